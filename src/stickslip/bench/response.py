"""A sweep or stepped sine without contact: H1, H2, coherence, and the mass, spring and damper behind them."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stickslip.arrays import Array, Complex
from stickslip.errors import EstimateError, ModelError, StickslipError
from stickslip.estimate import Constant, Doubt, Estimate, Result, Status
from stickslip.record.record import Record
from stickslip.signals.interpolate import without_delays
from stickslip.signals.noise import noise_along
from stickslip.signals.response import derivative_spectra

QUESTION, MODAL = "a frequency response", "mass, spring and damper by a frequency response"
SEGMENTS = 15  # half overlapping, of which the averaged spectra are made
EXCITED = 1e-4  # of the largest power of the input, down to which a line counts as excited
SEEN = 1e-2  # the same of averaged spectra, which are to be looked at
LEAST_LINES = 30
PERIODS = 10.0  # of a tone, over which its amplitude is read
HELD = 0.7  # of its largest amplitude, from which a tone stands
SETTLED = 0.4  # of the stretch of a tone that is left to settle
PIECES = 6  # of the rest, whose scatter tells the coherence
UNEXPLAINED = 3.0  # power of the residual, over that of the noise, from which the model is doubted
INPUTS = ("z", "force")


@dataclass(frozen=True, eq=False, repr=False)
class FrequencyResponse:
    r"""Output over input, line by line.

    Attributes
    ----------
    frequency : ndarray (n,)
        Lines that the input excites [Hz].
    h1, h2 : ndarray (n,)
        :math:`S_{uy}/S_{uu}`, low where the input is noisy, and :math:`S_{yy}/S_{yu}`, high where the output is.
    coherence : ndarray (n,)
        :math:`|S_{uy}|^2/(S_{uu}S_{yy})`, which is H1 over H2.
    channels : tuple of str
        Input and output.
    averages : int
        Spectra averaged.
    """

    frequency: Array
    h1: Complex
    h2: Complex
    coherence: Array
    channels: tuple[str, str]
    averages: int

    def __repr__(self) -> str:
        ends = f"{self.frequency[0]:.3g} to {self.frequency[-1]:.3g} Hz" if len(self.frequency) else "no line"
        low = f"coherence {self.coherence.min():.3g} or more" if len(self.frequency) else "nothing excited"
        return f"FrequencyResponse({self.channels[1]} over {self.channels[0]}, {ends}, {low})"


def frequency_response(
    record: Record,
    *,
    channels: tuple[str, str] = ("z", "x"),
    frequencies: Sequence[float] | None = None,
    segment: float | None = None,
) -> FrequencyResponse:
    r"""How does one channel answer another, at each frequency?

    Of a sweep, a chirp or noise, by averaged spectra of half overlapping Hann windows (Welch 1967; Bendat and Piersol,
    "Random Data", 4th ed., chapter 9). Of a stepped sine, whose `frequencies` are given, by the complex amplitudes of
    both channels while each tone stands. A window leaks where it is shorter than the resonance rings: then H1 is too
    low at its peak, the coherence says so, and :func:`modal_fit`, which does not leak, is what to read.

    Parameters
    ----------
    record : Record
    channels : tuple of str
        Input and output.
    frequencies : sequence of float, optional
        Of a stepped sine [Hz].
    segment : float, optional
        Length of a window [s]; an eighth of the record unless given.

    Returns
    -------
    FrequencyResponse

    Raises
    ------
    RecordError
        A channel is missing or not finite.
    EstimateError
        The input excites nothing.

    Examples
    --------
    >>> rng = np.random.default_rng(1)
    >>> force = rng.standard_normal(20_000)
    >>> record = Record.of({"force": force, "x": 2 * force + 0.1 * rng.standard_normal(20_000)}, fs=100)
    >>> response = frequency_response(record, channels=("force", "x"))
    >>> bool(np.abs(np.abs(response.h1) - 2).max() < 0.2), bool(response.coherence.min() > 0.98)
    (True, True)
    """
    record.require_clean(*channels, question=QUESTION, samples=16 * SEGMENTS)
    record = without_delays(record, *channels, question=QUESTION)
    u, y = (record[name] - record[name].mean() for name in channels)
    if frequencies is not None:
        return _stepped(record, channels, u, y, frequencies)
    from scipy.signal import csd

    size = round(segment * record.fs) if segment else 2 * len(record) // (SEGMENTS + 1)
    if not 16 <= size <= len(record) // 2:
        raise ModelError(
            f"segment = {size / record.fs:.3g} s", "two windows at least go into the record", "choose another length"
        )
    about: dict[str, Any] = {"fs": record.fs, "nperseg": size, "detrend": "constant"}
    frequency, uu = csd(u, u, **about)
    yy, uy = csd(y, y, **about)[1].real, csd(u, y, **about)[1]
    kept = (uu.real > SEEN * uu.real.max()) & (frequency > 0)
    if not kept.any() or uu.real.max() <= 0:
        raise EstimateError(f"{channels[0]} does not change", f"{QUESTION} needs an input", "shake, or tap")
    uu, yy, uy = uu.real[kept], yy[kept], uy[kept]
    count = 2 * len(record) // size - 1
    coherence = np.clip(np.abs(uy) ** 2 / (uu * np.maximum(yy, 1e-300)), 0.0, 1.0)
    return FrequencyResponse(frequency[kept], uy / uu, yy / np.conj(uy), coherence, channels, count)


def _stepped(
    record: Record, channels: tuple[str, str], u: Array, y: Array, frequencies: Sequence[float]
) -> FrequencyResponse:
    """By the amplitudes of each tone while it stands."""
    time, fs, rows = np.arange(len(record)) / record.fs, record.fs, []
    for tone in sorted(frequencies):
        turn = np.exp(-2j * np.pi * tone * time)
        size = max(8, round(PERIODS / tone * fs))
        level = np.abs(np.convolve(u * turn, np.ones(size) / size, mode="same"))
        stands = np.flatnonzero(level > HELD * level.max())
        if not 0 < tone < fs / 2 or len(stands) < 2 * size:
            raise EstimateError(
                f"a tone of {tone:g} Hz stands for {len(stands) / fs:.3g} s",
                f"{QUESTION} needs {2 * PERIODS:g} periods of each",
                "hold it longer, or leave it out of frequencies=",
            )
        begin = stands[0] + round(SETTLED * len(stands))
        whole = max(1, math.floor((stands[-1] - begin) / PIECES * tone / fs)) / tone * fs  # whole periods
        edges = (begin + np.round(whole * np.arange(PIECES + 1))).astype(int)
        parts = [slice(a, min(b, len(u))) for a, b in itertools.pairwise(edges) if a < len(u)]
        amplitudes = np.array([[np.mean(samples[part] * turn[part]) for samples in (u, y)] for part in parts]).T
        rows.append((tone, *(np.mean(a * np.conj(b)) for a, b in _pairs(amplitudes))))
    frequency, uu, yy, uy = (np.array(column) for column in zip(*rows, strict=True))
    coherence = np.clip(np.abs(uy) ** 2 / (uu.real * yy.real), 0.0, 1.0)
    return FrequencyResponse(frequency.real, uy / uu.real, yy.real / np.conj(uy), coherence, channels, PIECES)


def _pairs(amplitudes: Complex) -> list[tuple[Complex, Complex]]:
    u, y = amplitudes
    return [(u, u), (y, y), (y, u)]


@dataclass(frozen=True, eq=False, repr=False)
class ModalFit(Result):
    """Mass, spring and damper of one degree of freedom.

    Attributes
    ----------
    frequency : Estimate
        Natural frequency, undamped [Hz].
    damping_ratio : Estimate
        Viscous.
    mass, stiffness, damping : Estimate or None
        [kg], [N/m] and [N s/m]; of a base's motion only where one of mass and stiffness is given.
    delay : Estimate
        By which the output's sensor comes later than the input's [s].
    gain : Estimate or None
        Output's over input's gain, where the base is the input; a force's is in mass, spring and damper.
    lines : int
        That were excited.
    response : FrequencyResponse or None
        Averaged spectra of the same record, to look at; None where it is too short for them.
    damper : {"ground", "base"}
        What the viscous damper ends on.
    status : str
        "ok", or in words what to beware of.
    """

    frequency: Estimate
    damping_ratio: Estimate
    mass: Estimate | None
    stiffness: Estimate | None
    damping: Estimate | None
    delay: Estimate
    gain: Estimate | None
    lines: int
    response: FrequencyResponse | None
    damper: str
    status: str

    def model(self, frequency: Array) -> Complex:
        """The fitted oscillator's answer at frequencies [Hz]."""
        s = 2j * np.pi * frequency
        w, late = math.tau * self.frequency.value, np.exp(-s * self.delay.value)
        shape = s**2 + 2 * self.damping_ratio.value * w * s + w**2
        if self.gain is None:
            assert self.mass is not None
            return np.asarray(late / (self.mass.value * shape))
        return np.asarray(self.gain.value * late * (w**2 + self.through * s) / shape)

    @property
    def through(self) -> float:
        """What of the base's velocity a damper hands on [1/s]; nothing where it ends on the ground."""
        return 0.0 if self.damper == "ground" else 2 * self.damping_ratio.value * math.tau * self.frequency.value


