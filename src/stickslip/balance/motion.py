"""The motion of a contact: how its two sides move against each other, and the cycles of that motion."""

from __future__ import annotations

import math
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np

from stickslip.arrays import Array, Mask, Rows
from stickslip.errors import EstimateError, RecordError, StickslipError
from stickslip.estimate import Estimate
from stickslip.record.flaws import constant
from stickslip.record.record import Record
from stickslip.signals.derivatives import differentiate
from stickslip.signals.noise import noise_level
from stickslip.statistics import least_squares, mean_of_cycles
from stickslip.units import parse_value

DRIVES = {"z": "base", "force": "force"}  # channels of what moves the mass, and what each moves
LEAST = 32  # samples
FORCES = {"m": "N", "rad": "N m"}  # what does work on a displacement, or an angle
AUDIBLE = 5.0  # a speed of five standard deviations of its noise is motion
CREEP = 0.04  # share of the typical peak speed below which presliding and creep are not told from sticking
TURNED = 0.1  # share of the typical peak speed that the motion reaches before it counts as reversed
NEARLY = 0.02  # of a period: a cycle that lacks no more is complete
PERIODIC = 0.9  # share of the displacement's variance that repeats from cycle to cycle
PHASES = 200  # points of a mean cycle
STILL = 1e-10  # of a frequency: a smaller step is none
ENOUGH = 65536  # samples for the search of a frequency; longer records are averaged in blocks


@dataclass(frozen=True, eq=False)
class Motion:
    """Displacement and velocity across a contact.

    Attributes
    ----------
    displacement, velocity : ndarray, shape (n,)
        Of the moving side against the other [unit, unit/s].
    noise : float
        Standard deviation of the velocity's noise [unit/s].
    bandwidth : float
        Frequency [Hz] up to which the velocity follows.
    fs, start : float
        Sampling rate [Hz] and time [s] of the first sample.
    unit : str
        "m" or "rad".
    """

    displacement: Array
    velocity: Array
    noise: float
    bandwidth: float
    fs: float
    start: float
    unit: str

    @property
    def blur(self) -> int:
        """Samples on either side over which the smoothing spreads a jump: half a cycle of the bandwidth."""
        return max(1, math.ceil(self.fs / (2 * self.bandwidth)))


@dataclass(frozen=True, eq=False)
class Cycles:
    """Complete cycles of a motion.

    Attributes
    ----------
    edges : ndarray, shape (m + 1,)
        Where each of the m cycles begins and the last ends, in samples (not whole).
    frequency : Estimate
        Cycles per second [Hz].
    peak : float
        Typical peak speed: the median over the cycles of each one's largest.
    status : str
        "ok" where all cycles have one length; otherwise why they have not, and how they were told apart.
    turns : ndarray, shape (m,), or None
        Where each cycle turns back, in samples, if its length wanders.
    """

    edges: Array
    frequency: Estimate
    peak: float
    status: str = "ok"
    turns: Array | None = None

    def labels(self, size: int) -> Rows:
        """Number of the cycle that each of `size` samples lies in; -1 outside the complete cycles."""
        number = np.searchsorted(self.edges, np.arange(size), side="right") - 1
        return np.where(number < len(self.edges) - 1, number, -1)

    def folded(self, values: Array, phases: int = PHASES) -> Array:
        """`values` at equal phases of each cycle, shape (m, phases); all cycles turn back at the same phase."""
        grid = np.arange(phases) / phases
        begin, length = self.edges[:-1, None], np.diff(self.edges)[:, None]
        turn = length / 2 if self.turns is None else self.turns[:, None] - begin
        half = float(np.median(turn / length))
        at = begin + np.minimum(grid / half, 1) * turn + np.maximum((grid - half) / (1 - half), 0) * (length - turn)
        return np.interp(at, np.arange(len(values)), values)


# several questions ask one record for its motion and its cycles
_MOTIONS: WeakKeyDictionary[Record, dict[str, Motion]] = WeakKeyDictionary()
_CYCLES: WeakKeyDictionary[Motion, Cycles] = WeakKeyDictionary()


def slid_on(record: Record, contact: str | None) -> str:
    """What the mass slides on: as said, or as :func:`friction_force` was told, or the ground."""
    if contact is None:
        contact = "ground" if record.rig is None else record.rig.contact
    if contact not in ("ground", "base"):
        raise EstimateError(f"contact = '{contact}'", "the mass slides on the ground or the base", "choose one of them")
    return contact


def require_change(record: Record, *names: str, question: str) -> None:
    """Refuse, in one sentence, a sensor that reads one value throughout."""
    for name in names:
        if name in record and constant(record[name]):
            channel = record.channels[name]
            raise RecordError(
                f"channel {name} does not change: it reads {record[name][0]:.4g} {channel.unit} throughout",
                f"{question} needs a sensor that follows the motion",
                "look at its cable, range and column, or leave it out when reading",
            )


