"""The pages of the public names: one a name, and a table of them by subject.

A page's title is the bare name, which a phone can show in one line. Classes and functions stand in
folders of their own, as ``Skew`` and ``skew`` are one file name to some systems.
"""

import inspect
import re
import sys
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

import palpate

# palpate offers figures as a name; autodoc looks for a module.
sys.modules["palpate.figures"] = palpate.figures

#: Subject, and the packages of palpate whose public names it has.
SUBJECTS = {
    "Identify": ("identifying", "fleet.arrays", "output", "control_loops"),
    "Recordings and contacts": ("input", "method.contact"),
    "Force laws": ("force_laws",),
    "Estimators": ("method.estimators", "method.settings", "_core"),
    "Marks and numbers": ("identification", "findings"),
    "Errors and headers": ("errors", "_headers"),
}
#: Public modules, and their names; where none are listed, all that the module offers.
MODULES: dict[str, tuple[str, ...]] = {
    "figures": (),
    "lab": (),
    "lab.design": ("Motion", "design"),
    "exports": (),
    "control_loops": (),
    "control_loops.figures": ("draw_gains",),
    "fleet.files": ("read_results",),
    "fleet.running": ("identify_batch",),
    "fleet.tasks": ("Settings",),
    "fleet.maps": ("map_of",),
    "fleet.figures": ("draw_map",),
    "live": ("run",),
    "live.sources": ("SourceOptions", "open_source"),
    "live.recorder": ("Recorder",),
    "live.page": ("Page",),
    "live.zeromq": ("packed",),
}
_FOREIGN = "object, tuple, int, str, Enum, IntEnum, Exception, ValueError, RuntimeError, KeyError"


def write(folder: Path) -> None:
    """Write the page of each name."""
    for module, name, value in _all_names():
        if not callable(value):
            continue
        page = folder / f"{_page(module, name, value)}.rst"
        page.parent.mkdir(parents=True, exist_ok=True)
        page.write_text(_text(module, name, value), encoding="utf-8")


def tables() -> str:
    """Return the public names by subject, each with what it is, in Markdown."""
    subjects: dict[str, list[str]] = {subject: [] for subject in SUBJECTS}
    subjects |= {f"`palpate.{module}`": [] for module in MODULES}
    constants: dict[str, list[str]] = {subject: [] for subject in subjects}
    for module, name, value in _all_names():
        subject = f"`palpate.{module}`" if module else _subject(value)
        if callable(value):
            link = f"[{name}](api/{_page(module, name, value)}.rst)"
            subjects[subject].append(f"| {link} | {_first_sentence(value)} |")
        elif module:
            constants[subject].append(f"`{name}`")
    parts = []
    for subject, rows in subjects.items():
        parts.append("\n".join([f"\n## {subject}\n", "| name | |", "|---|---|", *rows, ""]))
        if constants[subject]:
            parts.append(f"\nConstants: {', '.join(constants[subject])}.\n")
    return "".join(parts)


def _all_names() -> Iterator[tuple[str, str, object]]:
    """Yield module, name and value of everything public; no module is palpate itself."""
    for name in palpate.__all__:
        yield "", name, getattr(palpate, name)
    for module, names in MODULES.items():
        loaded = import_module(_place(module))
        for name in names or [each for each in vars(loaded) if not each.startswith("_")]:
            value = getattr(loaded, name)
            if not inspect.ismodule(value):
                yield module, name, value


def _place(module: str) -> str:
    return f"palpate.{module}" if module else "palpate"


def _subject(value: object) -> str:
    """The subject of the package in which a name stands; a longer one is the more exact."""
    home = getattr(value, "__module__", "") + "."
    packages = {package: subject for subject, each in SUBJECTS.items() for package in each}
    for package in sorted(packages, key=len, reverse=True):
        if home.startswith(f"palpate.{package}."):
            return packages[package]
    return next(iter(SUBJECTS))


def _page(module: str, name: str, value: object) -> str:
    """The page of a name, in the folder ``reference/api``."""
    folder = "classes" if inspect.isclass(value) else "functions"
    return f"{folder}/{f'{module}.' if module else ''}{name}"


def _text(module: str, name: str, value: object) -> str:
    """The page of a name, which autodoc fills."""
    shown = f"{module}.{name}" if module else name
    lines = [shown, "=" * len(shown), "", f".. currentmodule:: {_place(module)}", ""]
    if inspect.isclass(value):
        members = ["   :members:", f"   :inherited-members: {_FOREIGN}"]
        lines += [f".. autoclass:: {name}", *members, ""]
    else:
        lines += [f".. autofunction:: {name}", ""]
    lines += ["All names: :doc:`Python </reference/api>`.", ""]
    return "\n".join(lines)


def _first_sentence(value: object) -> str:
    """What a name is, for a cell of a table."""
    paragraph = (inspect.getdoc(value) or "").partition("\n\n")[0]
    sentence = " ".join(paragraph.split()).partition(". ")[0].rstrip(".")
    plain = sentence.replace("|", "\\|").replace("``", "`")
    return re.sub(r":\w+:`~?([^`]*)`", r"`\1`", plain) + "."
