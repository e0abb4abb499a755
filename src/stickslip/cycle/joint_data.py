"""What is asked of a joint's log: its torque while it slides, and the columns that may explain it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from stickslip.balance.motion import away_from, require_fit, stretches
from stickslip.errors import EstimateError, ModelError, RecordError
from stickslip.estimate import Constant, Estimate
from stickslip.record.record import Record, Step, require_record
from stickslip.signals.derivatives import differentiate, five_point_difference
from stickslip.signals.interpolate import without_delays
from stickslip.signals.noise import quantisation_step
from stickslip.statistics import LeastSquares

Array = NDArray[np.float64]

# of a stroke's length, that the window has on either side: with 0.15 the accelerations of an axis fall out
SHARE = 0.08
SHORTEST = 4  # samples of the window on either side
REACH = 2  # samples that a difference adds to it
NOISY = 4.0  # deviations of the velocity's noise, below which it may be at rest
SLOW = 0.05  # of its fast speed (90 %): slower, static friction that falls with the speed would be taken for Coulomb's
APART = 4  # rows in the window's half: nearer ones tell the same
QUESTION = "the friction of a joint"
LEAST = 200  # samples
ROWS = 20  # instants at which it slides


@dataclass(frozen=True)
class Window:
    """A smoothing window of compact support, so that nothing beyond a stroke enters what is told within it.

    The kernel is ``(1 - (t/T)^2)^4``: the balance is weighed by functions that vanish with three derivatives at their
    ends (the modulating functions of Shinbrot, 1957), so that derivatives fall on the window and not on the noise.

    Attributes
    ----------
    half : int
        Samples on either side.
    fs : float
        Sampling rate [Hz].
    """

    half: int
    fs: float

    @cached_property
    def weights(self) -> Array:
        """The kernel, of sum one."""
        shape = (1 - (np.arange(-self.half, self.half + 1) / (self.half + 1)) ** 2) ** 4
        return np.asarray(shape / shape.sum())

    def apply(self, values: Array, order: int = 0) -> Array:
        """The derivative of that order, smoothed."""
        from scipy.signal import fftconvolve

        return np.asarray(fftconvolve(five_point_difference(values, order) * self.fs**order, self.weights, mode="same"))

    @cached_property
    def noise_of_acceleration(self) -> float:
        """Standard deviation of a second derivative for white noise of unit standard deviation."""
        impulse = np.zeros(len(self.weights) + 8)
        impulse[len(impulse) // 2] = 1.0
        return float(np.linalg.norm(self.apply(impulse, 2)))


@dataclass(frozen=True)
class Sliding:
    """When a joint slides, and which way.

    Attributes
    ----------
    side : ndarray, shape (n,)
        1 forward, -1 back, 0 at rest or too slow to be told from it.
    window : Window
        As wide as its strokes allow.
    rows : ndarray of int
        Instants whose window lies within one stroke.
    slowest : float
        Speed below which it may be at rest.
    """

    side: Array
    window: Window
    rows: NDArray[np.intp]
    slowest: float


def sliding(position: Array, fs: float) -> Sliding:
    """When does a joint surely slide?

    Where its speed is above four deviations of its noise, a twentieth of its fast speed, and one encoder count in half
    a window: slower, the error of the counts is a slope and no noise.
    """
    velocity = differentiate(position, fs)
    speed = np.abs(velocity.values)
    slowest = max(NOISY * float(np.median(velocity.sd)), SLOW * float(np.quantile(speed, 0.9)))
    begins, ends = stretches(speed > slowest)
    lengths = ends - begins
    if not len(lengths):
        raise EstimateError(
            "the joint never moves faster than its encoder's noise", "friction is told from sliding", "move it farther"
        )
    half = max(SHORTEST, int(SHARE * float(lengths @ lengths) / float(lengths.sum())))
    slowest = max(slowest, quantisation_step(position) * fs / half)
    side = np.where(speed > slowest, np.sign(velocity.values), 0.0)
    broken = (side == 0) | np.append(False, np.diff(side) != 0)
    within = away_from(broken, half + REACH)
    within[: half + REACH] = within[len(side) - half - REACH :] = False
    return Sliding(side, Window(half, fs), np.flatnonzero(within)[:: max(1, half // APART)], slowest)


@dataclass(frozen=True)
class Log:
    """What a joint's log tells, as it enters the balance.

    Attributes
    ----------
    position : ndarray, shape (n,)
        Of the joint.
    reference : ndarray or None
        What its controller was told, which knows nothing of the encoder's noise.
    sliding : Sliding
        When it slides.
    """

    position: Array
    reference: Array | None
    sliding: Sliding

    def columns(
        self, terms: tuple[str, ...], load: float, pull: tuple[float, float], *, steered: bool = False
    ) -> Array:
        r"""The balance's columns at the rows.

        Of :math:`\tau = J \ddot q + F_v \dot q + F_u |\dot q| \pm F_c + g_s \sin q + g_c \cos q +
        \mathrm{sgn}(\dot q) \mu |g| - k_d \dot e`, linear about a load part `load` and gravity's torque `pull`.

        Parameters
        ----------
        terms : tuple of str
            Of inertia, viscous, uneven, forward, back, coulomb (both alike), sine, cosine, load, damping.
        load : float
            The load part about which gravity's columns are linear.
        pull : (float, float)
            Gravity's sine and cosine part.
        steered : bool
            From the reference in place of the position: the instruments.
        """
        position = self.reference if steered and self.reference is not None else self.position
        side, window = self.sliding.side, self.sliding.window
        carried = pull[0] * np.sin(position) + pull[1] * np.cos(position)
        stronger = 1 + load * side * np.sign(carried)
        made = {
            "inertia": lambda: window.apply(position, 2),
            "viscous": lambda: window.apply(position, 1),
            "uneven": lambda: window.apply(side * five_point_difference(position, 1) * window.fs),
            "forward": lambda: window.apply(np.maximum(side, 0.0)),
            "back": lambda: window.apply(np.minimum(side, 0.0)),
            "coulomb": lambda: window.apply(side),
            "sine": lambda: window.apply(np.sin(position) * stronger),
            "cosine": lambda: window.apply(np.cos(position) * stronger),
            "load": lambda: window.apply(side * np.abs(carried)),
            "damping": lambda: self._error_rate(steered),
        }
        return np.column_stack([made[term]()[self.sliding.rows] for term in terms])

    def _error_rate(self, steered: bool) -> Array:
        """How the error of the position changes; its instrument is what inertia makes of the reference."""
        window, fs = self.sliding.window, self.sliding.window.fs
        if self.reference is None:
            raise EstimateError("no channel reference", "a controller follows one", "name the column of the reference")
        if steered:
            return window.apply(five_point_difference(self.reference, 1) * fs, 2)
        return window.apply(self.position - self.reference, 1)


# ---- what is regressed


@dataclass(frozen=True)
class JointData:
    """What is regressed: the torque at the rows, and what was stated, each with its standard deviation's column."""

    logs: tuple[Log, ...]
    torque: Array
    terms: tuple[str, ...]
    source: str
    raw: Array
    known: Array
    unsure: tuple[Array, ...] = ()
    stated: dict[str, Estimate] = field(default_factory=dict)

    @property
    def followed(self) -> bool:
        """Whether every log has the reference, whose columns are the instruments."""
        return all(log.reference is not None for log in self.logs)

    def columns(
        self, terms: tuple[str, ...], load: float, pull: tuple[float, float], *, steered: bool = False
    ) -> Array:
        """The columns of all logs, one below the other."""
        return np.concatenate([log.columns(terms, load, pull, steered=steered) for log in self.logs])

    def model(self, fit: LeastSquares, terms: tuple[str, ...], pull: tuple[float, float]) -> Array:
        """What a fit, of these logs or of others, makes of the torque."""
        share = float(fit.coefficients[terms.index("load")]) if "load" in terms else 0.0
        bare = tuple(term for term in terms if term != "load")
        columns = self.columns(bare, share, pull)
        return np.asarray(self.known + columns @ fit.coefficients[[terms.index(term) for term in bare]])


