"""The command ``palpate diagnose``."""

from pathlib import Path

from palpate.cli.judging import Judging
from palpate.cli.printing import AsJson
from palpate.cli.reading import Reading


def diagnose(
    file: Path,
    /,
    *,
    method: str = "variable-projection",
    as_json: AsJson = False,
    judging: Judging | None = None,
    reading: Reading | None = None,
) -> int:
    """Say what may be wrong with a recording and its identification, and how far to trust it.

    Parameters
    ----------
    file
        CSV with a header and, unless named otherwise, columns time_s, penetration_m, force_N and
        optionally velocity_m_s and segment.
    method
        The estimator, such as single-stage.
    as_json
        Print one JSON object instead of a table.
    """
    from palpate.cli.printing import print_json
    from palpate.cli.tables import as_dict
    from palpate.cli.verdicts import print_diagnosis
    from palpate.estimators import estimator_named
    from palpate.identification import identify as run

    reading, judging = reading or Reading(), judging or Judging()
    depth, kind = judging.depth, estimator_named(method)
    contact = reading.contact(file)
    result = run(contact, kind(**reading.settings(contact, kind)))
    result = result if depth is None else result.at_depth(depth)
    if as_json:
        print_json(as_dict(file, [result]))
    else:
        print_diagnosis(result)
    return judging.status([result.diagnosis.verdict])
