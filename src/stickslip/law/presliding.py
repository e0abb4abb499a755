"""Curves of friction over the displacement, with memory of the way back: Dahl, Jenkins, Iwan, Maxwell slip."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from stickslip.compiled import FAST, compiled
from stickslip.errors import EstimateError
from stickslip.estimate import Estimate
from stickslip.law.data import Samples, told
from stickslip.law.family import Family
from stickslip.laws.dahl import Dahl
from stickslip.laws.elastoslip import ElastoSlip

Array = NDArray[np.float64]

Beware = Callable[[dict[str, Estimate], Samples], list[tuple[tuple[str, ...], str]]]
SLIDES = 0.98  # of half a stroke: what holds longer never slides
DAHL_LENGTHS = 3.0  # over which Dahl's friction rises to 95 %
LENGTHS = 16  # presliding lengths to begin with, from a sample's way to half a stroke
POWERS = (0.5, 1.0, 2.0)  # of Dahl's parenthesis, to begin with
UNITS = {"kinetic": "N", "offset": "N", "stiffness": "N/m", "width": "m", "exponent": "1"}


@compiled(**FAST)
def _hold_and_slip(x, yields, out):
    """Deflection of elements that hold up to their yield displacement and then slip; relaxed at first."""
    for j in range(len(yields)):
        z, most = 0.0, yields[j]
        out[0, j] = 0.0
        for i in range(1, len(x)):
            z = min(most, max(-most, z + x[i] - x[i - 1]))
            out[i, j] = z


@compiled(**FAST)
def _yielding(x, length, power, out):
    """Dahl's friction over its level: along each step dF/dx = (1 - F sgn dx)^power / length, in closed form."""
    level = 0.0
    out[0] = 0.0
    for i in range(1, len(x)):
        step = x[i] - x[i - 1]
        side = 1.0 if step >= 0 else -1.0
        rest, way = max(0.0, 1 - level * side), abs(step) / length
        if abs(power - 1) < 1e-9:
            rest *= np.exp(-way)
        elif rest > 0:
            left = rest ** (1 - power) + (power - 1) * way
            rest = left ** (1 / (1 - power)) if left > 0 else 0.0
        level = side * (1 - rest)
        out[i] = level


def deflections(x: Array, yields: Array) -> Array:
    """Deflection [m] of each element of a yield displacement (n, j) along a displacement, relaxed at first."""
    out = np.empty((len(x), len(yields)))
    _hold_and_slip(np.ascontiguousarray(x), np.ascontiguousarray(yields), out)
    return out


def _of_dahl(samples: Samples, logs: Array) -> Array:
    out = np.empty(len(samples.displacement))
    _yielding(np.ascontiguousarray(samples.displacement), np.exp(logs[0]), np.exp(logs[1]), out)
    return np.column_stack([out, np.ones(len(out))])


def _of_jenkins(samples: Samples, logs: Array) -> Array:
    return np.column_stack([deflections(samples.displacement, np.exp(logs)), np.ones(len(samples.displacement))])


def _lengths(samples: Samples) -> tuple[Array]:
    step = float(np.median(np.abs(np.diff(samples.displacement))))
    return (np.linspace(np.log(max(step, 1e-4 * _half_stroke(samples))), np.log(_half_stroke(samples)), LENGTHS),)


def _half_stroke(samples: Samples) -> float:
    return float(np.ptp(samples.displacement)) / 2


def _beware(*, span: Callable[[dict[str, Estimate]], float]) -> Beware:
    """The friction where the motion is too short to slide, the stiffness where it is too coarse to give way."""

    def beware(found: dict[str, Estimate], samples: Samples) -> list[tuple[tuple[str, ...], str]]:
        length, half, unit = span(found), _half_stroke(samples), samples.unit
        step = float(np.median(np.abs(np.diff(samples.displacement))))
        if length > SLIDES * half:
            word = f"friction still rises {told(half, unit)} from the middle: larger strokes tell where it slides"
            return [(("kinetic",), word)]
        if length < step:
            word = (
                f"it gives way within a sample's {told(step, unit)}: sample faster, or move slower, to tell how stiffly"
            )
            return [(("stiffness",), word)]
        return []

    return beware


