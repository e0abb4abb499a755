"""How late one motion sensor is against another, and what the second one's mount does."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import EstimateError
from stickslip.estimate import Doubt, Estimate, Result, Status
from stickslip.record.record import Record
from stickslip.signals.alignment import Alignment, Pair, align, likely_delays
from stickslip.signals.derivatives import convolved
from stickslip.signals.noise import noise_level, quantisation_step

QUESTION = "the delay between sensors"
ORDERS = {"x": 0, "z": 0, "theta": 0, "v": 1, "a": 2}  # of the derivative of a displacement that a channel is
METHODS = ("phase", "residual")
LEAST = 256  # samples
FINEST = 1e-9  # of a channel's range: noise that it has at least, or nothing could be weighed
SHIFTED = 0.05  # s: how far the second channel is shifted to find the least residual
NEEDED = 30.0  # by which a mount betters the misfit, if it is there; noise alone reaches 19 on a single line
REPEATS, HIDDEN = "the motion repeats itself", "a mount may hide in it"  # kinds of doubt
FIRM = 0.1  # relative standard deviation up to which a mount counts as found
CHANCE, FAINT = 3.0, 10.0  # deviations below zero that a damping may have, and above that a gain has
MASKED = 3.0  # times a delay's deviation that a free mount would add to it where a run does not tell the two apart
ALIKE = 2.0  # factor up to which two sensors may differ in size without being asked why
# Of 120 records without a filter, lines up to 0.4 of the rate led to a wrong sign in 2 and to no answer in 6: there
# displacements show what is folded of their own kinks. Up to 0.2 signs are right and deviations are the same.
FOLDED = 0.2  # of the sampling rate, up to which lines are used where jumps
UNRESOLVED = 0.25  # are unresolved by more than this share: no filter with 1/16 left at the sampling rate
UNEXPLAINED = 2.0  # power at the lines, over that of the noise, from which the model is doubted


@dataclass(frozen=True, eq=False, repr=False)
class SensorDelay(Result):
    """How late one sensor is against another.

    Attributes
    ----------
    delay : Estimate
        Time [s] by which the second channel comes after the first; negative where the first comes later.
    gain : Estimate
        Reading of the second over what the first makes of it; 1 where both are calibrated alike, below zero where one
        of them has the wrong sign.
    mount_frequency, mount_damping : Estimate or None
        Resonance [Hz] and damping ratio of the second sensor's mount; None where they can not be told.
    others : tuple of float
        Delays [s] that explain the record as well: it repeats itself.
    channels : tuple of str
        The first and the second.
    method : str
        "phase" or "residual".
    status : str
        "ok", or in words what to beware of.
    """

    delay: Estimate
    gain: Estimate
    mount_frequency: Estimate | None
    mount_damping: Estimate | None
    others: tuple[float, ...]
    channels: tuple[str, str]
    method: str
    status: str


def sensor_delay(
    record: Record | Sequence[Record], *, channels: tuple[str, str] = ("x", "a"), method: str = "phase"
) -> SensorDelay:
    r"""How much later is one motion sensor than another, and how does its mount ring?

    With "phase", both channels are taken for the same motion u in noise, the second behind a mount of
    frequency :math:`\omega_m` and damping :math:`\zeta`, with a gain g and a delay d:

    .. math:: y + \frac{2\zeta}{\omega_m} \dot y + \frac{\ddot y}{\omega_m^2} = g\,x^{(n)}(t - d)

    (thesis, section 2.3, where d is read from one phase, d = phi / w). The relation holds line by line in spectra
    whose windows, not samples, are differentiated and shifted
    (:func:`~stickslip.signals.response.derivative_spectra`), for ring-downs, forced runs and friction runs
    alike; g, d, w_m and zeta are those under which both channels are most likely with the motion unknown:

    .. math:: \sum_k |r_k|^2 / (\sigma_y^2 |Q_k|^2 + g^2 \omega_k^{2n} \sigma_x^2) \to \min

    with r the residual of the relation and Q its left side's factor (errors in variables; Pintelon and
    Schoukens, "System Identification", 2nd ed., section 9.11). So the noise favours no delay. Noise that is not white
    is rated by what is found between the lines. The standard deviation of one run is within 7 % of the Cramer-Rao
    bound. That of several runs together, some of them single tones, with the mount fitted, is too small: 0.4 of the
    error, so that the interval held in half of the trials. State the mount there, or give runs with friction.

    Of a jump that an accelerometer makes between two samples, as no filter before the sampling would let it, the
    samples do not tell the instant (:func:`~stickslip.balance.lag.unresolved_jumps`). It is put into the middle, and
    all that is fitted is as unsure as it moves with every jump half a sample sooner, as likely anywhere up to there.

    With "residual", the thesis's way, the second channel is shifted by interpolation until the balance of forces
    without friction is left with least: interpolation itself lowers noise, most of all half-way between samples, so
    that the answer is wrong by up to half a sample. It is kept for comparison, and its status says so.

    Parameters
    ----------
    record : Record or sequence of Record
        With both channels. Several records of the same sensors are answered together: runs at different frequencies
        tell a mount from a delay. Delays that are stated are not taken out first.
    channels : tuple of str
        Two of x, z, v, a, theta that follow the same motion; the second is the derivative of the first, or the same.
    method : {"phase", "residual"}
        How it is found.

    Returns
    -------
    SensorDelay
        State what it found, to have it used: ``record.with_details("x", delay=-found.delay.value)``, and likewise for
        every channel as late as x.

    Raises
    ------
    RecordError
        A channel is missing or not finite, the clock is broken, or the record is short.
    EstimateError
        Unknown channels or method, channels that are swapped, or no motion that both see above their noise.

    Examples
    --------
    >>> t, rng = np.arange(8000) / 2000, np.random.default_rng(1)
    >>> x = 1e-3 * np.sin(60 * (t - 1.26e-3)) + 1e-6 * rng.standard_normal(t.size)
    >>> a = -3.6 * np.sin(60 * t) + 0.04 * rng.standard_normal(t.size)
    >>> lag = sensor_delay(Record.of({"x": x, "a": a}, fs=2000.0))
    >>> round(lag.delay.value * 1e3, 2), round(lag.gain.value, 2)
    (-1.26, 1.0)
    """
    records = [record] if isinstance(record, Record) else list(record)
    order = _order(channels)
    if method not in METHODS:
        raise EstimateError(f"method = '{method}'", f"a delay is found by {' or '.join(METHODS)}", "choose one of them")
    if not records:
        raise EstimateError("no record", "a delay is found in one record or several", "pass a record")
    for source in records:
        source.require_clean(*channels, question=QUESTION, samples=LEAST)
    if method == "residual":
        if len(records) > 1:
            raise EstimateError(f"{len(records)} records", "the least residual is that of one", "pass them one by one")
        return _by_residual(records[0], channels)
    pairs, mount = [_pair(record, channels, order) for record in records], records[0].channels[channels[1]].mount
    jumps = [unresolved_jumps(pair.second) for pair in pairs] if channels[1] == "a" else []
    limited, sooner = _limited(pairs, jumps)
    alignment, free, others = _fit(limited, mount, sooner)
    gain, spread = alignment.theta[1], alignment.sd([0, 1, 0, 0])
    if abs(gain) < FAINT * spread:
        raise EstimateError(
            f"{channels[1]} does not follow {channels[0]} (gain {gain:.2g} -+ {spread:.2g})",
            f"{QUESTION} needs one motion that both see",
            "check whether the channels are named right",
        )
    if order and not _alike(alignment):
        swapped = [replace(pair, first=pair.second, second=pair.first, noise=pair.noise[::-1]) for pair in pairs]
        turned = _fit(swapped, None)
        if _alike(turned[0]):
            raise EstimateError(
                f"{channels[0]} follows {channels[1]} as {channels[1]} should follow {channels[0]}",
                "the channels are swapped",
                "name them the other way round when reading",
            )
    # A jump lies anywhere in its interval, and where may repeat itself: all that this strays by is at the lines then.
    strays = sum(float(np.sum(own.sizes**2)) / pair.noise[1] ** 2 for pair, own in zip(pairs, jumps, strict=False)) / 12
    most = UNEXPLAINED * max(1.0, strays / (2 * len(alignment.lines.turn)))
    return _answer(alignment, free, others, mount, channels, most=most)


def _limited(pairs: Sequence[Pair], jumps: Sequence[Jumps]) -> tuple[Sequence[Pair], Sequence[Pair]]:
    """The pairs with unresolved jumps of an acceleration band-limited, and with them half a sample sooner if any."""
    if not any(own.unresolved for own in jumps):
        return pairs, ()
    limited, sooner = (
        [
            replace(
                pair,
                second=band_limited(pair.second, own.sizes, part),
                highest=FOLDED if own.unresolved > UNRESOLVED else pair.highest,
            )
            for pair, own in zip(pairs, jumps, strict=True)
        ]
        for part in (0.0, 0.5)
    )
    return limited, sooner


def _fit(
    pairs: Sequence[Pair], mount: tuple[float, float] | None, sooner: Sequence[Pair] = ()
) -> tuple[Alignment, Alignment, list[Alignment]]:
    """The fit that the pairs support, the one whose mount is free, and those of other delays.

    `sooner` are the pairs where every unresolved jump comes half a sample sooner.
    """
    shortest, *others = likely_delays(pairs, mount)
    fixed, free = align(pairs, shortest.delay, mount=mount), align(pairs, shortest.delay, free=True)
    if sooner:
        fixed = fixed.unsure_by(align(sooner, fixed.delay, mount=mount))
        free = free.unsure_by(align(sooner, free.delay, free=True))
    return free if _is_firm(free, fixed) else fixed, free, others


def _alike(pair: Alignment) -> bool:
    """Whether both sensors give the same size to what they see."""
    return bool(1 / ALIKE < abs(pair.theta[1]) < ALIKE)


def _order(channels: tuple[str, str]) -> int:
    """Of the derivative of the first channel that the second one is."""
    first, second = channels
    orders = [ORDERS.get(name) for name in channels]
    if None in orders or first == second or (("theta" in channels) and set(channels) & {"x", "z", "v", "a"}):
        raise EstimateError(
            f"channels {first} and {second}",
            f"two of {', '.join(ORDERS)} that follow one motion are compared, theta with no length",
            'name both: channels=("x", "a")',
        )
    step = orders[1] - orders[0]  # type: ignore[operator]
    if step < 0:
        raise EstimateError(
            f"channels {first} and {second}",
            "the second is the derivative of the first, or the same",
            f'turn them round: channels=("{second}", "{first}")',
        )
    return step


def _pair(record: Record, channels: tuple[str, str], order: int) -> Pair:
    first, second = (_restored(record, name) for name in channels)
    ranges = [float(np.ptp(values)) for values in (first, second)]
    if not all(ranges):
        raise EstimateError(
            f"a channel of {' and '.join(channels)} does not change", f"{QUESTION} needs a motion", "check the sensors"
        )
    noises = [record.channels[name].noise or noise_level(record[name], record.fs) for name in channels]
    low, high = (max(noise, FINEST * size) for noise, size in zip(noises, ranges, strict=True))
    return Pair(first, second, record.fs, (low, high), order)


def _restored(record: Record, name: str) -> Array:
    """A channel about its mean, with what leaked away put back."""
    values = record[name] - np.mean(record[name])
    constant = record.channels[name].discharge
    if constant is None:
        return values
    leaked = (np.cumsum(values) - values / 2) / (record.fs * constant)
    return np.asarray(values + leaked - np.mean(leaked))


def _is_firm(free: Alignment, fixed: Alignment) -> bool:
    """Whether the record tells the mount."""
    gain, damped, squared = free.theta[1:]
    wide, steps = CHANCE * free.sd([0, 0, 1, 0]), np.diff(free.lines.turn)
    narrowest = 2 * squared * float(np.min(steps[steps > 0], initial=math.inf))  # else a disturbance of one line
    damps = damped > -wide and damped + wide > narrowest
    moves = abs(gain) > FAINT * free.sd([0, 1, 0, 0])  # else what rings is not what moves
    better = (fixed.misfit - free.misfit) / free.widening
    return bool(squared > 0 and damps and moves and free.sd([0, 0, 0, 1]) < 2 * FIRM * squared and better > NEEDED)


def _answer(
    alignment: Alignment,
    free: Alignment,
    others: Sequence[Alignment],
    mount: tuple[float, float] | None,
    channels: tuple[str, str],
    *,
    most: float,
) -> SensorDelay:
    """What the fit supports; `free` is the one whose mount is free, and `most` what it may leave of the noise."""
    (first, second), method, fitted = channels, "phase of all lines that both channels show", alignment is free
    gain = alignment.theta[1]
    alike = [other.delay for other in others if gain < 0 or other.theta[1] > 0]
    hidden = (
        second == "a" and not fitted and mount is None and free.sd([1, 0, 0, 0]) > MASKED * alignment.sd([1, 0, 0, 0])
    )
    status = _status(alignment, alike, channels, hidden=hidden, unlike=alignment.unexplained > most)
    low, high = alignment.lines.turn.min() / (2 * math.pi), alignment.lines.turn.max() / (2 * math.pi)
    stated = f"held at {mount[0]:g} Hz and {mount[1]:g}, as stated" if mount else "taken to be rigid"
    moved = abs(float(alignment.moved[0]))
    checks = (
        *([f"jumps that {second} makes between two samples may move it by {moved:.2g} s"] if moved else []),
        f"{len(alignment.lines.turn)} lines of {low:.3g} to {high:.3g} Hz; mount {'fitted' if fitted else stated}",
        f"the residual at the lines has {alignment.unexplained:.2f} times the power of the noise between them",
    )

    def estimate(name: str, value: float, slope: Sequence[float], unit: str, status: str = "ok") -> Estimate:
        sd = alignment.sd(slope)
        return Estimate.normal(name, value, sd=sd, unit=unit, method=method, status=status, checks=checks)

    frequency = damping = None
    if fitted:
        damped, root = alignment.theta[2], math.sqrt(alignment.theta[3])
        name, slope = f"mount of {second}", [0, 0, 1 / (2 * root), -damped / (4 * root**3)]
        frequency = estimate(
            f"{name}, frequency", 1 / (2 * math.pi * root), [0, 0, 0, 1 / (4 * math.pi * root**3)], "Hz"
        )
        damping = estimate(f"{name}, damping ratio", damped / (2 * root), slope, "1").within(0.0)
    delay = estimate(f"delay of {second} behind {first}", alignment.delay, [1, 0, 0, 0], "s", status)
    gained = estimate(f"gain of {second} over {first}", gain, [0, 1, 0, 0], "1")
    return SensorDelay(delay, gained, frequency, damping, tuple(alike), channels, "phase", status)


def _status(pair: Alignment, others: Sequence[float], channels: tuple[str, str], *, hidden: bool, unlike: bool) -> str:
    (first, second), gain = channels, pair.theta[1]
    doubts: list[Doubt | str] = []
    if gain < 0:
        doubts.append(f"{first} or {second} has the wrong sign: the gain is {gain:.3g}")
    if not _alike(pair):
        doubts.append(
            f"{second} is {abs(gain):.3g} times what {first} makes of it: see the units and the sensitivities"
        )
    if others:
        delays = " or ".join(f"{1e3 * delay:.3g}" for delay in others[:2])
        sentence = f"what they share repeats itself: {delays} ms would explain it as well; the shortest is taken"
        doubts.append(Doubt(sentence, REPEATS))
    if hidden:
        sentence = (
            f"what a mount of {second} delays, by twice its damping ratio over its angular frequency, is in it: this "
            "motion does not tell them apart; state the mount, or give runs at other frequencies too"
        )
        doubts.append(Doubt(sentence, HIDDEN))
    if unlike:
        doubts.append(
            f"{first} and {second} differ by more than noise, a delay and a mount ({pair.unexplained:.3g} times the "
            "power of the noise); the intervals are widened"
        )
    return Status(*doubts)


def _by_residual(record: Record, channels: tuple[str, str]) -> SensorDelay:
    """Thesis, section 2.3: shift the second until k z - k x - m a is least, of one record without friction."""
    from scipy.optimize import minimize_scalar

    minimise: Any = minimize_scalar
    names = [channels[0], *({"z"} & set(record) - set(channels))]
    columns = np.column_stack([*(record[name] for name in names), np.ones(len(record))])
    room = max(2, min(round(SHIFTED * record.fs), len(record) // 8))
    rows = np.arange(room, len(record) - room, dtype=float)
    basis, _ = np.linalg.qr(columns[room : len(record) - room])

    def left(delay: float) -> float:
        shifted = np.interp(rows + delay * record.fs, np.arange(len(record)), record[channels[1]])
        return float(np.sum((shifted - basis @ (basis.T @ shifted)) ** 2))

    start = min((lag / record.fs for lag in range(1 - room, room)), key=left)
    delay = float(minimise(left, bounds=(start - 1 / record.fs, start + 1 / record.fs), method="bounded").x)
    half = 0.5 / record.fs
    status = (
        "interpolation lowers the noise most half-way between samples, so that the least residual is wrong by up to "
        f"half a sample, {half:.3g} s; in a run with friction it is the friction: use the phase"
    )
    method = "least residual of the balance without friction"
    name, interval = f"delay of {channels[1]} behind {channels[0]}", (delay - half, delay + half)
    of_delay = Estimate(name, delay, interval, half, "s", method, status)
    name, none = f"gain of {channels[1]} over {channels[0]}", math.nan
    of_gain = Estimate(name, none, (none, none), none, "1", method, "not found this way")
    return SensorDelay(of_delay, of_gain, None, None, (), channels, "residual", status)


# Jumps that lie between two samples, as of an acceleration that no filter smoothed before it was sampled.
CLEAR = 4.0  # standard deviations of noise alone from which a change counts as a jump
NOISE = 1.8  # of a change less the mean of the four around it, over that of a sample: sqrt(2 (1 + 1/4)^2 + 2/4^2)
BESIDE = 4  # samples on each side of a jump in which its highest frequencies are looked for
REACH = 32  # samples on each side over which a band-limited step swings
NORMAL = 1.4826  # standard deviations of a normal distribution in its median distance from zero


class Jumps(NamedTuple):
    """Jumps between samples.

    Attributes
    ----------
    sizes : ndarray (n - 1,)
        Between each sample and the next, as far as sampling did not resolve it; zero nearly everywhere.
    unresolved : float
        Share of all jumps that sampling did not resolve; zero where there are none.
    """

    sizes: Array
    unresolved: float


def unresolved_jumps(values: Array) -> Jumps:
    r"""How much the values jump between each sample and the next, as far as sampling did not resolve it.

    A jump is a change that stands out of those around it. Its changes :math:`D_k` have at half the sampling rate, by
    a window :math:`w_k` that keeps slower motion out,

    .. math:: \rho = \sum_k (-1)^k w_k D_k / \sum_k D_k

    of what they have at zero: all of it where the jump lies between two samples, 0.13 where a filter without phase at
    0.4 of the rate was before the sampling, 0.03 behind Butterworth's of eighth order at 0.3 of it. A filter falls
    from half the rate on at least as it fell up to there, and what is folded back to zero stood at the whole rate:
    :math:`\rho^2` is the share of all jumps that is taken for unresolved.

    Parameters
    ----------
    values : ndarray (n,)
        Samples, n >= 16; counts of a digitiser are no jumps.

    Returns
    -------
    Jumps

    Examples
    --------
    >>> n = np.arange(100)
    >>> jumps = unresolved_jumps(n // 50 + 0.2 * np.sin(n / 10))
    >>> np.flatnonzero(jumps.sizes).tolist(), round(float(jumps.sizes.max()), 2), round(jumps.unresolved, 2)
    ([49], 0.96, 0.95)
    """
    changes = np.diff(values)
    above = changes - np.convolve(changes, [0.25, 0.25, 0.0, 0.25, 0.25], mode="same")
    height = np.abs(above)
    height[:BESIDE] = height[-BESIDE:] = 0.0
    level = CLEAR * max(NOISE * quantisation_step(values) / math.sqrt(12), NORMAL * float(np.median(height)))
    highest = np.lib.stride_tricks.sliding_window_view(np.pad(height, BESIDE), 2 * BESIDE + 1).max(axis=1)
    at = np.flatnonzero((height > level) & (height == highest))
    jumps, share = np.zeros_like(changes), 0.0
    if len(at):
        beside = np.arange(-BESIDE, BESIDE + 1)
        swing = np.cos(math.pi * beside) * np.hanning(2 * BESIDE + 3)[1:-1]
        around = changes[at[:, None] + beside]
        sizes, weights = around[:, np.abs(beside) <= 2].sum(axis=1), above[at]
        share = float(np.clip(weights @ (around @ swing) / max(weights @ sizes, weights @ weights), 0.0, 1.0)) ** 2
        jumps[at] = share * weights
    return Jumps(jumps, share)


def band_limited(values: Array, jumps: Array, sooner: float = 0.0) -> Array:
    """The values as a filter up to half the sampling rate would have left them about these jumps.

    Where in its interval a jump lies is not known: it is put into the middle.

    Parameters
    ----------
    values : ndarray (n,)
        Samples.
    jumps : ndarray (n - 1,)
        Between each sample and the next.
    sooner : float
        Part of an interval by which every jump is put before the middle.

    Returns
    -------
    ndarray (n,)

    Examples
    --------
    >>> values = np.arange(100) // 50 * 1.0
    >>> band_limited(values, np.diff(values))[48:52].round(2).tolist()
    [-0.01, 0.06, 0.94, 1.01]
    """
    if not jumps.any():
        return values
    from scipy.special import sici

    times = np.arange(1 - REACH, REACH + 1) - 0.5
    step = 0.5 + sici(math.pi * (times + sooner))[0] / math.pi
    swing = (step - (times > 0)) * np.cos(math.pi * times / (2 * REACH)) ** 2
    return np.asarray(values + convolved(jumps, swing)[REACH - 1 : REACH - 1 + len(values)])
