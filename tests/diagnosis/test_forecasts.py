"""A weak prior, load transfer, and thirds that are held out."""

from dataclasses import replace

import numpy as np
import pytest
from cases import Floats

from palpate import (
    Contact,
    ContactGate,
    HuntCrossley,
    Recording,
    VariableProjection,
    ViscoelasticContact,
    compare,
    identify,
    identify_many,
    write_contact,
)
from palpate.findings import Check, Finding
from palpate.fleet.running import identify_batch
from palpate.fleet.tasks import Settings
from palpate.identifying import Identification
from palpate.input.preparation.from_penetration import Prepared
from palpate.input.preparation.places import Place, divide_by_place
from palpate.input.preparation.settings import Preparation
from palpate.input.preparation.surface import Surface

LAW = HuntCrossley(K=2e6, B=4e5, n=2.0)  # 50 N at 5 mm
GATE = ContactGate(1e-5, 1e-3, 1e-3)


def finding(result: Identification, check: str) -> list[Finding]:
    return [each for each in result.diagnosis.findings if each.check == check]


def contact_of(time: Floats, x: Floats, force: Floats, noise: float = 0.02) -> Contact:
    """A contact with noise on the force, and none of it above the surface."""
    random = np.random.default_rng(5).standard_normal(time.size)
    pressed = np.where(x > 0.0, force, 0.0) + noise * random
    return Contact(time=time, penetration=x, velocity=np.gradient(x, time), force=pressed)


def press(law: HuntCrossley = LAW, skin: float = 0.0, *, release: bool = False) -> Contact:
    """At 10 mm/s, from 1 mm above to 5 mm; with a stiffer part below 4 mm that the law has not."""
    time = np.arange(1200 if release else 600) * 1e-3
    x = -1e-3 + 10e-3 * np.minimum(time, 1.2 - time)
    x = x + 1e-5 * np.sin(30.0 * time)
    v = np.gradient(x, time)
    depth = np.maximum(x, 0.0)
    return contact_of(time, x, law.force(depth, v) + skin * np.maximum(depth - 3e-3, 0.0) ** 2)


def test_n_and_b_stay_within_the_prior_if_one_press_leaves_them_open() -> None:
    contact = press(skin=1e7)
    bounded, free = identify(contact), identify(contact, VariableProjection(weak_prior=False))
    assert not (1.0 <= free.law.n <= 2.0 and free.law.B >= 0.0)
    assert 1.0 <= bounded.law.n <= 2.0
    assert bounded.law.B >= 0.0
    assert np.isfinite(bounded.standard_errors).all()
    [said] = finding(bounded, "weak prior")
    assert "n from 1 to 2" in said.message
    assert not finding(bounded, "method")
    assert bounded.diagnosis.verdict.damping == "do-not-trust"
    # The release tells which is nearer.
    both = press(skin=1e7, release=True)
    after = slice(600, None)
    errors = [
        np.sqrt(np.mean((both.force - each.predicted_force(both))[after] ** 2))
        for each in (bounded, free)
    ]
    assert errors[0] < errors[1]


@pytest.mark.parametrize(
    "contact",
    [press(HuntCrossley(K=2e7, B=4e6, n=2.4)), press(skin=1e7, release=True)],
    ids=["one way, and the law holds", "both ways"],
)
def test_the_prior_is_not_used_where_the_samples_determine_n_and_b(contact: Contact) -> None:
    result = identify(contact)
    assert result.bounded is None
    assert not finding(result, "weak prior")


def touches(rises: float, count: int = 3, harder: float = 1.0) -> Contact:
    """Half sines of 4 mm from 2 mm above; on the way out the force rises by this part, or jumps."""
    time = np.arange(count * 800) * 1e-3
    phase = np.mod(time, 0.8) / 0.8
    x = -2e-3 + 6e-3 * np.sin(np.pi * phase)
    v = np.gradient(x, time)
    depth = np.maximum(x, 0.0)
    force = LAW.force(depth, v) * np.where(phase > 0.6, harder, 1.0)
    out = (phase > 0.5) & (x > 0.0)
    other = LAW.force(4e-3, 0.0) * (1.0 + rises * (phase - 0.5) / 0.1)
    return contact_of(time, x, np.where(out & (phase < 0.75) & (rises > 0.0), other, force))


