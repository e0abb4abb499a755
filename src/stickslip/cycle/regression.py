"""Which inertia, viscous and Coulomb friction explain a force?"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from stickslip.arrays import Array, Rows
from stickslip.balance.motion import is_measured, require_fit
from stickslip.errors import EstimateError
from stickslip.estimate import Estimate, Result, Status
from stickslip.record.record import Record
from stickslip.signals.derivatives import Derivative, Filter, differentiate, smooth
from stickslip.signals.interpolate import without_delays
from stickslip.signals.noise import noise_level
from stickslip.statistics import FEW_INDEPENDENT, LeastSquares, least_squares
from stickslip.units import parse_value

SIGNALS = ("force", "load", "friction")
LEAST = 200  # samples
HELD = 0.99  # share of the force's power that the band holds, its noise taken off
WIDER = 2.0  # times the frequency that holds it, so that the smoother does not cut into the motion
OVERSAMPLED = 10  # samples per cycle of the bandwidth that are kept for the regression
BIASED = 0.01  # share of noise in the power of a column above which its coefficient is visibly low


@dataclass(frozen=True, eq=False, repr=False)
class Regression(Result):
    """Coefficients of a force balance.

    Attributes
    ----------
    inertia : Estimate
        Moving mass [kg], or moment of inertia [kg m^2] where the motion is an angle.
    viscous, coulomb : Estimate
        Force per speed [N s/m], and dry friction [N]; the mean of both directions where they were let differ.
    offset : Estimate or None
        Constant force [N]; None in the asymmetric regression, which can not tell it from uneven dry friction.
    stiffness : Estimate or None
        Force per displacement [N/m], where it was asked for.
    viscous_forward, viscous_back, coulomb_forward, coulomb_back : Estimate or None
        Per direction, where they were let differ.
    residual : float
        Norm of what is left over the norm of the force, both in the band of the regression.
    time, measured, explained : ndarray, shape (n,)
        Time [s], the force in the band, and what the regression makes of it.
    bandwidth : float
        Frequency [Hz] (-3 dB) to which force and columns alike were smoothed.
    condition : float
        Condition number of the columns, each scaled to unit length.
    signal : str
        The channel that was explained.
    status : str
        "ok", or in words what to beware of.
    """

    inertia: Estimate
    viscous: Estimate
    coulomb: Estimate
    offset: Estimate | None
    stiffness: Estimate | None
    viscous_forward: Estimate | None
    viscous_back: Estimate | None
    coulomb_forward: Estimate | None
    coulomb_back: Estimate | None
    residual: float
    time: Array
    measured: Array
    explained: Array
    bandwidth: float
    condition: float
    signal: str
    status: str


def regress_friction(
    record: Record,
    *,
    signal: str | None = None,
    symmetric: bool = True,
    stiffness: bool = False,
    bandwidth: float | str | None = None,
) -> Regression:
    r"""Which inertia, viscous and Coulomb friction explain a measured force?

    By least squares on ``force = M a + Fv v + Fc sign(v) + offset`` (Janot, Gautier and Brunot 2019, the inverse
    dynamic model of a joint), or with a viscous and a Coulomb term for each direction. Noise is kept out and no bias
    let in by one rule: the force and every column, the sign of the velocity too, go through the same smoother without
    delay (that of :func:`differentiate`), so that the balance holds between them as it holds between the raw ones.
    Its bandwidth is twice the frequency below which 99 % of the force's power lies, the power of its broadband noise
    taken off, and no wider than gives the acceleration with the least error. The sign is that of the velocity at its
    own best bandwidth.

    The intervals hold for correlated residuals (see :func:`stickslip.statistics.mean_uncertainty`).

    Parameters
    ----------
    record : Record
        With the force, and ``x`` (or ``theta``) or ``v``; ``v`` and ``a`` are used where they were measured. Delays
        stated for them are taken out first.
    signal : {"force", "load", "friction"}, optional
        The channel to explain; the first of these that the record has.
    symmetric : bool
        Whether both directions share their coefficients.
    stiffness : bool
        Whether a term in the displacement is fitted too.
    bandwidth : float or str, optional
        Frequency of -3 dB [Hz] of the smoother; by the rule above when not given.

    Returns
    -------
    Regression

    Raises
    ------
    RecordError
        A channel is missing, broken or too short, or the units of force and motion do not belong together.
    EstimateError
        No motion, motion in one direction only, or coefficients that the motion can not tell apart.

    Examples
    --------
    >>> t = np.arange(8000) / 1000
    >>> x = 0.1 * np.sin(2 * np.pi * 0.5 * t) + 0.02 * np.sin(2 * np.pi * 1.7 * t)
    >>> v, a = np.gradient(x, 1e-3), np.gradient(np.gradient(x, 1e-3), 1e-3)
    >>> noise = np.random.default_rng(0).normal(0, 0.3, t.size)
    >>> force = 3.0 * a + 5.0 * v + 2.0 * np.sign(v) + 0.5 + noise
    >>> regression = regress_friction(Record.of({"x": x, "force": force}, fs=1000))
    >>> round(regression.inertia.value, 1), round(regression.coulomb.value, 1), regression.offset.includes(0.5)
    (3.0, 2.0, True)
    """
    question = "the regression of a force"
    name = _signal(record, signal, question)
    record = without_delays(record, name, *_measured(record), question=question)
    sources = _sources(record, name, stiffness, question)
    width = _bandwidth(record, name, sources, bandwidth)
    smoother = Filter("smoother", record.fs, width)
    made = {key: smoother.apply(values, {order: 1.0}) for key, (values, order) in sources.items()}
    velocity = _best(sources["v"][0], record.fs, sources["v"][1]).values
    columns = _columns(made, velocity, smoother, symmetric)
    margin = max(1, round(record.fs / width))
    step = max(1, int(record.fs / (OVERSAMPLED * width)))
    rows = np.arange(margin, len(record) - margin, step)
    _refuse_one_way(velocity[rows], len(rows), record)
    force = smoother.apply(record[name], {0: 1.0})[rows]
    fit = least_squares(np.column_stack([column[rows] for column in columns.values()]), force)
    noisy = _noise_share(sources["a"], smoother, record.fs, columns["inertia"][rows])
    return _answer(record, name, fit, list(columns), force, rows, width, noisy)


def _signal(record: Record, signal: str | None, question: str) -> str:
    if signal is not None and signal not in SIGNALS:
        raise EstimateError(f"signal = '{signal}'", f"it is one of {', '.join(SIGNALS)}", "choose one, or leave it out")
    name = signal or next((name for name in SIGNALS if name in record), "force")
    record.require_clean(name, question=question, samples=LEAST)
    if np.ptp(record[name]) == 0:
        raise EstimateError(
            f"channel {name} never changes", f"{question} needs a force that does", "check the sensor and its column"
        )
    return name


def _position(record: Record) -> str:
    return next((name for name in ("x", "theta") if name in record), "x")


def _measured(record: Record) -> list[str]:
    """The channels of the motion that were measured, along a path or round an axis."""
    motion = ["theta"] if _position(record) == "theta" else ["x", "v", "a"]
    return [name for name in motion if is_measured(record, name)]


def _sources(record: Record, name: str, stiffness: bool, question: str) -> dict[str, tuple[Array, int]]:
    """For displacement (if asked for), velocity and acceleration: the channel it comes from and the order to take."""
    position = _position(record)
    known = _measured(record)
    if known in ([], ["a"]):
        record.require(position, question=question)
    record.require_clean(*known, name, question=question, samples=LEAST)
    require_fit(record, name, length="rad" if position == "theta" else "m", question=question)
    for channel in known:
        if np.ptp(record[channel]) == 0:
            raise EstimateError(
                f"channel {channel} never changes", f"{question} needs motion", "check the sensor and its column"
            )
    velocity = (record["v"], 0) if "v" in known else (record[position], 1)
    acceleration = (record["a"], 0) if "a" in known else (velocity[0], velocity[1] + 1)
    sources = {"v": velocity, "a": acceleration}
    if stiffness:
        record.require(position, question=f"{question} with a stiffness")
        sources["x"] = (record[position] - record[position].mean(), 0)
    return sources


def _bandwidth(record: Record, name: str, sources: dict[str, tuple[Array, int]], given: float | str | None) -> float:
    if given is not None:
        width, low, high = parse_value(given, "Hz"), 10 * record.fs / len(record), 0.45 * record.fs
        if not low <= width <= high:
            raise EstimateError(
                f"bandwidth = {given} Hz", f"this record allows {low:.3g} to {high:.3g} Hz", "choose one in between"
            )
        return width
    values, order = sources["a"]
    best = _best(values, record.fs, order).bandwidth
    widest = WIDER * _holding(record[name], record.fs)
    return max(min(widest, best, 0.2 * record.fs), 10 * record.fs / len(record))


def _holding(values: Array, fs: float) -> float:
    """Frequency [Hz] below which 99 % of the power about the mean lies, less that of the broadband noise."""
    from scipy.fft import next_fast_len, rfft

    window = np.hanning(len(values))
    size = next_fast_len(len(values), real=True)
    power = np.abs(rfft((values - values.mean()) * window, size)) ** 2
    floor = noise_level(values, fs) ** 2 * float(window @ window)
    total = np.cumsum(power - floor)
    peak = float(total.max())
    return float(np.argmax(total >= HELD * peak) * fs / size)


def _best(values: Array, fs: float, order: int) -> Derivative:
    """The derivative of that order at the bandwidth that gives it with the least error."""
    return differentiate(values, fs, order=order) if order else smooth(values, fs)


def _columns(made: dict[str, Array], velocity: Array, smoother: Filter, symmetric: bool) -> dict[str, Array]:
    columns = {"inertia": made["a"]}
    if symmetric:
        columns["viscous"] = made["v"]
        columns["coulomb"] = smoother.apply(np.sign(velocity), {0: 1.0})
        columns["offset"] = np.ones(len(velocity))
    else:
        for side, there in (("forward", velocity > 0), ("back", velocity < 0)):
            columns[f"viscous_{side}"] = smoother.apply(np.where(there, velocity, 0.0), {0: 1.0})
            columns[f"coulomb_{side}"] = smoother.apply(np.where(there, np.sign(velocity), 0.0), {0: 1.0})
    if "x" in made:
        columns["stiffness"] = made["x"]
    return columns


def _refuse_one_way(velocity: Array, rows: int, record: Record) -> None:
    if rows < LEAST // 10:
        raise EstimateError(
            f"{rows} samples are left of {len(record)}", f"{LEAST // 10} are needed", "give a longer record"
        )
    fastest = float(np.abs(velocity).max())
    if min(np.max(velocity), -np.min(velocity)) < 0.05 * fastest:
        raise EstimateError(
            f"the speed runs from {velocity.min():.3g} to {velocity.max():.3g} and does not reverse",
            "dry friction is told from a constant force by motion both ways",
            "give a record that goes forward and back",
        )


def _noise_share(source: tuple[Array, int], smoother: Filter, fs: float, column: Array) -> float:
    """Share of noise in the power of the acceleration, which lowers the inertia by as much."""
    values, order = source
    passed = np.abs(smoother.response(np.linspace(0, fs / 2, 8193), {order: 1.0})) ** 2
    return float(noise_level(values, fs) ** 2 * passed.mean() / np.mean(column**2))


UNITS = {"inertia": "kg", "viscous": "N s/m", "coulomb": "N", "offset": "N", "stiffness": "N/m"}
TURNING = {"inertia": "kg m^2", "viscous": "N m s/rad", "coulomb": "N m", "offset": "N m", "stiffness": "N m/rad"}
WORDS = {"inertia": "inertia", "viscous": "viscous friction", "coulomb": "Coulomb friction", "offset": "constant force",
         "stiffness": "stiffness"}  # fmt: skip
PERHAPS = ("offset", "stiffness", "viscous_forward", "viscous_back", "coulomb_forward", "coulomb_back")
POSITIVE = ("inertia", "coulomb", "stiffness")  # viscous friction may fall with the speed


def _answer(
    record: Record, name: str, fit: LeastSquares, terms: list[str], force: Array, rows: Rows, width: float, noisy: float
) -> Regression:
    turning = record.channels[name].unit == "N m"
    method = f"least squares below {width:.3g} Hz"
    checks = (
        f"condition number {fit.condition:.3g}",
        f"residuals are worth {fit.independent:.0f} independent samples",
        f"noise is {100 * noisy:.2g} % of the acceleration's power",
    )
    worries = []
    if fit.independent < FEW_INDEPENDENT * len(terms):
        worries.append(f"only {fit.independent:.0f} independent samples for {len(terms)} coefficients")
    if noisy > BIASED:
        worries.append(f"noise in the acceleration lowers the inertia by about {100 * noisy:.2g} %")
    status = Status(*worries)
    known: dict[str, Estimate] = {}
    for index, term in enumerate(terms):
        word, _, side = term.partition("_")
        unit = (TURNING if turning else UNITS)[word]
        estimate = fit.estimate(index, f"{WORDS[word]} {side}".strip(), unit, method, status=status, checks=checks)
        known[term] = estimate.within(0.0) if word in POSITIVE else estimate
    for word in ("viscous", "coulomb"):
        if word not in known:
            known[word] = _mean_of_both(known[f"{word}_forward"], known[f"{word}_back"], WORDS[word])
    return Regression(
        inertia=known["inertia"],
        viscous=known["viscous"],
        coulomb=known["coulomb"],
        **{name: known.get(name) for name in PERHAPS},
        residual=float(np.linalg.norm(fit.residual) / np.linalg.norm(force)),
        time=record.start + rows / record.fs,
        measured=force,
        explained=force - fit.residual,
        bandwidth=width,
        condition=fit.condition,
        signal=name,
        status=status,
    )


def _mean_of_both(forward: Estimate, back: Estimate, name: str) -> Estimate:
    doubtful = forward if forward.status != "ok" else back
    if not (forward.known and back.known):
        return replace(forward if not forward.known else back, name=name)
    low, high = ((a + b) / 2 for a, b in zip(forward.interval, back.interval, strict=True))
    mean, sd = (forward.value + back.value) / 2, (forward.sd + back.sd) / 2
    method = f"mean of both directions, {forward.method}"
    return Estimate(name, mean, (low, high), sd, forward.unit, method, doubtful.status, forward.checks)
