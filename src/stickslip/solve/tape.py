"""From a system with a curved law to a tape of operations and flat arrays."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from stickslip.arrays import Array, Index
from stickslip.drives.kinds import Motion
from stickslip.errors import ModelError
from stickslip.laws.base import Exit, Mode
from stickslip.laws.curved import Creeping, CurvedMode, curved_modes
from stickslip.oscillator import Contact, Oscillator, Structure
from stickslip.solve.operations import Bound, Form, Operations, Scaled, combined, flat, guards_of, stilled, sums_of
from stickslip.solve.tables import JointMode, System, by_value, mode_number, numbered, reached
from stickslip.solve.taylor import Exits, Guards, Nodes, Sums

DTYPES = (np.int64, np.float64)
LEAST = 1e-13  # some hundred roundings of the motion's own speed: below it a velocity that falls can not be followed


@dataclass(frozen=True, eq=False)
class Tape:
    """A curved system as flat arrays.

    Attributes
    ----------
    system : Oscillator or Structure
        The system.
    names : tuple of str
        What each entry of the state is.
    modes : tuple of CurvedMode
        The law's modes.
    motion : Motion
        The drive.
    physical : int
        Number of leading entries that belong to the masses and the laws.
    degrees : int
        Degrees of freedom.
    entry : tuple of int
        Modes in which motion starts with negative, zero and positive relative velocity.
    opening : ndarray (physical, N)
        Each physical entry at the start, where it is not given, as a linear form of the entries before it.
    tones : ndarray (J, 4)
        Index of cosine, index of sine, angular frequency, phase.
    outputs : mapping of str to ndarray (N,)
        Linear forms of the state.
    nodes : Nodes
        The operations, for the march.
    kept : tuple of tuple of int
        Nodes of each mode whose series the march looks at.
    sums : Sums
        What rounds each rate and each exit.
    watched : Nodes
        As `nodes`, with the nodes of all outputs as well.
    exits : Exits
        How each mode may end.
    guards : Guards
        Functions that fall asleep.
    places : mapping of str to ndarray (M, R)
        Nodes of each output in each mode of `watched`.
    """

    system: System
    names: tuple[str, ...]
    modes: tuple[CurvedMode, ...]
    motion: Motion
    physical: int
    degrees: int
    entry: tuple[int, int, int]
    opening: Array
    tones: Array
    outputs: Mapping[str, Array]
    nodes: Nodes
    kept: tuple[tuple[int, ...], ...]
    sums: Sums
    watched: Nodes
    exits: Exits
    guards: Guards
    places: Mapping[str, Index]

    @property
    def shown(self) -> tuple[tuple[int, ...], ...]:
        """Nodes of each mode that outputs have."""
        size = len(self.names)
        rows = np.concatenate(list(self.places.values()), axis=1)
        return tuple(tuple(sorted({*row[row >= size].tolist()})) for row in rows)

    @property
    def settling(self) -> frozenset[int]:
        """Exits that are no event: none."""
        return frozenset()

    @property
    def first(self) -> Index:
        """Exits of mode j are ``first[j]`` to ``first[j + 1]``."""
        return self.exits.first

    @property
    def target(self) -> Index:
        """The mode behind each exit."""
        return self.exits.target

    def free(self, mode: int) -> Array:
        """What a small difference of the physical state may be in a mode: what is held has no velocity of its own."""
        free, n = np.eye(self.physical), self.degrees
        own: Any = self.modes[mode]
        parts = own.parts if isinstance(own, JointMode) else (own,)
        contacts = self.system.contacts if isinstance(self.system, Structure) else ()
        tangents = [c.tangent for c in contacts] if contacts else [np.ones(1)]
        stuck = np.array([row for row, part in zip(tangents, parts, strict=True) if part.friction is None])
        if len(stuck):
            free[n : 2 * n, n : 2 * n] -= np.linalg.pinv(stuck) @ stuck
        return free

    def index(self, mode: str) -> int:
        """Number of the mode of that name."""
        return mode_number(self.modes, mode)


def tape(system: System) -> Tape:
    """The flat arrays of a system with a curved law."""
    return _known(system) if isinstance(system, Oscillator) and by_value(system) else _built(system)


def _built(system: System) -> Tape:
    return _Builder(system).build()


_known = lru_cache(maxsize=32)(_built)


class _Made(NamedTuple):
    """A mode: its nodes for the march, node and factor of each entry's rate, what each contact knows, the rates as
    linear forms of nodes, and the friction of each contact."""

    moving: Operations
    entries: list[Scaled]
    known: list[dict[str, Form]]
    rates: dict[int, Form]
    friction: list[Form]


class _Contact:
    """A contact as the tape reads it: its law's modes, its names in the state, what it knows. Lives with a builder."""

    def __init__(self, contact: Contact, memory: range, *, alone: bool) -> None:
        self.contact, self.law, self.memory, self.alone = contact, contact.law, memory, alone
        self.tangent = np.asarray(contact.tangent, dtype=np.float64)
        self.normal = None if contact.normal is None else np.asarray(contact.normal, dtype=np.float64)
        law: Any = contact.law
        self.modes: tuple[Any, ...] = curved_modes(law) if alone else contact.modes()
        self.entry = contact.entry
        self.least = 0.0
        self.symbols: dict[str, Form] = {}

    def creep(self, least: float) -> None:
        """Go through a mode that holds the mass, up to a speed that is as good as none [m/s]."""
        self.least = least
        stop = {side: Exit({"v": -float(side), "always": 0.5 * least}, "held") for side in (-1, 1)}
        law: Any = self.law
        back, _, forward = law.entry
        modes = (*(replace(mode, exits=(stop[mode.side],)) for mode in law.rates()), law.holding(least))
        self.modes = modes if self.alone else self.contact.closing(modes, (back, "held", forward))

    def press(self, part: Any, moving: Operations) -> None:
        """Tell the load in a mode; of a contact that is lifted it is what would press it."""
        closed, preload, power = self.symbols["closed"], self.contact.preload, self.contact.power
        if power != 1 and part.kind not in ("flight", "landing"):
            share = combined([(1 / preload, closed)])
            closed = combined([(preload, moving.power(share, power))])
        self.symbols["1"] = closed

    def left(self, mode: Any, exit_: Exit, to: Any) -> float:
        """The speed [m/s] that an exit leaves against the counter-face; nan where it leaves what there is.

        Exactly none where the contact holds, or stops: rounding must not decide what follows.
        """
        if to.friction is None or (set(exit_.quantity) == {"v"} and mode.kind != "landing"):
            return float(to.speed)
        return to.side * self.least if getattr(mode, "creep", None) is not None else math.nan


