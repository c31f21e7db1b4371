"""The site: ``sphinx-build -W --keep-going docs build/site``, which needs no network.

The pages are written for a forge; what a site does otherwise with them is done while they are read:
chapters, pictures that follow the switch between light and dark, and links that leave ``docs``.
"""

import re
import shutil
import sys
from os.path import relpath
from pathlib import Path

from sphinx.application import Sphinx

import palpate

DOCS = Path(__file__).parent
ROOT = DOCS.parent
sys.path.insert(0, str(DOCS))

import api_pages  # noqa: E402 - it stands beside this file

project, author, copyright = "palpate", "The palpate developers", "The palpate developers"
version = release = palpate.__version__

extensions = ["myst_nb", "sphinx.ext.autodoc", "numpydoc", "sphinx_copybutton"]
exclude_patterns = ["README.md"]  # the forge's map of the pages
myst_heading_anchors = 4
suppress_warnings = ["misc.highlighting_failure"]  # a block of JSON may leave out what does not matter
smartquotes = False  # the two hyphens of an option stay two
# The tests run the notebooks and hold them to the outputs that they show.
nb_execution_mode = "off"
nb_ipywidgets_js = {}  # it would come from another site
autodoc_typehints = "none"
numpydoc_show_class_members = False
rst_prolog = ".. |v| replace:: \\|v\\|\n.. |v B/K| replace:: \\|v B/K\\|\n"

html_theme = "furo"
html_title = "palpate"
html_show_sourcelink = False
html_copy_source = False
html_static_path = ["site.css"]
html_css_files = ["site.css"]

#: The chapters, with their pages in the order in which they are read. Pages of the chapter's folder
#: that are not listed come last.
CHAPTERS = {
    "Start": ("start", ["start/first-answer", "start/which"]),
    "How-to": (
        "how-to",
        [
            "how-to/csv",
            "how-to/robot-log",
            "how-to/testing-machine",
            "how-to/afm",
            "how-to/robot-learning",
            "how-to/controller",
            "how-to/simulator",
            "how-to/lecturers",
            "how-to/map",
            "how-to/late-force",
            "how-to/payload",
            "how-to/do-not-trust",
            "how-to/many-contacts",
            "how-to/live",
            "how-to/motion",
            "how-to/figures",
        ],
    ),
    "Explain": (
        "explain",
        [
            "explain/marks",
            "explain/preparation",
            "explain/numbers",
            "explain/relaxation",
            "explain/default-method",
        ],
    ),
    "Reference": (
        "reference",
        [
            "reference/glossary",
            "reference/commands",
            "reference/api",
            "reference/findings",
            "reference/formats",
            "reference/files",
            "reference/results",
        ],
    ),
    "Gallery": ("notebooks", ["gallery"]),
    "Validation": ("validation", ["validation/README"]),
    "Contributing": ("contributing", ["contributing/README"]),
}
#: Pages that a table on another page lists.
LISTED = ("reference/api/", "reference/files/", "validation/")
#: What stands elsewhere in the checkout, and the page that it is on the site.
ELSEWHERE = {
    ROOT / "README.md": DOCS / "index.md",
    DOCS / "README.md": DOCS / "index.md",
    ROOT / "CONTRIBUTING.md": DOCS / "contributing" / "README.md",
    **{
        notebook: DOCS / "notebooks" / notebook.name
        for notebook in sorted((ROOT / "examples" / "notebooks").glob("*.ipynb"))
    },
}
WRITTEN = {page: source for source, page in ELSEWHERE.items() if source.suffix == ".ipynb"}
SHOWN_INSTEAD = {"contributing/README": ROOT / "CONTRIBUTING.md"}


def pages_in(folder: str) -> list[str]:
    """Return the names of the pages in a folder of ``docs``."""
    kinds = (".md", ".rst", ".ipynb")
    found = [path for path in (DOCS / folder).rglob("*") if path.suffix in kinds]
    return sorted(str(path.relative_to(DOCS).with_suffix("")) for path in found)


