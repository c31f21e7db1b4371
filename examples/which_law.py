"""Which law it is, in a loop of one's own: asked a few times a second, and K′ and B′ beside it.

    python examples/which_law.py [RECORDING.csv]

The recording stands in for the robot, as in ``online.py``. ``update`` and ``candidate`` take a
microsecond or two, ``verdict`` some ten, and ``dynamic_stiffness`` half a millisecond: where your
loop has not that, give a ``copy`` of the estimator to another thread, as is done here.
"""

import sys
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

from palpate import ChangeDetector, InvalidParameterError, OnlinePreparation, Status, prepare
from palpate import ViscoelasticContact as Estimator

SPONGE = Path(__file__).parent / "recordings" / "sponge.csv"


def main() -> None:
    """Feel one recording, sample by sample, and say which law it is."""
    contact = prepare(sys.argv[1] if len(sys.argv) > 1 else SPONGE)
    samples = zip(
        contact.time.tolist(), contact.penetration.tolist(), contact.force.tolist(), strict=True
    )
    step = contact.sample_time
    preparation = OnlinePreparation(sample_time=step)
    # memory="any" tells eleven laws apart in place of five, for twice the time.
    estimator = Estimator(sample_time=step, change_detector=ChangeDetector())
    in_force, ask_at, asked = None, 1.0, list[Future[str]]()
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
                print(f"{time:5.2f} s  {in_force or 'another material: none yet'}")
            if time >= ask_at:
                ask_at += 1.0
                asked.append(aside.submit(described, estimator.copy()))
            while asked and asked[0].done():
                print(f"{time:5.2f} s    {asked.pop(0).result()}")
    estimator.finish_pending()  # the last samples too
    print(described(estimator))


def described(estimator: Estimator) -> str:
    """The verdict and what a small oscillation feels, in one line."""
    verdict = estimator.verdict()
    if not verdict.model_ranking:
        return "no verdict yet"
    try:
        felt = estimator.dynamic_stiffness()
    except InvalidParameterError as error:  # the probe has hardly moved
        return f"{verdict}; {error}"
    flags = "".join(f"; {flag}" for flag in (*estimator.estimate().flags, *verdict.flags))
    return (
        f"{verdict}; K′ {felt.stiffness:.5g} ± {felt.stiffness_error:.2g} N/m, "
        f"B′ {felt.damping:.4g} ± {felt.damping_error:.2g} N·s/m at {1e3 * felt.depth:.2g} mm and "
        f"{felt.frequency:.3g} rad/s{flags}"
    )


if __name__ == "__main__":
    main()