class _Builder:
    """Turns laws' expressions into nodes; lives for one call of :func:`tape`."""

    def __init__(self, system: System) -> None:
        self.system, self.motion = system, system.drive.motion()
        self.joint = isinstance(system, Structure)
        whole = system if isinstance(system, Structure) else _Alone.of(system)
        self.whole, self.degrees = whole, whole.size
        self.contacts, self.one = self.contacts_of(whole), 0
        self.one = 2 * whole.size + sum(len(contact.memory) for contact in self.contacts)
        several = len(self.contacts) > 1
        memory = (
            f"{name}{c + 1}" if several else name for c, own in enumerate(self.contacts) for name in own.law.memory
        )
        self.names = (*numbered("x", whole.size), *numbered("v", whole.size), *memory, "1", *self.motion.rates)
        self.size = len(self.names)
        self.mass = np.asarray(whole.mass, dtype=np.float64)
        self.inverse: Array = np.asarray(np.linalg.inv(self.mass) if whole.size > 1 else 1 / self.mass)
        self.drive()
        for contact in self.contacts:
            self.know(contact)
            if isinstance(contact.law, Creeping):
                contact.creep(self.standstill(contact))

    def contacts_of(self, whole: Structure | _Alone) -> list[_Contact]:
        """The contacts, with the places of their memory in the state."""
        contacts, begin = [], 2 * whole.size
        for contact in whole.contacts:
            memory = range(begin, begin + len(contact.law.memory))
            contacts.append(_Contact(contact, memory, alone=not self.joint))
            begin += len(contact.law.memory)
        return contacts

    def drive(self) -> None:
        """What the drive moves: the counter-face with its rates, and the force of spring, damper and drive."""
        motion, whole = self.motion, self.whole
        self.base, self.force = self.form(motion.base), self.form(motion.force)
        self.signal = {self.names.index(name): self.form(rate) for name, rate in motion.rates.items()}
        face = self.form(motion.face)
        self.face = [face, self.moved(face), self.moved(self.moved(face))]
        damper = self.moved(self.base) if whole.damper == "base" else ({}, 0.0)
        own = self.form(motion.imposed)
        self.imposed = [own, self.moved(own), self.moved(self.moved(own))] if motion.imposed else None
        share, n = np.asarray(whole.acts_on, dtype=np.float64), self.degrees
        stiffness, damping = (np.asarray(part, dtype=np.float64) for part in (whole.stiffness, whole.damping))
        self.push = [
            combined(
                [
                    (share[i], self.force),
                    (float(stiffness[i] @ share), self.base),
                    *((-stiffness[i, k], ({k: 1.0}, 0.0)) for k in range(n)),
                    *((-damping[i, k], ({n + k: 1.0}, 0.0)) for k in range(n)),
                    (float(damping[i] @ share), damper),
                    *((c.normal[i] * c.contact.preload, ({}, 1.0)) for c in self.contacts if c.normal is not None),
                ]
            )
            for i in range(n)
        ]

    def know(self, contact: _Contact) -> None:
        """What a contact's symbols are: x and v relative to the counter-face, the load for 1, places as x is."""
        carried, tangent, n = contact.contact.carried, contact.tangent, self.degrees
        place, speed = (combined((tangent[i], ({shift + i: 1.0}, 0.0)) for i in range(n)) for shift in (0, n))
        face = [combined([(carried, part)]) for part in self.face]
        known = {"x": combined([(1.0, place), (-1.0, face[0])]), "v": combined([(1.0, speed), (-1.0, face[1])])}
        load: Form = ({}, contact.contact.preload)
        if contact.normal is not None:
            press = contact.contact.stiffness / contact.contact.power * contact.normal
            load = combined([(1.0, load), *((press[i], ({i: 1.0}, 0.0)) for i in range(n))])
        known |= {"closed": load}
        known |= {"1": load, "always": ({}, 1.0), "face_acceleration": face[2]}
        for name, j in zip(contact.law.memory, contact.memory, strict=True):
            own: Form = ({j: 1.0}, 0.0)
            known[name] = combined([(1.0, own), (-1.0, face[0])]) if name in contact.law.places else own
        contact.symbols = known

    def standstill(self, contact: _Contact) -> float:
        """The speed [m/s] that is as good as none: what friction takes from the mass in a part `LEAST` of a period."""
        law: Any = contact.law
        forward = law.rates()[-1]
        memory = {name: row.get("1", 0.0) for name, row in law.memory.items()}
        period, frequency = self.motion.period, self.system.frequency
        time = period if math.isfinite(period) else 1 / frequency if frequency else 1.0
        face = sum(abs(weight) for weight in self.face[1][0].values()) + abs(self.face[1][1])
        lightness = float(contact.tangent @ self.inverse @ contact.tangent) * abs(contact.contact.preload)
        return float(LEAST * (forward.friction.at(x=0.0, v=1.0, **memory) * lightness * time + face))

    def form(self, row: Mapping[str, float]) -> Form:
        """A drive's linear form over the state."""
        weights = {self.names.index(name): value for name, value in row.items() if name != "1"}
        return weights, row.get("1", 0.0)

    def moved(self, form: Form) -> Form:
        """The rate of a form of the drive's signals."""
        return combined((weight, self.signal[node]) for node, weight in form[0].items())

    def row(self, form: Form) -> Array:
        """A linear form of the state as an array."""
        row = np.zeros(self.size)
        row[list(form[0])] = list(form[0].values())
        row[self.one] += form[1]
        return row

    def told(self, contact: _Contact, row: Mapping[str, float], known: Mapping[str, Form]) -> Form:
        """A law's linear form over what its contact knows."""
        for name in row:
            if name not in known:
                raise ModelError(
                    f"{type(contact.law).__name__}, which follows '{name}', in one system with a curved law",
                    f"beside curved laws a contact knows {', '.join(known)}",
                    "use SmoothStateVariable for StateVariable, or a contact without mass",
                )
        return combined((value, known[name]) for name, value in row.items())

    def slides(self, contact: _Contact, part: Any, moving: Operations) -> Form:
        """Friction of a contact that slides: a curved law's is a coefficient of the load."""
        if isinstance(part, Mode):
            return self.told(contact, part.friction or {}, contact.symbols)
        moving.symbols = contact.symbols
        return moving.product(moving.form(part.friction), contact.symbols["1"])

    def mode(self, parts: Sequence[Any]) -> _Made:
        """Nodes for the march and with outputs, rates of the entries, nodes of the exits and of the outputs."""
        moving, n = Operations(self.size, {}), self.degrees
        still: Form = ({}, 0.0)
        for part, contact in zip(parts, self.contacts, strict=True):
            contact.press(part, moving)
        landing = any(part.kind == "landing" for part in parts)  # no time passes: a contact has yet to find its mode
        friction: list[Form] = [still for _ in parts]
        force = list(self.push)
        for c, (part, contact) in enumerate(zip(parts, self.contacts, strict=True)):
            if part.friction is not None:
                friction[c] = self.slides(contact, part, moving)
            load: Form = contact.symbols["1"] if part.kind != "flight" else still
            pressed = contact.normal if contact.normal is not None else np.zeros(n)
            force = [
                combined([(1.0, force[i]), (-contact.tangent[i], friction[c]), (-pressed[i], load)]) for i in range(n)
            ]
        stuck = [c for c, part in enumerate(parts) if part.friction is None]
        bound = self.bound(stuck)
        for c, form in zip(stuck, bound.friction(force, [self.faced(c, 2) for c in stuck]), strict=True):
            friction[c] = form
        known = [self.knows(c, part, friction[c], moving) for c, part in enumerate(parts)]
        speeds = [
            combined(
                [(1.0, self.faced(c, 1)), (1.0, ({}, parts[c].speed))]
                + [(1.0, known[c]["v"])] * (getattr(parts[c], "creep", None) is not None)
            )
            for c in stuck
        ]
        rates = dict(enumerate(bound.speed(speeds)))
        rates |= {n + i: form for i, form in enumerate(bound.acceleration(force, [self.faced(c, 2) for c in stuck]))}
        if self.imposed:  # whatever acts on it
            rates[n] = self.imposed[2]
        for c, (part, contact) in enumerate(zip(parts, self.contacts, strict=True)):
            speeding = [(contact.tangent[i], rates[n + i]) for i in range(n)]
            known[c]["a"] = combined([*speeding, (-1.0, self.faced(c, 2))])
            rates |= self.remembered(contact, part, known[c], moving)
        rates |= self.signal
        if landing:
            rates = {}
        entries = [moving.scaled(rates[j]) if rates.get(j, still) != still else (-1, 0.0) for j in range(self.size)]
        return _Made(moving, entries, known, rates, friction)

    def faced(self, c: int, order: int) -> Form:
        """The counter-face's motion under a contact."""
        return combined([(self.contacts[c].contact.carried, self.face[order])])

    def bound(self, stuck: Sequence[int]) -> Bound:
        """How the masses move that some contacts hold."""
        return Bound(
            self.mass, self.inverse, np.array([self.contacts[c].tangent for c in stuck]).reshape(-1, self.degrees)
        )

    def knows(self, c: int, part: Any, friction: Form, moving: Operations) -> dict[str, Form]:
        """What the exits and the memory of a contact may speak of in a mode."""
        contact = self.contacts[c]
        known = {**contact.symbols, "f": friction}
        if isinstance(part, Mode):
            return known
        load = contact.symbols["1"]
        share = friction if load == ({}, 1.0) else moving.quotient(friction, load)
        moving.symbols = {**contact.symbols, "f": share}
        if part.creep is not None:
            known["v"] = moving.symbols["v"] = moving.form(part.creep)
        return known | {name: moving.product(moving.form(level), load) for name, level in part.levels.items()}

    def remembered(
        self, contact: _Contact, part: Any, known: Mapping[str, Form], moving: Operations
    ) -> dict[int, Form]:
        """The rates of a contact's memory in a mode."""
        rates: dict[int, Form] = {}
        load = contact.symbols["1"]
        for name, j in zip(contact.law.memory, contact.memory, strict=True):
            rate: Form = ({}, 0.0)
            if name in part.rates and isinstance(part, Mode):
                rate = self.told(contact, part.rates[name], known)
            elif name in part.rates:
                share = (
                    known["f"]
                    if load == ({}, 1.0) or "f" not in part.rates[name].symbols
                    else moving.quotient(known["f"], load)
                )
                moving.symbols = {**known, "f": share}
                rate = moving.form(part.rates[name])
            if name in contact.law.places:
                rate = combined([(1.0, rate), (contact.contact.carried, self.face[1])])
            rates[j] = rate
        return rates

    def shown(self, made: _Made, parts: Sequence[Any]) -> tuple[Operations, dict[str, list[int]]]:
        """Nodes with those of all outputs, and which these are."""
        watched, n = Operations(self.size, {}), self.degrees
        watched.rows, watched.known = list(made.moving.rows), dict(made.moving.known)
        still: Form = ({}, 0.0)
        creeps = any(getattr(part, "creep", None) is not None for part in parts)
        entry: list[Form] = [({j: 1.0}, 0.0) for j in range(self.size)]
        speeds = [made.rates.get(i, still) for i in range(n)] if creeps else entry[n : 2 * n]
        outputs: dict[str, list[Form]] = {
            "x": entry[:n], "v": speeds, "a": [made.rates.get(n + i, still) for i in range(n)],
            "state": [*entry[:n], *speeds, *entry[2 * n : self.one]],
            "friction": made.friction, "slip": [known["v"] for known in made.known],
            "load": [
                still if part.kind == "flight" else known["1"] for part, known in zip(parts, made.known, strict=True)
            ],
            "z": [self.base], "force": [self.force], "face": [self.face[0]], "face_rate": [self.face[1]],
        }  # fmt: skip
        outputs |= {name: [entry[j]] for j, name in enumerate(self.names) if name not in outputs}
        return watched, {name: [watched.node(form) for form in forms] for name, forms in outputs.items()}

    def build(self) -> Tape:
        seeds = [tuple([contact.entry for contact in self.contacts])]
        if not self.joint:
            (contact,) = self.contacts
            seeds = [(mode.name,) for mode in contact.modes]
        joints = reached([contact.modes for contact in self.contacts], seeds)
        parts = [[c.modes[number] for c, number in zip(self.contacts, joint.numbers, strict=True)] for joint in joints]
        made = [self.mode(own) for own in parts]
        leaving = [(j, c, parts[j][c].exits[e]) for j, joint in enumerate(joints) for c, e in joint.exits]
        quantities = [
            [
                one.moving.scaled(self.told(self.contacts[c], exit_.quantity, one.known[c]))
                for i, c, exit_ in leaving
                if i == j
            ]
            for j, one in enumerate(made)
        ]
        shown = [self.shown(one, own) for one, own in zip(made, parts, strict=True)]
        rate = tuple(np.array([[r[c] for r in one.entries] for one in made], dtype=d) for c, d in enumerate(DTYPES))
        exits = self.exits(joints, parts, leaving, quantities)
        operations = [one.moving for one in made]
        guards, sums = guards_of(operations), sums_of(operations, [one.entries for one in made], quantities)
        modes: tuple[Any, ...] = (
            tuple(own[0] for own in parts)
            if not self.joint
            else tuple(
                JointMode.of(tuple(own), [(own[c].exits[e], c) for c, e in joint.exits])
                for own, joint in zip(parts, joints, strict=True)
            )
        )
        tones = [(self.names.index(c), self.names.index(s), w, phase) for c, s, w, phase in self.motion.tones]
        slip = np.array([self.row(contact.symbols["v"]) for contact in self.contacts])
        return Tape(
            system=self.system,
            names=self.names,
            modes=modes,
            motion=self.motion,
            physical=self.one,
            degrees=self.degrees,
            entry=self.entry(modes),
            opening=self.opening(),
            tones=np.array(tones, dtype=np.float64).reshape(len(tones), 4),
            outputs={"face_rate": self.row(self.face[1]), "slip": slip if self.joint else slip[0]},
            nodes=Nodes(*flat(operations), *rate),
            kept=kept_of(self.size, sums, exits, guards),
            sums=sums,
            watched=Nodes(*flat([watched for watched, _ in shown]), *rate),
            exits=exits,
            guards=guards,
            places={name: np.array([own[name] for _, own in shown], dtype=np.int64) for name in shown[0][1]},
        )

    def entry(self, modes: Sequence[Any]) -> tuple[int, int, int]:
        """The modes in which motion starts."""
        if self.joint:
            return 0, 0, 0
        (contact,) = self.contacts
        order = [mode.name for mode in modes]
        back, still, forward = contact.law.entry
        still = "held" if contact.least else still
        return order.index(back), order.index(still), order.index(forward)

    def opening(self) -> Array:
        """The physical state at the start: no displacement, least velocities without slip, memory as the laws say."""
        opening, n = np.zeros((self.one, self.size)), self.degrees
        faces = np.array([self.row(self.faced(c, 1)) for c in range(len(self.contacts))])
        opening[n : 2 * n] = np.linalg.pinv(np.array([contact.tangent for contact in self.contacts])) @ faces
        if self.imposed:
            opening[0], opening[1] = map(self.row, self.imposed[:2])
        for contact in self.contacts:
            for name, j in zip(contact.law.memory, contact.memory, strict=True):
                opening[j] = self.row(self.remade(contact, name, contact.law.memory[name], contact.symbols))
        return opening

    def remade(self, contact: _Contact, name: str, row: Mapping[str, float], known: Mapping[str, Form]) -> Form:
        """A new value of a memory: a place moves with the counter-face."""
        value = combined((value, known["always" if key == "1" else key]) for key, value in row.items())
        return combined([(1.0, value), (contact.contact.carried * (name in contact.law.places), self.face[0])])

    def exits(self, joints: Any, parts: Any, leaving: Any, quantities: Any) -> Exits:
        """How each mode may end, and what of the state an end sets anew."""
        target = [number for joint in joints for number in joint.targets]
        pairs = zip(leaving, target, strict=True)
        speeds = [self.contacts[c].left(parts[j][c], exit_, parts[t][c]) for (j, c, exit_), t in pairs]
        unit = np.eye(self.size)
        reset = np.tile(unit, (len(leaving), 1, 1))
        for e, ((j, c, exit_), t) in enumerate(zip(leaving, target, strict=True)):
            contact = self.contacts[c]
            for name, row in exit_.reset.items():
                j_ = contact.memory[list(contact.law.memory).index(name)]
                reset[e, j_] = self.row(self.remade(contact, name, row, contact.symbols))
            stuck = {} if math.isnan(speeds[e]) else {c: speeds[e]}
            if self.degrees > 1:  # one mass that is held has the counter-face's motion to the last digit
                following = {k: part.speed for k, part in enumerate(parts[t]) if part.friction is None}
                before = {k: part.speed for k, part in enumerate(parts[j]) if part.friction is None}
                stuck = before | following | stuck
            if stuck:
                reset[e] = self.stilled(stuck) @ reset[e]
        return Exits(
            node=np.array([node for own in quantities for node, _ in own], dtype=np.int64),
            factor=np.array([factor for own in quantities for _, factor in own], dtype=np.float64),
            target=np.array(target, dtype=np.int64),
            crossing=np.array([exit_.crossing for *_, exit_ in leaving], dtype=np.bool_),
            polished=np.isnan(speeds),
            carried=np.array([np.any(one != unit) for one in reset], dtype=np.bool_),
            reset=reset,
            first=np.cumsum([0, *(len(joint.exits) for joint in joints)]),
        )

    def stilled(self, stuck: Mapping[int, float]) -> Array:
        """The state with the velocities of some contacts told, and no more of them left but for rounding."""
        one = self.row(({}, 1.0))
        faces = {c: (self.row(self.faced(c, 1)) + speed * one)[None] for c, speed in stuck.items()}
        columns = {c: (self.contacts[c].tangent, face) for c, face in faces.items()}
        return np.asarray(stilled(np.eye(self.size)[None], self.degrees, columns)[0])


