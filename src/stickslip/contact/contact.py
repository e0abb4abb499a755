"""How stiff is the contact before it slides, and at which speed does sliding begin again after a turn?"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stickslip.arrays import Array, stretches
from stickslip.balance.balance import Balance
from stickslip.balance.likely_contact import (
    HELD,
    LEAST,
    NEGATIVE,
    STIFFNESS,
    LikelyContact,
    held_steps,
    likely_contact,
    sliding_level,
)
from stickslip.balance.motion import is_measured
from stickslip.contact.frequency_transition import transition
from stickslip.cycle.loops import Loops, friction_loops
from stickslip.errors import EstimateError
from stickslip.estimate import NORMAL_95, Doubt, Estimate, Result, Status, kinds
from stickslip.record.record import Record
from stickslip.statistics import mean_of_cycles, mean_uncertainty, student

METHODS = ("contact", "curve", "equation")
SPEED, FREQUENCY = "transition speed", "coupled frequency"
HARMONICS = 9  # of a mean cycle's displacement
LEVELS = 37  # of friction at which the branches are averaged
MONOTONE = 0.1  # of the level by which friction may fall on its way from one side to the other
STOPPED = 0.15  # of half a cycle: a contact that holds for longer does not turn as harmonic sliding does
FEW = 8  # branches below which an interval is crude
BEFORE = 5  # samples before a turn, of which the friction is taken
ROUNDED, BLURRED = 0.015, 0.06  # share by which the curve is off where a load cell tells friction, and where none does
LAG = 1e-3  # s, of which is said what it would do


@dataclass(frozen=True, eq=False, repr=False)
class TransitionSpeed(Result):
    """The speed at which a compliant contact begins to slide after the motion has turned.

    Attributes
    ----------
    method : str
        Which of the three `speed` is.
    contact, curve, equation : Estimate or None
        By the fitted contact, by the mean curve of friction against velocity, and by the thesis's equation 3.4
        [m/s]; None where what it needs is not there. What biases each is in its checks.
    friction, velocity : ndarray, shape (k,)
        The mean curve [N, m/s], from the turn up to 0.9 of the sliding friction, both directions taken together.
    turns : ndarray, shape (n,)
        The speed by the curve of each turn [m/s]: their scatter is the thesis's sigma.
    level : Estimate
        Sliding friction [N].
    status : str
        "ok", or in words what to beware of.
    """

    method: str
    contact: Estimate | None
    curve: Estimate | None
    equation: Estimate | None
    friction: Array
    velocity: Array
    turns: Array
    level: Estimate
    status: str

    @property
    def speed(self) -> Estimate:
        """The transition speed [m/s] by `method`."""
        speed: Estimate = getattr(self, self.method)
        return speed


def transition_speed(record: Record | Loops, *, method: str | None = None) -> TransitionSpeed:
    r"""At which speed does the contact begin to slide after the motion has turned?

    When a sliding mass turns, a compliant contact first lets go of its deflection and takes up that to the other side,
    :math:`2 f_k/K_y` in all; when sliding begins, the mass moves at the transition speed (thesis, section 3.4). For
    harmonic sliding at the angular frequency w and the amplitude X, three answers:

    - "contact": the mass set going again from rest by what pulls it at the turn, against the contact's spring and
      damper, until :math:`K_y u + c\,\dot u` has grown by :math:`2 f_k`; with K_y and c of :func:`contact_stiffness`,
      and the friction and the pull of the record at its turns. Only an error of K_y, c or mass goes into it.
    - "curve": read off the curve of friction against velocity of each turn, as in the thesis's figure 3.15, carried on
      from 0.9 of the sliding friction to all of it: the square of the velocity of a mass on a spring is a parabola in
      friction, whether it gathers speed up to there, as in sliding, or loses some again, as in stick-slip. Whatever
      blurs or shifts velocity against friction goes into it: a lag of 1.26 ms that is not stated does as much as a
      quarter to a third of it; what the smoother rounds is in its interval.
    - "equation": the thesis's equation 3.4, :math:`V_s = 2 w \sqrt{X f_k/K_y - (f_k/K_y)^2}`, in which the contact has
      no damping; with the damping of the thesis's rig it is 3 to 5 % high.

    In stick-slip these are of the turns out of sliding; after a micro-slip, which is no such turn, it is less.

    Parameters
    ----------
    record : Record or Loops
        After :func:`~stickslip.friction_force`, best with ``method="fusion"``; of :func:`~stickslip.friction_loops`
        the mean cycle is taken, and its slope for K_y.
    method : {"contact", "curve", "equation"}, optional
        Which answer is `speed`: "contact" where left out, or "equation" for loops.

    Returns
    -------
    TransitionSpeed

    Raises
    ------
    RecordError
        The record has no friction, or a channel is broken.
    EstimateError
        No turns that go from sliding to sliding, too few samples in them, or a method that does not fit.

    Examples
    --------
    >>> import stickslip as ss
    >>> contact = ss.laws.CompliantContact(1.1, stiffness=192000, damping=23.9)
    >>> drive = ss.drives.HarmonicBase(1.1e-3, frequency=8.7)
    >>> slider = ss.Oscillator(mass=2.42, stiffness=2310, law=contact, drive=drive)
    >>> record = ss.Rig.perfect().having("x", white=1e-7).measure(ss.simulate(slider, cycles=30), fs=4000, rng=1)
    >>> record = ss.friction_force(record.between(1.0, 3.4), mass=2.42, stiffness=2310, method="fusion")
    >>> print(f"{1e3 * transition_speed(record).speed.value:.2f} mm/s")
    5.36 mm/s
    """
    choices = ("curve", "equation") if isinstance(record, Loops) else METHODS
    if method not in (None, *choices):
        raise EstimateError(f"method = '{method}'", f"it is one of {', '.join(choices)}", "choose one of them")
    if isinstance(record, Loops):
        return _of_loops(record, method or "equation")
    record.require_clean("x", "friction", question=SPEED)
    loops = friction_loops(record)
    fitted, lost = _fitted(record, method)
    velocity = record["v"] if "v" in record else np.gradient(record["x"]) * record.fs
    friction = record["friction"] - loops.offset.value
    branches = _branches(friction, velocity, loops.level.value)
    stiffness = fitted.stiffness if fitted else contact_stiffness(record, method="slope")
    exact = _exact(record, friction, loops.offset.value, branches, fitted) if fitted else None
    off = ROUNDED if "load" in record or is_measured(record, "friction") else BLURRED
    return _answer(loops, branches, (stiffness, exact, off), method or ("contact" if exact else "equation"), lost)


def coupled_frequency(record: Record) -> Estimate:
    r"""At which frequency does the mass ring on spring and contact while the contact holds?

    :math:`\sqrt{(k + K_y)/m}/2\pi`, without damping, from :func:`contact_stiffness`; and, where the record sticks long
    enough to ring, from the ringing itself (:func:`~stickslip.contact.transition`), cut where micro-slips interrupt it.
    The checks say whether the two agree.

    Parameters
    ----------
    record : Record
        After :func:`~stickslip.friction_force`, whose rig is used, with the sensors' mounts stated.

    Returns
    -------
    Estimate
        [Hz].

    Raises
    ------
    RecordError
        The record has no friction.
    EstimateError
        As :func:`contact_stiffness`.

    Examples
    --------
    >>> import stickslip as ss
    >>> contact = ss.laws.CompliantContact(1.1, stiffness=192000, damping=23.9)
    >>> drive = ss.drives.HarmonicBase(0.65e-3, frequency=2.5)
    >>> run = ss.simulate(ss.Oscillator(mass=2.42, stiffness=2310, law=contact, drive=drive), cycles=6)
    >>> record = ss.Rig.perfect().having("x", white=1e-7).measure(run, fs=4000, rng=1)
    >>> record = ss.friction_force(record, mass=2.42, stiffness=2310, method="fusion")
    >>> print(f"{coupled_frequency(record).value:.1f} Hz")
    45.1 Hz
    """
    fitted = likely_contact(record)
    mass, spring = fitted.balance.mass, fitted.balance.stiffness
    low, value, high = (
        math.sqrt((spring + value) / mass) / (2 * math.pi)
        for value in (fitted.stiffness.interval[0], fitted.stiffness.value, fitted.stiffness.interval[1])
    )
    sd = fitted.stiffness.sd / (8 * math.pi**2 * mass * value)
    check, status = _ringing(record, fitted, value, sd)
    method = "sqrt((k + K) / m) / 2 pi, from the likeliest contact"
    status, checks = Status(fitted.stiffness.status, status), (check, *fitted.stiffness.checks)
    return Estimate(FREQUENCY, value, (low, high), sd, "Hz", method, status, checks)


def _ringing(record: Record, fitted: LikelyContact, value: float, sd: float) -> tuple[str, str]:
    """What the ringing says of the frequency, and whether that is the contact's; in words."""
    rig = fitted.balance
    balanced = (rig.pull(record) - rig.damping * record["v"] - record["friction"]) / rig.mass
    bare = Record.of({"a": balanced, "v": record["v"]}, fs=record.fs, start=record.start)
    try:
        ringing = transition(bare)
    except EstimateError as error:
        return f"no ringing to compare with: {error.value}", "ok"
    undamped = 1 / math.sqrt(1 - ringing.damping.value**2)
    other = ringing.frequency.scaled(undamped, "Hz")
    apart = abs(other.value - value) / math.hypot(other.sd, sd)
    half = NORMAL_95 * other.sd
    method = f"by the ringing of {len(ringing.sticks)} sticks {other.value:.5g} +- {half:.2g} Hz"
    if apart <= NORMAL_95:
        return f"{method}: they agree", "ok"
    return method, f"the ringing says {other.value:.5g} +- {half:.2g} Hz, {apart:.2g} deviations away"


