"""Every public result prints a sentence or a table, not its fields."""

import numpy as np
import pytest

import palpate
from benchmarks.bank.springs import touch
from palpate import exports, lab
from palpate.lab import design

LAW = palpate.HuntCrossley(K=2000.0, B=2000.0, n=1.3)
LONGEST = 200  # characters of a line that dataclass would print


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """One of each result, by its name."""
    bench = lab.Bench(lab.MATERIALS["ball"], lab.THREE_SINES, lab.IdealProbe())
    measurement = bench.run(0, seconds=4.0)
    contact = measurement.contact
    result = palpate.identify(contact)
    saved, file = tmp_path_factory.mktemp("saved"), tmp_path_factory.mktemp("file") / "a.csv"
    result.save(saved)
    palpate.write_contact(contact, file)
    plan = design.design(LAW, noise=0.05)
    asked = result.with_query(palpate.QueryOptions(0.5, palpate.Sphere(0.2), 0.5, 6.0))
    specimen = palpate.QueryOptions(specimen=palpate.Specimen(3e-4, 2e-2))
    x, v, force = contact.penetration, contact.velocity, contact.force
    return {
        "identify": result,
        "a survey": result.by_segment(),
        "compare": palpate.compare(contact),
        "diagnose": result.diagnosis,
        "verdict": result.diagnosis.verdict,
        "finding": result.diagnosis.findings[0],
        "working depth": result.diagnosis.working_depth,
        "another depth": result.at(0.005),
        "stiffness": result.stiffness,
        "damping": result.damping,
        "law": result.law,
        "live verdict": result.law_verdict,
        "estimate": result.estimate,
        "trace": result.trace,
        "data": result.data,
        "oscillation": result.oscillation,
        "energy": asked.energy,
        "passivity": asked.passivity,
        "drop test": asked.restitution(0.5),
        "modulus": asked.elastic_modulus(palpate.Sphere(0.2), 0.5),
        "answers": asked.answers,
        "compression modulus": result.with_query(specimen).answers,
        "contact": contact,
        "recording": palpate.open_recording(file),
        "saved": palpate.load_result(saved),
        "simulate": measurement,
        "bench": bench,
        "design": plan,
        "planned precision": plan.planned,
        "curves": palpate.fit_curves(x[None], v[None], force[None]),
        "skew": palpate.skew(touch(1)[0]),
        "export": exports.export(result, "usd"),
        "statement": exports.export(result, "usd").statement,
        "online preparation": palpate.OnlinePreparation(),
        "fleet": palpate.identify_many([contact]).select(["stiffness", "damping"]),
        "payload": palpate.Payload(0.4, np.zeros(3), np.eye(3), np.zeros(6), mass_error=0.01),
    }


@pytest.mark.long
def test_every_result_prints_in_lines_that_can_be_read(results):
    for name, result in results.items():
        words = str(result)
        assert " at 0x" not in words, name
        fields = words.startswith(f"{type(result).__name__}(") and len(words) > LONGEST
        assert not fields, f"{name}: {words}"
        assert "array(" not in words, name


@pytest.mark.long
def test_printed_results_have_the_numbers(results):
    assert "2000" in str(results["working depth"])
    assert "variable-projection: <Identification" in str(results["compare"])
    assert str(np.round(float(results["stiffness"]))).startswith("2000")
    assert "planned" in str(results["design"])
