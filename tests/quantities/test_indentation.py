"""Young's modulus of force curves: contact point, baseline, adhesion, and what is refused."""

import json
import math

import numpy as np
import pytest
from containers import HEIGHT_SCALE, SENSITIVITY, SPRING_CONSTANT, VOLTS, write_jpk

import palpate
from benchmarks.fleets.force_curves import (
    COUNT,
    EACH,
    FAULTS,
    falsely_trusted,
    faulty_curve,
    force_curve,
)
from palpate import Cone, FlatPunch, Pyramid, Recording, RecordingError, Sphere
from palpate.findings import Check
from palpate.identification.quantities.elastic_modulus import TIPS
from palpate.identification.quantities.indentation import (
    fit_approach,
    fit_force_curve,
    prepare_force_curve,
)

RADIUS = 5e-6
TIP = "sphere:radius=5um"


def approach(tip, *, modulus=2000.0, depth=1e-6, travel=4e-6, noise=0.0, count=2000):
    """Penetration and force of an approach; the surface is at 10 µm."""
    x = np.linspace(-travel, depth, count)
    force = modulus / 0.75 * tip.factor * np.maximum(x, 0.0) ** tip.exponent
    return x + 10e-6, force + noise * np.random.default_rng(5).normal(size=count)


def checks(found):
    return {each.check for each in found.findings}


def test_the_modulus_of_known_curves_is_within_two_bars():
    curves = [force_curve(number) for number in range(COUNT)]
    fits = [curve.fit() for curve in curves]
    for fit, curve in zip(fits, curves, strict=True):
        assert (Check.PULL_OFF in checks(fit)) is curve.adheres
        assert not (Check.BASELINE in checks(fit) and not curve.bends)
    values = [fit.modulus.value for fit in fits]
    errors = [v.value - c.modulus for v, c in zip(values, curves, strict=True)]
    within = [abs(e) <= 2.0 * v.whole_error for e, v in zip(errors, values, strict=True)]
    assert sum(within) >= 36
    assert np.median([v.whole_error / v.value for v in values]) < 0.04
    assert sum(Check.BASELINE in checks(fit) for fit in fits) >= 15  # of 20


@pytest.mark.parametrize("tip", [Sphere(RADIUS), FlatPunch(1e-6), Cone(0.6), Pyramid(0.6)])
def test_each_tip_gives_back_the_modulus_and_the_contact_point(tip):
    assert TIPS[tip.kind] is type(tip)
    x, force = approach(tip, depth=0.4e-6, noise=1e-12)
    found = fit_approach(x, force + 3e-10 + 2e-5 * x, None, tip)
    assert found.modulus.value.value == pytest.approx(2000.0, rel=0.05)
    assert found.contact_point.value == pytest.approx(10e-6, abs=1e-8)
    assert found.baseline == pytest.approx((3e-10 + 2e-5 * 10e-6, 2e-5), rel=0.02)
    assert found.largest_depth == pytest.approx(0.4e-6, abs=1e-8)
    other = fit_approach(x, force, None, tip, 0.0).modulus
    assert other.value.value == pytest.approx(2000.0 / 0.75, rel=0.05)
    assert (other.poisson_ratio, other.assumed) == (0.0, False)


def test_a_contact_point_at_an_edge_or_below_the_noise_is_not_trusted():
    tip = Sphere(RADIUS)
    near = fit_approach(*approach(tip, travel=0.5e-6, noise=1e-12), None, tip)
    few = fit_approach(*approach(tip, depth=20e-9, travel=8e-6, noise=1e-14), None, tip)
    for found in (near, few):
        assert Check.CONTACT_POINT in checks(found)
        assert found.modulus.mark == "do-not-trust"
    x, force = approach(tip, depth=0.1e-6)
    noisy = force + 0.5 * force.max() * np.random.default_rng(1).normal(size=x.size)
    found = fit_approach(x, noisy, None, tip)
    assert Check.INDENTATION in checks(found)
    assert found.modulus.mark == "do-not-trust"


def test_another_tip_than_the_true_one_is_not_trusted():
    x, force = approach(Cone(0.6), noise=1e-12)
    assert fit_approach(x, force, None, Cone(0.6)).modulus.mark == "trust"
    found = fit_approach(x, force, None, Sphere(RADIUS))
    assert Check.TIP_SHAPE in checks(found)
    assert found.modulus.mark == "do-not-trust"
    assert found.modulus.remarks[0].endswith("n = 1.5: a cone or a pyramid or a thin sample?")


