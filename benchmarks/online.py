"""``python -m benchmarks.online``: what a controller reads in the loop, every millisecond.

The laboratory's materials, tapped, pressed and swept, measured by sensors like the paper's and
prepared by :class:`OnlinePreparation`. Stiffness K′ and damping B′ are read after every sample, as
``estimate()`` gives them, and compared with the truth at the same depth and frequency. Materials
without memory are identified by variable projection, those that relax by ``ViscoelasticContact``.
"""

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.common.probing import NOISE, SAMPLE_TIME
from benchmarks.common.report import (
    Group,
    Limit,
    Line,
    Row,
    Section,
    at_least,
    describe_machine,
    publish,
    run_command,
)
from benchmarks.common.workers import Workers
from benchmarks.laboratory import SINGLE
from palpate import (
    ChangeDetector,
    Contact,
    ContactGate,
    FadingForgetting,
    OnlinePreparation,
    OutlierRejection,
    SelfPerturbation,
    SingleStageRLS,
    VariableProjection,
    ViscoelasticContact,
    lab,
)
from palpate.force_laws import ForceLaw, HuntCrossley
from palpate.method.estimators.contact_estimator import CompiledEstimator
from palpate.validation import Floats

COUNT = 19e-6  # m, a count of the encoders at the tip: 5.5 µm rms
BIAS = 0.1  # N, standard deviation of the sensor's bias
REST, SECONDS = 0.6, 3.6  # s in free air, and of the motion
FIRM = 5.0 * NOISE  # N
DEPTH = 6e-3  # m, where error bars are compared
SHARES = (0.1, 0.25, 0.5, 1.0)  # of a record
STAYS = 10  # samples for which a number must stay within its tolerance

Motion = Callable[[Floats, np.random.Generator], Floats]
Response = tuple[Floats, Floats]
Mask = NDArray[np.bool_]
PLAIN = ("ball", "sponge", "pvc", "inclusion")
RELAXING = ("tissue", "relaxing-sponge")
ONE_TIME = lab.Homogeneous(SINGLE, "one relaxation time")
MATERIALS: dict[str, lab.Material] = {
    **{name: lab.MATERIALS[name] for name in (*PLAIN, *RELAXING)},
    ONE_TIME.name: ONE_TIME,
}
# The zones, frozen: before, after, and the tolerance of K′.
SOFT, HARD = HuntCrossley(K=1e5, B=2e5, n=2.0), HuntCrossley(K=3e5, B=3e5, n=2.0)
ALIKE = HuntCrossley(K=1.07e5, B=2.14e5, n=2.0)
CHANGES = {
    "three times apart": ((SOFT, HARD, 0.1), (HARD, SOFT, 0.1)),
    "7 % apart": ((SOFT, ALIKE, 0.02), (ALIKE, SOFT, 0.02)),
}


def taps(time: Floats, rng: np.random.Generator) -> Floats:
    """Penetration of 1.3 taps a second, m."""
    begun = time - rng.uniform(0.0, 0.03)
    return -3e-3 + 12e-3 * np.sin(8.2 * begun) + 1.5e-3 * np.sin(1.7 * time)


def presses(time: Floats, rng: np.random.Generator) -> Floats:
    """Penetration of an approach and of the paper's three sines, m."""
    waves = 1e-3 * np.sin(4.0 * time) + 1.8e-3 * (np.sin(11.0 * time) + np.sin(15.0 * time))
    return -1e-3 + (9e-3 + waves) * approach(time, rng)


def sweeps(time: Floats, rng: np.random.Generator) -> Floats:
    """Penetration of an approach and of a sine whose frequency rises from 0.5 to 4 Hz, m."""
    turns = 0.5 * time + 0.5 * (4.0 - 0.5) / SECONDS * time**2
    return -1e-3 + (7e-3 + 3e-3 * np.sin(2.0 * math.pi * turns)) * approach(time, rng)


def approach(time: Floats, rng: np.random.Generator) -> Floats:
    """Rise from 0 to 1 within 0.3 to 0.6 s."""
    u = np.clip(time / rng.uniform(0.3, 0.6), 0.0, 1.0)
    return u**3 * (10.0 - 15.0 * u + 6.0 * u**2)


MOTIONS: dict[str, Motion] = {"taps": taps, "presses": presses, "sweeps": sweeps}


@dataclass(frozen=True)
class Switching:
    """A material that is another from a time [s] on."""

    before: ForceLaw
    after: ForceLaw
    at: float

    def force(self, time: Floats, _: Floats, x: Floats, v: Floats) -> Floats:
        """Return the force, N."""
        forces = np.where(time < self.at, self.before.force(x, v), self.after.force(x, v))
        return np.asarray(forces, dtype=np.float64)


