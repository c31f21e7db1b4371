"""The command ``palpate diagnose``."""

from palpate.cli.judging import Judging
from palpate.cli.printing import AsJson
from palpate.cli.reading import Files, Reading


def diagnose(
    files: Files,
    /,
    *,
    method: str = "variable-projection",
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
    method
        The estimator, such as single-stage.
    as_json
        Print one JSON object instead of a table.
    """
    from palpate.cli.printing import print_json
    from palpate.cli.verdicts import print_diagnosis
    from palpate.estimators import estimator_named
    from palpate.identifying import identify as run
    from palpate.results.description import described

    reading, judging = reading or Reading(), judging or Judging()
    depth, kind = judging.depth, estimator_named(method)
    contact = reading.contact(files, method)
    result = run(contact, kind(**reading.settings(contact, kind)), trace=False)
    result = result if depth is None else result.at_depth(depth)
    if as_json:
        print_json(described(files, [result]))
    else:
        print_diagnosis(result)
    return judging.status([result.diagnosis.verdict])
