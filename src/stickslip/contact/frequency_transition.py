"""How a contact rings while the mass sticks: frequency, damping, amplitude, and the contact's stiffness."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from stickslip.arrays import Array
from stickslip.contact.ringing import Ringing, Window, checked_mass, find_ringing, not_one_mode
from stickslip.errors import EstimateError
from stickslip.estimate import Constant, Estimate, Result, Status
from stickslip.record.record import Record
from stickslip.signals.morlet import ridge_centre
from stickslip.signals.wavelet import CENTRE, wavelet_map
from stickslip.statistics import correlation_time, least_squares, mean_of_cycles, student

QUESTION = "the transition"
AFTER, BEFORE = 0.09, 0.03  # of a cycle at the ends of a ring that are not trusted: where it begins is less sure
LEAST_RING = 0.2  # of a cycle that must be left
FAINT = 0.05  # of the acceleration's range: rings that are smaller are none
AUDIBLE = 5.0  # standard deviations of a ring's amplitude that it must have
OCTAVE = 1.6  # the wavelet's local maximum is looked for within this factor of the mode's frequency


@dataclass(frozen=True, eq=False, repr=False)
class StickTransition(Result):
    """How the contact rings in one stick.

    Attributes
    ----------
    time, duration : float
        When the stick begins and how long it lasts [s].
    frequency, damping, amplitude : Estimate
        Damped frequency [Hz], damping ratio, and the amplitude at which the first ring begins.
    wavelet_frequency : float
        Where the wavelet map has its local maximum [Hz]; NaN where it has none.
    rings : int
        Stretches of ringing, with a micro-slip between each two.
    """

    time: float
    duration: float
    frequency: Estimate
    damping: Estimate
    amplitude: Estimate
    wavelet_frequency: float
    rings: int


@dataclass(frozen=True, eq=False, repr=False)
class Transition(Result):
    """How a contact rings while the mass sticks.

    Attributes
    ----------
    frequency : Estimate
        Damped frequency of the mode [Hz], from the rings of all sticks together.
    damping : Estimate
        Damping ratio.
    amplitude : Estimate
        At which the first ring of a stick begins, mean of the sticks.
    wavelet_frequency : Estimate
        Where the wavelet map has its local maximum [Hz], mean of the sticks.
    agreement : str
        Whether both frequencies agree, in words.
    stiffness : Estimate or None
        Of the contact [N/m], implied by the frequency: ``K = m |p|^2 - k``.
    loop_stiffness : Estimate or None
        Of the contact [N/m], from friction against displacement within the same rings.
    sticks : tuple of StickTransition
        Stick by stick.
    status : str
        "ok", or in words what to beware of.
    """

    frequency: Estimate
    damping: Estimate
    amplitude: Estimate
    wavelet_frequency: Estimate
    agreement: str
    stiffness: Estimate | None
    loop_stiffness: Estimate | None
    sticks: tuple[StickTransition, ...]
    status: str


def transition(
    record: Record, *, channel: str = "a", mass: Constant | None = None, stiffness: Constant | None = None
) -> Transition:
    """At which frequency does the contact ring while the mass sticks, how is it damped, how stiff is the contact?

    A compliant contact that sticks rings with the mass, ``a = Re c exp(p t)`` about zero (thesis chapters 4 and 5),
    until the friction limit is reached and it slips by a little. Each stick is cut into rings and glides by dynamic
    programming; one mode p is fitted to the rings of all sticks together by least squares, each ring with its own
    amplitude and phase, each stick with its own response to the drive, at the drive's frequency. A single spectrum, or
    a wavelet, of the whole stick reads 2 to 10 % low where micro-slips interrupt the ringing.

    The frequency is ``Im p / 2 pi``, the damping ratio ``-Re p / |p|``, and the contact's stiffness
    ``K = m |p|^2 - k`` for a mass m on a spring k.

    Parameters
    ----------
    record : Record
        With an acceleration; sticks are taken from ``x`` or ``v`` where the record has them, else from the
        acceleration's integral.
    channel : str
        The acceleration.
    mass : float, str, tuple or Estimate, optional
        Oscillating mass [kg], for the contact's stiffness.
    stiffness : float, str, tuple or Estimate, optional
        Spring [N/m], for the same.

    Returns
    -------
    Transition

    Raises
    ------
    EstimateError
        "no transition": no stick, or no ringing in the sticks.
    RecordError
        A channel that is missing or not finite, a broken clock.

    Examples
    --------
    >>> import stickslip as ss
    >>> case = ss.scenarios.get("THESIS compliant 2.5Hz fk=1.1 Ky=192000 z.0174(k+Ky)")
    >>> record = ss.simulate(case.system, cycles=8).record(fs=4000).between(1.0, 3.2)
    >>> change = transition(record, mass=2.42, stiffness=2310)
    >>> round(change.frequency.value, 1), round(change.damping.value, 3), round(change.stiffness.value / 1000)
    (45.1, 0.017, 192)
    """
    ringing = find_ringing(record, channel, question=QUESTION, mass=mass, stiffness=stiffness)
    return transition_of(ringing, mass, stiffness)


def transition_of(ringing: Ringing, mass: Constant | None, stiffness: Constant | None) -> Transition:
    """The transition of sticks that are cut into pieces already."""
    record, channel = ringing.record, ringing.channel
    pooled = heard_mode(ringing)
    sticks = _stick_by_stick(record, channel, ringing, pooled)
    unit = record.channels[channel].unit
    frequency, damping = pooled.possible(ringing.fs)
    wavelet = _by_wavelet([stick.wavelet_frequency for stick in sticks])
    sizes = [stick.amplitude.value for stick in sticks]
    method = "of the first ring of each stick, at its begin; mean of sticks"
    amplitude = mean_of_cycles("transition amplitude", sizes, unit=unit, method=method)

    doubt = ringing.doubt or not_one_mode(ringing)

    def doubted(estimate: Estimate) -> Estimate:
        return replace(estimate, status=doubt) if doubt else estimate

    contact, loop = _stiffness(pooled, mass, stiffness), _loop_stiffness(record, ringing, pooled)
    return Transition(
        frequency=doubted(frequency),
        damping=doubted(damping),
        amplitude=doubted(amplitude),
        wavelet_frequency=doubted(wavelet),
        agreement=_agreement(frequency, wavelet),
        stiffness=doubted(contact) if contact is not None else None,
        loop_stiffness=doubted(loop) if loop is not None else None,
        sticks=sticks,
        status=_status(ringing, pooled, doubt),
    )


def heard_mode(ringing: Ringing) -> Mode:
    """The mode in which the sticks ring, where there is one that is heard."""
    pooled = _fitted(ringing.windows, ringing)
    if pooled is None:
        raise _none("the sticks hold no stretch of ringing", "ringing lasts a third of a cycle at least")
    loud = float(np.median([_amplitude(window, pooled, ringing)[0] for window in pooled.windows]))
    spread = float(np.median([np.ptp(window.values) for window in ringing.windows]))
    if loud < max(FAINT * spread, AUDIBLE * pooled.noise):
        raise _none(
            f"the sticks are quiet: {loud:.3g} m/s^2 where the acceleration changes by {spread:.3g}",
            f"a ring is {100 * FAINT:.0f} % of that change at least, and five times the noise, {pooled.noise:.3g}",
        )
    return pooled


@dataclass(frozen=True, eq=False)
class Mode:
    """One mode fitted to the rings of some windows."""

    pole: complex
    frequency: Estimate
    damping: Estimate
    noise: float
    windows: tuple[Window, ...]
    correlation: float

    def possible(self, fs: float) -> tuple[Estimate, Estimate]:
        """Frequency and damping as far as a sampled ring that dies away can have them."""
        return self.frequency.within(0.0, fs / 2), self.damping.within(0.0, 1.0)


def _none(value: str, rule: str) -> EstimateError:
    return EstimateError(
        f"no transition: {value}", rule, "the mechanism tells what the sticks are like; or take a quieter record"
    )


def _stretches(window: Window, pole: complex, fs: float) -> list[slice]:
    """The rows of a window that ring for sure."""
    cycle = 2 * math.pi / pole.imag * fs
    after, before = AFTER * cycle, BEFORE * cycle
    inner = [slice(math.ceil(piece.first + after), math.floor(piece.last - before)) for piece in window.rings]
    return [rows for rows in inner if rows.stop - rows.start >= max(8, LEAST_RING * cycle)]


def _design(window: Window, rows: list[slice], pole: complex, ringing: Ringing) -> tuple[Array, Array]:
    """Columns: cosine and sine of each ring, and of the drive, which moves the mass a little even while it sticks."""
    total = sum(part.stop - part.start for part in rows)
    design, at = np.zeros((total, 2 * len(rows) + 2)), 0
    turn = 2 * math.pi * max(ringing.sticks.frequency.value, 0.0) / ringing.fs
    for number, part in enumerate(rows):
        count = part.stop - part.start
        wave = np.exp(pole * np.arange(count) / ringing.fs)
        design[at : at + count, 2 * number] = wave.real
        design[at : at + count, 2 * number + 1] = wave.imag
        place = np.arange(part.start, part.stop) - len(window.values) / 2
        design[at : at + count, -2] = np.cos(turn * place)
        design[at : at + count, -1] = np.sinc(turn * place / np.pi) * place / len(window.values)
        at += count
    return design, np.concatenate([window.values[part] for part in rows])


def _fitted(windows: tuple[Window, ...], ringing: Ringing) -> Mode | None:
    """The mode of the windows' rings by least squares; amplitudes are eliminated (variable projection)."""
    from scipy.optimize import least_squares as nonlinear

    used = [(window, rows) for window in windows if (rows := _stretches(window, ringing.pole, ringing.fs))]
    if not used:
        return None

    def left(parameters: Array) -> Array:
        rests = []
        for window, rows in used:
            design, data = _design(window, rows, complex(*parameters), ringing)
            q, _ = np.linalg.qr(design)
            rests.append(data - q @ (q.T @ data))
        return np.concatenate(rests)

    start, scale = [ringing.pole.real, ringing.pole.imag], abs(ringing.pole)
    fit = nonlinear(left, start, x_scale=[scale, scale], jac="3-point", method="lm", max_nfev=60)
    pole, slopes, rings = complex(*fit.x), np.asarray(fit.jac), sum(len(rows) for _, rows in used)
    free, normal = len(fit.fun) - sum(2 * len(rows) + 2 for _, rows in used) - 2, slopes.T @ slopes
    definite = free >= 4 and np.isfinite(normal).all() and np.linalg.cond(normal) <= 1e12
    if not definite or pole.imag <= 0 or abs(pole - ringing.pole) >= 0.5 * scale:
        return None
    variance, tau = float(fit.fun @ fit.fun) / free, max(1.0, float(correlation_time(fit.fun)))
    spread, quantile = np.linalg.inv(normal) * variance * tau, student(free / tau)
    slope = np.array([-(pole.imag**2), pole.real * pole.imag]) / abs(pole) ** 3  # of the damping ratio
    method = f"one decaying mode, least squares over {rings} rings"
    checks = (f"{len(used)} sticks",)
    hertz, sd = pole.imag / (2 * math.pi), math.sqrt(spread[1, 1]) / (2 * math.pi)
    name = "transition frequency"
    frequency = Estimate.normal(name, hertz, sd=sd, unit="Hz", method=method, quantile=quantile, checks=checks)
    ratio, sd = -pole.real / abs(pole), math.sqrt(float(slope @ spread @ slope))
    damping = Estimate.normal("transition damping ratio", ratio, sd=sd, unit="1", method=method, quantile=quantile)
    return Mode(pole, frequency, damping, math.sqrt(variance), tuple(window for window, _ in used), tau)


