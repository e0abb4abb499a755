"""Flat tables of linear modes: everything the compiled kernels read, and the systems that they are assembled from.

The state is one vector S: displacements, velocities, the laws' memory, the constant 1 and the drive's signals. In each
mode it obeys S' = A S; each exit is a row q that ends the mode when q S rises above zero, and a matrix R that carries
the state over: S -> R S. All closed forms, certificates and Jacobians follow from A, q and R.

Many systems of one kind are held at once, entry by entry along a leading axis; one system is a batch of one. An
oscillator is a structure of one mass with one contact.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from stickslip.arrays import Array, Index, Mask
from stickslip.drives.kinds import Drive, Motion
from stickslip.errors import ModelError
from stickslip.laws.base import Exit, Law, Mode
from stickslip.laws.curved import CurvedMode, compared_by_value, with_sliding_modes
from stickslip.oscillator import Oscillator, Structure
from stickslip.solve.cells import Linear

MOST = 4096  # joint modes; more would not fit a desk


@dataclass(frozen=True)
class JointMode(Mode):
    """A mode of every contact at once, named after them; its side is that of the first contact that slides.

    Attributes
    ----------
    parts : tuple of Mode
        The mode of each contact.
    owners : tuple of int
        Number of the contact that each exit belongs to.
    """

    parts: tuple[Mode, ...] = ()
    owners: tuple[int, ...] = ()

    @classmethod
    def of(cls, parts: tuple[Mode, ...], taken: list[tuple[Exit, int]]) -> JointMode:
        """The joint mode of some parts, with the exits that end it and the contacts these belong to."""
        return cls(
            name=" + ".join(part.name for part in parts) or "free",
            kind=" + ".join(part.kind for part in parts) or "free",
            side=next((part.side for part in parts if part.side), 0),
            friction=None if parts and all(part.friction is None for part in parts) else {},
            exits=tuple(exit_ for exit_, _ in taken),
            parts=parts,
            owners=tuple(owner for _, owner in taken),
        )

    def changes(self, before: Mode, leaving: int) -> Iterator[tuple[int, Mode, Mode]]:
        """Each contact whose mode has changed, and the one whose exit it was; by -1, a jump of the drive, of none."""
        if not isinstance(before, JointMode):
            raise TypeError(f"{before.name} is no mode of several contacts")
        for contact, (old, new) in enumerate(zip(before.parts, self.parts, strict=True)):
            if old is not new or (leaving >= 0 and contact == before.owners[leaving]):
                yield contact, old, new


class Stops(NamedTuple):
    """Instants (K, 2), in laps and seconds, to which a march goes in turn, and the entries of the state (P,) that take
    new values (K, P) as each begins to be gone to."""

    ends: Array
    places: Index
    values: Array


class Joint(NamedTuple):
    """Number of each contact's mode; contact and number (within its mode) of each exit, and the joint mode behind."""

    numbers: tuple[int, ...]
    exits: list[tuple[int, int]]
    targets: list[int]


def reached(tables: Sequence[Sequence[Mode]], seeds: Sequence[tuple[str, ...]]) -> list[Joint]:
    """The joint modes that follow from some: a mode's name for every contact.

    Where a contact is landing no time passes, and none but its own exits are asked.
    """
    known = [{mode.name: number for number, mode in enumerate(table)} for table in tables]
    order = {tuple(own[name] for own, name in zip(known, seed, strict=True)): j for j, seed in enumerate(seeds)}
    waiting = list(order)
    joints: list[Joint] = []
    for numbers in waiting:
        parts = [table[number] for table, number in zip(tables, numbers, strict=True)]
        landing = [c for c, part in enumerate(parts) if part.kind == "landing"]
        exits = [(c, e) for c in landing[:1] or range(len(parts)) for e in range(len(parts[c].exits))]
        joints.append(Joint(numbers, exits, []))
        for c, e in exits:
            following = (*numbers[:c], known[c][parts[c].exits[e].to], *numbers[c + 1 :])
            if following not in order:
                if len(order) == MOST:
                    raise ModelError(
                        f"{len(tables)} contacts with more than {MOST} joint modes",
                        f"at most {MOST} are built",
                        "join contacts, or leave those that hardly move out",
                    )
                order[following] = len(order)
                waiting.append(following)
            joints[-1].targets.append(order[following])
    return joints


