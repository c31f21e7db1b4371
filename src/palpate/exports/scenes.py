"""A scene of MuJoCo that an export wrote, read from its file for the laboratory to press."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from palpate.errors import RecordingError
from palpate.exports.exporting import STATEMENT
from palpate.exports.motion import Motion
from palpate.exports.mujoco.pressing import Pressed, engine_here
from palpate.exports.mujoco.robot import compiled
from palpate.exports.mujoco.texts import PADS, TIP, Place
from palpate.exports.pressed import InAnEngine
from palpate.validation import Floats


class Scene(InAnEngine):
    """A material of the laboratory: ``scene.xml`` as MuJoCo compiles it, pressed state by state.

    Parameters
    ----------
    path : str or Path
        The file.

    Raises
    ------
    RecordingError
        MuJoCo cannot read it, or it has no contact of palpate's between a tip and a surface.
    """

    def __init__(self, path: str | Path) -> None:
        self._path = Path(path)
        self.name = f"{self._path.parent.name or 'a'} scene of MuJoCo".removeprefix(".")
        self._scene = _read(self._path)

    def pushed(self, motion: Motion) -> Floats:
        """Force of the scene's contact [N], shape (k,)."""
        return self._scene.along_motion(motion)

    def describe(self) -> dict[str, Any]:
        """Return the law that was exported, where a statement beside the scene says it."""
        beside = self._path.with_name(STATEMENT[0])
        try:
            law = json.loads(beside.read_bytes())["exported_law"]
            return {**law, "engine": "mujoco"}
        except (OSError, ValueError, LookupError, TypeError):
            return {"kind": "a scene of MuJoCo", "file": self._path.name}


def _read(path: Path) -> Pressed:
    mujoco = engine_here()
    try:
        model = mujoco.MjModel.from_xml_path(str(path))
    except Exception as error:  # the engine's own classes, of several kinds
        raise RecordingError(f"{path}: MuJoCo cannot read it: {error}") from None
    names = {model.geom(k).name for k in range(model.ngeom)}
    pads = [pad for pad in PADS if pad in names]
    if TIP not in names or not pads or model.npair != len(pads):
        raise RecordingError(
            f"{path}: no scene that palpate export wrote, with pairs of {TIP} and {PADS[0]}; that "
            "of a callback is pressed in Python, by palpate.exports.Pressed"
        )
    place = Place(tuple(np.asarray(model.geom(pads[0]).pos).tolist()))
    return compiled(mujoco, model, TIP, len(pads), place)