def chapters() -> str:
    """Return the hidden tables of contents from which the site makes its sidebar."""
    contents = []
    for caption, (folder, order) in CHAPTERS.items():
        there = [page for page in order if any(DOCS.glob(f"{page}.*"))]
        there += [page for page in pages_in(folder) if not page.startswith(LISTED)]
        lines = [f":caption: {caption}", "", *(f"/{page}" for page in dict.fromkeys(there))]
        contents += ["", "```{toctree}", ":hidden:", *lines, "```"]
    return "\n".join([*contents, ""])


PICTURE = re.compile(
    r'<picture>\s*<source[^>]*srcset="[^"]*">\s*<img src="(?P<light>[^"]*)" alt="(?P<alt>[^"]*)">\s*'
    r"</picture>|^!\[(?P<words>[^]]*)\]\((?P<path>[^)]*)\)$",
    re.MULTILINE,
)


def show_pictures(text: str, folder: Path) -> str:
    """Let pictures follow the site's switch; ``<picture>`` follows the system's, and is not copied."""

    def pair(found: re.Match[str]) -> str:
        light = Path(found["light"] or found["path"])
        dark = light.with_stem(f"{light.stem}-dark")
        if not (folder / dark).exists():
            return found[0]
        alt = " ".join((found["alt"] or found["words"]).split())
        return "\n".join(
            f":::{{image}} {path}\n:class: only-{kind}\n:alt: {alt}\n:::"
            for path, kind in ((light, "light"), (dark, "dark"))
        )

    return PICTURE.sub(pair, text)


LINK = re.compile(r"(?<!!)\[(?P<words>[^][]*)\]\((?P<path>[^)\s#:]+)(?P<anchor>#[^)\s]*)?\)")


def lead_to_pages(text: str, source: Path, page: Path) -> str:
    """Let the links of a source lead where they should from its page on the site.

    What has a page leads there. Any other file of the checkout can be downloaded; a folder cannot,
    and has its name only.
    """

    def link(found: re.Match[str]) -> str:
        target = (source.parent / found["path"]).resolve()
        if not target.exists():
            return found[0]
        if target.is_dir():
            return found["words"]
        target = ELSEWHERE.get(target, target)
        return f"[{found['words']}]({relpath(target, page.parent)}{found['anchor'] or ''})"

    return LINK.sub(link, text)


SCRIPT = re.compile(r"^.*\]\((?P<path>\.\./examples/gallery/\w+\.py)\)$", re.MULTILINE)


def adapt(app: Sphinx, name: str, source: list[str]) -> None:
    """Adapt a page of the forge to the site."""
    page = Path(app.env.doc2path(name))
    if page.suffix != ".md":
        return
    origin = SHOWN_INSTEAD.get(name, page)
    text = source[0] if origin == page else origin.read_text(encoding="utf-8")
    text = show_pictures(lead_to_pages(text, origin, page), page.parent)
    if name == "index":
        text += chapters()
    elif name == "gallery":
        text = SCRIPT.sub(r"\g<0>\n\n```{literalinclude} \g<path>\n```", text)
    elif name == "reference/api":
        text += api_pages.tables()
    source[0] = text


def write_pages(app: Sphinx) -> None:
    """Write the pages that the checkout does not have: notebooks, and the public names."""
    for page, notebook in WRITTEN.items():
        text = lead_to_pages(notebook.read_text(encoding="utf-8"), notebook, page)
        page.parent.mkdir(exist_ok=True)
        page.write_text(text, encoding="utf-8")
    folder = DOCS / "reference" / "api"
    shutil.rmtree(folder, ignore_errors=True)
    api_pages.write(folder)


def set_apart(app: Sphinx, doctree: object) -> None:
    """Keep tables of measurements out of the search, and pages that a table lists out of the sidebar.

    Sphinx makes the sidebar anew for every page: with these 200 it takes as long again as all else.
    """
    name = app.env.docname
    if name.startswith("validation/"):
        app.env.metadata[name]["nosearch"] = ""
    if name.startswith(LISTED):
        app.env.metadata[name]["orphan"] = ""


def setup(app: Sphinx) -> None:
    """Connect what is done while the pages are read."""
    app.connect("builder-inited", write_pages)
    app.connect("source-read", adapt)
    app.connect("doctree-read", set_apart)
