"""The command ``palpate explain``."""

from difflib import get_close_matches
from itertools import groupby

from palpate.cli.printing import Terminal, print_table, say, say_path
from palpate.errors import InvalidParameterError

_NO_MARKUP = dict.fromkeys(map(ord, "*`"))


def explain(*check: str) -> None:
    """Explain a finding: what happened, what it means for the numbers, what to do.

    Without an id, list all findings by subject.

    For example:

        palpate explain
        palpate explain clock offset

    Parameters
    ----------
    check
        Id of the finding, as palpate diagnose prints it.
    """
    from palpate.findings import Check  # here: it imports NumPy, which help does not need

    console = Terminal()
    if not check:
        for subject, checks in groupby(Check, lambda each: each.subject):
            rows = [
                (each.value, each.meaning.translate(_NO_MARKUP).partition("\n")[0])
                for each in checks
            ]
            headings = (subject, "what happened")
            print_table(console, headings, rows, prose=headings[1:])
            console.print()
        return
    by_anchor = {each.anchor: each for each in Check}
    typed = "-".join(check).lower().replace(" ", "-").replace("_", "-")
    found = by_anchor.get(typed)
    if found is None:
        near = " or ".join(get_close_matches(typed, by_anchor))
        advice = f"did you mean {near}?" if near else "palpate explain lists all"
        raise InvalidParameterError(f"no finding is called {typed!r}: {advice}")
    say(console, f"{found} ({found.subject})", "bold")
    for paragraph in found.meaning.translate(_NO_MARKUP).split("\n\n"):
        say(console, paragraph.replace("\n", " "))
    if found.link:
        say_path(console, found.link)