def _amplitude(window: Window, mode: Mode, ringing: Ringing) -> tuple[float, float]:
    """Amplitude at which the window's first ring begins, and its standard deviation."""
    rows = _stretches(window, ringing.pole, ringing.fs)
    design, data = _design(window, rows, mode.pole, ringing)
    fit = np.linalg.lstsq(design, data, rcond=None)[0]
    early = rows[0].start - next(piece.first for piece in window.rings if piece.first <= rows[0].start < piece.last)
    growth = math.exp(-mode.pole.real * early / ringing.fs)
    inverse = np.linalg.pinv(design.T @ design)[:2, :2] * mode.noise**2 * mode.correlation
    size = math.hypot(*fit[:2])
    along = fit[:2] / size if size else np.array([1.0, 0.0])
    return size * growth, math.sqrt(float(along @ inverse @ along)) * growth


def _stick_by_stick(record: Record, channel: str, ringing: Ringing, pooled: Mode) -> tuple[StickTransition, ...]:
    rings, events = [], [event for event in ringing.sticks.events if event.kind == "stick" and event.whole]
    peaks = _local_maxima(record, channel, ringing, pooled)
    for window, peak in zip(pooled.windows, peaks, strict=True):
        own = _fitted((window,), ringing)
        begin, middle = window.rings[0].first, ringing.time(window, len(window.values) / 2)
        event = min(events, key=lambda event: abs(event.time + event.duration / 2 - middle))
        size, sd = _amplitude(window, pooled, ringing)
        frequency, damping = own.possible(ringing.fs) if own is not None else _untold_alone(pooled)
        rings.append(
            StickTransition(
                time=ringing.time(window, begin),
                duration=event.duration,
                frequency=frequency,
                damping=damping,
                amplitude=Estimate.normal(
                    "transition amplitude",
                    size,
                    sd=sd,
                    unit=record.channels[channel].unit,
                    method="of the first ring, at its begin",
                ),
                wavelet_frequency=peak,
                rings=len(window.rings),
            )
        )
    return tuple(rings)