def motion_channels(record: Record, contact: str | None) -> list[str]:
    """The channels that tell the motion of the contact, its position first."""
    if slid_on(record, contact) == "base":
        return ["x", "z"]
    velocity = ["v"] if is_measured(record, "v") else []
    if "x" in record:
        return ["x", *velocity]
    return ["theta"] if "theta" in record else velocity or ["x"]


def contact_motion(record: Record, *, contact: str | None, question: str) -> Motion:
    """How do the two sides of the contact move against each other?

    Against the ground: ``x`` (or ``theta``) and ``v``, differentiated from it where it was not measured. Against the
    base: ``x - z`` and its derivative.

    Parameters
    ----------
    record : Record
        With ``x`` or ``theta``, or ``v`` alone, whose integral is then the displacement; their delays taken out.
    contact : {"ground", "base"}, optional
        What the mass slides on; as :func:`friction_force` was told, or the ground, when not given.
    question : str
        Who asks, for the errors.

    Returns
    -------
    Motion

    Raises
    ------
    RecordError
        A channel is missing, broken or too short.
    EstimateError
        Nothing moves.
    """
    known = _MOTIONS.setdefault(record, {})
    if (side := slid_on(record, contact)) not in known:
        known[side] = _contact_motion(record, contact, question)
    return known[side]


def _contact_motion(record: Record, contact: str | None, question: str) -> Motion:
    names = motion_channels(record, contact)
    record.require_clean(*names, question=question, samples=LEAST)
    displacement = record[names[0]]
    if names == ["v"]:
        displacement = np.concatenate([[0.0], np.cumsum((displacement[1:] + displacement[:-1]) / 2)]) / record.fs
    if "z" in names:
        displacement = displacement - record["z"]
    if np.ptp(displacement) == 0:
        raise EstimateError(
            f"channel {names[0]} never changes{' against z' if 'z' in names else ''}",
            f"{question} needs motion",
            "check the sensor and its column",
        )
    if "v" in names:
        stated = record.channels["v"].noise
        noise, bandwidth, velocity = stated or noise_level(record["v"], record.fs), record.fs / 2, record["v"]
    else:
        derivative = differentiate(displacement, record.fs)
        velocity, noise, bandwidth = derivative.values, float(np.median(derivative.sd)), derivative.bandwidth
    fastest = float(np.abs(velocity).max())
    unit = "rad" if "theta" in names else "m"
    displacement.setflags(write=False)
    velocity.setflags(write=False)
    if fastest <= AUDIBLE * noise:
        raise EstimateError(
            f"the largest speed is {fastest:.3g} {unit}/s, its noise {noise:.3g} {unit}/s",
            f"{question} needs motion that rises above its noise",
            "give a record that moves, or a quieter sensor",
        )
    return Motion(displacement, velocity, noise, bandwidth, record.fs, record.start, unit)


def find_cycles(record: Record, motion: Motion, *, frequency: float | str | None = None) -> Cycles:
    """Which complete cycles does the motion go through?

    The forcing frequency is the strongest line of ``z``, ``force`` or the displacement, whichever the record has first,
    refined by least squares; a cycle begins where the fundamental of the displacement passes its mean upwards. If the
    displacement does not repeat (less than 90 % of its variance), a cycle runs from one onset of forward motion to
    the next; of motion at all, where it never reverses.

    Parameters
    ----------
    record : Record
        Where the forcing is looked for.
    motion : Motion
        Of the contact.
    frequency : float or str, optional
        Forcing frequency [Hz], where it is known.

    Returns
    -------
    Cycles

    Raises
    ------
    EstimateError
        Not one complete cycle.
    """
    if frequency is None:
        if motion not in _CYCLES:
            _CYCLES[motion] = _cycles(record, motion)
        return _CYCLES[motion]
    frequency, duration = parse_value(frequency, "Hz"), len(motion.displacement) / motion.fs
    cycles = None
    if 1 / duration <= frequency < motion.fs / 2:
        given = Estimate.normal("forcing frequency", frequency, sd=0.0, unit="Hz", method="given")
        cycles = _periodic(motion, given)
    if cycles is None:
        raise EstimateError(
            f"frequency = {frequency:g} Hz gives no complete cycle in {duration:.3g} s",
            f"it lies between one cycle in the record and half the rate, {motion.fs / 2:g} Hz",
            "give it in Hz, or leave it out",
        )
    return cycles


def _cycles(record: Record, motion: Motion) -> Cycles:
    reference = next((name for name in ("z", "force") if name in record and _moves(record[name])), "")
    frequency = forcing_frequency(record[reference] if reference else motion.displacement, motion.fs)
    cycles = _periodic(motion, frequency)
    repeated = 0.0 if cycles is None else _repeated(cycles, motion.displacement)
    return cycles if cycles is not None and repeated >= PERIODIC else _aperiodic(motion, repeated)


