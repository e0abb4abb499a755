"""What becomes of steady sliding that does not last: the limit cycle, its swing, its sticks and flights, its energy;
and whether a servo loop with integral action hunts: sticks and slips about its set point for ever."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stickslip.arrays import Array, Complex
from stickslip.drives.kinds import Belt, Release
from stickslip.errors import ModelError
from stickslip.laws.base import Exit, Law, Mode, Rigid, Row
from stickslip.laws.coulomb import Coulomb, LinearSlope
from stickslip.oscillator import Oscillator, Structure
from stickslip.parameters import finite
from stickslip.solve.energies import EnergyFlow, energy_flow
from stickslip.solve.poincare import Table, stretch, tables
from stickslip.solve.self_excited import settled_cycle
from stickslip.solve.simulate import opening, simulate
from stickslip.solve.trajectory import Trajectory
from stickslip.squeak.stability import Stability, System, stability

FIRST = 64  # cycles of a small vibration before a cycle is looked for
SMALL = 1e-5  # of the vibration that would lift or stop a contact: what the growth is measured on
LEAST = 1e-2  # of that vibration: a cycle is looked for beyond it
DYING = 0.3  # of the vibration at the beginning: what is left of one that dies away
UNSETTLED = 0.1  # change of the size in the last round of a motion that has no size of its own yet
SAMPLES = 4096  # of a cycle whose extremes are looked for
HALVINGS = 14  # of the starts between one that dies away and one that lasts
NEAR = (4, 8, 16, 32)  # cycles after which such a start is still close to the unstable cycle


@dataclass(frozen=True, eq=False)
class LimitCycle:
    """The motion that a small vibration about steady sliding, or another start, ends in.

    Attributes
    ----------
    status : str
        "periodic", "steady sliding" (the vibration dies away), "held" (every contact sticks or has lifted off),
        "not periodic" (it lasts and does not repeat), "not settled" (it still grew or died away when it was left, or
        does neither for want of damping), or "unstable" (it repeats, and every small deviation leads away from it).
    frequency : float
        At which the motion repeats [Hz]; of one that does not, of its strongest line; 0 where nothing vibrates.
    amplitudes : ndarray (n,)
        Half the swing of each displacement [m, or rad of an angle].
    amplitude : float
        Half the swing of the contact that slides to and fro most [m].
    stick_share, separation_share : tuple of float
        Share of the time that each contact holds, and is lifted off.
    growth : float
        Of a small vibration about steady sliding, as simulated [1/s]; nan where there is no such sliding.
    energy : EnergyFlow
        What every motion takes up and loses in a cycle [J]; of a motion that does not repeat, over what is kept of it.
    multipliers : ndarray of complex
        Of a small deviation over a cycle, largest first; within 1: the cycle is stable. Empty where nothing repeats.
    sliding : Stability
        Of the steady sliding it has left.
    motion : Trajectory
        One cycle; the last stretch of a motion that does not repeat.
    """

    status: str
    frequency: float
    amplitudes: Array
    amplitude: float
    stick_share: tuple[float, ...]
    separation_share: tuple[float, ...]
    growth: float
    energy: EnergyFlow
    multipliers: Complex
    sliding: Stability
    motion: Trajectory

    @property
    def vibrates(self) -> bool:
        """Whether a vibration lasts."""
        return self.status in ("periodic", "not periodic", "not settled")

    def __repr__(self) -> str:
        if not self.vibrates:
            return f"LimitCycle: {self.status}"
        named = {"sticks": self.stick_share, "lifted": self.separation_share}
        spans = {name: ", ".join(f"{one:.3g}" for one in parts) for name, parts in named.items() if any(parts)}
        shares = [f"{name} {parts} of the time" for name, parts in spans.items()]
        head = f"LimitCycle: {self.status}, {self.frequency:.5g} Hz, contacts slide {self.amplitude:.4g} m to and fro"
        return "\n  ".join([head, *shares])


def limit_cycle(
    system: System,
    *,
    speed: float | None = None,
    start: Mapping[str, float | str] | None = None,
    push: float = 1e-3,
    patience: int = 16_384,
) -> LimitCycle:
    """Into which motion does steady sliding go over, and how does it sound?

    The exact engine follows a small vibration until it dies away or repeats; Newton's method on state and period closes
    the cycle to rounding, and its derivative over the cycle, events included, says whether it is stable.

    Parameters
    ----------
    system : Structure or Oscillator
        What slides: on a belt, or at the speed given.
    speed : float, optional
        Of the counter-face [m/s], in place of the system's drive; that of its Belt where left out.
    start : mapping, optional
        State at the beginning, as ``simulate`` takes it; another start can lead to another cycle.
    push : float
        Size of the vibration at the beginning where no start is given: a share of the one that would just lift or stop
        a contact, in the mode that grows fastest.
    patience : int
        Cycles of the small vibration after which the motion is taken as it is.

    Returns
    -------
    LimitCycle

    Raises
    ------
    ModelError
        Nothing slides, no spring holds it, or as in :func:`stability`.

    Examples
    --------
    A mass on a belt whose friction falls with the speed sticks and slips:

    >>> from stickslip import Oscillator

    >>> from stickslip.drives import Belt

    >>> from stickslip.laws import LinearSlope
    >>> cycle = limit_cycle(Oscillator(1.0, 1.0, LinearSlope(1.0, slope=-0.1), Belt(0.5)))
    >>> cycle.status, cycle.stick_share[0] > 0, round(cycle.growth / cycle.sliding.growth, 6)
    ('periodic', True, 1.0)
    """
    sliding = stability(system, speed=speed)
    if speed is not None:
        system = system.having(drive=Belt(speed))
    if not np.all(np.isfinite(sliding.place)):
        raise ModelError(
            "a system that no spring holds", "a limit cycle is about steady sliding", "give it a stiffness"
        )
    if not (isinstance(patience, int | np.integer) and patience >= FIRST):
        raise ModelError(f"patience = {patience}", f"it is a whole number of at least {FIRST} cycles", "raise it")
    finite("push", push, unit="of what lifts or stops a contact", positive=True)
    table = tables(system)
    cycle = 1 / (sliding.frequency or system.frequency)
    begin = _pushed(system, table, sliding, push) if start is None else opening(table, start)
    return _cycle_of(system, sliding, *_followed(system, table, sliding, begin, cycle, patience))


def separating_cycle(system: System, lasting: LimitCycle) -> LimitCycle | None:
    """The unstable cycle between stable sliding and a vibration that lasts beside it; None where none is found.

    Of the starts on the line from steady sliding to that vibration the last one that dies away is bisected. From there
    the motion stays close to the cycle that separates both for a while, and Newton's method closes it. There is none
    where all that separates them is whether a contact just sticks.
    """
    sliding, table = lasting.sliding, tables(system)
    cycle = 1 / (sliding.frequency or system.frequency)
    count = 2 * len(sliding.place)
    rest = np.append(sliding.place, np.zeros(len(sliding.place)))
    away = lasting.motion.states[0, :count] - rest

    def start(share: float) -> dict[str, float]:
        return dict(zip(table.names, map(float, rest + share * away), strict=False))

    dies, lasts = 0.0, 1.0
    for _ in range(HALVINGS):
        middle = (dies + lasts) / 2
        vibrates = limit_cycle(system, start=start(middle)).vibrates
        dies, lasts = (dies, middle) if vibrates else (middle, lasts)
    for share, cycles in itertools.product((lasts, dies), NEAR):
        near = stretch(system, table, *opening(table, start(share)), span=(0.0, cycles * cycle))
        settled = settled_cycle(near, cycle)
        if settled is not None and abs(settled[1][0]) > 1:
            return _cycle_of(system, sliding, "unstable", *settled)
    return None


def _cycle_of(system: System, sliding: Stability, status: str, motion: Trajectory, multipliers: Complex) -> LimitCycle:
    """What there is to say of a motion."""
    shares, still = _shares(motion), status in ("steady sliding", "held")
    swing, slide = (np.zeros(len(sliding.place)), 0.0) if still else _swings(motion)
    return LimitCycle(
        status=status,
        frequency=_frequency(status, motion, sliding),
        amplitudes=swing,
        amplitude=slide,
        stick_share=shares[0],
        separation_share=shares[1],
        growth=_growth(system, tables(system), sliding, 1 / (sliding.frequency or system.frequency)),
        energy=energy_flow(motion),
        multipliers=multipliers,
        sliding=sliding,
        motion=motion,
    )


def _followed(
    system: System, table: Table, sliding: Stability, begin: tuple[Array, int], cycle: float, patience: int
) -> tuple[str, Trajectory, Complex]:
    """Status, one cycle or the last stretch, multipliers."""
    state, mode = begin
    none, physical = np.zeros(0, dtype=np.complex128), table.physical
    done, count, opened = 0, FIRST, 0.0
    while True:
        motion = stretch(system, table, state, mode, span=(0.0, count * cycle))
        end, after = motion.end()
        part = count / 4
        first, last = (_size(motion, sliding, begin * cycle, part, cycle) for begin in (0.0, count - part))
        if _sticks(motion):
            return "held", motion, none
        opened = opened or first
        if sliding.stable and last < DYING * min(opened, 1.0):
            return "steady sliding", motion, none
        if last > LEAST:
            repeating = settled_cycle(motion, cycle)
            if (
                repeating is not None
                and abs(repeating[1][0]) < 1
                and _size(repeating[0], sliding, 0.0, 1.0, cycle) > LEAST
            ):
                return "periodic", *repeating
        done += count
        if done >= patience:
            settled = abs(last / first - 1) < UNSETTLED and sliding.growth != 0
            return "not periodic" if settled else "not settled", motion, none
        state = state.copy()
        state[:physical], mode, count = end[:physical], after, min(done, patience - done)


def _sticks(motion: Trajectory) -> bool:
    """Whether the last piece is a rest on the counter-face that lasts."""
    mode = motion.table.modes[motion.modes[-1]]
    return mode.friction is None and bool(motion.durations[-1] > 0.5 * motion.duration)


def _vector(sliding: Stability) -> tuple[int, Array]:
    """The fastest growing mode as (q, v) about steady sliding, and where it moves most."""
    mode = sliding.modes[0]
    value = complex(mode.growth, 2 * math.pi * mode.frequency)
    return int(np.argmax(np.abs(mode.shape))), np.concatenate([mode.shape.real, (value * mode.shape).real])


def _reach(sliding: Stability, system: System) -> float:
    """Size of that mode's vibration at which a contact would lift off or stop: what every size is measured by."""
    mode, speed = sliding.modes[0], system.drive.speed  # type: ignore[attr-defined]
    rate = abs(complex(mode.growth, 2 * math.pi * mode.frequency))
    if not isinstance(system, Structure):
        return float(abs(speed) / (rate * abs(mode.shape[0])))
    limits = []
    for contact, load in zip(system.contacts, sliding.loads, strict=True):
        limits.append((abs(contact.carried * speed), rate * abs(np.asarray(contact.tangent) @ mode.shape)))
        if contact.normal is not None:
            limits.append((abs(load), contact.stiffness * abs(np.asarray(contact.normal) @ mode.shape)))
    return float(min((limit / share for limit, share in limits if share > 0 and limit > 0), default=1.0))


