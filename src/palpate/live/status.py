"""What a loop says of itself, beside the samples: for its board, and at its end."""

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from palpate.live.choices import main_settings
from palpate.live.counts import summed
from palpate.live.states import State
from palpate.preparation import OnlinePreparation
from palpate.validation import defined

if TYPE_CHECKING:
    from palpate.live.loop import Loop

_USUAL = OnlinePreparation().settings


def status_of(loop: "Loop") -> dict[str, Any]:
    """Return it as plain numbers and words, as JSON takes them."""
    law, counts = loop.estimator.law_type, loop.source.counts
    return {
        "source": loop.source.name,
        "sample_time": loop.source.sample_time,
        "delay": loop.preparation.delay,
        "tare": defined(loop.preparation.tare),
        "preparation": _in_words(loop.preparation),
        "method": loop.estimator.method,
        "settings": main_settings(loop.estimator),
        "generation": loop.generation,
        "law": {
            "kind": law.kind,
            "names": law.names(),
            "symbols": law.symbols,
            "units": law.units,
            # Places of those that are shown: some law on offer has them as its own.
            "shown": loop.laws.shown,
            "remembers": loop.laws.remembers,
        },
        "verdict": loop.laws.page(loop.estimator),
        "flags": loop.estimator.estimate().flags,
        "needs_condition_10": loop.estimator.needs_condition_10,
        "state": loop.state.name.lower(),
        "held": loop.held,
        # What is wrong now; one that is past was said.
        "fault": loop.watchdog.words if loop.state is State.INVALID else "",
        # What a person may choose of the source itself: {"material": [...], ...}.
        "offers": getattr(loop.source, "offers", {}),
        "chosen": getattr(loop.source, "chosen", {}),
        "origin": getattr(loop.source, "origin", 0),
        "record": loop.record,
        "counts": summed(
            {"late": loop.lateness.over},
            asdict(loop.counts),
            asdict(loop.watchdog.faults),
            asdict(counts),
        ),
        "cycle": loop.cycle.as_dict(),
        "lateness": loop.lateness.as_dict(),
        "said": loop.said,
    }


def _in_words(preparation: OnlinePreparation) -> str:
    """The settings that are not the usual ones."""
    usual = {name: repr(value) for name, value in _USUAL.items()}
    given = {name: repr(value) for name, value in preparation.settings.items()}
    return ", ".join(f"{name}={value}" for name, value in given.items() if value != usual[name])