def numbered(name: str, count: int) -> tuple[str, ...]:
    """The name alone for one, else name1, name2 ..."""
    return (name,) if count == 1 else tuple(f"{name}{j + 1}" for j in range(count))


System = Oscillator | Structure


@dataclass(frozen=True, eq=False)
class Tables:
    """Systems as flat tables: B systems of m contacts with M modes, E exits and N entries of the state.

    Those of one system (:func:`table_of`) have no leading axis B.

    Attributes
    ----------
    names : tuple of str
        What each entry of the state is.
    modes : tuple of Mode
        The law's table, or the joint modes of several contacts, for names, kinds and sides.
    flow, cell, hop, series, target, crossing, reset, first, tones : ndarray
        As in :class:`stickslip.solve.cells.Linear`.
    friction : ndarray (B, M, m, N)
        Friction force of each contact as a linear form of the state.
    outputs : mapping of str to ndarray (B, N) or (B, m, N)
        Base displacement "z", relative velocity "slip", the counter-face's displacement "face" and velocity
        "face_rate", applied "force"; of a structure the contacts' "load" (B, M, m, N).
    motions : tuple of Motion
        The drive of each.
    period : ndarray (B,)
        Of the drive [s]; infinite where there is none.
    begin : ndarray (B, N)
        The drive's signals at time 0, and the constant.
    opening : ndarray (B, physical, N)
        Each physical entry at the start, where it is not given, as a linear form of the entries before it.
    physical : int
        Number of leading entries that belong to the masses and the laws.
    degrees : int
        Degrees of freedom: the state starts with their displacements, then their velocities.
    entry : tuple of int
        Modes in which motion starts with negative, zero and positive relative velocity.
    settling : frozenset of int
        Exits that are no event, see :mod:`stickslip.solve.settling`.
    """

    names: tuple[str, ...]
    modes: tuple[Mode, ...]
    flow: Array
    cell: Array
    hop: Array
    series: Array
    target: Index
    crossing: Mask
    reset: Array
    first: Index
    tones: Array
    friction: Array
    outputs: Mapping[str, Array]
    motions: tuple[Motion, ...]
    period: Array
    begin: Array
    opening: Array
    physical: int
    degrees: int
    entry: tuple[int, int, int]
    settling: frozenset[int] = frozenset()

    def of(self, number: int) -> Tables:
        """The tables of one system, without the leading axis."""
        own = {name: getattr(self, name)[number] for name in OWN}
        outputs = {name: rows[number] for name, rows in self.outputs.items()}
        return replace(self, **own, outputs=outputs, motions=(self.motions[number],))

    @property
    def linear(self) -> Linear:
        """The arrays that the kernels read."""
        return Linear(*(getattr(self, name) for name in Linear._fields))

    @property
    def motion(self) -> Motion:
        """The drive of the first system, or of the only one."""
        return self.motions[0]

    @cached_property
    def leap(self) -> Array:
        """What carries the state from a mode to another through modes in which no time passes (B, M, M, N, N)."""
        size = len(self.names)
        resets = self.reset.reshape(-1, len(self.target), size, size)
        leaps = _leaps(self.first, self.target, resets)
        return leaps if self.reset.ndim == 4 else leaps[0]

    def index(self, mode: str) -> int:
        """Number of the mode of that name."""
        return mode_number(self.modes, mode)


def mode_number(modes: Sequence[Mode | CurvedMode], mode: str) -> int:
    """The place of the mode of that name."""
    names = [m.name for m in modes]
    if mode not in names:
        raise ModelError(f"no mode is called '{mode}'", f"the law has {', '.join(names)}", "choose one of them")
    return names.index(mode)


