"""The command ``palpate lab``."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Group, Parameter

from palpate.cli.options import OutputFile, names_in
from palpate.cli.printing import Terminal, bar, say, say_path
from palpate.errors import InvalidParameterError
from palpate.writing import check_marked, check_outputs, is_standard_output

if TYPE_CHECKING:
    from palpate.lab import Bench, Material, Measurement, Probe, Trajectory

_MATERIALS = names_in("palpate.lab.MATERIALS", "palpate.force_laws.FORCE_LAWS")
#: The begin of the files that it writes, and may replace.
_MADE = "# made by: palpate lab;"
_TRAJECTORIES = names_in("palpate.lab.TRAJECTORIES")


@Parameter(name="*", group=Group("The probe and the sensors", sort_key=1.5))
@dataclass(frozen=True)
class Instruments:
    """The robot and the sensors."""

    probe: Literal["twin-pantograph", "ideal"] = "twin-pantograph"
    "twin-pantograph (needs the extra lab), or ideal: a tip that follows the command exactly."
    noise: float = 0.05
    "Standard deviation of the force noise, N; 0 for none."
    resolution: float = 0.125
    "Quantisation step of the force, N; 0 for none."
    bias: float = 0.5
    "Standard deviation of the force sensor's unknown bias, N; 0 for none."
    counts: float = 20_000.0
    "Encoder counts per turn; 0 for exact encoders."


def lab(
    material: Annotated[str, Parameter(completer=_MATERIALS)],
    /,
    *,
    output: OutputFile,
    trajectory: Annotated[str, Parameter(completer=_TRAJECTORIES)] = "three-sines",
    seconds: float = 10.0,
    seed: int = 0,
    picture: Path | None = None,
    instruments: Instruments = Instruments(),
    **law: list[float],
) -> None:
    """Simulate a touch of a material with known parameters, and write the recording.

    The same seed gives the same file.

    For example:

        palpate lab ball -o ball.csv
        palpate lab hunt-crossley --K 2000 --B 2000 --n 1.3 -o own.csv
        palpate lab tissue --seconds 30 -o tissue.csv
        palpate lab ball-in-mujoco/scene.xml --probe ideal -o again.csv

    Parameters
    ----------
    material
        ball, sponge, pvc, inclusion, tissue, relaxing-sponge, soft-and-hard or soft-and-bar (by
        lateral position) or soft-then-hard (by time); or a force law, such as hunt-crossley, with
        its parameters as options; or a MuJoCo scene from palpate export.
    output
        CSV file to write; the true parameters are in the comments above its header.
    trajectory
        three-sines, two-sines, one-sine, near-surface, palpation or tapping; or a CSV file with
        columns time_s and penetration_m.
    seconds
        Duration of the recording, including the pause of 2 s.
    seed
        Random seed of noise, bias and encoder phases.
    picture
        Draw the rig in contact with the material into this file (.png, .svg or .pdf).
    law
        Parameters of the force law by name, SI: --K, --B, --n and so on. For
        generalised-hunt-crossley with memory, --M and --longest-time give one
        relaxation time; add --shortest-time for a flat relaxation spectrum, and
        --spectrum-exponent for a power law. Any spectrum: --relaxation-times and
        --relaxation-stiffnesses, each repeated for every relaxation time.
    """
    from palpate import lab as laboratory
    from palpate.input.recordings.table_files import write_contact

    check_outputs([output, picture] if picture else [output])
    check_marked(output, _MADE)
    ideal = instruments.probe == "ideal"
    probe: Probe = laboratory.IdealProbe()
    if not ideal:
        probe = laboratory.TwinPantograph(counts_per_turn=instruments.counts)
    sensors = laboratory.Sensors(
        force_noise=instruments.noise,
        force_resolution=instruments.resolution,
        force_bias=instruments.bias,
    )
    bench = laboratory.Bench(_material(material, law), _trajectory(trajectory), probe, sensors)
    if picture is not None:
        from palpate.output.figures import check_figure

        check_figure(picture)
        if ideal:
            raise InvalidParameterError("--picture needs a robot: use --probe twin-pantograph")
    with bar(f"simulating a touch of {bench.material.name}") as progress:
        measurement = bench.run(
            seed,
            seconds=seconds,
            progress=lambda reached: progress(reached / seconds),
        )
    write_contact(measurement.contact, output, notes=_versions(bench))
    # The summary must not mix with a recording that goes to standard output.
    console = Terminal(stderr=is_standard_output(output))
    _print(measurement, output, console)
    if picture is not None:
        from palpate.lab.figures import save_rig

        say_path(console, f"picture, {save_rig(bench, picture)}: {picture}")


def _material(name: str, numbers: dict[str, list[float]]) -> "Material":
    from palpate.force_laws import FORCE_LAWS, law_from
    from palpate.force_laws.relaxation import LISTS
    from palpate.lab import MATERIALS, Homogeneous
    from palpate.validation import check_choice

    lists = {key.replace("-", "_"): value for key, value in numbers.items()}
    if several := [key for key in lists if key not in LISTS and len(lists[key]) > 1]:
        raise InvalidParameterError(f"{_option(several[0])} takes one number")
    given = {key: value if key in LISTS else value[0] for key, value in lists.items()}
    if name in MATERIALS:
        for parameter in given:
            raise InvalidParameterError(
                f"{_option(parameter)} has no effect on {name}, whose parameters are fixed: "
                "use a force law instead, such as hunt-crossley"
            )
        return MATERIALS[name]
    if Path(name).suffix == ".xml":
        from palpate.exports.mujoco.robot import Scene

        return Scene(name)
    if name not in FORCE_LAWS:
        check_choice("MATERIAL", name, [*MATERIALS, *FORCE_LAWS])
    return Homogeneous(law_from({"kind": name, **given}, _option), name)


def _option(name: str) -> str:
    return f"--{name.replace('_', '-')}"


def _trajectory(name: str) -> "Trajectory":
    from palpate.lab import TRAJECTORIES, SplineTrajectory

    if name in TRAJECTORIES:
        return TRAJECTORIES[name]
    if Path(name).suffix:
        return SplineTrajectory.read(name)
    raise InvalidParameterError(
        f"--trajectory must be one of {', '.join(TRAJECTORIES)}, or a CSV file, not {name!r}"
    )


def _versions(bench: "Bench") -> dict[str, str]:
    from importlib.metadata import version

    from palpate import __version__
    from palpate.lab import TwinPantograph

    names = ["numpy"] + ["mujoco"] * isinstance(bench.probe, TwinPantograph)
    versions = [f"palpate {__version__}", *(f"{name} {version(name)}" for name in names)]
    return {"made by": f"palpate lab; {', '.join(versions)}"}


def _print(measurement: "Measurement", output: Path, console: Terminal) -> None:
    contact = measurement.contact
    truth = measurement.truth
    say(console, f"{contact.source}: {len(contact)} samples, {contact.time[-1]:.3f} s")
    say_path(console, f"truth: {contact.provenance['truth']}")
    say(
        console,
        f"peak penetration {1e3 * truth.penetration.max():.2f} mm, peak speed "
        f"{1e3 * abs(truth.velocity).max():.1f} mm/s, peak force {truth.force.max():.2f} N",
    )
    say_path(console, f"recording: {output}")
