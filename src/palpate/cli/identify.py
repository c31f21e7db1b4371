"""The command ``palpate identify``."""

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from palpate.cli.choosing import Choosing
from palpate.cli.deriving import Deriving
from palpate.cli.drawing import Drawing
from palpate.cli.judging import Judging
from palpate.cli.printing import AsJson
from palpate.cli.reading import Files, Reading
from palpate.cli.values import ResultFolder

if TYPE_CHECKING:
    from palpate.contact import Contact
    from palpate.identifying import Identification
    from palpate.reports.saving import Destination


def identify(
    files: Files,
    /,
    *,
    law: str | None = None,
    method: str | None = None,
    changes: Annotated[bool, Parameter(negative="")] = False,
    output: ResultFolder = None,
    as_json: AsJson = False,
    drawing: Drawing | None = None,
    judging: Judging | None = None,
    deriving: Deriving | None = None,
    reading: Reading | None = None,
) -> int:
    """Identify the contact model of a recording.

    For example:

        palpate identify ball.csv --figure ball.pdf
        palpate identify sponge.csv --law auto --frequency 2Hz
        palpate identify probing.mcap --position /pose --force /ft --tare find
        palpate identify touch.csv --unit penetration=mm --at 3mm --json

    Parameters
    ----------
    files
        A recording, or several contacts with one object; - is standard input. CSV, Parquet, HDF5,
        MATLAB, ROS bags, MCAP, force curves: palpate info FILE shows what is in it.
    law
        The law: auto, the everyday one that explains the samples best; any, the best of all; or
        one, such as half-space, flat or half-space+single; Hunt-Crossley's unless given.
    method
        The estimator, such as single-stage; the usual one of the law unless given.
    changes
        Identify each stretch between changes of the material by itself.
    output
        Write a report, the numbers, the trace and the options to this folder.
    as_json
        Print one JSON object instead of a table.
    """
    from palpate.cli.tables import print_identifications
    from palpate.identifying import identify as run

    reading, judging = reading or Reading(), judging or Judging()
    deriving, drawing = deriving or Deriving(), drawing or Drawing()
    choosing = Choosing(law, method)
    wanted, depth, kind = deriving.wanted, judging.depth, choosing.kind
    drawing.check(list(files))
    destination = _destination(output, files)
    contact = reading.contact(files, choosing.options)
    settings = reading.settings(contact, kind) | choosing.settings
    result = run(contact, kind(**settings)).wanting(wanted)
    if result.wanted.frequency is not None:  # refused before anything is written
        result.dynamic_stiffness(result.wanted.frequency)
    result = _in_parts(result if depth is None else result.at_depth(depth), changes=changes)
    drawing.save("draw", result, list(files))
    if destination is not None:
        options = {**choosing.options, **({"changes": True} if changes else {})}
        options |= {**judging.options, **deriving.options, **reading.options}
        destination.save(result, options=options, compared=_compared(contact, reading))
    print_identifications(files, [result], drawing.figure, as_json=as_json, folder=output)
    return judging.status([result.diagnosis.verdict])


def _destination(output: Path | None, files: Files) -> "Destination | None":
    """Where the result goes, once it is known that it can be written there."""
    if output is None:
        return None
    from palpate.reports.saving import Destination

    return Destination(output, [file for file in files if str(file) != "-"])


def _in_parts(result: "Identification", *, changes: bool) -> "Identification":
    """With each stretch between changes by itself, or each place of a probe that travels."""
    from palpate.cli.progress import counted

    if changes:
        return result.by_stretch()
    prepared = result.contact.prepared
    if prepared is not None and prepared.places:
        return result.by_place(partial(counted, words="identifying each place"))
    return result


def _compared(contact: "Contact", reading: Reading) -> "dict[str, Identification]":
    """Every method on the same samples, for the report."""
    from palpate.cli.progress import counted
    from palpate.identifying import compare

    return compare(
        contact,
        gate=reading.gate(contact),
        outlier_rejection=None if reading.reject_outliers else False,
        exponent=reading.exponent,
        watch=partial(counted, words="comparing with every method"),
    )
