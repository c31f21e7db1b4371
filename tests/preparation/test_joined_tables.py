"""Tables whose rows are not samples of one contact: topics joined by time, contacts of bodies."""

import numpy as np
import pandas
import pytest

import palpate
from palpate import HuntCrossley, RecordingError
from palpate.input.channels.roles import choose_roles

LAW = HuntCrossley(K=2000.0, B=1500.0, n=1.2)


def press(time):
    """Depth and force of three touches, with 1 mN of noise; the probe is in the air in between."""
    depth = 2e-3 - 4e-3 * np.cos(np.pi * time)
    velocity = 4e-3 * np.pi * np.sin(np.pi * time)
    force = np.where(depth > 0.0, LAW.force(np.maximum(depth, 0.0), velocity), 0.0)
    noise = np.random.default_rng(1).normal(0.0, 1e-3, time.size)
    return depth, np.maximum(force, 0.0) + noise


def check_law(contact, stiffness=0.01, damping=0.05):
    """Linear interpolation between samples moves K by less than 1 %, and B by less than 5 %."""
    law = palpate.identify(contact).law
    assert law.force(4e-3, 0.0) == pytest.approx(LAW.force(4e-3, 0.0), rel=stiffness)
    felt = [each.force(4e-3, 0.01) - each.force(4e-3, 0.0) for each in (law, LAW)]
    assert felt[0] == pytest.approx(felt[1], rel=damping)


RATES = {"of a fast wrench": (100, 1000, 3e-4), "of a fast pose": (1000, 100, 3e-4)}
RATES |= {"with common times": (100, 500, 0.0), "of one rate": (500, 500, 7e-4)}
TOPICS = "/tcp_pose/pose/position/{}", "/ft_sensor/wrench/force/{}"


def joined(rate, force_rate, late, form=TOPICS, time="__time", start=1.7e9):
    """A position and a force as PlotJuggler exports them: all times in one column, blank cells."""
    stamps, own = np.arange(0.0, 6.0, 1.0 / rate), np.arange(0.0, 6.0, 1.0 / force_rate) + late
    zero = {"x": 0.0, "y": 0.0}
    pose, wrench = (
        pandas.DataFrame({time: start + at} | {name.format(k): v for k, v in axes.items()})
        for at, name, axes in (
            (stamps, form[0], {**zero, "z": -press(stamps)[0]}),
            (own, form[1], {**zero, "z": press(own)[1]}),
        )
    )
    return pose.merge(wrench, on=time, how="outer", sort=True)


@pytest.mark.parametrize("rates", RATES.values(), ids=RATES)
@pytest.mark.parametrize("suffix", ["csv", "json"])
def test_topics_joined_by_time_have_a_clock_each(tmp_path, rates, suffix):
    table, path = joined(*rates), tmp_path / f"table.{suffix}"
    table.to_csv(path, index=False) if suffix == "csv" else path.write_text(
        table.to_json(orient="records", double_precision=15)
    )
    contact = palpate.prepare(path, strict=True)
    assert "at the times of '__time of" in "".join(contact.provenance.values())
    assert not [each for each in contact.findings if each.severity != "note"]
    check_law(contact)


def test_missed_samples_are_no_topic_of_their_own():
    table = joined(500, 500, 0.0, ("robot.position.{}", "robot.force.{}"), "time_ms", 0.0)
    table.loc[np.random.default_rng(0).random(len(table)) < 0.3, "robot.force.z"] = np.nan
    contact = palpate.prepare(table, units={"time": "s"})
    assert any("palpate excluded" in each.message for each in contact.findings)
    check_law(contact)


def test_joined_topics_without_their_times_are_refused():
    table = joined(100, 1000, 3e-4).drop(columns="__time")
    with pytest.raises(RecordingError, match=r"both a position and a force; .* --time"):
        palpate.prepare(table, rate=1000.0)


TIME = np.arange(0.0, 6.0, 2e-3)
DEPTH, FORCE = press(TIME)
INSIDE = DEPTH > 0.0
MIDDLE = {"pos_x": 0.1, "pos_y": 0.2, "pos_z": 0.05 - 0.5 * DEPTH}
NORMAL = {f"contactNormalOnB_{axis}": float(axis == "z") for axis in "xyz"}
ON_A = {f"positionOnA_{axis}": 0.1 for axis in "xyz"}
ROWS = {
    "of MuJoCo": {"geom1": 1, "geom2": 4, "dist": -DEPTH, **MIDDLE, "force_n": FORCE},
    "without geoms": {"dist": -DEPTH, **MIDDLE, "force": FORCE},
    "with friction": {"geom1": 1, "dist": -DEPTH, **MIDDLE, "force_n": FORCE, "force_t1": DEPTH},
    "in mm": {"geom1": 1, "dist_mm": -1e3 * DEPTH, "pos_z_mm": 1e3 * DEPTH, "force_n": FORCE},
    "of PyBullet": {**ON_A, **NORMAL, "contactDistance": -DEPTH, "normalForce": FORCE},
    "positive inside": {"geom1": 1, "dist": DEPTH, **MIDDLE, "force_n": FORCE},
    "with a depth": {**NORMAL, "contact_pos_z": 0.05 - 0.5 * DEPTH, "depth": DEPTH, "fn": FORCE},
}


def rows_of(columns, rows=INSIDE):
    return pandas.DataFrame({"time": TIME, **columns})[rows]


@pytest.mark.parametrize("columns", ROWS.values(), ids=ROWS)
def test_the_distance_of_two_bodies_is_the_penetration(columns):
    check_law(palpate.prepare(rows_of(columns)), 1e-3, 0.05)


def test_a_distance_never_below_zero_is_of_a_range_sensor():
    columns = {"distance": 0.05 - DEPTH, **MIDDLE, "normal_force": FORCE, "in_contact": INSIDE * 1}
    roles = choose_roles(palpate.Recording(dict(rows_of(columns, slice(None)))))
    assert roles.depth == ("pos_x", "pos_y", "pos_z")


@pytest.mark.parametrize("name", ["camera_depth", "depth_image", "depth[{}]"])
def test_a_depth_image_is_no_penetration(name):
    image = {name.format(k): np.sin((3 + k) * TIME) for k in range(4)}
    columns = {**image, **MIDDLE, "force": FORCE}
    roles = choose_roles(palpate.Recording(dict(rows_of(columns))))
    assert roles.depth == ("pos_x", "pos_y", "pos_z")


def test_contacts_of_several_bodies_or_points_are_refused():
    columns = {"geom1": 1, "geom2": 4, "dist": -DEPTH, **MIDDLE, "force_n": FORCE}
    other = rows_of({**columns, "geom2": np.where(TIME < 2.0, 4, 5)})
    with pytest.raises(RecordingError, match="2 pairs of bodies, by geom1, geom2: 1 and 4, 1 and"):
        palpate.prepare(other)
    corners = [rows_of({**columns, "pos_x": x, "force_n": FORCE / 2}) for x in (0.1, 0.2)]
    with pytest.raises(RecordingError, match="the bodies touch at several points"):
        palpate.prepare(pandas.concat(corners).sort_values("time", kind="stable"))
