"""Velocity and acceleration from a noisy displacement, and filters: all without delay, with the response known.

Two methods of differentiation. The thesis's: a central difference followed by a five-point average (Appendix A). The
better one: a smoothing spline on the samples, as wide as the record's own noise asks, followed by a five-point
difference. The filters keep a band or take a mode out; each is told in the history.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from stickslip.arrays import Array, Complex, Rows
from stickslip.errors import EstimateError, RecordError
from stickslip.record.record import Record, Step, require_record
from stickslip.signals.noise import ROUGHNESS, checked_samples, end_modes, noise_along, penalised
from stickslip.units import parse_value

ORDER = 4  # of Butterworth's filter, which runs forward and back: the gain at an edge is one half
SETTLES = 3  # periods of the lowest edge that a record must last
Method = Literal["smoother", "five-point"]
METHODS: tuple[Method, ...] = ("smoother", "five-point")
LEAST = 24  # samples

_DIFFERENCE = {  # five-point differences, exact for polynomials of degree four
    0: np.array([0.0, 0.0, 1.0, 0.0, 0.0]),
    1: np.array([1.0, -8.0, 0.0, 8.0, -1.0]) / 12,
    2: np.array([-1.0, 16.0, -30.0, 16.0, -1.0]) / 12,
}
_BEYOND = np.array([[6.0, -8.0, 3.0], [3.0, -3.0, 1.0]])  # two samples before the first three, on their parabola


def keep_band(
    record: Record, *, low: float | None = None, high: float | None = None, channels: Iterable[str] | None = None
) -> Record:
    r"""Keep what lies between two frequencies.

    Butterworth's filter of fourth order forward and back (zero phase): the gain is :math:`1/(1 + (f/f_c)^8)` beside an
    edge :math:`f_c`, one half at it. All channels are filtered alike unless some are named, so that forces still
    balance between them.

    Parameters
    ----------
    record : Record
        With one clock.
    low, high : float, optional
        Edges of the band [Hz]; one that is left out is open.
    channels : iterable of str, optional
        Which ones; all where left out.

    Returns
    -------
    Record
        Its first and last periods of the lower edge hold the filter's settling.

    Raises
    ------
    RecordError
        No edge, edges out of order or beyond half the sampling rate, a record shorter than three periods of the lower
        edge, or values that are not numbers.

    Examples
    --------
    >>> t = np.arange(2000) / 1000
    >>> record = Record.of({"x": np.sin(2 * np.pi * 5 * t) + np.sin(2 * np.pi * 100 * t)}, fs=1000)
    >>> kept = keep_band(record, high=20)["x"][300:-300]
    >>> bool(np.abs(kept - np.sin(2 * np.pi * 5 * t)[300:-300]).max() < 1e-3)
    True
    """
    edges = [edge for edge in (low, high) if edge is not None]
    if not edges or not all(0 < edge < record.fs / 2 for edge in edges) or (len(edges) == 2 and edges[0] >= edges[1]):
        raise RecordError(
            f"a band from {low} to {high} Hz of a record at {record.fs:g} Hz",
            "edges lie between 0 and half the sampling rate, the lower first",
            "state low=, high= or both, in Hz",
        )
    kind = "bandpass" if len(edges) == 2 else "highpass" if high is None else "lowpass"
    between = " to ".join(f"{edge:g}" for edge in edges)
    below, above = (f"kept below {high:g} Hz" if high else ""), (f"kept above {low:g} Hz" if low else "")
    outcome = {"bandpass": f"kept {between} Hz", "highpass": above, "lowpass": below}[kind]
    return _passed(record, channels, edges, kind, Step("keep_band", {"low": low, "high": high}, outcome))


def remove_mode(
    record: Record, *, frequency: float, width: float = 0.2, channels: Iterable[str] | None = None
) -> Record:
    """Take out one mode of vibration: what lies about its frequency, as the ringing of a mount or of a frame.

    Parameters
    ----------
    record : Record
        With one clock.
    frequency : float
        Of the mode [Hz].
    width : float
        How wide a band is taken out, over its frequency.
    channels : iterable of str, optional
        Which ones; all where left out.

    Returns
    -------
    Record

    Raises
    ------
    RecordError
        A band that does not lie between 0 and half the sampling rate, or as of :func:`keep_band`.

    Examples
    --------
    >>> t = np.arange(4000) / 1000
    >>> slow, ringing = np.sin(2 * np.pi * 2 * t), 0.3 * np.sin(2 * np.pi * 60 * t)
    >>> record = remove_mode(Record.of({"x": slow + ringing}, fs=1000), frequency=60)
    >>> bool(np.abs(record["x"] - slow)[300:-300].max() < 1e-3), record.history[-1].outcome
    (True, 'taken out 54 to 66 Hz')
    """
    edges = [frequency * (1 - width / 2), frequency * (1 + width / 2)]
    if not (0 < width < 2 and edges[0] > 0 and edges[1] < record.fs / 2):
        raise RecordError(
            f"a mode at {frequency:g} Hz, {width:g} of it wide, at {record.fs:g} Hz",
            "its band lies between 0 and half the sampling rate",
            "correct the frequency [Hz] or width=",
        )
    outcome = f"taken out {edges[0]:g} to {edges[1]:g} Hz"
    step = Step("remove_mode", {"frequency": frequency, "width": width}, outcome)
    return _passed(record, channels, edges, "bandstop", step)


def _named(record: Record, channels: Iterable[str] | None, asker: str, samples: int) -> list[str]:
    require_record(record)
    names = list(channels or record)
    record.require_clean(*names, question=asker, samples=samples)
    return names


def _passed(record: Record, channels: Iterable[str] | None, edges: list[float], kind: str, step: Step) -> Record:
    """Some channels, run through Butterworth's filter forward and back."""
    from scipy.signal import butter, sosfiltfilt

    names = _named(record, channels, step.action, int(np.ceil(SETTLES * record.fs / edges[0])) + 1)
    sections = butter(ORDER, edges if len(edges) > 1 else edges[0], kind, fs=record.fs, output="sos")
    most = len(record) - 1
    settle = min(most, int(SETTLES * record.fs / edges[0]))
    through: dict[str, Array] = {n: sosfiltfilt(sections, record[n], padlen=settle) for n in names}
    described = Step(step.action, {**step.arguments, "channels": names}, step.outcome)
    return record.with_samples({**record.samples, **through}, described, filtered=True)


