"""How sure a mean or a regression coefficient is when neighbouring samples are alike.

One idea serves every question: an estimate is the mean of a series (of cycles, or of each sample's influence on it),
and the variance of a mean is the spectrum of the series at frequency zero. That is read from the lowest cosines.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from stickslip.arrays import Array, Rows
from stickslip.errors import EstimateError
from stickslip.estimate import NORMAL_95, Doubt, Estimate, Status

FEW_CYCLES = 8  # below this no test of the interval holds at 0.5 correlation between neighbours
HALF_ERROR = 0.5  # standard errors by which correlation is taken to be stronger: too weak a one costs more
FEW_INDEPENDENT = 8.0  # independent samples per coefficient, below which an interval is not to be trusted
MOST_NOISE = 0.75  # of the power of a sum of columns, that may be noise: beyond, nothing would be left of the columns
NOISE_UNSURE = 0.1  # of its power, that the noise of columns is unsure by, chosen
MOST_LEVERAGE = 0.9  # of a sample and its neighbours: beyond, one stroke alone tells a coefficient
BINS, FEWEST = 16, 6.0  # of a way or a cycle, and of how many, as they weigh, a correlation is told
# Deviations of Fisher's z, once in 700 without an effect: 1 of 58 joints whose friction is the same along the way.
REPEATS = 3.0
# Correlation with a later lag from which a residual is the same again, and that in deviations of noise, chosen: of five
# joints' logs of repeated motions it was 0.8 to 0.98, of one that did not repeat 0.12.
RECURS, RECURRED = 0.3, 5.0
ALIKE = 0.999  # a correlation, beyond which Fisher's z grows without bound
INSEPARABLE = 1e3  # condition number of columns of unit length; a force balance that can be read has less than 30


@dataclass(frozen=True, eq=False)
class LeastSquares:
    """Coefficients of a linear regression, with uncertainties that hold when residuals are correlated.

    Attributes
    ----------
    coefficients : ndarray, shape (p,)
        Estimates.
    residual : ndarray, shape (n,)
        Data minus model.
    condition : float
        Condition number of the design after scaling its columns to unit length.
    independent : float
        Number of independent samples that the residual is worth.
    projection : ndarray, shape (p, n)
        The coefficients as linear forms of the data.
    leverage : ndarray, shape (n,)
        By how much of the error of a sample and of its neighbours, which share it, the fit follows them.
    restored : ndarray, shape (p,)
        By how much each coefficient would grow with the noise of the columns, in proportion.
    cyclic : bool
        Whether what is left may come again with a motion that does; standard deviations then count it once.
    """

    coefficients: Array
    residual: Array
    condition: float
    independent: float
    projection: Array
    leverage: Array
    restored: Array
    cyclic: bool = False

    @cached_property
    def _sure(self) -> tuple[Array, Array]:
        terms = len(self.coefficients)
        pairs = [_influenced(form, self.residual, self.independent, terms) for form in self.projection]
        wider = math.sqrt(self.recurring)
        return np.array([wider * sd for sd, _ in pairs]), np.array([freedom for _, freedom in pairs])

    @cached_property
    def recurring(self) -> float:
        """In how many cycles of a motion what is left is the same (:func:`recurrence`): all tell no more than one."""
        return recurrence(self.residual) if self.cyclic else 1.0

    @property
    def sd(self) -> Array:
        """Standard deviations of the coefficients, shape (p,)."""
        return self._sure[0]

    @property
    def freedom(self) -> Array:
        """Degrees of freedom of each standard deviation, for Student's quantile."""
        return self._sure[1]

    def estimate(self, index: int, name: str, unit: str, method: str, **more: Any) -> Estimate:
        """Coefficient number `index` as an Estimate."""
        value, sd, quantile = self.coefficients[index], self.sd[index], student(float(self.freedom[index]))
        return Estimate.normal(name, value, sd=sd, unit=unit, method=method, quantile=quantile, **more)

    def combined(
        self, weights: ArrayLike, name: str, unit: str, method: str, *, beside: float = 0.0, **more: Any
    ) -> Estimate:
        """A weighted sum of coefficients as an Estimate; `beside` is a standard deviation that the data do not know.

        Each residual counts by what it would be, had the fit not followed it: over one less its leverage (MacKinnon and
        White 1985). On simulated joints that makes intervals which hold 91 % hold 94 %.
        """
        form = np.asarray(weights, dtype=float) @ self.projection
        sd, freedom = mean_uncertainty(len(form) * form * self.residual / (1 - self.leverage))
        sd *= math.sqrt(self.recurring)
        restored = NOISE_UNSURE * float(np.asarray(weights) @ self.restored)
        value, sd = float(np.asarray(weights) @ self.coefficients), math.hypot(sd, beside, restored)
        return Estimate.normal(name, value, sd=sd, unit=unit, method=method, quantile=student(freedom), **more)


