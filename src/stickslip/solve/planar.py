r"""The motion of a mass that rubs in a plane: between rest and rest a curved law, by the march that all have.

With u the velocity against the counter-face and P what pushes the mass against it, sliding is

    m u' = P(t, x, u) - F(|u|) u / |u|,

smooth but for u = 0, where two things happen that no series knows of. Both are put down as polynomials:

* An end of slip. Under a force P that stays, F |u| + P u falls by (F^2 - P^2) t / m, so that a mass with |P| < F comes
  to rest after m (F |u| + P u) / (F^2 - P^2), however it turns on its way. It ends from a speed so small that P stays.
* A begin of slip, u = t^p w(t): along P, with p = 1 where |P| exceeds the friction of the slowest slip, with p = 2
  where P has just reached it. The direction of u is that of w, which is smooth: w is found by collocation.

Where |P| > F a slip that slows down turns and goes on, and is followed through its least speed; it is at rest only
where it runs straight against P. Where |P| is F but for a thousandth, so slow a slip turns into P at once and drifts
along it, m s' = |P| - F in its speed s, to its end or until it is faster again.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import cache, cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import ArrayLike

from stickslip.arrays import Array, Index
from stickslip.laws.curved import CurvedMode, symbol
from stickslip.oscillator import PlanarOscillator
from stickslip.solve import march
from stickslip.solve.collocation import STAGES, WIDTH, method
from stickslip.solve.curved import CurvedTrajectory, implicit_of, model_of, run_curved
from stickslip.solve.march import FULL, HALT, REACH, STALL, STEADY, STIFF, TRY, Leaps, Steps, Work
from stickslip.solve.operations import Form, Operations, combined, flat, guards_of, sums_of
from stickslip.solve.refusal import named, unproved
from stickslip.solve.tables import Stops
from stickslip.solve.tape import Tape, kept_of
from stickslip.solve.taylor import Exits, Nodes

SLIP, STUCK, SLOW = range(3)  # a slow slip is followed where its end is not near, or where it turns
STOPPED, RELEASED, SPED, FAINT = range(4)  # exits: out of slip, out of stick, and two out of slow slip
MODES = ("slip", "slip", 0, symbol("f")), ("stuck", "stick", 0, None), ("slow", "slip", 0, symbol("f"))
NEAR = 1e-9  # of the speed that friction gives in a period: there a slip ends, its force as good as constant
BRIEF = 1e-6  # of a period: the longest that such an end may take
DRIFT = NEAR / BRIEF  # of the friction: an end takes longer only where P is as close to it
SHORTER = 50  # looks at a drift at most, each over the time up to where the one before has it end
REST = 1e-4  # of the speed at which a slip ends: a slip so slow is none, whatever pushes; far above the rounding of u
STRAIGHT = 1e-12  # of the largest speed: a slip so little beside P runs straight against it
LEVEL = 1e-12  # of the friction: P that exceeds it by no more is on the disc, for a run does not tell them apart
TURN = 0.2  # rad that the fastest motion turns in a begin: its ten powers of time are then exact to rounding
RESOLVED = 1e-12  # of w: what its last two coefficients may be
LEAST = 1e-5  # of the speed at which a slip ends: or what they may be of the velocity
SQUARED = 1e-8  # of w: a last step of Newton's, whose square is rounding
HALVINGS, NEWTON = 60, 12


@dataclass(frozen=True, eq=False, repr=False)
class PlanarTrajectory(CurvedTrajectory):
    """A simulated motion in a plane: as of a curved law; two rows of x, v, a, friction, slip, z and force."""

    def sample(self, times: ArrayLike, outputs: tuple[str, ...]) -> tuple[Array, Index]:
        """Values at increasing instants; parameters and returns as of :meth:`Trajectory.sample`."""
        values, piece = super().sample(times, outputs)
        begun = np.flatnonzero(~np.isfinite(values).all(axis=0))
        if not len(begun):
            return values, piece
        # where a slip begins, at rest, friction has the direction that it comes from
        plane = _Plane(self.system)
        state, _ = super().sample(np.asarray(times, dtype=np.float64)[begun], self.table.names)
        push = plane.push @ state
        friction = plane.system.friction.at(v=0.0) * push / np.hypot(*push)
        known = {"friction": friction, "a": (plane.flow[2:4] @ state) - friction / plane.system.mass}
        row = 0
        for name in outputs:
            count = len(self.labels(name))
            if name in known:
                values[row : row + count, begun] = known[name]
            row += count
        return values, piece


def planar_tape(system: PlanarOscillator) -> Tape:
    """The flat arrays of a mass in a plane: slip, and stick."""
    return _Plane(system).tape()


def run_planar(
    table: Tape, state: Array, mode: int, *, course: tuple[tuple[float, float], Stops], rtol: float, **rest: Any
) -> PlanarTrajectory:
    """As :func:`stickslip.solve.curved.run_curved`; whether the mass slides at the start, its velocity tells."""
    run = run_curved(table, state, mode, course=course, rtol=rtol, follow=_March(table, rtol), **rest)
    return PlanarTrajectory(**{field.name: getattr(run, field.name) for field in fields(run)})


class _Plane:
    """A mass in a plane as linear forms of its state (x1, x2, v1, v2, 1, signals), and what friction adds to them.

    Attributes
    ----------
    flow : ndarray (N, N)
        Rates of the state without friction.
    base, force, face : ndarray (2, N)
        Displacement of the springs' ends, applied force, displacement of the counter-face.
    slip, push : ndarray (2, N)
        Velocity against the counter-face, and what accelerates the mass against it [N].
    """

    def __init__(self, system: Any) -> None:
        self.system: PlanarOscillator = system
        self.motion = system.drive.motion()
        self.names = ("x1", "x2", "v1", "v2", "1", *self.motion.rates)
        size, motions = len(self.names), system.drive.motions
        self.flow: Array = np.zeros((size, size))
        for name, rate in self.motion.rates.items():
            self.flow[self.names.index(name)] = self.row(rate)
        self.base, self.force, self.face = (
            np.array([self.row(getattr(motion, part)) for motion in motions]) for part in ("base", "force", "face")
        )
        k, c = (np.diag(np.asarray(part, dtype=np.float64)) for part in (system.stiffness, system.damping))
        damper = self.base @ self.flow if system.damper == "base" else np.zeros((2, size))
        pushed = self.force + k @ (self.base - np.eye(2, size)) + c @ (damper - np.eye(2, size, 2))
        faced = self.face @ self.flow
        self.slip = np.eye(2, size, 2) - faced
        self.held: Array = np.vstack([faced, faced @ self.flow, self.flow[4:]])
        self.push = pushed - system.mass * faced @ self.flow
        self.flow[:2], self.flow[2:4] = np.eye(2, size, 2), pushed / system.mass

    def row(self, form: Mapping[str, float]) -> Array:
        """A drive's linear form over the state."""
        row = np.zeros(len(self.names))
        for name, value in form.items():
            row[self.names.index(name)] += value
        return row

    @cached_property
    def rate(self) -> float:
        """Fastest rate of springs, dampers and tones [rad/s]."""
        spring, damper = (float(np.max(np.abs(part))) for part in (self.system.stiffness, self.system.damping))
        own = math.sqrt(spring / self.system.mass), damper / self.system.mass
        return float(max(*own, *(abs(omega) for _, _, omega, _ in self.motion.tones)))

    @cached_property
    def time(self) -> float:
        """Shortest of the periods of drive and springs; a second where there is none [s]."""
        periods = [self.motion.period, 1 / self.system.frequency if self.system.frequency else math.inf]
        return min(periods) if math.isfinite(min(periods)) else 1.0

    @cached_property
    def near(self) -> float:
        """The speed at which a slip ends [m/s]; also far above the rounding of a fast counter-face's."""
        faced = np.abs(self.face @ self.flow).sum()
        return NEAR * self.system.friction.at(v=0.0) * self.time / self.system.mass + 1e3 * math.ulp(float(faced))

    def tape(self) -> Tape:
        """The operations of both modes, their exits and the outputs."""
        size = len(self.names)
        made = [self._sliding(fast=True), self._held(), self._sliding(fast=False)]
        entries = [
            [one.scaled(rates[j]) if rates[j] != ({}, 0.0) else (-1, 0.0) for j in range(size)]
            for one, rates, *_ in made
        ]
        quantities = [[one.scaled(exit_) for exit_ in exits] for one, _, exits, _ in made]
        moving = [one for one, *_ in made]
        outputs = [self._outputs(rates, friction) for _, rates, _, friction in made]
        kept = _copied(moving)
        places = {
            name: np.array([[one.node(form) for form in own[name]] for one, own in zip(kept, outputs, strict=True)])
            for name in outputs[0]
        }
        rate = np.array([[node for node, _ in own] for own in entries], dtype=np.int64)
        moved: Any = rate, np.array([[factor for _, factor in own] for own in entries])
        exits, guards = self._exits(quantities), guards_of(moving)
        sums = sums_of(moving, entries, quantities)
        opening = np.zeros((4, size))
        opening[2:] = self.face @ self.flow
        tones = [(self.names.index(c), self.names.index(s), omega, phase) for c, s, omega, phase in self.motion.tones]
        system: Any = self.system
        return Tape(
            system=system,
            names=self.names,
            modes=tuple(CurvedMode(*mode) for mode in MODES),
            motion=self.motion,
            physical=4,
            degrees=2,
            entry=(SLIP, SLIP, SLIP),
            opening=opening,
            tones=np.array(tones, dtype=np.float64).reshape(len(tones), 4),
            outputs={"face_rate": np.zeros(size), "slip": self.slip},
            nodes=Nodes(*flat(moving), *moved),
            kept=kept_of(size, sums, exits, guards),
            sums=sums,
            watched=Nodes(*flat(kept), *moved),
            exits=exits,
            guards=guards,
            places=places,
        )

    def _sliding(self, *, fast: bool) -> tuple[Operations, list[Form], list[Form], list[Form]]:
        """Slip: operations, rates, what ends it, and friction. Speeds in units of the slowest: a root needs it."""
        moving, near = Operations(len(self.names), {}), self.near
        along = [combined([(1 / near, _form(row))]) for row in self.slip]
        speed = moving.power(combined((1.0, moving.product(part, part)) for part in along), 0.5)
        moving.symbols = {"v": combined([(near, speed)])}
        level = moving.form(self.system.friction)
        friction = [moving.product(level, moving.quotient(part, speed)) for part in along]
        rates = [_form(row) for row in self.flow]
        for i in range(2):
            rates[2 + i] = combined([(1.0, rates[2 + i]), (-1 / self.system.mass, friction[i])])
        levels = [(-1.0, 1.0)] if fast else [(1.0, -2.0), (-1.0, REST)]
        return moving, rates, [combined([(side, speed), (level, ({}, 1.0))]) for side, level in levels], friction

    def _held(self) -> tuple[Operations, list[Form], list[Form], list[Form]]:
        """Stick: the mass goes with the counter-face, until the force that holds it leaves the disc."""
        moving, radius = Operations(len(self.names), {}), self.system.breakaway * (1 + LEVEL)
        friction = [_form(row) for row in self.push]
        shares = [combined([(1 / radius, part)]) for part in friction]
        rates = [_form(row) for row in self.flow]
        faced = self.face @ self.flow
        rates[:2], rates[2:4] = [_form(row) for row in faced], [_form(row) for row in faced @ self.flow]
        beyond = combined([*((1.0, moving.product(share, share)) for share in shares), (-1.0, ({}, 1.0))])
        return moving, rates, [beyond], friction

    def _outputs(self, rates: list[Form], friction: list[Form]) -> dict[str, list[Form]]:
        entry: list[Form] = [({j: 1.0}, 0.0) for j in range(len(self.names))]
        outputs = {"x": entry[:2], "v": entry[2:4], "a": rates[2:4], "state": entry[:4], "friction": friction}
        rows = {"slip": self.slip, "z": self.base, "force": self.force, "face": self.face}
        outputs |= {name: [_form(row) for row in own] for name, own in rows.items()}
        return outputs | {name: [entry[j]] for j, name in enumerate(self.names)}

    def _exits(self, quantities: list[list[tuple[int, float]]]) -> Exits:
        """How each mode may end. An end of slip counts where the speed falls through its level only."""
        own = [quantity for mode in quantities for quantity in mode]
        return Exits(
            node=np.array([node for node, _ in own], dtype=np.int64),
            factor=np.array([factor for _, factor in own], dtype=np.float64),
            target=np.array([STUCK, SLIP, SLIP, STUCK], dtype=np.int64),
            crossing=np.array([True, False, True, True]),
            polished=np.array([False, True, False, False]),
            carried=np.zeros(4, dtype=np.bool_),
            reset=np.tile(np.eye(len(self.names)), (4, 1, 1)),
            first=np.array([0, 1, 2, 4], dtype=np.int64),
        )


