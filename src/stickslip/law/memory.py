"""Does friction remember, and what: a time, a state that follows, or a way? By its loops over several frequencies."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from stickslip.arrays import Array, Rows
from stickslip.balance.motion import CREEP
from stickslip.errors import EstimateError
from stickslip.estimate import NORMAL_95, Estimate, Result, Status
from stickslip.law.curves import deflections
from stickslip.law.data import Samples, samples_of
from stickslip.law.family import minimise
from stickslip.record.record import Record
from stickslip.statistics import mean_of_cycles

LEAST_PHASE = 0.005  # rad: what smoothing leaves of a phase
POINTS = 2000  # of a mean cycle, at most
BLURRED = 0.25  # of the phase over which smoothing spreads the velocity's kinks: what it may shift the loop's
HALF = 0.5  # of the speed of creep: slower is at rest
STICKS = 0.05  # of the time at rest: more is no mere reversal
UNSURE = 0.1  # rad: phases that are no surer do not speak against a memory
REJECTED = 0.01  # chance of a misfit so large, below which a memory is ruled out
FAR = 100.0  # logarithm beyond which no memory is
LAGS = 40  # values of a memory to begin with
FURTHEST = 1.2  # ratio of the largest to the smallest frequency, below which no growth is seen


@dataclass(frozen=True, eq=False, repr=False)
class FrictionMemory(Result):
    """How friction follows the velocity.

    Attributes
    ----------
    memory : str
        "none", "time delay", "state variable", "way" (a contact that gives way), or "undecided".
    rotation : str
        Sense in which friction over velocity is gone round: "anticlockwise" where friction follows the velocity,
        "clockwise" where it goes ahead, "none".
    reason : str
        The evidence, in words and numbers.
    phases : tuple of Estimate
        Of each record, by which angle [rad] friction follows the velocity.
    frequencies : ndarray, shape (m,)
        Of the records [Hz].
    delay : Estimate or None
        Time [s] that explains them best if all friction comes that much later.
    time : Estimate or None
        Time constant [s] if friction follows its level by a first-order lag.
    give : Estimate or None
        Displacement [m] over which a contact gives way from no friction to sliding.
    misfit : dict of str to float
        Root mean square of what each memory leaves of the phases, over what their intervals allow: 1 where it fits.
    status : str
        "ok", or in words what to beware of.
    """

    memory: str
    rotation: str
    reason: str
    phases: tuple[Estimate, ...]
    frequencies: Array
    delay: Estimate | None
    time: Estimate | None
    give: Estimate | None
    misfit: dict[str, float]
    status: str

    @property
    def name(self) -> str:
        """The memory, with its evidence."""
        return f"{self.memory}: {self.reason}"

    @property
    def estimates(self) -> tuple[Estimate, ...]:
        """The phases, and what each memory would be."""
        return (*self.phases, *(estimate for estimate in (self.delay, self.time, self.give) if estimate is not None))


@dataclass(frozen=True, eq=False)
class _Loop:
    """One record's loop: its phase and frequency, and the mean cycle of its motion; `way` is the velocity's sign."""

    phase: Estimate
    frequency: float
    displacement: Array
    velocity: Array
    way: Array


def friction_memory(
    records: Record | Sequence[Record], *, contact: str | None = None, frequency: float | str | None = None
) -> FrictionMemory:
    r"""Does friction over velocity go round a loop, which way, and how does that grow with the frequency?

    Friction that follows the speed alone comes back by the way it went, whatever the curve and the motion: its loop has
    no area, and while the contact sticks nothing is added, since there the speed does not change. Friction with memory
    (thesis, 1.4 and 4.4) follows by an angle

    .. math:: \varphi = \arg\Big(\omega\!\int\! f v\,dt - i\oint\! f\,dv\Big),

    of a sine that of the fundamental, and its loop is gone round anticlockwise; where a falling curve answers late
    (higher friction while speeding up than while slowing down), clockwise. How the angle grows with the frequency tells
    which memory it is; each is followed along the measured motion, and for a sine:

    * a time delay: :math:`\varphi = \omega\tau`; of all friction, and so of a late sensor too;
    * a state variable, :math:`\dot\theta = (F(v) - \theta)/T`: :math:`\tan\varphi = \omega T`;
    * a way, Y, over which the contact gives before it slides: of one amplitude the same at every frequency.

    A memory is ruled out whose misfit has a chance of less than 1 %.

    Parameters
    ----------
    records : Record or sequence of Record
        With ``friction`` and the motion, each of one forcing frequency.
    contact : {"ground", "base"}, optional
        What the mass slides on; as :func:`friction_force` was told, or the ground.
    frequency : float or str, optional
        Forcing frequency [Hz] of a single record; found where not given.

    Returns
    -------
    FrictionMemory

    Raises
    ------
    RecordError
        A channel is missing, broken or too short.
    EstimateError
        No motion, no complete cycle, or a motion that does not reverse.

    Examples
    --------
    >>> records = []
    >>> for hz in (5.0, 20.0):
    ...     t = np.arange(16000) / 4000
    ...     late = np.sign(np.cos(2 * np.pi * hz * (t - 8e-3)))
    ...     records.append(Record.of({"x": np.sin(2 * np.pi * hz * t), "friction": late}, fs=4000))
    >>> memory = friction_memory(records)
    >>> memory.memory, memory.rotation, memory.delay.includes(8e-3)
    ('time delay', 'anticlockwise', True)
    """
    given = [records] if isinstance(records, Record) else list(records)
    if not given:
        raise EstimateError("no record", "a memory is told from one record or more", "give a record of each frequency")
    loops = [_loop(samples_of(record, contact=contact, frequency=frequency)[0]) for record in given]
    fits = {kind: _fitted(kind, loops) for kind in FOLLOWS}
    rotation = _rotation(loops)
    misfit = {kind: value for kind, (_, value) in fits.items()}
    memory, reason = _verdict(loops, rotation, misfit)
    return FrictionMemory(
        memory=memory,
        rotation=rotation,
        reason=reason,
        phases=tuple(loop.phase for loop in loops),
        frequencies=np.array([loop.frequency for loop in loops]),
        delay=fits["time delay"][0],
        time=fits["state variable"][0],
        give=fits["way"][0],
        misfit=misfit,
        status=_status(loops, memory),
    )


def _loop(samples: Samples) -> _Loop:
    if not samples.reverses:
        raise EstimateError(
            f"the velocity runs from {samples.velocity.min():.3g} to {samples.velocity.max():.3g} {samples.unit}/s",
            "the sense of rotation is told of motion both ways",
            "give a record that reverses",
        )
    count = samples.cycles
    starts = np.searchsorted(samples.cycle, np.arange(count))
    ends = np.append(starts[1:], len(samples.cycle))
    shortest = int(np.min(ends - starts))
    points = min(POINTS, shortest)
    length = (samples.time[-1] - samples.time[0]) / max(1, len(samples.time) - 1) * len(samples.time) / count
    way = np.clip(samples.velocity / (CREEP * np.abs(samples.velocity).max()), -1, 1)
    velocity, friction, displacement, way = (
        _folded(values, starts, ends, points)
        for values in (samples.velocity, samples.friction, samples.displacement, way)
    )
    mean = velocity.mean(axis=0)
    # against the other cycles' motion, whose noise the friction of a cycle does not share
    others = (count * mean - velocity) / (count - 1) if count > 1 else velocity
    phases = np.array([_angle(v, f) for v, f in zip(others, friction, strict=True)])
    middle = _angle(mean, friction.mean(axis=0))
    phase = mean_of_cycles(
        f"phase of friction behind velocity at {1 / length:.3g} Hz",
        middle + np.angle(np.exp(1j * (phases - middle))),
        unit="rad",
        method="area of the loop, each cycle",
    )
    # a reversal lies between two samples, and its kink within the blur
    least = math.hypot(LEAST_PHASE, math.pi / points, BLURRED * math.pi * samples.blur / shortest)
    return _Loop(_at_least(phase, least), 1 / length, displacement.mean(axis=0), mean, way.mean(axis=0))


def _folded(values: Array, starts: Rows, ends: Rows, points: int) -> Array:
    """Means over equal parts of each cycle (m, points): a jump inside a part keeps its place."""
    summed = np.concatenate([[0.0], np.cumsum(values)])
    edges = np.linspace(starts, ends, points + 1, axis=1)
    return np.asarray(
        np.diff(np.interp(edges, np.arange(len(summed)), summed), axis=1) * points / (ends - starts)[:, None]
    )


def _angle(velocity: Array, friction: Array) -> float:
    """By which friction follows the velocity, of one cycle each."""
    change = (np.roll(velocity, -1) - np.roll(velocity, 1)) / 2
    return math.atan2(-float(friction @ change), 2 * math.pi / len(velocity) * float(friction @ velocity))


def _at_least(phase: Estimate, sd: float) -> Estimate:
    """The phase with no narrower an interval than sampling allows."""
    half = math.hypot(phase.interval[1] - phase.value, NORMAL_95 * sd)
    return replace(phase, interval=(phase.value - half, phase.value + half), sd=math.hypot(phase.sd, sd))


def _late(value: float, loop: _Loop) -> Array:
    waves = np.fft.rfftfreq(len(loop.way), 1 / len(loop.way))
    turned = np.exp(-2j * np.pi * loop.frequency * value * waves)
    return np.asarray(np.fft.irfft(np.fft.rfft(loop.way) * turned, len(loop.way)))


def _following(value: float, loop: _Loop) -> Array:
    waves = np.fft.rfftfreq(len(loop.way), 1 / len(loop.way))
    lag = 1 + 2j * np.pi * loop.frequency * value * waves
    return np.asarray(np.fft.irfft(np.fft.rfft(loop.way) / lag, len(loop.way)))


def _giving(value: float, loop: _Loop) -> Array:
    """An element that gives way over `value` along the loop's displacement, gone through twice."""
    x = loop.displacement
    return deflections(np.tile(x, 2), np.array([value]))[len(x) :, 0]