def _influenced(form: Array, residual: Array, independent: float, terms: int) -> tuple[float, float]:
    """Standard deviation of a linear form of the data, and its degrees of freedom."""
    sd, freedom = mean_uncertainty(len(residual) * form * residual)
    return sd * math.sqrt(independent / max(1.0, independent - terms)), freedom


def student(freedom: float) -> float:
    """Two-sided 95 % quantile of Student's t with `freedom` degrees of freedom."""
    from scipy.special import stdtrit

    return float(stdtrit(freedom, 0.975))


def correlation_time(series: ArrayLike) -> float:
    """How many neighbouring samples tell the same story?

    ``tau = 1 + 2 sum_k rho_k``, summed up to the first autocorrelation that is not positive; n samples are then worth
    n / tau independent ones.

    Parameters
    ----------
    series : array_like, shape (n,)
        Samples on a uniform clock.

    Returns
    -------
    float
        In samples; 1 for white noise, ``(1 + rho) / (1 - rho)`` for a first-order autoregression.

    Examples
    --------
    >>> correlation_time([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])
    1.0
    """
    correlation = autocorrelation(np.asarray(series, dtype=float))
    negative = np.flatnonzero(correlation <= 0)
    return float(1 + 2 * correlation[: negative[0] if len(negative) else None].sum())


def autocorrelation(series: Array) -> Array:
    """Of a series about its mean, at lags of one sample and more, each sum over that of all; zeros of a constant."""
    from scipy.fft import irfft, next_fast_len, rfft

    values = series - series.mean()
    power = float(values @ values)
    if power == 0:
        return np.zeros(len(values) - 1)
    size = next_fast_len(2 * len(values), real=True)
    return np.asarray(irfft(np.abs(rfft(values, size)) ** 2, size)[1 : len(values)] / power)


def recurrence(series: Array) -> float:
    """By how many samples one counts that comes again later: ``1 + 2 sum_m rho_m`` over later lags that stand out.

    What an encoder's counts leave of a motion is the same each time that the motion is: eight cycles of it are one.

    Examples
    --------
    >>> noise = np.random.default_rng(0).standard_normal(4000)
    >>> recurrence(noise), round(recurrence(np.tile(noise[:500], 8)), 1)
    (1.0, 8.0)
    """
    correlation = autocorrelation(series)
    count, after = len(series), np.flatnonzero(correlation <= 0)
    if not len(after):
        return 1.0
    lags = np.arange(1, len(correlation) + 1)
    share = 1 - lags / count
    again = (correlation > share * np.maximum(RECURS, RECURRED / np.sqrt(count * share))) & (lags > after[0])
    peaks = [
        correlation[lobe].max()
        for lobe in np.split(np.arange(len(lags)), np.flatnonzero(np.diff(again)) + 1)
        if again[lobe[0]]
    ]
    return float(1 + 2 * sum(peaks))


