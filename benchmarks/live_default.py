"""``python -m benchmarks.live_default``: which estimator a live run should start with.

How far K′ and B′ are from those that ``identify`` finds in the whole run, so long after the first
contact; and after a change of the material, how soon the prediction has recovered.
"""

import numpy as np

from benchmarks.common.probing import NOISE, feed, sines
from benchmarks.common.report import Row, Section, describe_machine, publish, run_command
from palpate import VariableProjection, ViscoelasticContact, identify, lab
from palpate.force_laws import ForceLaw, GeneralisedHuntCrossley
from palpate.live.running import default_estimator
from palpate.method.estimators import ContactEstimator

KINDS = (ViscoelasticContact, VariableProjection)
MATERIALS = ("ball", "sponge", "pvc", "tissue", "relaxing-sponge")
SECONDS = 21.0
AFTER = (1.0, 5.0, 18.0)  # s after the first contact
CHANGES = (("pvc", "inclusion"), ("inclusion", "pvc"), ("ball", "sponge"), ("sponge", "ball"))
RECOVERED = 5  # samples over which the mean error is below 2 σ


def started(kind: type[ContactEstimator]) -> ContactEstimator:
    """Return an estimator with the settings of a live run at 1 kHz."""
    made = default_estimator(kind)
    return made.replace(sample_time=1e-3) if "sample_time" in made.settings else made


def response(law: ForceLaw, depth: float, frequency: float) -> complex:
    """Return K′ + iωB′."""
    if isinstance(law, GeneralisedHuntCrossley):
        return complex(law.dynamic_stiffness(depth, frequency))
    return complex(law.stiffness_at(depth), frequency * law.damping_at(depth))


def differences(material: str, seed: int) -> np.ndarray:
    """Return relative differences, shape (kinds, times, 2)."""
    contact = lab.Bench(lab.MATERIALS[material], lab.THREE_SINES).run(seed, seconds=SECONDS).contact
    result = identify(contact, trace=False)
    depth, frequency = result.diagnosis.working_depth.depth, result.frequency
    exact = response(result.law, depth, frequency)
    first = int(np.flatnonzero(contact.penetration > 0.0)[0])
    columns = (contact.penetration, contact.velocity, contact.force)
    ends = [first + round(1e3 * each) + 1 for each in AFTER]
    found = []
    for kind in KINDS:
        for estimate in feed(started(kind), *columns, ends):
            now = response(estimate.law, depth, frequency)
            found.append((now.real / exact.real - 1.0, now.imag / exact.imag - 1.0))
    return np.array(found).reshape(len(KINDS), len(AFTER), 2)


def recovery(kind: type[ContactEstimator], change: tuple[str, str], seed: int) -> float:
    """Return the ms until the mean prediction error over 5 ms is below twice the noise."""
    rng = np.random.default_rng(seed)
    at = int(rng.integers(5000, 8000))
    x, v = sines(0.001 * at + 0.5)
    time = np.arange(len(x), dtype=np.float64) * 1e-3
    before, after = (lab.MATERIALS[name].force(time, time, x, v) for name in change)
    force = np.where(np.arange(len(x)) < at, before, after)
    force += rng.normal(0.0, NOISE, len(x))
    errors = np.abs(started(kind).replay(x, v, force).predicted_force - force)[at:]
    means = np.convolve(errors, np.full(RECOVERED, 1.0 / RECOVERED), "valid")
    return float(np.argmax(means < 2.0 * NOISE))


def measure(seeds: int) -> list[Section]:
    """Measure both, for the default and for variable projection."""
    runs = {name: [differences(name, seed) for seed in range(seeds)] for name in MATERIALS}
    rows = []
    for name, each in runs.items():
        rms = 100.0 * np.sqrt(np.mean(np.square(each), axis=0))
        for kind, (k, seconds) in ((p, t) for p in range(len(KINDS)) for t in enumerate(AFTER)):
            for part, symbol in enumerate(("K′", "B′")):
                what = f"{name}, {KINDS[kind].method}, after {seconds:g} s: {symbol}"
                rows.append(Row(what, float(rms[kind, k, part]), "%"))
    late = [
        Row(
            f"{' → '.join(change)}, {kind.method}",
            float(np.percentile([recovery(kind, change, seed) for seed in range(3 * seeds)], 95.0)),
            "ms",
        )
        for change in CHANGES
        for kind in KINDS
    ]
    notes = [f"{seeds} seeds; the laboratory's robot and sensors, three sines."]
    return [
        Section("Rms difference from identify of the whole run", rows, notes),
        Section("Until recovery after a change, 95 % of the runs", late, [f"{3 * seeds} seeds."]),
    ]


def main(*, seeds: int = 4) -> None:
    """Measure, and print the tables.

    Parameters
    ----------
    seeds
        Runs of each material.
    """
    publish(measure(seeds), describe_machine())


if __name__ == "__main__":
    run_command(main)
