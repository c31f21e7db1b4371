"""The commands ``palpate identify``, ``diagnose`` and ``compare``."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Annotated, TypeVar

from cyclopts import Parameter

from palpate.cli.options import (
    OUTPUT,
    FigureOptions,
    Flag,
    MethodOptions,
    QuantityOptions,
    ResultFolder,
    VerdictOptions,
)
from palpate.cli.printing import (
    AsJson,
    bar,
    print_caption,
    print_diagnosis,
    print_hold_out,
    print_identifications,
    print_json,
    print_panels,
)
from palpate.cli.reading import Files, ReadingOptions
from palpate.errors import InvalidParameterError

if TYPE_CHECKING:
    from palpate.identification.quantities.elastic_modulus import Tip
    from palpate.identifying import Identification
    from palpate.method.contact import Contact
    from palpate.method.estimators import ContactEstimator


Item = TypeVar("Item")


def identify(
    files: Files,
    /,
    *,
    choosing: MethodOptions = MethodOptions(),
    changes: Flag = False,
    hold_out: Flag = False,
    output: ResultFolder | None = None,
    as_json: AsJson = False,
    drawing: FigureOptions = FigureOptions(),
    panels: Annotated[str | None, Parameter(group=OUTPUT, metavar="PANELS")] = None,
    judging: VerdictOptions = VerdictOptions(),
    deriving: QuantityOptions = QuantityOptions(),
    reading: ReadingOptions = ReadingOptions(),
) -> int:
    """Identify the contact model of a recording.

    It prints stiffness and damping at the working depth and the motion's frequency, ± one standard
    error, each with a mark. trust: the standard error, all causes together, is at most 10 %
    (damping 20 %). do not trust: it is more than 25 % (damping 60 %), or the recording has a fault.

    For example:

        palpate identify ball.csv --figure ball.pdf
        palpate identify sponge.csv --frequency 2Hz
        palpate identify probing.mcap --position /pose --force /ft --tare find
        palpate identify touch.csv --unit penetration=mm --at 3mm --json

    Parameters
    ----------
    files
        A recording, or several of one object; - is standard input. CSV, XLSX, NumPy, JSON,
        Parquet, HDF5, MATLAB, ROS bags, MCAP, force curves: palpate info FILE shows what is in it.
    changes
        Identify each segment between changes of the material separately.
    hold_out
        Predict the second half from the first, and compare with plain Hunt–Crossley.
    output
        Write report, numbers, trace and options to this folder.
    panels
        Panels of the figure, such as loop,residual, or all; help lists them.
    as_json
        Print one JSON object instead of text.
    """
    if panels == "help":
        print_panels()
        return 0
    from palpate.identifying import identify as run

    query = deriving.query
    depth = judging.depth
    names = _panel_names(panels, drawing)
    destination = None
    if output is not None:  # once it is known that it can be written there
        from palpate.output.reports.identification import Destination

        destination = Destination(output, [file for file in files if str(file) != "-"])
    choosing.check()
    contact = reading.contact(files, choosing.options, tip=query.tip)
    if query.tip is not None:
        from palpate.identification.quantities.indentation import find_force_curve

        power_law = not query.tip.thinness(1.0)
        if power_law and find_force_curve(contact) is not None:
            reading = replace(reading, exponent=query.tip.exponent)
    choosing, estimator = _estimator(contact, choosing, reading)
    if query.tip is None:
        query = replace(query, tip=_find_stated_tip(contact))
    result = run(contact, estimator).with_query(query)
    if result.query.frequency is not None:  # refused before anything is written
        result.dynamic_stiffness(result.query.frequency)
    if hold_out:
        result = result.hold_out()
    result = _identify_parts(result if depth is None else result.at_depth(depth), changes=changes)
    drawing.save("palpate.output.figures.draw", result, names)
    if destination is not None:
        options = {**choosing.options, **({"changes": True} if changes else {})}
        options |= {**judging.options, **deriving.options, **reading.options}
        watch = partial(_show_progress, text="comparing with every method")
        compared = reading.compared(contact, watch=watch, known=result)
        destination.save(result, options=options, compared=compared)
    print_identifications(files, [result], drawing.figure, as_json=as_json, folder=output)
    if not as_json:
        _print_beside(result, drawing, names, hold_out=hold_out)
    asked = query.frequency is not None or query.impact_speed is not None
    return judging.status([result.diagnosis.verdict], damping=asked)


def _panel_names(panels: str | None, drawing: FigureOptions) -> list[str] | None:
    """Return the names of the panels, once it is known that the figure can be drawn."""
    drawing.check()
    if panels is None:
        return None
    if drawing.figure is None:
        raise InvalidParameterError("--panels needs a figure: pass --figure FILE too")
    return [name.strip() for name in panels.split(",")]


def _print_beside(
    result: "Identification", drawing: FigureOptions, panels: list[str] | None, *, hold_out: bool
) -> None:
    """Print what belongs to an answer only on request: a caption, and a forecast of one half."""
    from palpate.findings import Check

    if drawing.is_plain:
        print_caption(result, panels)
    for finding in result.findings if hold_out else ():
        if finding.check == Check.HOLD_OUT:
            print_hold_out(finding)


def _estimator(
    contact: "Contact",
    choosing: MethodOptions,
    reading: ReadingOptions,
) -> "tuple[MethodOptions, ContactEstimator]":
    """The estimator that the options request, and the options that name it."""
    choosing = reading.choose_default_law(choosing, timeless=contact.timeless)
    kind = choosing.kind
    return choosing, kind(**reading.settings(contact, kind) | choosing.settings)


def _find_stated_tip(contact: "Contact") -> "Tip | None":
    """The ball on the probe, if the recording states its radius."""
    prepared = contact.prepared
    radius = None if prepared is None else prepared.recording.settings.get("tip radius")
    if radius is None:
        return None
    from palpate.identification.quantities.elastic_modulus import Sphere

    return Sphere(radius)


def _identify_parts(result: "Identification", *, changes: bool) -> "Identification":
    """Identify each segment between changes, or each place of a travelling probe, separately."""
    if changes:
        return result.by_segment()
    prepared = result.contact.prepared
    if prepared is not None and prepared.places:
        return result.by_place(partial(_show_progress, text="identifying each place"))
    return result


def _show_progress(items: Sequence[Item], text: str) -> Iterable[Item]:
    """Go through items, with a bar."""
    with bar(text) as progress:
        for k, item in enumerate(items):
            yield item
            progress(k + 1, len(items))


# The command ``palpate diagnose``.


def diagnose(
    files: Files,
    /,
    *,
    choosing: MethodOptions = MethodOptions(),
    as_json: AsJson = False,
    judging: VerdictOptions = VerdictOptions(),
    reading: ReadingOptions = ReadingOptions(),
) -> int:
    """Check a recording and its identification: every finding, with the next step.

    For example:

        palpate diagnose ball.csv --at 3mm --fail-on do-not-trust

    Parameters
    ----------
    files
        A recording, or several of one object, as for palpate identify.
    as_json
        Print one JSON object instead of text.
    """
    from palpate.identifying import identify as run
    from palpate.output.results.saved import describe_contact

    depth = judging.depth
    contact = reading.contact(files, choosing.options)
    result = run(contact, _estimator(contact, choosing, reading)[1], trace=False)
    result = result if depth is None else result.at_depth(depth)
    if as_json:
        print_json(describe_contact(files, [result]))
    else:
        print_diagnosis(result)
    return judging.status([result.diagnosis.verdict])


# The command ``palpate compare``.


def compare(
    files: Files,
    /,
    *,
    as_json: AsJson = False,
    drawing: FigureOptions = FigureOptions(),
    judging: VerdictOptions = VerdictOptions(),
    reading: ReadingOptions = ReadingOptions(),
) -> int:
    """Identify a recording with every method, side by side.

    For example:

        palpate compare ball.csv --figure methods.pdf

    Parameters
    ----------
    files
        A recording, or several of one object, as for palpate identify.
    as_json
        Print one JSON object instead of text.
    """
    depth = judging.depth
    if reading.surface == "estimate":
        raise InvalidParameterError(
            "--surface estimate works with palpate identify only: pass --surface fit here"
        )
    drawing.check()
    contact = reading.contact(files)
    results = reading.compared(contact)
    if depth is not None:
        results = {name: result.at_depth(depth) for name, result in results.items()}
    drawing.save("palpate.output.figures.draw_comparison", results)
    print_identifications(files, list(results.values()), drawing.figure, as_json=as_json)
    return judging.status([result.diagnosis.verdict for result in results.values()])
