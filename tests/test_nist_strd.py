"""The nonlinear problems of NIST's Statistical Reference Datasets: certified digits, each from two starts."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from numpy import arctan, cos, exp, log, pi, sin
from numpy.typing import NDArray

from stickslip.errors import EstimateError
from stickslip.law.family import minimise

Array = NDArray[np.float64]
FOLDER = Path(__file__).parent / "data" / "nist_strd"
DIGITS = {"Lower": 6, "Average": 6, "Higher": 4}  # that a sound program agrees in


def enso(b: Array, x: Array) -> Array:
    year = b[1] * cos(2 * pi * x / 12) + b[2] * sin(2 * pi * x / 12)
    slow = b[4] * cos(2 * pi * x / b[3]) + b[5] * sin(2 * pi * x / b[3])
    return b[0] + year + slow + b[7] * cos(2 * pi * x / b[6]) + b[8] * sin(2 * pi * x / b[6])


def two_peaks(b: Array, x: Array) -> Array:
    peaks = b[2] * exp(-(((x - b[3]) / b[4]) ** 2)) + b[5] * exp(-(((x - b[6]) / b[7]) ** 2))
    return b[0] * exp(-b[1] * x) + peaks


def three_decays(b: Array, x: Array) -> Array:
    return b[0] * exp(-b[1] * x) + b[2] * exp(-b[3] * x) + b[4] * exp(-b[5] * x)


def cubic_ratio(b: Array, x: Array) -> Array:
    return (b[0] + b[1] * x + b[2] * x**2 + b[3] * x**3) / (1 + b[4] * x + b[5] * x**2 + b[6] * x**3)


MODELS: dict[str, Callable[[Array, Array], Array]] = {
    "Bennett5": lambda b, x: b[0] * (b[1] + x) ** (-1 / b[2]),
    "BoxBOD": lambda b, x: b[0] * (1 - exp(-b[1] * x)),
    "Chwirut1": lambda b, x: exp(-b[0] * x) / (b[1] + b[2] * x),
    "Chwirut2": lambda b, x: exp(-b[0] * x) / (b[1] + b[2] * x),
    "DanWood": lambda b, x: b[0] * x ** b[1],
    "ENSO": enso,
    "Eckerle4": lambda b, x: b[0] / b[1] * exp(-0.5 * ((x - b[2]) / b[1]) ** 2),
    "Gauss1": two_peaks,
    "Gauss2": two_peaks,
    "Gauss3": two_peaks,
    "Hahn1": cubic_ratio,
    "Kirby2": lambda b, x: (b[0] + b[1] * x + b[2] * x**2) / (1 + b[3] * x + b[4] * x**2),
    "Lanczos1": three_decays,
    "Lanczos2": three_decays,
    "Lanczos3": three_decays,
    "MGH09": lambda b, x: b[0] * (x**2 + b[1] * x) / (x**2 + b[2] * x + b[3]),
    "MGH10": lambda b, x: b[0] * exp(b[1] / (x + b[2])),
    "MGH17": lambda b, x: b[0] + b[1] * exp(-b[3] * x) + b[2] * exp(-b[4] * x),
    "Misra1a": lambda b, x: b[0] * (1 - exp(-b[1] * x)),
    "Misra1b": lambda b, x: b[0] * (1 - (1 + b[1] * x / 2) ** -2),
    "Misra1c": lambda b, x: b[0] * (1 - (1 + 2 * b[1] * x) ** -0.5),
    "Misra1d": lambda b, x: b[0] * b[1] * x / (1 + b[1] * x),
    "Nelson": lambda b, x: b[0] - b[1] * x[0] * exp(-b[2] * x[1]),
    "Rat42": lambda b, x: b[0] / (1 + exp(b[1] - b[2] * x)),
    "Rat43": lambda b, x: b[0] / (1 + exp(b[1] - b[2] * x)) ** (1 / b[3]),
    "Roszman1": lambda b, x: b[0] - b[1] * x - arctan(b[2] / (x - b[3])) / pi,
    "Thurber": cubic_ratio,
}


class Problem(NamedTuple):
    starts: Array  # (2, p)
    certified: Array  # (p,)
    sd: Array  # (p,)
    squares: float
    level: str
    data: Array
    x: Array


@cache
def problem(name: str) -> Problem:
    lines = (FOLDER / f"{name}.dat").read_text("ascii").splitlines()
    text = "\n".join(lines)
    rows = np.array([line.split("=")[1].split() for line in lines[40:58] if re.match(r"\s*b\d+ =", line)], dtype=float)
    data = np.array([line.split() for line in lines[60:] if line.strip()], dtype=float)
    (squares,) = re.findall(r"Residual Sum of Squares:\s*(\S+)", text)
    (level,) = re.findall(r"(Lower|Average|Higher) Level of Difficulty", text)
    y, x = data[:, 0], data[:, 1:].T
    y, x = (log(y), x) if name == "Nelson" else (y, x[0])
    return Problem(rows[:, :2].T, rows[:, 2], rows[:, 3], float(squares), level, y, x)


def digits(found: Array, certified: Array) -> float:
    """Of the worst parameter: the certified values have eleven."""
    return float(-np.log10(np.max(np.abs(found - certified) / np.abs(certified)) + 1e-11))


def test_all_problems_are_there() -> None:
    levels = [problem(name).level for name in MODELS]
    assert {level: levels.count(level) for level in DIGITS} == {"Lower": 8, "Average": 11, "Higher": 8}


@pytest.mark.parametrize("start", [0, 1])
@pytest.mark.parametrize("name", MODELS)
def test_certified_digits(name: str, start: int) -> None:
    given = problem(name)
    minimum = minimise(lambda b: MODELS[name](b, given.x), given.data, given.starts[start])
    least = DIGITS[given.level]
    assert minimum.settled
    assert digits(minimum.parameters, given.certified) >= least
    assert digits(minimum.sd, given.sd) >= 4 if name != "Lanczos1" else minimum.sd.max() < 1e-9
    if name != "Lanczos1":  # its squares, 1e-25, are of rounding alone
        assert minimum.squares == pytest.approx(given.squares, rel=1e-6)


def test_what_can_not_be_fitted_is_refused() -> None:
    with pytest.raises(EstimateError, match="2 samples for 2 parameters"):
        minimise(lambda b: b[0] + b[1] * np.arange(2.0), [1.0, 2.0], [0.0, 0.0])
    with pytest.raises(EstimateError, match="no finite value at the start"):
        minimise(lambda b: np.full(9, np.nan) * b[0], np.ones(9), [1.0])
