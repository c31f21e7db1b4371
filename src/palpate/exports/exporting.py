"""A law on its way into an engine and back: fitted, judged, written down; and pressed again."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

from palpate.errors import ExportRefusedError, InvalidParameterError, MissingExtraError
from palpate.exports.engine import Engine, ExportRequest, Fragment, ProbeMotion, engine_called
from palpate.exports.statement import Exportable, ExportedLaw, Statement, compared
from palpate.lab.materials import Touch
from palpate.validation import Floats, number_in
from palpate.writing import (
    as_json,
    check_own,
    check_writable,
    encoded,
    make_folder,
    write_text,
)

STATEMENT = ("statement.json", "statement.md")


@dataclass(frozen=True, slots=True, eq=False)
class Export:
    """A law in an engine's numbers, and how far that is from it.

    Attributes
    ----------
    statement : Statement
        In words and numbers: exact, or within so much, replayed or predicted.
    fragment : Fragment
        What the engine will do with it.
    files : mapping of str to str
        Text by file name: the first is what is to be pasted, ``scene`` the smallest that runs.
    """

    statement: Statement
    fragment: Fragment = field(repr=False)
    files: Mapping[str, str] = field(repr=False)

    def __str__(self) -> str:
        return "\n".join(self.statement.describe())

    def save(self, folder: str | Path, *, inputs: Sequence[Path] = ()) -> list[Path]:
        """Write fragment, scene and statement to a folder, each whole or not at all.

        Parameters
        ----------
        folder : str or Path
            It is made where it is not there.
        inputs : sequence of Path
            Files that must not be written over.

        Raises
        ------
        RecordingError
            It cannot be made or written to, or one of the files would replace an input, or a file
            that no export wrote or that was changed since.
        """
        return save_statement(self.statement, Path(folder), inputs, self.files)


def export(
    result: Exportable,
    to: str,
    *,
    mass: float | None = None,
    model: str | Path | None = None,
    geom: str | None = None,
    form: str = "auto",
    tip_radius: float | None = None,
    time_step: float | None = None,
    allow: bool = False,
    replay: bool = True,
) -> Export:
    """Return a law in the numbers of a simulation engine, with its error.

    Parameters
    ----------
    result : Identification, SavedResult or ForceLaw
        What was identified: the engine is replayed on the motion recorded. A law alone has no
        recording and no verdict; the paper's motion stands in.
    to : str
        The engine: see :func:`engines`.
    mass : float, optional
        Of the body that presses, as the contact feels it, kg, in (0, 1e6].
    model : str or Path, optional
        A model of the engine's, in place of the mass: what its contact feels is taken from it.
    geom : str, optional
        The geom in the model that touches.
    form : str
        Which of the engine's ways; the best for the law unless given.
    tip_radius : float, optional
        Of a round tip, m, in (0, 1], where the engine's law has it.
    time_step : float, optional
        Of the simulation, s, in (0, 1]; 0 where the engine can do without, as Drake can. 1 ms
        unless given; a model has its own.
    allow : bool
        Export what would be refused; the fragment says so.
    replay : bool
        Ask the real engine, where it is installed; else its error is predicted.

    Raises
    ------
    ExportRefusedError
        The diagnosis does not trust the result, or the engine is off by more than 5 % of force,
        or another reason; ``allow`` exports it all the same.
    InvalidParameterError
        An argument is out of its range, or the engine lacks one.
    """
    engine = engine_called(to)
    source = ExportedLaw.of(result)
    nearest = source.nearest()
    radius = source.tip_radius if tip_radius is None else tip_radius
    if radius is not None:
        number_in("tip_radius", radius, 0.0, 1.0, open_low=True)
    step = 1e-3 if time_step is None else time_step
    request = ExportRequest(
        law=nearest.law,
        motion=source.motion,
        mass=None if mass is None else number_in("mass", mass, 0.0, 1e6, open_low=True),
        model=None if model is None else Path(model),
        geom=geom,
        tip_radius=radius,
        time_step=number_in("time_step", step, 0.0, 1.0, open_low=not engine.continuous),
        form=form,
    )
    if model is not None and time_step is not None:
        raise InvalidParameterError("give time_step or model: a model has a time step of its own")
    _check(engine, request, given_radius=tip_radius is not None)
    fragment = engine.fit(request)
    found = compared(source, nearest, fragment, replay=replay and engine.version() is not None)
    statement = Statement(source, nearest, engine, fragment, found, allow)
    if statement.refused:
        raise ExportRefusedError(f"{engine.title}: {statement.claim}", statement)
    return Export(statement, fragment, fragment.files(statement.notes()))


def _check(engine: Engine, request: ExportRequest, *, given_radius: bool) -> None:
    """Refuse what the engine can do nothing with, rather than ignore it."""
    if request.form != "auto" and request.form not in engine.forms:
        known = ", ".join(["auto", *engine.forms])
        raise InvalidParameterError(
            f"form must be one of {known} for {engine.name}, not {request.form!r}"
        )
    if request.model is not None and request.mass is not None:
        raise InvalidParameterError("give mass or model: what the contact feels is taken from one")
    if request.geom is not None and request.model is None and "geom" in engine.takes:
        raise InvalidParameterError("geom names one of a model: give that too, as --model FILE")
    given = {"model": request.model, "geom": request.geom, "tip_radius": given_radius or None}
    for name, value in given.items():
        if value is not None and name not in engine.takes:
            raise InvalidParameterError(f"{name} means nothing to {engine.title}: leave it out")


def save_statement(
    statement: Statement, folder: Path, inputs: Sequence[Path], files: Mapping[str, str]
) -> list[Path]:
    """Write a statement and the files that it is about; none where nothing was exported."""
    make_folder(folder)
    earlier = _earlier(folder)
    made = {*files, *STATEMENT}
    left = [name for name in earlier if name not in made and (folder / name).is_file()]
    texts = _written(statement, files, earlier, left)
    paths = [folder / name for name in texts]
    for path in paths:
        check_writable(path, inputs)

    def own(path: Path) -> bool:
        if path.name == STATEMENT[0] and earlier:
            return True
        found = sha256(path.read_bytes()).hexdigest()
        # Or as it is to be: an export that was interrupted has no statement.
        return found in (earlier.get(path.name), _digest(texts[path.name]))

    check_own(folder, texts, own)
    for path, text in zip(paths, texts.values(), strict=True):
        write_text(path, text, inputs)
    return paths


def _earlier(folder: Path) -> dict[str, str]:
    """SHA-256 of earlier exports' files in a folder by their names, as their statement says."""
    try:
        found = json.loads((folder / STATEMENT[0]).read_bytes())["sha256"]
        return {str(name): str(digest) for name, digest in found.items()}
    except (OSError, ValueError, LookupError, TypeError, AttributeError):
        return {}


