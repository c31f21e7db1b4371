"""Fits of force maps by nanite, in a separate environment and process.

``python nanite_alone.py FOLDER MAP…`` writes the curves and its results to FOLDER. nanite is under
the GPL; no part of palpate imports it, and none of the extras contains it.
"""

import json
import sys
import time
from pathlib import Path
from typing import Any

import nanite
import numpy as np


def main() -> None:
    folder = Path(sys.argv[1])
    found: list[dict[str, Any]] = []
    for path in sys.argv[2:]:
        for curve in nanite.IndentationGroup(path):
            curve.apply_preprocessing(["compute_tip_position", "correct_tip_offset"])
            begun = time.perf_counter()
            curve.fit_model(
                model_key="hertz_para",
                weight_cp=0,
                segment=0,
                x_axis="tip position",
                y_axis="force",
                range_x=(0, 0),
                gcf_k=1.0,
            )
            seconds = time.perf_counter() - begun
            fit = curve.fit_properties
            if not fit.get("success"):
                continue
            approach = curve["segment"] == 0
            name = f"{len(found):04d}.npz"
            np.savez(
                folder / name,
                penetration=-np.asarray(curve["tip position"])[approach],
                force=np.asarray(curve["force"])[approach],
            )
            parameters = {key: each.value for key, each in fit["params_fitted"].items()}
            found.append({"file": name, "seconds": seconds, **parameters})
    print(json.dumps(found))


if __name__ == "__main__":
    main()