def _untold_alone(pooled: Mode) -> tuple[Estimate, ...]:
    """Frequency and damping of all sticks, for one that does not tell them by itself."""
    return tuple(
        estimate.unknown("this stick alone does not tell it") for estimate in (pooled.frequency, pooled.damping)
    )


def _local_maxima(record: Record, channel: str, ringing: Ringing, pooled: Mode) -> list[float]:
    """Frequency [Hz] of the largest local maximum of the wavelet map within each stick, near the mode's."""
    centre = pooled.frequency.value
    wanted = centre * np.geomspace(1 / OCTAVE, min(OCTAVE, 0.45 * ringing.fs / centre), 61)
    reach = math.ceil(7 * ridge_centre(CENTRE, "energy") / (2 * math.pi * wanted[0]) * ringing.fs)
    maxima = []
    for window in pooled.windows:
        first, last = max(0, window.first - reach), min(len(record), window.first + len(window.values) + reach)
        part = record.rows(first, last)
        moduli = np.abs(wavelet_map(part, channel, frequencies=wanted, precision="single").values)
        inside = moduli[:, window.first - first : window.first - first + len(window.values)]
        ridge = inside.max(axis=1)
        peak = int(ridge[1:-1].argmax()) + 1
        low, middle, high = np.log(np.maximum(ridge[peak - 1 : peak + 2], 1e-300)).tolist()
        bend = low - 2 * middle + high
        higher = bend < 0 and middle >= max(low, high)
        refined = float(wanted[peak] * (wanted[1] / wanted[0]) ** (0.5 * (low - high) / bend)) if higher else math.nan
        maxima.append(refined)
    return maxima


