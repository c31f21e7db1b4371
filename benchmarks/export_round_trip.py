"""The round trip: export a law, press it in the engine with noise, identify it."""

from dataclasses import replace

import numpy as np

import palpate
from benchmarks.export_laws import LAWS, made, there
from benchmarks.report import Limit, Row, Section
from palpate import exports, lab

SEEDS, NOISE = 20, 0.05  # N


def measure_round_trip() -> Section:
    """Export, record in the engine with 0.05 N of noise, identify, and return the errors."""
    rows = []
    for to, form, laws in (
        ("mujoco", "pair", tuple(LAWS)),
        ("mujoco", "callback", tuple(LAWS)),
        ("drake", "auto", tuple(LAWS)),
        ("opensim", "auto", ("n = 1.5",)),
    ):
        for law in laws if there(to) else ():
            worst, literal, biases = round_trips(made(law, to, form), law)
            name = f"{to}, {form}, {law}"
            rows += [
                Row(f"{name}: K, B, n", worst, "s.e.", limit=Limit(3.0)),
                Row(f"{name}: K, B, n, taken literally", literal, "s.e."),
                Row(f"{name}: stiffness or damping at depth, the mean", biases, "%"),
            ]
    notes = (
        "The stated error ε is one of force. It changes a parameter by s.e. · ε ‖F‖/σ at most, "
        "which is subtracted; taken literally it is that fraction of the parameter.",
    )
    return Section(f"Round trip: beyond the stated error, worst of {SEEDS} seeds", rows, notes)


def round_trips(export: exports.Export, law: str) -> tuple[float, float, float]:
    """Return the worst of K, B and n, both ways, in s.e.; bias of stiffness or damping, %."""
    bench = lab.Bench(
        exports.SimulatedContact(export), lab.THREE_SINES, lab.IdealProbe(), lab.PERFECT
    )
    clean, truth = bench.run(seed=0).contact, LAWS[law]
    stated = 0.01 * export.statement.compared.percent
    worst, literal, biases = [], [], []
    for seed in range(SEEDS):
        noise = NOISE * np.random.default_rng(seed).standard_normal(len(clean))
        result = palpate.identify(replace(clean, force=clean.force + noise), trace=False)
        off = np.abs(result.law.parameters - truth.parameters)
        errors = result.standard_errors
        size = float(np.linalg.norm(result.contact.force[result.trace.taken]))
        worst.append(float((off / errors).max()) - stated * size / NOISE)
        literal.append(float(((off - stated * truth.parameters) / errors).max()))
        there_ = result.working_depths[0]
        real = np.array([truth.stiffness_at(there_.depth), truth.damping_at(there_.depth)])
        biases.append(np.array([there_.stiffness.value, there_.damping.value]) / real - 1.0)
    return (
        max(0.0, *worst),
        max(0.0, *literal),
        100.0 * float(np.abs(np.mean(biases, axis=0)).max()),
    )
