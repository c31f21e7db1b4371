"""The command ``palpate compare``."""

from palpate.cli.judging import Judging
from palpate.cli.printing import AsJson
from palpate.cli.reading import Files, Reading
from palpate.cli.values import Dark, FigureFile, FigureWidth


def compare(
    files: Files,
    /,
    *,
    figure: FigureFile = None,
    dark: Dark = False,
    width: FigureWidth = None,
    as_json: AsJson = False,
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
    figure
        Draw it to this file (.svg, .pdf or .png).
    dark
        Draw on a dark background.
    width
        Width of the figure as it is printed, 60mm to 400mm: a journal's column is 88mm.
    as_json
        Print one JSON object instead of a table.
    """
    from palpate.cli.quantities import figure_width
    from palpate.cli.tables import print_identifications
    from palpate.errors import InvalidParameterError
    from palpate.identification import compare as run

    reading, judging = reading or Reading(), judging or Judging()
    depth = judging.depth
    if reading.surface == "estimate":
        raise InvalidParameterError(
            "--surface estimate is for one method that can: palpate identify"
        )
    wide = figure_width(width, figure)
    if figure is not None:
        from palpate.figures import check_figure

        check_figure(figure, inputs=list(files))
    contact = reading.contact(files)
    results = run(
        contact,
        gate=reading.gate(contact),
        outlier_rejection=None if reading.reject_outliers else False,
    )
    if depth is not None:
        results = {name: result.at_depth(depth) for name, result in results.items()}
    if figure is not None:
        from palpate import figures

        figures.save(
            figures.draw_comparison(results, dark=dark, width=wide), figure, inputs=list(files)
        )
    print_identifications(files, list(results.values()), figure, as_json=as_json)
    return judging.status([result.diagnosis.verdict for result in results.values()])
