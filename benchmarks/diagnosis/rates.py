"""Rates and errors with limits, as a Markdown table."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

Row = dict[str, Any]
Rows = list[Row]
UNSTEADY = ("change", "gain drift")


def rates(rows: Rows) -> list[list[str]]:
    """Return each rate for the ideal probe and for the robot, and its limit."""
    banks = {bank: [row for row in rows if row["bank"] == bank] for bank in ("ideal", "robot")}
    figures: list[tuple[str, Callable[[Rows], str], str]] = [
        ("clean, not *trust*", _share(_is("clean"), _spoken), "≤ 1 %"),
        ("change of 5 % and more found", _share(_is("change"), _changed), "≥ 98 %"),
        ("… its time, largest error", _times, "–"),
        ("change named where there is none", _share(_steady, _changed), "≤ 1 %"),
        ("delay of 2 ms seen", _share(_is("delay", 2.0), _listed), "≥ 80 %"),
        ("delay of 3 ms and more seen", _share(_is("delay", 3.0, 5.0, 10.0), _listed), "100 %"),
        ("delay, error of those seen, rms; 95 %", _delays, "≤ 0.5 ms"),
        ("surface off 0.35 mm and more, seen", _share(_far, _listed), "≥ 90 %"),
        ("surface off 0.2 mm, seen", _share(_is("surface", 0.2), _listed), "–"),
        ("clean: S, C in printed standard errors, rms", _own_errors, "1"),
    ]
    return [[name, *(of(rows) for rows in banks.values()), limit] for name, of, limit in figures]


def _size(row: Row) -> float:
    """Return the number at the start of a severity."""
    return abs(float(row["severity"].split()[0].rstrip("%")))


def _is(kind: str, *sizes: float) -> Callable[[Row], bool]:
    return lambda row: row["kind"] == kind and (not sizes or _size(row) in sizes)


def _far(row: Row) -> bool:
    return row["kind"] == "surface" and _size(row) >= 0.35


def _steady(row: Row) -> bool:
    return row["kind"] not in UNSTEADY


def _spoken(row: Row) -> bool:
    return bool(row["overall"] != "trust")


def _listed(row: Row) -> bool:
    return bool(set(row["names"]) & set(row["named"]))


def _named(check: str) -> Callable[[Row], bool]:
    return lambda row: check in row["named"]


_changed = _named("change")


def _share(chosen: Callable[[Row], bool], counted: Callable[[Row], bool]) -> Callable[[Rows], str]:
    def of(rows: Rows) -> str:
        kept = [counted(row) for row in rows if chosen(row)]
        return f"{sum(kept)} of {len(kept)} ({100.0 * np.mean(kept):.1f} %)" if kept else "–"

    return of


def _delays(rows: Rows) -> str:
    """Of delays of 1 ms and more."""
    off = [
        1e3 * row["delay"] - float(row["severity"].split()[0])
        for row in rows
        if row["kind"] == "delay" and not math.isnan(row["delay"]) and _size(row) >= 1.0
    ]
    if not off:
        return "–"
    return f"{np.sqrt(np.mean(np.square(off))):.2f}; {np.percentile(np.abs(off), 95):.2f} ms"


def _times(rows: Rows) -> str:
    off = [
        min((abs(time - 4.0) for time in row["changes"]), default=math.nan)
        for row in rows
        if row["kind"] == "change"
    ]
    return f"{1e3 * np.nanmax(off):.2g} ms" if off else "–"


def _own_errors(rows: Rows) -> str:
    clean = [row for row in rows if row["kind"] == "clean"]
    parts = [
        np.sqrt(np.nanmean([row[name] ** 2 for row in clean]))
        for name in ("stiffness_deviation", "damping_deviation")
    ]
    return f"{parts[0]:.2f}, {parts[1]:.2f}" if clean else "–"