@pytest.mark.long
@pytest.mark.parametrize("fault", FAULTS)
def test_no_modulus_that_is_wrong_by_a_tenth_is_trusted(fault):
    fits = [faulty_curve(fault, number) for number in range(EACH)]
    assert falsely_trusted(fits) == 0
    marks = [fit.modulus.mark for fit, _ in fits]
    if fault == "none":
        assert set(marks) == {"trust"}
    elif fault != "tilted baseline":
        assert "trust" not in marks
    if fault == "thin sample":
        for number in range(EACH):
            fit, modulus = faulty_curve(fault, number, stated=True)
            assert fit.modulus.mark == "trust"
            # Its error bar is 1 to 3 %.
            assert fit.modulus.value.value == pytest.approx(modulus, rel=0.06)


def test_a_sample_that_relaxes_states_the_speed_of_its_approach():
    time = 1e-3 * np.arange(4000)
    x = 0.8e-6 - 2e-6 * np.abs(time - 2.0)
    load = Sphere(RADIUS).factor * 2000.0 / 0.75 * np.maximum(x, 0.0) ** 1.5
    fading = 0.8 + 0.2 * np.exp(-time / 0.3)
    force = np.convolve(fading, np.diff(load, prepend=0.0))[: time.size]
    for curve, relaxes in ((load, False), (np.maximum(force, 0.0), True)):
        noisy = curve + 1e-11 * np.random.default_rng(3).normal(size=time.size)
        segment = np.repeat([0, 1], 2000)
        found = fit_approach(x, noisy, segment, Sphere(RADIUS), time=time).modulus
        assert ("that at 2 µm/s" in " ".join(found.remarks)) is relaxes


def test_a_text_with_units_is_the_same_force_curve(tmp_path, run):
    x, force = approach(Sphere(RADIUS), noise=1e-12)
    units = {"force (nN)": 1e9, "Vertical Tip Position [nm]": 1e9}
    columns = [size * each for size, each in zip(units.values(), (force, -x), strict=True)]
    path = tmp_path / "curve.csv"
    np.savetxt(path, np.transpose(columns), delimiter=",", header=",".join(units), comments="")
    _, out, _ = run("identify", path, "--tip", TIP, "--json")
    answer = json.loads(out)["results"][0]
    # Written with 19 digits.
    assert answer["elastic_modulus"]["value"] == pytest.approx(
        fit_approach(x, force, None, Sphere(RADIUS)).modulus.value.value, rel=1e-6
    )
    assert answer["fixed"] == ["n"]
    tip = ("--tip", TIP, "--thickness", "4um")
    thin = json.loads(run("identify", path, *tip, "--json")[1])["results"][0]["elastic_modulus"]
    assert thin["tip"]["thickness"] == pytest.approx(4e-6)
    assert thin["value"] < 0.7 * answer["elastic_modulus"]["value"]
    for wrong in (("--tip", "cone:angle=20deg", "--thickness", "4um"), (*tip, "--poisson", "0.3")):
        code, _, error = run("identify", path, *wrong)
        assert (code, "thickness needs" in error) == (2, True)


def test_impossible_curves_and_depths_have_no_modulus():
    x = np.linspace(0.0, 1e-6, 500)
    noise = np.random.default_rng(2).normal(size=500)
    for force in (-x, np.full(500, np.nan)):
        with pytest.raises(RecordingError, match=r"curve: the approach has"):
            fit_approach(x, force, None, Sphere(RADIUS), source="curve")
    for few in (0, 39):
        with pytest.raises(RecordingError, match=f"the approach has {few} samples; it needs 40"):
            fit_approach(x[:few], noise[:few], None, Sphere(RADIUS))
    found = fit_approach(*approach(Sphere(0.2e-6), noise=1e-13), None, Sphere(0.2e-6)).modulus
    assert "larger than the sphere allows" in found.refused
    assert math.isnan(found.value.value)
    assert found.mark == "do-not-trust"