def _form(row: Array) -> Form:
    """A row over the state as a linear form; its entry 4 is the constant 1."""
    return {int(j): float(row[j]) for j in np.flatnonzero(row) if j != 4}, float(row[4])


def _copied(modes: list[Operations]) -> list[Operations]:
    """Operations to which outputs can be added."""
    copies = [Operations(one.size, {}) for one in modes]
    for copy, one in zip(copies, modes, strict=True):
        copy.rows, copy.known = list(one.rows), dict(one.known)
    return copies


def _crossed(series: Polynomial) -> list[float]:
    """Where a polynomial over -1 to 1 is zero, behind its begin."""
    roots: Any = series.roots()
    return [float(root.real) for root in roots if abs(root.imag) < 1e-12 and -1 < root.real <= 1]


class _Basis(NamedTuple):
    """Polynomials of a begin of slip with u = t^p w, over a time of 1: degree STAGES - 1 - p in w.

    At its points (Radau's) values of w, of t^p w, of its rate and of its integral, by the coefficients of w; the same
    polynomials, of t^p w and of its integral, as powers of 2 t - 1; and the powers of t at the points.
    """

    share: Array
    speed: Array
    rate: Array
    way: Array
    speeds: Array
    ways: Array
    times: Array


@cache
def _basis(p: int) -> _Basis:
    count = STAGES - p
    inner = np.polynomial.Legendre.basis(count) - np.polynomial.Legendre.basis(count - 1)
    points = np.append(np.sort(inner.roots().real)[:-1], 1.0)
    time = Polynomial([0.5, 0.5])
    shares = [Polynomial.basis(k) for k in range(count)]
    speeds = [time**p * share for share in shares]
    ways = [speed.integ(lbnd=-1) / 2 for speed in speeds]

    def at(parts: list[Polynomial]) -> Array:
        return np.column_stack([part(points) for part in parts])

    def powers(parts: list[Polynomial]) -> Array:
        return np.array([np.pad(part.coef, (0, WIDTH - len(part.coef))) for part in parts])

    rates = [2 * speed.deriv() for speed in speeds]
    stretches = np.vander(time(points), WIDTH)[:, ::-1]
    return _Basis(at(shares), at(speeds), at(rates), at(ways), powers(speeds), powers(ways), stretches)


