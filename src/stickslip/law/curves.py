"""Curves of friction over the sliding velocity: Coulomb, viscous, Stribeck, uneven, and a monotone table.

Rate-and-state friction, fitted to a step of the driving velocity.

Curves of friction over the displacement, with memory of the way back: Dahl, Jenkins, Iwan, Maxwell slip.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from stickslip.arrays import Array
from stickslip.compiled import FAST, compiled
from stickslip.errors import EstimateError
from stickslip.estimate import Estimate
from stickslip.law.data import Samples, told
from stickslip.law.family import Family
from stickslip.laws.compliant import Dahl
from stickslip.laws.coulomb import Coulomb, LinearSlope
from stickslip.laws.series import ElastoSlip
from stickslip.laws.state_variable import RateState
from stickslip.laws.stribeck import Stribeck, Tabulated

EXPONENTS = (0.5, 1.0, 2.0)  # of Stribeck's curve, to begin with
SPEEDS = 12  # Stribeck speeds to begin with, from the slowest sliding to the fastest

LEAST_STEP = 1.2  # ratio of the two speeds
LEAST_WAY = 1.5  # times the way from its first reading to its last, from which on a displacement goes to and fro
STALLED = 1e5  # times the fastest rate's time, in one sample
RATIOS = (0.5, 1.0, 1.5)  # b over a, to begin with
DISTANCES = 8  # ways of renewal to begin with, from that of a few samples to that after the step
STIFFNESSES = 6  # to begin with: friction follows the step within the record, or within a few samples
STEP_UNITS = {
    "friction": "1", "direct": "1", "evolution": "1", "rate_dependence": "1", "distance": "m", "stiffness": "N/m",
    "trend": "1/m",
}  # fmt: skip

Beware = Callable[[dict[str, Estimate], Samples], list[tuple[tuple[str, ...], str]]]
SLIDES = 0.98  # of half a stroke: what holds longer never slides
DAHL_LENGTHS = 3.0  # over which Dahl's friction rises to 95 %
LENGTHS = 16  # presliding lengths to begin with, from a sample's way to half a stroke
POWERS = (0.5, 1.0, 2.0)  # of Dahl's parenthesis, to begin with
UNITS = {"kinetic": "N", "offset": "N", "stiffness": "N/m", "width": "m", "exponent": "1"}


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


def _stribeck_law(values: dict[str, float]) -> Stribeck:
    return Stribeck(**{name: value for name, value in values.items() if name != "offset"})


def _beware(estimates: dict[str, Estimate], samples: Samples) -> list[tuple[tuple[str, ...], str]]:
    """What Stribeck's curve says where nothing slid, or where friction does not fall."""
    slowest, unseen = float(np.abs(samples.velocity).min()), ("static", "speed", "exponent")
    static = estimates["static"]
    if static.value - estimates["kinetic"].value <= static.interval[1] - static.value:
        word = f"friction does not fall with speed above {told(slowest, f'{samples.unit}/s')} more than its scatter"
        return [(unseen, f"{word}: slide slower to tell a static friction and a Stribeck speed")]
    if slowest > estimates["speed"].value:
        word = f"the slowest sliding, {told(slowest, f'{samples.unit}/s')}, is above the Stribeck speed: slide slower"
        return [(unseen, word)]
    return []


def _uneven_columns(samples: Samples, logs: Array) -> Array:
    v = samples.velocity
    return np.column_stack([v > 0, np.maximum(v, 0), -1.0 * (v < 0), np.minimum(v, 0)])


