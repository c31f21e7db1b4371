"""``python -m benchmarks.diagnosis.forecasts``: others' recordings, one half from the other.

Contact samples are those of the notes beside each recording: penetration and force above their
thresholds, the window of time, the mask; the velocity is by the notes too. The first half of them,
in time, is identified, by itself ("contact") or with all that was recorded until then ("whole").
The law predicts the force of the second half from penetration and velocity; the rms error is over
that of plain least squares of K xⁿ + B xⁿ v + F₀ on the first half's contact samples.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.common.recordings import least_squares_law, read, with_notes
from benchmarks.common.report import markdown_table, run_command, show
from palpate import Contact, identify
from palpate.validation import Floats

LAWS = {"identify": None, "auto": "auto"}


def forecasts(path: Path, way: str) -> dict[str, tuple[float, float, str]]:
    """Error over plain least squares, per cent of the force, and verdict, for the requested law."""
    contact, good = read(path)
    first, second = good[: good.size // 2], good[good.size // 2 :]
    x, v, force = contact.penetration, contact.velocity, contact.force
    size = float(np.sqrt(np.mean(force[second] ** 2)))

    def error(predicted: Floats) -> float:
        return float(np.sqrt(np.mean((force[second] - predicted) ** 2)))

    plain = error(least_squares_law(x[first], v[first], force[first]).force(x[second], v[second]))
    rows = {"plain": (1.0, 100.0 * plain / size, "")}
    known = first if way == "contact" else np.arange(second[0])
    along = good if way == "contact" else np.arange(len(contact))
    for name, law in LAWS.items():
        found = identify(_part(contact, known), law=law, trace=False)
        predicted = found.predicted_force(_part(contact, along))[np.searchsorted(along, second)]
        verdict = found.diagnosis.verdict.overall
        rows[name] = error(predicted) / plain, 100.0 * error(predicted) / size, verdict
    return rows


def _part(contact: Contact, samples: NDArray[np.intp]) -> Contact:
    chosen = np.zeros(len(contact), dtype=bool)
    chosen[samples] = True
    return contact.taken(chosen)


def _mean(ratios: list[float]) -> float:
    return float(np.exp(np.mean(np.log(ratios))))


def forecast_page(recordings: list[Path]) -> list[str]:
    """The table of forecasts."""
    lines, summary = [], []
    for way in ("contact", "whole"):
        rows = [forecasts(each, way) for each in recordings]
        for recording, row in zip(recordings, rows, strict=True):
            cells = [f"{row['plain'][1]:.1f}"]
            for name in LAWS:
                ratio, part, verdict = row[name]
                cells += [f"{ratio:.2f}", f"{part:.1f}", verdict]
            lines.append([recording.stem, way, *cells])
        for name in LAWS:
            bad = [r for r in rows if r[name][1] > 100.0 and r[name][2] != "do-not-trust"]
            mean = _mean([row[name][0] for row in rows])
            summary.append([way, name, f"{mean:.3f}", len(bad)])
    heads = ["recording", "way", "plain, %"]
    for name in LAWS:
        heads += [f"{name} / plain", "%", "verdict"]
    short = ["way", "law", "geometric mean", "errors > 100 % without *do not trust*"]
    return [*markdown_table(heads, lines), "", *markdown_table(short, summary)]


def main() -> None:
    """Print the table."""
    show(forecast_page(with_notes()))


if __name__ == "__main__":
    run_command(main)