def _fitted(record: Record, method: str | None) -> tuple[LikelyContact | None, str]:
    """The likeliest contact, or why there is none; which is an error where it was asked for."""
    try:
        return likely_contact(record), "ok"
    except EstimateError as error:
        if method == "contact":
            raise
        return None, f"no fitted contact: {error.value}"


def _of_loops(loops: Loops, method: str) -> TransitionSpeed:
    branches = _branches(loops.friction - loops.offset.value, loops.velocity, loops.level.value)
    return _answer(loops, branches, (contact_stiffness(loops), None, BLURRED), method, "ok")


@dataclass(frozen=True, eq=False)
class Branch:
    """Friction and velocity on the way from one side to the other, each with the sign that makes it rise."""

    first: int
    side: float
    force: Array
    speed: Array


def _branches(friction: Array, velocity: Array, level: float) -> list[Branch]:
    branches = []
    for first, last in held_steps(friction, velocity, level)[1]:
        side = math.copysign(1.0, friction[last - 1])
        force, speed = side * friction[first:last], side * velocity[first:last]
        highest = np.maximum.accumulate(force)
        whole = force[0] < -level / 2 and force[-1] > level / 2
        if whole and last - first > LEAST and np.max(highest - force) < MONOTONE * level:
            branches.append(Branch(first, side, highest, speed))
    if not branches:
        raise EstimateError(
            f"no turn from sliding to sliding with more than {LEAST} samples below {HELD:g} of the sliding friction",
            "the transition speed is read where sliding begins after a turn",
            "sample faster; in stick-slip see contact_stiffness and transition instead",
        )
    return branches