@cache
def _shifted() -> Array:
    """Powers of t over a time of 1 as powers of 2 t - 1."""
    rows = [Polynomial([0.5, 0.5]) ** k for k in range(WIDTH)]
    return np.array([np.pad(row.coef, (0, WIDTH - len(row.coef))) for row in rows])


class _March:
    """The march of a mass in a plane: that of every curved law, and what is done at rest. Lives for one run."""

    def __init__(self, table: Tape, rtol: float) -> None:
        self.plane = _Plane(table.system)
        # every exit leads to no mode: whether the mass then slides or sticks is no matter of linear forms
        exits = table.exits._replace(target=-1 - np.arange(len(table.exits.target)))
        self.model = model_of(table, rtol)._replace(exits=exits)
        self.implicit, self.stiff, self.fresh = implicit_of(table, self.model), False, True
        self.level, self.slope = self.plane.system.friction, self.plane.system.friction.slope("v")
        self.rest, self.breakaway = self.level.at(v=0.0), self.plane.system.breakaway

    def __call__(
        self, clock: Array, state: Array, big: Array, mode: int, until: tuple[float, float], steps: Steps, work: Work
    ) -> tuple[int, int, int, int]:
        """As :func:`stickslip.solve.march.strides`; a place in steps and leaps is kept for the end and the begin of a
        slip."""
        place = _Place(self, clock, state, big, until, steps, work)
        if self.fresh:
            self.fresh, mode = False, place.opened()
        spare = Steps._make(column[:-2] for column in steps)
        leaps = work._replace(leaps=Leaps._make(column[:-2] for column in work.leaps))
        while place.row < len(spare.laps) and place.leapt < len(leaps.leaps.reach):
            if mode == SLOW and place.drifts:
                mode = place.drifted()
                continue
            rest = (clock, state, big, mode, until, spare, place.row)
            if self.stiff:
                outcome, place.row, place.leapt, mode = march.strides(self.implicit, *rest, place.leapt, leaps)
            else:
                outcome, place.row, mode = march.march(self.model, *rest, work.step)
            if outcome == STIFF:
                self.stiff = True
            elif outcome == HALT:
                mode = place.freed() if mode == -1 - RELEASED else place.slowed(-1 - mode)
            elif outcome == STALL and mode != STUCK and place.slow:
                mode = place.slowed(FAINT)
            else:
                return outcome, place.row, place.leapt, mode
        return FULL, place.row, place.leapt, mode


