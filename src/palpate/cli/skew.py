"""The command ``palpate skew``."""

from pathlib import Path
from typing import TYPE_CHECKING

from palpate.cli.printing import (
    STYLES,
    AsJson,
    Cell,
    Terminal,
    print_json,
    print_table,
    say,
    say_path,
)
from palpate.cli.reading import Files, ReadingOptions
from palpate.errors import InvalidParameterError

if TYPE_CHECKING:
    from palpate.identification.quantities.skew import Skew


def skew(
    files: Files,
    /,
    *,
    as_json: AsJson = False,
    reading: ReadingOptions = ReadingOptions(),
) -> None:
    """Measure how late the force is behind the position, from a touch of a steel spring.

    Press the spring with the rig of your recordings, without restarting it. Move back and forth in
    contact, slowly and then at least 3 times as quickly, such as 1 Hz and 4 Hz, for some periods
    each. Touch it again at the end and pass both files: clocks may move.

    For example:

        palpate skew spring.csv
        palpate skew spring-before.mcap spring-after.mcap --position /pose --force /ft

    Parameters
    ----------
    files
        A touch of the spring, or several.
    as_json
        Print one JSON object instead of text.
    """
    from palpate.identification.quantities.skew import skew as measure
    from palpate.validation import plain

    if reading.delay is not None:
        raise InvalidParameterError("palpate skew measures the delay: omit --delay")
    found = measure(*(reading.contact([file]) for file in files))
    if as_json:
        print_json({"option": f"--delay {found.option}", **plain(found.as_dict())})
        return
    _print(files, found)


def _print(files: tuple[Path, ...], found: "Skew") -> None:
    """Print the skew, the option that uses it, and how it was found."""
    from rich.text import Text

    from palpate.digits import percent, rounded
    from palpate.findings import spoken
    from palpate.identification.quantities.skew import describe_delay

    console = Terminal()
    say_path(console, ", ".join(file.name for file in files), "bold")
    slow, quick = (
        f"{describe_delay(each)} at {rounded(frequency, 2)} Hz"
        for each, frequency in zip(found.by_speed, found.frequencies, strict=True)
    )
    mark = Text(spoken(found.mark), STYLES[found.mark])
    rows: list[list[Cell]] = [
        ["skew", f"the force is {describe_delay(found.delay)}", mark],
        ["use", f"--delay {found.option}", ""],
        ["speeds", f"{slow}; {quick}", ""],
        ["friction", f"{percent(found.friction)} of the force", ""],
    ]
    if len(found.touches) > 1:
        each = "; ".join(describe_delay(touch.delay) for touch in found.touches)
        rows.append(["touches", each, ""])
    print_table(console, ["", "", ""], rows)
    holds = "for recordings made without restarting the rig"
    again = "" if found.touches else "; touch the spring again at the end and pass both files"
    say(console, f"{holds}{again}", "dim")
    if found.next_step:
        say(console, f"next: {found.next_step}")