def _answer(
    loops: Loops, branches: Sequence[Branch], estimates: tuple[Estimate, Estimate | None, float], method: str, lost: str
) -> TransitionSpeed:
    """All three, from the contact's stiffness, the speed by the fitted contact, and how far off the curve may be."""
    level, (stiffness, exact, off) = loops.level, estimates
    amplitude = _amplitude(loops.displacement)
    turn = 2 * math.pi * loops.frequency.value
    friction = np.linspace(-HELD, HELD, LEVELS) * level.value
    velocity = np.mean([np.interp(friction, branch.force, branch.speed) for branch in branches], axis=0)
    # per lag, friction is read where the mass has gathered more speed: by its acceleration at the turn
    lagging = f"a lag of 1 ms that is not stated would change it by {1e3 * LAG * turn**2 * amplitude[0]:.2g} mm/s"
    if not stiffness.value > 0:
        raise EstimateError(
            f"a contact of {stiffness.value:.3g} {stiffness.unit}",
            "a contact that holds is pushed back: its stiffness is above zero",
            "check the signs of friction and displacement",
        )
    known = np.array([turn, amplitude[0], level.value, math.log(stiffness.value)])
    doubt = np.diag([2 * math.pi * loops.frequency.sd, amplitude[1], level.sd, stiffness.sd / stiffness.value]) ** 2
    stops = _stops(loops, branches, turn * amplitude[0])
    high = ("without damping of the contact, and for harmonic sliding: 3 to 5 % high on a rig like the thesis's",)
    equation = _propagated("equation", _equation, known, doubt, "equation 3.4 of the thesis", high)
    turns = np.array([_reached(branch, level.value) for branch in branches])
    curve = _of_curve(turns, lagging, off)
    equation = replace(equation, status=stops) if stops != "ok" else equation
    if math.isinf(stiffness.interval[1]):
        exact, equation = exact and _at_most(exact), _at_most(equation)
    status = Status(lost, stiffness.status, stops, curve.status)
    return TransitionSpeed(method, exact, curve, equation, friction, velocity, turns, level, status)


