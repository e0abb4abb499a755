"""What curves and laws are held against: friction over a motion, cycle by cycle, and friction around rest."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from stickslip.arrays import Array, Mask, Rows
from stickslip.balance.motion import (
    AUDIBLE,
    CREEP,
    FORCES,
    away_from,
    contact_motion,
    find_cycles,
    motion_channels,
    require_fit,
)
from stickslip.cycle.loops import LEAST_SPREAD, Loops
from stickslip.errors import EstimateError
from stickslip.estimate import NORMAL_95, Estimate
from stickslip.record.record import Record
from stickslip.signals.derivatives import smooth
from stickslip.signals.interpolate import without_delays
from stickslip.signals.noise import noise_level
from stickslip.units import prefixed

BLOCKS = 200  # of a cycle, or of a motion without one, whose residuals are told apart
LEAST = 50  # samples
REVERSED = 0.05  # of the fastest speed: what goes back slower than that does not reverse
COEFFICIENT = {"N": "1", "N s/m": "s/m", "N/m": "1/m"}  # what stands for a unit where friction has none
TURNING = {"N": "N m", "N s/m": "N m s/rad", "N/m": "N m/rad", "m": "rad", "m/s": "rad/s"}
FAST = 0.3  # of the largest speed, above which friction is that of sliding
CREEPING, AT_REST = 0.08, 0.02  # of the largest speed: hardly sliding, and not at all
NOISY = 4.0  # deviations of the velocity, below which it may be at rest
HELD = 0.4  # of a radian of the motion that a contact holds at least, for a release to be told
LEAST_HELD, LEAST_SLOW = 24, 8  # samples of a hold, and of slow sliding
CORNER, AFTER = 3, 15  # samples after a release within which a sudden fall is blurred, and is over
ROUNDED = 0.01  # of the level, that smoothing alone makes of a corner
EXCESSES = np.linspace(0.0, 0.6, 121)[1:]
FALLS = np.geomspace(0.03, 1.0, 16)  # Stribeck speed over the largest speed


@dataclass(frozen=True, eq=False)
class Samples:
    """Friction over a motion.

    Attributes
    ----------
    time, displacement, velocity, friction : ndarray, shape (n,)
        In order of time.
    cycle : ndarray of int, shape (n,)
        Number of the cycle that each sample lies in; all zero where there is none.
    block : ndarray of int, shape (n,)
        Part of the cycle, 0 to 199.
    cycles : int
        Number of cycles that went into them.
    noise : float
        Standard deviation of the friction's broadband noise.
    unit : str
        Of the displacement, "m" or "rad".
    force : str
        Of the friction, "N", "N m" or "1".
    skipped : int
        Samples at the start that set the memory of a curve that has one, and are not compared.
    blur : int
        Samples over which the velocity's smoothing spreads a kink.
    """

    time: Array
    displacement: Array
    velocity: Array
    friction: Array
    cycle: Rows
    block: Rows
    cycles: int
    noise: float
    unit: str
    force: str = "N"
    skipped: int = 0
    blur: int = 1

    @property
    def compared(self) -> Samples:
        """Those that a curve is held against."""
        return replace(self.rows(slice(self.skipped, None)), skipped=0)

    def rows(self, chosen: Mask | Rows | slice) -> Samples:
        """Some of the samples."""
        arrays = ("time", "displacement", "velocity", "friction", "cycle", "block")
        return replace(self, **{name: getattr(self, name)[chosen] for name in arrays})

    def in_units(self, unit: str) -> str:
        """A unit along a path, or what stands for it round an axis, or for a coefficient."""
        if self.force == "1":
            return COEFFICIENT.get(unit, unit)
        return TURNING.get(unit, unit) if self.unit == "rad" else unit

    @property
    def speed_spread(self) -> float:
        """How far the speed varies about its mean, over that mean; each direction about its own."""
        speed, forward = np.abs(self.velocity), self.velocity > 0
        spread = [float(speed[side].std()) for side in (forward, ~forward) if side.any()]
        return max(spread) / float(speed.mean())

    @property
    def drives(self) -> bool:
        """Whether friction feeds the motion on the whole."""
        return float(self.friction @ self.velocity) < 0

    @property
    def reverses(self) -> bool:
        """Whether it moves both ways."""
        fastest = float(np.abs(self.velocity).max())
        return bool(min(self.velocity.max(), -self.velocity.min()) > REVERSED * fastest)


def told(value: float, unit: str) -> str:
    """A number to three figures, in a readable unit."""
    factor, text = prefixed(value, unit)
    return f"{factor * value:.3g} {text}"


def require_resisting(samples: Samples) -> None:
    """Refuse friction that drives the motion: no contact gives way so."""
    if samples.drives:
        raise EstimateError(
            f"friction does {float(samples.friction @ samples.velocity) / len(samples.time):.3g} W on average",
            "it opposes the motion",
            "check the sign of the force or of the displacement",
        )


def samples_of(
    data: Record | Loops,
    *,
    contact: str | None,
    frequency: float | str | None,
    smoothed: bool = False,
    normal: float | None = None,
) -> tuple[Samples, Samples]:
    """All samples of the complete cycles, the first of several to set a memory, and those of them that slide.

    A displacement that trembles by its noise makes an element give way and come back: `smoothed`, it does not.
    A coefficient of friction is turned into a force where the load `normal` [N] is known.
    """
    if isinstance(data, Loops):
        query = {"contact": contact, "frequency": frequency, "normal": normal}
        if given := [f"{name}=" for name, value in query.items() if value is not None]:
            raise EstimateError(
                f"{' and '.join(given)} of friction_loops' answer",
                "its mean cycle holds a force over a known motion",
                "tell friction_loops, or give the record itself",
            )
        return _of_loops(data)
    if not isinstance(data, Record):
        raise EstimateError(
            f"a curve of {type(data).__name__}", "it is fitted to a Record or to friction_loops of one", "give either"
        )
    return _of_record(data, contact, frequency, smoothed, normal)


def _of_record(
    data: Record, contact: str | None, frequency: float | str | None, smoothed: bool, normal: float | None
) -> tuple[Samples, Samples]:
    """The friction over the motion of the contact, cycle by cycle where it has any."""
    question = "the fit of a friction curve"
    rubs = "coefficient" if "coefficient" in data and "friction" not in data else "friction"
    data.require_clean(rubs, question=question, samples=LEAST)
    if np.ptp(data[rubs]) == 0:
        raise EstimateError(f"channel {rubs} never changes", f"{question} needs one that does", "check its column")
    record = without_delays(data, *motion_channels(data, contact), rubs, question=question)
    motion = contact_motion(record, contact=contact, question=question)
    friction, force = record[rubs], record.channels[rubs].unit
    if rubs == "friction":
        require_fit(record, rubs, length=motion.unit, question=question)
    elif normal is not None:
        friction, force = normal * friction, "N"
    label, edges = np.zeros(len(friction), dtype=np.intp), np.array([0.0, len(friction)])
    try:
        cycles = find_cycles(record, motion, frequency=frequency)
    except EstimateError:
        if frequency is not None:
            raise
        peak = float(np.abs(motion.velocity).max())  # no cycle: all of it is one
    else:
        label, edges, peak = cycles.labels(len(friction)), cycles.edges, cycles.peak
    rows = np.arange(len(friction))
    place = smooth(motion.displacement, record.fs).values if smoothed else motion.displacement
    share = (rows - edges[label]) / (edges[label + 1] - edges[label])
    samples = Samples(
        time=record.start + rows / record.fs,
        displacement=place,
        velocity=motion.velocity,
        friction=friction,
        cycle=label,
        block=np.clip((BLOCKS * share).astype(np.intp), 0, BLOCKS - 1),
        cycles=len(edges) - 1,
        noise=noise_level(friction, record.fs),
        unit=motion.unit,
        force=force,
        blur=motion.blur,
    )
    fast = np.abs(motion.velocity) > max(CREEP * peak, AUDIBLE * motion.noise)
    clear = fast & away_from(~fast, motion.blur)
    sliding = clear if clear.sum() > fast.sum() / 2 else fast
    whole = samples.rows(label >= 0)
    return replace(whole, skipped=int(np.argmax(whole.cycle > 0))), _require_sliding(
        samples.rows(sliding & (label >= 0))
    )


def _of_loops(loops: Loops) -> tuple[Samples, Samples]:
    """The mean cycle; what it knows of the scatter between cycles is in the noise."""
    count = len(loops.phase_grid)
    samples = Samples(
        time=loops.phase_grid / loops.frequency.value,
        displacement=loops.displacement,
        velocity=loops.velocity,
        friction=loops.friction,
        cycle=np.zeros(count, dtype=np.intp),
        block=(BLOCKS * loops.phase_grid).astype(np.intp),
        cycles=len(loops.cycles),
        noise=float(np.median(loops.scatter)) / np.sqrt(len(loops.cycles)),
        unit=loops.unit,
        force=FORCES[loops.unit],
    )
    fast = np.abs(loops.velocity) > CREEP * float(np.abs(loops.velocity).max())
    twice = samples.rows(np.tile(np.arange(count), 2))  # once round to set the memory
    return replace(twice, skipped=count), _require_sliding(samples.rows(fast & away_from(~fast, 1)))


def _require_sliding(samples: Samples) -> Samples:
    if len(samples.friction) < LEAST:
        raise EstimateError(
            f"{len(samples.friction)} samples slide",
            f"a curve of friction needs {LEAST} at least",
            "give a record that slides longer, or was sampled faster",
        )
    return samples


def require_speeds(samples: Samples, curve: str) -> None:
    """Refuse to tell how friction changes with speed where the speed hardly does."""
    if samples.speed_spread < LEAST_SPREAD:
        raise EstimateError(
            f"the sliding speed varies by {100 * samples.speed_spread:.1f} % about its mean",
            f"the curve '{curve}' needs speeds that differ by {100 * LEAST_SPREAD:g} % at least",
            "let the speed vary, as in a sine or a ramp; of this record, fit 'coulomb'",
        )


def require_reversals(samples: Samples, curve: str) -> None:
    """Refuse what only motion both ways shows."""
    if not samples.reverses:
        raise EstimateError(
            f"the velocity runs from {samples.velocity.min():.3g} to {samples.velocity.max():.3g} {samples.unit}/s",
            f"the curve '{curve}' needs motion both ways",
            "give a record that reverses",
        )


@dataclass(frozen=True, eq=False)
class Rests:
    """Friction around rest, over its level in fast sliding.

    Attributes
    ----------
    falls : ndarray (n,)
        Of each release: by how much the friction falls at once.
    sinks : ndarray (n, 16)
        What a Stribeck curve of excess 1 falls there as quickly, for each v_s of FALLS.
    rises : ndarray (q,)
        Of each start and each end of a stroke: by how much it is larger in slow sliding.
    shapes : ndarray (q, 16)
        Mean of ``exp(-(v/v_s)^2)`` there, for each v_s of FALLS.
    strays : ndarray
        Of each stroke: standard deviation in fast sliding.
    pulls : ndarray (q,)
        How large the forces are whose balance the friction is there, and whose calibrations may be off.
    """

    falls: Array
    sinks: Array
    rises: Array
    shapes: Array
    strays: Array
    pulls: Array

    @classmethod
    def of(
        cls,
        speed: Array,
        friction: Array,
        *,
        fs: float,
        frequency: float,
        unsure: float,
        blur: int = 1,
        balanced: Array | None = None,
    ) -> Rests:
        """Those of one record; `unsure` [m/s] is the speed's deviation, `frequency` [rad/s] the motion's.

        `balanced` [N] is how large the forces are whose balance the friction is, where no load cell tells it.

        A fall is not told of forces that are balanced, where smoothing spreads it beyond its corner (`blur` samples),
        or where the motion goes on while its samples pass: at 60 samples a cycle even a friction of one level seemed to
        fall by its own size.
        """
        sudden = balanced is None and blur <= CORNER and AFTER / fs * frequency < HELD
        top = float(np.abs(speed).max())
        still = max(AT_REST * top, NOISY * unsure)
        falls, sinks, rises, shapes, strays, pulls = [], [], [], [], [], []
        ended = None
        for first, last in _strokes(speed, still, FAST * top):
            side = np.sign(speed[(first + last) // 2])
            fast = side * speed[first:last] > FAST * top
            sliding = side * friction[first:last]
            level = float(np.median(sliding[fast]))
            if not level > 0:
                continue
            strays.append(float(np.std(sliding[fast])) / level)
            swift = np.flatnonzero(side * speed[first:last] > CREEPING * top)
            begins, ends = (first, first + int(swift[0])), (first + int(swift[-1]) + 1, last)
            whole = (ended is not None, last < len(speed) - LEAST_HELD)
            for (a, b), seen in zip((begins, ends), whole, strict=True):
                if seen and b - a >= max(LEAST_SLOW, 2 * blur) and still < CREEPING * top:
                    rises.append(float(side * friction[a:b].mean()) / level - 1)
                    shapes.append(_stribeck(speed[a:b] / top))
                    pulls.append(1.0 if balanced is None else float(balanced[a:b].mean()) / level)
            duration = first - (first if ended is None else ended)
            if sudden and duration >= max(LEAST_HELD, HELD / frequency * fs) and first + LEAST_HELD <= len(speed):
                begun = first - duration // 2
                fall, after = _fall(side * friction[begun : first + LEAST_HELD], duration // 2)
                falls.append(fall / level)
                sinks.append(1 - _stribeck(speed[begun:][after] / top))
            ended = last
        curves = (np.array(rows).reshape(-1, len(FALLS)) for rows in (sinks, shapes))
        return cls(np.array(falls), next(curves), np.array(rises), next(curves), np.array(strays), np.array(pulls))

    @classmethod
    def together(cls, parts: Sequence[Rests]) -> Rests:
        """Those of several records."""
        names = ("falls", "sinks", "rises", "shapes", "strays", "pulls")
        return cls(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))

    @property
    def fall(self) -> Estimate | None:
        """By what the friction falls at once when the contact lets go; of two releases at least."""
        if len(self.falls) < 2:
            return None
        value, sd = _middle(self.falls, self.strays)
        sd = float(np.hypot(sd, ROUNDED))
        ends = (max(0.0, value - NORMAL_95 * sd), max(0.0, value) + NORMAL_95 * sd)
        method = f"fall of the friction as the contact lets go, median of {len(self.falls)} releases"
        return Estimate("excess of static friction", max(0.0, value), ends, sd, "1", method)

    def probabilities(self, calibration: float, least: float) -> dict[str, float]:
        r"""How probable each rigid law is, its parameters averaged over what they may be.

        With J the fall at a release and R the rise in slow sliding, both over the level: Coulomb has J = R = 0; static
        friction that exceeds by e has J = e, R = 0; a Stribeck curve J = 0, :math:`R = e \exp(-(v/v_s)^2)`. An excess
        below `least` is not asked for. What was not seen speaks for none. Where the speed has run through a curve when
        the friction after a release is told, J is what that has fallen by.
        """
        fall, rise, sink, shape = 0.0, 0.0, np.zeros(len(FALLS)), np.ones(len(FALLS))
        sharp, slow = np.inf, np.inf
        if self.fall is not None:
            fall, sharp, sink = float(np.median(self.falls)), self.fall.sd, np.median(self.sinks, axis=0)
        if len(self.rises) > 1:
            scatter = max(float(np.std(self.rises, ddof=1)), float(np.median(self.strays)))
            off = calibration * max(1.0, float(np.median(self.pulls)))
            slow = float(np.hypot(scatter / len(self.rises) ** 0.5, max(ROUNDED, off)))
            rise, shape = float(self.rises.mean()), self.shapes.mean(axis=0)
        excesses = EXCESSES[np.greater(EXCESSES, least)]
        flat, still = _likely(rise / slow), _likely(fall / sharp)
        odds = {
            "Coulomb": still * flat,
            "static": flat * _likely((fall - excesses) / sharp),
            "Stribeck": _likely(
                np.hypot((fall - np.outer(excesses, sink)) / sharp, (rise - np.outer(excesses, shape)) / slow)
            ),
        }
        total = sum(odds.values())
        return {name: value / total if total > 0 else 1 / len(odds) for name, value in odds.items()}


def _stribeck(speeds: Array) -> Array:
    """Mean of Stribeck's curve at speeds over the largest one, for each v_s of FALLS."""
    return np.asarray(np.exp(-((speeds[:, None] / FALLS) ** 2)).mean(axis=0))


