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
    identify,
)
from palpate.identification.diagnosis.material import relaxation_remedy
from palpate.identification.diagnosis.outcome import ModelSelection
from palpate.method.estimators.by_law import estimator_by_law, law_names
from palpate.method.estimators.law_verdicts import Candidate, LawVerdict, RankedModel
from palpate.output import figures
from palpate.output.results import view
from palpate.output.results.parameters import parameter_rows

# Of faults.LAW's stiffness; where the damper grows otherwise it is as large at 8 mm.
N = faults.LAW.n
WEAKER = faults.LAW.B * 8e-3
BOX = FlatSpectrum(faults.STEP, 4096.0 * faults.STEP)
LAWS = {
    "Kelvin–Voigt": GeneralisedHuntCrossley(K=1300.0, n=1.0, B=17.0, p=0.0),
    "half-space": GeneralisedHuntCrossley(K=9000.0, n=N, B=WEAKER, p=N - 1.0),
    "Hunt–Crossley with relaxation": GeneralisedHuntCrossley(
        K=9000.0, n=N, B=15000.0, p=N, M=4500.0, relaxation=BOX
    ),
    "half-space with relaxation": GeneralisedHuntCrossley(
        K=9000.0, n=N, B=WEAKER, p=N - 1.0, M=4500.0, relaxation=BOX
    ),
    "one time": GeneralisedHuntCrossley(
        K=9000.0, n=N, B=15000.0, p=N, M=9000.0, relaxation=SingleRelaxation(0.1)
    ),
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
def test_without_a_law_the_one_that_fits_best_is_selected(name):
    result, asked = identified(name), identified(name, "auto")
    assert str(result.law_verdict.candidate) == name
    assert repr(result.law) == repr(asked.law)
    there = result.diagnosis.working_depth
    exact = LAWS[name].dynamic_stiffness(there.depth, result.frequency)
    truth = exact.real, exact.imag / result.frequency
    for quantity, true in zip((there.stiffness, there.damping), truth, strict=True):
        assert abs(quantity.value - true) < 2.0 * quantity.whole_error
    plain = identified(name, "hunt-crossley")
    assert plain.law.power_law
    assert plain.law_verdict is None


def test_plain_materials_get_the_answer_of_variable_projection():
    for seed in range(3):
        result = identify(faults.clean(seed), trace=False)
        plain = identify(faults.clean(seed), law="hunt-crossley", trace=False)
        assert str(result.law_verdict.candidate) == "Hunt–Crossley"
        assert result.law.parameters.tolist() == plain.law.parameters.tolist()
        assert result.diagnosis.verdict.overall == "trust"
    assert identify(faults.changed(0.3), trace=False).law.power_law
    assert identify(faults.late(8e-3), trace=False).law.power_law


def laws_of(best, *others):
    law = GeneralisedHuntCrossley(K=1.0, n=1.0, B=1.0, p=1.0)
    model_ranking = tuple(
        RankedModel(each, 12.0 * k, 1.0) for k, each in enumerate((best, *others))
    )
    return ModelSelection(law, LawVerdict(best, model_ranking, 100.0, 50.0, 1e-3, 10.0), 2.0)


NONE, RELAXING = Candidate("half-space", "none"), Candidate("hunt-crossley", "spectrum")


@pytest.mark.parametrize(
    "laws, time, words",
    [
        (laws_of(RELAXING, NONE), 0.1, "record at the speed of the task"),
        (laws_of(NONE, RELAXING), 34.0, "tare the sensor before each touch"),
        (None, 0.1, "let palpate select the law: run again without --law"),
    ],
)
def test_the_remedy_of_a_memory_says_what_the_verdict_on_laws_says(laws, time, words):
    assert relaxation_remedy(laws, time).startswith(words)
    plain = identified("Hunt–Crossley with relaxation", "hunt-crossley")
    [memory] = findings_of(plain, "memory")
    assert memory.remedy == relaxation_remedy(None, 0.1)


@pytest.mark.parametrize("law", law_names())
def test_each_law_that_can_be_asked_for_has_an_estimator(law):
    kind, settings = estimator_by_law(law)
    kind(**settings)
    assert estimator_by_law(law, kind.method)[1] == settings


def test_a_law_selects_its_usual_method():
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
def test_an_unknown_or_unsuitable_law_is_refused(given, words):
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
    plain, chosen = identified(name, "hunt-crossley"), identified(name)
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
def test_a_frequency_outside_the_motion_is_refused_with_its_band(law):
    result = identified("half-space", law)
    own = result.dynamic_stiffness().frequency
    for omega in (0.49 * own, 2.01 * own, math.nan):
        with pytest.raises(InvalidParameterError, match="frequency must be"):
            result.dynamic_stiffness(omega)
    with pytest.raises(InvalidParameterError, match=r"band of the motion, .* Hz to .* Hz"):
        result.dynamic_stiffness(100.0 * own)


@pytest.mark.parametrize("law", [None, "auto"])
def test_a_verdict_is_read_back_to_the_bit_and_said_in_one_line(law):
    result = identified("half-space with relaxation", law)
    written = json.loads(json.dumps(result.as_dict(), allow_nan=False))["law_verdict"]
    assert LawVerdict.from_dict(written) == result.law_verdict
    assert {each["memory"] for each in written["model_ranking"]} == {"none", "spectrum"}
    line = "Model selection: half-space damping with relaxation, rms error 29.7 mN, 0.492 N without"
    assert line in view.as_text([view.law_section(result)]).replace("\n", " ")
    assert "Model ranking" not in result.summary()


@pytest.mark.parametrize("width", [None, 88e-3])
def test_the_oscillations_of_laws_are_drawn_beside_each_other(width):
    name = "half-space with relaxation"
    figure = figures.draw_oscillations(
        [identified(name, "hunt-crossley"), identified(name)], width=width
    )
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