def test_touches_end_where_the_force_rises_while_the_probe_withdraws() -> None:
    contact = touches(0.3)
    result = identify(contact)
    [said] = finding(result, "load transfer")
    assert said.message.startswith("in 3 touches")
    assert said.severity == "with-care"
    assert (result.contact.velocity[result.trace.taken] > -1e-3).all()
    assert result.law.force(3e-3, 0.01) == pytest.approx(LAW.force(3e-3, 0.01), rel=0.02)
    assert compare(contact)["single-stage"].contact.force.size == result.contact.force.size
    kept = identify(contact, VariableProjection(outlier_rejection=False))
    assert len(kept.contact) == len(contact)


@pytest.mark.parametrize(
    "contact",
    [touches(0.0), touches(0.3, count=1), touches(0.0, harder=1.6)],
    ids=["the law", "once", "borders of a material"],
)
def test_touches_of_the_law_and_changes_of_the_material_are_kept(contact: Contact) -> None:
    assert identify(contact).contact is contact


def known(values: list[object]) -> list[object]:
    """The values, with None for a damping that one way does not give."""
    return [None if isinstance(each, float) and np.isnan(each) else each for each in values]


def answer(result: Identification) -> list[object]:
    at = result.diagnosis.working_depth
    numbers = (at.depth, at.stiffness.value, at.stiffness.systematic, at.damping.value)
    return known([*result.law.parameters, *numbers, at.stiffness.mark, at.damping.mark])


def answer_in(row: dict[str, object]) -> list[object]:
    names = "K B n depth stiffness stiffness_systematic"
    names += " damping verdict_stiffness verdict_damping"
    return known([row[name] for name in names.split()])


@pytest.mark.parametrize("rejection", [None, False], ids=["rejecting", "keeping"])
def test_identify_fleet_and_identify_many_handle_load_transfer_alike(tmp_path, rejection):
    pa = pytest.importorskip("pyarrow")
    file = tmp_path / "heel.csv"
    write_contact(touches(0.3), file)
    method = VariableProjection(outlier_rejection=rejection)
    expected = answer(identify(file, method))
    [row] = identify_many([file], method=method, diagnosis="full").to_pylist()
    assert answer_in(row) == expected
    expected = answer(identify(file, ViscoelasticContact(outlier_rejection=rejection)))
    changed = {} if rejection is None else {"outlier_rejection": False}
    named = pa.table({"source": [str(file)], "kind": ["file"], "index": pa.array([None])})
    [row] = identify_batch(named, Settings(diagnosis="full", estimator=changed)).to_pylist()
    assert answer_in(row) == expected
    assert any(each["check"] == Check.LOAD_TRANSFER for each in row["findings"]) is (
        rejection is None
    )


def test_identify_many_excludes_load_transfer_like_identify() -> None:
    pytest.importorskip("pyarrow")
    contact = touches(0.3)
    arrays = {name: getattr(contact, name)[None] for name in ("penetration", "velocity", "force")}
    [row] = identify_many(**arrays, sample_time=1e-3).to_pylist()
    result = identify(contact)
    assert row["fit"] == "whole-curve"
    at = result.diagnosis.working_depth
    assert row["stiffness"] == pytest.approx(at.stiffness.value, rel=0.02)
    assert any(each["check"] == Check.LOAD_TRANSFER for each in row["findings"])
    assert row["samples"] == len(result.contact)


