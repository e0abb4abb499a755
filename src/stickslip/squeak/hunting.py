"""Does a servo loop with integral action hunt: stick and slip about its set point for ever?"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

from stickslip.drives.kinds import Release
from stickslip.errors import ModelError
from stickslip.laws.base import Exit, Law, Mode, Rigid, Row
from stickslip.laws.coulomb import Coulomb, LinearSlope
from stickslip.oscillator import Oscillator
from stickslip.parameters import finite
from stickslip.solve.simulate import simulate
from stickslip.solve.trajectory import Trajectory

NEAR = 1e-9  # of the holding torque, by which a slip begins early
SMALLEST = 1e-6  # of the rest that static friction allows under the proportional gain alone
LONGEST = 60.0  # of the loop's slowest time: a slip that has not ended by then creeps
NARROWER = 0.9  # a rest that is tried over the one before: slips from farther creep
WITHIN = 1000  # states of a slip, of which the largest torque is told: of a half sine that misses 1.2e-6
SLOPE = 1e-4  # of the amplitude, over which the map's slope is taken


@dataclass(frozen=True)
class _Integrating(Rigid):
    """A law with the integral of the position acting beside it: the controller's memory."""

    law: Law
    gain: float

    @property
    def memory(self) -> Mapping[str, Row]:
        return {"integral": {}}

    def modes(self) -> tuple[Mode, ...]:
        return tuple(
            replace(
                mode,
                friction=None if mode.friction is None else {**mode.friction, "integral": self.gain},
                exits=tuple(self._exit(one) for one in mode.exits),
                rates={"integral": {"x": 1.0}},
            )
            for mode in self.law.modes()
        )

    def _exit(self, way: Exit) -> Exit:
        """What holds at rest is friction and the integral's torque together."""
        friction = way.quantity.get("f", 0.0)
        return replace(way, quantity={**way.quantity, "integral": -friction * self.gain}) if friction else way


@dataclass(frozen=True)
class Hunting:
    """What a servo loop does about its set point.

    Attributes
    ----------
    amplitude : float
        How far from the set point it rests, in turn on either side [rad, or m]; 0 where it does not hunt.
    frequency : float
        Cycles in a second [Hz]; 0 where it does not hunt.
    stuck_share : float
        Share of the time at rest.
    multiplier : float
        By which a small deviation of a rest grows until the next: the hunting lasts where its size is below 1.
    torque, torque_rate : float
        How large the controller's torque gets in a cycle [N m, or N], and how fast it changes [N m/s]: a drive that
        gives as much hunts so, whatever its limits are.
    """

    amplitude: float
    frequency: float
    stuck_share: float
    multiplier: float
    torque: float
    torque_rate: float

    @property
    def lasts(self) -> bool:
        """Whether it hunts, and goes on from any start nearby."""
        return self.amplitude > 0 and abs(self.multiplier) < 1