def _equation(known: Array) -> float:
    turn, amplitude, level, log_stiffness = known
    deflection = level / math.exp(log_stiffness)
    return float(2 * turn * math.sqrt(max(0.0, amplitude * deflection - deflection**2)))


def _exact(
    record: Record, friction: Array, offset: float, branches: Sequence[Branch], fitted: LikelyContact
) -> Estimate:
    """From the contact, and from the friction before, the pull at, and its change after each turn."""
    rig, speeds = fitted.balance, []
    pull = rig.pull(record) - offset  # the zero of a sensor is in both
    for branch in branches:
        before = slice(max(0, branch.first - BEFORE - 1), max(1, branch.first - 1))
        rows = np.arange(branch.first, branch.first + len(branch.force))
        late = branch.speed[0] / max(branch.speed[1] - branch.speed[0], 1e-300)  # samples since the turn
        change, start = np.polyfit((np.arange(len(rows)) + late) / record.fs, branch.side * pull[rows], 1)
        speeds.append((float(np.mean(-branch.side * friction[before])), float(start), float(change)))
    known, doubt = np.mean(speeds, axis=0), np.zeros((5, 5))
    doubt[range(3), range(3)] = [mean_uncertainty(column)[0] ** 2 for column in np.transpose(speeds)]
    doubt[3:, 3:] = fitted.covariance
    centre = math.log(fitted.stiffness.value), fitted.damping.value
    return _propagated(
        "contact",
        lambda values: _set_going(values, rig),
        np.array([*known, *centre]),
        doubt,
        "motion after the turn on the fitted contact",
        ("with the friction and the pull found at the turns; errors of the mass and of gains go into it",),
    )


def _set_going(known: Array, rig: Balance) -> float:
    """Speed at which the contact's force has grown by twice the friction, from rest under a pull that grows evenly."""
    from scipy import optimize

    brentq: Any = optimize.brentq
    level, start, change, log_stiffness, damping = known
    if level <= 0:
        raise EstimateError(
            f"friction of {level:.3g} N before the turns", "friction opposes the motion", "check the sensors' signs"
        )
    stiffness = math.exp(log_stiffness)
    square, decay = stiffness / rig.mass, (damping + rig.damping) / (2 * rig.mass)
    if decay**2 >= square:
        raise EstimateError(
            f"a contact of {stiffness:.3g} N/m with {damping:.3g} N s/m",
            "the speed of transition is that of a contact that rings as it begins to slide",
            "look at the contact's damping, or at a faster motion",
        )
    ring = math.sqrt(square - decay**2)
    drift = change / stiffness
    rest = (start + level) / stiffness - 2 * decay * drift / square
    sine = -(decay * rest + drift) / ring

    def moved(t: float) -> tuple[float, float]:
        fading, c, s = math.exp(-decay * t), math.cos(ring * t), math.sin(ring * t)
        swing = fading * (-rest * c + sine * s)
        turning = fading * ring * (rest * s + sine * c)
        return rest + drift * t + swing, drift + turning - decay * swing

    def short(t: float) -> float:
        place, speed = moved(t)
        return float(stiffness * place + damping * speed - 2 * level)

    half = math.pi / ring
    if short(half) <= 0:
        raise EstimateError(
            "the contact holds on after each turn",
            "a transition speed is that at which it begins to slide",
            "see transition for how it rings",
        )
    return float(moved(float(brentq(short, 0.0, half)))[1])


def _propagated(
    name: str, function: Callable[[Array], float], known: Array, covariance: Array, method: str, checks: tuple[str, ...]
) -> Estimate:
    """The function of what is known, with the first-order deviation."""
    step = np.sqrt(np.diag(covariance))
    step = np.where(np.isfinite(step) & (step > 0), step, 0.0) + 1e-9 * np.abs(known)
    slope = [(function(known + d) - function(known - d)) / (2 * d.sum()) for d in np.diag(step)]
    within = np.where(np.isfinite(covariance), covariance, 0.0)
    sd = math.sqrt(max(0.0, float(np.array(slope) @ within @ slope)))
    return Estimate.normal(f"{SPEED} by the {name}", function(known), sd=sd, unit="m/s", method=method, checks=checks)


