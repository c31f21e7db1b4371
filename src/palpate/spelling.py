"""The two spellings of what a command and a function take: ``--delay 5ms``, ``delay=0.005``.

palpate writes its advice with the options of ``palpate identify``. Whoever calls it from Python
gets the arguments instead.
"""

import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager

_SIZES = {
    "m": 1.0, "mm": 1e-3, "um": 1e-6, "nm": 1e-9, "s": 1.0, "ms": 1e-3, "us": 1e-6,
    "N": 1.0, "mN": 1e-3, "kg": 1.0, "g": 1e-3, "Hz": 1.0, "": 1.0,
}  # fmt: skip
_NUMBER = re.compile(r"(-?\d+\.?\d*(?:e-?\d+)?)([a-zA-Z]*)")


def _number(text: str) -> str:
    found = _NUMBER.fullmatch(text)
    return repr(text) if found is None else f"{float(found[1]) * _SIZES.get(found[2], 1.0):.6g}"


def _numbers(text: str) -> str:
    """Several numbers, as of ``0:2``, ``14ms+-0.2ms`` or ``3mm,0,140mm``."""
    parts = re.split(r"\+-|[,:]", text)
    return _number(text) if len(parts) == 1 else f"({', '.join(map(_number, parts))})"


def _pairs(text: str) -> str:
    pairs = (each.partition("=") for each in text.split(","))
    return f"{{{', '.join(f'{name!r}: {unit!r}' for name, _, unit in pairs)}}}"


def _text(text: str) -> str:
    return repr(text.strip("'"))


#: Each option: the argument, "{}" for its value, and how the value is spelled. Options that are not
#: here have no argument: they belong to a command, such as ``palpate fleet``.
ARGUMENTS: Mapping[str, tuple[str, Callable[[str], str]]] = {
    **{
        name: (f"{name.replace('-', '_')}={{}}", _numbers)
        for name in (
            "velocity-window", "delay", "tare", "surface", "tool-weight", "mass", "rate", "spot",
            "tip-offset", "exponent", "curve", "header-row", "episode", "max-size", "time-step",
            "tip-radius", "max-depth", "max-speed", "sensitivity", "spring-constant",
        )
    },
    **{
        name: (f"{name.replace('-', '_')}={{}}", _text)
        for name in ("law", "method", "normal", "force-frame", "form", "geom", "model", "sheet")
    },
    **{
        name: (f"columns=Columns({name.replace('-', '_')}={{}})", _text)
        for name in (
            "time", "penetration", "position", "force", "velocity", "orientation",
            "orientation-form", "torque",
        )
    },
    "unit": ("units={}", _pairs),
    "start": ("window=({}, None)", _number),
    "stop": ("window=(None, {})", _number),
    "at": ("depth={}", _number),
    "min-penetration": ("gate=ContactGate({}, 0, 0)", _number),
    "min-force": ("gate=ContactGate(0, {0}, {0})", _number),
    "with": ("companion={}", _text),
    "payload": ("payload={}", _text),
    "tip": ("tip={}", _text),
}  # fmt: skip
#: Options without a value.
FLAGS: Mapping[str, str] = {
    "flip-force": "flip=['force']",
    "flip-penetration": "flip=['penetration']",
    "no-time": "no_time=True",
    "strict": "strict=True",
    "no-reject-outliers": "outlier_rejection=False",
    "no-weak-prior": "weak_prior=False",
    "changes": "identify(…).by_segment()",
    "hold-out": "check_hold_out",
}

# Words that follow an option in a sentence and are not its value.
_GRAMMAR = (
    "(?:a|and|excludes|finds|for|gives|has|if|into|is|needs|of|or|such|then|to|which|with|without)"
)
_OPTION = re.compile(
    rf"(?<![\w-])--([a-z][a-z-]*)(?:[ =]((?!{_GRAMMAR}\b|-)('[^']*'|[^\s;]*[^\s;,.:)])))?"
)

_commanded = False


@contextmanager
def options_in_advice() -> Iterator[None]:
    """Spell advice with the options of a command within this context, as the command line does."""
    global _commanded
    before = _commanded
    _commanded = True
    try:
        yield
    finally:
        _commanded = before


def spell_advice(text: str) -> str:
    """Return a sentence that names options, with the arguments of functions unless commanded."""
    return text if _commanded else _OPTION.sub(_as_argument, text)


def _as_argument(found: re.Match[str]) -> str:
    name = found[1]
    value = found[2]
    rest = "" if value is None else found[0][len(name) + 2 :]
    if name in FLAGS:
        return FLAGS[name] + rest
    if name not in ARGUMENTS:
        return found[0]
    argument, spelled = ARGUMENTS[name]
    if value is None and argument.endswith("={}"):
        return argument.removesuffix("={}")
    return argument.format(spelled(value) if value else "…")
