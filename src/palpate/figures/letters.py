"""Sentences broken into lines by the widths of their letters."""

import functools
import warnings


def wrapped(words: str, width: float, size: float, lines: int) -> str:
    """Break a sentence into lines of at most a width; what is left over becomes ….

    Parameters
    ----------
    words : str
        A sentence.
    width, size : float
        Of a line and of the letters, points.
    lines : int
        At most so many.
    """
    rows = [""]
    for word in words.split(" "):  # not at a no-break space, as split() would
        longer = f"{rows[-1]} {word}".strip()
        if width_of(longer, size) <= width:
            rows[-1] = longer
            continue
        pieces = _broken(word, width, size)
        rows = [*rows, *pieces] if rows[-1] else pieces
    if len(rows) <= lines:
        return "\n".join(rows)
    last = rows[lines - 1]
    while last and width_of(f"{last} …", size) > width:
        last = last[:-1]
    return "\n".join([*rows[: lines - 1], f"{last.rstrip(' ,;:')} …"])


def width_of(words: str, size: float) -> float:
    """Width of a line in letters of a size, points."""
    from matplotlib import rcParams

    return _width_in((*rcParams["font.family"], *rcParams["font.sans-serif"]), words, size)


@functools.lru_cache(4096)  # a page's figures share most of their words
def _width_in(fonts: tuple[str, ...], words: str, size: float) -> float:
    """Width of a line in the fonts that matplotlib is set to."""
    from matplotlib.font_manager import FontProperties
    from matplotlib.textpath import text_to_path

    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph .* missing from")  # it has some width
        found = text_to_path.get_text_width_height_descent(words, FontProperties(size=size), False)
    return float(found[0])


def _broken(word: str, width: float, size: float) -> list[str]:
    """A word, such as the name of a file, that is wider than a line, in pieces."""
    pieces = [""]
    for letter in word:
        if pieces[-1] and width_of(pieces[-1] + letter, size) > width:
            pieces.append("")
        pieces[-1] += letter
    return pieces