def _at_most(speed: Estimate) -> Estimate:
    sentence = f"at most {speed.interval[1]:.3g} m/s: the contact is not told from a rigid one"
    return replace(speed, interval=(0.0, speed.interval[1]), status=sentence)


def _amplitude(displacement: Array) -> tuple[float, float]:
    """Half the range of a mean cycle by its first harmonics, and its standard deviation by what they leave."""
    spectrum = np.fft.rfft(displacement)
    smooth = np.fft.irfft(np.where(np.arange(len(spectrum)) <= HARMONICS, spectrum, 0.0), len(displacement))
    residual = float(np.std(displacement - smooth))
    return float(np.ptp(smooth)) / 2, residual * math.sqrt((2 * HARMONICS + 1) / len(displacement))


def _stops(loops: Loops, branches: Sequence[Branch], peak: float) -> str:
    """Whether the contact holds for too long for harmonic sliding, in words."""
    speeds = [float(branch.speed[-1]) for branch in branches]
    stuck = math.asin(min(1.0, float(np.mean(speeds)) / peak)) / math.pi  # of half a cycle
    measured = float(np.median(np.abs(loops.velocity)) / np.max(np.abs(loops.velocity)))
    if stuck < STOPPED and measured > 0.5:  # of a sine it is 0.71
        return "ok"
    return "it stops between its turns: the equation is for harmonic sliding, the rest for the turns out of sliding"


def _reached(branch: Branch, level: float) -> float:
    """The speed at which the curve of a turn reaches the sliding friction, the square of its velocity carried on."""
    degree = min(2, len(np.unique(branch.force)) - 1)
    square = np.polyval(np.polyfit(branch.force, branch.speed**2, degree), level)
    return math.sqrt(max(0.0, float(square)))


def _of_curve(speeds: Array, lagging: str, off: float) -> Estimate:
    """The mean over the turns."""
    sd, freedom = mean_uncertainty(speeds)
    scatter = float(np.std(speeds, ddof=1)) if len(speeds) > 1 else math.nan
    speed = Estimate.normal(
        f"{SPEED} by the curve",
        float(np.mean(speeds)),
        sd=sd,
        unit="m/s",
        quantile=student(freedom),
        method="curve of friction against velocity, where it reaches the sliding friction",
        status=Status(*([Doubt.few(len(speeds), "turn")] if len(speeds) < FEW else [])),
        checks=(
            f"{len(speeds)} turns, scatter between them {1e3 * scatter:.2g} mm/s",
            lagging,
            f"the smoother rounds the end of the turn: off by {100 * off:.2g} % at most on a rig like the thesis's",
        ),
    )
    half = (speed.interval[1] - speed.interval[0]) / 2 + off * speed.value
    return replace(speed, interval=(speed.value - half, speed.value + half), sd=half / NORMAL_95)


def contact_stiffness(record: Record | Loops, *, method: str | None = None) -> Estimate:
    r"""How stiff is the contact while it holds?

    While it holds, friction follows :math:`f = f_0 + K_y (x - x_0) + c\,\dot x` (thesis, equations 3.8 to 3.11). With
    "stick" the K_y and c are taken under which everything that the sensors read is most likely (a Kalman filter that
    lets the friction follow the contact where it holds, and do as it likes elsewhere): 0.012 % from 3 s of a rig like
    the thesis's in stick-slip, 0.2 % in sliding at 8.7 Hz, 0.4 % at 11.1 Hz. With "slope" a line is drawn through
    friction against displacement in each stick, as in the thesis's section 3.5; its answers scatter by 10 to 20 %
    between sticks on that rig, and are up to 30 % off, the more the faster the stick is over.

    Parameters
    ----------
    record : Record or Loops
        After :func:`~stickslip.friction_force`, whose rig is used, with the sensors' mounts stated; of
        :func:`~stickslip.friction_loops` the slope of the mean cycle is taken.
    method : {"stick", "slope"}, optional
        "stick" for a record, "slope" for loops, where left out.

    Returns
    -------
    Estimate
        K_y [N/m], or [N m/rad]; what its method can not see is in its checks.

    Raises
    ------
    RecordError
        The record has no friction.
    EstimateError
        Too few sticks, a contact on the moving base, or a method that does not fit.

    Examples
    --------
    >>> import stickslip as ss
    >>> contact = ss.laws.CompliantContact(1.1, stiffness=192000, damping=23.9)
    >>> drive = ss.drives.HarmonicBase(0.65e-3, frequency=2.5)
    >>> run = ss.simulate(ss.Oscillator(mass=2.42, stiffness=2310, law=contact, drive=drive), cycles=5)
    >>> record = ss.Rig.perfect().having("x", white=1e-7).measure(run, fs=4000, rng=1)
    >>> record = ss.friction_force(record, mass=2.42, stiffness=2310, method="fusion")
    >>> bool(abs(contact_stiffness(record).value / 192000 - 1) < 0.01)
    True
    """
    methods = ("slope",) if isinstance(record, Loops) else ("stick", "slope")
    if method not in (None, *methods):
        raise EstimateError(f"method = '{method}'", f"it is one of {', '.join(methods)}", "choose one of them")
    if isinstance(record, Loops):
        friction = record.friction - record.offset.value
        return _slope(branch_slopes(record.displacement, friction, record.level.value), record.unit)
    if method == "slope":
        record.require_clean("x", "friction", question=STIFFNESS)
        level, middle = sliding_level(record["friction"], np.gradient(record["x"]))
        return _slope(branch_slopes(record["x"], record["friction"] - middle, level), "m")
    return likely_contact(record).stiffness


