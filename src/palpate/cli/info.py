"""The command ``palpate info``."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from palpate.cli.options import Dark, FigureFile, MaxSize
from palpate.cli.printing import AsJson, Terminal, open_with_progress, print_json, say_path


def info(
    file: Path,
    /,
    *,
    companion: Annotated[Path | None, Parameter("--with", metavar="FILE")] = None,
    channel: tuple[str, ...] = (),
    curve: int | None = None,
    episode: int | None = None,
    sheet: str | None = None,
    header_row: int | None = None,
    max_size: MaxSize = None,
    figure: FigureFile = None,
    dark: Dark = False,
    as_json: AsJson = False,
) -> None:
    """Show the contents of a recording: channels, units, clocks with rates and gaps, ranges.

    Of a force map, without --curve, show its curves.

    For example:

        palpate info probing.mcap --channel /ft --figure strips.pdf
        palpate info demonstrations/ --episode 3

    Parameters
    ----------
    file
        Recording: text, spreadsheet, array, JSON, MCAP, bag, Parquet, HDF5, MATLAB, force curve or
        data set; - is standard input.
    companion
        Second file of one contact, as for palpate identify: show both on one clock.
    channel
        Only this channel, or all channels of this topic or group; may be repeated.
    curve
        Index, from 0, of the curve to read in a file with several.
    episode
        Number of the episode to show of a data set (default: its episodes, channels of the first).
    sheet
        Name, or number from 1, of the sheet to read in a spreadsheet.
    header_row
        Line of the column names in a text (default: above the largest block of numbers).
    max_size
        Largest size of the data in memory, such as 8GB (default: 4 GiB).
    figure
        Draw a strip chart of each channel into this file (.svg, .pdf or .png).
    dark
        Draw on a dark background.
    as_json
        Print one JSON object instead of tables.
    """
    from palpate.cli.info_tables import as_dict, print_curves, print_episodes, print_recording
    from palpate.input.channels.roles import explain_roles
    from palpate.input.recordings.datasets import describe_data_set
    from palpate.input.recordings.opening import MAPS
    from palpate.input.recordings.survey import survey

    if curve is None and file.name.lower().endswith(MAPS):
        return print_curves(file, max_size, as_json=as_json)
    if figure is not None:
        from palpate.output.figures import check_figure

        check_figure(figure)
    data = None if episode is not None else describe_data_set(file, max_size)
    if data is not None:
        episode = next(iter(data.lengths))
    options = {"curve": curve, "episode": episode, "sheet": sheet, "header_row": header_row}
    recording = open_with_progress(file, channel or None, max_size=max_size, **options)
    if companion is not None:
        from palpate.input.preparation.clock_offset import align
        from palpate.input.preparation.preparing import prepare_contact
        from palpate.input.preparation.settings import Preparation

        second = open_with_progress(companion, None, max_size=max_size)
        recording, _ = align(recording, second, Preparation(), prepare_contact)
    uses, refusal = explain_roles(recording)
    surveyed = survey(recording, next((n for n, (role, _) in uses.items() if role == "time"), None))
    if figure is not None:
        from palpate.output import figures
        from palpate.output.figures.strips import draw_strips

        figures.save(draw_strips(recording, surveyed, dark=dark), figure)
    if as_json:
        print_json(as_dict(file, recording, surveyed, uses, refusal, data))
    else:
        if data is not None:
            print_episodes(data)
        print_recording(recording, surveyed, uses, refusal)
        if figure is not None:
            say_path(Terminal(), f"figure: {figure}")
