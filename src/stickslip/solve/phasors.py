"""The fast path through the same tables: two phasors for each piece, one that the drive turns and one that runs free.

Where the memory rests, one tone drives and the free motion turns (no mode aperiodic, none at resonance), an exit is

    g(t) = G + Re(D e^{i w t}) + Re(W e^{l t}),

displacement, velocity and every derivative come from the same two phasors, and the duration found one lap of the drive
earlier is an excellent guess for the next one: one Halley step polishes it, quartic bounds in Bernstein form from both
ends certify that no exit lies before it. Where any of this fails, the general march takes over for one piece.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from stickslip.arrays import Array, Complex, Index, Mask
from stickslip.compiled import FAST, compiled, meanwhile
from stickslip.solve.cells import distinct
from stickslip.solve.tables import Tables

KEEPS, STOPS, CARRIES = 0.0, 1.0, 2.0  # what an exit does to velocity and memory
HALF_STEP = 0.09  # rad between a node and the edge of its polynomial; degree 9 leaves 1e-17
LONGEST = 8192  # nodes of one table
SLIDING, HELD = 1.0, 0.0


class Phasors(NamedTuple):
    """The tables of the fast path: M modes, E exits, C entries that rest (memory and the constant).

    Those of many systems have a leading axis, and their nodes one after another; :meth:`of` gives those of one.

    Attributes
    ----------
    drive : ndarray (4,)
        Angular frequency [rad/s], phase [rad], nodes per second and number of nodes of the drive's table.
    mode : ndarray (M, 12)
        What :func:`slide_of` reads.
    level : ndarray (M, C)
        Constant forcing of each mode as a linear form of what rests.
    exit : ndarray (E, 9)
        What :func:`way_out` reads.
    rest : ndarray (E, C)
        G of each exit as a linear form of what rests.
    nodes : ndarray (K, 3)
        e^{i w t} and, mode by mode, e^{l t} at their nodes, and the node's time.
    span : ndarray (2,)
        First node of the system and the one after its last; it has none where it is not of the kind.
    """

    drive: Array
    mode: Array
    level: Array
    exit: Array
    rest: Array
    nodes: Array
    span: Index

    def of(self, number: int) -> Phasors:
        """The tables of one system."""
        begin, end = self.span[number]
        own = (part[number] for part in (self.drive, self.mode, self.level, self.exit, self.rest))
        return Phasors._make([*own, self.nodes[begin:end], np.array([0, end - begin])])


class Turn(NamedTuple):
    """What turns, and where its nodes are: how many, the first, how many in a second; and its rate [1/s]."""

    first: int
    nodes: int
    density: float
    rate: complex


class Slide(NamedTuple):
    """A mode: whether the mass moves freely in it, and how.

    Attributes
    ----------
    free : Turn
        The free motion e^{l t}.
    forced : complex
        Amplitude that the drive forces.
    softness : float
        Displacement of the centre by a constant forcing [s^2].
    speed, swing : float
        |l| and 1 / (imaginary part of l).
    reach : float
        Modulus sum of the forced amplitude.
    """

    slides: bool
    free: Turn
    forced: complex
    softness: float
    speed: float
    swing: float
    reach: float


class Way(NamedTuple):
    """An exit: its coefficients of x and v, D, W per unit of free amplitude, the moduli of both, and its deed."""

    x: float
    v: float
    drive: complex
    free: complex
    free_size: float
    drive_size: float
    deed: float


@compiled(**FAST, forceinline=True)
def drive_of(fast):
    """The drive's turning."""
    return Turn(0, int(fast.drive[3]), fast.drive[2], complex(0.0, fast.drive[0]))


@compiled(**FAST, forceinline=True)
def slide_of(fast, mode):
    """A row of the modes' table, as :func:`_slides` writes it."""
    row = fast.mode[mode]
    free = Turn(int(row[9]), int(row[10]), row[8], complex(row[1], row[2]))
    return Slide(row[0] == SLIDING, free, complex(row[3], row[4]), row[5], row[6], row[7], row[11])


@compiled(**FAST, forceinline=True)
def way_out(fast, e):
    """A row of the exits' table, as :func:`_phasors` writes it."""
    row = fast.exit[e]
    return Way(row[0], row[1], complex(row[2], row[3]), complex(row[4], row[5]), row[6], row[7], row[8])


def phasors_of(tables: Tables) -> Phasors:
    """The tables of the fast path of many systems."""
    return _phasors(tables, tables.flow, tables.series[:, :, 0], tables.reset, tables.tones)


@lru_cache(maxsize=32)
def fast_tables(table: Tables) -> Phasors:
    """The tables of the fast path of one system; with no nodes at all where it has none."""
    return _phasors(table, table.flow[None], table.series[None, :, 0], table.reset[None], table.tones[None]).of(0)


