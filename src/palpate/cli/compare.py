"""The command ``palpate compare``."""

from palpate.cli.options import Drawing, Judging
from palpate.cli.printing import AsJson
from palpate.cli.reading import Files, Reading
from palpate.errors import InvalidParameterError


def compare(
    files: Files,
    /,
    *,
    as_json: AsJson = False,
    drawing: Drawing = Drawing(),
    judging: Judging = Judging(),
    reading: Reading = Reading(),
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

    depth = judging.depth
    if reading.surface == "estimate":
        raise InvalidParameterError(
            "--surface estimate is for one method that can: palpate identify"
        )
    drawing.check(list(files))
    contact = reading.contact(files)
    results = reading.compared(contact)
    if depth is not None:
        results = {name: result.at_depth(depth) for name, result in results.items()}
    drawing.save("palpate.figures.draw_comparison", results, list(files))
    print_identifications(files, list(results.values()), drawing.figure, as_json=as_json)
    return judging.status([result.diagnosis.verdict for result in results.values()])
