"""Select the law in your own loop: ask for the verdict, with K′ and B′, once a second.

    python examples/which_law.py [RECORDING.csv]

The recording stands in for the robot, as in ``online.py``. ``update`` and ``candidate`` take a
microsecond or two, ``verdict`` some ten, and ``dynamic_stiffness`` half a millisecond. If that is
too long for your loop, pass a ``copy`` of the estimator to another thread, as here.
"""

import sys
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

from palpate import ChangeDetector, InvalidParameterError, OnlinePreparation, Status, prepare
from palpate import ViscoelasticContact as Estimator

SPONGE = Path(__file__).parent / "recordings" / "sponge.csv"


def main() -> None:
    """Identify one recording, sample by sample, and print which law it is."""
    contact = prepare(sys.argv[1] if len(sys.argv) > 1 else SPONGE)
    samples = zip(
        contact.time.tolist(), contact.penetration.tolist(), contact.force.tolist(), strict=True
    )
    step = contact.sample_time
    preparation = OnlinePreparation(sample_time=step)
    estimator = Estimator(sample_time=step, change_detector=ChangeDetector())
    in_force, report_at, pending = None, 1.0, list[Future[str]]()
    with ThreadPoolExecutor(1) as aside:
        for time, position, force in samples:
            sample = preparation.update(position, force, time)
            if sample is None:
                if preparation.status is Status.RESTARTED:  # samples were missing
                    estimator.leave_contact()
                continue
            estimator.update(*sample)
            if estimator.candidate is not in_force:
                in_force = estimator.candidate
                print(f"{time:5.2f} s  {in_force or 'the material changed: no verdict yet'}")
            if time >= report_at:
                report_at += 1.0
                pending.append(aside.submit(describe, estimator.copy()))
            while pending and pending[0].done():
                print(f"{time:5.2f} s    {pending.pop(0).result()}")
    estimator.finish_pending()  # include the last samples
    print(describe(estimator))


def describe(estimator: Estimator) -> str:
    """Return the verdict and the response to a small oscillation, in one line."""
    verdict = estimator.verdict()
    if not verdict.model_ranking:
        return "no verdict yet"
    try:
        response = estimator.dynamic_stiffness()
    except InvalidParameterError as error:  # the probe has hardly moved
        return f"{verdict}; {error}"
    flags = "".join(f"; {flag}" for flag in (*estimator.estimate().flags, *verdict.flags))
    return (
        f"{verdict}; K′ {response.stiffness:.5g} ± {response.stiffness_error:.2g} N/m, "
        f"B′ {response.damping:.4g} ± {response.damping_error:.2g} N·s/m "
        f"at {1e3 * response.depth:.2g} mm and {response.frequency:.3g} rad/s{flags}"
    )


if __name__ == "__main__":
    main()
