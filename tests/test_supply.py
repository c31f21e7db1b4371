"""What palpate is built from and needs: licences of its dependencies, and the lock of its tools."""

import re
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

from packaging.requirements import Requirement

ROOT = Path(__file__).parents[1]
#: Licences of packages that anybody may pass on together with palpate, changed or not.
PERMISSIVE = re.compile(r"MIT|BSD|Apache|PSF|Python Software|License agreement for matplotlib|ISC|"
                        r"Zlib|CC0|any-OSI", re.I)  # fmt: skip
#: Others, which NOTICE names, with the extra that installs them.
OTHERS = {"igor2": "afm"}
OWN_USE = {"test", "develop", "peers", "browser", "docs"}  # extras that no user installs


def _plain(name):
    return re.sub(r"[-_.]+", "-", name).lower()


def _needed(name, extras, known):
    """Add the installed packages that one needs, and what these need, to ``known``."""
    for line in distribution(name).requires or ():
        required = Requirement(line)
        wanted = required.marker is None or any(
            required.marker.evaluate({"extra": extra}) for extra in ("", *extras)
        )
        key = _plain(required.name), frozenset(required.extras)
        if not wanted or key in known:
            continue
        try:
            known[key] = distribution(required.name).metadata
        except PackageNotFoundError:
            continue
        _needed(required.name, required.extras, known)


def _licence(metadata):
    classifiers = [each for each in metadata.get_all("Classifier") or () if "License ::" in each]
    first = (metadata.get("License") or "").strip().partition("\n")[0]
    return metadata.get("License-Expression") or "; ".join(classifiers) or first


def test_every_required_package_is_redistributable():
    known = {}
    extras = set(distribution("palpate").metadata.get_all("Provides-Extra")) - OWN_USE
    _needed("palpate", extras, known)
    licences = {name: _licence(metadata) for (name, _), metadata in known.items()}
    assert {"numpy", "rich", "cyclopts"} <= licences.keys()
    others = {name: words for name, words in licences.items() if not PERMISSIVE.search(words)}
    assert others.keys() <= OTHERS.keys(), others
    notice = (ROOT / "NOTICE").read_text("utf-8")
    assert all(name in notice and f'"{extra}"' in notice for name, extra in OTHERS.items())


def test_release_tools_are_installed_by_hash():
    lock = (ROOT / ".ci/release.txt").read_text("utf-8")
    locked = re.findall(r"^([\w.-]+)==[^\\]+\\\n((?:    --hash=sha256:[0-9a-f]{64}(?: \\)?\n?)+)",
                        lock, re.M)  # fmt: skip
    assert len(locked) == len(re.findall(r"^\S", lock, re.M))
    assert "://" not in lock
    named = re.findall(r"^[\w-]+$", (ROOT / ".ci/release.in").read_text("utf-8"), re.M)
    assert set(named) <= {name for name, _ in locked}
    for place in (".ci/release", ".github/workflows/wheels.yml"):
        text = (ROOT / place).read_text("utf-8")
        lines = re.findall(r"^.*pip\"? install .*$", text, re.M)
        assert lines
        assert all("--require-hashes -r .ci/release.txt" in x or "$wheel" in x for x in lines)
        assert "pipx" not in text
