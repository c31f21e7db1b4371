"""The command ``palpate lab``."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Group, Parameter

from palpate.cli.options import OutputFile, names_in
from palpate.cli.printing import Terminal, bar, say, say_path
from palpate.errors import InvalidParameterError
from palpate.writing import check_outputs, is_standard_output

if TYPE_CHECKING:
    from palpate.lab import Bench, Material, Measurement, Probe, Trajectory

_MATERIALS = names_in("palpate.lab.MATERIALS", "palpate.force_laws.FORCE_LAWS")
_TRAJECTORIES = names_in("palpate.lab.TRAJECTORIES")


@Parameter(name="*", group=Group("The probe and the sensors", sort_key=1.5))
@dataclass(frozen=True)
class Instruments:
    """What carries the probe, and what measures."""

    probe: Literal["twin-pantograph", "ideal"] = "twin-pantograph"
    "twin-pantograph (needs the extra lab), or ideal: a tip that is where the command says."
    noise: float = 0.05
    "Standard deviation of the force, N; 0 switches it off."
    resolution: float = 0.125
    "Step that the force is rounded to, N; 0 for none."
    bias: float = 0.5
    "Standard deviation of the force sensor's unknown bias, N; 0 for none."
    counts: float = 20_000.0
    "Counts a turn of the robot's encoders; 0 for encoders without steps."


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
    **law: float,
) -> None:
    """Press a material of known truth, and write the recording.

    The same seed gives the same file.

    For example:

        palpate lab ball -o ball.csv
        palpate lab hunt-crossley --stiffness 2000 --damping 2000 --exponent 1.3 -o own.csv
        palpate lab tissue --seconds 30 -o tissue.csv
        palpate lab ball-in-mujoco/scene.xml --probe ideal -o again.csv

    Parameters
    ----------
    material
        ball, sponge, pvc, inclusion, tissue, relaxing-sponge, soft-and-hard (by lateral position)
        or soft-then-hard (by time); or a force law, such as hunt-crossley, with parameters of one's
        own; or a scene of MuJoCo that palpate export wrote.
    output
        CSV to write; the truth stands in the notes above its header.
    trajectory
        three-sines, two-sines, one-sine, near-surface, palpation or tapping; or a CSV file with
        columns time_s and penetration_m.
    seconds
        Length of the recording, the pause of 2 s included.
    seed
        Of noise, bias and encoder phases.
    picture
        Draw the rig as it presses the material to this file (.png, .svg or .pdf).
    law
        Parameters of a law of one's own by their names, SI: --stiffness, --damping, --exponent and
        so on. The memory of generalised-hunt-crossley has --relaxation-stiffness and --longest-time
        for one relaxation time; --shortest-time too for a flat spectrum; --spectrum-exponent too
        for a power law.
    """
    from palpate import lab as laboratory
    from palpate.recordings import write_contact

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
        from palpate.figures import check_figure

        check_figure(picture)
        if ideal:
            raise InvalidParameterError("--picture shows the robot; an ideal probe has none")
    inputs = [] if trajectory in laboratory.TRAJECTORIES else [Path(trajectory)]
    inputs += [Path(material)] if _is_scene(material) else []
    check_outputs([output, picture] if picture else [output], inputs)
    with bar(f"pressing {bench.material.name}") as progress:
        measurement = bench.run(
            seed, seconds=seconds, progress=lambda reached: progress(reached / seconds)
        )
    write_contact(measurement.contact, output, notes=_versions(bench))
    # A recording that goes on into a pipe is not mixed with words about it.
    console = Terminal(stderr=is_standard_output(output))
    _print(measurement, output, console)
    if picture is not None:
        from palpate.lab.figures import save_rig

        say_path(console, f"picture, {save_rig(bench, picture)}: {picture}")


def _material(name: str, given: dict[str, float]) -> "Material":
    from palpate.force_laws import FORCE_LAWS, law_from
    from palpate.lab import MATERIALS, Homogeneous
    from palpate.validation import one_of

    given = {key.replace("-", "_"): value for key, value in given.items()}
    if name in MATERIALS:
        if given:
            raise InvalidParameterError(
                f"{_options([*given][:1])} goes with a law of one's own, such as hunt-crossley; "
                f"{name} has its own parameters"
            )
        return MATERIALS[name]
    if _is_scene(name):
        from palpate.exports.mujoco.robot import Scene

        return Scene(name)
    one_of("MATERIAL", name, [*MATERIALS, *FORCE_LAWS])
    law = FORCE_LAWS[name]
    needed = [each for each in law.names() if each not in law.optional]
    if not set(needed) <= set(given) <= set(law.names()):
        words = f"{name} needs {_options(needed)}"
        words += f", may have {_options(law.optional)}" if law.optional else ""
        raise InvalidParameterError(f"{words}, and no others")
    return Homogeneous(law_from({"kind": name, **given}), name)


def _is_scene(name: str) -> bool:
    return Path(name).suffix == ".xml"


def _options(names: Iterable[str]) -> str:
    return ", ".join(f"--{name.replace('_', '-')}" for name in names)


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
    contact, truth = measurement.contact, measurement.truth
    say(console, f"{contact.source}: {len(contact)} samples, {contact.time[-1]:.3f} s")
    say_path(console, f"truth: {contact.provenance['truth']}")
    say(
        console,
        f"peak penetration {1e3 * truth.penetration.max():.2f} mm, fastest "
        f"{1e3 * abs(truth.velocity).max():.1f} mm/s, peak force {truth.force.max():.2f} N",
    )
    say_path(console, f"recording: {output}")
