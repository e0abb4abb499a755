"""Does friction turn beside the velocity because a sensor is late, or because the contact gives way?"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from stickslip.arrays import Array, Rows
from stickslip.balance.lag import sensor_delay
from stickslip.balance.likely_contact import LikelyContact, likely_contact
from stickslip.balance.motion import is_measured, slid_on
from stickslip.compiled import FAST, compiled
from stickslip.errors import EstimateError, StickslipError
from stickslip.estimate import NORMAL_95, Estimate, Result
from stickslip.record.channels import Channel
from stickslip.record.record import Record
from stickslip.signals.derivatives import smooth
from stickslip.signals.interpolate import without_delays
from stickslip.signals.pieces import turning_points
from stickslip.statistics import mean_of_cycles

QUESTION = "lag or compliance"
CAUSES = ("sensor lag", "contact compliance", "both", "neither", "cannot be told")
LEAST = 64  # samples
MOST = 1 << 17  # samples that are looked at, in the middle of a record that is longer
FEW = 4  # reversals
LATEST = 0.2  # of the time between two reversals: lags are looked for within
LAGS, SLIPS = 21, 14  # of the grid
EXPLAINED = 0.05  # share of the friction's variance that the best fit may leave
FAR = 0.15  # the same where the lag is held by the accelerometer: the smoothing moves a rigid contact's reversals
WORSE = 1.5  # times what both leave: a single cause that leaves more does not explain it; less may be a damper's
DAMPED = 0.08  # of a passage from one side's friction to the other's: a damper in the contact passes for such a lag
STIFFENED = 0.12  # share by which a damper in the contact, of which the element knows nothing, makes it seem stiffer
CERTAIN = 0.2  # samples: a lag that is smaller is none
RIGID = 0.01  # of the least give
NOISY = 3.0  # times the displacement's noise: a smaller give is none


@dataclass(frozen=True, eq=False, repr=False)
class Cause(Result):
    """Why friction does not turn with the velocity.

    Attributes
    ----------
    cause : str
        "sensor lag", "contact compliance", "both", "neither", or "cannot be told".
    reason : str
        The evidence, in words and numbers.
    lag : Estimate
        By how much the displacement comes after the force [s]; negative where the force comes later.
    give : Estimate
        Displacement over which the friction goes from zero to its sliding value [m].
    stiffness : Estimate or None
        Of the contact [N/m], the sliding friction over the give; None where none is seen. Where the contact can be
        fitted it is that of :func:`contact_stiffness`, else the element's, which knows of no damper in the contact:
        its interval then reaches down by the 12 % that one may make it seem stiffer.
    mimicked : float
        What velocity the lag would put beside a reversal, as a share of the velocity at which the contact lets go
        after one (thesis, equation 3.4): so much of the transition speed would be the sensor's. NaN where
        there is none.
    left : tuple of float
        Root mean square of the friction [N] that is left without a cause, by a lag, by compliance, and by both.
    status : str
        "ok", or in words what to beware of.
    """

    cause: str
    reason: str
    lag: Estimate
    give: Estimate
    stiffness: Estimate | None
    mimicked: float
    left: tuple[float, float, float, float]
    status: str

    def __repr__(self) -> str:
        return f"{self.cause}: {self.reason}\n{super().__repr__()}"


def lag_or_compliance(record: Record, *, contact: str | None = None) -> Cause:
    r"""Is a sensor late, or does the contact give way?

    Either makes the friction turn beside the velocity, and a lag that is not known passes for 22 to 37 % of a
    transition speed. But a late sensor shifts all of the curve by one time, whatever the speed, and the friction still
    jumps; a compliant contact begins to turn with the velocity and needs a displacement, :math:`2 Y`, to
    come to the other side (thesis, section 3.3). So the friction is fitted by an element that slides at :math:`f_k`
    and before that gives way,

    .. math:: f = f_k\, y / Y, \quad \dot y = \dot x(t + \tau) \text{ within } |y| \le Y

    behind the load cell's mount where that is stated, with a lag :math:`\tau`, with a give Y, with both and with
    neither. What a single cause leaves beyond what both do, and what each estimate's interval says, decide. Of a
    record of more than 131072 samples the middle is looked at; the reason says which.

    Parameters
    ----------
    record : Record
        ``x``, and a ``load`` or ``friction`` that was measured, or was found by :func:`friction_force`. Stated delays
        are taken out first, so that what is found is what they do not explain.
    contact : {"ground", "base"}, optional
        What the mass slides on; as :func:`friction_force` was told, or the ground.

    Returns
    -------
    Cause

    Raises
    ------
    RecordError
        A channel is missing, not finite, or too short.
    EstimateError
        Fewer than four reversals.

    Examples
    --------
    >>> import stickslip as ss
    >>> slider = ss.Oscillator(
    ...     mass=2.42, stiffness=2310, law=ss.laws.CompliantContact(1.1, stiffness=192000, damping=23.9),
    ...     drive=ss.drives.HarmonicBase(1.1e-3, frequency=8.7),
    ... )
    >>> record = ss.Rig.perfect().measure(ss.simulate(slider, duration=3), fs=4000)
    >>> lag_or_compliance(record.between(2, 3)).cause
    'contact compliance'
    """
    with_cell, force = record, "load" if is_measured(record, "load") else "friction"
    names = ["x", force, *(["z"] if slid_on(record, contact) == "base" else [])]
    record = without_delays(record, *names, question=QUESTION)
    record.require_clean(*names, question=QUESTION, samples=LEAST)
    seen = _middle(record)
    place = smooth(seen["x"] - seen["z"] if "z" in names else seen["x"], seen.fs)
    blur = seen.fs / (4 * math.pi * place.bandwidth)
    noise = NOISY * float(np.median(place.sd))
    fit = _Fit(place.values, seen[force], seen.fs, seen.channels[force], noise, blur)
    if len(fit.reversals) < FEW:
        raise EstimateError(
            f"{len(fit.reversals)} reversals of the motion", f"{QUESTION} is told from {FEW}", "give a longer record"
        )
    answer = _answer(fit, _by_accelerometer(seen), with_cell)
    if len(seen) < len(record):
        sentence = f"told from the {seen.duration:.4g} s in the middle of {record.duration:.4g} s"
        answer = replace(answer, reason=f"{answer.reason}; {sentence}")
    return answer


def _middle(record: Record) -> Record:
    first = max(0, len(record) - MOST) // 2
    return record.rows(first, first + MOST)


def _likely(record: Record) -> LikelyContact | None:
    """The contact under which all sensors are most likely, where friction was found by a balance of forces."""
    try:
        return likely_contact(record)
    except StickslipError:
        return None


@dataclass(frozen=True, eq=False)
class _Fit:
    """Friction as an element makes it of a motion, seen some time later."""

    place: Array
    force: Array
    fs: float
    channel: Channel
    least: float  # give [m] that is as good as none
    blur: float  # by how much the smoothing may move a reversal [samples]

    @property
    def none(self) -> float:
        """A give [m] that is none."""
        return RIGID * self.least

    @cached_property
    def reversals(self) -> Rows:
        """Where the motion turns, after it went as far as an eighth of its range."""
        return _turns(self.place, 0.125 * float(np.ptp(self.place)))

    @cached_property
    def inside(self) -> slice:
        """Between the first reversal and the last, beyond the reach of a lag."""
        return slice(int(self.reversals[0]), int(self.reversals[-1]))

    @cached_property
    def latest(self) -> float:
        """Longest lag that is looked for [samples]."""
        return LATEST * float(np.median(np.diff(self.reversals)))

    def moved(self, lag: float) -> Array:
        """The motion `lag` samples later."""
        from scipy.ndimage import shift

        return np.asarray(shift(self.place, -lag, order=3, mode="nearest"))

    def made(self, place: Array, give: float) -> Array:
        """What the element makes of it, in shares of its sliding friction, behind the mount."""
        share = np.empty_like(place)
        _slide(place, give, share)
        return self.behind(share)

    @cached_property
    def mount(self) -> tuple[Array, Array]:
        """The load cell's, from sample to sample: asked for thousands of times in a search, it took half of it."""
        from scipy import signal

        assert self.channel.mount is not None
        discrete: Any = signal.cont2discrete
        w, ratio = 2 * math.pi * self.channel.mount[0], self.channel.mount[1]
        top, bottom, _ = discrete(([w * w], [1.0, 2 * ratio * w, w * w]), 1 / self.fs, method="foh")
        return np.ravel(top), bottom

    def behind(self, values: Array) -> Array:
        """Through the mount of the load cell."""
        if self.channel.mount is None:
            return values
        from scipy import signal

        return np.asarray(signal.lfilter(*self.mount, values))

    def design(self, lag: float, give: float, place: Array | None = None) -> Array:
        """Columns: the element, its level, and the inertia of what lies on a load cell."""
        place = self.moved(lag) if place is None else place
        columns = [self.made(place, give), np.ones(len(place))]
        if self.channel.inertia:
            columns.append(self.behind(np.gradient(np.gradient(place))))
        return np.column_stack(columns)[self.inside]

    def left(self, lag: float, give: float, place: Array | None = None) -> float:
        """Sum of squares that is left of the friction."""
        design, data = self.design(lag, give, place), self.force[self.inside]
        normal = design.T @ design + 1e-12 * np.eye(design.shape[1])
        along = design.T @ data
        return float(data @ data - along @ np.linalg.solve(normal, along))

    def best(self, lags: Array, *, gives: bool) -> tuple[float, float, float]:
        """Lag [samples] of these, or between them, give [m] where it is free, and what is left [N]."""
        from scipy import optimize

        minimize: Any = optimize.minimize
        far = max(0.25 * float(np.ptp(self.place)), 2 * self.least)
        slips = np.array([self.none, *(np.geomspace(self.least, far, SLIPS) if gives else [])])
        tried = []
        for lag in lags:
            place = self.moved(lag)
            tried += [(self.left(lag, give, place), lag, math.log(give)) for give in slips]
        start, free = np.array(min(tried)[1:]), np.array([len(lags) > 1, gives])
        scale = np.array([self.latest / LAGS, 0.3])

        def cost(step: Array) -> float:
            lag, give = start + scale * np.where(free, step, 0.0)
            return self.left(float(lag), max(self.none, math.exp(give))) if abs(lag) <= self.latest else math.inf

        if free.any():
            corners = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
            options: dict[str, Any] = {"initial_simplex": corners, "xatol": 1e-3, "maxiter": 80}
            better = minimize(cost, corners[0], method="Nelder-Mead", options=options).x
            start = start + scale * np.where(free, better, 0.0)
        lag, give = float(start[0]), max(self.none, math.exp(start[1]))
        return lag, give, math.sqrt(self.left(lag, give) / (self.inside.stop - self.inside.start))

    def level(self, lag: float, give: float) -> float:
        """Sliding friction [N] of the element."""
        return abs(float(np.linalg.lstsq(self.design(lag, give), self.force[self.inside], rcond=None)[0][0]))

    def spread(self, lag: float, give: float) -> tuple[Array, Array]:
        """Lag and give from each of some parts of the record, from one step of Gauss and Newton."""
        design, data = self.design(lag, give), self.force[self.inside]
        coefficients = np.linalg.lstsq(design, data, rcond=None)[0]
        late = (self.design(lag + 0.5, give) - self.design(lag - 0.5, give)) @ coefficients
        wide = (self.design(lag, 1.05 * give) - self.design(lag, give / 1.05)) @ coefficients / (2 * math.log(1.05))
        whole = np.column_stack([late, wide, design])
        rest = data - design @ coefficients
        edges = np.linspace(0, len(data), max(2, min(8, len(self.reversals) // 2)) + 1).astype(int)
        steps = [np.linalg.lstsq(whole[j:k], rest[j:k], rcond=None)[0][:2] for j, k in pairwise(edges)]
        return np.array([step[0] for step in steps]) + lag, give * (1 + np.array([step[1] for step in steps]))


@compiled(**FAST)
def _slide(place: Array, give: float, share: Array) -> None:
    """An element that gives way up to `give` and then slides; its friction in shares of the sliding one."""
    y = 0.0
    for t in range(place.shape[0]):
        if t > 0:
            y += place[t] - place[t - 1]
        y = min(give, max(-give, y))
        share[t] = y / give


def _turns(place: Array, least: float) -> Rows:
    """Where a motion turns back, after it went `least` at least."""
    rows = np.empty(len(place), dtype=np.intp)
    count = turning_points(place, least, rows)
    return rows[1 : max(1, count - 1)]  # without the first and the last extreme, before which it may have gone less


def _by_accelerometer(record: Record) -> Estimate | None:
    """How late the displacement is, against an accelerometer that follows the same mass."""
    if not is_measured(record, "a"):
        return None
    try:
        alignment = sensor_delay(without_delays(record, "a", question=QUESTION), channels=("x", "a"))
    except StickslipError:
        return None
    return alignment.delay if alignment.delay.status == "ok" else None


def _answer(fit: _Fit, against: Estimate | None, record: Record) -> Cause:
    """Weigh what is left by each cause."""
    late = np.linspace(-fit.latest, fit.latest, LAGS) if against is None else np.array([-against.value * fit.fs])
    fits = [fit.best(lags, gives=gives) for gives in (False, True) for lags in (np.zeros(1), late)]
    best = fits[3]
    lags, gives = fit.spread(*best[:2])
    sharp = float(np.median(np.abs(np.gradient(np.gradient(fit.place))[fit.reversals]))) * fit.fs**2
    passage = math.sqrt(4 * best[1] / sharp) if sharp > 0 else 0.0  # from one side's friction to the other's
    # a rigid contact's reversals have a corner that smoothing moves, a compliant one's have none
    unsure = DAMPED * passage if best[1] > fit.least else fit.blur / fit.fs
    lag = _lag(lags / fit.fs, best[0] / fit.fs, unsure, fit.fs, against)
    give = _give(gives, best[1])
    residuals = (fits[0][2], fits[1][2], fits[2][2], fits[3][2])
    spread = float(np.std(fit.force[fit.inside]))
    is_late = not lag.includes(0.0) and (1.0 if against else WORSE) * residuals[3] < residuals[2]
    is_soft = give.value > fit.least and give.interval[0] > 0 and WORSE * residuals[3] < residuals[1]
    cause = _named(residuals, spread, is_late=is_late, is_soft=is_soft, measured=against is not None)
    contact = _likely(record) if cause == "contact compliance" else None
    stiffness = contact.stiffness if contact else _stiffness(fit.level(*best[:2]), give) if is_soft else None
    give = _give_of(contact) if contact else give
    unstated = fit.channel.name == "load" and fit.channel.mount is None
    mimicked = abs(lag.value) / passage if is_soft and passage else math.nan
    seen = give.value if is_soft else None, mimicked if is_late else math.nan
    reason = _reason(residuals, spread, lag, *seen)
    status = "the load cell's mount is not stated: its own delay counts as negative lag" if unstated else "ok"
    return Cause(cause, reason, lag, give, stiffness, mimicked, residuals, status)


def _named(
    residuals: tuple[float, float, float, float], spread: float, *, is_late: bool, is_soft: bool, measured: bool
) -> str:
    """The cause, or that it can not be told: from what each leaves; `measured`: the accelerometer tells the lag."""
    neither, lagging, _, both = residuals
    good = math.sqrt(EXPLAINED) * spread
    if is_soft:
        certain = both < good
    elif measured:
        certain = lagging < math.sqrt(FAR) * spread
    else:
        certain = lagging < good and (is_late or neither < WORSE * both)
    names = {(True, True): "both", (True, False): CAUSES[0], (False, True): CAUSES[1], (False, False): "neither"}
    return names[is_late, is_soft] if certain else CAUSES[-1]


def _reason(residuals: tuple[float, ...], spread: float, lag: Estimate, give: float | None, mimicked: float) -> str:
    neither, lagging, soft, both = residuals
    sentence = (
        f"of the friction's {spread:.3g} N (rms) a rigid contact read without lag leaves {neither:.3g} N unexplained, "
        f"a lag alone {lagging:.3g} N, a contact that gives way {soft:.3g} N, "
        f"both together {min(both, soft, lagging):.3g} N"
    )
    sentence += (
        f"; the displacement comes {1e3 * lag.value:.3g} ms "
        f"(95 %: {1e3 * lag.interval[0]:.3g} to {1e3 * lag.interval[1]:.3g}) after the force, by {lag.method}"
    )
    if give is not None:
        sentence += f"; the contact gives way by {1e6 * give:.3g} µm before it slides"
    return sentence + (
        f"; the lag would pass for {100 * mimicked:.0f} % of the transition speed" if mimicked > 0 else ""
    )


def _give(parts: Array, value: float) -> Estimate:
    """The element's give about that of the whole, as unsure as its parts are, and as a damper leaves it."""
    give = mean_of_cycles("give of the contact", parts, unit="m", method="element fitted to each of some parts")
    half = (give.interval[1] - give.interval[0]) / 2 + abs(give.value - value)
    high = (value + half) * (1 + STIFFENED)
    return replace(give, value=value, interval=(value - half, high), sd=(high - value + half) / (2 * NORMAL_95))


def _give_of(contact: LikelyContact) -> Estimate:
    """The give of a contact that was fitted with its damper."""
    stiffness, method = contact.stiffness, "sliding friction over the likeliest stiffness"
    return _over(contact.level, stiffness, "give of the contact", "m", method, stiffness.status)


def _stiffness(level: float, give: Estimate) -> Estimate:
    unknown = f"a damper in the contact may make it seem up to {100 * STIFFENED:.0f} % stiffer: see contact_stiffness"
    return _over(level, give, "contact stiffness", "N/m", "sliding friction over give", unknown)


def _over(level: float, by: Estimate, name: str, unit: str, method: str, status: str) -> Estimate:
    """A force over an estimate."""
    low, high = (level / end if end > 0 else math.inf for end in reversed(by.interval))
    return Estimate(name, level / by.value, (low, high), level * by.sd / by.value**2, unit, method, status)


def _lag(parts: Array, value: float, open_: float, fs: float, against: Estimate | None) -> Estimate:
    """The lag, with what smoothing and a damper in the contact leave open [s] where only the friction tells it."""
    if against is not None:
        low, high = against.interval
        floor = CERTAIN / fs
        return replace(
            against,
            name="lag of the displacement",
            value=-against.value,
            interval=(min(-high, -against.value - floor), max(-low, -against.value + floor)),
            method="its phases against the accelerometer's",
        )
    lag = mean_of_cycles("lag of the displacement", parts, unit="s", method="the friction's shape at the reversals")
    half = (lag.interval[1] - lag.interval[0]) / 2 + open_
    return replace(lag, value=value, interval=(value - half, value + half), sd=half / NORMAL_95)