def _pushed(system: System, table: Table, sliding: Stability, push: float) -> tuple[Array, int]:
    """State and mode at the start of a vibration: what is compliant slides already, as it does in steady sliding."""
    rest = np.append(sliding.place, np.zeros(len(sliding.place)))
    start = rest + push * _reach(sliding, system) * _vector(sliding)[1]
    state, mode = opening(table, dict(zip(table.names, map(float, start), strict=False)))
    carried = [one.carried for one in system.contacts] if isinstance(system, Structure) else [1.0]
    sides = [-np.sign(share * system.drive.speed) for share in carried]  # type: ignore[attr-defined]
    sliding_to = [[(part.kind, part.side) for part in _parts(joint)] for joint in table.modes]
    slides = [j for j, parts in enumerate(sliding_to) if parts == [("slip", side) for side in sides]]
    return state, slides[0] if len(slides) == 1 and push < 1 else mode


def _parts(mode: Any) -> tuple[Any, ...]:
    """The mode of each contact."""
    return tuple(getattr(mode, "parts", (mode,)))


def _size(motion: Trajectory, sliding: Stability, begin: float, cycles: float, cycle: float) -> float:
    """Of the vibration in cycles from `begin`, as a share of the one that would lift or stop a contact."""
    most, _ = _vector(sliding)
    times = np.linspace(begin, min(begin + cycles * cycle, motion.duration), 1 + int(64 * cycles))
    path = motion.sample(times, ("x",))[0][most] - sliding.place[most]
    return float(np.max(np.abs(path))) / _reach(sliding, motion.system)