SHARED = {"target", "crossing", "first"}
OWN = tuple(f.name for f in fields(Tables) if f.type in ("Array", "Index") and f.name not in SHARED)


class Rubbing(NamedTuple):
    """One contact of systems of one kind.

    Attributes
    ----------
    laws : sequence of Law
        The different ones, which name the same modes.
    tables : sequence of tuple of Mode
        The modes of each, with what the contact adds to them.
    which : ndarray (B,)
        The law that each system has.
    tangent, normal : ndarray (n,)
        Directions in which it slides and, if its load follows the motion, in which it is pressed.
    stiffness, preload : float
        The load is preload + stiffness * (normal @ displacements).
    carried : float
        Share of the counter-face's motion.
    """

    laws: Sequence[Law]
    tables: Sequence[tuple[Mode, ...]]
    which: Index
    tangent: Array
    normal: Array | None = None
    stiffness: float = 0.0
    preload: float = 1.0
    carried: float = 1.0


@dataclass(frozen=True, eq=False)
class Systems:
    """B systems of one kind: the same contacts under laws that name the same modes, drives that name the same signals.

    Attributes
    ----------
    contacts : tuple of Rubbing
        Where they rub.
    drives : tuple of Drive
        The different ones.
    drive : ndarray (B,)
        Which drive each system has.
    mass, stiffness, damping : ndarray (B, n, n)
        In kg, N/m and N s/m.
    on_base : ndarray (B,)
        Whether the dampers are fixed to the base.
    share : ndarray (n,)
        Of the drive on each degree of freedom.
    seeds : tuple of tuple of str
        Names of the contacts' modes from which all others are reached.
    joint : bool
        Whether a mode is told as one of several contacts.
    """

    contacts: tuple[Rubbing, ...]
    drives: tuple[Drive, ...]
    drive: Index
    mass: Array
    stiffness: Array
    damping: Array
    on_base: Mask
    share: Array
    seeds: tuple[tuple[str, ...], ...]
    joint: bool


def is_curved(system: System) -> bool:
    """Whether a contact has a law of curved modes, or a load that does: then Taylor series are marched."""
    return bool(curves_of(system))


def curves_of(system: System) -> list[str]:
    """What is curved in the contacts of a system, in words."""
    curved = [type(law).__name__ for law in laws_of(system) if hasattr(law, "rates")]
    contacts = system.contacts if isinstance(system, Structure) else ()
    return curved + [f"a load of power {contact.power:g}" for contact in contacts if contact.power != 1]


def laws_of(system: System) -> list[Any]:
    """The law of each contact.

    Raises
    ------
    ModelError
        No oscillator and no structure: a mass in a plane, whose two motions one contact couples.
    """
    if not isinstance(system, Oscillator | Structure):
        raise ModelError(
            f"a {type(system).__name__}",
            "this is asked of masses that move along a line; one in a plane is simulated alone",
            "give an Oscillator or a Structure",
        )
    return [contact.law for contact in system.contacts] if isinstance(system, Structure) else [system.law]


def require_oscillator(system: object, question: str) -> Oscillator:
    """The system, where it is one mass that moves along a line and rubs on one contact."""
    if not isinstance(system, Oscillator):
        several = "a system of several masses" if isinstance(system, Structure) else f"a {type(system).__name__}"
        raise ModelError(several, f"{question} of one mass on one contact, along a line", "give an Oscillator")
    return system


def by_value(system: Oscillator) -> bool:
    """Whether an equal system is the same one: law and drive are compared by their values."""
    return all(map(compared_by_value, (system.law, system.drive)))


def systems_of(systems: Sequence[Oscillator]) -> Systems:
    """Oscillators given one by one."""
    own = np.arange(len(systems))
    numbers = np.array([[s.mass, s.stiffness, s.damping] for s in systems], dtype=np.float64).T
    on_base = np.array([s.damper == "base" for s in systems])
    laws: Any = tuple(s.law for s in systems)
    return oscillators(laws, own, tuple(s.drive for s in systems), own, numbers=numbers, on_base=on_base)