def test_places_keep_every_segment_that_load_transfer_cut() -> None:
    pytest.importorskip("pyarrow")
    contact, flat = touches(0.3, count=6), Surface(0.0, 0.0, "as given")
    ends = (0.0, 2.3995), (2.4, 5.0)
    places = tuple(Place(*times, np.zeros(3), None, flat) for times in ends)
    made = Prepared(Recording({}), Preparation(), places=places)
    contact = replace(contact, segment=(contact.time > 2.3995).astype(int), prepared=made)
    parts = identify(contact).by_place().segments
    kept = [len(list(part.contact.segments())) for part in parts]
    assert kept == [4, 4]  # three touches and what comes after the last
    assert sum(len(part.contact) for part in parts) == len(identify(contact).contact)
    rows = identify_many([contact], diagnosis="full").to_pylist()
    assert [answer_in(row) for row in rows] == [answer(part) for part in parts]
    whole = [own for _, own in divide_by_place(contact, rejecting=False)]
    assert sum(map(len, whole)) == len(contact)


@pytest.mark.long
def test_identify_and_identify_many_share_the_rule_of_damping_sign() -> None:
    pytest.importorskip("pyarrow")
    time = np.arange(1000) * 1e-3
    x = 4e-3 + 2e-3 * np.sin(12.0 * time) + 1e-3 * np.sin(31.0 * time)
    v = 24e-3 * np.cos(12.0 * time) + 31e-3 * np.cos(31.0 * time)
    laws = [HuntCrossley(K=2000.0, B=0.0, n=1.3)] * 20 + [HuntCrossley(K=2000.0, B=-2e3, n=1.3)]
    random = np.random.default_rng(2)
    force = np.array([law.force(x, v) + random.normal(0.0, 0.02, x.size) for law in laws])
    arrays = {"penetration": np.tile(x, (21, 1)), "velocity": np.tile(v, (21, 1)), "force": force}
    rows = identify_many(**arrays, sample_time=1e-3).to_pylist()
    assert sum(row["B"] < 0.0 for row in rows) > 5
    flagged = [
        any(flag["check"] == Check.NEGATIVE_DAMPING for flag in row["flags"]) for row in rows
    ]
    results = [identify(time=time, penetration=x, velocity=v, force=each) for each in force]
    assert flagged == [any("negative damping" in f for f in each.flags) for each in results]
    assert {each.diagnosis.verdict.damping for each in results} == {"do-not-trust"}
    reasons = [each.diagnosis.reason for each in results]  # of a spring's damping the sign is open
    assert flagged == [reason.startswith("the damping is negative") for reason in reasons]
    assert flagged == [False] * 20 + [True]


def swinging(softens: float = 0.0, last: float = 1.0) -> Contact:
    """Ten seconds at 1.5 Hz between 2 and 6 mm; K and B fall by this part, and change at last."""
    time = np.arange(5000) * 2e-3
    x = 4e-3 + 2e-3 * np.sin(2.0 * np.pi * 1.5 * time) + 0.5e-3 * np.sin(4.0 * time)
    v = np.gradient(x, time)
    factor = (1.0 - softens * time / 10.0) * np.where(time > 6.7, last, 1.0)
    return contact_of(time, x, LAW.force(x, v) * factor)


def test_a_recent_part_that_predicts_better_is_offered() -> None:
    [said] = finding(identify(swinging(softens=0.2)), "forecast")
    assert said.severity == "note"
    assert said.remedy is not None
    start = float(said.remedy.partition("--start ")[2])
    assert start == pytest.approx(6.67, abs=0.05)
    assert not finding(identify(swinging()), "forecast")


@pytest.mark.parametrize("last, mark", [(1.6, "trust"), (0.4, "do-not-trust")])
def test_an_unpredicted_last_third_is_not_trusted(last: float, mark: str) -> None:
    result = identify(swinging(last=last))
    assert result.law.power_law  # two materials are no memory
    diagnosis = result.diagnosis
    [said] = [each for each in diagnosis.findings if each.check == "forecast"]
    assert (said.stiffness, said.damping) == (mark, mark)
    assert diagnosis.verdict.overall == "do-not-trust"
    [change] = finding(result, "change")
    assert change.stiffness == change.damping == "with-care"
    assert len(diagnosis.episodes) == 2
