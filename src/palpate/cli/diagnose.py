"""The command ``palpate diagnose``."""

from palpate.cli.options import Choosing, Judging
from palpate.cli.printing import AsJson, print_json
from palpate.cli.reading import Files, Reading


def diagnose(
    files: Files,
    /,
    *,
    choosing: Choosing = Choosing(),
    as_json: AsJson = False,
    judging: Judging = Judging(),
    reading: Reading = Reading(),
) -> int:
    """Say what may be wrong with a recording and its identification, and how far to trust it.

    For example:

        palpate diagnose ball.csv --at 3mm --fail-on do-not-trust

    Parameters
    ----------
    files
        A recording, or several contacts with one object, as for palpate identify.
    as_json
        Print one JSON object instead of a table.
    """
    from palpate.cli.tables import print_diagnosis
    from palpate.identifying import identify as run
    from palpate.results.description import described

    depth, kind = judging.depth, choosing.kind
    contact = reading.contact(files, choosing.options)
    settings = reading.settings(contact, kind) | choosing.settings
    result = run(contact, kind(**settings), trace=False)
    result = result if depth is None else result.at_depth(depth)
    if as_json:
        print_json(described(files, [result]))
    else:
        print_diagnosis(result)
    return judging.status([result.diagnosis.verdict])