def pooled(data: Sequence[JointData]) -> JointData:
    """Several logs as one."""
    first = data[0]
    joined = {name: np.concatenate([getattr(one, name) for one in data]) for name in ("torque", "raw", "known")}
    unsure = tuple(np.concatenate(columns) for columns in zip(*(one.unsure for one in data), strict=True))
    logs = tuple(log for one in data for log in one.logs)
    return JointData(logs, terms=first.terms, source=first.source, unsure=unsure, stated=first.stated, **joined)


def joint_data(record: Record, gravity: bool | None, **given: Constant | None) -> tuple[Record, JointData]:
    """The record with its torque, and what is asked of it under what is stated."""
    require_record(record)
    constants = _constants(record, **given)
    record = _torqued(record, constants)
    return record, _data_of(record, constants, turning(record) if gravity is None else gravity)


def turning(record: Record) -> bool:
    return "theta" in record or "x" not in record


def _constants(record: Record, **given: Constant | None) -> dict[str, Estimate]:
    """The stated constants, in the units of the motion."""
    torque = "N m" if turning(record) else "N"
    stiff, damped, heavy = ("N m/rad", "N m s/rad", "kg m^2") if turning(record) else ("N/m", "N s/m", "kg")
    units = {"inertia": heavy, "kp": stiff, "kd": damped, "torque_constant": f"{torque}/A"}
    stated = {name: Estimate.stated(name, value, units[name]) for name, value in given.items() if value is not None}
    for name, constant in stated.items():
        if constant.value < 0 or (constant.value == 0 and name != "kd") or not math.isfinite(constant.value):
            raise ModelError(
                f"{name} = {constant.value:g} {constant.unit}", f"a joint's {name} is positive", f"correct {name}="
            )
    return stated


