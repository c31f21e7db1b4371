"""Comparison with other packages: time a sample, and whether the numbers agree."""

from time import perf_counter

import numpy as np

from benchmarks.motion import Samples, contact_samples
from benchmarks.peers import BESIDES, ENGINE, NOTES, ONLINE, OURS, SINGLE_STAGE, Peer
from benchmarks.report import Limit, Row, Section
from benchmarks.timing import Clock, Effort

SAMPLES = 20_000


def compare_with_peers(clock: Clock, effort: Effort) -> Section:
    """Time every package on the same samples, and compare the last θ."""
    samples = contact_samples(SAMPLES)
    peers, notes = _installed({**OURS, **ONLINE, **BESIDES}, samples[:10])
    cases = {name: lambda p=peer: _seconds(p, samples) for name, peer in peers.items()}
    best = clock.best("other packages", cases, effort.peer_rounds)
    rows = [*_speeds(best), *_differences(peers, samples)]
    title = "Compared with other packages: single-stage regression, per sample"
    return Section(title, rows, [*NOTES, *notes])


def _installed(peers: dict[str, Peer], samples: Samples) -> tuple[dict[str, Peer], list[str]]:
    """Return those that can be imported, and a note on each that cannot."""
    present, notes = {}, []
    for name, peer in peers.items():
        try:
            peer(samples)
            present[name] = peer
        except ImportError as error:
            notes.append(f"no {name}: {error}; it is in the 'benchmark' extra")
    return present, notes


def _seconds(peer: Peer, samples: Samples) -> float:
    start = perf_counter()
    peer(samples)
    return (perf_counter() - start) / len(samples)


def _speeds(best: dict[str, float]) -> list[Row]:
    rows = []
    ours = best[SINGLE_STAGE]
    for name, seconds in best.items():
        if name == SINGLE_STAGE:
            rows.append(Row(name, 1e9 * seconds, "ns"))
            continue
        limit = Limit(50.0, at_least=True) if name in ONLINE else None
        rows.append(Row(name, 1e9 * seconds, "ns", seconds / ours, SINGLE_STAGE, limit))
    fastest = min((name for name in best if name in ONLINE), key=best.__getitem__)
    seconds = best[fastest]
    rows.append(Row(fastest, 1e9 * seconds, "ns", seconds / best[ENGINE], ENGINE))
    return rows


def _differences(peers: dict[str, Peer], samples: Samples) -> list[Row]:
    ours = OURS[ENGINE](samples)
    rows = []
    for name, peer in peers.items():
        if name != ENGINE:
            difference = float(np.max(np.abs(peer(samples) / ours - 1.0)))
            reference = f"of {ENGINE}"
            label = f"{name}: difference of θ, relative"
            rows.append(Row(label, difference, "", None, reference, Limit(1e-9)))
    return rows