def _digest(text: str) -> str:
    return sha256(encoded(text)).hexdigest()


def _written(
    statement: Statement, files: Mapping[str, str], earlier: Mapping[str, str], left: Sequence[str]
) -> dict[str, str]:
    """All files, of which the statement's own two come last."""
    title = f"# {statement.source.name or 'A law'} in {statement.engine.title}"
    listed = [f"- `{name}`" for name in files] or ["Nothing was exported."]
    if left:
        listed.append(f"\nOf an earlier export, and not of this one: {', '.join(left)}.")
    page = "\n\n".join([title, *statement.describe(), "\n".join(listed)])
    number, words = STATEMENT
    texts = {**files, words: page + "\n"}
    digests = {name: _digest(text) for name, text in texts.items()}
    digests |= {name: earlier[name] for name in left}
    whole = {**statement.as_dict(), "files": list(files), "left": list(left), "sha256": digests}
    return {**texts, number: as_json(whole)}


# An exported fragment, for the laboratory to press: the engine's force in place of a law's.


class InAnEngine:
    """A material of the laboratory whose force an engine works out, state by state.

    Parameters
    ----------
    name : str
        What a person calls it.
    pushed : callable
        Force of the engine [N] at the states of a motion below the surface, shape (k,).
    truth : dict
        What a recording says of it, SI.
    """

    def __init__(
        self, name: str, pushed: Callable[[ProbeMotion], Floats], truth: dict[str, Any]
    ) -> None:
        self.name, self._pushed, self._truth = name, pushed, truth

    def describe(self) -> dict[str, Any]:
        """Return the law that was exported, SI, and the engine."""
        return self._truth

    def touch(self) -> Touch:
        """Refuse: the contact of an engine has the probe's acceleration in it.

        Raises
        ------
        InvalidParameterError
            Always.
        """
        raise InvalidParameterError(
            f"{self.name} can be pressed by an ideal probe only (--probe ideal), whose motion is "
            "known beforehand: the contact of an engine has the acceleration in it"
        )

    def force(
        self, time: Floats, lateral_position: Floats, penetration: Floats, velocity: Floats
    ) -> Floats:
        """Force of the engine [N] along a whole motion, shapes (k,); 0 out of contact."""
        force, below = np.zeros_like(time), np.flatnonzero(penetration > 0.0)
        if below.size:
            acceleration = np.gradient(velocity, time)
            t, x, v, a = (each[below] for each in (time, penetration, velocity, acceleration))
            force[below] = self._pushed(ProbeMotion(t, x, v, a, np.ones(below.size, dtype=bool)))
        return force


class SimulatedContact(InAnEngine):
    """A material of the laboratory whose force is that of the real engine, state by state.

    The round trip: of what an engine makes of a law the laboratory records a contact, which is
    identified as any other.

    Parameters
    ----------
    made : Export
        By :func:`palpate.exports.export`; to be pressed by :class:`palpate.lab.IdealProbe`.

    Raises
    ------
    InvalidParameterError
        The engine is not run here.
    """

    def __init__(self, made: Export) -> None:
        statement, fragment = made.statement, made.fragment
        engine, law = statement.engine, statement.nearest.law.simplest()

        def replayed(motion: ProbeMotion) -> Floats:
            ran = fragment.replay(motion)
            if ran is None:
                raise MissingExtraError(f"{engine.title} is not run here: nothing can press it")
            return ran.force

        name = f"{statement.source.name or 'a law'} in {engine.title}"
        inside = {"engine": engine.name, "form": fragment.form}
        super().__init__(name, replayed, {"kind": law.kind, **law.as_dict(), **inside})