@dataclass(frozen=True)
class Derivative:
    """A smoothed or differentiated channel, with its uncertainty.

    Attributes
    ----------
    values : ndarray, shape (n,)
        The derivative, in the unit of the samples over s^order.
    sd : ndarray, shape (n,)
        Standard deviation of each value: the noise of the samples through the filter and, for the smoother, the
        estimated smoothing bias (what a second pass of the smoother changes, less what noise alone would change).
    fs : float
        Sampling rate [Hz].
    order : int
        0, 1 or 2.
    method : str
        "smoother" or "five-point".
    bandwidth : float
        Frequency [Hz] at which the smoothing passes 1/sqrt(2) (-3 dB) of the amplitude.
    noise : float
        Root mean square over the record of the samples' noise.
    """

    values: Array
    sd: Array
    fs: float
    order: int
    method: str
    bandwidth: float
    noise: float

    def response(self, frequency: ArrayLike) -> Array:
        """Gain at `frequency` [Hz] relative to the exact derivative; real, for the delay is zero."""
        tone = 2 * np.pi * np.atleast_1d(np.asarray(frequency, dtype=float))
        made = Filter(self.method, self.fs, self.bandwidth).response(frequency, {self.order: 1.0})
        with np.errstate(divide="ignore", invalid="ignore"):
            gain = np.real(np.atleast_1d(made) / (1j * tone) ** self.order)
        gain[tone == 0] = 1.0
        return gain.reshape(np.shape(frequency))