COULOMB = Family(
    "f = kinetic sign(v) + offset",
    "v",
    lambda samples, logs: _with_offset(samples, np.sign(samples.velocity)),
    _parameters("kinetic"),
    _named("kinetic", "offset"),
    lambda values: Coulomb(values["kinetic"]),
)
VISCOUS = Family(
    "f = kinetic sign(v) + viscous v + offset",
    "v",
    lambda samples, logs: _with_offset(samples, np.sign(samples.velocity), samples.velocity),
    _parameters("kinetic", "viscous"),
    _named("kinetic", "viscous", "offset"),
    lambda values: LinearSlope(values["kinetic"], slope=values["viscous"]),
)
DRY_STRIBECK = Family(
    "f = (kinetic + (static - kinetic) exp(-(|v|/speed)^exponent)) sign(v) + offset",
    "v",
    _stribeck_columns,
    _parameters("kinetic", "static"),
    _named("kinetic", "static", "offset", "speed", "exponent"),
    _stribeck_law,
    _stribeck_starts,
    _beware,
)
STRIBECK = Family(
    "f = (kinetic + (static - kinetic) exp(-(|v|/speed)^exponent)) sign(v) + viscous v + offset",
    "v",
    _stribeck_viscous_columns,
    _parameters("kinetic", "static", "viscous"),
    _named("kinetic", "static", "viscous", "offset", "speed", "exponent"),
    _stribeck_law,
    _stribeck_starts,
    _beware,
    instead=DRY_STRIBECK,
    positive=("viscous",),
)
UNEVEN = Family(
    "f = kinetic_forward + viscous_forward v where v > 0, -kinetic_back + viscous_back v where v < 0",
    "v",
    _uneven_columns,
    _parameters("kinetic_forward", "viscous_forward", "kinetic_back", "viscous_back"),
    _named("kinetic_forward", "viscous_forward", "kinetic_back", "viscous_back"),
    lambda values: None,
)


def table(samples: Samples, points: int) -> Family:
    """A polygon through forces at speeds that as many samples lie between, rising or falling all the way."""
    speed = np.abs(samples.velocity)
    nodes = np.quantile(speed, np.linspace(0, 1, points)).tolist()
    names = [f"force_{number}" for number in range(1, points + 1)]

    def columns(some: Samples, logs: Array) -> Array:
        hats = np.stack([np.interp(np.abs(some.velocity), nodes, row) for row in np.eye(points)], axis=1)
        return _with_offset(some, *(np.sign(some.velocity)[:, None] * hats).T)

    def law(values: dict[str, float]) -> Tabulated:
        return Tabulated([0.0, *nodes], [values[names[0]], *(values[name] for name in names)])

    places = ", ".join(f"{node:.3g}" for node in nodes)
    return Family(
        f"f = F(|v|) sign(v) + offset, F a polygon through force_1 ... force_{points} at {places} m/s",
        "v",
        columns,
        _parameters(*names),
        _named(*names, "offset"),
        law,
        fitted=lambda made, data: _monotone(made, data, points),
    )


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
        solution = lsq_linear(gram[:, :-1], gram[:, -1], bounds=(lowest, np.inf))
        if solution.cost < least:
            best, least = steps @ solution.x, float(solution.cost)
    return best


@compiled(**FAST)
def _rates(z, w, drive, ratio, distance, stiffness, slip):
    """Rates of the logarithms of speed and age, both over those before the step; time in units of 1/V1."""
    way = np.exp(z)
    dw = -way * (z + w) / distance if slip else (np.exp(-w) - way) / distance
    return stiffness * (drive - way) - ratio * dw, dw


@compiled(**FAST)
def _response(time, step_time, speed, after, ratio, distance, stiffness, slip, out):
    """Friction over a, less that before a step of the drive from `speed` to `after` (a ratio), by Runge and Kutta."""
    z = w = 0.0
    now = step_time
    for i in range(len(time)):
        if time[i] <= step_time:
            out[i] = 0.0
            continue
        left = (time[i] - now) * speed
        now = time[i]
        while left > 0:
            fastest = (stiffness + (1 + ratio) / distance) * max(after, np.exp(z)) + np.exp(-w) / distance
            if not fastest * left < STALLED:  # speeds without bound: the slider runs away from its spring
                out[i:] = np.nan
                return
            h = min(left, 0.2 / fastest)  # far inside what is stable: errors of 1e-6
            a1, b1 = _rates(z, w, after, ratio, distance, stiffness, slip)
            a2, b2 = _rates(z + h / 2 * a1, w + h / 2 * b1, after, ratio, distance, stiffness, slip)
            a3, b3 = _rates(z + h / 2 * a2, w + h / 2 * b2, after, ratio, distance, stiffness, slip)
            a4, b4 = _rates(z + h * a3, w + h * b3, after, ratio, distance, stiffness, slip)
            z += h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
            w += h / 6 * (b1 + 2 * b2 + 2 * b3 + b4)
            left -= h
        out[i] = z + ratio * w


