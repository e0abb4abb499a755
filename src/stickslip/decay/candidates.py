"""A candidate motion's least squares on one free decay."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from stickslip.arrays import Array
from stickslip.decay.motions import MOTIONS, PARAMETERS, WORN, Motion, Restoring, free_decay

CURVED = "curved spring"  # whose phase a straight spring's fit loses after some periods
ALWAYS = ("both", "static")  # candidates that are fitted whatever is asked for
DRIFTS = (0.0, -0.01, 0.01)  # in a first amplitude, from which friction that wears is searched
TRIES = 12  # numbers of half cycles
FIRST = 2.0  # periods fitted first; then twice as many, till the end: the phase can not slip
LEAST = 24  # blocks of a fit
HOPELESS = 4.0  # times what viscous damping with dry friction leaves
EVALUATIONS = 60  # of one search
PRECISION = 1e-6  # of the range: no record is better, no residual below it says anything
CONVERGED = 1e-8  # relative change of the sum of squares, and of the parameters
LOWEST = {
    "damping_ratio": 0.0, "dry_displacement": 0.0, "quadratic": 0.0, "rise": 0.0, "micro_slip": 0.0, "wear": -0.5,
    "relaxation": 0.0,
}  # fmt: skip
# lowest and highest; speeds in units of the first speed
SHAPES = {"stribeck_speed": (0.02, 1.0), "exponent": (0.1, 1.0)}
PRESLIDING = (1e-5, 0.2)  # lowest and highest, in units of the first amplitude
ADDED = ("quadratic", "rise", "micro_slip")
CLEAR = 10.0  # effect over noise above which the shape of a term is known
HIGHEST = {"damping_ratio": 0.95, "rise": 1.0, "wear": 0.5}  # by half in a first amplitude is no wear any more
NEARLY, STEEP, STEEPEST = 0.99, 1.01, 4.0  # of the highest rise: from where, and up to which, one beyond is searched
STRIBECK_SPEEDS = (0.05, 0.3)  # of the first speed, at which a slope is looked for
EXPONENT = 0.5  # of the micro-slip that is looked for
STIFFER = (100.0, 20.0, 4.0)  # a contact than the spring, from which one that yields is searched
FADING = 0.1  # damping ratio of its ringing there
NUMBERS = {name: number for number, name in enumerate(PARAMETERS)}


@dataclass(frozen=True, eq=False)
class BlockMeans:
    """A free decay as the fits see it: means over blocks of samples.

    Attributes
    ----------
    times, values : ndarray, shape (n,)
        Centres of the blocks [s], rising, and the displacement's means.
    counts : ndarray, shape (n,)
        Samples in each block.
    fs : float
        Sampling rate [Hz].
    restoring : {"linear", "pendulum"}
        The spring's law.
    weights : ndarray, shape (n,)
        Independent readings in each block.
    """

    times: Array
    values: Array
    counts: Array
    weights: Array
    fs: float
    restoring: Restoring = "linear"

    @property
    def floor(self) -> float:
        """What rounding, and the means of blocks across a turning point, may leave of a motion that is the true one."""
        return PRECISION * float(np.ptp(self.values)) * math.sqrt(float(self.weights.mean()))

    @cached_property
    def spread(self) -> Array:
        """Standard deviation in time of each block's samples [s]."""
        return np.asarray(np.sqrt((self.counts**2 - 1) / 12) / self.fs)

    def weighted(self, matrix: Array) -> Array:
        """`matrix` (n,) or (n, m) scaled so that the noise of its rows is of one variance."""
        roots = np.sqrt(self.weights)
        return np.asarray(matrix * (roots if matrix.ndim == 1 else roots[:, None]))

    def motion(
        self, parameters: Array, *, free: tuple[str, ...] = (), half_cycles: int | None = None
    ) -> tuple[Array, Array, int]:
        """:func:`free_decay` at these blocks."""
        more: Any = {"restoring": self.restoring, "half_cycles": half_cycles, "spread": self.spread}
        return free_decay(self.times, parameters, free=free, **more)

    def until(self, time: float) -> BlockMeans:
        """The blocks up to an instant."""
        rows = slice(0, max(int(np.searchsorted(self.times, time)), min(LEAST, len(self.times))))
        return replace(
            self, times=self.times[rows], values=self.values[rows], counts=self.counts[rows], weights=self.weights[rows]
        )


