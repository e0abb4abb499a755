"""A hammer tap: which resonances does it excite, and which sensor shows them?"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from stickslip.arrays import Array, Complex
from stickslip.balance.balance import known_constants
from stickslip.balance.mounts import ACCELEROMETER, CELL, Resonance
from stickslip.errors import EstimateError
from stickslip.estimate import Constant, Doubt, Estimate, Plain, Result, Status
from stickslip.record.record import Record
from stickslip.signals.interpolate import without_delays
from stickslip.signals.noise import noise_along

QUESTION = "the impact test"
COUPLED = "coupled contact"
SENSED = ("a", "load")
LONGEST = 900  # samples of the ringing that are looked at
SEARCHED = 400  # of them, for the first guess
LEAST = 40
LOUD = 20.0  # standard deviations of its noise that the ringing must reach
STANDS_OUT = 1.6  # times the largest singular value of noise
AUDIBLE = 5.0  # standard deviations of its amplitude that a mode has in a channel that shows it
ALIKE = 2.0  # factor within which acceleration and force of the coupled contact belong to one mass
GROWN = 30.0  # powers of e to which a pole that the search tries may grow: beyond, no number can be fitted
MISFIT = 1.5  # root mean square of what is left over, in standard deviations of the noise
# Of a channel's largest reading after the tap: how far it may move before, and how far from there its middle lie then.
# Of 16 rigs on the bench at 1 to 10 kHz taps had 0.04 at most; driven, swept, let go, and loaded by weights 0.5.
STILL = 0.3


@dataclass(frozen=True, eq=False, repr=False)
class ImpactTest(Result, Plain):
    """What rings after a tap.

    Attributes
    ----------
    resonances : tuple of Resonance
        From low to high frequencies.
    time : float
        From when on [s] the ringing was fitted.
    duration : float
        How long [s].
    residual : float
        Root mean square of what is left over, in standard deviations of the channels' noise.
    status : str
        "ok", or in words what to beware of.
    """

    resonances: tuple[Resonance, ...]
    time: float
    duration: float
    residual: float
    status: str

    @property
    def estimates(self) -> tuple[Estimate, ...]:
        """Frequency and damping of each."""
        return tuple(number for resonance in self.resonances for number in (resonance.frequency, resonance.damping))


def impact_test(record: Record, *, mass: Constant | None = None, tapped: bool = True) -> ImpactTest:
    r"""Which resonances does a hammer tap excite, and which sensor shows them?

    The thesis's section 2.5: the base held, the contact engaged, a tap on the mass. After it every channel is a sum
    of the same decaying oscillations, :math:`\sum_j \mathrm{Re}\, c_j e^{p_j t}`, and a straight line; the poles come
    from the matrix pencil (Hua and Sarkar 1990) of all channels together and are refined by least squares, with
    intervals.

    A mode that both sensors show, the force as large against the acceleration as the mass says and opposed to it, is
    the contact's, coupled with the mass; one that only the accelerometer shows, or shows larger than that, is its
    mount, and one that the load cell shows is the cell's. Of several of a kind the largest bears its name.

    Parameters
    ----------
    record : Record
        With ``a`` or ``load``, better both, and one tap.
    mass : float, str, tuple or Estimate, optional
        Moving mass [kg]; as :func:`~stickslip.friction_force` was told, if it was. Without it, the lowest mode that
        both show is taken for the contact's.
    tapped : bool
        Whether the record is one of a tap; else it is taken apart from its loudest reading on, whatever came before.

    Returns
    -------
    ImpactTest

    Raises
    ------
    RecordError
        Neither channel, or a broken one.
    EstimateError
        No tap: nothing rings, or it moves before as it does after.

    Examples
    --------
    >>> t = np.arange(4000) / 4000 - 0.2
    >>> def ring(frequency, damping):
    ...     w = 2 * np.pi * frequency
    ...     return np.where(t > 0, np.exp(-damping * w * t) * np.sin(w * np.sqrt(1 - damping**2) * t), 0.0)
    >>> noise = np.random.default_rng(1).standard_normal((2, t.size))
    >>> a = ring(47.0, 0.02) + 0.5 * ring(125.0, 0.1) + 1e-3 * noise[0]
    >>> load = -2.42 * ring(47.0, 0.02) + 0.2 * ring(250.0, 0.05) + 1e-3 * noise[1]
    >>> mount = impact_test(Record.of({"a": a, "load": load}, fs=4000), mass=2.42)
    >>> [(each.name, round(each.frequency.value)) for each in mount.resonances]
    [('coupled contact', 47), ('mount of the accelerometer', 125), ('mount of the load cell', 250)]
    """
    channels = [name for name in SENSED if name in record]
    record.require_clean(*(channels or SENSED), question=QUESTION, samples=2 * LEAST)
    record = without_delays(record, *channels, question=QUESTION)
    known = known_constants(record, mass=mass).get("mass")
    ringing = _ringing(record, channels)
    modes, residual = _modes(ringing)
    doubts = _blow(record, ringing, math.ceil(record.fs / modes[0].frequency)) if tapped else []
    slips = f"what rings is no sum of decaying oscillations: {residual:.2g} times the noise is left over (slips?)"
    status = Status(*doubts, *[Doubt(slips, "slips")] * (residual > MISFIT))
    named = _named(modes, channels, known, status)
    begin, lasts = record.start + ringing.first / record.fs, len(ringing.values) / record.fs
    return ImpactTest(tuple(named), begin, lasts, residual, status)


@dataclass(frozen=True, eq=False)
class _Ringing:
    """What was read after the tap, each channel in standard deviations of its noise."""

    values: Array
    noise: Array
    first: int
    fs: float


def _ringing(record: Record, channels: Sequence[str]) -> _Ringing:
    values = np.column_stack([record[name] for name in channels])
    noise = np.array([np.median(noise_along(record[n], record.fs, record.channels[n].noise)) for n in channels])
    noise = np.maximum(noise, 1e-9 * np.ptp(values, axis=0))
    if not np.all(noise > 0):
        raise EstimateError("a channel that never changes", f"{QUESTION} needs a tap", "check the sensor")
    scaled = (values - np.median(values, axis=0)) / noise
    first = int(np.max(np.abs(scaled[: np.argmax(np.abs(scaled[:, 0])) + LEAST]).argmax(axis=0)))
    size = np.abs(scaled).max(axis=1)
    last = int(np.flatnonzero(size > 2)[-1]) + 1 if np.any(size > 2) else first
    last = min(last, first + LONGEST, len(scaled))
    if last - first < LEAST or size[first : first + LEAST].max() < LOUD:
        raise EstimateError(
            f"{last - first} samples of ringing, {size.max():.3g} times the noise",
            f"{QUESTION} needs {LEAST} samples after a tap that stand {LOUD:g} times out of the noise",
            "tap harder, or record at a higher rate",
        )
    return _Ringing(scaled[first:last], noise, first, record.fs)


def _blow(record: Record, ringing: _Ringing, period: int) -> list[Doubt]:
    """What speaks against a blow: that a channel swings about another place then; one that moved before is refused."""
    first, size = ringing.first, len(ringing.values)
    before = slice(max(0, first - period - size), max(0, first - period))
    after = slice(first, first + max(1, size // period) * period)
    if before.stop - before.start < LEAST:
        raise EstimateError(
            f"what rings begins {first / record.fs:.3g} s after the record",
            f"{QUESTION} needs rest before the tap: {LEAST} samples, and a period of what rings",
            "keep what is before the tap",
        )
    doubts = []
    for name in (name for name in (*SENSED, "x") if name in record and np.all(np.isfinite(record[name]))):
        values = record[name] - np.median(record[name][before])
        largest = float(np.abs(values[before.stop : after.stop]).max())
        if largest < LOUD * float(np.median(noise_along(record[name], record.fs, record.channels[name].noise))):
            continue
        moves, shift = np.ptp(values[before]) / 2 / largest, abs(np.mean(values[after])) / largest
        if moves > STILL:
            raise EstimateError(
                f"{name} moves before it rings, by {100 * moves:.0f} % of its largest reading",
                f"{QUESTION} needs a tap, which comes out of rest",
                "hold the base, press the contact and tap once, or name the record of a tap",
            )
        if shift > STILL:
            doubts.append(
                Doubt(
                    f"{name} swings about another place than before, {100 * shift:.0f} % of its largest reading away: "
                    "the contact slipped, or this is no tap but a mass let go, or loaded",
                    "no tap",
                )
            )
    return doubts


@dataclass(frozen=True, eq=False)
class _Mode:
    """A pole [1/s], its covariance in (frequency [Hz], ratio), and complex amplitudes with deviations per channel."""

    frequency: float
    damping: float
    sd: Array
    amplitude: Complex
    amplitude_sd: Array


def _modes(ringing: _Ringing) -> tuple[list[_Mode], float]:
    """Every mode that a channel shows, refined together, from low to high."""
    poles = _pencil(ringing.values[:SEARCHED]) * ringing.fs
    poles = poles[(poles.imag > 0) & (poles.real < 0)]
    poles = poles[(-poles.real < 0.9 * np.abs(poles)) & (poles.imag > 2 * np.pi * ringing.fs / len(ringing.values))]
    while len(poles):
        modes, residual = _refined(poles, ringing)
        shown = [bool(np.any(np.abs(mode.amplitude) > AUDIBLE * mode.amplitude_sd)) for mode in modes]
        sound = [s and 0 < m.damping < 1 and m.sd[0] < 0.2 * m.frequency for s, m in zip(shown, modes, strict=True)]
        if all(sound):
            return modes, residual
        poles = np.array([_pole(m.frequency, m.damping) for m, kept in zip(modes, sound, strict=True) if kept])
    raise EstimateError(
        "nothing that oscillates", f"{QUESTION} needs a mode that rings", "tap harder, or sample faster"
    )


def _pole(frequency: float, damping: float) -> complex:
    return 2 * math.pi * frequency * complex(-damping, math.sqrt(max(1e-9, 1 - damping**2)))


def _pencil(values: Array) -> Complex:
    """Poles per sample of all channels together."""
    count = len(values)
    length = count // 3
    blocks = [np.lib.stride_tricks.sliding_window_view(column, length + 1) for column in (values - values.mean(0)).T]
    hankel = np.concatenate(blocks)
    _, singular, right = np.linalg.svd(hankel, full_matrices=False)
    chance = STANDS_OUT * (math.sqrt(len(hankel)) + math.sqrt(length + 1))
    order = max(2, min(24, int(np.sum(singular > chance)), len(singular) - 1))
    basis = right[:order].T
    return np.asarray(np.log(np.linalg.eigvals(np.linalg.pinv(basis[:-1]) @ basis[1:]).astype(complex)))


def _refined(poles: Complex, ringing: _Ringing) -> tuple[list[_Mode], float]:
    """Modes by least squares, the amplitudes eliminated."""
    from scipy.optimize import least_squares

    time = np.arange(len(ringing.values)) / ringing.fs
    many = len(poles)

    def waves(values: Array) -> Array:
        poles = np.array([_pole(math.exp(f), z) for f, z in values.reshape(-1, 2)])
        grown = np.outer(time, poles)
        wave = np.exp(np.minimum(grown.real, GROWN) + 1j * grown.imag)
        return np.column_stack([wave.real, -wave.imag, np.ones(len(time)), time])  # what leaks away is a slope

    def misfit(values: Array) -> Array:
        columns = waves(values)
        return (ringing.values - columns @ np.linalg.lstsq(columns, ringing.values, rcond=None)[0]).ravel()

    start = np.column_stack([np.log(np.abs(poles) / (2 * np.pi)), -poles.real / np.abs(poles)]).ravel()
    solve: Any = least_squares
    fit = solve(misfit, start, x_scale=np.tile([1e-3, 1e-3], many), max_nfev=60)
    columns = waves(fit.x)
    amplitudes = np.linalg.lstsq(columns, ringing.values, rcond=None)[0]
    freedom = fit.fun.size - fit.x.size - amplitudes.size
    residual = math.sqrt(float(fit.fun @ fit.fun) / max(1, freedom))
    scale = max(1.0, residual)
    sd = scale * np.sqrt(np.diag(np.linalg.pinv(fit.jac.T @ fit.jac)))
    variances = np.diag(np.linalg.pinv(columns.T @ columns))  # of a wave that others make up, a rounding below zero
    spread = scale * np.sqrt(np.where(variances > 0, variances, math.inf))
    modes = []
    for j in np.argsort(fit.x[::2]):
        frequency, damping = math.exp(fit.x[2 * j]), float(fit.x[2 * j + 1])
        amplitude = (amplitudes[j] + 1j * amplitudes[many + j]) * ringing.noise
        wide = np.hypot(spread[j], spread[many + j]) * ringing.noise
        modes.append(_Mode(frequency, damping, sd[2 * j : 2 * j + 2] * [frequency, 1.0], amplitude, wide))
    return modes, residual


def _named(modes: Sequence[_Mode], channels: Sequence[str], mass: float | None, status: Status) -> list[Resonance]:
    both = [mode for mode in modes if len(_shown(mode, channels)) == 2]
    ratio = mass  # of force to acceleration in a mode of the mass on its contact
    if ratio is None and both:
        ratio = float(np.abs(both[0].amplitude[1] / both[0].amplitude[0]))
    kinds = [_kind(mode, channels, ratio, known=mass is not None) for mode in modes]
    names = _names(modes, [name for name, _ in kinds], channels)
    described = zip(modes, names, kinds, strict=True)
    return [_resonance(mode, name, _shown(mode, channels), evidence, status) for mode, name, (_, evidence) in described]


def _names(modes: Sequence[_Mode], kinds: Sequence[str], channels: Sequence[str]) -> list[str]:
    """A name for each mode: the largest of a kind bears its name, the others, by number, that of what shows them."""
    names = []
    for mode, kind in zip(modes, kinds, strict=True):
        at = int(kind == CELL)
        alike = [abs(other.amplitude[at]) for other, its in zip(modes, kinds, strict=True) if its == kind]
        largest = kind and abs(mode.amplitude[at]) == max(alike)
        names.append(kind if largest else f"resonance seen by {' and '.join(_shown(mode, channels))}")
    numbers = {name: itertools.count(1) for name in names if names.count(name) > 1}
    return [f"{name}, {next(numbers[name])} of {names.count(name)}" if name in numbers else name for name in names]


def _shown(mode: _Mode, channels: Sequence[str]) -> tuple[str, ...]:
    heard = np.abs(mode.amplitude) > AUDIBLE * mode.amplitude_sd
    return tuple(name for name, is_heard in zip(channels, heard, strict=True) if is_heard)


def _kind(mode: _Mode, channels: Sequence[str], ratio: float | None, *, known: bool) -> tuple[str, str]:
    """What swings in a mode, and why; "" where one sensor alone can not tell."""
    shown = _shown(mode, channels)
    if len(channels) == 1:
        return "", "one sensor alone can not tell a contact from a mount"
    if len(shown) == 1:
        name = ACCELEROMETER if shown == ("a",) else CELL
        return name, f"{shown[0]} shows it and {'load' if shown == ('a',) else 'a'} does not"
    assert ratio is not None
    force = -complex(mode.amplitude[1] / mode.amplitude[0])  # of m a = - f
    turned = math.degrees(abs(np.angle(force)))
    alike = 1 / ALIKE < abs(force) / ratio < ALIKE and abs(np.angle(force)) < math.pi / 4
    return COUPLED if alike else ACCELEROMETER if abs(force) < ratio else CELL, (
        f"both show it, the force opposed to the acceleration but for {turned:.0f} degrees and as large as that of "
        f"{abs(force):.3g} kg{f', the mass being {ratio:.3g} kg' if known else ''}"
    )


def _resonance(mode: _Mode, name: str, shown: tuple[str, ...], evidence: str, status: Status) -> Resonance:
    method = "decaying oscillations of all channels after the tap, by least squares"
    more: dict[str, Any] = {"method": method, "status": status}
    return Resonance(
        name,
        Estimate.normal(f"frequency of the {name}", mode.frequency, sd=mode.sd[0], unit="Hz", **more),
        Estimate.normal(f"damping ratio of the {name}", mode.damping, sd=mode.sd[1], unit="1", **more).within(0),
        shown,
        evidence,
    )
