"""As a controller would use it: one call a sample, and the law whenever somebody asks.

    python examples/online.py [RECORDING.csv]

The recording stands in for the robot. In a real loop the ``for`` is your 1 kHz timer, and the three
numbers come from your encoder, its velocity filter and your force sensor, all equally late.
"""

import sys
from pathlib import Path

from palpate import ContactGate, SingleStageRLS, prepare

BALL = Path(__file__).parent / "recordings" / "ball.csv"


def main() -> None:
    """Feel one recording, sample by sample."""
    contact = prepare(sys.argv[1] if len(sys.argv) > 1 else BALL)
    samples = zip(
        contact.time.tolist(),
        contact.penetration.tolist(),
        contact.velocity.tolist(),
        contact.force.tolist(),
        strict=True,
    )
    # Trust nothing below ten times the force noise: ln F has no patience with it.
    estimator = SingleStageRLS(gate=ContactGate(minimum_penetration=1e-4, make_force=0.6))
    report_at = 0.5
    for time, penetration, velocity, force in samples:
        status = estimator.update(penetration, velocity, force)
        if time >= report_at:
            report_at = time + 0.5
            print(f"{time:5.2f} s  {status.name:8}  {describe(estimator)}")
    print(f"   at the end  {describe(estimator)}")


def describe(estimator: SingleStageRLS) -> str:
    """What is known now, in one line."""
    estimate = estimator.estimate()
    if not estimate.samples:
        return "nothing touched yet"
    law = estimate.law
    parts = [
        f"{symbol} = {value:.5g} ± {error:.2g}"
        for symbol, value, error in zip(
            law.symbols, law.parameters, estimate.standard_errors, strict=True
        )
    ]
    limit = "" if estimate.valid else "  (too fast for eq. 10)"
    return ", ".join(parts) + limit


if __name__ == "__main__":
    main()