def velocity_step(samples: Samples, *, law: str, normal: float) -> Family:
    r"""Friction by the aging or the slip law behind a spring whose far end changes its speed once.

    With :math:`z = \ln(v/V_1)` and :math:`w = \ln(V_1\theta/D_c)`, friction is
    :math:`N[\mu_0 + a z + b w]`, its spring says :math:`\dot f = k (V - v)`, so
    :math:`\dot z = (k/aN)(V - v) - (b/a)\dot w`; slip goes on steadily before the step.
    The instant of the step, first taken from the drive's displacement, is fitted too.
    """
    step_time, before, after = step_of(samples)
    ways = (samples.displacement - samples.displacement[0])[:, None]

    def columns(some: Samples, logs: Array) -> Array:
        ratio, distance, stiffness, since = np.exp(logs)
        out = np.empty(len(some.time))
        _response(
            some.time, some.time[0] + since, before, after / before, ratio, distance, stiffness, law == "slip", out
        )
        return np.column_stack([out, np.ones(len(out)), ways])

    def parameters(c: Array, shape: Array) -> dict[str, float]:
        a, b = c[0] / normal, c[0] / normal * shape[0]
        return {
            "friction": c[1] / normal, "direct": a, "evolution": b, "rate_dependence": a - b, "distance": shape[1],
            "stiffness": c[0] * shape[2], "trend": c[2] / normal,
        }  # fmt: skip

    def made(parameters: dict[str, float]) -> RateState:
        values = {name: parameters[name] for name in ("friction", "direct", "evolution", "distance")}
        return RateState(normal, reference=before, law=law, **values)

    def starts(some: Samples) -> tuple[Array, Array, Array, Array]:
        slid, grain = float(np.ptp(ways)), after * float(np.median(np.diff(some.time)))
        lengths = np.log(np.geomspace(4 * grain, slid / 4, DISTANCES))
        stiff = np.log(np.geomspace(4 / slid, 1 / (2 * grain), STIFFNESSES))
        return np.log(RATIOS), lengths, stiff, np.log([step_time - some.time[0]])

    formula = (
        f"f = normal (friction + direct ln(v/V1) + evolution ln(V1 age/distance) + trend x), the {law} law, behind a "
        f"spring of that stiffness, V1 = {before:.3g} m/s, then {after:.3g} m/s"
    )
    return Family(formula, "t", columns, parameters, STEP_UNITS, made, starts)


def step_of(samples: Samples) -> tuple[float, float, float]:
    """Time of the drive's step, and its speed before and after: the two straight lines that its displacement follows.

    Raises
    ------
    EstimateError
        One speed alone, or a motion that does not go one way.
    """
    time, x = samples.time - samples.time[0], samples.displacement
    best, least = (0.0, 0.0, 0.0), np.inf
    low, high = time[-1] * 0.005, time[-1] * 0.995
    for _ in range(6):  # a search of the corner, each time ten times finer
        grid = np.linspace(low, high, 25)
        for corner in grid:
            lines = np.column_stack([np.ones(len(x)), time, np.maximum(time - corner, 0)])
            slope = np.linalg.lstsq(lines, x, rcond=None)[0]
            left = x - lines @ slope
            if float(left @ left) < least:
                best, least = (float(corner), float(slope[1]), float(slope[1] + slope[2])), float(left @ left)
        width = 1.5 * (grid[1] - grid[0])
        low, high = max(best[0] - width, 0.0), min(best[0] + width, time[-1])
    corner, before, after = best
    if np.ptp(x) > LEAST_WAY * abs(x[-1] - x[0]):
        raise EstimateError(
            "the displacement goes to and fro",
            "a velocity step goes forward: steady sliding one way, then faster or slower the same way",
            "give such a record, or fit a curve over the speed, as stribeck",
        )
    if min(before, after) <= 0 or max(before, after) < LEAST_STEP * min(before, after):
        raise EstimateError(
            f"the driving speed goes from {before:.3g} to {after:.3g} m/s",
            f"a velocity step goes forward, and changes the speed {LEAST_STEP:g} times at least",
            "give a record with x of the drive before and after a step, both forward",
        )
    return samples.time[0] + corner, before, after


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