class _Place:
    """Where a march is, at an end or a begin of slip: clock, state and what is written there."""

    def __init__(
        self, own: _March, clock: Array, state: Array, big: Array, until: tuple[float, float], steps: Steps, work: Work
    ) -> None:
        self.own, self.plane, self.mass = own, own.plane, own.plane.system.mass
        self.clock, self.state, self.big, self.until, self.steps, self.work = clock, state, big, until, steps, work
        self.row = self.leapt = 0

    @property
    def slip(self) -> Array:
        """Velocity against the counter-face [m/s]."""
        return np.asarray(self.plane.slip @ self.state)

    @property
    def slow(self) -> bool:
        """Whether it is as good as none."""
        return bool(np.hypot(*self.slip) <= self.plane.near * (1 + 1e-9))

    @property
    def push(self) -> Array:
        """What pushes the mass against the counter-face [N]."""
        return np.asarray(self.plane.push @ self.state)

    @property
    def remaining(self) -> float:
        """Time to the end of the march [s]."""
        return float(march.remaining_of(self.clock, self.until, self.own.model.period))

    @property
    def drifts(self) -> bool:
        """Whether a slow slip goes along a push that is as good as its friction."""
        return self.remaining > 0.0 and bool(abs(np.hypot(*self.push) - self.own.rest) <= DRIFT * self.own.rest)

    def opened(self) -> int:
        """The mode in which a run starts."""
        if not self.slow:
            return SLIP
        self.still()
        return self.rested()

    def still(self) -> None:
        """The counter-face's velocity to the last digit."""
        self.state[2:4] -= self.slip

    def rested(self) -> int:
        """The mode of a mass that is at rest: it stays on the disc, or begins to slide at once."""
        held = np.hypot(*self.push) <= self.own.breakaway * (1 + LEVEL)
        return STUCK if held else self.released()

    def slowed(self, leaving: int) -> int:
        """The mode behind a change of speed: stick, slip the other way, or the same slip, slow or no more so."""
        slip, push, rest = self.slip, self.push, self.own.rest
        speed, force = np.hypot(*slip), np.hypot(*push)
        across = abs(slip[0] * push[1] - slip[1] * push[0])
        straight = across <= STRAIGHT * np.hypot(*self.big[2:4]) * force and push @ slip <= 0
        longest = BRIEF * self.plane.time
        if self.row:
            self.steps.ends[self.row - 1] = -1  # the event, if it is one, is at the end of what follows
        if leaving == SPED:
            return SLIP
        if force < rest:
            time = self.mass * (rest * speed + push @ slip) / (rest**2 - force**2)
        else:
            time = self.mass * speed / (rest + force)
        if leaving == FAINT:
            time = min(time, longest)
        elif time > longest or not (force < rest or straight):
            return SLOW
        speeds, ways = np.zeros((2, WIDTH)), np.zeros((2, WIDTH))
        speeds[:, 0], speeds[:, 1] = slip / 2, -slip / 2
        ways[:, :3] = time * slip[:, None] * np.array([0.375, 0.25, -0.125])  # of t - t^2 / 2
        if time > 0.0 and not self.lay(speeds, ways, time, STOPPED):
            return SLOW
        self.still()
        return self.rested()

    def drifted(self) -> int:
        """The mode behind a slow slip along P, which ends, or is slow no more: put down as far as a series reaches."""
        slip, push, near = self.slip, self.push, self.plane.near
        force = float(np.hypot(*push))
        speed = (self.own.rest * np.hypot(*slip) + push @ slip) / (self.own.rest + force)  # what turning leaves of it
        rates = self._held()
        along, scheme = (push / force) ** 2, method()
        spring = -along @ np.diag(self.plane.push[:, :2])
        damper = self.own.slope.at(v=0.0) - along @ np.diag(self.plane.push[:, 2:4])
        time = min(self.remaining, TURN / self.plane.rate if self.plane.rate else self.remaining)
        for _ in range(SHORTER):
            pushes = np.vander(scheme.points * time, WIDTH, increasing=True) @ (rates @ self.plane.push.T)
            forces, sums = np.hypot(*pushes.T), time * scheme.matrix
            moved = np.eye(STAGES) + sums @ (damper * np.eye(STAGES) + spring * sums) / self.mass
            speeds = np.linalg.solve(moved, speed + sums @ (forces - self.own.rest) / self.mass)
            series = Polynomial(scheme.fit @ (speeds - speed)) + speed
            ends = [root for level in (0.0, 2 * near) for root in _crossed(series - level)]
            if not ends or min(ends) > 1 - 1e-9:
                break
            time *= (min(ends) + 1) / 2
        slips = (speeds / forces)[:, None] * pushes
        first = speed / force * push
        powers = (scheme.fit @ (slips - first)).T
        powers[:, 0] += first
        stopped = bool(ends) and speeds[-1] < near
        if not self.lay(powers, (scheme.fit @ (sums @ slips)).T, time, STOPPED if stopped else -1) or not stopped:
            return SLOW if speeds[-1] < near else SLIP
        self.still()
        return self.rested()

    def _held(self) -> Array:
        """Powers of the time of a state that goes with the counter-face from now on."""
        rates = [self.state.copy()]
        for k in range(1, WIDTH):
            rates.append(self.plane.held @ rates[-1] / k)
        return np.array(rates)

    def freed(self) -> int:
        """The mode behind a stick."""
        if not self.row:  # due where a chunk begins: its event needs a step of its own
            march.write(self.steps, 0, self.clock, self.state, STUCK, 0.0, RELEASED, -1)
            self.row = 1
        self.still()
        return self.released()

    def released(self) -> int:
        """Slip: its begin from rest, along what pushes, put down up to where a series can go on."""
        remaining = self.remaining
        if not remaining > 0.0:
            return SLIP
        pushes = self._held() @ self.plane.push.T
        along = pushes[0] / np.hypot(*pushes[0])
        p, most = self._power(pushes @ along)
        for k in range(p - 1):  # what is as good as none, is none
            pushes[k] -= (pushes[k] @ along - self.own.rest * (k == 0)) * along
        time = min(remaining, TURN / self.plane.rate if self.plane.rate else remaining)
        for _ in range(HALVINGS):
            shares = self._begun(p, most * along, pushes, time)
            if shares is not None:
                basis = _basis(p)
                self.lay(time**p * shares.T @ basis.speeds, time ** (p + 1) * shares.T @ basis.ways, time, -1)
                return SLIP
            time /= 2
        raise unproved(self._told())

    def _power(self, pushes: Array) -> tuple[int, float]:
        """The power p of the time with which the speed begins to grow, and its factor."""
        rest, time = self.own.rest, self.plane.time
        excess = [pushes[0] - rest, *pushes[1:3]]
        for p, value in enumerate(excess, start=1):
            if value * time ** (p - 1) > 2 * LEVEL * rest:
                return p, value / (p * self.mass)
        raise unproved(self._told())

    def _begun(self, p: int, first: Array, pushes: Array, time: float) -> Array | None:
        """Coefficients (STAGES - p, 2) of w = u / t^p over a time [s], w = `first` at its begin; None where they do not
        reach as far."""
        basis, own, m = _basis(p), self.own, self.mass * time ** (p - 1)
        spring, damper = self.plane.push[:, :2] * time ** (p + 1), self.plane.push[:, 2:4] * time**p
        held = basis.times @ (pushes * time ** np.arange(WIDTH)[:, None])
        count = len(held)
        shares, unit = np.zeros((count, 2)), np.eye(2)
        shares[0] = first
        fixed = np.einsum("il,jk->jikl", m * unit, basis.rate)
        fixed -= np.einsum("il,jk->jikl", spring, basis.way) + np.einsum("il,jk->jikl", damper, basis.speed)
        for _ in range(NEWTON):
            w, speed = basis.share @ shares, time**p * np.hypot(*(basis.speed @ shares).T)
            size = np.hypot(*w.T)
            if not np.all(w @ first > 0):
                return None
            along = w / size[:, None]
            level = np.array([own.level.at(v=v) for v in speed])
            slope = np.array([own.slope.at(v=v) for v in speed]) * time**p * basis.times[:, p]
            twice = np.einsum("ji,jl->jil", along, along)
            turned = (level / size)[:, None, None] * (unit - twice) + slope[:, None, None] * twice
            left = np.einsum("jikl,kl->ji", fixed, shares) - held + level[:, None] * along
            jacobian = fixed + np.einsum("jil,jk->jikl", turned, basis.share)
            change = np.linalg.solve(jacobian.reshape(2 * count, -1), left.ravel()).reshape(count, 2)
            shares -= change
            if np.max(np.abs(change)) <= SQUARED * np.max(np.abs(shares)):
                break
        else:
            return None
        least = LEAST * self.plane.near / time**p
        return shares if np.max(np.abs(shares[-2:])) <= max(RESOLVED * np.max(np.abs(shares)), least) else None

    def lay(self, speeds: Array, ways: Array, time: float, leaving: int) -> bool:
        """Put down a slip whose velocity against the counter-face is a polynomial, and go to its end; whether the run
        has not ended before."""
        remaining = self.remaining
        whole, ahead, term = time <= remaining, min(time, remaining), self.state
        powers = [term]
        for k in range(1, WIDTH):
            term = self.plane.held @ term * (time / k)
            powers.append(term)
        poly = self.work.leaps.polys[self.leapt]
        poly[:] = np.array(powers).T @ _shifted()
        poly[2:4] += speeds
        poly[:2] += ways
        march.write(self.steps, self.row, self.clock, self.state, SLIP, ahead, leaving if whole else -1, self.leapt)
        self.work.leaps.reach[self.leapt] = time
        self.state[:] = poly @ (2 * ahead / time - 1) ** np.arange(WIDTH)
        self.clock[TRY], self.clock[REACH], self.clock[STEADY] = ahead, 0.0, 0.0
        before = self.steps.states[self.row]
        march.passed(self.own.model, self.clock, self.until, remaining, ahead, -1, before, self.state, self.big)
        self.row, self.leapt = self.row + 1, self.leapt + 1
        return bool(whole)

    def _told(self) -> str:
        return f"lap {self.clock[0]:g}, {self.clock[1]:g} s, at {named(self.plane.names[:4], self.state)}"
