"""A contact in the tables that users of Python have; units come with them."""

import faults
import numpy as np
import pandas as pd
import pyarrow as pa
import pytest

import palpate

SI = {"time": faults.TIME, "penetration": faults.X, "force": faults.noisy(faults.FORCE)}
FRAME = pd.DataFrame(SI)
MILLIMETRES = FRAME.assign(penetration=1e3 * FRAME.penetration)


class OfPint:
    """The part of a quantity of pint that palpate reads."""

    def __init__(self, magnitude, unit):
        self.magnitude, self.units = magnitude, Unit(unit)


class Unit(str):
    def __format__(self, form):
        assert form == "~"
        return str(self)


def indexed(by):
    return FRAME.assign(time=by(FRAME.time, unit="s")).set_index("time")


def stated(frame, **units):
    frame.attrs["units"] = units
    return frame


TABLES = {
    "an index of seconds": FRAME.set_index("time"),
    "an index without a name": FRAME.set_index("time").rename_axis(None),
    "an index of Timedelta": indexed(pd.to_timedelta),
    "an index of dates": indexed(pd.to_datetime),
    "a dict": SI,
    "a dict of lists": {name: values.tolist() for name, values in SI.items()},
    "rows": FRAME.to_dict("records"),
    "a structured array": FRAME.to_records(index=False),
    "an Arrow table": pa.table(SI),
    "units of a frame": stated(MILLIMETRES, penetration="mm", force="N", time="s"),
    "units of Arrow": pa.table(
        [SI["time"], 1e3 * SI["penetration"], SI["force"]],
        schema=pa.schema([
            pa.field("time", pa.float64()),
            pa.field("penetration", pa.float64(), metadata={"unit": "mm"}),
            pa.field("force", pa.float64()),
        ]),
    ),
    "units of pint": {
        "time": OfPint(1e3 * SI["time"], "ms"),
        "penetration": OfPint(1e3 * SI["penetration"], "mm"),
        "force": OfPint(SI["force"], "N"),
    },
}  # fmt: skip


@pytest.fixture(scope="module")
def expected():
    return palpate.identify(FRAME)


@pytest.mark.long
@pytest.mark.parametrize("table", TABLES.values(), ids=TABLES)
def test_a_table_is_the_contact_that_it_holds(table, expected):
    found = palpate.identify(table)
    # Integer nanoseconds round the times.
    assert found.stiffness.value == pytest.approx(expected.stiffness.value, rel=1e-6)


@pytest.mark.peers
@pytest.mark.parametrize("unit", ["mm", "um", "inch"])
def test_a_table_of_pint_is_the_contact_that_it_holds(unit, expected):
    """Of pint itself: a dict of its quantities, and a frame whose types have its units."""
    pint = pytest.importorskip("pint")
    units = pint.UnitRegistry()
    time, depth, force = (
        units.Quantity(SI[name], si).to(to)
        for name, si, to in (("time", "s", "ms"), ("penetration", "m", unit), ("force", "N", "mN"))
    )
    table = {"time": time, "penetration": depth, "force": force}
    frames = pytest.importorskip("pint_pandas")
    frames.PintType.ureg = units
    frame = pd.DataFrame({
        name: pd.Series(each.magnitude, dtype=f"pint[{each.units:~}]")
        for name, each in table.items()
    })  # fmt: skip
    for given in (table, frame):
        found = palpate.identify(given)
        assert found.stiffness.value == pytest.approx(expected.stiffness.value, rel=1e-6)


@pytest.mark.parametrize("form", ["to_pandas", "to_xarray"])
def test_tables_written_by_palpate_are_read_back(form, expected):
    found = palpate.identify(getattr(expected, form)())
    assert found.stiffness.value == pytest.approx(expected.stiffness.value, rel=1e-9)


def test_units_delay_and_exponent_are_arguments(expected):
    found = palpate.identify(
        FRAME.assign(penetration=1e3 * FRAME.penetration), units={"penetration": "mm"}
    )
    assert found.stiffness.value == pytest.approx(expected.stiffness.value, rel=1e-6)
    assert palpate.identify(FRAME, exponent=1.4).law.n == 1.4
    assert palpate.identify(FRAME, law="hunt-crossley", exponent=1.4).fixed == ("n",)
    assert palpate.identify(FRAME, delay=1e-3).contact.delay.seconds == 1e-3


@pytest.mark.parametrize("thing", [7, [], [1.0, 2.0], {}, np.zeros(3), object()])
def test_unsupported_tables_are_refused(thing):
    with pytest.raises(
        palpate.InvalidParameterError, match="must be a Recording, a path, or a table"
    ):
        palpate.prepare(thing)


def test_a_number_prints_its_error_and_its_mark(expected):
    assert str(expected.stiffness).endswith("(trust)")
    assert "±" in str(expected.stiffness)