def _by_wavelet(peaks: list[float]) -> Estimate:
    """Mean of the sticks' local maxima; without a number where the map has none."""
    name, method = "transition frequency by wavelet", "local maximum of the Morlet map in each stick, mean of sticks"
    if np.isfinite(peaks).any():
        return mean_of_cycles(name, peaks, unit="Hz", method=method)
    nothing = Estimate(name, math.nan, (math.nan, math.nan), math.nan, "Hz", method)
    return nothing.unknown("the map has no local maximum in any stick")


def _agreement(frequency: Estimate, wavelet: Estimate) -> str:
    """In words: whether the wavelet's frequency is the mode's as nearly as a wavelet can tell."""
    apart = wavelet.value / frequency.value - 1
    if not math.isfinite(apart):
        return "the wavelet map has no local maximum near it"
    if frequency.interval[0] <= wavelet.value <= frequency.interval[1]:
        return f"the mode and the wavelet agree: the wavelet reads {wavelet.value:.4g} Hz, within the interval"
    width = math.sqrt(math.log(2)) * 2 / ridge_centre(CENTRE, "energy")  # half of the bandwidth at half power
    side = "lower" if apart < 0 else "higher"
    why = "less than its bandwidth resolves" if abs(apart) < width / 2 else "more than its bandwidth explains"
    reads = f"the wavelet reads {wavelet.value:.4g} Hz, {100 * abs(apart):.1f} % {side}"
    return f"the mode and the wavelet differ: {reads}, {why}"


