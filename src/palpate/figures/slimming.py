"""Drawings without what nobody sees: a page holds two of every figure."""

import re
import zlib
from functools import lru_cache


def slim(svg: str) -> str:
    """Return matplotlib's SVG, looking the same to a tenth of a point, at about half its size."""
    svg = re.sub(r"<!--.*?-->", "", svg, flags=re.DOTALL)
    svg = re.sub(r'<g id="[^"]*"', "<g", svg)  # what is referred to is a path or a clipping path
    svg = re.sub(r' d="([^"]*)"', _path, _ungrouped(svg))
    svg = re.sub(r' (x|y)="[^"]*"', lambda place: _cut(place[0], 2), svg)
    return re.sub(r"\s*\n\s*", "\n", _styles_named(svg))


def _path(found: re.Match[str]) -> str:
    """Give each place of straight lines by the step to it, in whole tenths so that none adds up."""
    places = _cut(found[1], 1)
    if not re.fullmatch(r"[MLz\d\s.-]*", places):
        return f' d="{places}"'
    here = start = (0, 0)
    written = ""
    for command, numbers in re.findall(r"([MLz])([^MLz]*)", places):
        tenths = [round(10.0 * float(number)) for number in numbers.split()]
        steps = []
        for place in zip(tenths[::2], tenths[1::2], strict=True):
            steps += [_step(new - old) for new, old in zip(place, here, strict=True)]
            here = place
        if command == "M":
            start = here
        elif command == "z":
            here = start
        # More places after a move are lines.
        letter = {"M": "m", "L": " ", "z": "z"}[command]
        written += letter + " ".join(steps)
    return f' d="{written.replace(" -", "-")}"'


# Most steps of a curve are among a few hundred.
@lru_cache(maxsize=4096)
def _step(tenths: int) -> str:
    return re.sub(r"^(-?)0\.", r"\1.", f"{tenths / 10:g}")


def _ungrouped(svg: str) -> str:
    """Leave out groups that say nothing of what they hold."""
    said: list[bool] = []

    def kept(tag: re.Match[str]) -> str:
        if tag[0].endswith("/>"):
            return ""  # it holds nothing
        if tag[0] != "</g>":
            said.append(tag[0] != "<g>")
            return tag[0] if said[-1] else ""
        return tag[0] if said.pop() else ""

    return re.sub(r"<g\b[^>]*>|</g>", kept, svg)


def _cut(text: str, digits: int) -> str:
    return re.sub(rf"(\.\d{{{digits}}})\d+", r"\1", text)


def _styles_named(svg: str) -> str:
    """Give each style a class: matplotlib repeats it at every tick.

    Its name depends on the style alone: drawings that stand in one page may share their classes.
    """
    names: dict[str, str] = {}

    def named(style: re.Match[str]) -> str:
        name = f"s{zlib.crc32(style[1].encode('utf-8'))}"
        return f' class="{names.setdefault(style[1], name)}"'

    svg = re.sub(r' style="([^"]*)"', named, svg)
    rules = "".join(f".{name}{{{style}}}" for style, name in names.items())
    return svg.replace("</style>", f"{rules}</style>", 1)
