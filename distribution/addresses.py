"""The addresses that a release must state, each in the file that shows it.

    python distribution/addresses.py                                     which of them are empty
    python distribution/addresses.py REPOSITORY DOCUMENTATION EMAIL      write them

The checkout has none: who publishes it knows them. ``.ci/release`` stops while one is empty.
"""

import re
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
KINDS = ("repository", "documentation", "email")
#: File, what stands before the address and what behind it, and its kind.
FIELDS = (
    ("pyproject.toml", 'repository = "', '"', "repository"),
    ("pyproject.toml", 'documentation = "', '"', "documentation"),
    ("pyproject.toml", 'email = "', '"', "email"),
    ("CITATION.cff", 'repository-code: "', '"', "repository"),
    ("package.xml", '<maintainer email="', '"', "email"),
    ("package.xml", '<url type="repository">', "<", "repository"),
    ("distribution/vcpkg/vcpkg.json", '"homepage": "', '"', "repository"),
    ("distribution/conda/recipe.yaml", 'repository: "', '"', "repository"),
    ("distribution/conda/recipe.yaml", 'documentation: "', '"', "documentation"),
)


def _pattern(before: str, behind: str) -> re.Pattern[str]:
    return re.compile(f"(?<={re.escape(before)})[^{behind}]*(?={behind})")


def is_empty(address: str) -> bool:
    """Tell whether an address is missing; a package.xml cannot leave it out, and has localhost."""
    return not address or address.endswith("localhost")


def empty_fields() -> list[str]:
    """Return the fields that a release must still fill in, as ``file: field``."""
    missing = []
    for file, before, behind, kind in FIELDS:
        text = (ROOT / file).read_text(encoding="utf-8")
        address = _pattern(before, behind).search(text)
        if address is None or is_empty(address[0]):
            missing.append(f"{file}: {kind}")
    return missing


def fill(addresses: dict[str, str]) -> None:
    """Write the addresses, by their kinds, into every file that shows them."""
    for file, before, behind, kind in FIELDS:
        path = ROOT / file
        text = path.read_text(encoding="utf-8")
        path.write_text(_pattern(before, behind).sub(addresses[kind], text), encoding="utf-8")


if __name__ == "__main__":
    given = sys.argv[1:]
    if given and len(given) != len(KINDS):
        sys.exit(f"Give {', '.join(KINDS)}, or nothing")
    if given:
        fill(dict(zip(KINDS, given, strict=True)))
    if missing := empty_fields():
        sys.exit(
            f"A release needs {'; '.join(missing)}. "
            "Fill them in: python distribution/addresses.py REPOSITORY DOCUMENTATION EMAIL"
        )
