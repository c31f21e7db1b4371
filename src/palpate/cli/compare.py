"""The command ``palpate compare``."""

from palpate.cli.drawing import Drawing
from palpate.cli.judging import Judging
from palpate.cli.printing import AsJson
from palpate.cli.reading import Files, Reading


def compare(
    files: Files,
    /,
    *,
    as_json: AsJson = False,
    drawing: Drawing | None = None,
    judging: Judging | None = None,
    reading: Reading | None = None,
) -> int:
    """Identify a recording with every method, side by side.

    For example:

        palpate compare ball.csv --figure methods.pdf

    Parameters
    ----------
    files
        A recording, or several contacts with one object, as for palpate identify.
    as_json
        Print one JSON object instead of a table.
    """
    from palpate.cli.tables import print_identifications
    from palpate.errors import InvalidParameterError
    from palpate.identifying import compare as run

    reading, judging = reading or Reading(), judging or Judging()
    drawing = drawing or Drawing()
    depth = judging.depth
    if reading.surface == "estimate":
        raise InvalidParameterError(
            "--surface estimate is for one method that can: palpate identify"
        )
    drawing.check(list(files))
    contact = reading.contact(files)
    results = run(
        contact,
        gate=reading.gate(contact),
        outlier_rejection=None if reading.reject_outliers else False,
        exponent=reading.exponent,
    )
    if depth is not None:
        results = {name: result.at_depth(depth) for name, result in results.items()}
    drawing.save("draw_comparison", results, list(files))
    print_identifications(files, list(results.values()), drawing.figure, as_json=as_json)
    return judging.status([result.diagnosis.verdict for result in results.values()])
