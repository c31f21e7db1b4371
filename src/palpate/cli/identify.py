"""The command ``palpate identify``."""

from typing import Annotated

from cyclopts import Parameter

from palpate.cli.deriving import Deriving
from palpate.cli.drawing import Drawing
from palpate.cli.judging import Judging
from palpate.cli.printing import AsJson
from palpate.cli.reading import Files, Reading
from palpate.cli.values import ResultFolder


def identify(
    files: Files,
    /,
    *,
    method: str = "variable-projection",
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
        palpate identify probing.mcap --position /pose --force /ft --tare find
        palpate identify touch.csv --unit penetration=mm --at 3mm --json

    Parameters
    ----------
    files
        A recording, or several contacts with one object; - is standard input. CSV, Parquet, HDF5,
        MATLAB, ROS bags, MCAP, force curves: palpate info FILE shows what is in it.
    method
        The estimator, such as single-stage; ``palpate compare`` shows them all.
    changes
        Identify each stretch between changes of the material by itself.
    output
        Write a report, the numbers, the trace and the options to this folder.
    as_json
        Print one JSON object instead of a table.
    """
    from functools import partial

    from palpate.cli.progress import counted
    from palpate.cli.tables import print_identifications
    from palpate.estimators import estimator_named
    from palpate.identification import compare
    from palpate.identification import identify as run

    reading, judging = reading or Reading(), judging or Judging()
    drawing = drawing or Drawing()
    deriving = deriving or Deriving()
    wanted = deriving.wanted
    depth, kind = judging.depth, estimator_named(method)
    drawing.check(list(files))
    folder = None
    if output is not None:
        from palpate.reports.saving import Destination

        folder = Destination(output, [file for file in files if str(file) != "-"])
    contact = reading.contact(files, method)
    result = run(contact, kind(**reading.settings(contact, kind)))
    result = result.wanting(wanted)
    result = result if depth is None else result.at_depth(depth)
    result = result.by_stretch() if changes else result
    if not changes and contact.prepared is not None and contact.prepared.places:
        result = result.by_place(partial(counted, words="identifying each place"))
    drawing.save("draw", result, list(files))
    if folder is not None:
        folder.save(
            result,
            options={
                "method": method,
                **({"changes": True} if changes else {}),
                **judging.options,
                **deriving.options,
                **reading.options,
            },
            compared=compare(
                contact,
                gate=reading.gate(contact),
                outlier_rejection=None if reading.reject_outliers else False,
                watch=partial(counted, words="comparing with every method"),
            ),
        )
    print_identifications(files, [result], drawing.figure, as_json=as_json, folder=output)
    return judging.status([result.diagnosis.verdict])
