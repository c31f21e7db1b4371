"""What an index shows: the README with absolute links, and the project's addresses.

The build backend calls ``dynamic_metadata``, with the addresses of ``[[tool.dynamic-metadata]]`` in
``pyproject.toml``, which a release fills in. Without them the README stays as it is.
"""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

#: A link or a picture of Markdown, and an attribute of HTML, with a path in the project.
RELATIVE = re.compile(
    r"""(?P<before> \]\( | (?:src|srcset|href)=" )
        (?P<path> (?!https?:|mailto:|\#) [^)"\s]+ )""",
    re.VERBOSE,
)
PICTURES = (".svg", ".png", ".jpg", ".gif")


def with_absolute_links(text: str, repository: str, version: str) -> str:
    """Let every relative link of a page lead to the release's own files in the repository."""

    def absolute(link: re.Match[str]) -> str:
        kind = "raw" if link["path"].endswith(PICTURES) else "blob"
        return f"{link['before']}{repository}/{kind}/v{version}/{link['path']}"

    return RELATIVE.sub(absolute, text)


def dynamic_metadata(settings: Mapping[str, str], project: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields ``readme``, ``urls`` and ``authors`` of the project."""
    readme = Path("README.md").read_text(encoding="utf-8")
    repository = settings["repository"]
    urls = {}
    if repository:
        readme = with_absolute_links(readme, repository, project["version"])
        urls = {
            "Repository": repository,
            "Changelog": f"{repository}/blob/v{project['version']}/CHANGELOG.md",
            "Issues": f"{repository}/issues",
        }
    if settings["documentation"]:
        urls["Documentation"] = settings["documentation"]
    author = {"name": "The palpate developers"}
    if settings["email"]:
        author["email"] = settings["email"]
    return {
        "readme": {"content-type": "text/markdown", "text": readme},
        "urls": urls,
        "authors": [author],
    }