def mean_uncertainty(series: ArrayLike) -> tuple[float, float]:
    """How sure is the mean of a series whose neighbours are correlated?

    The long-run variance by equally weighted cosines (Mueller 2007; Lazarus, Lewis, Stock and Watson 2018): with
    ``L_j = sqrt(2/n) sum_t x_t cos(pi j (t - 1/2) / n)``, ``var(mean) = sum_j L_j^2 / g_j / (n q)``, j = 1..q, and
    ``(mean - truth) / sd`` is about Student's t with q degrees of freedom. The number of cosines is chosen from the
    series itself, ``q = (n / tau)^(2/3)`` with its correlation time tau, at any sampling rate.

    A short series seems less correlated than it is, for its own mean is taken off. The correlation ``rho`` of the
    first-order autoregression of that tau is raised by its bias, ``(1 + 3 rho) / n`` (Kendall 1954), and by half a
    standard error; ``g_j = (1 - rho)^2 / (1 - 2 rho cos(pi j / n) + rho^2)`` is that autoregression's spectrum at each
    cosine over that at zero, where the mean lives. Simulated, the 95 % interval holds the truth 92 times in 100 or more
    for n >= 8 and rho <= 0.5, and 86 times at rho = 0.8; 30 values make that 92.

    Parameters
    ----------
    series : array_like, shape (n,)
        Samples or values per cycle, in order.

    Returns
    -------
    sd : float
        Standard deviation of the mean; infinite for one value.
    freedom : float
        Degrees of freedom of that standard deviation.

    Examples
    --------
    >>> sd, freedom = mean_uncertainty(np.random.default_rng(0).standard_normal(10000))
    >>> bool(0.008 < sd < 0.012), freedom > 100
    (True, True)
    """
    from scipy.fft import dct

    values = np.asarray(series, dtype=float)
    count = len(values)
    if count < 2:
        return math.inf, 1.0
    tau = correlation_time(values)
    rho = (tau - 1) / (tau + 1)
    rho += (1 + 3 * rho) / count + HALF_ERROR * math.sqrt((1 - rho**2) / count)
    rho = min(rho, 1 - 2 / count)  # no longer than the series
    cosines = round(min(count - 1.0, max(2.0, (count * (1 - rho) / (1 + rho)) ** (2 / 3))))
    lowest = dct(values - values.mean(), type=2)[1 : cosines + 1] / math.sqrt(2 * count)
    fall = (1 - rho) ** 2 / (1 - 2 * rho * np.cos(np.pi * np.arange(1, cosines + 1) / count) + rho**2)
    return math.sqrt(float(np.mean(lowest**2 / fall)) / count), float(cosines)


def mean_of_cycles(
    name: str, values: ArrayLike, *, unit: str, method: str, checks: tuple[str, ...] = (), of: str = "cycle"
) -> Estimate:
    """Mean over cycles, its interval from the scatter between them.

    Parameters
    ----------
    name, unit, method : str
        As in :class:`Estimate`.
    values : array_like, shape (n,)
        One value per cycle, in order; cycles without a value are NaN and left out.
    checks : tuple of str
        What else was checked.
    of : str
        What the values are of, where it is not cycles.

    Returns
    -------
    Estimate
        With the status in words where fewer than eight cycles carry it; one cycle has an infinite interval.

    Raises
    ------
    EstimateError
        No cycle has a value.

    Examples
    --------
    >>> mean_of_cycles("level", [1.0, 1.1, 0.9, 1.0, 1.05], unit="N", method="mean of cycles").status
    'only 5 cycles: the interval is crude'
    """
    present = np.asarray(values, dtype=float)
    present = present[np.isfinite(present)]
    count = len(present)
    if count == 0:
        raise EstimateError(
            f"no cycle gives a {name}", "one cycle at least must slide both ways", "give a longer record"
        )
    sd, freedom = mean_uncertainty(present)
    if count == 1:
        status, check = Status(f"only 1 {of}: how sure it is can not be told"), f"1 {of}"
    else:
        status = Status(*([Doubt.few(count, of)] if count < FEW_CYCLES else []))
        scatter = f"{present.std(ddof=1):.3g}{'' if unit == '1' else ' ' + unit}"
        check = f"{count} {of}s, scatter between them {scatter}"
    more: dict[str, Any] = {"quantile": student(freedom), "status": status, "checks": (check, *checks)}
    return Estimate.normal(name, present.mean(), sd=sd, unit=unit, method=method, **more)


def relative_swing(values: Array) -> float:
    """Standard deviation over the mean of what is finite; none of none, and of what has no mean."""
    finite = values[np.isfinite(values)]
    mean = abs(float(np.mean(finite))) if len(finite) else 0.0
    return float(np.std(finite)) / mean if mean else 0.0


def disagreement(estimates: Sequence[Estimate]) -> float:
    """How far estimates of one quantity differ, over what their own standard deviations allow: 1 where they agree."""
    values, sds = _values(estimates)
    weights = 1 / sds**2
    mean = float(weights @ values / weights.sum())
    return math.sqrt(float(weights @ (values - mean) ** 2) / (len(values) - 1))