NONE = Hunting(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def servo_hunting(
    law: Law,
    *,
    inertia: float,
    kp: float,
    ki: float,
    kd: float,
    most: float = math.inf,
    fastest: float = math.inf,
) -> Hunting:
    r"""Does a joint or an axis hunt under :math:`\tau = -k_p x - k_i \int x\,dt - k_d \dot x` and dry friction?

    At rest the integral winds up until static friction gives way: then :math:`k_p x + k_i \int x\,dt` is the static
    friction, so that where it rests says all of its state. One slip, simulated exactly, maps each rest to the next;
    it hunts where a rest is mapped to its mirror image, which is found by bisection. With static friction above the
    kinetic such a rest is there at any gain, if slips end before they creep (Armstrong-Helouvry and Amin, Automatica
    1996).

    The approximation in common use misses it: the describing function of friction, the first harmonic of a sinusoidal
    motion's, asks for :math:`A = 4 F_k / (\pi (k_i/\omega - c\,\omega))` at :math:`\omega = \sqrt{k_p/J}`, knows
    nothing of static friction, and has no solution in a loop that is stable without friction.

    A drive that saturates, or whose torque changes at a limited rate, hunts the same as long as the cycle stays within
    its limits. Where static friction is above all that it gives, the joint rests for ever.

    Parameters
    ----------
    law : Law
        Friction on a rigid contact, linear in its modes and alike both ways: Coulomb, LinearSlope.
    inertia, kp, ki, kd : float
        [kg m^2, N m/rad, N m/(rad s), N m s/rad], or of an axis [kg, N/m, N/(m s), N s/m].

    most, fastest : float
        What the drive's torque is limited to [N m, or N], and the rate at which it changes [N m/s].

    Returns
    -------
    Hunting

    Raises
    ------
    ModelError
        A gain or a limit that is not positive, a law with a memory or of two directions, a loop that is unstable
        anyway, or limits that the cycle reaches: the error says how much it asks for.

    Examples
    --------
    >>> from stickslip.laws import Coulomb
    >>> hunting = servo_hunting(Coulomb(0.06, static=0.08), inertia=0.02, kp=18.0, ki=40.0, kd=0.1)
    >>> hunting.lasts, round(1e3 * hunting.amplitude, 2), round(hunting.frequency, 3)
    (True, 1.03, 0.163)
    >>> servo_hunting(Coulomb(0.06), inertia=0.02, kp=18.0, ki=40.0, kd=0.1).lasts
    False
    """
    for name, value, unit in (("inertia", inertia, "kg m^2"), ("kp", kp, "N m/rad"), ("ki", ki, "N m/(rad s)")):
        finite(name, value, unit=unit, positive=True)
    finite("kd", kd, unit="N m s/rad")
    for name, value, unit in (("most", most, "N m"), ("fastest", fastest, "N m/s")):
        if value != math.inf:
            finite(name, value, unit=unit, positive=True)
    kinetic, static, viscous = _levels(law)
    if (kd + viscous) * kp <= ki * inertia:
        raise ModelError(
            f"ki = {ki:g} at (kd + slope) kp / inertia = {(kd + viscous) * kp / inertia:.4g}",
            "without friction the loop is unstable: it grows beyond any rest",
            "lower ki, or raise kd",
        )
    loop = _Loop(law, inertia, kp, ki, kd, static)
    amplitude = loop.mirrored() if kinetic < static < most else 0.0
    if amplitude == 0:
        return NONE
    step = SLOPE * amplitude
    after, slips, wound = loop.slip(amplitude)
    slope = (loop.slip(amplitude + step)[0] - loop.slip(amplitude - step)[0]) / (2 * step)
    rests = (loop.wound(after) - wound) / after
    torque, rate = loop.peaks(amplitude)
    for name, limit, peak in (("most", most, torque), ("fastest", fastest, rate)):
        if peak > limit:
            raise ModelError(
                f"{name} = {limit:g} in a cycle that gets to {peak:.4g}",
                "within its limits a drive hunts as one without; beyond them no cycle is told",
                f"give {name} above {peak:.4g}, or simulate the drive",
            )
    return Hunting(amplitude, 0.5 / (slips + rests), rests / (slips + rests), -slope, torque, rate)


def _levels(law: Law) -> tuple[float, float, float]:
    """Sliding and static friction and the slope, of a law alike both ways."""
    if law.memory or not isinstance(law, Coulomb | LinearSlope):
        raise ModelError(
            f"the law {type(law).__name__}", "hunting is told of Coulomb or LinearSlope", "give one of them"
        )
    return law.kinetic, law.breakaway, getattr(law, "slope", 0.0)


@dataclass(frozen=True)
class _Loop:
    """The loop about its set point, from one rest to the next."""

    law: Law
    inertia: float
    kp: float
    ki: float
    kd: float
    static: float

    def wound(self, place: float) -> float:
        """The integral at which static friction gives way at a place [rad s]."""
        return (math.copysign(self.static, place) - self.kp * place) / self.ki

    def slipping(self, place: float) -> Trajectory:
        """What happens from giving way at a place on."""
        law = _Integrating(self.law, self.ki)
        loop = Oscillator(mass=self.inertia, stiffness=self.kp, damping=self.kd, law=law, drive=Release())
        slowest = self.kp / self.ki + 2 * math.pi * math.sqrt(self.inertia / self.kp) + self.kd / self.kp
        start = {"x": place, "integral": self.wound(place) * (1 + math.copysign(NEAR, self.wound(place) * place))}
        return simulate(loop, duration=LONGEST * slowest, start=start)

    def peaks(self, place: float) -> tuple[float, float]:
        """How large the controller's torque gets in a slip from a place, and its rate."""
        run, end = self.slipping(place), self.slip(place)[1]
        states = [run.state(end * number / WITHIN) for number in range(WITHIN)]
        torques = (self.kp * s["x"] + self.ki * s["integral"] + self.kd * s["v"] for s in states)
        rates = (self.kp * s["v"] + self.ki * s["x"] + self.kd * s["a"] for s in states)
        return max(map(abs, torques)), max(map(abs, rates))

    def slip(self, place: float) -> tuple[float, float, float]:
        """From giving way at a place on: the next rest, when it comes [s], and the integral then; NaN if it creeps."""
        run = self.slipping(place)
        rest = next((event.time for event in run.events if event.kind == "stick" and event.time > 0), None)
        if rest is None:
            return math.nan, math.nan, math.nan
        state = run.state(rest)
        return state["x"], rest, state["integral"]

    def mirrored(self) -> float:
        """The rest that a slip maps to its mirror image; 0 where there is none before slips creep."""
        from scipy.optimize import brentq

        high = self.static / self.kp
        low = SMALLEST * high
        while not self.slip(high)[0] + high > 0:
            high *= NARROWER
            if high < low:
                return 0.0
        if not self.slip(low)[0] + low < 0:
            return 0.0
        return float(brentq(lambda place: self.slip(place)[0] + place, low, high, xtol=1e-12 * high, rtol=1e-12))