class _Alone(NamedTuple):
    """The structure of one mass and one contact that an oscillator is, which need not be checked again."""

    mass: Array
    damping: Array
    stiffness: Array
    contacts: tuple[Contact]
    damper: str
    acts_on: tuple[float] = (1.0,)
    size: int = 1

    @classmethod
    def of(cls, system: Oscillator) -> _Alone:
        mass, damping, stiffness = np.array([[[system.mass]], [[system.damping]], [[system.stiffness]]])
        contact = Contact(system.law, [1.0])  # type: ignore[arg-type]
        return cls(mass, damping, stiffness, (contact,), system.damper)


def kept_of(size: int, sums: Sums, exits: Exits, guards: Guards) -> tuple[tuple[int, ...], ...]:
    """Nodes of each mode that are exits, are guarded, or make up a rate or an exit."""
    count, kept, low, first = len(exits.first) - 1, [], sums.first, exits.first
    for mode in range(count):
        rates = sums.node[low[mode * size] : low[(mode + 1) * size]]
        terms = sums.node[low[count * size + first[mode]] : low[count * size + first[mode + 1]]]
        leaving = exits.node[first[mode] : first[mode + 1]]
        asleep = guards.argument[guards.first[mode] : guards.first[mode + 1]]
        looked = {*rates.tolist(), *terms.tolist(), *leaving.tolist(), *asleep.tolist()}
        kept.append(tuple(sorted(node for node in looked if node >= size)))
    return tuple(kept)
