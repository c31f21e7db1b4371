"""Force curves of AFMs exported as text: JPK, NanoScope and afmformats."""

import numpy as np
import pytest
from recordings import written

from palpate import open_recording
from palpate.identification.quantities.elastic_modulus import Sphere
from palpate.identification.quantities.indentation import fit_force_curve

STIFFNESS = 0.05  # N/m
SENSITIVITY = 4e-8  # m/V
TIP = Sphere(5e-6)
DEPTH = np.linspace(-4e-6, 1e-6, 600)  # m
FORCE = 2000.0 / 0.75 * TIP.factor * np.maximum(DEPTH, 0.0) ** 1.5  # E = 2 kPa, ν = 0.5
FORCE += np.random.default_rng(3).normal(0.0, 2e-11, 600)
HEIGHT = 5e-5 - DEPTH - FORCE / STIFFNESS


def jpk(columns: str, units: str, *values: np.ndarray) -> str:
    """A curve of two segments; the retract repeats the comments in its own order of time."""
    text = ""
    for segment, order in (("extend", 1), ("retract", -1)):
        text += f"# index: 1\n#\n# segment: {segment}\n# columns: {columns}\n"
        text += f"# springConstant: {STIFFNESS}\n# units: {units}\n#\n"
        rows = zip(*(each[::order] for each in values), strict=True)
        text += "".join(" ".join(f"{x:.7E}" for x in row) + "\n" for row in rows) + "\n"
    return text


def nanoscope(sign: float, order: int, deflection: str, size: float) -> str:
    """Extension and retraction side by side; the ramp grows, or falls, towards the sample."""
    ramp = -1e9 * sign * (HEIGHT - HEIGHT[0])[::order]
    bending = (FORCE / size)[::order]
    text = f"Calc_Ramp_Ex_nm\tCalc_Ramp_Rt_nm\t{deflection}_Ex\t{deflection}_Rt\n"
    rows = zip(ramp, ramp, bending, bending, strict=True)
    return text + "".join("\t".join(f"{x:.7g}" for x in row) + "\n" for row in rows)


VOLTS = STIFFNESS * SENSITIVITY
CURVES = {
    "JPK": (jpk("height vDeflection", "m N", HEIGHT, FORCE), {}),
    "JPK with the tip": (jpk("verticalTipPosition vDeflection", "m N", 5e-5 - DEPTH, FORCE), {}),
    "JPK in metres": (jpk("measuredHeight vDeflection", "m m", HEIGHT, FORCE / STIFFNESS), {}),
    "JPK in volts": (
        jpk("height vDeflection", "m V", HEIGHT, FORCE / VOLTS),
        {"sensitivity": SENSITIVITY},
    ),
    **{
        f"NanoScope {sign:+g} {order:+d}": (
            nanoscope(sign, order, "Defl_V", VOLTS),
            {"sensitivity": SENSITIVITY, "spring_constant": STIFFNESS},
        )
        for sign in (1.0, -1.0)
        for order in (1, -1)
    },
    "NanoScope in nm": (
        nanoscope(1.0, 1, "Defl_nm", 1e-9 * STIFFNESS),
        {"spring_constant": STIFFNESS},
    ),
}


@pytest.mark.parametrize("text, calibration", CURVES.values(), ids=CURVES)
def test_a_curve_exported_as_text_has_its_modulus(run, tmp_path, text, calibration):
    path = written(tmp_path / "curve.txt", text)
    read = open_recording(path, **calibration)
    assert np.unique(read.channels["segment"]).size == 2
    modulus = fit_force_curve(read, TIP).modulus.value
    assert abs(modulus.value - 2000.0) < 3.0 * modulus.whole_error
    assert modulus.whole_error < 100.0
    if calibration:
        status, _, err = run("identify", path)
        assert status == 2
        assert "--sensitivity 40nm/V" in err
        options = ["--sensitivity", "40nm/V", "--spring-constant", "50mN/m"]
        status, out, _ = run("identify", path, *options, "--tip", "sphere:radius=5um")
        assert (status, "Young's modulus" in out) == (0, True)


def test_an_approach_alone_in_volts_asks_for_the_calibration(run, tmp_path):
    approach = CURVES["JPK in volts"][0].partition("\n\n")[0] + "\n"
    status, _, err = run("identify", written(tmp_path / "approach.txt", approach))
    assert (status, "--sensitivity 40nm/V" in err) == (2, True)
