"""From a system to flat mode tables: everything the compiled kernels read.

The state is one vector S: displacement, velocity, the law's memory, the constant 1 and the drive's signals. In each
mode it obeys S' = A S; each exit is a row q that ends the mode when q S rises above zero, and a matrix R that carries
the state over: S -> R S. All closed forms, certificates and Jacobians follow from A, q and R.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stickslip.drives import Motion
from stickslip.errors import ModelError
from stickslip.laws.base import Exit, Law, Mode
from stickslip.laws.curved import CurvedLaw
from stickslip.oscillator import Oscillator
from stickslip.structure import Structure

Array = NDArray[np.float64]
System = Oscillator | Structure

DEGREE = 20  # of the Taylor polynomial in a cell; with rate * cell <= 1 the remainder is 1/21! = 2e-20 of its scale
SPLITTER = 134217729.0  # 2^27 + 1: halves a number into 26 bits and the rest
SETTLED = 16  # terms of an exponential after which one that changes nothing is followed by none that does
CANCELLED = 8 * 2.220446049250313e-16  # of the terms: what rounding leaves of a difference of equals


@dataclass(frozen=True, eq=False)
class Automaton:
    """A system as flat tables; E exits over M modes, N entries of the state.

    Attributes
    ----------
    names : tuple of str
        What each entry of the state is.
    modes : tuple of Mode
        The law's table, for names, kinds and sides.
    flow : ndarray (M, N, N)
        A of each mode.
    cell : ndarray (M,)
        Length [s] of a Taylor cell: the reciprocal of the mode's fastest rate; infinite where nothing turns.
    hop : ndarray (M, 3, N, N)
        exp(A cell), in the three parts of :func:`halved`.
    series : ndarray (E, DEGREE + 1, N)
        q A^k of each exit: its derivatives as linear forms of the state.
    target, crossing : ndarray (E,)
        Mode that follows; whether only a crossing counts.
    reset : ndarray (E, N, N)
        R of each exit, with the stuck velocity set where the next mode holds the mass.
    first : ndarray (M + 1,)
        Exits of mode j are ``first[j]`` to ``first[j + 1]``.
    friction : ndarray (M, N)
        Friction force as a linear form of the state.
    outputs : mapping of str to ndarray (N,)
        Base displacement "z", relative velocity "slip", applied "force".
    motion : Motion
        The drive.
    physical : int
        Number of leading entries that belong to the oscillator and its law.
    entry : tuple of int
        Modes in which motion starts with negative, zero and positive relative velocity.
    opening : ndarray (physical, N)
        Each physical entry at the start, where it is not given, as a linear form of the entries before it.
    tones : ndarray (J, 4)
        Index of cosine, index of sine, angular frequency, phase.
    degrees : int
        Degrees of freedom: the state starts with their displacements, then their velocities.
    """

    names: tuple[str, ...]
    modes: tuple[Mode, ...]
    flow: Array
    cell: Array
    hop: Array
    series: Array
    target: NDArray[np.int64]
    crossing: NDArray[np.bool_]
    reset: Array
    first: NDArray[np.int64]
    friction: Array
    outputs: Mapping[str, Array]
    motion: Motion
    physical: int
    entry: tuple[int, int, int]
    opening: Array
    tones: Array
    degrees: int = 1

    @property
    def tables(self) -> tuple[NDArray[Any], ...]:
        """The arrays that the kernels read, in their order."""
        return (self.flow, self.cell, self.hop, self.series, self.target, self.crossing, self.reset, self.first,
                self.tones)  # fmt: skip

    @cached_property
    def leap(self) -> Array:
        """What carries the state from a mode to another through modes in which no time passes (M, M, N, N)."""
        return np.asarray(leaps_between(self.first, self.target, self.reset[None])[0])

    def index(self, mode: str) -> int:
        """Number of the mode of that name."""
        names = [m.name for m in self.modes]
        if mode not in names:
            raise ModelError(f"no mode is called '{mode}'", f"the law has {', '.join(names)}", "choose one of them")
        return names.index(mode)


def automaton(system: System) -> Automaton:
    """The flat tables of a system."""
    if isinstance(system, Structure):
        from stickslip.solve.product import product

        return product(system)
    if isinstance(system.law, CurvedLaw):
        raise ModelError(
            f"{type(system.law).__name__} has curved modes",
            "this question needs a law of linear modes",
            "ask simulate(), or make a polygon of the curve with Tabulated.of()",
        )
    return _known(system) if by_value(system) else _built(system)


def by_value(system: Oscillator) -> bool:
    """Whether an equal system is the same one: law and drive are compared by their values."""
    return all(type(part).__hash__ not in (None, object.__hash__) for part in (system.law, system.drive))


def _built(system: Oscillator) -> Automaton:
    return _Builder(system, system.law).build()  # type: ignore[arg-type]


_known = lru_cache(maxsize=32)(_built)  # a fit asks for the same system from many starts


class _Builder:
    """Turns rows over names into rows over the state; lives for one call of :func:`automaton`."""

    def __init__(self, system: Oscillator, law: Law) -> None:
        self.system, self.law, self.motion, self.modes = system, law, system.drive.motion(), law.modes()
        self.memory, self.places = tuple(law.memory), law.places
        self.names = ("x", "v", *self.memory, "1", *self.motion.rates)
        self.size = len(self.names)
        motion = self.motion
        self.base = self.row(motion.base)
        self.face = [self.row(motion.face)]
        self.signals = np.zeros((self.size, self.size))
        for name, rate in motion.rates.items():
            self.signals[self.names.index(name)] = self.row(rate)
        self.face.append(self.face[0] @ self.signals)
        self.face.append(self.face[1] @ self.signals)
        damper = self.base @ self.signals if system.damper == "base" else np.zeros(self.size)
        self.push = (
            self.row(motion.force)
            + system.stiffness * (self.base - self.row({"x": 1.0}))
            - system.damping * (self.row({"v": 1.0}) - damper)
        )

    def row(self, form: Mapping[str, float]) -> Array:
        """A linear form over the state's own names."""
        row = np.zeros(self.size)
        for name, value in form.items():
            row[self.names.index(name)] += value
        return row

    def relative(self, form: Mapping[str, float], friction: Array, slope: Array | None = None) -> Array:
        """A law's linear form: x and v relative to the counter-face, f the friction of the mode, df its rate.

        The law's places are kept in the frame of x, so that x less a place loses no digits however far a belt runs.
        """
        own = {name: value for name, value in form.items() if name not in ("f", "df")}
        carried = sum(value for name, value in own.items() if name == "x" or name in self.places)
        row = self.row(own) - carried * self.face[0] - own.get("v", 0.0) * self.face[1]
        row += form.get("f", 0.0) * friction
        return row if slope is None else row + form.get("df", 0.0) * slope

    def moved(self, name: str, order: int) -> Array:
        """What a place owes to the counter-face: its displacement (order 0) or velocity (1)."""
        return self.face[order] if name in self.places else np.zeros(self.size)

    def held(self) -> Array:
        """The state with the mass's velocity set to the counter-face's."""
        carry = np.eye(self.size)
        carry[1] = self.face[1]
        return carry

    def carry(self, exit_: Exit, friction: Array, held: bool) -> Array:
        """R of an exit."""
        carry = np.eye(self.size)
        for name, form in exit_.reset.items():
            carry[self.names.index(name)] = self.relative(form, friction) + self.moved(name, 0)
        return self.held() @ carry if held else carry

    def build(self) -> Automaton:
        system, order = self.system, {mode.name: j for j, mode in enumerate(self.modes)}
        frictions, flows = [], []
        for mode in self.modes:
            flow = self.signals.copy()
            flow[0, 1] = 1.0
            if mode.friction is None:
                friction = self.push - system.mass * self.face[2]
                flow[0], flow[1] = self.face[1], self.face[2]
            else:
                friction = self.relative(mode.friction, np.zeros(self.size))
                flow[1] = (self.push - friction) / system.mass
            slope = friction @ flow
            for name in self.memory:
                rate = self.relative(mode.rates.get(name, {}), friction, slope)
                flow[self.names.index(name)] = rate + self.moved(name, 1)
            frictions.append(friction)
            flows.append(flow)
        rows, targets, resets, first = [], [], [], [0]
        cells, hops = [], []
        for mode, flow, friction in zip(self.modes, flows, frictions, strict=True):
            slope = friction @ flow
            quantities = np.array([self.relative(exit_.quantity, friction, slope) for exit_ in mode.exits])
            cell, hop, series = _mode_tables(flow.tobytes(), quantities.tobytes(), self.size)
            cells.append(cell)
            hops.append(hop)
            rows += list(series)
            for exit_ in mode.exits:
                target = order[exit_.to]
                targets.append(target)
                # an exit at zero velocity leaves exactly none: rounding must not decide what follows
                stopped = set(exit_.quantity) == {"v"}
                resets.append(self.carry(exit_, friction, stopped or self.modes[target].friction is None))
            first.append(len(rows))
        entry = self.law.entry
        none = np.zeros(self.size)
        opening = [none, self.face[1]]
        opening += [self.relative(form, none) + self.moved(name, 0) for name, form in self.law.memory.items()]
        tones = [(self.names.index(c), self.names.index(s), w, phase) for c, s, w, phase in self.motion.tones]
        return Automaton(
            names=self.names,
            modes=self.modes,
            flow=np.array(flows),
            cell=np.array(cells),
            hop=np.array(hops),
            series=np.array(rows).reshape(len(rows), DEGREE + 1, self.size),
            target=np.array(targets, dtype=np.int64),
            crossing=np.array([e.crossing for mode in self.modes for e in mode.exits], dtype=np.bool_),
            reset=np.array(resets).reshape(len(rows), self.size, self.size),
            first=np.array(first, dtype=np.int64),
            friction=np.array(frictions),
            outputs={
                "z": self.base,
                "slip": self.row({"v": 1.0}) - self.face[1],
                "face": self.face[0],
                "face_rate": self.face[1],
                "force": self.row(self.motion.force),
            },
            motion=self.motion,
            physical=2 + len(self.memory),
            entry=(order[entry[0]], order[entry[1]], order[entry[2]]),
            opening=np.array(opening),
            tones=np.array(tones).reshape(len(tones), 4),
        )


