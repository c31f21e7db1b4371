"""Export a law: fit the engine's parameters, judge the error, write files."""

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from hashlib import sha256
from pathlib import Path

from palpate.errors import ExportRefusedError, InvalidParameterError
from palpate.exports.engine import Engine, Fragment, engine_called, make_warnings
from palpate.exports.motion import ExportRequest
from palpate.exports.statement import Exportable, ExportedLaw, Statement, compare_errors
from palpate.validation import frozen, number_in, shown
from palpate.writing import (
    as_json,
    check_own,
    check_writable,
    encode_text,
    escape_markdown,
    make_folder,
    write_text,
)

STATEMENT = ("statement.json", "statement.md")
_NAME = re.compile(r"[\w.-]{1,100}")


@frozen(eq=False)
class Export:
    """A law in an engine's parameters, and the statement of its error.

    Attributes
    ----------
    statement : Statement
        Error, origin, warnings.
    fragment : Fragment
        The law in the engine's parameters.
    files : mapping of str to str
        Text by file name: first the fragment to paste, then a minimal scene.
    """

    statement: Statement
    fragment: Fragment = field(repr=False)
    files: Mapping[str, str] = field(repr=False)

    def __str__(self) -> str:
        return "\n".join(self.statement.describe())

    def save(self, folder: str | Path, *, inputs: Sequence[Path] = ()) -> list[Path]:
        """Write fragment, scene and statement to a folder, each file completely or not at all.

        Parameters
        ----------
        folder : str or Path
            Folder; created if it does not exist.
        inputs : sequence of Path
            Files that must not be overwritten. Default: none.

        Raises
        ------
        RecordingError
            The folder cannot be created or written to, or a file would replace an input or a file
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
    friction: float = 0.0,
    name: str = "",
    allow: bool = False,
    replay: bool = True,
) -> Export:
    """Export a law as the parameters of a simulation engine, and state the engine's error.

    Parameters
    ----------
    result : Identification, SavedResult or ForceLaw
        The law to export. For an identification the engine replays the recorded motion; for a law
        alone, which has no verdict, the paper's motion.
    to : str
        Name of the engine, one of :func:`engines`.
    mass : float, optional
        Effective mass of the pressing body at the contact, kg, in (0, 1e6].
    model : str or Path, optional
        Model of the engine from which the effective mass is computed, in place of ``mass``.
    geom : str, optional
        Name of the touching geom in the model.
    form : str
        Form of the contact in the engine. Default: "auto", the most accurate one for the law.
    tip_radius : float, optional
        Radius of a spherical tip, m, in (0, 1], for engines whose law contains it.
    time_step : float, optional
        Time step of the simulation, s, in (0, 1]; Drake also takes 0, a continuous plant. Default:
        that of the model, else 1 ms.
    friction : float
        Coefficient of friction of the contact, in [0, 10]. Default: 0, frictionless.
    name : str
        Part of the names in the fragment, so that one model can have several exports: letters,
        digits, ``_``, ``-`` and ``.``. Default: "", for the only one.
    allow : bool
        Export even if refused; the fragment then names the refusals. Default: False.
    replay : bool
        Replay the motion in the engine if it is installed, else predict the error. Default: True.

    Raises
    ------
    ExportRefusedError
        The verdict is do-not-trust, the force error of the engine exceeds 5 %, or the simulation is
        unstable or cannot represent the law; ``allow=True`` exports despite that.
    InvalidParameterError
        An argument is outside its range, or one that the engine needs is missing.
    """
    engine = engine_called(to)
    own_mass = None if mass is None else number_in("mass", mass, 0.0, 1e6, open_low=True)
    source = ExportedLaw.of(result, own_mass or 1.0)
    nearest = source.nearest()
    radius = source.tip_radius if tip_radius is None else tip_radius
    if radius is not None:
        number_in("tip_radius", radius, 0.0, 1.0, open_low=True)
    step = 1e-3 if time_step is None else time_step
    request = ExportRequest(
        law=nearest.law,
        motion=source.motion,
        mass=own_mass,
        model=None if model is None else Path(model),
        geom=geom,
        tip_radius=radius,
        time_step=number_in("time_step", step, 0.0, 1.0, open_low=not engine.continuous),
        form=form,
        friction=number_in("friction", friction, 0.0, 10.0),
        name=name,
        material=source.name,
    )
    if model is not None and time_step is not None:
        raise InvalidParameterError("pass either time_step or model: the model has its own")
    _check(engine, request, given_radius=tip_radius is not None)
    runs = replay and engine.version() is not None

    def state(fragment: Fragment) -> Statement:
        found = compare_errors(source, nearest, fragment, replay=runs)
        return Statement(source, nearest, engine, fragment, found, allow)

    statement = state(engine.fit(request))
    exact_form = engine.exact_form
    if form == "auto" and exact_form in engine.forms and statement.engine_fails:
        why = f"exported as a {exact_form}: as {statement.fragment.form}, {statement.refusals[0]}"
        exact = engine.fit(replace(request, form=exact_form))
        other = state(replace(exact, findings=(*make_warnings(why), *exact.findings)))
        if not other.engine_fails or other.compared.percent < statement.compared.percent:
            statement = other
    if statement.refused:
        raise ExportRefusedError(f"{engine.title}: {statement.claim}", statement)
    fragment = statement.fragment
    return Export(statement, fragment, fragment.files(statement.notes()))


def _check(engine: Engine, request: ExportRequest, *, given_radius: bool) -> None:
    """Raise for arguments that the engine does not use."""
    if request.form != "auto" and request.form not in engine.forms:
        known = ", ".join(["auto", *engine.forms])
        raise InvalidParameterError(
            f"form must be one of {known} for {engine.name}, not {request.form!r}"
        )
    if request.model is not None and request.mass is not None:
        raise InvalidParameterError("pass either mass or model: the model determines the mass")
    if request.geom is not None and request.model is None and "geom" in engine.takes:
        raise InvalidParameterError("geom needs a model that contains it: add --model FILE")
    if request.name and not _NAME.fullmatch(request.name):
        raise InvalidParameterError(
            f"name must consist of letters, digits, _, - and ., not {shown(request.name)}"
        )
    given = {
        "model": request.model,
        "geom": request.geom,
        "tip_radius": given_radius or None,
        "friction": request.friction or None,
        "name": request.name or None,
    }
    for name, value in given.items():
        if value is not None and name not in engine.takes:
            raise InvalidParameterError(f"{engine.title} does not use {name}: omit it")


def save_statement(
    statement: Statement,
    folder: Path,
    inputs: Sequence[Path],
    files: Mapping[str, str],
) -> list[Path]:
    """Write the statement and the exported files; return their paths."""
    make_folder(folder)
    earlier = _earlier(folder)
    made = {*files, *STATEMENT}
    left = [name for name in earlier if name not in made and (folder / name).is_file()]
    texts = _file_texts(statement, files, earlier, left)
    paths = [folder / name for name in texts]
    for path in paths:
        check_writable(path, inputs)

    def own(path: Path) -> bool:
        if path.name == STATEMENT[0] and earlier:
            return True
        found = sha256(path.read_bytes()).hexdigest()
        # An interrupted export has left files without a statement.
        return found in (earlier.get(path.name), _digest(texts[path.name]))

    check_own(folder, texts, own)
    for path, text in zip(paths, texts.values(), strict=True):
        write_text(path, text, inputs)
    return paths


def _earlier(folder: Path) -> dict[str, str]:
    """Return the SHA-256 of earlier exports' files by name, from the statement in the folder."""
    try:
        found = json.loads((folder / STATEMENT[0]).read_bytes())["sha256"]
        return {str(name): str(digest) for name, digest in found.items()}
    except (OSError, ValueError, LookupError, TypeError, AttributeError):
        return {}


def _digest(text: str) -> str:
    return sha256(encode_text(text)).hexdigest()


def _file_texts(
    statement: Statement,
    files: Mapping[str, str],
    earlier: Mapping[str, str],
    left: Sequence[str],
) -> dict[str, str]:
    """Return the text of all files, the two of the statement last."""
    name = escape_markdown(statement.source.name or "A law")
    title = f"# {name} in {statement.engine.title}"
    listed = [f"- `{name}`" for name in files] or ["Nothing was exported."]
    if left:
        listed.append(f"\nFiles of an earlier export, not of this one: {', '.join(left)}.")
    described = map(escape_markdown, statement.describe())
    page = "\n\n".join([title, *described, "\n".join(listed)])
    number, words = STATEMENT
    texts = {**files, words: page + "\n"}
    digests = {name: _digest(text) for name, text in texts.items()}
    digests |= {name: earlier[name] for name in left}
    whole = {**statement.as_dict(), "files": list(files), "left": list(left), "sha256": digests}
    return {**texts, number: as_json(whole)}
