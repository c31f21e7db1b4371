"""The command ``palpate info``."""

from pathlib import Path

from palpate.cli.options import Dark, FigureFile
from palpate.cli.printing import AsJson, opened, print_json


def info(
    file: Path,
    /,
    *,
    channel: tuple[str, ...] = (),
    curve: int | None = None,
    figure: FigureFile = None,
    dark: Dark = False,
    as_json: AsJson = False,
) -> None:
    """Say what a recording holds: channels, units, clocks with rates and gaps, ranges.

    For example:

        palpate info probing.mcap --channel /ft --figure strips.pdf

    Parameters
    ----------
    file
        Any recording: text, Parquet, Feather, HDF5, MATLAB, or a force curve; - is standard input.
    channel
        Look at these only: a channel, or a topic or group with all below it; may be repeated.
    curve
        Which curve, from 0, of a file that holds many.
    figure
        Draw a strip chart of each channel to this file (.svg, .pdf or .png).
    dark
        Draw on a dark background.
    as_json
        Print one JSON object instead of tables.
    """
    from palpate.cli.info_tables import as_dict, print_recording
    from palpate.recordings.survey import survey

    if figure is not None:
        from palpate.figures import check_figure

        check_figure(figure, inputs=[file])
    recording = opened(file, channel or None, strict=False, curve=curve)
    surveyed = survey(recording)
    if figure is not None:
        from palpate import figures
        from palpate.figures.strips import draw_strips

        figures.save(draw_strips(recording, surveyed, dark=dark), figure, inputs=[file])
    if as_json:
        print_json(as_dict(file, recording, surveyed))
    else:
        print_recording(recording, surveyed)
        if figure is not None:
            print(f"figure: {figure}")