FOLLOWS: dict[str, tuple[Callable[[float, _Loop], Array], str, str]] = {
    "time delay": (_late, "delay of all friction", "s"),
    "state variable": (_following, "time constant of the friction", "s"),
    "way": (_giving, "give of the contact", "m"),
}


def _fitted(kind: str, loops: list[_Loop]) -> tuple[Estimate | None, float]:
    """The value of a memory that explains the phases best, and what it leaves of them over what they allow."""
    follows, name, unit = FOLLOWS[kind]
    phases, sds = (np.array(column) for column in zip(*((loop.phase.value, _sd(loop)) for loop in loops), strict=True))
    if phases.mean() <= 0:
        return None, float(np.sqrt(np.sum((phases / sds) ** 2) / max(1, len(loops) - 1)))
    slowest = 1 / (2 * math.pi * min(loop.frequency for loop in loops))
    scale = slowest if unit == "s" else max(float(np.ptp(loop.displacement)) for loop in loops) / 2

    def misfit(logs: Array) -> Array:
        value = math.exp(float(np.clip(logs[0], -FAR, FAR)))
        return np.asarray(np.array([_angle(loop.velocity, follows(value, loop)) for loop in loops]) / sds)

    grid = np.log(scale * np.geomspace(1e-5, 0.99, LAGS))
    start = min(grid, key=lambda log: float(np.sum((phases / sds - misfit(np.array([log]))) ** 2)))
    # one row of no weight more than parameters: a single record still has its value
    minimum = minimise(
        lambda logs: np.append(misfit(logs), 0.0), np.append(phases / sds, 0.0), [start], settled_at=1e-8, most=60
    )
    left = float(np.sqrt(minimum.squares / max(1, len(loops) - 1)))
    slope = float(np.linalg.norm(minimum.jacobian))
    value, wide = math.exp(minimum.parameters[0]), min(FAR, NORMAL_95 * max(1.0, left) / max(slope, 1e-300))
    interval = (value * math.exp(-wide), value * math.exp(wide))
    return Estimate(
        name, value, interval, value * wide / NORMAL_95, unit, f"least squares of {len(loops)} phases"
    ), left