def modal_fit(
    record: Record,
    *,
    channels: tuple[str, str] = ("z", "x"),
    mass: Constant | None = None,
    stiffness: Constant | None = None,
    damper: str = "ground",
) -> ModalFit:
    r"""How large are mass, spring and damper, by the answer to a motion of the base or a force on the mass?

    .. math:: \ddot x + 2\zeta\omega_n \dot x + \omega_n^2 x = g\,\omega_n^2\,z(t - d)
       \quad\text{or}\quad m \ddot x + c \dot x + k x = f(t - d)

    holds line by line in spectra whose windows, not samples, are differentiated
    (:func:`~stickslip.signals.response.derivative_spectra`), so that neither a short record nor a resonance that rings
    on leaks. The parameters are those under which both channels are most likely with the motion unknown (errors in
    variables; Pintelon and Schoukens, "System Identification", 2nd ed., section 9.11). A sweep, a stepped sine, noise
    and a tap serve alike.

    Parameters
    ----------
    record : Record
        With both channels; contact off.
    channels : tuple of str
        Input ("z" or "force") and the displacement.
    mass, stiffness : float, str, tuple or Estimate, optional
        One of both, where the base is the input [kg, N/m].
    damper : {"ground", "base"}
        What the viscous damper ends on.

    Returns
    -------
    ModalFit

    Raises
    ------
    RecordError
        A channel is missing or not finite.
    EstimateError
        The input is neither, excites too few lines, or the output is no answer of one degree of freedom.

    Examples
    --------
    >>> import stickslip as ss
    >>> drive = ss.drives.Recorded(np.random.default_rng(1).standard_normal(800).cumsum(), 20.0, on="force")
    >>> slider = ss.Oscillator(mass=2.42, stiffness=2310, damping=3.0, law=ss.laws.Coulomb(0.0), drive=drive)
    >>> record = ss.Rig.perfect("x", "force").measure(ss.simulate(slider, duration=39.0), fs=500)
    >>> modes = modal_fit(record, channels=("force", "x"))
    >>> round(modes.mass.value, 2), round(modes.stiffness.value), round(modes.damping.value, 1)
    (2.42, 2310, 3.0)
    """
    from scipy.optimize import least_squares

    if channels[0] not in INPUTS or damper not in ("ground", "base"):
        raise EstimateError(
            f"input {channels[0]}, damper {damper}",
            "the input is z or force, the damper ends on ground or base",
            "name them as channels= and damper=",
        )
    record.require_clean(*channels, question=MODAL, samples=200)
    record = without_delays(record, *channels, question=MODAL)
    lines = _Lines.of(record, channels, damper)
    begin = lines.start()
    solve: Any = least_squares
    fit = solve(lines.misfit, begin, x_scale=np.maximum(np.abs(begin), 1e-6))
    power = float(fit.fun @ fit.fun) / (len(fit.fun) - len(begin))
    cover = max(1.0, power) * np.linalg.inv(fit.jac.T @ fit.jac)[:4, :4]
    stated = (("mass", mass, "kg"), ("stiffness", stiffness, "N/m"))
    given = {name: Estimate.stated(name, value, unit) for name, value, unit in stated if value is not None}
    doubt = Doubt(
        f"the answer leaves {power:.2g} times the noise: more than one mass on one spring, or friction", "model"
    )
    modal = _modal_of(lines, fit.x, cover, given, Status(*[doubt] * (power > UNEXPLAINED)))
    return replace(modal, response=_response_of(record, channels))