def weighted_mean(estimates: Sequence[Estimate], *, of: str, status: str = "ok") -> Estimate:
    """One answer of several estimates of one quantity: their mean by weight, its interval wider where they disagree.

    Parameters
    ----------
    estimates : sequence of Estimate
        One or more, of the same unit; the first gives the name.
    of : str
        What each is of, in the plural ("releases").
    status : str
        The answer's.

    Examples
    --------
    >>> each = [Estimate.normal("friction", value, sd=0.02, unit="N", method="") for value in (1.00, 1.02, 1.01)]
    >>> print(weighted_mean(each, of="releases"))
    friction 1.01 N (95 %: 0.99 to 1.03)
    """
    first = estimates[0]
    if len(estimates) == 1:
        return replace(first, status=status)
    values, sds = _values(estimates)
    weights, excess = 1 / sds**2, disagreement(estimates)
    mean = float(weights @ values / weights.sum())
    quantile = student(len(values) - 1) if excess > 1 else NORMAL_95
    return Estimate.normal(
        first.name,
        mean,
        sd=max(1.0, excess) / math.sqrt(float(weights.sum())),
        unit=first.unit,
        method=f"weighted mean of {len(values)} {of}",
        quantile=quantile,
        status=status,
        checks=(f"they differ by {excess:.2g} times what their own intervals allow",),
    )


def mixture(estimates: Sequence[Estimate], weights: Array) -> Estimate:
    """One answer of several that exclude each other, each as likely as its weight: the interval is that of them all.

    Examples
    --------
    >>> two = [Estimate.normal("friction", value, sd=0.01, unit="N", method="") for value in (1.0, 2.0)]
    >>> print(mixture(two, np.array([0.5, 0.5])))
    friction 1.5 N (95 %: 1.0 to 2.0)
    """
    from scipy.special import ndtr

    centres, sds = _values(estimates)
    value = float(weights @ centres)
    sd = math.sqrt(float(weights @ (sds**2 + (centres - value) ** 2)))
    spreads = np.array([(one.interval[1] - one.interval[0]) / (2 * NORMAL_95) for one in estimates])  # by Student's t
    spreads = np.maximum(spreads, sds)
    reach = np.linspace(min(centres - 5 * spreads), max(centres + 5 * spreads), 2000)
    low, high = np.interp((0.025, 0.975), ndtr((reach[:, None] - centres) / spreads) @ weights, reach)
    ends = (min(float(low), value), max(float(high), value))
    first = estimates[int(np.argmax(weights))]
    return replace(first, value=value, interval=ends, sd=sd)


def _values(estimates: Sequence[Estimate]) -> tuple[Array, Array]:
    values, sds = (np.array([getattr(estimate, key) for estimate in estimates]) for key in ("value", "sd"))
    return values, np.maximum(sds, 1e-12 * max(1e-300, float(np.abs(values).max())))


def least_squares(
    design: ArrayLike, data: ArrayLike, *, instruments: ArrayLike | None = None, noise: ArrayLike | None = None
) -> LeastSquares:
    """Linear least squares whose uncertainties hold for correlated, uneven residuals.

    ``b = (X'X)^-1 X'y``. Each sample's influence on b is ``psi_t = n (X'X)^-1 x_t u_t`` with residual u; b varies as
    the mean of psi does, so :func:`mean_uncertainty` of psi is its standard deviation. It is scaled by
    ``sqrt(m / (m - p))``, m the number of independent samples, for the p coefficients fitted.

    With instruments, ``b = (Z'X)^-1 Z'y``: columns that go with those of the design and know nothing of the noise in
    them, which would else pull the coefficients towards zero (Reiersol 1945). Where nobody has such columns but the
    power of the noise E in the design is, ``b = (X'X - E'E)^-1 X'y`` (Fuller 1987, section 2.2). It counts as known to
    a tenth in :meth:`LeastSquares.combined`, and as no more than three quarters of the power of any sum of columns.

    Parameters
    ----------
    design : array_like, shape (n, p)
        One column per coefficient.
    data : array_like, shape (n,)
        What the columns explain, in order of time.
    instruments : array_like, shape (n, p), optional
        One for each column; the columns themselves where left out.
    noise : array_like, shape (p, p), optional
        ``E'E`` of the noise of the columns; none where left out.

    Returns
    -------
    LeastSquares

    Raises
    ------
    EstimateError
        Columns that can not be told apart.

    Examples
    --------
    >>> line = least_squares(np.column_stack([np.arange(50.0), np.ones(50)]), 2 * np.arange(50.0) + 1)
    >>> line.coefficients.round(6).tolist()
    [2.0, 1.0]
    """
    columns, values = np.asarray(design, dtype=float), np.asarray(data, dtype=float)
    count, terms = columns.shape
    lengths = np.linalg.norm(columns, axis=0)
    if count <= terms or not np.all(lengths > 0):
        raise EstimateError(
            f"{count} samples and a column of zeros" if count > terms else f"{count} samples for {terms} coefficients",
            "every coefficient needs motion that shows it",
            "give a record with more motion",
        )
    unit = columns / lengths
    known = unit if instruments is None else np.asarray(instruments, dtype=float)
    sizes = np.linalg.norm(known, axis=0)
    if not np.all(sizes > 0):
        raise EstimateError("an instrument of zeros", "every column needs an instrument", "leave the term out")
    noisy = np.zeros((terms, terms)) if noise is None else np.asarray(noise, dtype=float) / np.outer(lengths, lengths)
    inner = (known / sizes).T @ unit
    condition = math.sqrt(float(np.linalg.cond(inner)))
    if condition > INSEPARABLE:
        raise EstimateError(
            f"the regression's condition number is {condition:.3g}",
            "the columns must be told apart",
            "leave a term out, or give a record whose speed and acceleration vary more",
        )
    if noisy.any():
        noisy *= min(1.0, MOST_NOISE / float(np.abs(np.linalg.eigvals(np.linalg.solve(inner, noisy))).max()))
    inverse = np.linalg.inv(inner - noisy)
    projection = inverse @ (known / sizes).T
    scaled = projection @ values
    residual = values - unit @ scaled
    independent = count / correlation_time(residual)
    leverage = np.einsum("ij,ji->i", unit, projection)
    leverage = np.clip(leverage * count / independent, 0.0, MOST_LEVERAGE)
    influence = projection / lengths[:, None]
    restored = inverse @ noisy @ scaled / lengths
    return LeastSquares(scaled / lengths, residual, condition, independent, influence, leverage, restored)