def _sd(loop: _Loop) -> float:
    half = (loop.phase.interval[1] - loop.phase.interval[0]) / 2 / NORMAL_95
    return half if math.isfinite(half) else LEAST_PHASE


def _rotation(loops: list[_Loop]) -> str:
    signs = {0 if abs(loop.phase.value) < NORMAL_95 * _sd(loop) else int(np.sign(loop.phase.value)) for loop in loops}
    if signs == {0}:
        return "none"
    return "anticlockwise" if signs <= {0, 1} else "clockwise" if signs <= {0, -1} else "both"


def _verdict(loops: list[_Loop], rotation: str, misfit: dict[str, float]) -> tuple[str, str]:
    phases = ", ".join(f"{loop.phase.value:.3f} rad at {loop.frequency:.3g} Hz" for loop in loops)
    unsure = max(NORMAL_95 * _sd(loop) for loop in loops)
    if rotation == "none" and unsure > UNSURE:
        return "undecided", f"the phases are told to {unsure:.2g} rad alone ({phases}): give more cycles, or less noise"
    if rotation == "none":
        return "none", f"friction is in phase with the velocity ({phases})"
    if rotation != "anticlockwise":
        return "undecided", (
            f"friction goes ahead of the velocity ({phases}): a falling curve that answers late is gone round "
            "clockwise, and so is friction whose sensor is early"
        )
    if len(loops) < 2 or _reach(loops) < FURTHEST:
        return (
            "undecided",
            f"friction follows the velocity ({phases}): a second frequency tells whether by a time or a way",
        )
    left = {kind for kind, value in misfit.items() if _chance(value, len(loops) - 1) > REJECTED}
    leaves = ", ".join(f"{kind} {value:.2g}" for kind, value in misfit.items())
    if len(left) == 1:
        return left.pop(), f"friction follows the velocity ({phases}); misfits over what the phases allow: {leaves}"
    why = "none of them explains" if not left else "each of " + ", ".join(sorted(left)) + " explains"
    return "undecided", f"{why} how friction follows the velocity ({phases}); misfits: {leaves}"


def _reach(loops: list[_Loop]) -> float:
    frequencies = [loop.frequency for loop in loops]
    return max(frequencies) / min(frequencies)


def _chance(misfit: float, freedom: int) -> float:
    """Of a misfit at least so large, were the memory right."""
    from scipy.special import chdtrc

    return float(chdtrc(freedom, misfit**2 * freedom))


def _status(loops: list[_Loop], memory: str) -> str:
    doubts = [loop.phase.status for loop in loops if loop.phase.status != "ok"][:1]
    for loop in loops:
        stuck = float(np.mean(np.abs(loop.way) < HALF))
        if stuck > STICKS:
            doubts.append(
                f"at {loop.frequency:.3g} Hz the contact rests {100 * stuck:.0f} % of the time, in which no memory "
                "shows: records in which it slides all the time tell more"
            )
    if memory == "undecided" and len(loops) > 1 and _reach(loops) >= FURTHEST:
        doubts.append("give records of higher frequencies, where the memories part")
    return Status(*doubts)
