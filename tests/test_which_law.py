"""Which law it is, as a user meets it: asked for, named by a diagnosis, printed and compared."""

import functools
import json
import math

import faults
import pytest

import palpate
from palpate import (
    FlatSpectrum,
    GeneralisedHuntCrossley,
    InvalidParameterError,
    SingleRelaxation,
    figures,
    identify,
)
from palpate.diagnosis.finding import Laws, remedy_of_memory
from palpate.estimators.by_law import estimator_by_law, law_names
from palpate.estimators.law_verdicts import Candidate, LawVerdict, RankedModel
from palpate.results import view
from palpate.results.parameters import parameter_rows

# Of faults.LAW's stiffness; where the damper grows otherwise it is as large at 8 mm.
N = faults.LAW.exponent
WEAKER = faults.LAW.damping * 8e-3
BOX = FlatSpectrum(faults.STEP, 4096.0 * faults.STEP)
LAWS = {
    "Kelvin–Voigt": GeneralisedHuntCrossley(1300.0, 1.0, 17.0, 0.0),
    "half-space": GeneralisedHuntCrossley(9000.0, N, WEAKER, N - 1.0),
    "Hunt–Crossley with relaxation": GeneralisedHuntCrossley(9000.0, N, 15000.0, N, 4500.0, BOX),
    "half-space with relaxation": GeneralisedHuntCrossley(9000.0, N, WEAKER, N - 1.0, 4500.0, BOX),
    "one time": GeneralisedHuntCrossley(9000.0, N, 15000.0, N, 9000.0, SingleRelaxation(0.1)),
}


@functools.cache
def contact_of(name):
    time, x, v = faults.motion()
    return faults.contact(time, x, faults.noisy(LAWS[name].force_along(x, v, faults.STEP)))


@functools.cache
def identified(name, law=None):
    return identify(contact_of(name), law=law, trace=False)


def findings_of(result, check):
    return [each for each in result.diagnosis.findings if each.check == check]


@pytest.mark.parametrize("name", list(LAWS)[:4])
def test_the_diagnosis_of_another_law_names_the_better_one_and_the_law_finds_it(name):
    plain, chosen = identified(name), identified(name, "auto")
    [named] = findings_of(plain, "law")
    assert named.message.startswith(
        f"model selection clearly prefers {chosen.law_verdict.candidate.title} (ΔBIC "
    )
    moved = named.moves_stiffness_percent, named.moves_damping_percent
    words = (
        f"{name} {round(by):+d} %" for name, by in zip(("stiffness", "damping"), moved, strict=True)
    )
    assert ", ".join(words) in named.message
    assert named.remedy.startswith("run again with --law auto")
    assert str(chosen.law_verdict.candidate) == name
    assert findings_of(chosen, "law") == []


def test_where_it_is_hunt_crossley_or_two_materials_no_other_law_is_named():
    for seed in range(3):
        result = identify(faults.clean(seed), trace=False)
        assert findings_of(result, "law") == []
        assert str(result.law_verdict.candidate) == "Hunt–Crossley"
        assert result.diagnosis.verdict.overall == "trust"
    result = identify(faults.changed(0.3), trace=False)
    assert result.law_verdict.model_ranking[0].score == 0.0
    assert findings_of(result, "law") == []


def test_a_force_that_may_be_late_is_said_beside_the_law_that_looks_like_it():
    found = identified("half-space")
    [named] = findings_of(found, "law")
    assert len(findings_of(found, "delay")) == 1
    assert named.remedy == "run again with --law auto, unless the force is known to be late"
    assert findings_of(identify(faults.late(8e-3), trace=False), "law") == []


def test_what_the_better_law_moves_is_in_the_bars():
    plain = identified("one time")
    there, omega = plain.diagnosis.working_depth, plain.dynamic_stiffness().frequency
    exact = LAWS["one time"].dynamic_stiffness(there.depth, omega)
    for quantity, truth in ((there.stiffness, exact.real), (there.damping, exact.imag / omega)):
        bar = math.hypot(quantity.standard_error, quantity.systematic)
        assert abs(quantity.value - truth) < 2.0 * bar
        assert quantity.systematic > max(quantity.standard_error, 0.5 * abs(quantity.value - truth))


def test_a_law_that_does_not_predict_the_last_third_is_not_trusted():
    softer = faults.recorded(faults.FORCE * (1.0 - 0.3 * faults.TIME / faults.TIME[-1]))
    found = identify(softer, law="auto", trace=False)
    [held] = findings_of(found, "held-out force")
    assert held.message.startswith("the law of the first two thirds of the contact predicts the ")
    assert held.remedy.startswith("identify the recent part alone: --start 4.")
    assert held.stiffness == "with-care"
    there = found.diagnosis.working_depth
    truth = 0.7 * faults.LAW.stiffness_at(there.depth)
    assert abs(there.stiffness.value - truth) < 3.0 * there.stiffness.whole_error
    for name in ("Hunt–Crossley with relaxation", "half-space"):
        assert findings_of(identified(name, "auto"), "held-out force") == []