@dataclass(frozen=True, eq=False)
class Fitted:
    """A candidate at its least squares.

    Attributes
    ----------
    motion : Motion
        The candidate.
    parameters : ndarray, shape (15,)
        In the order of ``PARAMETERS``.
    half_cycles : int
        That it makes within the record.
    forced : bool
        Whether it stays where its kinetic friction would let it go on.
    residual : ndarray, shape (n,)
        Data minus motion, weighted.
    jacobian : ndarray, shape (n, p)
        Weighted sensitivities to the free parameters.
    blocks : BlockMeans
        What was fitted.
    """

    motion: Motion
    parameters: Array
    half_cycles: int
    forced: bool
    residual: Array
    jacobian: Array
    blocks: BlockMeans

    @cached_property
    def cost(self) -> float:
        """Sum of squares left."""
        return float(self.residual @ self.residual)

    @cached_property
    def worn(self) -> Fitted:
        """The same with friction that changes with the way slid, searched from here."""
        starts = [self.parameters.copy() for _ in DRIFTS]
        for start, drift in zip(starts, DRIFTS, strict=True):
            start[NUMBERS["wear"]] = drift
        return min((fit_motion(WORN, self.blocks, start) for start in starts), key=lambda fitted: fitted.cost)

    @cached_property
    def steeper(self) -> Fitted:
        """The same with friction that may rise further towards rest, where it rises as far as is looked for."""
        if self.value("rise") < NEARLY * HIGHEST["rise"]:
            return self
        start = self.parameters.copy()
        start[NUMBERS["rise"]] = STEEP
        return fit_motion(self.motion, self.blocks, start)

    def value(self, name: str) -> float:
        """One parameter."""
        return float(self.parameters[NUMBERS[name]])

    @property
    def added(self) -> str | None:
        """The term that it adds to viscous damping and dry friction, with a range of its own."""
        return next((name for name in ADDED if name in self.motion.terms), None)

    @property
    def settled(self) -> tuple[int, ...]:
        """Columns beside the added term, without the shape of one that is faint."""
        added = self.added
        clear = False
        if added is not None:
            effect = self.value(added) * np.linalg.norm(self.jacobian[:, self.motion.free.index(added)])
            clear = bool(effect > CLEAR * math.sqrt(self.cost / len(self.residual)))
        return tuple(
            column for column, name in enumerate(self.motion.free) if name != added and (clear or name not in SHAPES)
        )


def fit_candidates(names: tuple[str, ...], blocks: BlockMeans, start: Array) -> dict[str, Fitted]:
    """Every candidate's least squares; none leaves more than one that it contains.

    Parameters
    ----------
    names : tuple of str
        Of ``MOTIONS``; those of viscous damping with dry friction are always fitted.
    blocks : BlockMeans
        The data.
    start : ndarray, shape (6,)
        The first six of ``PARAMETERS``, near the fit of viscous damping with dry friction.

    Returns
    -------
    dict of str to Fitted
        The fewest terms first.
    """
    first = np.zeros(len(PARAMETERS))
    first[:6], first[NUMBERS["exponent"]] = start[:6], EXPONENT
    straight = _followed(MOTIONS["static"], blocks, first)
    fitted = {name: fit_motion(MOTIONS[name], blocks, straight) for name in ALWAYS}
    base = min(fitted.values(), key=lambda candidate: candidate.cost)
    hopeless = HOPELESS * base.cost
    wanted = sorted((name for name in MOTIONS if name in names or name in fitted), key=lambda name: MOTIONS[name].size)
    for name in wanted:
        motion = MOTIONS[name]
        tries = [fitted[name]] if name in fitted else []
        if not tries:
            starts = [*_starts(motion, base), *([_followed(motion, blocks, first)] if name == CURVED else [])]
            tries = [fit_motion(motion, blocks, s, hopeless=hopeless) for s in starts]
        for other in fitted.values():
            if motion.contains(other.motion) and other.cost < min(candidate.cost for candidate in tries):
                shaped = _shaped(motion, other.parameters.copy(), share=1e-3)
                tries += [fit_motion(motion, blocks, s, hopeless=hopeless) for s in shaped]
        fitted[name] = min(tries, key=lambda candidate: candidate.cost)
    return {name: fitted[name] for name in wanted}