def forcing_frequency(values: Array, fs: float) -> Estimate:
    """The frequency of the strongest line, by least squares on ``a cos + b sin + c + d t``.

    It starts from the largest value of the Hann-windowed spectrum and is refined by Gauss-Newton; the interval holds
    for correlated residuals.

    Parameters
    ----------
    values : ndarray, shape (n,)
        Samples.
    fs : float
        Sampling rate [Hz].

    Returns
    -------
    Estimate
        In Hz.

    Examples
    --------
    >>> t = np.arange(4000) / 1000
    >>> noise = 0.1 * np.random.default_rng(0).standard_normal(t.size)
    >>> round(forcing_frequency(np.sin(2 * np.pi * 2.5 * t) + noise, 1000).value, 2)
    2.5
    """
    from scipy.fft import next_fast_len, rfft

    block = max(1, len(values) // ENOUGH)
    short = values[: len(values) // block * block].reshape(-1, block).mean(axis=1)
    rate, count = fs / block, len(short)
    time = np.asarray((np.arange(count) - (count - 1) / 2) / rate, dtype=float)
    trend = np.column_stack([np.ones(count), time / time[-1]])
    level = short - trend @ np.linalg.lstsq(trend, short, rcond=None)[0]
    size = next_fast_len(4 * count, real=True)
    spectrum = np.abs(rfft(level * np.hanning(count), size))
    first = max(1, size // count)  # one cycle in the record
    guess = frequency = (first + int(np.argmax(spectrum[first:]))) * rate / size
    name, method = "forcing frequency", "least-squares sine"
    for _ in range(12):
        columns = np.column_stack([*_wave(frequency, time, short, trend), trend])
        step = float(np.linalg.lstsq(columns, short, rcond=None)[0][0])
        frequency += float(np.clip(step, -0.2 * frequency, 0.2 * frequency))
        if abs(step) < STILL * frequency:
            break
    try:
        fit = least_squares(np.column_stack([*_wave(frequency, time, short, trend), trend]), short)
    except EstimateError:  # about a cycle: a sine is not told from a trend
        status = "too few cycles to tell the frequency from a trend"
        return Estimate.normal(name, guess, sd=math.inf, unit="Hz", method=method, status=status)
    return Estimate.normal(name, frequency, sd=float(fit.sd[0]), unit="Hz", method=method)


def _wave(frequency: float, time: Array, values: Array, trend: Array) -> tuple[Array, Array, Array]:
    """How the nearest sine changes with its frequency, and its cosine and sine."""
    turn = 2 * np.pi * frequency * time
    cosine, sine = np.cos(turn), np.sin(turn)
    a, b = np.linalg.lstsq(np.column_stack([cosine, sine, trend]), values, rcond=None)[0][:2]
    return 2 * np.pi * time * (b * cosine - a * sine), cosine, sine


def is_measured(record: Record, name: str) -> bool:
    """Whether the record has the channel, and not from :func:`friction_force`, which derives what was not measured."""
    return name in record and record.channels[name].source != "friction_force"


def require_fit(record: Record, *forces: str, length: str, question: str) -> None:
    """Refuse, in one sentence, a torque with a displacement or a force with an angle (`length` "m" or "rad")."""
    for name in forces:
        unit = record.channels[name].unit
        if unit != FORCES[length]:
            raise RecordError(
                f"channel {name} is in {unit}, the motion in {length}",
                f"{question} needs a force in N with a displacement, or a torque in N m with an angle",
                "give both in units that belong together, as in a lever's x = r theta or force = torque / r",
            )


def away_from(events: Mask, margin: int) -> Mask:
    """Which samples are more than `margin` samples away from every sample where `events` holds."""
    count = np.concatenate([[0], np.cumsum(events)])
    rows = np.arange(len(events))
    return np.asarray(count[np.minimum(rows + margin + 1, len(events))] == count[np.maximum(rows - margin, 0)])


def _moves(values: Array) -> bool:
    return bool(np.isfinite(values).all() and np.ptp(values) > 0)


def _periodic(motion: Motion, frequency: Estimate) -> Cycles | None:
    """Cycles of one length, from where the displacement's fundamental passes its mean upwards."""
    count = len(motion.displacement)
    time = np.arange(count) / motion.fs
    centred = motion.displacement - motion.displacement.mean()
    phase = np.angle(np.vdot(np.exp(2j * np.pi * frequency.value * time), centred))  # x ~ cos(2 pi f t + phase)
    period = motion.fs / frequency.value
    first = ((-np.pi / 2 - phase) / (2 * np.pi)) % 1.0 * period
    if period - first < NEARLY * period:
        first -= period
    edges = first + period * np.arange(math.floor((count - 1 - first) / period + NEARLY) + 1)
    edges = np.clip(edges, 0, count - 1)
    return Cycles(edges, frequency, _typical_peak(motion.velocity, edges)) if len(edges) >= 2 else None


def _aperiodic(motion: Motion, repeated: float) -> Cycles:
    """Cycles between onsets of forward motion, or of motion where it never reverses."""
    edges, turns = _onsets(motion, 1.0), None
    if len(edges) >= 2:
        back = _onsets(motion, -1.0)  # one between each two forward
        turns = back[(back > edges[0]) & (back < edges[-1])]
    else:
        edges = _departures(motion)
    if len(edges) < 2:
        raise EstimateError(
            f"the motion of {len(motion.velocity) / motion.fs:.3g} s holds no complete cycle",
            "a cycle goes forward, back, and forward again, or rests, slips, and slips again",
            "give a longer record, or frequency= if it is known",
        )
    mean = mean_of_cycles("cycle", np.diff(edges) / motion.fs, unit="s", method="")
    longest, shortest = mean.interval[1], mean.interval[0]
    interval, sd = (1 / longest, 1 / shortest if shortest > 0 else math.inf), mean.sd / mean.value**2
    how, doubt = "cycles between onsets of motion", "the motion is not periodic"
    average = Estimate("cycle frequency", 1 / mean.value, interval, sd, "Hz", how, doubt, mean.checks)
    status = (
        f"the motion is not periodic ({100 * max(0.0, repeated):.0f} % of its variance repeats): "
        f"{len(edges) - 1} cycles from one onset of motion, at {definite_speed(motion):.3g} {motion.unit}/s, "
        "to the next"
    )
    return Cycles(edges, average, _typical_peak(motion.velocity, edges), status, turns)


def _repeated(cycles: Cycles, displacement: Array) -> float:
    """Share of the displacement's variance that is the same in every cycle."""
    folded = cycles.folded(displacement)
    if len(folded) < 2:  # all that can be told of one cycle is whether it closes
        ends = np.interp(cycles.edges, np.arange(len(displacement)), displacement)
        return 1 - float(abs(ends[1] - ends[0]) / np.ptp(folded))
    return 1 - float(np.mean(folded.var(axis=0, ddof=1))) / float(displacement.var())


def _onsets(motion: Motion, sign: float) -> Array:
    """Where motion to that side begins after motion to the other."""
    moving = np.flatnonzero(np.abs(motion.velocity) > definite_speed(motion))
    signs = sign * np.sign(motion.velocity[moving])
    return moving[1:][(signs[1:] > 0) & (signs[:-1] < 0)].astype(float)


def _departures(motion: Motion) -> Array:
    """Where motion begins after rest."""
    speed, definite = np.abs(motion.velocity), definite_speed(motion)
    state = np.flatnonzero((speed > definite) | (speed < definite * CREEP / TURNED))
    fast = speed[state] > definite
    return state[1:][fast[1:] & ~fast[:-1]].astype(float)


def definite_speed(motion: Motion) -> float:
    """Speed above which the contact moves without a doubt."""
    return max(TURNED * float(np.quantile(np.abs(motion.velocity), 0.99)), AUDIBLE * motion.noise)


def _typical_peak(velocity: Array, edges: Array) -> float:
    starts = np.ceil(edges).astype(int)
    return float(np.median(np.maximum.reduceat(np.abs(velocity[: starts[-1]]), starts[:-1])))


def driving(record: Record) -> str | None:
    """The channel of what moves the mass: of the base's motion z, or of a force on it; None where neither changes."""
    return next((name for name in DRIVES if name in record and np.ptp(record[name]) > 0), None)


def lacking(record: Record, question: str) -> StickslipError | None:
    """What a record lacks to have a twin, as an error; None where it lacks nothing."""
    stated = record.rig
    if stated is None or stated.mass is None or stated.stiffness is None or is_measured(record, "friction"):
        return EstimateError(
            "a friction without a balance of forces behind it",
            f"{question} needs the mass and the spring that moved",
            "state mass and stiffness",
        )
    try:
        record.require("x", "v", question=question)
        motion = contact_motion(record, contact=None, question=question)
    except StickslipError as error:
        return error
    if driving(record) is None:
        return EstimateError(
            "neither a motion z of the base nor an applied force",
            f"{question} is moved as the record was",
            "record what moves the mass",
        )
    if not len(_onsets(motion, 1.0)) and not len(_onsets(motion, -1.0)):
        return EstimateError(
            "a motion that never turns round",
            f"{question} can not tell its friction from a zero of x that is off",
            "take the answers as they are",
        )
    return None
