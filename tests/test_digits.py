"""Numbers are written with the digits that their error allows."""

import math
import re
from decimal import Decimal

import numpy as np
import pytest
from uncertainties import ufloat

from palpate.cli import prepare_output
from palpate.digits import interval, rounded, with_error


@pytest.mark.parametrize(
    "value, errors, words",
    [
        (4321.0, [1600.0], "4300 ± 1600"),
        (2.0, [0.0018], "2.0000 ± 0.0018"),
        (1e5, [780.0], "(1.000 ± 0.008)·10⁵"),
        (17.5412, [0.0121], "17.541 ± 0.012"),
        (1.5e-9, [2e-10], "(1.50 ± 0.20)·10⁻⁹"),
        (12.0, [340.0], "10 ± 340"),
        (-0.01, [2.0], "0.0 ± 2.0"),
        (0.0, [1e-6], "(0.0 ± 1.0)·10⁻⁶"),
        (2001.0, [0.53, 40.0], "2000 ± 0.5 ± 40"),
        (2001.2, [0.53, 0.0], "2001.2 ± 0.5"),
        (5.0, [0.0], "5"),
        (3.0, [math.inf], "3 ± unknown"),
        (3.0, [0.1, math.nan], "3.00 ± 0.10 ± unknown"),
        (math.nan, [1.0], "unknown"),
        (5e-324, [5e-324], "(5 ± 5)·10⁻³²⁴"),
    ],
)
def test_a_number_is_written_with_the_digits_that_its_error_allows(value, errors, words):
    assert with_error(value, *errors) == words
    unit = "" if words == "unknown" else " N/m"
    assert with_error(value, *errors, unit="N/m") == words + unit


def test_the_digits_are_those_of_the_package_uncertainties():
    draw = np.random.default_rng(1)
    for value, relative in zip(
        10.0 ** draw.uniform(-8, 8, 400), 10.0 ** draw.uniform(-6, 2, 400), strict=True
    ):
        error = value * relative
        found = re.fullmatch(r"\(?(\S+?)\+/-([^)]+)\)?(e.*)?", f"{ufloat(value, error)}")
        ours = re.fullmatch(r"\(?(\S+) ± ([^)·]+)\)?(·10(.*))?", with_error(value, error))
        power = (ours[4] or "0").translate(str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789"))
        for k in (1, 2):
            theirs = Decimal(found[k] + (found[3] or ""))
            assert Decimal(ours[k] + f"e{power}") == theirs, (value, error)


@pytest.mark.parametrize(
    "value, error, words",
    [
        (4300.0, 900.0, "2500 to 6100"),
        (1.0013, 0.0006, "1.0001 to 1.0025"),
        (1e6, 2e4, "(0.961 to 1.039)·10⁶"),
        (1.0, 0.0, "unknown"),
    ],
)
def test_an_interval_has_the_digits_of_the_error(value, error, words):
    assert interval(value, error) == words


@pytest.mark.parametrize(
    "value, digits, words",
    [(1234567.0, 3, "1.23·10⁶"), (0.00123, 4, "0.00123"), (99999.7, 4, "1·10⁵"), (0.0, 3, "0")],
)
def test_a_number_without_an_error_is_rounded(value, digits, words):
    assert rounded(value, digits) == words


def test_powers_of_ten_reach_a_terminal_of_plain_letters():
    prepare_output()
    words = with_error(1.5e-12, 2e-13, unit="N·s/mⁿ⁺¹").encode("ascii", "palpate.plain")
    assert words == b"(1.50 +- 0.20)*10^-12 N*s/m^n+1"