DAHL = Family(
    "df/dx = stiffness (1 - f/kinetic sign(v))^exponent, and offset", "x", _of_dahl,
    lambda c, shape: {"kinetic": c[0], "stiffness": c[0] / shape[0], "offset": c[1], "exponent": shape[1]}, UNITS,
    lambda found: Dahl(found["kinetic"], stiffness=found["stiffness"], exponent=found["exponent"]),
    lambda samples: (*_lengths(samples), np.log(POWERS)),
    _beware(span=lambda found: DAHL_LENGTHS * found["kinetic"].value / found["stiffness"].value),
)  # fmt: skip
JENKINS = Family(
    "df/dx = stiffness up to |f| = kinetic, and offset", "x", _of_jenkins,
    lambda c, shape: {"kinetic": c[0] * shape[0], "stiffness": c[0], "offset": c[1]}, UNITS,
    lambda found: ElastoSlip([found["stiffness"]], [found["kinetic"]]), _lengths,
    _beware(span=lambda found: found["kinetic"].value / found["stiffness"].value),
)  # fmt: skip


def iwan(elements: int) -> Family:
    """Iwan's model of that many classes, their yield displacements even up to a width."""
    middles = (np.arange(elements) + 0.5) / elements

    def columns(samples: Samples, logs: Array) -> Array:
        whole = deflections(samples.displacement, np.exp(logs[0]) * middles).mean(axis=1)
        return np.column_stack([whole, np.ones(len(whole))])

    return Family(
        f"Iwan's {elements} classes that yield evenly up to width, together of stiffness, and offset", "x", columns,
        lambda c, shape: {"kinetic": c[0] * shape[0] / 2, "stiffness": c[0], "width": shape[0], "offset": c[1]}, UNITS,
        lambda found: ElastoSlip.iwan(found["stiffness"], width=found["width"], elements=elements), _lengths,
        _beware(span=lambda found: found["width"].value),
    )  # fmt: skip


def maxwell_slip(samples: Samples, elements: int) -> Family:
    """Elements side by side, their yield displacements spread by equal ratios, those kept that bear something."""
    from scipy.optimize import nnls

    logs = _lengths(samples)[0]
    yields = np.exp(np.linspace(logs[0], logs[-1], elements))
    made = deflections(samples.displacement, yields)
    kept = nnls(made - made.mean(axis=0), samples.friction - samples.friction.mean())[0] > 0
    if not kept.any():
        raise EstimateError(
            "no element bears friction with the motion", "some friction follows the way", "fit 'coulomb' or 'viscous'"
        )  # fmt: skip
    yields = yields[kept]

    def columns(some: Samples, logs: Array) -> Array:
        return np.column_stack([deflections(some.displacement, yields), np.ones(len(some.displacement))])

    def parameters(c: Array, shape: Array) -> dict[str, float]:
        each = {f"stiffness_{number}": value for number, value in enumerate(c[:-1], start=1)}
        return {"kinetic": float(c[:-1] @ yields), "stiffness": float(c[:-1].sum()), **each, "offset": c[-1]}

    def law(found: dict[str, float]) -> ElastoSlip:
        stiff = np.array([found[f"stiffness_{number}"] for number in range(1, len(yields) + 1)])
        return ElastoSlip(stiff.tolist(), (stiff * yields).tolist())

    places = ", ".join(f"{each:.3g}" for each in yields)
    units = UNITS | {f"stiffness_{number}": "N/m" for number in range(1, len(yields) + 1)}
    formula = f"elements of stiffness_1 ... stiffness_{len(yields)} that slip at deflections of {places} m, and offset"
    beware = _beware(span=lambda found: float(yields[-1]))
    return Family(formula, "x", columns, parameters, units, law, beware=beware)
