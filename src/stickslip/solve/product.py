"""From a structure to flat mode tables: the product of its contacts' modes.

A joint mode holds a mode of every contact. The contacts that hold rigidly share their holding forces through the mass
matrix; the exits of a joint mode are the exits of all its contacts. Only joint modes that can be reached are built.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stickslip.errors import ModelError
from stickslip.laws.base import Exit, Mode
from stickslip.solve.automaton import DEGREE, Automaton, cell_of, derivatives
from stickslip.structure import Contact, Structure

Rows = NDArray[np.floating[Any]]

WHOLE = 1e3 * float(np.finfo(np.longdouble).eps)  # a part this close to a whole number is one
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

    @property
    def passing(self) -> bool:
        """Whether no time passes: a contact has yet to find its mode."""
        return any(part.kind == "landing" for part in self.parts)

    def changes(self, before: Mode, leaving: int) -> Iterator[tuple[int, Mode, Mode]]:
        """Each contact whose mode has changed, and the one whose exit it was."""
        if not isinstance(before, JointMode):
            raise TypeError(f"{before.name} is no mode of several contacts")
        for contact, (old, new) in enumerate(zip(before.parts, self.parts, strict=True)):
            if old is not new or contact == before.owners[leaving]:
                yield contact, old, new


def product(system: Structure) -> Automaton:
    """The flat tables of a structure.

    Parameters
    ----------
    system : Structure
        What moves.

    Returns
    -------
    Automaton
    """
    return _Builder(system).build()


class _Builder:
    """Turns rows over names into rows over the state; lives for one call of :func:`product`."""

    def __init__(self, system: Structure) -> None:
        self.system, self.motion, self.contacts = system, system.drive.motion(), tuple(system.contacts)
        self.degrees, several = system.size, len(self.contacts) > 1
        self.memory = tuple(
            {name: f"{name}{c + 1}" if several else name for name in contact.law.memory}
            for c, contact in enumerate(self.contacts)
        )
        kept = [name for names in self.memory for name in names.values()]
        self.names = (*numbered("x", self.degrees), *numbered("v", self.degrees), *kept, "1", *self.motion.rates)
        self.physical, self.size = 2 * self.degrees + len(kept), len(self.names)
        # in extended precision: what cancels in the tables must leave less than the rounding of the states
        identity = np.eye(self.size, dtype=np.longdouble)
        self.place, self.speed = identity[: self.degrees], identity[self.degrees : 2 * self.degrees]
        self.one = identity[self.physical]
        self.signals = np.zeros((self.size, self.size), dtype=np.longdouble)
        for name, rate in self.motion.rates.items():
            self.signals[self.names.index(name)] = self.row(rate)
        self.face = [self.row(self.motion.face)]
        self.face += [self.face[0] @ self.signals, self.face[0] @ self.signals @ self.signals]
        self.tangents = system.tangents.astype(np.longdouble)
        self.loads = [self.load(contact) for contact in self.contacts]
        self.inverse = inverse(np.asarray(system.mass))
        base, share = self.row(self.motion.base), np.asarray(system.acts_on)
        ends = [np.outer(share, base), np.outer(share, base @ self.signals * (system.damper == "base"))]
        self.push = (
            np.outer(share, self.row(self.motion.force))
            - np.asarray(system.stiffness) @ (self.place - ends[0])
            - np.asarray(system.damping) @ (self.speed - ends[1])
        )
        self.base = base
        self.still: dict[tuple[int, ...], Rows] = {}

    def row(self, form: Mapping[str, float]) -> Rows:
        """A linear form over the state's own names."""
        row = np.zeros(self.size, dtype=np.longdouble)
        for name, value in form.items():
            row[self.names.index(name)] += value
        return row

    def load(self, contact: Contact) -> Rows:
        """The load that presses a closed contact."""
        row: Rows = contact.preload * self.one
        if contact.normal is not None:
            row = row + contact.stiffness * (np.asarray(contact.normal) @ self.place)
        return row

    def relative(self, c: int, form: Mapping[str, float], friction: Rows, flow: Rows | None = None) -> Rows:
        """A linear form of contact c: x and v along its tangent relative to the counter-face, "1" its load.

        As in an oscillator's table, places are kept in the frame of the structure.
        """
        contact, names = self.contacts[c], self.memory[c]
        slopes = np.zeros((self.size, self.size)) if flow is None else flow
        known = {
            "x": self.tangents[c] @ self.place,
            "v": self.tangents[c] @ self.speed,
            "1": self.loads[c],
            "d1": self.loads[c] @ slopes,
            "f": friction,
            "df": friction @ slopes,
            "always": self.one,
        }
        row = np.zeros(self.size, dtype=np.longdouble)
        for name, value in form.items():
            row += value * (known[name] if name in known else self.row({names[name]: 1.0}))
        carried = sum(value for name, value in form.items() if name == "x" or name in contact.law.places)
        return row - contact.carried * (carried * self.face[0] + form.get("v", 0.0) * self.face[1])

    def moved(self, c: int, name: str, order: int) -> Rows:
        """What a place of contact c owes to the counter-face: its displacement (order 0) or velocity (1)."""
        contact = self.contacts[c]
        return contact.carried * self.face[order] if name in contact.law.places else np.zeros(self.size)

    def holding(self, held: list[int]) -> tuple[Rows, Rows]:
        """P and I - P W of the contacts that hold, W their tangents: what brings a velocity to theirs."""
        rows = self.tangents[held]
        spread = self.inverse @ rows.T @ inverse(rows @ self.inverse @ rows.T)
        free = np.eye(self.degrees) - spread @ rows
        # entries that are whole but for rounding are whole: a mass that is held has no part in the motion
        return spread, np.where(np.abs(free - np.rint(free)) < WHOLE, np.rint(free), free)

    def faces(self, held: list[int], order: int) -> Rows:
        """The counter-face's motion under the contacts that hold: (held, N)."""
        return np.array([self.contacts[c].carried * self.face[order] for c in held]).reshape(len(held), self.size)

    def flow(self, mode: JointMode) -> tuple[Rows, Rows]:
        """A of a joint mode, and the friction forces (m, N) as linear forms of the state."""
        frictions = np.zeros((len(mode.parts), self.size), dtype=np.longdouble)
        flow = self.signals.copy()
        if mode.passing:
            return np.zeros_like(flow), frictions
        force, held = self.push.copy(), []
        for c, (part, contact) in enumerate(zip(mode.parts, self.contacts, strict=True)):
            if contact.normal is not None:
                pressing = 0.0 if part.kind == "flight" else self.loads[c]
                force += np.outer(np.asarray(contact.normal), contact.preload * self.one - pressing)
            if part.friction is None:
                held.append(c)
                continue
            frictions[c] = self.relative(c, part.friction, np.zeros(self.size))
            force -= np.outer(self.tangents[c], frictions[c])
        flow[: self.degrees], acceleration = self.speed, self.inverse @ force
        if held:
            spread, free = self.holding(held)
            rows = self.tangents[held]
            gap = rows @ acceleration - self.faces(held, 2)
            frictions[held] = inverse(rows @ self.inverse @ rows.T) @ gap
            flow[: self.degrees] = free @ self.speed + spread @ self.faces(held, 1)
            acceleration = free @ acceleration + spread @ self.faces(held, 2)
        flow[self.degrees : 2 * self.degrees] = acceleration
        for c, part in enumerate(mode.parts):
            for name, entry in self.memory[c].items():
                rate = self.relative(c, part.rates.get(name, {}), frictions[c], flow)
                flow[self.names.index(entry)] = rate + self.moved(c, name, 1)
        return flow, frictions

    def carry(self, mode: JointMode, e: int, following: JointMode, frictions: Rows) -> Rows:
        """R of an exit: the memory it resets, and no velocity left where the contact has stopped or holds."""
        exit_, owner = mode.exits[e], mode.owners[e]
        carry = np.eye(self.size, dtype=np.longdouble)
        for name, form in exit_.reset.items():
            row = self.relative(owner, form, frictions[owner]) + self.moved(owner, name, 0)
            carry[self.names.index(self.memory[owner][name])] = row
        # a contact that holds before or after has no velocity at the event, nor has one that stops
        stopped = {owner} if set(exit_.quantity) == {"v"} and mode.parts[owner].kind != "landing" else set()
        holds = (mode.parts, following.parts)
        held = tuple(sorted({c for parts in holds for c, part in enumerate(parts) if part.friction is None} | stopped))
        if held not in self.still:
            self.still[held] = self.stilled(list(held))
        return self.still[held] @ carry

    def stilled(self, held: list[int]) -> Rows:
        """The state with no velocity left under some contacts but for the rounding of its own terms.

        One degree of freedom after the other takes the velocity that the rest leave it, contacts that see the fewest
        first. No projection: that would mix in the rounding of velocities that a contact does not see, and rounding
        must not decide what follows.
        """
        still = np.eye(self.size, dtype=np.longdouble)
        speeds = slice(self.degrees, 2 * self.degrees)
        for c in sorted(held, key=lambda c: int(np.count_nonzero(self.tangents[c]))):
            left = self.contacts[c].carried * self.face[1] - self.tangents[c] @ still[speeds]
            p = self.degrees + int(np.argmax(np.abs(left[speeds])))
            if abs(left[p]) > 1e-12 * np.max(np.abs(self.tangents[c])):
                taken = -left / left[p]
                taken[p] = -1.0
                still += np.outer(still[:, p], taken)
        return still

    def build(self) -> Automaton:
        modes, targets = self._reach()
        flows, frictions = zip(*map(self.flow, modes), strict=True)
        rows, resets, first = [], [], [0]
        for mode, flow, friction, follow in zip(modes, flows, frictions, targets, strict=True):
            quantities = [
                self.relative(owner, exit_.quantity, friction[owner], flow)
                for exit_, owner in zip(mode.exits, mode.owners, strict=True)
            ]
            rows += list(np.stack(derivatives(np.array(quantities), flow), axis=1))
            resets += [self.carry(mode, e, modes[follow[e]], friction) for e in range(len(mode.exits))]
            first.append(len(rows))
        smooth = np.array(flows, dtype=np.float64)
        cells, hops = zip(*map(cell_of, smooth), strict=True)
        tones = [(self.names.index(c), self.names.index(s), w, phase) for c, s, w, phase in self.motion.tones]
        lifted = np.array([[part.kind == "flight" for part in mode.parts] for mode in modes], dtype=bool)
        lifted = lifted.reshape(len(modes), len(self.contacts), 1)
        loads = np.array(self.loads).reshape(len(self.contacts), self.size)
        single = len(self.contacts) == 1
        slips = [self.relative(c, {"v": 1.0}, self.one) for c in range(len(self.contacts))]
        outputs = {
            "z": self.base,
            "slip": slips[0] if single else np.array(slips).reshape(len(slips), self.size),
            "face": self.face[0],
            "face_rate": self.face[1],
            "force": self.row(self.motion.force),
            "load": np.where(lifted, 0.0, loads),
        }
        return Automaton(
            names=self.names,
            modes=modes,
            flow=smooth,
            cell=np.array(cells),
            hop=np.array(hops),
            series=np.array(rows, dtype=np.float64).reshape(len(rows), DEGREE + 1, self.size),
            target=np.array([t for follow in targets for t in follow], dtype=np.int64),
            crossing=np.array([e.crossing for mode in modes for e in mode.exits], dtype=np.bool_),
            reset=np.array(resets, dtype=np.float64).reshape(len(rows), self.size, self.size),
            first=np.array(first, dtype=np.int64),
            friction=np.array(frictions, dtype=np.float64),
            outputs={name: np.asarray(row, dtype=np.float64) for name, row in outputs.items()},
            motion=self.motion,
            physical=self.physical,
            degrees=self.degrees,
            entry=(0, 0, 0),
            opening=np.asarray(self._opening(), dtype=np.float64),
            tones=np.array(tones).reshape(len(tones), 4),
        )

    def _opening(self) -> Rows:
        """The physical state at the start: no displacement, least velocities without slip, memory as the laws say."""
        none = np.zeros(self.size)
        every = list(range(len(self.contacts)))
        velocities = np.linalg.pinv(self.system.tangents) @ self.faces(every, 1)
        kept = [
            self.relative(c, form, none) + self.moved(c, name, 0)
            for c, contact in enumerate(self.contacts)
            for name, form in contact.law.memory.items()
        ]
        rows = [np.zeros((self.degrees, self.size)), velocities, np.array(kept).reshape(-1, self.size)]
        return np.vstack(rows)

    def _reach(self) -> tuple[tuple[JointMode, ...], list[list[int]]]:
        """The joint modes that follow from the start, and of each the numbers of those that its exits lead to."""
        tables = [{mode.name: mode for mode in contact.modes()} for contact in self.contacts]
        order: dict[tuple[str, ...], int] = {tuple(contact.entry for contact in self.contacts): 0}
        waiting = list(order)
        modes: list[JointMode] = []
        targets: list[list[int]] = []
        for names in waiting:
            parts = tuple(table[name] for table, name in zip(tables, names, strict=True))
            landing = [c for c, part in enumerate(parts) if part.kind == "landing"]
            asked = landing[:1] or range(len(parts))
            taken = [(exit_, c) for c in asked for exit_ in parts[c].exits]
            modes.append(JointMode.of(parts, taken))
            targets.append([])
            for exit_, c in taken:
                following = (*names[:c], exit_.to, *names[c + 1 :])
                if following not in order:
                    if len(order) == MOST:
                        raise ModelError(
                            f"{len(self.contacts)} contacts with more than {MOST} joint modes",
                            f"at most {MOST} are built",
                            "join contacts, or leave those that hardly move out",
                        )
                    order[following] = len(order)
                    waiting.append(following)
                targets[-1].append(order[following])
        return tuple(modes), targets


def inverse(matrix: Rows) -> Rows:
    """The inverse of a small symmetric positive matrix in extended precision, by Gauss and Jordan."""
    size = len(matrix)
    work = np.hstack([np.asarray(matrix, dtype=np.longdouble), np.eye(size, dtype=np.longdouble)])
    for j in range(size):
        work[j] /= work[j, j]
        for i in range(size):
            if i != j:
                work[i] -= work[i, j] * work[j]
    return work[:, size:]


def numbered(name: str, count: int) -> tuple[str, ...]:
    """The name alone for one, else name1, name2 ..."""
    return (name,) if count == 1 else tuple(f"{name}{j + 1}" for j in range(count))