def contact_damping(record: Record) -> Estimate:
    r"""How much does the contact damp while it holds?

    The c of :math:`f = f_0 + K_y (x - x_0) + c\,\dot x`, from the same fit as :func:`contact_stiffness` with "stick".

    Parameters
    ----------
    record : Record
        After :func:`~stickslip.friction_force`, whose rig is used, with the sensors' mounts stated.

    Returns
    -------
    Estimate
        c [N s/m].

    Raises
    ------
    RecordError
        The record has no friction.
    EstimateError
        Too few sticks, a contact on the moving base, or a damping below zero, which no contact has: a sensor's lag or
        mount is not accounted for.

    Examples
    --------
    >>> import stickslip as ss
    >>> contact = ss.laws.CompliantContact(1.1, stiffness=192000, damping=23.9)
    >>> drive = ss.drives.HarmonicBase(0.65e-3, frequency=2.5)
    >>> run = ss.simulate(ss.Oscillator(mass=2.42, stiffness=2310, law=contact, drive=drive), cycles=5)
    >>> record = ss.Rig.perfect().having("x", white=1e-7).measure(run, fs=4000, rng=1)
    >>> record = ss.friction_force(record, mass=2.42, stiffness=2310, method="fusion")
    >>> bool(abs(contact_damping(record).value - 23.9) < 1)
    True
    """
    damping = likely_contact(record).damping
    if NEGATIVE in kinds(damping.status):
        raise EstimateError(
            f"a contact damping of {damping.value:.3g} N s/m",
            "a contact takes energy from the motion, so that its damping is not below zero",
            "state the sensors' lags and mounts, by with_details or under [sensors] in the rig file",
        )
    return damping


def branch_slopes(displacement: Array, friction: Array, level: float) -> Array:
    """The slope of friction against displacement in each stick that goes from one side of `level` to the other."""
    slopes = []
    for first, last in zip(*stretches(np.abs(friction) < HELD * level), strict=True):
        way = displacement[first:last] - np.mean(displacement[first:last])
        whole = last - first >= LEAST and np.ptp(friction[first:last]) > level
        if whole and np.ptp(displacement[first:last]) > 0:
            slopes.append(float(way @ friction[first:last] / (way @ way)))
    return np.array(slopes)


def _slope(deflection: Array, unit: str) -> Estimate:
    if len(deflection) < 2:
        raise EstimateError(
            f"{len(deflection)} sticks with {LEAST} samples or more below the sliding friction",
            "a slope needs two at least",
            "sample faster, or give a longer record",
        )
    scatter = float(np.std(deflection, ddof=1) / abs(np.mean(deflection)))
    checks = (
        f"{len(deflection)} sticks, which scatter by {100 * scatter:.0f} %",
        "noise in the displacement and lags make a slope too low: 2 to 27 % on a rig like the thesis's",
    )
    unit, method = "N/m" if unit == "m" else "N m/rad", "mean slope of friction against displacement in each stick"
    return mean_of_cycles(STIFFNESS, deflection, unit=unit, method=method, checks=checks).within(0.0)