def _phasors(tables: Tables, flow: Array, rows: Array, reset: Array, tones: Array) -> Phasors:
    """The tables of the fast path of B systems, from their flows, the quantities (B, E, N) and resets of their exits,
    and what turns."""
    count, number, size = flow.shape[:3]
    exits, physical, first = rows.shape[1], tables.physical, tables.first
    resting = slice(2, physical + 1)
    if tones.shape[1] != 1 or size != physical + 3 or exits == 0:
        return without(count)
    omega, phase = tones[:, 0, 2], tones[:, 0, 3]
    able = ~np.any(flow[:, :, resting], axis=(1, 2, 3))
    modes, levels = np.zeros((count, number, 12)), np.zeros((count, number, physical - 1))
    ways, rests = np.zeros((count, exits, 9)), np.zeros((count, exits, physical - 1))
    turns, sliding = [1j * omega], []
    for j in range(number):
        own, part = flow[:, j], slice(first[j], first[j + 1])
        q = rows[:, part]
        drive = q[:, :, -2] - 1j * q[:, :, -1]
        ways[:, part, :2], rests[:, part] = q[:, :, :2], q[:, :, resting]
        if np.any(own[:, :2]):
            free, forced, stiffness, modes[:, j] = _slides(own, omega, able)
            sliding.append(j)
            turns.append(free)
            levels[:, j] = own[:, 1, resting]
            drive = drive + (q[:, :, 0] + 1j * omega[:, None] * q[:, :, 1]) * forced[:, None]
            weight = q[:, :, 0] + q[:, :, 1] * free[:, None]
            ways[:, part, 4:7] = np.stack([weight.real, weight.imag, np.abs(weight)], axis=-1)
            rests[:, part] += q[:, :, :1] * (own[:, 1, resting] / stiffness[:, None])[:, None]
        ways[:, part, 2:4] = np.stack([drive.real, drive.imag], axis=-1)
        ways[:, part, 7] = np.abs(drive)
    ways[:, :, 8] = _deeds(reset[:, :, 1:physical])
    span, offsets, nodes = _all_nodes(np.stack(turns, axis=1), able)
    modes[:, sliding, 9:11] = offsets[:, 1:]
    drives = np.column_stack([omega, phase, omega / (2 * HALF_STEP), offsets[:, 0, 1]])
    return Phasors(drives, modes, levels, ways, rests, nodes, span)


def _slides(flow: Array, omega: Array, able: Mask) -> tuple[Complex, Any, Array, Array]:
    """Rate l of the free motion in a mode, forced amplitude, stiffness over mass, and what :func:`slide_of` reads.

    Systems whose free motion hardly turns, or that the drive hardly differs from, are no longer `able`.
    """
    stiffness, damping = -flow[:, 1, 0], -flow[:, 1, 1]
    turn = stiffness - damping**2 / 4
    response = stiffness - omega**2 + 1j * omega * damping
    able &= (turn > 1e-3 * np.abs(stiffness)) & (flow[:, 0, 1] == 1.0)
    able &= np.abs(response) >= 1e-2 * np.maximum(stiffness, omega**2)
    stiffness, response = np.where(able, stiffness, 1.0), np.where(able, response, 1.0)
    free = -damping / 2 + 1j * np.sqrt(np.where(able, turn, 1.0))
    forced = (flow[:, 1, -2] - 1j * flow[:, 1, -1]) / response
    fast, columns = np.abs(free), np.zeros((len(flow), 12))
    columns[:, 0] = SLIDING
    columns[:, 1:5] = np.transpose([free.real, free.imag, forced.real, forced.imag])
    columns[:, 5:9] = np.transpose([1 / stiffness, fast, 1 / free.imag, fast / (2 * HALF_STEP)])
    columns[:, 11] = np.abs(forced.real) + np.abs(forced.imag)
    return free, forced, stiffness, columns


def without(count: int) -> Phasors:
    """The tables of systems without a fast path."""
    tables = (np.zeros((count, *shape)) for shape in ((4,), (1, 12), (1, 1), (1, 9), (1, 1)))
    return Phasors._make([*tables, np.zeros((0, 3)), np.zeros((count, 2), np.int64)])


def _all_nodes(turns: Complex, able: Mask) -> tuple[Index, Array, Array]:
    """Nodes of all that turns, the drive first: where each system's lie in the table, and in them first node and number
    of each of its turning parts. Systems that turn alike share theirs."""
    where, which = np.empty((2, len(turns)), np.int64)
    keys = turns[where[: meanwhile.now(distinct, turns.size)(turns.view(np.float64), where, which)]]
    spans, offsets = np.zeros((len(keys), 2), np.int64), np.zeros((*keys.shape, 2))
    parts, length = [np.zeros((0, 3))], 0
    wanted = np.zeros(len(keys), dtype=bool)
    wanted[which[able]] = True
    for j in np.flatnonzero(wanted):
        period = 2 * math.pi / keys[j, 0].imag
        grids = [_nodes(complex(rate), period) for rate in keys[j]]
        if any(grid is None for grid in grids):
            continue
        ends = np.cumsum([len(grid) for grid in grids if grid is not None])
        offsets[j, :, 0], offsets[j, :, 1] = np.append(0, ends[:-1]), np.diff(ends, prepend=0)
        spans[j] = length, length + ends[-1]
        length += ends[-1]
        parts += [grid for grid in grids if grid is not None]
    spans = spans[which]
    spans[~able] = 0
    return spans, offsets[which], np.ascontiguousarray(np.concatenate(parts))


@lru_cache(maxsize=256)
def _nodes(rate: complex, period: float) -> Array | None:
    """e^{rate t} at distances that the polynomial bridges, over one period, and their times (K, 3)."""
    count = int(period * abs(rate) / (2 * HALF_STEP)) + 3
    if count > LONGEST:
        return None
    times = np.arange(count, dtype=np.float64) * (2 * HALF_STEP / abs(rate))
    steps = np.asarray(times, dtype=np.longdouble)
    turned = np.exp(np.longdouble(rate.real) * steps)
    angle = np.longdouble(rate.imag) * steps
    return np.asarray(np.column_stack([turned * np.cos(angle), turned * np.sin(angle), times]), np.float64)


def _deeds(inner: Array) -> Array:
    """Whether an exit keeps velocity and memory, only stops the mass, or carries them over in another way."""
    unit = np.eye(inner.shape[-1])[1 : 1 + inner.shape[-2]]
    stopped = unit.copy()
    stopped[0] = 0.0
    kept, stops = (np.all(inner == like, axis=(-2, -1)) for like in (unit, stopped))
    return np.where(kept, KEEPS, np.where(stops, STOPS, CARRIES))