def _growth(system: System, table: Table, sliding: Stability, cycle: float) -> float:
    """Of a small vibration [1/s]: how fast its share in the fastest mode grows as simulated."""
    if sliding.status != "ok":
        return math.nan
    state, mode = _pushed(system, table, sliding, SMALL)
    duration = min(8 * cycle, 2 / abs(sliding.growth) if sliding.growth else math.inf)
    run = stretch(system, table, state, mode, span=(0.0, duration))
    path = run.sample([0.0, duration], ("x", "v"))[0].T - np.append(sliding.place, np.zeros(len(sliding.place)))
    columns = []
    for one in sliding.modes:
        value = complex(one.growth, 2 * math.pi * one.frequency)
        vector = np.concatenate([one.shape, value * one.shape])
        columns += [vector, vector.conj()] if one.frequency else [vector]
    shares = [abs(np.linalg.lstsq(np.array(columns).T, deviation, rcond=None)[0][0]) for deviation in path]
    return math.log(shares[1] / shares[0]) / duration


def _swings(motion: Trajectory) -> tuple[Array, float]:
    """Half the swing of each displacement, and of the contact that slides to and fro most."""
    times = np.linspace(0.0, motion.duration, SAMPLES)
    x = motion.sample(times, ("x",))[0]
    system = motion.system
    slides = system.tangents @ x if isinstance(system, Structure) else x
    return _half(x), float(np.max(_half(slides)))


