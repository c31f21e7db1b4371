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
from palpate.output.figures.style import recolour_for_dark

DOCS = Path(__file__).resolve().parent
ROOT = DOCS.parent
sys.path.insert(0, str(DOCS))

import api_pages  # noqa: E402 - it stands beside this file

project, author, copyright = "palpate", "The palpate developers", "The palpate developers"
version = release = palpate.__version__

extensions = ["myst_nb", "sphinx.ext.autodoc", "numpydoc", "sphinx_copybutton"]
exclude_patterns = ["README.md"]  # the forge's map of the pages
myst_enable_extensions = ["attrs_inline"]
myst_heading_anchors = 4
# A block of JSON may leave out what does not matter.
suppress_warnings = ["misc.highlighting_failure"]
smartquotes = False  # the two hyphens of an option stay two
# The tests run the notebooks and hold them to the outputs that they show.
nb_execution_mode = "off"
nb_ipywidgets_js = {}  # it would come from another site
autodoc_typehints = "none"
numpydoc_show_class_members = False
# In a docstring |v| is an absolute value, not a substitution.
rst_prolog = ".. |v| replace:: \\|v\\|\n.. |v B/K| replace:: \\|v B/K\\|\n"

html_theme = "furo"
pygments_dark_style = "github-dark"
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
            "how-to/gains",
            "how-to/simulator",
            "how-to/contact-force",
            "how-to/solref",
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


PICTURE = re.compile(r"<picture>.*?</picture>|<img\b[^>]*>|!\[[^]]*\]\([^)\s]+\)", re.DOTALL)
ATTRIBUTE = re.compile(r'(\w+)="([^"]*)"')


def show_pictures(text: str, page: Path) -> str:
    """Show each picture once for light and once for dark pages: the site's switch chooses.

    ``<picture>`` would follow the system's, and Sphinx copies no file that HTML names.
    """

    def pair(found: re.Match[str]) -> str:
        tag = found[0][found[0].find("<img") :]
        attributes = dict(ATTRIBUTE.findall(tag)) if tag.startswith("<img") else {}
        words, _, path = found[0][2:-1].partition("](")
        light = Path(attributes.get("src", path))
        alt = " ".join(attributes.get("alt", words).split())
        size = f" width={attributes['width']}" if "width" in attributes else ""
        dark = dark_twin(page.parent / light)
        if dark is None:
            return f"![{alt}]({light}){{{size}}}" if attributes else found[0]
        shown = (light, "light"), (relpath(dark, page.parent), "dark")
        return "".join(f"![{alt}]({each}){{.only-{kind}{size}}}" for each, kind in shown)

    return PICTURE.sub(pair, text)


def dark_twin(light: Path) -> Path | None:
    """Return the picture for dark pages: the one beside, or a figure of palpate recoloured."""
    beside = light.with_stem(f"{light.stem}-dark")
    if beside.exists() or light.suffix != ".svg" or not light.is_relative_to(DOCS):
        return beside if beside.exists() else None
    dark = DOCS / "dark" / light.resolve().relative_to(DOCS)
    dark.parent.mkdir(parents=True, exist_ok=True)
    dark.write_text(recolour_for_dark(light.read_text(encoding="utf-8")), encoding="utf-8")
    return dark


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
    text = show_pictures(lead_to_pages(text, origin, page), page)
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
    """Keep measurements out of the search, and pages that a table lists out of the sidebar.

    Sphinx makes the sidebar anew for every page: with these 200 the build takes twice as long.
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
