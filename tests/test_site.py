"""The site: built once, without the network, and looked through for what a warning does not say."""

import html
import json
import re
import runpy
import subprocess
import sys
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

import palpate

ROOT = Path(__file__).parents[1]


def test_the_generated_reference_is_what_the_code_says():
    """After a change that is meant: ``python docs/write_reference.py``."""
    written = runpy.run_path(str(ROOT / "docs" / "write_reference.py"))
    for path, text in written["WRITERS"].items():
        assert text() == (ROOT / path).read_text(encoding="utf-8"), path


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    pytest.importorskip("sphinx")
    folder = tmp_path_factory.mktemp("site")
    words = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "docs", str(folder)]
    built = subprocess.run(words, cwd=ROOT, capture_output=True, text=True)
    assert (built.returncode, built.stderr) == (0, "")
    return folder


@pytest.fixture(scope="module")
def pages(site):
    return {path: path.read_text(encoding="utf-8") for path in site.rglob("*.html")}


ADDRESS = re.compile(r'\b(?P<kind>href|src|srcset)="(?P<address>[^"]*)"')


@pytest.mark.browser
def test_no_link_of_the_site_is_dead_and_no_page_loads_from_elsewhere(pages, site):
    anchors = {page: set(re.findall(r'\bid="([^"]+)"', text)) for page, text in pages.items()}
    dead = []
    for page, text in pages.items():
        for kind, address in ADDRESS.findall(text):
            parts = urlsplit(html.unescape(address))
            if parts.scheme or parts.netloc:
                if kind != "href" or re.search(r"\.(css|js|woff2?)\b", parts.path):
                    dead.append((page, address))
                continue
            target = (page.parent / unquote(parts.path)).resolve() if parts.path else page
            if not target.exists() or unquote(parts.fragment) not in {"", *anchors.get(target, ())}:
                dead.append((page, address))
    assert len(pages) > 200
    assert dead == []


@pytest.mark.browser
def test_the_site_has_a_page_for_each_public_name_and_shows_each_picture(pages, site):
    names = {page.stem for page in pages if page.is_relative_to(site / "reference" / "api")}
    assert {name for name in palpate.__all__ if callable(getattr(palpate, name))} <= names
    # What Markdown did not understand stands there as it was typed.
    typed = re.compile(r"```|:::|&lt;picture|\{\.only-|!\[")
    own = {page: text for page, text in pages.items() if "reference/api" not in str(page)}
    assert [page.name for page, text in own.items() if typed.search(_words(text))] == []


def _words(text: str) -> str:
    """The words of a page, without blocks of code."""
    return re.sub(r"<pre>.*?</pre>|<code.*?</code>|<script.*?</script>", "", text, flags=re.DOTALL)


@pytest.mark.browser
def test_the_search_finds_no_table_of_measurements(site):
    index = (site / "searchindex.js").read_text(encoding="utf-8")
    found = json.loads(index.removeprefix("Search.setIndex(").removesuffix(")"))
    measured = {k for k, name in enumerate(found["docnames"]) if name.startswith("validation/")}
    assert measured
    for words in (found["terms"], found["titleterms"]):
        for word, places in words.items():
            assert measured.isdisjoint(places if isinstance(places, list) else [places]), word
