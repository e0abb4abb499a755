"""From systems to their tables: each law read once, and written out over the state.

A law is read as coefficients over what its contact knows (displacement, velocity, load, memory, friction ...). What the
contact knows is rows over the state; the product of both is the table.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stickslip.arrays import Array
from stickslip.compiled import meanwhile
from stickslip.errors import ModelError
from stickslip.laws.base import Mode
from stickslip.oscillator import Oscillator, Structure
from stickslip.solve.cells import DEGREE, cells_of, derivatives, derive
from stickslip.solve.operations import stilled
from stickslip.solve.settling import settled
from stickslip.solve.tables import (
    JointMode,
    Rubbing,
    System,
    Systems,
    Tables,
    batch_of,
    by_value,
    curves_of,
    numbered,
    reached,
    systems_of,
)

Rows = NDArray[np.floating[Any]]

WHOLE = 1e3 * float(np.finfo(np.longdouble).eps)  # a part this close to a whole number is one


def table_of(system: System) -> Tables:
    """The flat tables of one system."""
    curved = curves_of(system)
    if curved:
        raise ModelError(
            f"{' and '.join(curved)} with curved modes",
            "this question needs a law of linear modes",
            "ask simulate(), or make a polygon of a law's curve with Tabulated.of() and leave out power=",
        )
    return _known(system) if isinstance(system, Oscillator) and by_value(system) else _built(system)


def _built(system: System) -> Tables:
    return settled(tables_of(batch_of(system) if isinstance(system, Structure) else systems_of([system])).of(0))


_known = lru_cache(maxsize=32)(_built)  # a fit asks for the same system from many starts


def tables_of(systems: Systems) -> Tables:
    """The flat tables of systems of one kind."""
    return _Builder(systems).build()


# what a contact knows of, in the order in which terms are added; memory stands between, and the last ones by the mode
KNOWN = ("x", "v", "1", "always")
FACE, FACE_RATE, FACE_ACCELERATION, FRICTION, FRICTION_RATE, LOAD_RATE = range(-6, 0)
LATER = {"face_acceleration": FACE_ACCELERATION, "f": FRICTION, "df": FRICTION_RATE, "d1": LOAD_RATE}


class _Forms:
    """A contact's law as coefficients over what the contact knows: (B, forms, V) for each mode.

    The forms of a mode are its friction, the rate of each memory, the quantity of each exit, and the exits' resets.
    """

    def __init__(self, contact: Rubbing) -> None:
        law, self.carried = contact.laws[0], contact.carried
        self.memory, self.places = tuple(law.memory), law.places
        self.columns = {name: j for j, name in enumerate((*KNOWN, *self.memory))} | LATER
        self.width = len(KNOWN) + len(self.memory) + len(range(FACE, 0))
        own = [[self._row(one.memory[name], name, FACE) for name in self.memory] for one in contact.laws]
        self.opening = np.array(own).reshape(len(own), len(self.memory), self.width)[contact.which]
        self.modes = [
            np.array([self._forms_of(mode) for mode in alike])[contact.which]
            for alike in zip(*contact.tables, strict=True)
        ]

    def _forms_of(self, mode: Mode) -> list[list[float]]:
        return [
            self._row(mode.friction or {}),
            *(self._row(mode.rates.get(name, {}), name, FACE_RATE) for name in self.memory),
            *(self._row(exit_.quantity) for exit_ in mode.exits),
            *(self._row(form, name, FACE) for exit_ in mode.exits for name, form in exit_.reset.items()),
        ]

    def _row(self, form: Mapping[str, float], sets: str = "", face: int = FACE) -> list[float]:
        """A linear form's coefficients: x and v are relative to the counter-face.

        The law's places are kept in the frame of x, so that x less a place loses no digits however far a belt runs: a
        form that sets a place owes it the counter-face's displacement, or velocity for its rate.
        """
        row = [0.0] * self.width
        for name, value in form.items():
            row[self.columns[name]] += value * (self.carried if name == "face_acceleration" else 1.0)
            if name == "x" or name in self.places:
                row[FACE] -= self.carried * value
            elif name == "v":
                row[FACE_RATE] -= self.carried * value
        if sets in self.places:
            row[face] += self.carried
        return row


class _Builder:
    """Turns systems into rows over the state; lives for one call of :func:`tables_of`."""

    def __init__(self, systems: Systems) -> None:
        self.systems, self.contacts = systems, systems.contacts
        self.motions = [drive.motion() for drive in systems.drives]
        # What rounding leaves of terms that cancel must not count. A mass alone is a sum of few terms; where contacts
        # share their forces, elimination comes between, and is done in extended precision.
        self.digits: Any = np.longdouble if systems.joint else np.float64
        self.forms = [_Forms(contact) for contact in self.contacts]
        self._name()
        self._drive()
        self.inverse = _solved(self.mass, np.eye(self.degrees)) if systems.joint else None
        self.known = [self._knows(contact, c) for c, contact in enumerate(self.contacts)]
        self.joints = reached([contact.tables[0] for contact in self.contacts], systems.seeds)
        self.parts = [
            [contact.tables[0][number] for contact, number in zip(self.contacts, joint.numbers, strict=True)]
            for joint in self.joints
        ]
        self.still: dict[tuple[tuple[int, float], ...], Rows] = {}

    def _name(self) -> None:
        """The entries of the state, and the rows that read them."""
        self.count, self.degrees = self.systems.mass.shape[:2]
        several, n = len(self.contacts) > 1, self.degrees
        memory = [f"{name}{c + 1}" if several else name for c, forms in enumerate(self.forms) for name in forms.memory]
        motion = self.motions[0]
        self.names = (*numbered("x", n), *numbered("v", n), *memory, "1", *motion.rates)
        self.places = {name: j for j, name in enumerate(self.names)}
        self.size, self.physical = len(self.names), 2 * n + len(memory)
        starts = np.cumsum([2 * n, *(len(forms.memory) for forms in self.forms)])
        self.memory = [range(begin, end) for begin, end in pairwise(starts.tolist())]
        self.unit = np.eye(self.size, dtype=self.digits)
        self.place, self.speed, self.one = self.unit[:n], self.unit[n : 2 * n], self.unit[self.physical]

    def _drive(self) -> None:
        """What the drive moves: the counter-face with its rates, and the force of spring, damper and drive."""
        systems, motions = self.systems, self.motions
        self.signals = np.zeros((self.count, self.size, self.size), dtype=self.digits)
        for name in motions[0].rates:
            self.signals[:, self.places[name]] = self._driven([m.rates[name] for m in motions])
        face = self._driven([m.face for m in motions])
        self.face = [face, _through(face, self.signals)]
        self.face.append(_through(self.face[1], self.signals))
        self.base, self.force = self._driven([m.base for m in motions]), self._driven([m.force for m in motions])
        self.imposed = self._driven([m.imposed for m in motions]) if motions[0].imposed else None
        damper = _through(self.base, self.signals) * systems.on_base[:, None]
        self.mass, stiffness, damping = (
            part.astype(self.digits) for part in (systems.mass, systems.stiffness, systems.damping)
        )
        share = systems.share[:, None]
        self.push = (
            share * self.force[:, None]
            - stiffness @ (self.place - share * self.base[:, None])
            - damping @ (self.speed - share * damper[:, None])
        )
        for contact in self.contacts:  # a preload comes from outside, and balances the contact at no displacement
            if contact.normal is not None:
                self.push += np.outer(contact.normal, contact.preload * self.one)

    def _driven(self, forms: Sequence[Mapping[str, float]]) -> Rows:
        """One form of each drive, over the state's own names."""
        rows = np.zeros((len(forms), self.size), dtype=self.digits)
        for row, form in zip(rows, forms, strict=True):
            for name, value in form.items():
                row[self.places[name]] += value
        return np.asarray(rows[self.systems.drive])

    def _knows(self, contact: Rubbing, c: int) -> Rows:
        """What a contact's forms are made of (B, V, N), but for what the mode adds."""
        known = np.zeros((self.count, self.forms[c].width, self.size), dtype=self.digits)
        tangent = contact.tangent.astype(self.digits)
        known[:, 0], known[:, 1], known[:, 3] = tangent @ self.place, tangent @ self.speed, self.one
        known[:, 2] = contact.preload * self.one
        if contact.normal is not None:
            known[:, 2] += contact.stiffness * (contact.normal @ self.place)
        known[:, len(KNOWN) : FACE] = self.unit[list(self.memory[c])]
        known[:, FACE], known[:, FACE_RATE], known[:, FACE_ACCELERATION] = self.face
        return known

    def _faces(self, stuck: Sequence[int], order: int) -> Rows:
        """The counter-face's motion under the contacts that hold: (B, stuck, N)."""
        carried = np.array([self.contacts[c].carried for c in stuck]).reshape(-1, 1)
        return np.asarray(carried * self.face[order][:, None])

    def motion_in(self, j: int) -> tuple[Rows, Rows, list[Rows]]:
        """A of a mode, the friction forces (B, m, N), and what each contact knows in it."""
        parts, numbers = self.parts[j], self.joints[j].numbers
        friction = np.zeros((self.count, len(parts), self.size), dtype=self.digits)
        known = [own.copy() for own in self.known]
        if any(part.kind == "landing" for part in parts):  # no time passes: a contact has yet to find its mode
            return np.zeros_like(self.signals), friction, known
        flow, force = self.signals.copy(), self.push.copy()
        n, stuck = self.degrees, [c for c, part in enumerate(parts) if part.friction is None]
        for c, (part, contact) in enumerate(zip(parts, self.contacts, strict=True)):
            if contact.normal is not None and part.kind != "flight":
                force -= contact.normal[:, None] * known[c][:, None, 2]
            if part.friction is not None:
                friction[:, c] = (self.forms[c].modes[numbers[c]][:, :1] @ known[c])[:, 0]
                force -= contact.tangent[:, None] * friction[:, None, c]
        flow[:, :n], flow[:, n : 2 * n], friction[:, stuck] = self._moving(force, parts, stuck)
        rates = [self.forms[c].modes[numbers[c]][:, 1 : 1 + len(own)] for c, own in enumerate(self.memory)]
        follows = any(rate[:, :, [FRICTION_RATE, LOAD_RATE]].any() for rate in rates)
        for c, own in enumerate(known):
            own[:, FRICTION] = friction[:, c]
        for _ in range(1 + follows):  # memory that follows a force's rate, anew with the other memory that moves
            for c, own in enumerate(known):
                own[:, FRICTION_RATE], own[:, LOAD_RATE] = (_through(own[:, k], flow) for k in (FRICTION, 2))
                flow[:, self.memory[c].start : self.memory[c].stop] = rates[c] @ own
        for own in known:
            own[:, FRICTION_RATE], own[:, LOAD_RATE] = (_through(own[:, k], flow) for k in (FRICTION, 2))
        return flow, friction, known

    def _moving(self, force: Rows, parts: Sequence[Mode], stuck: list[int]) -> tuple[Rows, Rows, Rows]:
        """Velocity and acceleration of every mass, and the friction of the contacts that hold."""
        if not stuck:
            return self.speed, self._accelerated(force), np.zeros((self.count, 0, self.size))
        rows = np.array([self.contacts[c].tangent for c in stuck], dtype=self.digits)
        speed = self._faces(stuck, 1) + np.outer([parts[c].speed for c in stuck], self.one)
        acceleration = self._faces(stuck, 2)
        if len(stuck) == self.degrees:  # nothing is free: the contacts take what the masses' forced motion leaves
            spread = rows.T @ _solved(rows @ rows.T, np.eye(len(rows)))
            forced = spread @ acceleration
            return spread @ speed, forced, spread.T @ (force - self.mass @ forced)
        assert self.inverse is not None
        share = _solved(rows @ self.inverse @ rows.T, np.eye(len(rows)))
        spread = self.inverse @ rows.T @ share
        free = np.eye(self.degrees) - spread @ rows
        # entries that are whole but for rounding are whole: a mass that is held has no part in the motion
        free = np.where(np.abs(free - np.rint(free)) < WHOLE, np.rint(free), free)
        loose = self._accelerated(force)
        return (
            free @ self.speed + spread @ speed,
            free @ loose + spread @ acceleration,
            share @ (rows @ loose - acceleration),
        )

    def _accelerated(self, force: Rows) -> Rows:
        if self.imposed is not None:  # whatever acts on it
            return _through(_through(self.imposed, self.signals), self.signals)[:, None]
        return np.asarray(force / self.mass if self.inverse is None else self.inverse @ force)

    def _resets(self, j: int, rows: list[Rows], out: Array) -> None:
        """R of each exit of a mode, written over the unit matrices of `out`: the memory that it resets, and no velocity
        left where a contact has stopped or holds."""
        joint, taken = self.joints[j], [0] * len(self.contacts)
        for e, (c, number) in enumerate(joint.exits):
            exit_ = self.parts[j][c].exits[number]
            carry = None
            for name in exit_.reset:
                if carry is None:
                    carry = np.tile(self.unit, (self.count, 1, 1))
                place = self.memory[c][self.forms[c].memory.index(name)]
                carry[:, place] = rows[c][:, taken[c]]
                taken[c] += 1
            stuck = self._held(j, e)
            if stuck:
                if stuck not in self.still:
                    self.still[stuck] = self._stilled(dict(stuck))
                out[:, e] = self.still[stuck] if carry is None else self.still[stuck] @ carry
            elif carry is not None:
                out[:, e] = carry

    def _held(self, j: int, e: int) -> tuple[tuple[int, float], ...]:
        """The contacts whose velocity is told after an exit, and that velocity."""
        joint = self.joints[j]
        c, number = joint.exits[e]
        parts, following = self.parts[j], self.parts[joint.targets[e]]
        stuck = {k: part.speed for k, part in enumerate(following) if part.friction is None}
        if self.degrees > 1:  # one mass that is held has the counter-face's motion to the last digit
            stuck = {k: part.speed for k, part in enumerate(parts) if part.friction is None} | stuck
        # an exit at zero velocity leaves exactly none: rounding must not decide what follows
        if set(parts[c].exits[number].quantity) == {"v"} and parts[c].kind != "landing":
            stuck.setdefault(c, 0.0)
        return tuple(sorted(stuck.items()))

    def _stilled(self, stuck: Mapping[int, float]) -> Rows:
        """The state with the velocities of some contacts told, none where they hold."""
        columns = {
            c: (self.contacts[c].tangent, self.contacts[c].carried * self.face[1] + speed * self.one)
            for c, speed in stuck.items()
        }
        return np.asarray(stilled(np.tile(self.unit, (self.count, 1, 1)), self.degrees, columns))

    def build(self) -> Tables:
        joints, count, size = self.joints, self.count, self.size
        first = np.cumsum([0, *(len(joint.exits) for joint in joints)])
        flows = np.empty((count, len(joints), size, size))
        frictions = np.empty((count, len(joints), len(self.contacts), size))
        series = np.zeros((count, first[-1], DEGREE + 1, size))
        reset = np.empty((count, first[-1], size, size))
        reset[...] = np.eye(size)
        for j, joint in enumerate(joints):
            flow, frictions[:, j], known = self.motion_in(j)
            flows[:, j] = flow
            rows = [self._rows(j, c, known[c]) for c in range(len(known))]
            part = slice(first[j], first[j + 1])
            if joint.exits:
                quantities = np.concatenate([rows[c][0] for c in dict.fromkeys(c for c, _ in joint.exits)], axis=1)
                if self.systems.joint:
                    series[:, part] = derivatives(quantities, flow)
                else:
                    series[:, part, 0] = quantities
            self._resets(j, [own for _, own in rows], reset[:, part])
        if not self.systems.joint:
            now = meanwhile.now(derive, series.size * size)
            now(flows, first, series, np.empty((2, size**2), np.int64), np.empty(size**2))
        cell, hop = cells_of(flows, self.physical)
        return Tables(
            names=self.names,
            modes=self._modes(),
            flow=flows,
            cell=cell,
            hop=hop,
            series=series,
            target=np.array([target for joint in joints for target in joint.targets], dtype=np.int64),
            crossing=np.array(
                [self.parts[j][c].exits[e].crossing for j, joint in enumerate(joints) for c, e in joint.exits],
                dtype=np.bool_,
            ),
            reset=reset,
            first=first,
            tones=self._tones(),
            friction=frictions,
            outputs=self._outputs(),
            motions=tuple(self.motions[k] for k in self.systems.drive),
            period=np.array([m.period for m in self.motions])[self.systems.drive],
            begin=self._begin(),
            opening=self._opening(),
            physical=self.physical,
            degrees=self.degrees,
            entry=self._entry(),
        )

    def _rows(self, j: int, c: int, known: Rows) -> tuple[Rows, Rows]:
        """The quantities of the exits of contact c in a mode, and what they reset, as rows over the state."""
        number = self.joints[j].numbers[c]
        begin = 1 + len(self.memory[c])
        rows = self.forms[c].modes[number][:, begin:] @ known
        exits = len(self.parts[j][c].exits)
        return rows[:, :exits], rows[:, exits:]

    def _modes(self) -> tuple[Mode, ...]:
        if not self.systems.joint:
            return tuple(parts[0] for parts in self.parts)
        return tuple(
            JointMode.of(tuple(parts), [(parts[c].exits[e], c) for c, e in joint.exits])
            for parts, joint in zip(self.parts, self.joints, strict=True)
        )

    def _entry(self) -> tuple[int, int, int]:
        if self.systems.joint:
            return (0, 0, 0)
        order = [mode.name for mode in self.contacts[0].tables[0]]
        back, still, forward = (order.index(name) for name in self.contacts[0].laws[0].entry)
        return back, still, forward

    def _tones(self) -> Array:
        own = [[(self.places[c], self.places[s], w, phase) for c, s, w, phase in m.tones] for m in self.motions]
        return np.array(own, dtype=np.float64).reshape(len(own), -1, 4)[self.systems.drive]

    def _begin(self) -> Array:
        begin = self._driven([m.start for m in self.motions]).astype(np.float64)
        begin[:, self.physical] = 1.0
        return begin

    def _opening(self) -> Array:
        """The physical state at the start: no displacement, least velocities without slip, memory as the laws say."""
        opening = np.zeros((self.count, self.physical, self.size))
        if self.contacts:
            tangents = np.array([contact.tangent for contact in self.contacts])
            least = np.linalg.pinv(tangents) if self.systems.joint else tangents
            opening[:, self.degrees : 2 * self.degrees] = least @ self._faces(range(len(tangents)), 1)
        if self.imposed is not None:
            opening[:, 0], opening[:, 1] = self.imposed, _through(self.imposed, self.signals)
        for forms, own, known in zip(self.forms, self.memory, self.known, strict=True):
            opening[:, list(own)] = forms.opening @ known
        return opening

    def _outputs(self) -> dict[str, Array]:
        slips = [known[:, 1] - c.carried * self.face[1] for known, c in zip(self.known, self.contacts, strict=True)]
        rows = {
            "z": self.base,
            "slip": slips[0] if len(slips) == 1 else np.array(slips).reshape(self.count, len(slips), self.size),
            "face": self.face[0],
            "face_rate": self.face[1],
            "force": self.force,
        }
        if self.systems.joint:
            lifted = np.array([[part.kind == "flight" for part in parts] for parts in self.parts], dtype=bool)
            loads = np.array([known[:, 2] for known in self.known]).reshape(self.count, 1, len(slips), self.size)
            rows["load"] = np.where(lifted.reshape(1, len(self.parts), len(slips), 1), 0.0, loads)
        return {name: np.asarray(row, dtype=np.float64) for name, row in rows.items()}


def _through(rows: Rows, flow: Rows) -> Rows:
    """Each row times its own matrix."""
    return np.asarray((rows[:, None] @ flow)[:, 0])


def _solved(matrix: Rows, right: Any) -> Rows:
    """The solution of small symmetric positive systems by Gauss and Jordan."""
    size = matrix.shape[-1]
    right = np.broadcast_to(right, (*matrix.shape[:-2], *np.shape(right)[-2:]))
    work = np.concatenate([matrix, right], axis=-1)
    for j in range(size):
        work[..., j, :] /= work[..., j, j, None]
        for i in range(size):
            if i != j:
                work[..., i, :] -= work[..., i, j, None] * work[..., j, :]
    return np.asarray(work[..., size:])