def recorded(*, retract):
    x, force = approach(Sphere(RADIUS), noise=1e-12)
    if retract:
        x, force = np.concatenate([x, x[::-1]]), np.concatenate([force, force[::-1]])
    time = 1e-3 * np.arange(x.size)
    channels = {"time": time, "tip position": -x, "force": force + 1e-10}
    if retract:
        channels["segment"] = np.repeat([0, 1], x.size // 2)
    return Recording(channels, source="curve", clocks={"force": "time", "tip position": "time"})


def test_only_an_approach_with_its_retract_has_a_damping():
    for retract in (False, True):
        curve = recorded(retract=retract)
        found = fit_force_curve(curve, Sphere(RADIUS))
        contact = prepare_force_curve(curve, found)
        assert contact.timeless is not retract
        result = palpate.identify(contact, palpate.VariableProjection(exponent=1.5))
        assert math.isfinite(result.diagnosis.working_depth.damping.value) is retract
        stiffness = result.diagnosis.working_depth.stiffness
        expected = 1.5 * found.K.value * result.depths[0] ** 0.5
        assert stiffness.value == pytest.approx(expected, rel=0.02)
        # The numbers of a force curve have one origin, whoever asks for them.
        assert result.elastic_modulus(Sphere(RADIUS)).value == found.modulus.value


@pytest.fixture(scope="module")
def map_file(tmp_path_factory):
    """A force map of four curves, of 1, 2, 3 and 4 kPa, in the counts of an instrument."""
    curves = []
    for number in range(4):
        x, force = approach(
            Sphere(RADIUS), modulus=1000.0 * (number + 1), depth=0.4e-6, noise=5e-12
        )
        x, force = np.concatenate([x, x[::-1]]), np.concatenate([force, force[::-1]])
        height = (40e-6 - x - force / SPRING_CONSTANT) / (HEIGHT_SCALE * VOLTS)
        deflection = force / (SENSITIVITY * SPRING_CONSTANT * VOLTS)
        curves.append((np.round(height), np.round(deflection)))
    return write_jpk(tmp_path_factory.mktemp("afm") / "map.jpk-force-map", curves)


def test_identify_fleet_and_map_give_the_same_modulus(map_file, run, tmp_path, threaded):
    from palpate.fleet.files import read_results
    from palpate.fleet.maps import map_of

    folder = tmp_path / "results"
    code, out, _ = run("fleet", map_file, "-o", folder, "--tip", TIP, "--workers", "1")
    assert code == 0
    assert "Young's modulus" in out
    assert "pass --tip" not in out
    out = run("fleet", map_file, "-o", tmp_path / "without", "--workers", "1")[1]
    assert "for Young's modulus of force curves pass --tip" in out
    table = read_results(folder)
    rows = table.to_pylist()
    for number, row in enumerate(rows):
        error = math.hypot(row["modulus_standard_error"], row["modulus_systematic"])
        assert abs(row["modulus"] - 1000.0 * (number + 1)) < 2.0 * error
        assert row["verdict_stiffness"] == row["verdict_modulus"] == "trust"
        assert row["verdict_damping"] is None
    code, out, _ = run("identify", map_file, "--curve", "2", "--tip", TIP, "--json")
    modulus = json.loads(out)["results"][0]["elastic_modulus"]
    assert (modulus["value"], modulus["mark"]) == (rows[2]["modulus"], "trust")
    found = map_of(table, ["index"])
    assert (found.quantity, found.unit, found.name) == ("modulus", "Pa", "Young's modulus")
    assert found.value.tolist() == [row["modulus"] for row in rows]
    code, out, _ = run("map", folder, "--by", "index", "--figure", tmp_path / "map.svg")
    assert out.startswith("Young's modulus over the whole contact: median 250")
    code, _, error = run("identify", map_file, "--curve", "2", "--tip", TIP, "--exponent", "1.5")
    assert (code, "drop the options for exponent" in error) == (2, True)
    code, _, error = run("identify", map_file, "--curve", "2", "--tip", TIP, "--stop", "0.3")
    assert (code, "drop the options for window" in error) == (2, True)


def test_arrays_with_a_tip_are_force_curves():
    from palpate.fleet.arrays import Curves, identify_curves
    from palpate.fleet.tasks import Settings

    x, force = approach(Sphere(RADIUS), noise=1e-12)
    curves = Curves(1e-3 * np.arange(x.size), np.stack([x, x]), np.stack([force, -force]))
    rows = identify_curves(curves, Settings(tip=Sphere(RADIUS)))[0].to_pylist()
    assert rows[0]["modulus"] == pytest.approx(2000.0, rel=0.02)
    assert "no contact in which the force rises" in rows[1]["error"]