def follows(measured: Array, model: Array) -> float:
    """Share of the motion that a model follows: ``100 (1 - |y - m| / |y - mean y|)`` %, an offset left out.

    Ljung, System Identification (1999), section 16.4, as a comparison of models is commonly rated.

    Examples
    --------
    >>> wave = np.sin(np.linspace(0, 20, 1000))
    >>> round(follows(wave, 0.9 * wave), 1)
    90.0
    """
    both = np.isfinite(measured) & np.isfinite(model)
    residual, whole = (measured - model)[both], measured[both]
    size = float(np.linalg.norm(whole - whole.mean()))
    return 100 * (1 - float(np.linalg.norm(residual - residual.mean())) / size) if size else 0.0


def repeating(number: Rows, values: Array) -> Array:
    """That part of values which repeats with the part of a way or a cycle; zeros where none surely does.

    Means over each part are compared between the earlier half and the later one: noise of one half knows nothing of the
    other's, so that their covariance is the variance of what repeats, and their correlation says how surely it does
    (the transform of Fisher 1921).

    Parameters
    ----------
    number : ndarray of int, shape (n,)
        Of `BINS`, that which each value is of.
    values : ndarray, shape (n,)
        In order of time.

    Returns
    -------
    ndarray, shape (BINS,)

    Examples
    --------
    >>> number = np.tile(np.arange(BINS), 40)
    >>> noise = np.random.default_rng(0).normal(0, 0.1, number.size)
    >>> repeating(number, noise)[[0, -1]].tolist(), repeating(number, noise + (number > 7))[[0, -1]].round(1).tolist()
    ([0.0, 0.0], [-0.5, 0.5])
    """
    early = np.arange(len(number)) < len(number) // 2
    counts = np.array([np.bincount(number[half], minlength=BINS) for half in (early, ~early)])
    sums = np.array([np.bincount(number[half], values[half], minlength=BINS) for half in (early, ~early)])
    weights = np.sqrt(counts[0] * counts[1])
    total = float(weights.sum())
    nothing, independent = np.zeros(BINS), total**2 / max(float(weights @ weights), 1.0)
    if independent < FEWEST:
        return nothing
    means = sums / np.maximum(counts, 1)
    means -= (means @ weights / total)[:, None]
    common, spread = float(weights @ (means[0] * means[1])), math.sqrt(math.prod(means**2 @ weights))
    if common <= 0 or math.atanh(min(common / spread, ALIKE)) * math.sqrt(independent - 3) <= REPEATS:
        return nothing
    middle = np.where(weights > 0, means.mean(axis=0), 0.0)
    return np.asarray(middle * math.sqrt(common / float(weights @ middle**2)))
