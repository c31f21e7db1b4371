"""Arrays of contacts by a gated recursion: through lanes, with the rows of one by one."""

import numpy as np
import pytest
from fleets import STEP, curves, mixed_touches, write_zarr

from palpate import (
    Contact,
    ContactGate,
    KelvinVoigtRLS,
    Scale,
    SingleStageRLS,
    choose_gate,
    identify_many,
)
from palpate.fleet import arrays
from palpate.fleet.batch import identify_batch
from palpate.fleet.settings import Settings
from palpate.preparation.gates_of_rows import gates_of_rows, scales_of_rows
from palpate.preparation.suggestions import suggest_scale

pytest.importorskip("pyarrow")

# Lanes divide once where the recursion divides ten times, and sums of a row go in another order;
# P magnifies the last bits, of these motions to 1e-8.
CLOSE = 1e-6


def one_by_one(monkeypatch, **options):
    with monkeypatch.context() as patch:
        patch.setattr(arrays, "goes_through_lanes", lambda _: False)
        return identify_many(**options)


def assert_same_rows(found, expected, names):
    assert found.schema == expected.schema
    for column in expected.schema.names:
        if column == "fit":
            continue
        pairs = zip(found[column].to_pylist(), expected[column].to_pylist(), strict=True)
        for name, (one, other) in zip(names, pairs, strict=True):
            if column == "covariance" and other is not None:
                errors = np.sqrt(np.diag(np.reshape(other, (int(len(other) ** 0.5),) * 2)))
                units = np.outer(errors, errors).reshape(-1)
                np.testing.assert_allclose(one, other, atol=CLOSE * units.max(), err_msg=name)
                assert np.all(np.abs(np.subtract(one, other)) <= CLOSE * units), name
            elif isinstance(other, float):
                assert one == pytest.approx(other, rel=CLOSE, nan_ok=True), (column, name)
            else:
                assert one == other, (column, name)


@pytest.mark.parametrize(
    "method, diagnosis, measured",
    [
        ("single-stage", "input", True),
        ("kelvin-voigt", "none", True),
        ("extended-kelvin-voigt", "none", False),
        ("known exponent", "none", True),
        ("own settings", "none", True),
    ],
)
def test_rows_of_lanes_are_those_of_one_by_one(monkeypatch, method, diagnosis, measured):
    own = {
        "known exponent": lambda: SingleStageRLS(exponent=1.3),
        "own settings": lambda: KelvinVoigtRLS(
            gate=ContactGate(1e-4, 0.1), scale=Scale(), outlier_rejection=False
        ),
    }
    x, v, force, names = mixed_touches()
    time = np.tile(STEP * np.arange(x.shape[1]), (len(x), 1))
    time[names.index("uneven")] **= 1.01
    options = {
        "method": own[method]() if method in own else method,
        "diagnosis": diagnosis,
        "penetration": x,
        "velocity": v if measured else None,
        "force": force,
        "time": time,
        "source": "touches",
        "places": {"x": np.arange(float(len(x)))},
    }
    before = [array.copy() for array in (x, v, force)]
    found = identify_many(**options, threads=2)
    expected = one_by_one(monkeypatch, **options)
    assert_same_rows(found, expected, names)
    for array, copy in zip((x, v, force), before, strict=True):
        np.testing.assert_array_equal(array, copy)  # what was given is not changed
    fits = dict(zip(names, found["fit"].to_pylist(), strict=True))
    by_lanes = "recursion" if method == "known exponent" else "lanes"
    assert {fits[f"good {k}"] for k in range(17) if k % 2} == {by_lanes}
    assert {fits[name] for name in ("a hole", "uneven")} == {"recursion"}
    assert fits["never touches"] is fits["nothing"] is None


def test_flags_of_the_mixed_touches_are_those_that_they_were_made_for():
    """So that the comparison compares something."""
    x, v, force, names = mixed_touches()
    rows = identify_many(
        penetration=x, velocity=v, force=force, sample_time=STEP, method="single-stage"
    ).to_pylist()
    flags = {name: " ".join(row["flags"] or []) for name, row in zip(names, rows, strict=True)}
    assert "negative damping" in flags["negative damping"]
    assert "left out as an outlier" in flags["spiked"]
    assert "only 25 samples" in flags["few samples"]
    assert "less than 0.2 s" in flags["brief"]
    assert "condition 10 violated" in flags["wrong sign of the velocity"]
    assert "refused" in flags["no velocity"]


def test_an_uneven_clock_goes_one_by_one():
    x, v, force = curves(3, samples=200)
    time = (STEP * np.arange(200.0)) ** 1.01
    table = identify_many(
        penetration=x, velocity=v, force=force, time=time, method="single-stage", diagnosis="none"
    )
    assert set(table["fit"].to_pylist()) == {"recursion"}


def test_rows_do_not_depend_on_threads_or_neighbours():
    x, v, force = curves(300, samples=120)
    options = {"sample_time": STEP, "method": "single-stage", "diagnosis": "none"}
    every = {"penetration": x, "velocity": v, "force": force}
    alone, shared = (identify_many(**every, **options, threads=n) for n in (1, 3))
    assert repr(alone.to_pylist()) == repr(shared.to_pylist())  # NaN and all
    some = {name: values[7:12] for name, values in every.items()}
    few = identify_many(**some, **options)
    assert few["stiffness"].to_pylist() == alone["stiffness"].to_pylist()[7:12]


def test_gates_and_scales_of_rows_are_those_of_each_contact():
    x, v, force, names = mixed_touches()
    kept = [k for k, name in enumerate(names) if name not in ("infinite", "absurd", "no velocity")]
    x, v, force = x[kept], v[kept], force[kept]
    there = np.isfinite(x) & np.isfinite(force)
    prefix = there == (np.arange(x.shape[1]) < there.sum(axis=1)[:, None])
    whole = prefix.all(axis=1) & (there.sum(axis=1) >= 8)
    x[~there] = v[~there] = force[~there] = np.nan
    signals = x[whole], v[whole], force[whole]
    gates, scales = gates_of_rows(*signals), scales_of_rows(*signals)
    for k, row in enumerate(np.flatnonzero(whole)):
        own = there[row]
        touch = Contact(
            STEP * np.arange(own.sum()),
            penetration=x[row][own],
            velocity=v[row][own],
            force=force[row][own],
        )
        assert tuple(gates[k]) == choose_gate(touch)._plain()
        assert tuple(scales[k]) == suggest_scale(touch)._plain()
    assert np.count_nonzero(gates[:, 2] == 0.0) >= 2  # one never touches; of others depth decides


def test_arrays_on_disk_go_through_lanes(tmp_path):
    zarr = pytest.importorskip("zarr")
    assert zarr
    import pyarrow as pa

    path = tmp_path / "touches.zarr"
    x, v, force = write_zarr(path, 6)
    batch = pa.table({"source": [str(path)] * 6, "kind": ["zarr"] * 6, "index": range(6)})
    found = identify_batch(batch, Settings(method="single-stage", diagnosis="none"), threads=2)
    assert found["fit"].to_pylist() == ["lanes"] * 6
    direct = identify_many(
        penetration=x, velocity=v, force=force, sample_time=STEP, method="single-stage"
    )
    assert found["damping"].to_pylist() == direct["damping"].to_pylist()
