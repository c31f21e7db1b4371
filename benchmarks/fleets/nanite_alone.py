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

RADIUS = 5e-6


def rated(curve: Any) -> dict[str, float]:
    """Modulus for a sphere, incompressible, and rating of a curve by nanite's own defaults.

    Its baseline, slope and contact point, and its weights near the contact point.
    """
    steps = ["compute_tip_position", "correct_force_offset", "correct_tip_offset"]
    curve.apply_preprocessing([*steps, "correct_force_slope"])
    initial = curve.get_initial_fit_parameters(model_key="hertz_para")
    initial["R"].value = RADIUS
    curve.fit_model(model_key="hertz_para", params_initial=initial, weight_cp=1e-6)
    modulus = curve.fit_properties["params_fitted"]["E"].value
    return {"modulus": float(modulus), "rating": float(curve.rate_quality())}


def main() -> None:
    folder = Path(sys.argv[1])
    found: list[dict[str, Any]] = []
    for path in sys.argv[2:]:
        groups = nanite.IndentationGroup(path), nanite.IndentationGroup(path)
        for curve, fresh in zip(*groups, strict=True):
            curve.apply_preprocessing(["compute_tip_position", "correct_tip_offset"])
            begun = time.process_time()
            curve.fit_model(
                model_key="hertz_para",
                weight_cp=0,
                segment=0,
                x_axis="tip position",
                y_axis="force",
                range_x=(0, 0),
                gcf_k=1.0,
            )
            seconds = time.process_time() - begun
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
            found.append({"file": name, "seconds": seconds, **parameters, **rated(fresh)})
    print(json.dumps(found))


if __name__ == "__main__":
    main()
