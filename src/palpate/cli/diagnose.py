"""The command ``palpate diagnose``."""

from palpate.cli.choosing import Choosing
from palpate.cli.judging import Judging
from palpate.cli.printing import AsJson
from palpate.cli.reading import Files, Reading


def diagnose(
    files: Files,
    /,
    *,
    law: str | None = None,
    method: str | None = None,
    as_json: AsJson = False,
    judging: Judging | None = None,
    reading: Reading | None = None,
) -> int:
    """Say what may be wrong with a recording and its identification, and how far to trust it.

    For example:

        palpate diagnose ball.csv --at 3mm --fail-on do-not-trust

    Parameters
    ----------
    files
        A recording, or several contacts with one object, as for palpate identify.
    law
        The law: auto, the everyday one that explains the samples best; any, the best of all; or
        one, such as half-space, flat or half-space+single; Hunt-Crossley's unless given.
    method
        The estimator, such as single-stage; the usual one of the law unless given.
    as_json
        Print one JSON object instead of a table.
    """
    from palpate.cli.printing import print_json
    from palpate.cli.verdicts import print_diagnosis
    from palpate.identifying import identify as run
    from palpate.results.description import described

    reading, judging = reading or Reading(), judging or Judging()
    choosing = Choosing(law, method)
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