def laws_of(best, *others, own=False):
    law = GeneralisedHuntCrossley(1.0, 1.0, 1.0, 1.0)
    model_ranking = tuple(
        RankedModel(each, 12.0 * k, 1.0) for k, each in enumerate((best, *others))
    )
    return Laws(law, LawVerdict(best, model_ranking, 100.0, 50.0, 1e-3, 10.0), own, 2.0)


NONE, RELAXING = Candidate("half-space", "none"), Candidate("hunt-crossley", "spectrum")


@pytest.mark.parametrize(
    "laws, time, words",
    [
        (laws_of(RELAXING, NONE), 0.1, "run again with --law auto"),
        (laws_of(RELAXING, NONE, own=True), 0.1, "record at the speed of the task"),
        (laws_of(NONE, RELAXING), 0.1, "record at the speed of the task"),
        (laws_of(NONE, RELAXING), 34.0, "tare the sensor before each touch"),
        (laws_of(NONE, own=True), 0.1, "run again with --law auto"),
        (None, 0.1, "run again with --law auto"),
    ],
)
def test_the_remedy_of_a_memory_says_what_the_verdict_on_laws_says(laws, time, words):
    assert remedy_of_memory(laws, time).startswith(words)
    [memory] = findings_of(identified("Hunt–Crossley with relaxation"), "memory")
    assert memory.remedy == "run again with --law auto"


@pytest.mark.parametrize("law", law_names())
def test_each_law_that_can_be_asked_for_has_an_estimator(law):
    kind, settings = estimator_by_law(law)
    kind(**settings)
    assert estimator_by_law(law, kind.method)[1] == settings


@pytest.mark.parametrize("law", ["any", "flat", "single", "power-law", "half-space+single"])
def test_a_law_that_is_gone_is_refused_by_a_line_that_names_auto(refused, law):
    line = refused("identify", "no-file-is-read.csv", "--law", law)
    assert "auto" in line
    assert law in line


def test_a_law_is_found_by_its_usual_method_unless_another_is_named():
    for given, kind in (
        ((), palpate.VariableProjection),
        (("hunt-crossley",), palpate.VariableProjection),
        (("hunt-crossley", "single-stage"), palpate.SingleStageRLS),
        (("kelvin-voigt",), palpate.KelvinVoigtRLS),
    ):
        assert estimator_by_law(*given)[0] is kind
    settings = {"damping": "hunt-crossley", "memory": "none"}
    by_memory = estimator_by_law("hunt-crossley", "viscoelastic")
    assert by_memory == (palpate.ViscoelasticContact, settings)


@pytest.mark.parametrize(
    "given, words",
    [
        ({"law": "springy"}, "law must be one of hunt-crossley, auto, half-space, "),
        ({"law": "auto", "estimator": "single-stage"}, "only the hunt-crossley law"),
        (
            {"law": "kelvin-voigt", "estimator": "viscoelastic"},
            "not identify law kelvin-voigt",
        ),
        ({"law": "auto", "estimator": palpate.VariableProjection}, "method must be one of"),
        ({"law": 3}, "law must be one of"),
    ],
)
def test_a_law_that_is_not_there_or_does_not_go_with_the_method_is_refused(given, words):
    with pytest.raises(InvalidParameterError, match=words.replace("(", r"\(")):
        identify("no file is read before", **given)
    with pytest.raises(InvalidParameterError, match="excludes an estimator with settings"):
        identify("no file is read before", palpate.VariableProjection(), law="auto")


@pytest.mark.parametrize(
    "name, law, symbols, bound",
    [
        ("Kelvin–Voigt", "auto", "KnBp", {"n": "1", "p": "n − 1"}),
        ("half-space", "auto", "KnBp", {"p": "n − 1"}),
        ("one time", "auto", "KnBpMτ", {"p": "n", "τ": "0.09 ± 0.04 s"}),
        (
            "half-space with relaxation", "auto", "KnBpMτ",
            {"τ": "several relaxation times, 22.9 ms to 3 s"},
        ),
    ],
)  # fmt: skip
def test_a_law_is_printed_with_what_it_has(name, law, symbols, bound):
    rows = {row.symbol: row for row in parameter_rows(identified(name, law))}
    assert "".join(rows) == symbols
    for symbol, words in bound.items():
        assert rows[symbol].text == words
        assert not rows[symbol].estimated


