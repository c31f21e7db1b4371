"""Force maps that an instrument wrote, where they are: they may not be copied into the project."""

import json
import os
from pathlib import Path

import numpy as np
import pytest

from palpate import RecordingError
from palpate.recordings import open_recording

BESIDE = Path(__file__).resolve().parents[2] / "shared" / "data"
FOLDER = Path(os.environ.get("PALPATE_DATA", BESIDE))
MAPS = sorted(FOLDER.glob("afm_maps/*.jpk-force-map"))
NONE = pytest.mark.skip(reason="no force maps beside the checkout, and PALPATE_DATA is not set")
CASES = [pytest.param(path, id=path.stem) for path in MAPS] or [pytest.param(None, marks=NONE)]


@pytest.mark.parametrize("path", CASES)
def test_every_curve_of_a_map_is_read(path):
    pytest.importorskip("afmformats")
    with pytest.raises(RecordingError, match="curves; choose one with --curve N") as refusal:
        open_recording(path)
    count = int(str(refusal.value).partition("holds ")[2].split()[0])
    for number in range(count):
        curve = open_recording(path, curve=number)
        assert set(curve.channels) == {
            "force", "height (measured)", "height (piezo)", "segment", "time", "tip position",
        }  # fmt: skip
        assert not curve.losses
        approach = curve.channels["segment"] == 0
        height = curve.channels["height (measured)"]
        assert height[approach][0] > height[approach][-1]  # it comes down
        assert curve.channels["force"].argmax() == pytest.approx(approach.sum(), abs=600)


def test_a_curve_is_that_which_was_taken_out_of_the_map_by_others():
    pytest.importorskip("afmformats")
    taken = FOLDER / "E_afm_refpoints_c0.csv"
    if not taken.exists() or not MAPS:
        pytest.skip("no force maps beside the checkout, and PALPATE_DATA is not set")
    about = json.loads(taken.with_suffix(".json").read_text())
    [path] = [path for path in MAPS if about["path"].endswith(path.name)]
    curve, other = open_recording(path, curve=about["curve"]), open_recording(taken)
    rows = np.rint(other.numbers("time_s") * about["rate_hz"]).astype(int)
    force = curve.channels["force"][rows] - about["baseline_force_N"]
    # Nine digits were written there.
    np.testing.assert_allclose(force, other.numbers("force_N"), rtol=1e-8, atol=1e-17)
    height = curve.channels["height (measured)"][rows]
    np.testing.assert_allclose(height, other.numbers("height_m"), rtol=1e-8)