@dataclass(frozen=True)
class Filter:
    """A linear filter without delay: any sum of a channel and its derivatives, smoothed.

    Attributes
    ----------
    method : str
        "smoother" or "five-point".
    fs : float
        Sampling rate [Hz].
    bandwidth : float
        Frequency [Hz] of -3 dB of the smoother; not used by the five-point method, which has none to choose.
    """

    method: str
    fs: float
    bandwidth: float

    @property
    def penalty(self) -> float:
        """The smoother's lambda: ``1 / (1 + lambda (2 - 2 cos w)^3) = 1/sqrt(2)`` at the bandwidth."""
        return (math.sqrt(2) - 1) / (2 * math.sin(math.pi * self.bandwidth / self.fs)) ** (2 * ROUGHNESS)

    def apply(self, values: Array, terms: Mapping[int, float]) -> Array:
        """``sum of coefficient * derivative of that order`` along the first axis; smoothed too at order 0."""
        if self.method == "smoother":
            values = penalised(values, self.penalty)
        return sum((c * self._derivative(values, order) for order, c in terms.items() if c), np.zeros_like(values))

    def response(self, frequency: ArrayLike, terms: Mapping[int, float]) -> Complex:
        """Complex response at `frequency` [Hz] of what :meth:`apply` does away from the ends."""
        w = 2 * np.pi * np.asarray(frequency, dtype=float) / self.fs
        total = np.zeros(w.shape, dtype=complex)
        for order, coefficient in terms.items():
            if self.method == "five-point":
                step = (1j * np.sin(w) * self.fs * five_point_response(frequency, self.fs)) ** order
            else:
                step = self.fs**order * sum(tap * np.exp(1j * w * (i - 2)) for i, tap in enumerate(_DIFFERENCE[order]))
            total = total + coefficient * step
        return np.asarray(total * self.smoothing(frequency), dtype=complex)

    def smoothing(self, frequency: ArrayLike) -> Array:
        """``1 / (1 + lambda (2 - 2 cos w)^3)`` of the smoother; 1 for five-point, whose average goes with the order."""
        if self.method == "five-point":
            return np.ones(np.shape(frequency))
        half = np.sin(np.pi * np.asarray(frequency, dtype=float) / self.fs)
        return np.asarray(1 / (1 + self.penalty * (2 * half) ** (2 * ROUGHNESS)))

    def inner_gain(self, terms: Mapping[int, float], *, change: bool = False) -> float:
        """Standard deviation, away from the ends, for white noise of unit standard deviation (Parseval's theorem).

        With `change`, of what a second pass of the smoother would take away.
        """
        grid = np.linspace(0, self.fs / 2, max(4096, 2 * self._reach()) + 1)
        power = np.abs(self.response(grid, terms) * ((1 - self.smoothing(grid)) if change else 1)) ** 2
        return float(np.sqrt((power.sum() - (power[0] + power[-1]) / 2) / (len(grid) - 1)))

    def noise_gain(self, size: int, terms: Mapping[int, float]) -> Array:
        """Standard deviation of each of `size` outputs for white noise of unit standard deviation.

        Inside as :meth:`inner_gain`; within reach of the ends from the rows of the filter itself.
        """
        reach = self._reach()
        gain = np.full(size, self.inner_gain(terms))
        zone = min(reach, size // 2)
        rows = np.unique(np.round(np.geomspace(1, zone + 1, 80)).astype(int) - 1)
        rows = rows[rows < zone]
        # A record reversed in time turns the odd derivatives round: where all are odd, or all even, the ends are alike.
        turned = {order: c * (-1) ** order for order, c in terms.items()}
        alike = len({order % 2 for order, c in terms.items() if c}) < 2
        begin = self._row_norms(min(size, 2 * reach), terms, rows)
        end = begin if alike else self._row_norms(min(size, 2 * reach), turned, rows)
        for side, norms in ((gain, begin), (gain[::-1], end)):
            side[:zone] = np.interp(np.arange(zone), rows, norms)
        return gain

    def _derivative(self, values: Array, order: int) -> Array:
        if self.method == "smoother":
            return five_point_difference(values, order) * self.fs**order
        for _ in range(order):
            values = five_point_average(np.gradient(values, axis=0, edge_order=2)) * self.fs
        return values

    def _reach(self) -> int:
        """Samples after which the end of the record no longer matters (1e-4 of its weight)."""
        if self.method == "five-point":
            return 16
        return 8 + math.ceil(math.log(1e-4) / math.log(np.abs(end_modes(self.penalty)).max()))

    def _row_norms(self, size: int, terms: Mapping[int, float], rows: Rows) -> Array:
        if self.method == "five-point":
            return np.asarray(np.linalg.norm(self.apply(np.eye(size), terms)[rows], axis=1))
        # The smoother is a symmetric matrix S: row i of (difference S) is S times row i of the difference.
        stencil = sum((c * self._derivative(np.eye(12), order) for order, c in terms.items()), np.zeros((12, 12)))
        columns = np.zeros((size, len(rows)))
        for column, row in enumerate(rows):
            shift = max(0, row - 4)
            columns[shift : shift + 8, column] = stencil[row - shift, :8]
        return np.asarray(np.linalg.norm(penalised(columns, self.penalty), axis=0))


def differentiate(
    values: ArrayLike,
    fs: float,
    *,
    order: int = 1,
    method: Method = "smoother",
    noise: ArrayLike | None = None,
    bandwidth: float | str | None = None,
) -> Derivative:
    r"""What is the velocity (order 1) or the acceleration (order 2) behind a sampled displacement?

    ``"smoother"``: the samples y are replaced by the u that minimises ``sum (y - u)^2 + lambda sum (third difference
    of u)^2``, which is then differenced over five points. Its frequency response is

    .. math:: H(\omega) = \frac{1}{1 + \lambda (2 - 2\cos\omega)^3} \, D(\omega), \quad \omega = 2 \pi f / f_s

    with ``D = i (8 sin w - sin 2w)/6 fs`` or ``-(15 - 16 cos w + cos 2w)/6 fs^2``. It is the steady state of a
    Kalman/Rauch-Tung-Striebel smoother whose acceleration walks at random, and Wiener's best filter for accelerations
    that jump, as they do at a stick. At the ends the minimum itself is computed, not a padded record's, so that any
    parabola passes unchanged. The bandwidth is the most likely one given the record (:func:`best_bandwidth`).

    ``"five-point"``: each order is a central difference followed by :func:`five_point_average` (thesis, Appendix A).

    Parameters
    ----------
    values : array_like, shape (n,)
        Samples, finite, n >= 24.
    fs : float
        Sampling rate [Hz].
    order : {1, 2}
        Order of the derivative.
    method : {"smoother", "five-point"}
        See above.
    noise : float or array_like, shape (n,), optional
        Standard deviation of the samples' noise; estimated, in time where it varies, when not given.
    bandwidth : float or str, optional
        The smoother's frequency of -3 dB [Hz]; chosen when not given.

    Returns
    -------
    Derivative

    Raises
    ------
    EstimateError
        Too few samples, a value that is not finite, or an argument out of its range.

    Examples
    --------
    >>> t = np.arange(2000) / 1000
    >>> x = np.sin(10 * t) + 1e-3 * np.random.default_rng(1).standard_normal(t.size)
    >>> velocity = differentiate(x, 1000)
    >>> bool(np.std(velocity.values - 10 * np.cos(10 * t)) < 0.03)
    True
    """
    if order not in (1, 2):
        raise EstimateError(
            f"order = {order}", "the first or the second derivative is computed", "pass order=1 or order=2"
        )
    return _filtered(values, fs, order, method, noise, bandwidth)


def smooth(
    values: ArrayLike, fs: float, *, noise: ArrayLike | None = None, bandwidth: float | str | None = None
) -> Derivative:
    """What is the channel without its noise? The smoother of :func:`differentiate` at order 0.

    Parameters
    ----------
    values, fs, noise, bandwidth
        As for :func:`differentiate`.

    Returns
    -------
    Derivative
        Of order 0, with a frequency response of ``1 / (1 + lambda (2 - 2 cos w)^3)``.

    Raises
    ------
    EstimateError
        As for :func:`differentiate`.

    Examples
    --------
    >>> t = np.arange(2000) / 1000
    >>> x = np.sin(10 * t) + 1e-2 * np.random.default_rng(1).standard_normal(t.size)
    >>> bool(np.std(smooth(x, 1000).values - np.sin(10 * t)) < 3e-3)
    True
    """
    return _filtered(values, fs, 0, "smoother", noise, bandwidth)


def five_point_average(values: ArrayLike) -> Array:
    """The moving average of the thesis, equation (A.1), with its end formulas; indices run from 0 to n.

    ``(y[i-2] + y[i-1] + y[i] + y[i+1] + y[i+2]) / 5`` inside; at the first and last two points the value of the
    straight line fitted to the five at that end.

    Parameters
    ----------
    values : array_like, shape (n, ...)
        At least five samples along the first axis.

    Returns
    -------
    ndarray
        Of the shape of `values`.

    Raises
    ------
    EstimateError
        Fewer than five samples.

    Examples
    --------
    >>> bool(np.allclose(five_point_average([0, 1, 2, 3, 4, 5]), [0, 1, 2, 3, 4, 5]))  # a line is left alone
    True
    """
    y = np.asarray(values, dtype=float)
    if len(y) < 5:
        raise EstimateError(f"{len(y)} samples", "the five-point average needs five", "give a longer record")
    mean = np.empty_like(y)
    mean[2:-2] = (y[:-4] + y[1:-3] + y[2:-2] + y[3:-1] + y[4:]) / 5
    for end, side in ((mean, y), (mean[::-1], y[::-1])):
        end[0] = (3 * side[0] + 2 * side[1] + side[2] - side[4]) / 5
        end[1] = (4 * side[0] + 3 * side[1] + 2 * side[2] + side[3]) / 10
    return mean


def five_point_response(frequency: ArrayLike, fs: float) -> Array:
    """Gain of the five-point average, ``(1 + 2 cos w + 2 cos 2w) / 5`` (thesis, equation (A.2)).

    Zero at fs/5 and 2 fs/5 and negative between: the delay is zero, the sign is not kept above fs/5.

    Parameters
    ----------
    frequency : array_like
        Frequency [Hz].
    fs : float
        Sampling rate [Hz].

    Returns
    -------
    ndarray

    Examples
    --------
    >>> five_point_response([0, 250, 500], 4000).round(3).tolist()
    [1.0, 0.852, 0.483]
    """
    w = 2 * np.pi * np.asarray(frequency, dtype=float) / fs
    return np.asarray((1 + 2 * np.cos(w) + 2 * np.cos(2 * w)) / 5)


def best_bandwidth(values: Array, fs: float) -> float:
    r"""Which bandwidth suits the signal and the noise of this channel?

    Third differences of a displacement whose acceleration walks at random, in white noise, have the spectrum
    ``s^2 ((2 - 2 cos w)^3 + 1/lambda)``. Its likelihood (restricted, for parabolas have no third differences) is taken
    after Whittle (1953) from a periodogram under a Hann window, which neither trends nor the ends of the record leak
    through. The lambda that makes it largest gives the least mean square error in displacement, velocity and
    acceleration alike, and needs no noise level beside.

    Parameters
    ----------
    values : ndarray, shape (n,)
        Samples, n >= 24.
    fs : float
        Sampling rate [Hz].

    Returns
    -------
    float
        Frequency of -3 dB [Hz], between two and a half cycles in the record and 0.45 fs.

    Examples
    --------
    >>> t = np.arange(2000) / 1000
    >>> x = np.abs(np.sin(10 * t)) ** 3 + 1e-3 * np.random.default_rng(1).standard_normal(t.size)
    >>> 10 < best_bandwidth(x, 1000) < 40
    True
    """
    from scipy import fft

    differences = np.diff(values, ROUGHNESS)
    size = len(differences)
    window = np.hanning(size + 2)[1:-1]
    padded = fft.next_fast_len(size, real=True)
    power = (np.abs(fft.rfft(differences * window, padded)) ** 2)[1:] / np.sum(window**2)
    frequency = fft.rfftfreq(padded, 1 / fs)[1:]
    starts = np.unique(np.geomspace(1, len(power), min(4000, len(power))).astype(int)) - 1
    count = np.diff(np.append(starts, len(power)))
    power = np.add.reduceat(power, starts) / count
    white = (2 * np.sin(np.pi * np.add.reduceat(frequency, starts) / count / fs)) ** (2 * ROUGHNESS)

    def misfit(bandwidth: float) -> float:  # minus twice the log likelihood per frequency, the noise level profiled out
        shape = white + 1 / Filter("smoother", fs, bandwidth).penalty
        return float(np.log(np.sum(count * power / shape)) + np.sum(count * np.log(shape)) / count.sum())

    if not power.any():
        return 0.45 * fs  # a perfect parabola: nothing to smooth
    candidates = np.geomspace(2.5 * fs / size, 0.45 * fs, 160)
    return float(candidates[int(np.argmin([misfit(float(candidate)) for candidate in candidates]))])


def checked_method(method: str) -> str:
    """`method`, if it is one of "smoother" and "five-point"."""
    if method not in METHODS:
        raise EstimateError(
            f"method = '{method}'", f"a derivative is taken by {' or '.join(METHODS)}", "choose one of them"
        )
    return method


def total_sd(filtered: Array, noise_sd: Array, bias: Filter | None, ratio: float) -> Array:
    """Noise and smoothing bias together: the bias is what a second pass of `bias` changes beyond its own noise."""
    if bias is None:
        return noise_sd
    change = filtered - bias.apply(filtered, {0: 1.0})
    return np.asarray(np.sqrt(noise_sd**2 + np.maximum(0, change**2 - (ratio * noise_sd) ** 2)))


def _filtered(
    values: ArrayLike, fs: float, order: int, method: str, noise: ArrayLike | None, bandwidth: float | str | None
) -> Derivative:
    checked_method(method)
    samples = checked_samples(values, fs, least=LEAST)
    along = noise_along(samples, fs, noise)
    level = float(np.sqrt(np.mean(along**2)))
    terms = {order: 1.0}
    if method == "five-point":
        if bandwidth is not None:
            raise EstimateError(
                f"bandwidth = {bandwidth} Hz",
                "the five-point average has no bandwidth to choose",
                'leave it out, or use method="smoother"',
            )
        width = _half_power(lambda f: five_point_response(f, fs) ** order, fs / 5)
    elif bandwidth is None:
        width = best_bandwidth(samples, fs)
    else:
        width = checked_bandwidth(bandwidth, fs, samples.size)
    made = Filter(method, fs, width)
    result = made.apply(samples, terms)
    gain = made.noise_gain(samples.size, terms)
    smoother = made if method == "smoother" else None
    ratio = made.inner_gain(terms, change=True) / made.inner_gain(terms) if smoother else 0.0
    return Derivative(result, total_sd(result, gain * along, smoother, ratio), fs, order, method, width, level)


def checked_bandwidth(bandwidth: float | str, fs: float, size: int) -> float:
    """`bandwidth` in Hz, if a record of `size` samples can be smoothed to it."""
    bandwidth, low, high = parse_value(bandwidth, "Hz"), fs / size, fs / 2
    if not low <= bandwidth <= high:
        raise EstimateError(
            f"bandwidth = {bandwidth} Hz",
            f"this record can be smoothed to between {low:g} Hz (one cycle) and {high:g} Hz (half the rate)",
            "choose a bandwidth in between, or leave it out",
        )
    return bandwidth


def _half_power(response: Callable[[Any], Array], top: float) -> float:
    from scipy.optimize import brentq

    return float(brentq(lambda f: float(response(f)) - math.sqrt(0.5), 0, top))


def convolved(values: Array, kernel: Array) -> Array:
    """Both convolved in full, as scipy.signal.fftconvolve has it, whose import takes a second."""
    from scipy.fft import irfft, next_fast_len, rfft

    count = len(values) + len(kernel) - 1
    size = next_fast_len(count, real=True)
    return np.asarray(irfft(rfft(values, size) * rfft(kernel, size), size)[:count])


def five_point_difference(values: Array, order: int) -> Array:
    """Five-point difference along the first axis; two samples beyond each end are put on the parabola there."""
    if order == 0:
        return values
    before = _BEYOND @ values[:3]
    after = (_BEYOND @ values[:-4:-1])[::-1]
    long = np.concatenate([before, values, after])
    size = len(values)
    return np.asarray(sum(tap * long[i : i + size] for i, tap in enumerate(_DIFFERENCE[order]) if tap))
