"""Curves of friction over the sliding velocity: Coulomb, viscous, Stribeck, uneven, and a monotone table."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from stickslip.estimate import Estimate
from stickslip.law.data import Samples, told
from stickslip.law.family import Family
from stickslip.laws.coulomb import Coulomb
from stickslip.laws.linear_slope import LinearSlope
from stickslip.laws.stribeck import Stribeck
from stickslip.laws.tabulated import Tabulated

Array = NDArray[np.float64]

EXPONENTS = (0.5, 1.0, 2.0)  # of Stribeck's curve, to begin with
SPEEDS = 12  # Stribeck speeds to begin with, from the slowest sliding to the fastest


def _with_offset(samples: Samples, *columns: Array) -> Array:
    """The columns, and a constant force where motion both ways tells it from friction."""
    return np.column_stack([*columns, np.ones(len(samples.velocity))] if samples.reverses else columns)


def _named(*names: str) -> dict[str, str]:
    units = {"viscous": "N s/m", "viscous_forward": "N s/m", "viscous_back": "N s/m", "speed": "m/s", "exponent": "1"}
    return {name: units.get(name, "N") for name in names}


def _parameters(*names: str) -> Callable[[Array, Array], dict[str, float]]:
    """Coefficients and shape in the order of the names; the offset last among the coefficients, if there is one."""

    def by_name(coefficients: Array, shape: Array) -> dict[str, float]:
        linear = [name for name in names if name not in ("speed", "exponent")]
        linear += ["offset"] * (len(coefficients) > len(linear))
        values = [*coefficients.tolist(), *shape.tolist()]
        return dict(zip([*linear, "speed", "exponent"], values, strict=False))

    return by_name


def _stribeck_columns(samples: Samples, logs: Array) -> Array:
    sign, speed = np.sign(samples.velocity), np.abs(samples.velocity)
    fall = np.exp(-((speed / np.exp(logs[0])) ** np.exp(logs[1])))
    return _with_offset(samples, sign * (1 - fall), sign * fall)


def _stribeck_viscous_columns(samples: Samples, logs: Array) -> Array:
    dry = _stribeck_columns(samples, logs)
    return np.column_stack([dry[:, :2], samples.velocity, dry[:, 2:]])


def _stribeck_starts(samples: Samples) -> tuple[Array, Array]:
    speed = np.abs(samples.velocity)
    return np.linspace(np.log(np.quantile(speed, 0.01)), np.log(speed.max()), SPEEDS), np.log(EXPONENTS)


def _stribeck_law(found: dict[str, float]) -> Stribeck:
    return Stribeck(**{name: value for name, value in found.items() if name != "offset"})


def _beware(found: dict[str, Estimate], samples: Samples) -> list[tuple[tuple[str, ...], str]]:
    """What Stribeck's curve says where nothing slid, or where friction does not fall."""
    slowest, unseen = float(np.abs(samples.velocity).min()), ("static", "speed", "exponent")
    if found["static"].value - found["kinetic"].value <= found["static"].interval[1] - found["static"].value:
        word = f"friction does not fall with speed above {told(slowest, f'{samples.unit}/s')} more than its scatter"
        return [(unseen, f"{word}: slide slower to tell a static friction and a Stribeck speed")]
    if slowest > found["speed"].value:
        word = f"the slowest sliding, {told(slowest, f'{samples.unit}/s')}, is above the Stribeck speed: slide slower"
        return [(unseen, word)]
    return []


def _uneven_columns(samples: Samples, logs: Array) -> Array:
    v = samples.velocity
    return np.column_stack([v > 0, np.maximum(v, 0), -1.0 * (v < 0), np.minimum(v, 0)])


COULOMB = Family(
    "f = kinetic sign(v) + offset", "v",
    lambda samples, logs: _with_offset(samples, np.sign(samples.velocity)),
    _parameters("kinetic"), _named("kinetic", "offset"), lambda found: Coulomb(found["kinetic"]),
)  # fmt: skip
VISCOUS = Family(
    "f = kinetic sign(v) + viscous v + offset", "v",
    lambda samples, logs: _with_offset(samples, np.sign(samples.velocity), samples.velocity),
    _parameters("kinetic", "viscous"), _named("kinetic", "viscous", "offset"),
    lambda found: LinearSlope(found["kinetic"], slope=found["viscous"]),
)  # fmt: skip
DRY_STRIBECK = Family(
    "f = (kinetic + (static - kinetic) exp(-(|v|/speed)^exponent)) sign(v) + offset", "v",
    _stribeck_columns, _parameters("kinetic", "static"),
    _named("kinetic", "static", "offset", "speed", "exponent"), _stribeck_law, _stribeck_starts, _beware,
)  # fmt: skip
STRIBECK = Family(
    "f = (kinetic + (static - kinetic) exp(-(|v|/speed)^exponent)) sign(v) + viscous v + offset", "v",
    _stribeck_viscous_columns, _parameters("kinetic", "static", "viscous"),
    _named("kinetic", "static", "viscous", "offset", "speed", "exponent"), _stribeck_law, _stribeck_starts, _beware,
    instead=DRY_STRIBECK, positive=("viscous",),
)  # fmt: skip
UNEVEN = Family(
    "f = kinetic_forward + viscous_forward v where v > 0, -kinetic_back + viscous_back v where v < 0", "v",
    _uneven_columns, _parameters("kinetic_forward", "viscous_forward", "kinetic_back", "viscous_back"),
    _named("kinetic_forward", "viscous_forward", "kinetic_back", "viscous_back"), lambda found: None,
)  # fmt: skip


def table(samples: Samples, points: int) -> Family:
    """A polygon through forces at speeds that as many samples lie between, rising or falling all the way."""
    speed = np.abs(samples.velocity)
    nodes = np.quantile(speed, np.linspace(0, 1, points)).tolist()
    names = [f"force_{number}" for number in range(1, points + 1)]

    def columns(some: Samples, logs: Array) -> Array:
        hats = np.stack([np.interp(np.abs(some.velocity), nodes, row) for row in np.eye(points)], axis=1)
        return _with_offset(some, *(np.sign(some.velocity)[:, None] * hats).T)

    def law(found: dict[str, float]) -> Tabulated:
        return Tabulated([0.0, *nodes], [found[names[0]], *(found[name] for name in names)])

    places = ", ".join(f"{node:.3g}" for node in nodes)
    return Family(
        f"f = F(|v|) sign(v) + offset, F a polygon through force_1 ... force_{points} at {places} m/s", "v", columns,
        _parameters(*names), _named(*names, "offset"), law, fitted=lambda made, data: _monotone(made, data, points),
    )  # fmt: skip


def _monotone(columns: Array, friction: Array, points: int) -> Array:
    """The coefficients of which the first `points` rise, or fall, all the way: whichever leaves less."""
    from scipy.optimize import lsq_linear

    best, least = np.empty(0), np.inf
    for side in (1.0, -1.0):
        steps = np.eye(columns.shape[1])
        steps[:points, :points] = np.tril(np.ones((points, points)))
        steps[:points, 1:points] *= side
        lowest = np.where((np.arange(len(steps)) >= 1) & (np.arange(len(steps)) < points), 0.0, -np.inf)
        gram = np.asarray(np.linalg.qr(np.column_stack([columns @ steps, friction]), mode="r"))
        found = lsq_linear(gram[:, :-1], gram[:, -1], bounds=(lowest, np.inf))
        if found.cost < least:
            best, least = steps @ found.x, float(found.cost)
    return best