def measure(
    material: lab.Material | Switching, motion: Motion, seed: int
) -> tuple[Contact, Floats]:
    """Return what the estimator gets, and the force without noise at its times."""
    rng = np.random.default_rng([seed, 62])
    time: Floats = np.arange(round((REST + SECONDS) / SAMPLE_TIME), dtype=np.float64) * SAMPLE_TIME
    x = motion(np.maximum(time - REST, 0.0), rng)
    force = material.force(time, np.zeros_like(time), x, np.gradient(x, SAMPLE_TIME))
    shift = rng.uniform(-0.5, 0.5)
    position = COUNT * (np.round(x / COUNT + shift) - shift)
    sensed = force + rng.normal(0.0, NOISE, time.size) + rng.normal(0.0, BIAS)
    preparation = OnlinePreparation(tare_time=0.5, sample_time=SAMPLE_TIME)
    contact = preparation.replay(position, sensed, time)
    return contact, np.interp(contact.time, time, force)


def response(material: lab.Material, depth: Floats, frequency: Floats) -> Response:
    """True K′ and B′ at depths [m] and angular frequencies [rad/s]."""
    x, omega = np.maximum(depth, 1e-9), np.maximum(frequency, 1e-3)
    law = material.law  # type: ignore[attr-defined]  # all materials here have one
    if isinstance(law, HuntCrossley):
        _, b, n = law.parameters
        stiffness, damping = n * law.parameters[0] * x ** (n - 1.0), b * x**n
        if isinstance(material, lab.Relaxing):
            tau = material.relaxation_time
            share = material.branch_stiffness / (1.0 + (omega * tau) ** 2)
            stiffness, damping = stiffness + share * (omega * tau) ** 2, damping + share * tau
        return stiffness, damping
    whole = np.array([law.dynamic_stiffness(*at) for at in zip(x, omega, strict=True)])
    return whole.real, whole.imag / omega


def watching(kind: type[CompiledEstimator]) -> CompiledEstimator:
    """Return the estimator of the loop on the page of a controller."""
    return kind(outlier_rejection=OutlierRejection(), change_detector=ChangeDetector())  # type: ignore[call-arg]


def single_stage(perturbation: SelfPerturbation | None = None) -> SingleStageRLS:
    """Return the paper's method, with P₀ = 1e3."""
    return SingleStageRLS(
        gate=ContactGate(0.0, FIRM, 0.8 * FIRM),
        forgetting=FadingForgetting(),
        outlier_rejection=OutlierRejection(),
        initial_covariance=1e3,
        perturbation=perturbation,
    )


READ = ("k", "k_error", "k_usable", "b", "b_error", "b_usable", "depth", "frequency")


def read(estimator: CompiledEstimator, contact: Contact) -> dict[str, Floats]:
    """Read an estimate after every sample."""
    rows, samples = np.empty((len(contact.time), len(READ))), columns(contact)
    for row, sample in zip(rows, samples, strict=True):
        estimator.update(*sample)
        now = estimator.estimate()
        k, b = now.stiffness, now.damping
        row[:] = (
            *(k.value, k.standard_error, k.usable, b.value, b.standard_error, b.usable),
            *(now.depth, now.frequency),
        )
    return dict(zip(READ, rows.T, strict=True))


def columns(contact: Contact) -> list[tuple[float, float, float]]:
    """Return the samples of a contact."""
    signals = contact.penetration, contact.velocity, contact.force
    return list(zip(*(signal.tolist() for signal in signals), strict=True))


def response_of_trace(estimator: CompiledEstimator, contact: Contact) -> Response:
    """K′ and B′ of a Hunt–Crossley law as identified, without bounds, at each sample."""
    trace = estimator.replay(contact.penetration, contact.velocity, contact.force)
    k, b, n = trace.parameters.T
    x = np.maximum(contact.penetration, 1e-9)
    with np.errstate(all="ignore"):
        return n * k * x ** (n - 1.0), b * x**n


def stays(within: Mask) -> float:
    """Return the ms until a number is within its tolerance and stays there for a while."""
    run = np.convolve(within, np.ones(STAYS), "valid") >= STAYS
    return float(np.argmax(run)) if run.any() else math.inf


Record = dict[str, Any]