def _response_of(record: Record, channels: tuple[str, str]) -> FrequencyResponse | None:
    try:
        return frequency_response(record, channels=channels)
    except StickslipError:
        return None


@dataclass(frozen=True, eq=False)
class _Lines:
    """Spectra of displacement, velocity, acceleration and input at the lines that are excited, with their noise."""

    turn: Complex
    x: Complex
    u: Complex
    level: Complex  # of what is one throughout: zeros of the sensors, and means taken off that do not balance
    noise: tuple[float, float]
    of_base: bool
    damper: str
    gains: float  # standard deviation of both channels' gains, as a part

    @classmethod
    def of(cls, record: Record, channels: tuple[str, str], damper: str) -> _Lines:
        spectra, noise = [], []
        for name in channels[::-1]:
            values = record[name] - np.mean(record[name])
            spectra.append(derivative_spectra(values, fs=record.fs, orders=[0, 1, 2]))
            sd = float(np.median(noise_along(values, record.fs, record.channels[name].noise)))
            noise.append(max(sd, 1e-9 * float(np.ptp(values))) * math.sqrt(len(values)))
        frequency = np.fft.rfftfreq(len(record), 1 / record.fs)
        x, u = spectra
        power = np.abs(u[0]) ** 2
        kept = (power > max(EXCITED * power.max(), 9 * noise[1] ** 2)) & (frequency > 0)
        if kept.sum() < LEAST_LINES:
            raise EstimateError(
                f"{kept.sum()} lines that {channels[0]} excites",
                f"{MODAL} needs {LEAST_LINES}",
                f"sweep, or shake longer; of white noise state the sensor's own: with_details('{channels[0]}', noise=)",
            )
        turn = 2j * np.pi * frequency[kept]
        level = derivative_spectra(np.ones(len(record)), fs=record.fs, orders=[0])[0, kept]
        gains = math.hypot(*(record.channels[name].gain_sd for name in channels))
        return cls(turn, x[:, kept], u[:, kept], level, (noise[0], noise[1]), channels[0] == "z", damper, gains)

    def start(self) -> Array:
        """By least squares, no delay. A base: (w^2, c/m, delay, gain, level), a force: (m, c, delay, k, level)."""
        if self.of_base:
            columns, known = [self.x[0] - self.u[0], self.x[1], -self.level], -self.x[2]
        else:
            columns, known = [self.x[2], self.x[1], self.x[0], -self.level], self.u[0]
        design = np.column_stack(columns)
        design, target = np.vstack([design.real, design.imag]), np.concatenate([known.real, known.imag])
        scale = np.linalg.norm(design, axis=0)
        fit = np.linalg.lstsq(design / scale, target)[0] / scale
        if self.of_base:
            if fit[0] <= 0:
                raise EstimateError("no spring between base and mass", f"{MODAL} needs one", "check signs and channels")
            return np.array([fit[0], max(fit[1], 1e-3 * math.sqrt(fit[0])), 0.0, 1.0, fit[2]])
        if fit[0] <= 0 or fit[2] <= 0:
            raise EstimateError(
                "no mass on a spring", f"{MODAL} needs one", "check the signs of force and displacement"
            )
        return np.array([fit[0], max(fit[1], 1e-3 * math.sqrt(fit[0] * fit[2])), 0.0, fit[2], fit[3]])

    def misfit(self, p: Array) -> Array:
        """The relation's residual in standard deviations, real and imaginary parts."""
        late = np.exp(-self.turn * p[2])
        if self.of_base:
            left, factor = self.x[2] + p[1] * self.x[1] + p[0] * self.x[0], self.turn**2 + p[1] * self.turn + p[0]
            pushed, of_input = p[3] * p[0] * self.u[0], np.full(len(self.turn), p[3] * p[0], dtype=complex)
            if self.damper == "base":
                pushed, of_input = pushed + p[3] * p[1] * self.u[1], of_input + p[3] * p[1] * self.turn
        else:
            left = p[0] * self.x[2] + p[1] * self.x[1] + p[3] * self.x[0]
            factor = p[0] * self.turn**2 + p[1] * self.turn + p[3]
            pushed, of_input = self.u[0], np.ones(len(self.turn), dtype=complex)
        sd = np.sqrt((np.abs(factor) * self.noise[0]) ** 2 + (np.abs(of_input) * self.noise[1]) ** 2) / math.sqrt(2)
        residual = (left - late * pushed - p[4] * self.level) / sd
        return np.concatenate([residual.real, residual.imag])


