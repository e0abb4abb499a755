"""The likeliest contact while it holds: its stiffness and damping from everything that the sensors read."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from stickslip.arrays import Array, Mask, stretches
from stickslip.balance.balance import Balance
from stickslip.balance.force import FUSIONS
from stickslip.balance.fusion import Held, fuse
from stickslip.balance.motion import is_measured
from stickslip.errors import EstimateError
from stickslip.estimate import NORMAL_95, Doubt, Estimate, Status
from stickslip.record.record import Record

Stretches = list[tuple[int, int]]

STIFFNESS, DAMPING = "contact stiffness", "contact damping"
HELD = 0.9  # share of the sliding friction below which the contact certainly holds
FAST = 0.5  # share of the peak speed above which it certainly slides
LEAST = 3  # samples of one stick to draw a line through
FEW = 4  # sticks
MOST, PIECES = 1 << 16, 8  # samples that are looked at, and in how many stretches of a record that is longer
UNSURE = 0.1  # relative deviation above which the likelihood is no parabola, and is followed to its ends
SLIGHT, ALMOST = 0.015, 0.95  # of the critical damping: where the search starts, and from where there is no ringing
SOFTEST = 1e-3  # of the spring's stiffness
STRAYS = 1.5  # mean square surprise of a sensor over its noise, from which it is told, and
STRAYING = "a sensor strays"
ABSURD = 1e3  # from which no answer is given
CYCLE, SHORT = 8.0, 5.0  # samples of a ring's cycle, and of a stick, below which the answer hangs on what is between
NEGATIVE = "negative damping"
# Of the share by which a constant or a gain is off, what K follows of it at most: of the mass's it was 0.96 to 1.32, of
# the others' 0.6 at most (the thesis's rig at 2.5 and 8.7 Hz, each moved alone).
FOLLOWS = 4 / 3
ROUNDS = 4
NEAR = 0.03  # of the log likelihood: how near its peak a simplex goes before a parabola takes over
METHOD = "likeliest contact while it holds, by a Kalman filter"


@dataclass(frozen=True, eq=False)
class LikelyContact:
    """A contact that holds like a spring and a damper beside it.

    Attributes
    ----------
    stiffness, damping : Estimate
        K [N/m] and c [N s/m].
    covariance : ndarray (2, 2)
        Of log K and c.
    level : float
        Sliding friction [N].
    balance : Balance
        The mass on its spring.
    """

    stiffness: Estimate
    damping: Estimate
    covariance: Array
    level: float
    balance: Balance


_FOUND: WeakKeyDictionary[Record, LikelyContact] = WeakKeyDictionary()  # several questions ask one record


def likely_contact(record: Record) -> LikelyContact:
    """The stiffness and the damping under which everything that the sensors read of a record is most likely."""
    if record not in _FOUND:
        _FOUND[record] = _likeliest(record)
    return _FOUND[record]


def _likeliest(record: Record) -> LikelyContact:
    balance, sensors, fused = _balanced(record)
    seen = _looked_through(record, balance, sensors, fused=fused)
    sticks, search = seen.sticks, _Search.of(seen.parts, balance, record.fs)
    best, covariance = search.peak(max(balance.stiffness, seen.slope))
    misfit = np.mean([part.misfit(math.exp(best[0]), best[1]) for part in seen.parts], axis=0)
    stray, scale = _stray(misfit, sensors), max(1.0, float(misfit.max()))
    _require_spring(best, balance)
    doubts: list[Doubt | str] = []
    if scale > STRAYS:  # what a sensor misreads it misreads alike all through a stick
        doubts.append(stray)
        scale *= float(np.median(sticks))
    doubts += _unsure(best, balance, record.fs, sticks)
    # a damping below zero shows how far off the sensors put the contact
    below = max(1.0, -best[1] / (NORMAL_95 * math.sqrt(scale * covariance[1, 1])))
    if below > 1 or (best[1] < 0 and scale > STRAYS):
        sentence = "its damping comes out negative: a sensor's lag or mount is not accounted for"
        doubts.append(Doubt(f"{sentence} ({best[1]:.3g} N s/m)", NEGATIVE))
        scale *= below**2
    if sensors == ["x"]:
        doubts.append("from the displacement alone, which blurs where sticks begin and end")
    common: dict[str, Any] = {
        "method": METHOD,
        "status": Status(*doubts),
        "checks": (
            f"{len(sticks)} sticks, in which the friction is below {HELD:g} of {seen.level:.3g} N",
            f"from {', '.join(sensors)}; a common error of lags or mounts is not in the interval",
            f"at most, {stray}",
        ),
    }
    covariance = scale * covariance + np.diag([_misstated(record, sensors) ** 2, 0.0])
    estimates = replace(search, scale=scale).estimates(best, covariance, common)
    return LikelyContact(*estimates, covariance, seen.level, balance)


def _misstated(record: Record, sensors: Sequence[str]) -> float:
    """Standard deviation of log K by what was stated of constants and gains."""
    rig = record.rig
    assert rig is not None
    shares = [sd / rig.constants[name] for name, sd in rig.sd.items() if name in ("mass", "stiffness")]
    return FOLLOWS * math.hypot(*shares, *(record.channels[name].gain_sd for name in sensors))


@dataclass(frozen=True)
class _Seen:
    """The stretches of a record in which the contact holds."""

    parts: list[Held]
    sticks: list[int]  # samples of each
    level: float  # of the sliding friction [N]
    slope: float  # of friction against displacement while it holds [N/m]


def _looked_through(record: Record, balance: Balance, sensors: Sequence[str], *, fused: bool) -> _Seen:
    parts, levels, sticks, guesses = [], [], [], []
    for rows in _looked_at(len(record)):
        part = record.rows(rows.start, rows.stop)
        friction, velocity = (part["friction"], part["v"]) if fused else _fused(part, balance, sensors)
        level, middle = sliding_level(friction, velocity)
        levels.append(level)
        holds, steps = held_steps(friction - middle, velocity, level)
        sticks += [last - first for first, last in steps]
        if steps:
            parts.append(Held.of(part, balance, sensors, holds, level))
            change, way = np.diff(friction)[holds[:-1]], (velocity[:-1] / record.fs)[holds[:-1]]
            guesses.append((float(change @ way), float(way @ way)))
    if len(sticks) < FEW:
        raise EstimateError(
            f"{len(sticks)} sticks of {LEAST} samples or more",
            f"{FEW} are needed: a contact that holds for less is rigid, or can not be told from a rigid one",
            "sample faster, or longer",
        )
    across, along = np.sum(guesses, axis=0)
    return _Seen(parts, sticks, float(np.mean(levels)), across / along)


def _stray(misfit: Array, sensors: Sequence[str]) -> str:
    """How far the worst sensor is from what it should read, in words, if it is not absurd."""
    worst = int(np.argmax(misfit))
    sentence = f"{sensors[worst]} strays from the likeliest contact by {math.sqrt(misfit[worst]):.3g} times its noise"
    if misfit[worst] > ABSURD:
        raise EstimateError(
            sentence,
            "a contact that holds is a spring and a damper, and every sensor reads it as stated",
            "check signs, and state gains, delays and mounts, by with_details or under [sensors] in the rig file",
            kind=STRAYING,
        )
    return sentence


def _require_spring(best: Array, balance: Balance) -> None:
    critical = 2 * math.sqrt(balance.mass * (balance.stiffness + math.exp(best[0])))
    if best[1] > ALMOST * critical:
        raise EstimateError(
            f"a damper of {best[1]:.3g} N s/m is likelier than any spring",
            f"a contact that holds rings, so that its damping is below {critical:.3g} N s/m",
            "sample faster, or add an accelerometer or a load cell: the ends of the sticks are blurred",
        )


def _unsure(best: Array, balance: Balance, fs: float, sticks: Sequence[int]) -> list[str]:
    """Where the rate is too low for the contact, in words."""
    cycle = fs * 2 * math.pi * math.sqrt(balance.mass / (balance.stiffness + math.exp(best[0])))
    doubts = []
    if cycle < CYCLE:
        doubts.append(f"{fs:g} Hz gives {cycle:.2g} samples to a cycle of the contact's ringing: sample faster")
    if np.median(sticks) < SHORT:
        doubts.append(f"sticks of {np.median(sticks):g} samples: sample faster")
    return doubts


def sliding_level(friction: Array, velocity: Array) -> tuple[float, float]:
    """The friction's magnitude [N] where the contact certainly slides, and its middle: a sensor's zero may be off."""
    speed = np.abs(velocity)
    fast = speed > FAST * np.quantile(speed, 0.99)
    ways = [friction[fast & (sign * velocity > 0)] for sign in (1, -1)]
    middle = sum(float(np.median(way)) for way in ways) / 2 if all(map(len, ways)) else 0.0
    return float(np.median(np.abs(friction[fast] - middle))), middle


def held_steps(friction: Array, velocity: Array, level: float) -> tuple[Mask, Stretches]:
    """Which steps, each from a sample to the next, lie within a stick; and the samples of each stick.

    A stick begins where the velocity turns against the friction, which is sharp, and is over when the friction is
    nearly back at the sliding level, which on a way of twice its deflection it reaches fast.
    """
    inside = np.abs(friction) < HELD * level
    against = friction * velocity <= 0
    holds, steps = np.zeros(len(friction), dtype=bool), []
    for begin, last in zip(*stretches(inside), strict=True):
        if last - begin < LEAST:
            continue
        first, earliest = begin, max(0, 2 * begin - last)
        while first < last and not against[first]:
            first += 1
        while first > earliest and against[first - 1]:
            first -= 1
        if last - first >= LEAST:
            holds[first : last - 1] = True
            steps.append((first, last))
    return holds, steps


def _balanced(record: Record) -> tuple[Balance, list[str], bool]:
    """By which the friction was found, the sensors that speak of it, and whether they were put together."""
    record.require_clean("x", "friction", question=STIFFNESS)
    rig, balance = record.rig, Balance.of(record.rig)
    if rig is None or rig.contact == "base":
        raise EstimateError(
            "a friction force that friction_force did not find" if rig is None else "a contact on the moving base",
            "the likeliest contact is found from a mass that rubs on the ground, by its balance of forces",
            'call friction_force(record, ..., method="fusion") first, or take method="slope"',
        )
    if balance is None:
        raise EstimateError(
            "friction without mass and stiffness of the oscillator",
            "the likeliest contact is found by the balance of forces on the mass",
            'give friction_force mass= or stiffness=, or take method="slope"',
        )
    named = FUSIONS.get(rig.method, FUSIONS["fusion"])
    fused = rig.method in FUSIONS and not is_measured(record, "v")
    return balance, [name for name in named if is_measured(record, name)], fused


def _fused(record: Record, balance: Balance, sensors: Sequence[str]) -> tuple[Array, Array]:
    """Friction and velocity by all sensors together."""
    fused = fuse(record, balance, sensors)
    return fused.friction, fused.velocity


def _looked_at(size: int) -> Iterator[slice]:
    """Rows of a record: all of them, or some stretches spread evenly over a long one."""
    count, length = (1, size) if size <= MOST else (PIECES, MOST // PIECES)
    for first in np.linspace(0, size - length, count).round().astype(int):
        yield slice(int(first), int(first) + length)


@dataclass(frozen=True, eq=False)
class _Search:
    """The likelihood over (log K, c), between a contact softer than the spring and one that can not be told from rigid.

    A contact that rings at half the sampling rate is as good as rigid.
    """

    likelihood: Callable[[float, float], float]
    lowest: float  # log K
    highest: float
    mass: float
    scale: float = 1.0  # by which the sensors' variance is larger than stated

    @classmethod
    def of(cls, parts: Sequence[Held], balance: Balance, fs: float) -> _Search:
        def likelihood(log_stiffness: float, damping: float) -> float:
            stiffness = math.exp(log_stiffness)
            return sum(part.log_likelihood(stiffness, damping) for part in parts)

        mass = balance.mass
        softest = math.log(max(balance.stiffness, mass * fs**2 * 1e-9) * SOFTEST)
        return cls(likelihood, softest, math.log(mass * (math.pi * fs) ** 2), mass)

    def critical(self, log_stiffness: float) -> float:
        """The damping at which the mass no longer rings on the contact: there is none beyond it."""
        return 2 * math.sqrt(math.exp(log_stiffness) * self.mass)

    def peak(self, stiffness: float) -> tuple[Array, Array]:
        """Where the likelihood is largest, from a first guess; and from the rigid end, where that is as likely."""
        start = min(math.log(stiffness), self.highest - 1)
        best, covariance = self._climb(start)
        top = self.likelihood(*best)
        if self.likelihood(self.highest, SLIGHT * self.critical(self.highest)) > top - NORMAL_95**2:
            other, doubt = self._climb(self.highest - 1)
            if self.likelihood(*other) > top:
                return other, doubt
        return best, covariance

    def _climb(self, start: float) -> tuple[Array, Array]:
        """To a peak by simplex, and on by a parabola; the covariance there, infinite where there is no peak."""
        from scipy import optimize

        minimize: Any = optimize.minimize
        unit = np.array([1e-2, 0.005 * self.critical(start)])
        at = np.array([start, SLIGHT * self.critical(start)])

        def cost(step: Array) -> float:
            log_stiffness, damping = at + unit * step
            inside = self.lowest <= log_stiffness <= self.highest and abs(damping) <= self.critical(log_stiffness)
            return -self.likelihood(log_stiffness, damping) if inside else math.inf

        near, reach = np.zeros(2), 5.0
        for _ in range(ROUNDS):
            options: dict[str, Any] = {
                "initial_simplex": near + reach * np.array([[0, 0], [1, 0], [0, 1]]), "xatol": np.inf, "fatol": NEAR,
            }  # fmt: skip
            near, reach = minimize(cost, near, method="Nelder-Mead", options=options).x, 1.0
            slope, curved = _derivatives(cost, near, _widths(cost, near))
            if not (np.all(np.isfinite(curved)) and np.all(np.linalg.eigvalsh(curved) > 0)):
                break
            inverse = np.asarray(np.linalg.inv(curved), dtype=np.float64)
            if slope @ inverse @ slope < 1:  # within a deviation of the peak
                return at + unit * (near - inverse @ slope), inverse * np.outer(unit, unit)
        return at + unit * near, np.full((2, 2), math.inf)

    def estimates(self, best: Array, covariance: Array, common: dict[str, Any]) -> tuple[Estimate, Estimate]:
        """Stiffness and damping; of a stiffness that is unsure both ends where the likelihood has fallen."""
        stiffness, sd = math.exp(best[0]), np.sqrt(np.diag(covariance))
        if sd[0] < UNSURE:
            contact = Estimate.normal(STIFFNESS, stiffness, sd=stiffness * sd[0], unit="N/m", **common)
            return contact, Estimate.normal(DAMPING, best[1], sd=sd[1], unit="N s/m", **common)
        low, high = (self._end(best, sd[1], end) for end in (self.lowest, self.highest))
        if math.isinf(low):
            raise EstimateError(
                "the record can not tell a stiff contact from none",
                "while the contact holds, friction must follow the displacement beyond the noise",
                "use better sensors, or a longer record",
            )
        if math.isinf(high):
            sentence = f"at least {math.exp(low):.3g} N/m: not told from a rigid contact"
            common["status"] = sentence if common["status"] == "ok" else f"{sentence}; {common['status']}"
        interval = math.exp(low), math.exp(high)
        contact = Estimate(STIFFNESS, stiffness, interval, stiffness * sd[0], "N/m", **common)
        return contact, Estimate.normal(DAMPING, best[1], sd=sd[1], unit="N s/m", **common)

    def _end(self, best: Array, unsure: float, end: float) -> float:
        """Where, from the peak towards an end, twice the likelihood has fallen by chi square's 3.84; or infinite.

        `unsure` is the deviation of the damping at the peak, infinite where it is not known.
        """
        from scipy import optimize

        brentq: Any = optimize.brentq
        minimize_scalar: Any = optimize.minimize_scalar

        def highest(log_stiffness: float) -> float:
            reach = self.critical(log_stiffness)
            optimum = minimize_scalar(
                lambda c: -self.likelihood(log_stiffness, c),
                bounds=(-0.1 * reach, reach),
                method="bounded",
                options={"xatol": min(0.1 * unsure, 1e-2 * reach)},
            )
            return max(-float(optimum.fun), self.likelihood(log_stiffness, best[1]))  # the search is of one valley

        top = highest(best[0])

        def fallen(log_stiffness: float) -> float:
            return 2 * (top - highest(log_stiffness)) - self.scale * NORMAL_95**2

        if abs(end - best[0]) < 1e-3 or not fallen(end) > 0:  # or no number, where nothing is likely
            return -math.inf if end == self.lowest else math.inf
        return float(brentq(fallen, best[0], end, xtol=0.01))


def _widths(cost: Callable[[Array], float], at: Array) -> Array:
    """Steps along each axis over which the cost rises by about one."""
    widths = np.ones(2)
    for axis in range(2):
        for _ in range(8):
            rise = min(cost(at + widths[axis] * np.eye(2)[axis]) - cost(at), 100.0)
            if 0.3 < rise < 3:
                break
            widths[axis] /= math.sqrt(max(rise, 1e-4)) if rise > 0 else 0.5
    return widths


def _derivatives(cost: Callable[[Array], float], at: Array, width: Array) -> tuple[Array, Array]:
    """Slope and curvature by central differences."""
    value = {(i, j): cost(at + width * (i, j)) for i in (-1, 0, 1) for j in (-1, 0, 1)}
    with np.errstate(invalid="ignore"):  # beyond the search's bounds the cost is infinite
        slope = np.array([value[1, 0] - value[-1, 0], value[0, 1] - value[0, -1]]) / (2 * width)
        own = [(value[1, 0] + value[-1, 0] - 2 * value[0, 0]), (value[0, 1] + value[0, -1] - 2 * value[0, 0])]
        cross = np.float64(value[1, 1] + value[-1, -1] - value[1, -1] - value[-1, 1]) / 4
    return slope, np.array([[own[0], cross], [cross, own[1]]]) / np.outer(width, width)