def _half(paths: Array) -> Array:
    """Half of greatest less least, each at the top of the parabola through three samples."""

    def top(path: Array) -> float:
        j = int(np.clip(np.argmax(path), 1, len(path) - 2))
        before, here, after = path[j - 1 : j + 2]
        bend = before - 2 * here + after
        return float(here - (after - before) ** 2 / (8 * bend)) if bend < 0 else float(np.max(path))

    return np.array([(top(path) + top(-path)) / 2 for path in paths])


def _frequency(status: str, motion: Trajectory, sliding: Stability) -> float:
    """At which the motion repeats, or rises through its mean where it moves most [Hz]."""
    if status in ("periodic", "unstable"):
        return 1 / motion.duration
    if status in ("steady sliding", "held"):
        return 0.0
    times = np.linspace(0.0, motion.duration, 16 * SAMPLES)
    path = motion.sample(times, ("x",))[0][_vector(sliding)[0]]
    path = path - np.mean(path)
    rises = times[1:][(path[:-1] < 0) & (path[1:] >= 0)]
    return float((len(rises) - 1) / (rises[-1] - rises[0])) if len(rises) > 1 else 0.0


def _shares(motion: Trajectory) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Share of the time that each contact holds, and is lifted off."""
    kinds = np.array([[part.kind for part in _parts(mode)] for mode in motion.table.modes])[motion.modes]
    weights = motion.durations / motion.duration
    stuck = weights @ ((kinds == "stick") | (kinds == "microstick"))
    return tuple(map(float, stuck)), tuple(map(float, weights @ (kinds == "flight")))


EARLY = 1e-9  # of the holding torque, by which a slip begins early
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
    law: Law, *, inertia: float, kp: float, ki: float, kd: float, most: float = math.inf, fastest: float = math.inf
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
        start = {"x": place, "integral": self.wound(place) * (1 + math.copysign(EARLY, self.wound(place) * place))}
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