def _torqued(record: Record, constants: dict[str, Estimate]) -> Record:
    """The record with a torque, from a current where it has none; delays taken out."""
    position = "theta" if turning(record) else "x"
    used = [name for name in (position, "reference", "force", "current") if name in record]
    record.require_clean(position, *used, question=QUESTION, samples=LEAST)
    record = without_delays(record, *used, question=QUESTION, samples=LEAST)
    if "force" not in record and "current" in record and "torque_constant" in constants:
        constant = constants["torque_constant"]
        step = Step("regress_joint", {"torque_constant": constant.value}, "torque of the current")
        unit = "N m" if turning(record) else "N"
        record = record.with_channel(
            "force", constant.value * record["current"], unit=unit, source="current", step=step
        )
    if "force" in record:
        require_fit(record, "force", length="rad" if position == "theta" else "m", question=QUESTION)
        return record
    if not ("reference" in record and "kp" in constants):
        lacks = "the current's torque_constant" if "current" in record else "kp" if "reference" in record else "force"
        raise RecordError(
            f"no torque: the record has {', '.join(record)}, and {lacks} is missing",
            f"{QUESTION} needs a torque: measured, of a current with its constant, or of a controller with its gains",
            "name the column of the torque (force=), give --torque-constant of a current, or --kp with the reference",
        )
    return record


def _data_of(record: Record, constants: dict[str, Estimate], gravity: bool) -> JointData:
    position = record["theta" if turning(record) else "x"]
    followed = "reference" in record
    reference = record["reference"] if followed else None
    if np.ptp(position) == 0:
        raise EstimateError("the position never changes", f"{QUESTION} needs motion", "check the column")
    slides = sliding(position, record.fs)
    _refuse_still(slides, record)
    log = Log(position, reference, slides)
    window, rows = slides.window, slides.rows
    terms = ["viscous", "forward", "back", *(("sine", "cosine", "load") if gravity else ())]
    known, unsure = np.zeros(len(rows)), []
    if "inertia" in constants:
        column = window.apply(position, 2)[rows]
        known, unsure = known + constants["inertia"].value * column, [constants["inertia"].sd * column]
    else:
        terms.insert(0, "inertia")
    if "force" in record:
        raw = record["force"]
        torque = window.apply(raw)[rows]
        scale = constants.get("torque_constant") if record.channels["force"].source == "current" else None
        source = "current" if scale else "force"
    else:
        assert reference is not None
        scale, source = constants["kp"], "reference"
        raw = scale.value * (reference - position)
        torque = window.apply(raw)[rows]
        if "kd" in constants:
            rate = window.apply(reference - position, 1)[rows]
            raw = raw + constants["kd"].value * window.apply(reference - position, 1)
            torque, unsure = torque + constants["kd"].value * rate, [*unsure, constants["kd"].sd * rate]
        else:
            terms.append("damping")
    if scale is not None:
        unsure.append(scale.sd / scale.value * torque)
    gain_sd = max((record.channels[name].gain_sd for name in ("force", "current") if name in record), default=0.0)
    unsure.append(gain_sd * torque)
    return JointData((log,), torque, tuple(terms), source, np.asarray(raw), known, tuple(unsure), constants)


def _refuse_still(slides: Sliding, record: Record) -> None:
    """Refuse a log that does not slide both ways for long enough."""
    ways = [int(np.sum(slides.side[slides.rows] == side)) for side in (1, -1)]
    if min(ways) >= ROWS // 2 and sum(ways) >= ROWS:
        return
    raise EstimateError(
        f"it slides steadily faster than {slides.slowest:.2g} rad/s at {ways[0]} instants forward and {ways[1]} back",
        f"friction is told from gravity by strokes both ways, {ROWS // 2} instants each at least",
        "swing it back and forth, farther or faster, through the same places",
    )
