"""What stays stable, as lines: public names of Python with their arguments, and of the headers.

``python tests/stable_names.py`` writes them to ``stable_names.txt``, after a change that is meant.
"""

import enum
import inspect
import re
from pathlib import Path

import palpate

PLACE = Path(__file__).with_suffix(".txt")
HEADERS = Path(__file__).parents[1] / "include" / "palpate"


def _argument(each):
    """One argument with its name, kind and default, as in a call; types may become wider."""
    mark = {each.VAR_POSITIONAL: "*", each.VAR_KEYWORD: "**"}.get(each.kind, "")
    default = "" if each.default is each.empty else f"={_default(each.default)}"
    return f"{mark}{each.name}{default}"


def _default(value):
    return value if isinstance(value, float | int | str | bool | None) else "…"


def signature(called):
    """The arguments of a function or class, with the star before those that need their names."""
    try:
        given = list(inspect.signature(called).parameters.values())
    except (TypeError, ValueError):  # a compiled class, or an exception's
        return ""
    words = [_argument(each) for each in given if each.name != "self"]
    by_name = [each for each in given if each.kind is each.KEYWORD_ONLY]
    if by_name and not any(each.kind is each.VAR_POSITIONAL for each in given):
        words.insert(words.index(_argument(by_name[0])), "*")
    return f"({', '.join(words)})"


def _members(kind):
    """Public methods and properties, inherited ones too."""
    for name in sorted(dir(kind)):
        owner = next((each for each in kind.__mro__ if name in vars(each)), object)
        if name.startswith("_") or not owner.__module__.startswith("palpate"):
            continue
        member = inspect.getattr_static(kind, name)
        plain = getattr(member, "__func__", member)
        yield name, signature(plain) if callable(plain) else ""


def python_names():
    """One line a name, and one a member of a class."""
    for name in sorted(palpate.__all__):
        value = getattr(palpate, name)
        if not callable(value):
            yield name
            continue
        yield f"{name}{signature(value)}"
        if inspect.isclass(value) and not issubclass(value, enum.Enum | Exception):
            yield from (f"{name}.{member}{words}" for member, words in _members(value))


def cpp_names():
    """Classes, aliases and concepts of the namespace ``palpate``, without those of ``detail``."""
    for path in sorted(HEADERS.rglob("*.hpp")):
        namespace = ""
        for line in path.read_text(encoding="utf-8").splitlines():
            if opened := re.match(r"namespace ([\w:]+) \{", line):
                namespace = opened[1]
            named = re.match(r"(?:class|struct|enum class|using|concept) (\w+)", line)
            if named and namespace == "palpate":
                yield f"palpate::{named[1]}"


def lines():
    """All names of Python, then all of C++."""
    return [*python_names(), *sorted(set(cpp_names()))]


if __name__ == "__main__":
    PLACE.write_text("\n".join(lines()) + "\n", encoding="utf-8")