def _followed(motion: Motion, blocks: BlockMeans, start: Array) -> Array:
    """Parameters of a candidate that follows the first periods, then twice as many, till the end."""
    end, release = float(blocks.times[-1]), float(start[NUMBERS["release"]])
    reach = FIRST * 2 * math.pi / start[0]
    while release + reach < end:
        start = fit_motion(motion, blocks.until(release + reach), start).parameters
        reach *= 2
    return start


def fit_motion(
    motion: Motion, blocks: BlockMeans, start: Array, *, half_cycles: int | None = None, hopeless: float = math.inf
) -> Fitted:
    """A candidate's least squares.

    The number of half cycles before it sticks is whole: within one the residual is smooth, from one to the next it has
    a kink. So each fit is made with one number, and the best of those that its own friction allows is taken.

    Parameters
    ----------
    motion : Motion
        The candidate; what it does not free stays as in `start`.
    blocks : BlockMeans
        The data.
    start : ndarray, shape (15,)
        Where the search begins.
    half_cycles : int, optional
        It stays after so many, whatever drives it on.
    hopeless : float
        Sum of squares beyond which the number of half cycles is not refined.

    Returns
    -------
    Fitted
    """
    if half_cycles is not None or not motion.stops:
        return _search(motion, blocks, start, half_cycles)
    number = blocks.motion(start)[2]
    tried = {number: _search(motion, blocks, start, number)}
    best = number
    for _ in range(TRIES):
        best = min(tried, key=lambda half_cycles: tried[half_cycles].cost)
        if tried[best].cost > hopeless:
            return tried[best]
        allowed = blocks.motion(tried[best].parameters)[2]
        near = dict.fromkeys((allowed, best - 1, best + 1, best - 2, best + 2))
        new = [count for count in near if count > 0 and count not in tried]
        if not new:
            break
        for half_cycles in new:
            tried[half_cycles] = _search(motion, blocks, tried[best].parameters, half_cycles)
    if motion.sticks_early:
        return tried[best]
    own = [candidate for number, candidate in tried.items() if blocks.motion(candidate.parameters)[2] == number]
    if tried[best] not in own:  # the kink itself may be best: numbers that its friction allows left ten times as much
        own.append(_search(motion, blocks, tried[best].parameters, None))
    return replace(min(own, key=lambda candidate: candidate.cost), forced=False)


def _search(motion: Motion, blocks: BlockMeans, start: Array, half_cycles: int | None) -> Fitted:
    """Least squares by a trust region with exact sensitivities."""
    from scipy.optimize import least_squares

    parameters = start.copy()
    columns = [NUMBERS[name] for name in motion.free]
    units = _units(start)[columns]
    low, high = (ends / units for ends in _bounds(motion, start))
    last: dict[bytes, tuple[Array, Array, int]] = {}

    def at(free: Array) -> tuple[Array, Array, int]:
        key = free.tobytes()
        if key not in last:
            trial = parameters.copy()
            trial[columns] = units * free
            x, jacobian, begun = blocks.motion(trial, free=motion.free, half_cycles=half_cycles)
            if len(last) > 1:
                last.pop(next(iter(last)))
            last[key] = blocks.weighted(blocks.values - x), blocks.weighted(units * jacobian), begun
        return last[key]

    def residual_at(free: Array) -> Array:
        return at(free)[0]

    def slope_at(free: Array) -> Array:
        return -at(free)[1]

    solved = least_squares(
        residual_at,
        np.clip(parameters[columns] / units, low, high),
        jac=slope_at,
        bounds=(low, high),
        x_scale="jac",
        xtol=CONVERGED,
        ftol=CONVERGED,
        gtol=None,
        max_nfev=EVALUATIONS,
    )
    parameters[columns] = units * solved.x
    residual, jacobian, begun = at(solved.x)
    return Fitted(motion, parameters, begun, half_cycles is not None, residual, jacobian / units, blocks)