def _likely(strays: Array | float) -> float:
    """The mean likelihood of Gaussian strays."""
    return float(np.mean(np.exp(-np.square(strays) / 2)))


def _middle(values: Array, strays: Array) -> tuple[float, float]:
    """The median, and how unsure: neither surer than the values agree nor than the friction strays in sliding."""
    scatter = max(float(np.median(np.abs(values - np.median(values)))) / 0.6745, float(np.median(strays)))
    return float(np.median(values)), 1.25 * scatter / float(np.sqrt(len(values)))


def _strokes(speed: Array, still: float, fast: float) -> list[tuple[int, int]]:
    """First and last row of each slide one way in which the mass becomes fast."""
    way = np.concatenate([[0.0], np.sign(speed) * (np.abs(speed) > still), [0.0]])
    edges = np.flatnonzero(np.diff(way))
    slides = [(int(a), int(b)) for a, b in itertools.pairwise(edges) if way[a + 1]]
    return [(a, b) for a, b in slides if np.abs(speed[a:b]).max() > fast]


def _fall(friction: Array, hold: int) -> tuple[float, slice]:
    """By what the friction is less after a release than the line that it followed until then, and where it is told; the
    release is searched.

    `hold` is the row from which on it surely slides.
    """
    best, fall = np.inf, (0.0, slice(hold + CORNER, hold + AFTER))
    for release in range(hold // 2, hold + 1):
        rows = np.arange(max(0, release - hold // 2), release) - release
        inner = slice(release + CORNER, release + AFTER)
        after = friction[inner]
        slope, end = np.polyfit(rows, friction[release + rows], 1)
        left = np.concatenate([friction[release + rows] - end - slope * rows, after - after.mean()])
        cost = float(left @ left) / len(left)
        if cost < best:
            best, fall = cost, (float(end - after.mean()), inner)
    return fall