def _modal_of(lines: _Lines, p: Array, cover: Array, given: dict[str, Estimate], status: str) -> ModalFit:
    method = f"{len(lines.turn)} lines, errors in both channels"

    def of(name: str, value: float, gradient: Sequence[float], unit: str, extra: float = 0.0) -> Estimate:
        slope = np.asarray(gradient)
        sd = math.hypot(math.sqrt(max(0.0, float(slope @ cover @ slope))), extra)
        return Estimate.normal(name, value, sd=sd, unit=unit, method=method, status=status)

    delay = of("delay of the displacement behind the input", p[2], [0, 0, 1, 0], "s")
    about: Any = {"delay": delay, "lines": len(lines.turn), "response": None, "damper": lines.damper, "status": status}
    if lines.of_base:
        w = math.sqrt(p[0])
        frequency = of("natural frequency", w / math.tau, [1 / (2 * w * math.tau), 0, 0, 0], "Hz")
        ratio = of("damping ratio", p[1] / (2 * w), [-p[1] / (4 * w**3), 1 / (2 * w), 0, 0], "1").within(0.0)
        gain = of("gain of the displacement over that of the base", p[3], [0, 0, 0, 1], "1", lines.gains * p[3])
        weight = given.get("mass")
        if weight is None and "stiffness" in given:
            spring = given["stiffness"]
            part = math.hypot(spring.sd / spring.value, math.sqrt(cover[0, 0]) / p[0])
            weight = Estimate.normal(
                "mass", spring.value / p[0], sd=part * spring.value / p[0], unit="kg", method=method
            )
        if weight is None:
            return ModalFit(frequency, ratio, None, None, None, gain=gain, **about)
        m = weight.value
        spring = of("spring stiffness", m * p[0], [m, 0, 0, 0], "N/m", weight.sd * p[0])
        damper = of("viscous damping", m * p[1], [0, m, 0, 0], "N s/m", weight.sd * abs(p[1])).within(0.0)
        return ModalFit(frequency, ratio, weight, spring, damper, gain=gain, **about)
    m, c, k = p[0], p[1], p[3]
    w, root = math.sqrt(k / m), math.sqrt(k * m)
    return ModalFit(
        of("natural frequency", w / math.tau, [-w / (2 * m) / math.tau, 0, 0, w / (2 * k) / math.tau], "Hz"),
        of("damping ratio", c / root / 2, [-c / (4 * root * m), 0.5 / root, 0, -c / (4 * root * k)], "1").within(0),
        of("mass", m, [1, 0, 0, 0], "kg"),
        of("spring stiffness", k, [0, 0, 0, 1], "N/m"),
        of("viscous damping", c, [0, 1, 0, 0], "N s/m").within(0.0),
        gain=None,
        **about,
    )