def _stiffness(mode: Mode, mass: Constant | None, spring: Constant | None) -> Estimate | None:
    kilograms, k = checked_mass(mass, spring)
    if kilograms is None:
        return None
    square = abs(mode.pole) ** 2
    # |p|^2 = w^2 / (1 - z^2): the frequency carries nearly all of its uncertainty
    z, sd_z = mode.damping.value, mode.damping.sd
    relative = math.hypot(2 * mode.frequency.sd / mode.frequency.value, 2 * z / (1 - z**2) * sd_z)
    quantile = (mode.frequency.interval[1] - mode.frequency.value) / mode.frequency.sd
    status = "ok" if spring is not None else "the spring's own stiffness is part of it"
    return Estimate.normal(
        "contact stiffness by frequency",
        kilograms * square - k,
        sd=kilograms * square * relative,
        unit="N/m",
        method="K = m |p|^2 - k",
        quantile=quantile,
        status=status,
    ).within(0.0, otherwise="it rings slower than on its spring alone: mass= or stiffness= is wrong")


def _loop_stiffness(record: Record, ringing: Ringing, mode: Mode) -> Estimate | None:
    """Slope of friction against displacement in the rings, beside a term in the velocity and a level for each ring."""
    if "friction" not in record or "x" not in record or record.channels["friction"].unit != "N":
        return None
    x, friction = record["x"], record["friction"]
    if not (np.isfinite(x).all() and np.isfinite(friction).all()):
        return None
    velocity = record["v"] if "v" in record else np.gradient(x) * record.fs
    parts, force = [], []
    for window in mode.windows:
        for rows in _stretches(window, ringing.pole, ringing.fs):
            at = slice(window.first + rows.start, window.first + rows.stop)
            parts.append(np.column_stack([x[at] - x[at].mean(), velocity[at] - velocity[at].mean()]))
            force.append(friction[at] - friction[at].mean())
    design = np.vstack(parts)
    if np.linalg.cond(design / np.linalg.norm(design, axis=0)) > 100:
        return None
    line = least_squares(design, np.concatenate(force))
    return line.estimate(0, "contact stiffness by loops", "N/m", "friction on x and v in the rings").within(0.0)


def _status(ringing: Ringing, pooled: Mode, doubt: str) -> str:
    doubts = [doubt, ringing.sticks.status]
    silent = len(ringing.windows) - len(pooled.windows)
    if silent:
        doubts.append(f"{silent} of {len(ringing.windows)} sticks hold no ringing long enough")
    return Status(*doubts)
