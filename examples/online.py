"""Identify in a control loop: one call per sample, and the law on request.

    python examples/online.py [RECORDING.csv]

The recording stands in for the robot. In a real loop the ``for`` is your 1 kHz timer, and the two
numbers come from your encoder and your force sensor. The preparation computes the velocity, and
delays position and force by as much as its filter does.
"""

import sys
from pathlib import Path

from palpate import ContactGate, OnlinePreparation, SingleStageRLS, prepare

BALL = Path(__file__).parent / "recordings" / "ball.csv"


def main() -> None:
    """Identify one recording, sample by sample."""
    contact = prepare(sys.argv[1] if len(sys.argv) > 1 else BALL)
    samples = zip(
        contact.time.tolist(), contact.penetration.tolist(), contact.force.tolist(), strict=True
    )
    preparation = OnlinePreparation(sample_time=contact.sample_time)
    # Use no force below ten times its noise, because ln F amplifies the noise of small forces.
    estimator = SingleStageRLS(gate=ContactGate(minimum_penetration=1e-4, make_force=0.6))
    report_at = 0.5
    for time, position, force in samples:
        sample = preparation.update(position, force, time)
        if sample is None:  # the filter's window is not full yet; preparation.status has the reason
            continue
        status = estimator.update(*sample)
        if sample.time >= report_at:
            report_at = sample.time + 0.5
            print(f"{sample.time:5.2f} s  {status.name:8}  {describe(estimator)}")
    print(f"   at the end  {describe(estimator)}")


def describe(estimator: SingleStageRLS) -> str:
    """Return the current estimate, in one line."""
    estimate = estimator.estimate()
    if not estimate.samples:
        return "no contact yet"
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
