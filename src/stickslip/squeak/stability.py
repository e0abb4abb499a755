"""Does steady sliding last, or do motions couple, or friction that falls with speed feeds them, until it squeals?

What slides steadily, made linear: masses, dampers and springs, and what its contacts' friction adds to them. A virtual
rig that squeaks: rubber on steel, dry or wet, lightly or heavily loaded.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np

from stickslip.arrays import Array, Complex
from stickslip.drives.kinds import Belt, HarmonicBase
from stickslip.errors import ModelError
from stickslip.laws.base import Exit
from stickslip.laws.coulomb import LinearSlope
from stickslip.laws.curved import CurvedMode, lifted, symbol
from stickslip.oscillator import Contact, Oscillator, Structure
from stickslip.parameters import finite
from stickslip.units import parse_constant

ROUNDING = 1e-11  # of the largest eigenvalue: growth below it is none
STEPS = 30  # of Newton towards steady sliding under loads that grow with a power: a dozen reach it from no load
JAMS, ITSELF = "jamming", "the structure itself"

Matrices = tuple[Array, Array, Array]
System = Oscillator | Structure


@dataclass(frozen=True, eq=False)
class SlidingMode:
    """One way in which a sliding structure vibrates.

    Attributes
    ----------
    frequency : float
        [Hz]; 0 where the motion does not oscillate.
    growth : float
        Real part of the eigenvalue [1/s]; positive where it grows.
    shape : ndarray of complex, shape (n,)
        Displacements against the largest one, which is 1: what their angles differ by is the phase between them.
    """

    frequency: float
    growth: float
    shape: Complex

    @property
    def damping_ratio(self) -> float:
        """Share of critical damping; negative where the motion grows."""
        size = math.hypot(self.growth, 2 * math.pi * self.frequency)
        return -self.growth / size if size and self.growth else 0.0


@dataclass(frozen=True, eq=False)
class Stability:
    """Whether steady sliding lasts, and what ends it.

    Attributes
    ----------
    stable : bool
        Whether every small vibration dies away (or, without any damping, does not grow).
    modes : tuple of SlidingMode
        Those that grow fastest first.
    mechanism : str
        "stable", or what feeds the growth: "mode coupling", "falling friction", "mode coupling and falling friction
        together" (neither alone is enough), "mode coupling and rising friction together" (so too, where no friction
        falls: what damps one motion alone can feed both), "mode coupling, and falling friction too" (each alone is
        enough), "jamming" (the contact draws itself in without oscillating, as a sprag does), or "the structure itself"
        (it grows without any friction: dampers that feed it, springs that buckle).
    growth : float
        Fastest growth [1/s].
    without_coupling, without_slope : float
        The same where friction does not follow the load, and where it does not change with the speed [1/s].
    place : tuple of float
        Displacements while it slides steadily [m, or rad of an angle].
    loads : tuple of float
        Load on each contact there [N].
    status : str
        "ok", or why steady sliding is not what the contacts would do.
    """

    stable: bool
    modes: tuple[SlidingMode, ...]
    mechanism: str
    growth: float
    without_coupling: float
    without_slope: float
    place: tuple[float, ...]
    loads: tuple[float, ...]
    status: str

    @property
    def frequency(self) -> float:
        """Frequency of the mode that grows fastest, or dies away slowest [Hz]."""
        return self.modes[0].frequency

    @property
    def course(self) -> str:
        """What that mode does; at the border two modes meet, and their growth is the root of a rounding."""
        if self.stable and self.growth >= 0:
            return "neither grows nor dies away"
        return f"{'grows' if self.growth > 0 else 'dies away'} by {abs(self.growth):.4g} 1/s"

    def __repr__(self) -> str:
        head = f"Stability: {self.mechanism}, {self.frequency:.4g} Hz {self.course}"
        rows = [f"{mode.frequency:.5g} Hz, damping ratio {mode.damping_ratio:.3g}" for mode in self.modes]
        return "\n  ".join([head if self.status == "ok" else f"{head} [{self.status}]", *rows])


def stability(system: System, *, speed: float | None = None) -> Stability:
    r"""Does steady sliding last, and if not, what feeds the vibration?

    Small motions about steady sliding obey

    .. math:: M\ddot q + \Big(C + \sum s\,w_t w_t^T\Big)\dot q
        + \Big(K + \sum k_n\,w_n w_n^T + \sum \pm\mu\,k_n\,w_t w_n^T\Big)\,q = 0

    with s the slope of friction against sliding speed [N s/m]. The last sum is not symmetric: through it two motions
    of like frequency couple and one takes up energy, whatever the slope (Hoffmann, Fischer, Allgaier and Gaul, "A
    minimal model for studying properties of the mode-coupling type instability", 2002). A negative s feeds the motion
    by itself (Stribeck). Each is switched off in turn to tell which it was. A contact with a stiffness of its own
    (CompliantContact) slides as a rigid one does.

    Parameters
    ----------
    system : Structure or Oscillator
        What slides: on a belt, or at the speed given.
    speed : float, optional
        Of the counter-face [m/s]; that of the system's Belt where left out.

    Returns
    -------
    Stability

    Raises
    ------
    ModelError
        Nothing slides, no speed is known, or the law's memory has a part in the vibration.

    Examples
    --------
    A pad pressed on a belt, sprung along it and across it (the minimal model of Hoffmann and others):

    >>> from stickslip import Contact, Structure

    >>> from stickslip.drives import Belt

    >>> from stickslip.laws import Coulomb
    >>> pad = Contact(Coulomb(0.6), [1, 0], normal=[0, 1], stiffness=11.0, preload=5.0)
    >>> springs, none = [[23.25, 3.9], [3.9, 7.75]], [[0, 0], [0, 0]]
    >>> found = stability(Structure([[1, 0], [0, 1]], none, springs, contacts=[pad], drive=Belt(1.0)))
    >>> found.mechanism, round(found.frequency, 3)
    ('mode coupling', 0.73)
    """
    mass, damping, stiffness, contacts = sliding_parts(system, speed)
    place, loads, status = _rest(stiffness, contacts)
    rubbing = [r.about(load) for r, load in zip(contacts, loads, strict=True)]
    pressed = stiffness + sum((r.stiffness * np.outer(r.normal, r.normal) for r in rubbing), np.zeros_like(mass))
    follows = sum((r.follows for r in rubbing), np.zeros_like(mass))
    falls = sum((r.slope * np.outer(r.tangent, r.tangent) for r in rubbing), np.zeros_like(mass))
    whole = (mass, damping + falls, pressed + follows)
    uncoupled, unsloped = (mass, damping + falls, pressed), (mass, damping, pressed + follows)
    bare = (mass, damping, pressed)
    modes = modes_of(whole)
    return Stability(
        stable=margin(whole) <= ROUNDING,
        modes=modes,
        mechanism=_mechanism(whole, bare, uncoupled, unsloped, modes, any(r.slope < 0 for r in rubbing)),
        growth=modes[0].growth,
        without_coupling=modes_of(uncoupled)[0].growth,
        without_slope=modes_of(unsloped)[0].growth,
        place=place,
        loads=loads,
        status=status,
    )


def margin(matrices: Matrices) -> float:
    """Negative where small motions die away; it passes through zero, with a slope, where one begins to grow.

    Without damping, minus the least square of the difference of two squared frequencies, or the least squared
    frequency, over their size; else the fastest growth over the largest eigenvalue.
    """
    mass, damping, stiffness = matrices
    if damping.any():
        values = np.linalg.eigvals(_flow(matrices))
        return float(np.max(values.real) / np.max(np.abs(values)))
    squares = np.linalg.eigvals(np.linalg.solve(mass, stiffness)).astype(complex)
    size = float(np.max(np.abs(squares))) or 1.0
    apart = [float(((a - b) ** 2).real) / size**2 for a, b in combinations(squares, 2)]
    return max(-min(apart, default=math.inf), -float(np.min(squares.real)) / size)


def _flow(matrices: Matrices) -> Array:
    """A of the state (q, q')."""
    mass, damping, stiffness = matrices
    count = len(mass)
    flow = np.zeros((2 * count, 2 * count))
    flow[:count, count:] = np.eye(count)
    flow[count:] = -np.linalg.solve(mass, np.hstack([stiffness, damping]))
    return flow


def modes_of(matrices: Matrices) -> tuple[SlidingMode, ...]:
    """One for each pair of eigenvalues and each real one, those that grow fastest first."""
    values, vectors = np.linalg.eig(_flow(matrices))
    largest, count = float(np.max(np.abs(values))), len(matrices[0])
    modes = []
    for value, vector in zip(values, vectors.T, strict=True):
        if value.imag < -ROUNDING * largest:
            continue
        shape = vector[:count] / vector[np.argmax(np.abs(vector[:count]))]
        growth = float(value.real) if abs(value.real) > ROUNDING * largest else 0.0
        frequency = float(value.imag) if value.imag > ROUNDING * largest else 0.0
        modes.append(SlidingMode(frequency / (2 * math.pi), growth, shape))
    return tuple(sorted(modes, key=lambda mode: (-mode.growth, mode.frequency)))


def _mechanism(
    whole: Matrices, bare: Matrices, uncoupled: Matrices, unsloped: Matrices, modes: Sequence[SlidingMode], falls: bool
) -> str:
    if margin(whole) <= ROUNDING:
        return "stable"
    if margin(bare) > ROUNDING:
        return ITSELF
    grows_by_slope, grows_by_coupling = margin(uncoupled) > ROUNDING, margin(unsloped) > ROUNDING
    if modes[0].frequency == 0 and grows_by_coupling:
        return JAMS
    if grows_by_slope and grows_by_coupling:
        return "mode coupling, and falling friction too"
    if not grows_by_slope and not grows_by_coupling:
        return f"mode coupling and {'falling' if falls else 'rising'} friction together"
    return "falling friction" if grows_by_slope else "mode coupling"


def _rest(stiffness: Array, rubbing: Sequence[Rubbing]) -> tuple[tuple[float, ...], tuple[float, ...], str]:
    """Place and loads of steady sliding by Newton's steps, of which linear loads take one; and whether it can be."""
    place, none = np.zeros(len(stiffness)), np.zeros_like(stiffness)
    for _ in range(1 if all(r.power == 1 for r in rubbing) else STEPS):
        loads = tuple(float(r.load(place)) for r in rubbing)
        around = [r.about(load) for r, load in zip(rubbing, loads, strict=True)]
        steep = stiffness + sum((r.stiffness * np.outer(r.normal, r.normal) + r.follows for r in around), none)
        if np.linalg.cond(steep) > 1 / np.finfo(float).eps:
            unpressed = tuple(r.preload for r in rubbing)
            return (math.nan,) * len(place), unpressed, "no spring holds it: the loads are those before it slides"
        pairs = zip(rubbing, loads, strict=True)
        forces = ((load - r.preload) * r.normal + r.at(load) * r.tangent for r, load in pairs)
        residual = stiffness @ place + sum(forces, 0)
        step = np.linalg.solve(steep, residual)
        place = place - step
        if np.linalg.norm(step) <= np.finfo(float).eps * np.linalg.norm(place):
            break
    loads = tuple(float(r.load(place)) for r in rubbing)
    lifting = [str(j) for j, load in enumerate(loads, start=1) if load <= 0]
    status = f"contact {', '.join(lifting)} would lift off before it slides steadily" if lifting else "ok"
    return tuple(map(float, place)), loads, status


@dataclass(frozen=True, eq=False)
class Rubbing:
    """A contact that slides steadily: its friction is level N(w_n q) + slope (w_t q' - face)."""

    tangent: Array
    normal: Array
    stiffness: float
    preload: float
    level: float
    slope: float
    velocity: float
    power: float = 1.0

    def load(self, place: Array) -> float:
        """Normal load at displacements [N]; of a power it ends where the contact opens."""
        closed = self.preload + self.stiffness / self.power * float(self.normal @ place)
        return closed if self.power == 1 else self.preload * (max(closed, 0.0) / self.preload) ** self.power

    def about(self, load: float) -> Rubbing:
        """The same with the normal stiffness that it has under a load [N]."""
        if self.power == 1:
            return self
        return replace(self, stiffness=self.stiffness * (load / self.preload) ** (1 - 1 / self.power))

    @property
    def follows(self) -> Array:
        """What the friction adds to K because it follows the load."""
        return self.level * self.stiffness * np.outer(self.tangent, self.normal)

    def at(self, load: float) -> float:
        """Friction force under a load [N]."""
        return self.level * load + self.slope * self.velocity


def sliding_matrices(system: System, speed: float | None) -> Matrices:
    """M, C, K of small motions about steady sliding."""
    mass, damping, stiffness, contacts = sliding_parts(system, speed)
    _, loads, _ = _rest(stiffness, contacts)
    for r in (contact.about(load) for contact, load in zip(contacts, loads, strict=True)):
        damping = damping + r.slope * np.outer(r.tangent, r.tangent)
        stiffness = stiffness + r.stiffness * np.outer(r.normal, r.normal) + r.follows
    return mass, damping, stiffness


def sliding_parts(system: System, speed: float | None) -> tuple[Array, Array, Array, list[Rubbing]]:
    """M, C, K without contacts, and the contacts."""
    if not isinstance(system, Oscillator | Structure):
        raise ModelError(f"a system {system!r}", "what slides is an Oscillator or a Structure", "give one")
    if speed is None:
        if not isinstance(system.drive, Belt):
            raise ModelError(
                f"a system driven by {type(system.drive).__name__}",
                "steady sliding needs a counter-face that runs at a steady speed",
                "give it drive=Belt(speed), or say speed=",
            )
        speed = system.drive.speed
    if finite("speed", speed, unit="m/s", signed=True) == 0:
        raise ModelError(
            f"speed = {speed} m/s", "a counter-face that slides has a speed", "give a number that is not 0"
        )
    if isinstance(system, Oscillator):
        numbers = (np.array([[value]]) for value in (system.mass, system.damping, system.stiffness))
        level, slope = _curve(system.law, -speed)
        one, none = np.ones(1), np.zeros(1)
        return *numbers, [Rubbing(one, none, 0.0, 1.0, level, slope, -speed)]  # type: ignore[return-value]
    if not system.contacts:
        raise ModelError("a structure without contacts", "something has to rub", "give it contacts=[...]")
    matrices = (np.asarray(part, dtype=np.float64) for part in (system.mass, system.damping, system.stiffness))
    return *matrices, [_rubbing(contact, speed) for contact in system.contacts]  # type: ignore[return-value]


def _rubbing(contact: Contact, speed: float) -> Rubbing:
    tangent = np.asarray(contact.tangent)
    normal = np.zeros_like(tangent) if contact.normal is None else np.asarray(contact.normal)
    velocity = -contact.carried * speed
    if velocity == 0:
        raise ModelError(
            "a contact whose counter-face is at rest (carried = 0)",
            "every contact slides while sliding is steady",
            "give carried=, or leave that contact out",
        )
    level, slope = _row(contact, velocity)
    return Rubbing(tangent, normal, contact.stiffness, contact.preload, level, slope, velocity, contact.power)


def _row(part: Any, velocity: float) -> tuple[float, float]:
    """Friction of the slip that lasts at a relative velocity: its share of the load, and its slope."""
    side = 1 if velocity > 0 else -1
    for mode in part.modes() if hasattr(part, "modes") else ():
        if isinstance(mode, CurvedMode):
            if (mode.kind, mode.side) != ("slip", side) or mode.friction is None or mode.friction.symbols - {"v"}:
                continue
            if getattr(part, "normal", None) is not None:
                break  # its slope follows the load
            slope = mode.friction.slope("v").at(v=velocity)
            return mode.friction.at(v=velocity) - slope * velocity, slope * getattr(part, "preload", 1.0)
        if mode.kind == "slip" and mode.side == side and all(_lasts(exit_, velocity) for exit_ in mode.exits):
            if mode.rates or mode.friction is None or set(mode.friction) - {"1", "v"}:
                break
            return mode.friction.get("1", 0.0), mode.friction.get("v", 0.0)
    law = part.law if isinstance(part, Contact) else part
    raise ModelError(
        f"{type(law).__name__}, which remembers",
        "steady sliding is told of friction that follows speed and load alone",
        "use Coulomb, LinearSlope, Tabulated, CompliantContact or a curve; of a mass on a belt ask steady_sliding()",
    )


def _lasts(exit_: Exit, velocity: float) -> bool:
    """Whether an exit that is about the speed stays shut."""
    if "v" not in exit_.quantity or set(exit_.quantity) - {"v", "1", "always"}:
        return True
    bound = exit_.quantity.get("1", 0.0) + exit_.quantity.get("always", 0.0)
    return exit_.quantity["v"] * velocity + bound <= 0


def _curve(law: Any, velocity: float) -> tuple[float, float]:
    """Friction force at rest of the tangent to the law's curve at a relative velocity, and the tangent's slope."""
    if not hasattr(law, "branches"):
        return _row(law, velocity)
    side, fast = math.copysign(1.0, velocity), abs(velocity)
    curve = max((branch for branch in law.branches() if branch[0] <= fast), key=lambda branch: branch[0])[1]
    friction = lifted(curve(symbol("v")))
    slope = friction.slope("v").at(v=fast)
    return side * (friction.at(v=fast) - slope * fast), slope


MASS, STIFFNESS, BEARING = 1.92, 2310.0, 0.0177  # kg, N/m and damping ratio of the linear bearing (sections 2.2, 6.5)
FORCING = 5.0  # Hz
HEAVY = 6.13  # N
BENDING, TORSION = 185.0, 250.0  # Hz, of the beam without its contacts (section 7.3)

# chosen: the thesis does not give them
BEAM, INERTIA = 0.02, 5e-6  # kg and kg m^2 that move at the beam's tip
BENDING_DAMPING, TORSION_DAMPING = 0.017, 0.01
ENGAGED = 484.0  # Hz of bending alone with both contacts engaged under the heavy load
HERTZ = 1 / 3  # contact stiffness grows with this power of the load, as that of a sphere does
ARM, OFFSET = 13.8e-3, -0.95e-3  # m: half the distance of the contacts, and how far their middle is from the axis
LEVER, SKEW = 1.7e-3, 2.3e-3  # m: height of the contacts over the axis, and how much they differ from it


@dataclass(frozen=True)
class Surface:
    """Friction coefficient of both contacts at vanishing speed, and its slope [s/m]."""

    friction: float
    slope: float


# 20 and 8 N (section 7.2); slopes chosen
SURFACES = {"dry": Surface(20 / HEAVY, 2.3), "wet": Surface(8 / HEAVY, -0.26)}


def squeak_rig(surface: str = "wet", load: float | str = HEAVY, *, amplitude: float = 8e-3) -> Structure:
    r"""A rig that squeaks where it is wet and heavily loaded, and only there.

    A mass on a linear bearing is driven by its base at 5 Hz and rubs on two rubber hemispheres at the tip of a
    beam, which bends towards the mass and twists: three degrees of freedom (x of the mass, x2 of the tip across it,
    x3 its angle [rad]), tangential, normal and rotational, as section 8.2 of the thesis asks for. Of chapter 7 are the
    masses, springs, frequencies and friction levels; inertia, levers, slopes and damping of the beam are chosen so that
    its four observations hold together: the contacts stiffen with the load until bending and torsion, at 185 and 250 Hz
    without contact, meet near 490 Hz; water lowers friction to where they couple (dry, friction shifts torsion past
    bending), while its falling slope alone is too weak. Which of them decides, :func:`stability` says.

    Parameters
    ----------
    surface : {"wet", "dry"}
        Friction of 8 or 20 N under the heavy load, falling or rising with speed.
    load : float or str
        Normal load on both contacts together [N]; the thesis has 6.13 and 1.23.
    amplitude : float
        Of the mass's motion [m], roughly: the base moves as far as that takes against the friction by harmonic balance.
        Where friction nearly holds the mass the motion is up to two thirds smaller; to drive it to like motions, as
        the thesis did, move the base as the mass alone needs it (``stickslip_thesis.chapter7.base_for``).

    Returns
    -------
    Structure
        Driven by a :class:`HarmonicBase`; for steady sliding give it a Belt: ``rig.having(drive=Belt(0.1))``.

    Raises
    ------
    ModelError
        No such surface, or a load or an amplitude that is not positive.

    Examples
    --------
    >>> for surface, load in [("dry", 6.13), ("wet", 6.13), ("dry", 1.23), ("wet", 1.23)]:
    ...     print(surface, load, stability(squeak_rig(surface, load), speed=-0.1).mechanism)
    dry 6.13 stable
    wet 6.13 mode coupling
    dry 1.23 stable
    wet 1.23 stable
    """
    if surface not in tuple(SURFACES):
        raise ModelError(f"surface = '{surface}'", f"it is {' or '.join(SURFACES)}", "choose one of them")
    load = parse_constant("load", load, "N")
    amplitude = finite("amplitude", amplitude, unit="m", positive=True)
    rubber, turn = SURFACES[surface], 2 * math.pi
    bends, twists = BEAM * (turn * BENDING) ** 2, INERTIA * (turn * TORSION) ** 2
    stiffness = BEAM * turn**2 * (ENGAGED**2 - BENDING**2) * (load / HEAVY) ** HERTZ
    damping = [
        2 * BEARING * math.sqrt(MASS * STIFFNESS),
        2 * BENDING_DAMPING * math.sqrt(BEAM * bends),
        2 * TORSION_DAMPING * math.sqrt(INERTIA * twists),
    ]
    contacts = [
        Contact(
            LinearSlope(rubber.friction, slope=rubber.slope),
            [1, 0, LEVER + side * SKEW],
            normal=[0, 1, OFFSET + side * ARM],
            stiffness=stiffness / 2,
            preload=load / 2,
        )
        for side in (1, -1)
    ]
    return Structure(
        np.diag([MASS, BEAM, INERTIA]),
        np.diag(damping),
        np.diag([STIFFNESS, bends, twists]),
        contacts=contacts,
        drive=HarmonicBase(_base(rubber.friction * load, amplitude), frequency=FORCING),
        acts_on=[1, 0, 0],
        rotations=[3],
    )


def _base(friction: float, amplitude: float) -> float:
    """Amplitude of the base that moves the mass so far, by harmonic balance [m]."""
    detuned = 1 - (2 * math.pi * FORCING) ** 2 * MASS / STIFFNESS
    return math.hypot(amplitude * detuned, 4 * friction / (math.pi * STIFFNESS))