def oscillators(
    laws: Sequence[Law],
    law: Index,
    drives: Sequence[Drive],
    drive: Index,
    *,
    numbers: Array,
    on_base: Mask,
) -> Systems:
    """Oscillators as systems of one mass: the different laws and drives, which of them each has (B,), its mass,
    stiffness and damping (3, B), and whether its damper is fixed to the base (B,)."""
    tables = [with_sliding_modes(one.modes()) for one in laws]
    one = np.ones(1)
    contact = Rubbing(laws, tables, law, one)
    mass, stiffness, damping = numbers[:, :, None, None]
    seeds = tuple((mode.name,) for mode in tables[0])
    return Systems((contact,), tuple(drives), drive, mass, stiffness, damping, on_base, one, seeds, joint=False)


def batch_of(system: Structure) -> Systems:
    """A structure as a batch of one."""
    none = np.zeros(1, np.int64)
    contacts = tuple(
        Rubbing(
            [c.law],
            [c.modes()],
            none,
            np.asarray(c.tangent),
            None if c.normal is None else np.asarray(c.normal),
            c.stiffness,
            c.preload,
            c.carried,
        )
        for c in system.contacts
    )
    mass, stiffness, damping = (np.asarray(part)[None] for part in (system.mass, system.stiffness, system.damping))
    return Systems(
        contacts,
        (system.drive,),
        none,
        mass,
        stiffness,
        damping,
        np.array([system.damper == "base"]),
        np.asarray(system.acts_on),
        (tuple(contact.entry for contact in system.contacts),),
        joint=True,
    )


def kind_of_law(law: Any) -> Any:
    """What the laws of systems of one kind have in common; None for a law without linear modes."""
    if hasattr(law, "rates") or not hasattr(law, "modes"):
        return None
    modes = with_sliding_modes(law.modes())
    exits = [tuple((e.to, e.crossing, set(e.quantity) == {"v"}, *e.reset) for e in mode.exits) for mode in modes]
    parts = [(mode.name, mode.kind, mode.side, mode.friction is None) for mode in modes]
    return tuple(parts), tuple(exits), tuple(law.memory), tuple(law.places), law.entry


def kind_of_drive(drive: Drive) -> Any:
    """What the drives of systems of one kind have in common; None for a drive with knots or several tones."""
    motion = drive.motion()
    if motion.knots is not None or len(motion.tones) > 1:
        return None
    own = tuple(motion.rates), tuple(tone[:2] for tone in motion.tones), math.isfinite(motion.period)
    return (*own, bool(motion.imposed))


def _leaps(first: Index, targets: Index, resets: Array) -> Array:
    """The products of resets (B, E, N, N) along the shortest way from each mode to each other one (B, M, M, N, N)."""
    count, size = len(first) - 1, resets.shape[-1]
    leaps = np.zeros((len(resets), count, count, size, size))
    for begin in range(count):
        leaps[:, begin, begin] = np.eye(size)
        seen, queue = {begin}, [begin]
        while queue:
            mode = queue.pop(0)
            for e in range(first[mode], first[mode + 1]):
                if targets[e] not in seen:
                    seen.add(targets[e])
                    queue.append(targets[e])
                    leaps[:, begin, targets[e]] = resets[:, e] @ leaps[:, begin, mode]
    return leaps


def opened(tables: Tables, start: Mapping[str, Array]) -> tuple[Array, Index]:
    """State of each system at time 0 and its mode, before any exit that is due at once."""
    state = tables.begin.copy()
    for j, name in enumerate(tables.names[: tables.physical]):
        given = start.get(name)
        state[:, j] = np.einsum("bi,bi->b", tables.opening[:, j], state) if given is None else given
    if len(set(tables.entry)) == 1:
        return state, np.full(len(state), tables.entry[1])
    slip = np.einsum("bi,bi->b", tables.outputs["slip"], state)
    return state, np.array(tables.entry)[np.sign(slip).astype(np.int64) + 1]