def touch(run: tuple[str, str, int]) -> Record:
    """Measure one record: (material, motion, seed)."""
    name, motion, seed = run
    material, plain = MATERIALS[name], name in PLAIN
    contact, force = measure(material, MOTIONS[motion], seed)
    kind = VariableProjection if plain else ViscoelasticContact
    now = read(watching(kind), contact)
    true_k, true_b = response(material, now["depth"], now["frequency"])
    first = int(np.argmax(force > FIRM))
    firm = force > FIRM
    late = firm & (np.arange(force.size) >= first + round(1.0 / SAMPLE_TIME))
    k, b = now["k"] / true_k, now["b"] / true_b
    usable_k, usable_b = now["k_usable"] > 0.0, now["b_usable"] > 0.0
    after = slice(first, None)
    found: Record = {
        "seconds": float(firm.sum()) * SAMPLE_TIME,
        "bad K′": float(np.sum(usable_k[after] & (np.abs(k - 1.0) > 0.25)[after])),
        "bad B′": float(np.sum(usable_b[after] & (np.abs(b - 1.0) > 0.6)[after])),
        "safe K′": (k[firm] >= 0.5) & (k[firm] <= 2.0),
        "safe B′": (b[firm] >= 0.0) & (b[firm] <= 5.0),
        "usable": usable_k[firm],
        "usable K′ late": usable_k[late],
        "usable B′ late": usable_b[late],
        "extremes": np.array([k[firm].min(), k[firm].max(), b[firm].min(), b[firm].max()]),
        "first": float(np.argmax(usable_k[after])),
    }
    single = response_of_trace(single_stage(), contact)
    found["single"] = stays(np.abs(single[0] / true_k - 1.0)[after] < 0.1)
    found["errors"] = transient(k, b, firm, first)
    found["errors of single"] = transient(single[0] / true_k, single[1] / true_b, firm, first)
    if plain:
        law = response_of_trace(watching(kind), contact)
        found["errors of law"] = transient(law[0] / true_k, law[1] / true_b, firm, first)
        end = np.flatnonzero(firm & (np.arange(force.size) >= first + round(2.0 / SAMPLE_TIME)))
        found["late errors"] = np.array(
            [each[end] - 1.0 for each in (k, b, law[0] / true_k, law[1] / true_b)]
        )
    else:  # as by a law that cannot describe it
        other = read(watching(VariableProjection), contact)
        error = other["b"] / response(material, other["depth"], other["frequency"])[1] - 1.0
        wrong = (other["b_usable"] > 0.0) & (np.abs(error) > 0.6)
        found["bad B′ without memory"] = float(np.sum(wrong[after])) / found["seconds"]
    found["bars"] = bars(watching(kind), material, contact, first)
    return found


TRANSIENT = (0, 20, 50, 100, 200, 500, 1000)  # ms since touch


def transient(k: Floats, b: Floats, firm: Mask, first: int) -> list[tuple[Floats, Floats]]:
    """Return the relative errors of K′ and B′ in each interval since touch."""
    found = []
    for low, high in itertools.pairwise(TRANSIENT):
        part = slice(first + low, first + high)
        inside = firm[part]
        found.append((np.abs(k[part][inside] - 1.0), np.abs(b[part][inside] - 1.0)))
    return found


def bars(
    estimator: CompiledEstimator, material: lab.Material, contact: Contact, first: int
) -> Mask:
    """Return whether K′ and B′ at a depth lie within two error bars, after shares of a record."""
    samples, start, held = columns(contact), 0, []
    for share in SHARES:
        end = first + round(share * (len(samples) - first))
        for sample in samples[start:end]:
            estimator.update(*sample)
        start, now = end, estimator.estimate(at=DEPTH)
        truth = response(material, np.array([DEPTH]), np.array([now.frequency]))
        numbers = now.stiffness, now.damping
        held.append(
            [
                abs(number.value - exact[0]) < 2.0 * number.standard_error
                for number, exact in zip(numbers, truth, strict=True)
            ]
        )
    return np.array(held)


def recover(zones: Sequence[tuple[HuntCrossley, HuntCrossley, float]], seed: int) -> Floats:
    """Return the ms until K′ is right after changes: here, and with self-perturbation."""
    found = []
    for before, after, tolerance in zones:
        at = REST + np.random.default_rng([seed, 7]).uniform(2.0, 3.2)
        contact, _ = measure(Switching(before, after, at), presses, seed)
        change = int(np.searchsorted(contact.time, at))
        k, _, n = after.parameters
        exact = n * k * np.maximum(contact.penetration, 1e-9) ** (n - 1.0)
        here = read(watching(VariableProjection), contact)["k"]
        perturbed = response_of_trace(single_stage(SelfPerturbation()), contact)[0]
        numbers = here, perturbed
        found.append([stays(np.abs(n / exact - 1.0)[change:] < tolerance) for n in numbers])
    return np.array(found)


