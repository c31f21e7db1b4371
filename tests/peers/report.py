"""Prints what every reference simulator was set to and what every estimator returned, as Markdown.

From the folder of the tests: ``python -m peers.report``.
"""

import platform
from datetime import date
from importlib.metadata import version

import numpy as np

from palpate import (
    ContactEstimator,
    DoubleStageRLS,
    DriftTracking,
    ExtendedKelvinVoigtRLS,
    HuntCrossley,
    KelvinVoigt,
    KelvinVoigtRLS,
    SingleStageRLS,
    VariableProjection,
    identify,
)
from peers.reference_simulators import (
    NOISE,
    REFERENCE_SIMULATORS,
    ReferenceSimulator,
    beside,
    sensed,
    shown_by,
)


def main() -> None:
    print("| simulator | set | motion in contact | largest force | deviation from its law |")
    print("|---|---|---|--:|--:|")
    for name, simulator in REFERENCE_SIMULATORS.items():
        print(_row(name, _numbers(simulator.law), *_shown(name, simulator)))
    print("\n| simulator | estimator | identified | error of each |\n|---|---|---|---|")
    for name, simulator in REFERENCE_SIMULATORS.items():
        for words, estimator, seed in _estimators(simulator.law):
            print(_row(name, words, *_returned(name, estimator, seed)))
    packages = ", ".join(f"{p} {version(p)}" for p in ("drake", "opensim", "palpate", "numpy"))
    print(f"\n{packages}, CPython {platform.python_version()}, {date.today().isoformat()}")


def _shown(name: str, simulator: ReferenceSimulator) -> list[str]:
    contact = shown_by(name)
    touching = contact.force > 0.0
    speed, depth = np.abs(contact.velocity[touching]), contact.penetration[touching]
    motion = f"to {1e3 * depth.max():.1f} mm, {1e3 * speed.max():.0f} mm/s"
    return [motion, f"{contact.force.max():.1f} N", f"{beside(contact, simulator.law):.0e}"]


def _estimators(law: HuntCrossley | KelvinVoigt) -> list[tuple[str, ContactEstimator, int | None]]:
    """In words, as it is built, and the seed of the force's noise if there is any."""
    if isinstance(law, KelvinVoigt):
        return [
            ("KelvinVoigtRLS", KelvinVoigtRLS(), None),
            ("ExtendedKelvinVoigtRLS", ExtendedKelvinVoigtRLS(), None),
            (f"KelvinVoigtRLS, {NOISE} N of noise", KelvinVoigtRLS(), 1),
        ]
    return [
        ("VariableProjection", VariableProjection(), None),
        ("SingleStageRLS", SingleStageRLS(), None),
        ("DoubleStageRLS", DoubleStageRLS(), None),
        ("DoubleStageRLS, from the truth", DoubleStageRLS(initial=law), None),
        (f"DriftTracking, noise={NOISE}", DriftTracking(noise=NOISE), None),
        ("DriftTracking", DriftTracking(), None),
        (f"VariableProjection, {NOISE} N of noise", VariableProjection(), 1),
    ]


def _returned(name: str, estimator: ContactEstimator, seed: int | None) -> tuple[str, str]:
    law = REFERENCE_SIMULATORS[name].law
    contact = shown_by(name) if seed is None else sensed(shown_by(name), seed)
    found = identify(contact, estimator).law
    if len(found.symbols) != len(law.symbols):
        return _numbers(found), "–"
    errors = found.parameters / law.parameters - 1.0
    return _numbers(found), ", ".join(f"{error:+.0e}" for error in errors)


def _numbers(law) -> str:
    return ", ".join(f"{value:.6g}" for value in law.parameters)


def _row(*cells: str) -> str:
    return f"| {' | '.join(cells)} |"


if __name__ == "__main__":
    main()