def _beware_of_span(*, span: Callable[[dict[str, Estimate]], float]) -> Beware:
    """The friction where the motion is too short to slide, the stiffness where it is too coarse to give way."""

    def beware(estimates: dict[str, Estimate], samples: Samples) -> list[tuple[tuple[str, ...], str]]:
        length, half, unit = span(estimates), _half_stroke(samples), samples.unit
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
    "df/dx = stiffness (1 - f/kinetic sign(v))^exponent, and offset",
    "x",
    _of_dahl,
    lambda c, shape: {"kinetic": c[0], "stiffness": c[0] / shape[0], "offset": c[1], "exponent": shape[1]},
    UNITS,
    lambda values: Dahl(values["kinetic"], stiffness=values["stiffness"], exponent=values["exponent"]),
    lambda samples: (*_lengths(samples), np.log(POWERS)),
    _beware_of_span(span=lambda estimates: DAHL_LENGTHS * estimates["kinetic"].value / estimates["stiffness"].value),
)
JENKINS = Family(
    "df/dx = stiffness up to |f| = kinetic, and offset",
    "x",
    _of_jenkins,
    lambda c, shape: {"kinetic": c[0] * shape[0], "stiffness": c[0], "offset": c[1]},
    UNITS,
    lambda values: ElastoSlip([values["stiffness"]], [values["kinetic"]]),
    _lengths,
    _beware_of_span(span=lambda estimates: estimates["kinetic"].value / estimates["stiffness"].value),
)


def iwan(elements: int) -> Family:
    """Iwan's model of that many classes, their yield displacements even up to a width."""
    middles = (np.arange(elements) + 0.5) / elements

    def columns(samples: Samples, logs: Array) -> Array:
        whole = deflections(samples.displacement, np.exp(logs[0]) * middles).mean(axis=1)
        return np.column_stack([whole, np.ones(len(whole))])

    return Family(
        f"Iwan's {elements} classes that yield evenly up to width, together of stiffness, and offset",
        "x",
        columns,
        lambda c, shape: {"kinetic": c[0] * shape[0] / 2, "stiffness": c[0], "width": shape[0], "offset": c[1]},
        UNITS,
        lambda values: ElastoSlip.iwan(values["stiffness"], width=values["width"], elements=elements),
        _lengths,
        _beware_of_span(span=lambda estimates: estimates["width"].value),
    )


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
        )
    yields = yields[kept]

    def columns(some: Samples, logs: Array) -> Array:
        return np.column_stack([deflections(some.displacement, yields), np.ones(len(some.displacement))])

    def parameters(c: Array, shape: Array) -> dict[str, float]:
        parameters = {f"stiffness_{number}": value for number, value in enumerate(c[:-1], start=1)}
        return {"kinetic": float(c[:-1] @ yields), "stiffness": float(c[:-1].sum()), **parameters, "offset": c[-1]}

    def law(values: dict[str, float]) -> ElastoSlip:
        stiff = np.array([values[f"stiffness_{number}"] for number in range(1, len(yields) + 1)])
        return ElastoSlip(stiff.tolist(), (stiff * yields).tolist())

    places = ", ".join(f"{length:.3g}" for length in yields)
    units = UNITS | {f"stiffness_{number}": "N/m" for number in range(1, len(yields) + 1)}
    formula = f"elements of stiffness_1 ... stiffness_{len(yields)} that slip at deflections of {places} m, and offset"
    beware = _beware_of_span(span=lambda values: float(yields[-1]))
    return Family(formula, "x", columns, parameters, units, law, beware=beware)