def main(*, seeds: int = 20, workers: int | None = None) -> None:
    """Measure, and print the tables.

    Parameters
    ----------
    seeds
        Records of each material and motion.
    workers
        Worker processes. Default: one per core.
    """
    processes = Workers(workers, seeds)
    runs = [
        (name, motion, seed) for name in MATERIALS for motion in MOTIONS for seed in range(seeds)
    ]
    records = processes.map("records", touch, runs)
    changes = {
        name: np.concatenate(processes.repeat(name, partial(recover, zones)))
        for name, zones in CHANGES.items()
    }
    publish([_reading(records), _changes(changes), _times(records)], describe_machine(seeds=seeds))


def _reading(records: Sequence[Record]) -> Section:
    def joined(name: str) -> Floats:
        return np.concatenate([np.atleast_1d(each[name]) for each in records])

    def share(name: str) -> float:
        return 100.0 * float(np.mean(joined(name)))

    seconds = float(np.sum(joined("seconds")))
    low, high, least, most = np.array([each["extremes"] for each in records]).T
    first, single = (float(np.median(joined(name))) for name in ("first", "single"))
    late = np.concatenate(
        [each["late errors"] for each in records if "late errors" in each], axis=1
    )
    rms = np.sqrt(np.mean(late**2, axis=1))
    name = "bad B′ without memory"
    without = float(np.mean([each[name] for each in records if name in each]))
    held = 100.0 * np.mean([each["bars"] for each in records], axis=0)
    rows = [
        Row(
            "usable, K′ off by > 25 %", np.sum(joined("bad K′")) / seconds, "ms/s", limit=Limit(1.0)
        ),
        Row(
            "usable, B′ off by > 60 %", np.sum(joined("bad B′")) / seconds, "ms/s", limit=Limit(3.0)
        ),
        Row("the same, a law without memory", without, "ms/s", limit=Limit(3.0)),
        Row("any K′ beyond 0.5–2 ×", 100.0 - share("safe K′"), "%", limit=Limit(0.2)),
        Row("any B′ beyond 0–5 ×", 100.0 - share("safe B′"), "%", limit=Limit(0.5)),
        Row("K′ usable", share("usable"), "%", limit=at_least(90.0)),
        Row("K′ usable after 1 s", share("usable K′ late"), "%", limit=at_least(98.0)),
        Row("B′ usable after 1 s", share("usable B′ late"), "%", limit=at_least(95.0)),
        Row("first usable K′", first, "ms", first / single, "single stage", Limit(1.2)),
        Row("K′ after 2 s, rms", 100.0 * rms[0], "%", rms[0] / rms[2], "the law", Limit(1.02)),
        Row("B′ after 2 s, rms", 100.0 * rms[1], "%", rms[1] / rms[3], "the law", Limit(1.02)),
        *(
            Row(f"{symbol} within two bars, {share:.0%}", value, "%", limit=at_least(90.0))
            for share, pair in zip(SHARES, held, strict=True)
            for symbol, value in zip(("K′", "B′"), pair, strict=True)
        ),
    ]
    notes = [
        f"From a force of 5 σ on; the extremes are {low.min():.2g} and {high.max():.2g} × of K′, "
        f"{least.min():.2g} and {most.max():.2g} × of B′.",
        "The single stage's time is that within 10 %; the law is `estimate().law`.",
    ]
    return Section("Read at every millisecond", rows, notes)


def _changes(changes: dict[str, Floats]) -> Section:
    rows = []
    for name, times in changes.items():
        here, perturbed = np.median(times, axis=0).tolist()
        ratio = here / perturbed
        rows.append(Row(f"zones {name}", here, "ms", ratio, "self-perturbation", Limit(1.0)))
    return Section("Until K′ is right after a change, median", rows)


def _times(records: Sequence[Record]) -> Group:
    plain = [each for each in records if "errors of law" in each]
    lines = []
    for k, (low, high) in enumerate(itertools.pairwise(TRANSIENT)):
        errors = [
            100.0 * float(np.percentile(np.concatenate([each[name][k][i] for each in plain]), 95.0))
            for name in ("errors", "errors of law", "errors of single")
            for i in (0, 1)
        ]
        lines.append(Line(f"{low}–{high} ms", tuple(errors)))
    methods = "estimate()", "its law", "single stage"
    return Group(
        "Error since touch, %",
        "95 % of the errors of the materials without memory are below.",
        tuple(f"{symbol}, {method}" for method in methods for symbol in ("K′", "B′")),
        lines,
    )


if __name__ == "__main__":
    run_command(main)