def _units(start: Array) -> Array:
    """What each parameter is measured in, so that the steps of a search do not depend on the record's units."""
    w, length, exponent = start[0], abs(start[NUMBERS["amplitude"]]), start[NUMBERS["exponent"]]
    measures = {
        "angular_frequency": w, "dry_displacement": length, "rest": length, "amplitude": length, "release": 1 / w,
        "quadratic": 1 / length, "stribeck_speed": w * length, "micro_slip": length**-exponent,
        "curvature": length**-2, "presliding": length, "relaxation": 1 / w,
    }  # fmt: skip
    return np.array([measures.get(name, 1.0) for name in PARAMETERS])


def _bounds(motion: Motion, start: Array) -> tuple[Array, Array]:
    """Lowest and highest value of each free parameter."""
    low, high = [], []
    for name in motion.free:
        unit = {"stribeck_speed": first_speed(start), "presliding": abs(start[NUMBERS["amplitude"]])}.get(name, 1.0)
        ends = (LOWEST.get(name, -math.inf), highest(name, start))
        ends = PRESLIDING if name == "presliding" else SHAPES.get(name, ends)
        low.append(unit * ends[0])
        high.append(unit * ends[1])
    return np.array(low), np.array(high)


def highest(name: str, parameters: Array) -> float:
    """Highest value of a parameter, searched from or ending at these; of a rise above it, the steepest."""
    if name == "rise" and parameters[NUMBERS[name]] > HIGHEST[name]:
        return STEEPEST
    return HIGHEST.get(name, math.inf)


def first_speed(parameters: Array) -> float:
    """About the greatest speed: natural frequency times first amplitude."""
    return float(parameters[NUMBERS["angular_frequency"]] * abs(parameters[NUMBERS["amplitude"]]))


def _starts(motion: Motion, both: Fitted) -> list[Array]:
    """Where to search for a candidate, from the fit of viscous damping with dry friction."""
    start = both.parameters.copy()
    amplitude = abs(both.value("amplitude"))
    damping, dry = both.value("damping_ratio"), both.value("dry_displacement")
    if "dry_displacement" not in motion.terms:  # the same energy from half the first amplitude
        start[NUMBERS["damping_ratio"]] = min(damping + (4 / math.pi) * dry / amplitude, 0.5)
        start[NUMBERS["dry_displacement"]] = 0.0
    if "damping_ratio" not in motion.terms:
        start[NUMBERS["dry_displacement"]] = dry + (math.pi / 4) * damping * amplitude
        start[NUMBERS["damping_ratio"]] = 0.0
    return _shaped(motion, start)


def _shaped(motion: Motion, start: Array, *, share: float = 1.0) -> list[Array]:
    """A start with a little of each term that it has none of yet, one for each shape that is tried."""
    amplitude, speed = abs(start[NUMBERS["amplitude"]]), first_speed(start)
    little = {
        "dry_displacement": 1e-4 * amplitude, "damping_ratio": 1e-4, "quadratic": 1e-3 / amplitude,
        "micro_slip": 0.01 * amplitude**-EXPONENT, "rise": 0.05,
    }  # fmt: skip
    for name, value in little.items():
        if name in motion.terms and start[NUMBERS[name]] == 0:
            start[NUMBERS[name]] = share * value
    if "stribeck_speed" in motion.terms and start[NUMBERS["stribeck_speed"]] == 0:
        return [_with(start, stribeck_speed=ratio * speed) for ratio in STRIBECK_SPEEDS]
    if "presliding" in motion.terms and start[NUMBERS["presliding"]] == 0:
        return [yielding(start, stiffer) for stiffer in STIFFER]
    return [start]


def yielding(parameters: Array, stiffer: float) -> Array:
    """The same on a contact that yields with a stiffness so many times the spring's, its ringing damped a little."""
    rate = parameters[NUMBERS["angular_frequency"]] * math.sqrt(1 + stiffer)
    least = PRESLIDING[0] * abs(parameters[NUMBERS["amplitude"]])
    presliding = max(float(parameters[NUMBERS["dry_displacement"]] / stiffer), least)
    return _with(parameters, presliding=presliding, relaxation=2 * FADING / rate * (1 + 1 / stiffer))


def rigid(parameters: Array) -> Array:
    """The same on a contact that does not yield."""
    return _with(parameters, presliding=0.0, relaxation=0.0)


def _with(parameters: Array, **values: float) -> Array:
    """A copy with some parameters changed."""
    changed = parameters.copy()
    for name, value in values.items():
        changed[NUMBERS[name]] = value
    return changed