@lru_cache(maxsize=512)
def _mode_tables(flow_: bytes, quantities_: bytes, size: int) -> tuple[float, Array, Array]:
    """Cell, hop and series of a mode: systems that differ a little, as those of a fit, share most of theirs."""
    flow, quantities = (np.frombuffer(data).reshape(-1, size) for data in (flow_, quantities_))
    series = np.stack(derivatives(quantities, flow), axis=1)
    return *cell_of(flow), series


def cell_of(flow: Array) -> tuple[float, Array]:
    """The length of a Taylor cell [s], in which no rate turns more than one radian, and exp(A cell) as `hop` has it."""
    rate = fastest(flow)
    cell = 1.0 / rate if rate > 0 else np.inf
    return cell, halved(exponential(flow, cell, rate))


def derivatives(quantity: Any, flow: Any) -> list[Any]:
    """q A^k of an exit, or of several as rows; where terms cancel but for their rounding, nothing is left."""
    rows = [quantity]
    sizes = np.abs(flow)
    for _ in range(DEGREE):
        if not np.any(rows[-1]):
            break
        row, size = rows[-1] @ flow, np.abs(rows[-1]) @ sizes
        rows.append(np.where(np.abs(row) > CANCELLED * size, row, 0.0))
    return rows + [np.zeros_like(rows[-1])] * (DEGREE + 1 - len(rows))