def test_the_numbers_of_laws_of_any_kind_are_compared_at_one_frequency():
    name = "half-space with relaxation"
    plain, chosen = identified(name), identified(name, "auto")
    omega = plain.dynamic_stiffness().frequency
    depth = plain.diagnosis.working_depth.depth
    there, felt = plain.dynamic_stiffness(), chosen.dynamic_stiffness(omega, depth)
    assert there.stiffness == plain.diagnosis.working_depth.stiffness
    assert there.damping == plain.diagnosis.working_depth.damping
    exact = LAWS[name].dynamic_stiffness(depth, omega)
    assert felt.stiffness.value == pytest.approx(exact.real, rel=5e-3)
    assert felt.damping.value == pytest.approx(exact.imag / omega, rel=2e-2)
    assert felt.loss_tangent.value == pytest.approx(exact.imag / exact.real, rel=2e-2)
    relaxed = chosen.relaxed_stiffness(depth)
    truth = float(LAWS[name].relaxed().stiffness_at(depth))
    assert abs(relaxed.value - truth) < 3.0 * relaxed.whole_error < 0.2 * truth
    assert chosen.relaxation_time is None
    assert plain.relaxation_time is None


@pytest.mark.parametrize("law", [None, "auto"])
def test_what_the_motion_did_not_contain_is_refused_with_its_band(law):
    result = identified("half-space", law)
    own = result.dynamic_stiffness().frequency
    for omega in (0.49 * own, 2.01 * own, math.nan):
        with pytest.raises(InvalidParameterError, match="frequency must be"):
            result.dynamic_stiffness(omega)
    with pytest.raises(InvalidParameterError, match=r"band of the motion, .* Hz to .* Hz"):
        result.dynamic_stiffness(100.0 * own)


def test_where_hunt_crossley_is_selected_the_answer_is_that_of_the_default():
    plain, chosen = (identify(faults.clean(), law=law, trace=False) for law in (None, "auto"))
    assert chosen.method == plain.method
    assert chosen.law == plain.law
    assert chosen.dynamic_stiffness() == plain.dynamic_stiffness()
    assert chosen.law_verdict == plain.law_verdict


def test_a_law_that_relaxes_has_no_restitution_without_a_mass():
    remembering = identified("half-space with relaxation", "auto").restitution(0.05)
    assert math.isnan(remembering.coefficient.value)
    assert "for a law with memory it depends on the body's mass" in remembering.remarks[0]


@pytest.mark.parametrize("law", [None, "auto"])
def test_a_verdict_is_read_back_to_the_bit_and_said_in_one_line(law):
    result = identified("half-space with relaxation", law)
    written = json.loads(json.dumps(result.as_dict(), allow_nan=False))["law_verdict"]
    assert LawVerdict.from_dict(written) == result.law_verdict
    assert {each["memory"] for each in written["model_ranking"]} == {"none", "spectrum"}
    line = "Model selection: half-space damping with relaxation, rms error 29.7 mN, 0.492 N without"
    assert line in view.as_text([view.law(result)]).replace("\n", " ")
    assert "Model ranking" not in result.summary()


@pytest.mark.parametrize("width", [None, 88e-3])
def test_the_oscillations_of_laws_are_drawn_beside_each_other(width):
    name = "half-space with relaxation"
    figure = figures.draw_oscillations([identified(name), identified(name, "auto")], width=width)
    stiffness, damping = figure.axes
    assert [line.get_linestyle() for line in stiffness.lines] == ["-", "--"]
    labels = [axes.get_ylabel() for axes in (stiffness, damping)]
    assert labels == ["K′ [kN/m]", "B′ [N·s/m]"]
    assert stiffness.get_xlabel() == "frequency [Hz]"


def test_laws_within_two_of_the_score_are_not_distinguished():
    law = Candidate("hunt-crossley", "none")
    for score, expected in ((1.0, True), (5.0, False)):
        ranking = RankedModel(law, 0.0, 1.0), RankedModel(NONE, score, 1.1)
        words = str(LawVerdict(law, ranking, 100.0, 50.0, 1e-3, 10.0))
        assert ("cannot be distinguished from half-space damping" in words) is expected
        assert "rms error 1 N, 1.1 N with half-space damping; effective sample size 50" in words


def test_a_half_space_is_said_to_be_like_a_force_that_is_early():
    for name, expected in (("half-space", True), ("Hunt–Crossley with relaxation", False)):
        notes = {f.check: f.message for f in identified(name, "auto").diagnosis.findings}
        assert ("no check can distinguish half-space damping" in notes["skew"]) == expected