def leaps_between(first: NDArray[np.int64], targets: NDArray[np.int64], resets: Array) -> Array:
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


def fastest(flow: Array) -> float:
    """The fastest rate of a flow [1/s]: the largest modulus of its eigenvalues.

    They are found without the constant and nilpotent parts, whose eigenvalues come out of a general solver as small
    noise instead of zero.
    """
    return float(np.max(np.abs(_eigenvalues(flow)), initial=0.0))


def _eigenvalues(flow: Array) -> Any:
    """Eigenvalues of the strongly connected parts of the flow: exact zeros stay zero."""
    parts = _parts((flow != 0).tobytes(), len(flow))
    return np.concatenate([
        flow[part[0], part] if len(part) == 1 else np.linalg.eigvals(flow[np.ix_(part, part)]) for part in parts
    ])  # fmt: skip


@lru_cache(maxsize=256)
def _parts(pattern: bytes, size: int) -> list[tuple[int, ...]]:
    """Strongly connected parts of a flow, by where it is not zero."""
    reach = np.frombuffer(pattern, dtype=bool).reshape(size, size) | np.eye(size, dtype=bool)
    for _ in range(max(1, size.bit_length())):
        reach = reach @ reach
    return sorted({tuple(np.flatnonzero(reach[j] & reach[:, j]).tolist()) for j in range(size)})


def halved(matrix: Any) -> Array:
    """A matrix as a sum of three: its first 26 bits, the rest of a double, and what a double has no room for."""
    whole = np.asarray(matrix, dtype=np.float64)
    spread = SPLITTER * whole
    upper = spread - (spread - whole)
    return np.array([upper, whole - upper, np.asarray(matrix - whole, dtype=np.float64)])


def exponential(flow: Array, time: float, rate: float | None = None) -> Any:
    """exp(A t) in extended precision by its Taylor series, halved until no entry of the flow dominates.

    Each entry is summed on its own, so entries of very different units keep their digits. `rate` is the flow's fastest
    rate where it is known.
    """
    if not np.isfinite(time):
        return np.eye(len(flow), dtype=np.longdouble)
    turned = (fastest(flow) if rate is None else rate) * time
    halvings = max(0, int(np.ceil(np.log2(turned))) + 1) if turned > 0.5 else 0
    step = np.asarray(flow, dtype=np.longdouble) * (np.longdouble(time) / 2**halvings)
    total = term = np.eye(len(flow), dtype=np.longdouble)
    for k in range(1, 40):
        term = term @ step / k
        before, total = total, total + term
        if k >= SETTLED and np.array_equal(total, before):
            break
    for _ in range(halvings):
        total = total @ total
    return total
