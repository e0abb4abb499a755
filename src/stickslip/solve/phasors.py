"""The fast path through the same tables: two phasors for each piece, one that the drive turns and one that runs free.

Where the memory rests, one tone drives and the free motion turns (no mode aperiodic, none at resonance), an exit is

    g(t) = G + Re(D e^{i w t}) + Re(W e^{l t}),

displacement, velocity and every derivative come from the same two phasors, and the duration found one lap of the drive
earlier is an excellent guess for the next one: one Halley step polishes it, quartic bounds in Bernstein form from both
ends certify that no exit lies before it. Where any of this fails, the general march takes over for one piece.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stickslip.compiled import FAST, compiled
from stickslip.solve.roots import NOISE
from stickslip.solve.tables import Array, Tables, distinct

KEEPS, STOPS, CARRIES = 0.0, 1.0, 2.0  # what an exit does to velocity and memory
HALF_STEP = 0.09  # rad between a node and the edge of its polynomial; degree 9 leaves 1e-17
LONGEST = 8192  # nodes of one table
HISTORY = 4096  # pieces remembered; the guess is one lap old
SLIDING, HELD = 1.0, 0.0
SPLITS = 64
LOOK = 0.4  # rad between two looks for an exit of which the lap before tells nothing


@dataclass(frozen=True, eq=False)
class Phasors:
    """The tables of the fast path; B systems, M modes, E exits, C entries that rest (memory and the constant).

    Attributes
    ----------
    drive : ndarray (B, 4)
        Angular frequency [rad/s], phase [rad], nodes per second and number of nodes of the drive's table.
    mode : ndarray (B, M, 12)
        Kind, real and imaginary part of l, real and imaginary part of the forced amplitude, 1 / (k/m), |l|, nodes
        per second, first node, number of nodes, 1 / (imaginary part of l), modulus sum of the forced amplitude.
    level : ndarray (B, M, C)
        Constant forcing of each mode as a linear form of what rests.
    exit : ndarray (B, E, 9)
        Coefficient of x and v, D (complex), W per unit of free amplitude (complex), its modulus, modulus of D, what it
        does to velocity and memory.
    rest : ndarray (B, E, C)
        G of each exit as a linear form of what rests.
    nodes : ndarray (K, 3)
        e^{i w t} and, mode by mode, e^{l t} at their nodes, and the node's time.
    span : ndarray (B, 2)
        First node of each system and the one after its last; it has none where it is not of the kind.
    """

    drive: Array
    mode: Array
    level: Array
    exit: Array
    rest: Array
    nodes: Array
    span: NDArray[np.int64]

    @property
    def tables(self) -> tuple[NDArray[Any], ...]:
        """All arrays, in their order."""
        return self.drive, self.mode, self.level, self.exit, self.rest, self.nodes, self.span

    def of(self, number: int) -> tuple[Array, ...]:
        """The arrays of one system, as the kernel reads them."""
        begin, end = self.span[number]
        own = (part[number] for part in (self.drive, self.mode, self.level, self.exit, self.rest))
        return (*own, self.nodes[begin:end])


def _phasors(
    flow: Array, rows: Array, reset: Array, tones: Array, *, first: NDArray[np.int64], physical: int
) -> Phasors:
    """The tables of the fast path of B systems.

    Parameters
    ----------
    flow : ndarray (B, M, N, N)
        Flows of the modes.
    rows : ndarray (B, E, N)
        Quantities of the exits.
    reset : ndarray (B, E, N, N)
        What each exit does to the state.
    tones : ndarray (B, J, 4)
        What turns.
    first : ndarray (M + 1,)
        Exits of mode j are ``first[j]`` to ``first[j + 1]``.
    physical : int
        Entries of the state that belong to the oscillator and its law.
    """
    count, number, size = flow.shape[:3]
    exits, resting = rows.shape[1], slice(2, physical + 1)
    if tones.shape[1] != 1 or size != physical + 3 or exits == 0:
        return _without(count)
    omega, phase = tones[:, 0, 2], tones[:, 0, 3]
    able = np.ones(count, dtype=bool)
    modes, levels = np.zeros((count, number, 12)), np.zeros((count, number, physical - 1))
    leaving, rests = np.zeros((count, exits, 9)), np.zeros((count, exits, physical - 1))
    turns, sliding = [1j * omega], []
    for j in range(number):
        own, part = flow[:, j], slice(first[j], first[j + 1])
        able &= ~np.any(own[:, resting], axis=(1, 2))
        q = rows[:, part]
        drive = q[:, :, -2] - 1j * q[:, :, -1]
        leaving[:, part, :2], rests[:, part] = q[:, :, :2], q[:, :, resting]
        if np.any(own[:, :2]):
            stiffness, damping = -own[:, 1, 0], -own[:, 1, 1]
            turn = stiffness - damping**2 / 4
            response = stiffness - omega**2 + 1j * omega * damping
            able &= (turn > 1e-3 * np.abs(stiffness)) & (own[:, 0, 1] == 1.0)
            able &= np.abs(response) >= 1e-2 * np.maximum(stiffness, omega**2)
            stiffness, response = np.where(able, stiffness, 1.0), np.where(able, response, 1.0)
            free = -damping / 2 + 1j * np.sqrt(np.where(able, turn, 1.0))
            forced = (own[:, 1, size - 2] - 1j * own[:, 1, size - 1]) / response
            fast = np.abs(free)
            sliding.append(j)
            turns.append(free)
            modes[:, j] = np.column_stack([
                np.full(count, SLIDING), free.real, free.imag, forced.real, forced.imag, 1 / stiffness, fast,
                fast / (2 * HALF_STEP), np.zeros((count, 2)), 1 / free.imag, np.abs(forced.real) + np.abs(forced.imag),
            ])  # fmt: skip
            levels[:, j] = own[:, 1, resting]
            drive = drive + (q[:, :, 0] + 1j * omega[:, None] * q[:, :, 1]) * forced[:, None]
            weight = q[:, :, 0] + q[:, :, 1] * free[:, None]
            leaving[:, part, 4:7] = np.stack([weight.real, weight.imag, np.abs(weight)], axis=-1)
            rests[:, part] += q[:, :, :1] * (own[:, 1, resting] / stiffness[:, None])[:, None]
        leaving[:, part, 2:4] = np.stack([drive.real, drive.imag], axis=-1)
        leaving[:, part, 7] = np.abs(drive)
    leaving[:, :, 8] = _deeds(reset[:, :, 1:physical])
    span, offsets, nodes = _all_nodes(np.stack(turns, axis=1), able)
    modes[:, sliding, 8:10] = offsets[:, 1:]
    drives = np.column_stack([omega, phase, omega / (2 * HALF_STEP), offsets[:, 0, 1]])
    return Phasors(drives, modes, levels, leaving, rests, nodes, span)


@lru_cache(maxsize=32)
def fast_tables(table: Tables) -> tuple[Array, ...]:
    """The arrays of the fast path of one system; with no nodes at all where it has none."""
    one = (part[None] for part in (table.flow, table.series[:, 0], table.reset, table.tones))
    return _phasors(*one, first=table.first, physical=table.physical).of(0)


def phasors_of(tables: Tables) -> Phasors:
    """The tables of the fast path of many systems."""
    own = (tables.flow, tables.series[:, :, 0], tables.reset, tables.tones)
    return _phasors(*own, first=tables.first, physical=tables.physical)


def _without(count: int) -> Phasors:
    """The tables of systems without a fast path."""
    return Phasors(
        np.zeros((count, 4)), np.zeros((count, 1, 12)), np.zeros((count, 1, 1)), np.zeros((count, 1, 9)),
        np.zeros((count, 1, 1)), np.zeros((0, 3)), np.zeros((count, 2), np.int64),
    )  # fmt: skip


def _all_nodes(turns: NDArray[np.complex128], able: NDArray[np.bool_]) -> tuple[NDArray[np.int64], Array, Array]:
    """Nodes of all that turns, the drive first: where each system's lie in the table, and in them first node and number
    of each of its turning parts. Systems that turn alike share theirs."""
    where, which = np.empty((2, len(turns)), np.int64)
    keys = turns[where[: distinct(turns.view(np.float64), where, which)]]
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


def blank_past() -> tuple[NDArray[Any], ...]:
    """The ring of pieces before the first one."""
    return (np.full(HISTORY, -1, np.int64), np.full(HISTORY, -1, np.int64), np.zeros(HISTORY),
            np.ones(HISTORY, np.int64), np.zeros(3, np.int64))  # fmt: skip


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
    kept, held = (np.all(inner == like, axis=(-2, -1)) for like in (unit, stopped))
    return np.where(kept, KEEPS, np.where(held, STOPS, CARRIES))


@compiled(**FAST, forceinline=True)
def _turn(nodes, first, count, density, decay, turn, t):
    """e^{(decay + i turn) t} from the nearest node."""
    j = min(count - 1, int(t * density + 0.5))
    r = t - nodes[first + j, 2]
    z = turn * r
    q = z * z
    c = 1.0 + q * (-0.5 + q * (1 / 24 + q * (-1 / 720 + q * (1 / 40320))))
    s = z * (1.0 + q * (-1 / 6 + q * (1 / 120 + q * (-1 / 5040 + q * (1 / 362880)))))
    if decay != 0.0:
        y = decay * r
        e = 1 / 120
        if abs(y) > 5e-4:
            e += y * (1 / 720 + y * (1 / 5040 + y * (1 / 40320 + y * (1 / 362880))))
        e = 1.0 + y * (1.0 + y * (0.5 + y * (1 / 6 + y * (1 / 24 + y * e))))
        c *= e
        s *= e
    a, b = nodes[first + j, 0], nodes[first + j, 1]
    return a * c - b * s, a * s + b * c


@compiled(**FAST, forceinline=True)
def _below(g, d, h, j, fourth, length):
    """Whether g + d t + h t^2/2 + j t^3/6 + fourth t^4/24 stays below zero on (0, length]: Bernstein coefficients."""
    a, b, c = d * length, h * length * length, j * length * length * length
    e = fourth * length * length * length * length
    return (
        (g <= 0.0)
        & (g + 0.25 * a <= 0.0)
        & (g + 0.5 * a + b * (1 / 12) <= 0.0)
        & (g + 0.75 * a + 0.25 * b + c * (1 / 24) <= 0.0)
        & (g + a + 0.5 * b + c * (1 / 6) + e * (1 / 24) < 0.0)
    )


@compiled(**FAST, forceinline=True)
def _certified(grid, piece, exits, leaving, w, lr, li, t, spread, end, parts, nodes):
    """Whether every exit stays below zero on (0, t): quartic bounds from both ends of `parts` intervals.

    `grid` holds number and density of the drive's nodes, then first, number and density of the mode's (0: held);
    `spread` is what a growing motion multiplies the bound of the fourth derivative by.
    """
    half = 0.5 * t / parts
    cr, ci, yr, yi = end
    for j in range(parts, -1, -1):
        if j == parts:
            nr, ni, mr, mi = cr, ci, yr, yi
        elif j > 0:
            at = t * j / parts
            nr, ni = _turn(nodes, 0, grid[0], grid[1], 0.0, w, at)
            mr, mi = 0.0, 0.0
            if grid[3] > 0:
                mr, mi = _turn(nodes, grid[2], grid[3], grid[4], lr, li, at)
        else:
            nr, ni, mr, mi = 0.0, 0.0, 0.0, 0.0
        for q in range(exits):
            fourth = piece[q, 9] * spread
            if j == 0:
                if not _below(piece[q, 5], piece[q, 6], piece[q, 7], piece[q, 8], fourth, half):
                    return False
                continue
            dr, di = piece[q, 1] * nr - piece[q, 2] * ni, piece[q, 1] * ni + piece[q, 2] * nr
            wr, wi = piece[q, 3] * mr - piece[q, 4] * mi, piece[q, 3] * mi + piece[q, 4] * mr
            ar, ai = lr * wr - li * wi, lr * wi + li * wr
            br, bi = lr * ar - li * ai, lr * ai + li * ar
            g, d = piece[q, 0] + dr + wr, ar - w * di
            h, jerk = br - w * w * dr, w * w * w * di + lr * br - li * bi
            if j == parts:
                if q == leaving:
                    g = 0.0
            elif not _below(g, d, h, jerk, fourth, half):
                return False
            if not _below(g, -d, h, -jerk, fourth, half):
                return False
    return True


@compiled(**FAST, forceinline=True)
def _sought(grid, piece, exits, w, lr, li, lam, longest, nodes):
    """Near which time some exit first rises through zero, and which: looks at some distance, only to start from.

    (-1, 0) where none is seen. What lies between two looks is not seen, and left to the certificate.
    """
    step = LOOK / max(w, lam)
    count = int(longest / step) + 1
    for j in range(1, count + 1):
        t, best, which = min(j * step, longest), 2.0 * longest, 0
        nr, ni = _turn(nodes, 0, grid[0], grid[1], 0.0, w, t)
        mr, mi = 0.0, 0.0
        if grid[3] > 0:
            mr, mi = _turn(nodes, grid[2], grid[3], grid[4], lr, li, t)
        for q in range(exits):
            g = piece[q, 0] + piece[q, 1] * nr - piece[q, 2] * ni + piece[q, 3] * mr - piece[q, 4] * mi
            before = piece[q, 5] if j == 1 else piece[q, 10]
            piece[q, 10] = g
            if g > 0.0:
                # the chord's zero; of a rise from zero itself there is none
                near = t - step * g / (g - before) if before < 0.0 else t
                if near < best:
                    best, which = near, q
        if best < 2.0 * longest:
            return best, which
    return -1.0, 0


@compiled(**FAST, forceinline=True)
def _polished(grid, piece, k, w, lr, li, lam, t, nodes):
    """Halley's steps onto the zero of an exit: whether they end there, the time, and both phasors at it."""
    cr, ci, yr, yi = 1.0, 0.0, 0.0, 0.0
    for _ in range(6):
        cr, ci = _turn(nodes, 0, grid[0], grid[1], 0.0, w, t)
        if grid[3] > 0:
            yr, yi = _turn(nodes, grid[2], grid[3], grid[4], lr, li, t)
        dr, di = piece[k, 1] * cr - piece[k, 2] * ci, piece[k, 1] * ci + piece[k, 2] * cr
        wr, wi = piece[k, 3] * yr - piece[k, 4] * yi, piece[k, 3] * yi + piece[k, 4] * yr
        ar, ai = lr * wr - li * wi, lr * wi + li * wr
        g, d, h = piece[k, 0] + dr + wr, ar - w * di, lr * ar - li * ai - w * w * dr
        step = -2.0 * g * d / (2.0 * d * d - g * h)
        if not (d > 0.0 and abs(step) < 0.2 * t):
            break
        t += step
        if abs(step) * max(w, lam) < 2e-6:
            # the phasors follow the last correction by their Taylor polynomials
            z = w * step
            cr, ci = cr - z * ci - 0.5 * z * z * cr, ci + z * cr - 0.5 * z * z * ci
            p, q = lr * step, li * step
            p, q = p + 0.5 * (p * p - q * q), q + p * q
            return True, t, cr, ci, yr + p * yr - q * yi, yi + p * yi + q * yr
    return False, t, cr, ci, yr, yi


@compiled(**FAST)
def glide(fast, tables, clock, state, mode, limit, period, past, out, begun, work):
    """March by phasors as far as every piece is certified.

    Parameters
    ----------
    fast : tuple of arrays
        See :class:`Phasors`.
    tables : tuple of arrays
        See :class:`stickslip.solve.tables.Linear`.
    clock, state, mode, limit, period, out
        As in :func:`stickslip.solve.kernel.march`.
    past : tuple of arrays
        Modes, exits, durations and certificate parts of the pieces gone by, in a ring, and (newest, guess, start of
        the lap) within it.
    begun : int
        Pieces already in `out`.
    work : ndarray (9, 16 or more)
        Scratch.

    Returns
    -------
    tuple of (int, int, bool)
        Number of pieces in `out`, the mode, and whether time passes in it: else the general march settles it. The next
        piece is the general march's.
    """
    drive, modes, level, exits, rest, nodes = fast
    target, crossing, reset, first = tables[4], tables[5], tables[6], tables[7]
    laps_out, times_out, modes_out, durations_out, states_out, exits_out = out
    past_mode, past_exit, past_time, past_parts, ring = past
    size = state.shape[0]
    resting = level.shape[1]
    w, phase, density, turns = drive[0], drive[1], drive[2], int(drive[3])
    # a row per exit: G, D, D, W, W, g and three derivatives at the start, a bound of the fourth
    piece, fresh = work[:8], work[8]
    count, capacity = begun, laps_out.shape[0]
    x, v = state[0], state[1]
    ec, es = state[size - 2], state[size - 1]
    since, chain = 0, 0
    settled = False
    while chain < 8:
        sliding = modes[mode, 0] == SLIDING
        lr, li, lam = modes[mode, 1], modes[mode, 2], modes[mode, 6]
        hr, hi = modes[mode, 3], modes[mode, 4]
        low = first[mode]
        number = first[mode + 1] - low
        zr, zi, centre, free, free_noise = 0.0, 0.0, 0.0, 0.0, 0.0
        if number > 8:
            break
        if sliding:
            force = 0.0
            for i in range(resting):
                force += level[mode, i] * state[2 + i]
            centre = force * modes[mode, 5]
            fr, fi = hr * ec - hi * es, hr * es + hi * ec
            zr = x - centre - fr
            zi = -(v + w * fi - lr * zr) * modes[mode, 10]
            free = math.sqrt(zr * zr + zi * zi)
            reach = abs(x) + abs(centre) + modes[mode, 11]
            free_noise = NOISE * (reach + (abs(v) + w * modes[mode, 11] + abs(lr) * reach) * modes[mode, 10])
        # an exit due at once is taken; one too close to call goes to the general march
        fired, doubtful = -1, False
        for q in range(number):
            e = low + q
            g, scale = 0.0, 0.0
            for i in range(resting):
                term = rest[e, i] * state[2 + i]
                g += term
                scale += abs(term)
            if not sliding:
                g += exits[e, 0] * x + exits[e, 1] * v
                scale += abs(exits[e, 0] * x)
            dr, di = exits[e, 2] * ec - exits[e, 3] * es, exits[e, 2] * es + exits[e, 3] * ec
            wr, wi = exits[e, 4] * zr - exits[e, 5] * zi, exits[e, 4] * zi + exits[e, 5] * zr
            # derivatives at the start: (i w)^k D and l^k W
            ar, ai = lr * wr - li * wi, lr * wi + li * wr
            br, bi = lr * ar - li * ai, lr * ai + li * ar
            g0, g1, g2 = g + dr + wr, ar - w * di, br - w * w * dr
            doubt = exits[e, 6] * free_noise
            sure = g0
            if abs(g0) <= NOISE * (scale + exits[e, 7]) + doubt:
                g0, sure = 0.0, g1
                if abs(g1) <= NOISE * exits[e, 7] * w + doubt * lam:
                    g1, sure = 0.0, g2
                    if abs(g2) <= NOISE * exits[e, 7] * w * w + doubt * lam * lam:
                        doubtful = True
                        break
            if sure > 0.0:
                doubtful = crossing[e]
                fired = e
                break
            piece[q, 0], piece[q, 1], piece[q, 2], piece[q, 3], piece[q, 4] = g, dr, di, wr, wi
            piece[q, 5], piece[q, 6], piece[q, 7] = g0, g1, g2
            piece[q, 8] = w * w * w * di + lr * br - li * bi
            piece[q, 9] = exits[e, 7] * w * w * w * w + exits[e, 6] * free * lam * lam * lam * lam
        if doubtful:
            break
        if fired >= 0:
            if exits[fired, 8] == STOPS:
                v = 0.0
            elif exits[fired, 8] == CARRIES:
                state[0], state[1], state[size - 2], state[size - 1] = x, v, ec, es
                _carry(reset[fired], state, fresh, size)
                v = state[1]
            mode = target[fired]
            chain += 1
            continue
        settled = count == capacity
        if settled:
            break
        # the same piece one lap ago is the guess; where it is none, looks along the way find one
        slot = ring[1]
        left = (limit[0] - clock[0]) * period if limit[0] != clock[0] else 0.0
        left += limit[1] - clock[1]
        longest = 0.999 * min(left, period)
        grid = (turns, density, int(modes[mode, 8]), int(modes[mode, 9]), modes[mode, 7])
        t, leaving, parts = past_time[slot], past_exit[slot], past_parts[slot]
        guessed = past_mode[slot] == mode and leaving >= 0
        done = False
        for attempt in range(2):
            if attempt == 1:
                t, k = _sought(grid, piece, number, w, lr, li, lam, longest, nodes)
                leaving, parts = low + k, 1
            elif not guessed:
                continue
            if not 0.0 < t < longest:
                continue
            k = leaving - low
            done, t, cr, ci, yr, yi = _polished(grid, piece, k, w, lr, li, lam, t, nodes)
            if done and t < 0.9999 * left and t < period:
                spread = math.exp(1.000001 * lr * t) if lr > 0.0 else 1.0
                end = (cr, ci, yr, yi)
                while parts <= SPLITS and not _certified(
                    grid, piece, number, k, w, lr, li, t, spread, end, parts, nodes
                ):
                    parts *= 2
                done = parts <= SPLITS
            else:
                done = False
            if done:
                break
        if not done and 0.0 < left < 0.999 * period:
            # nothing ends it before the limit, perhaps
            t, leaving, parts = left, -1, 1
            cr, ci = _turn(nodes, 0, grid[0], grid[1], 0.0, w, t)
            yr, yi = _turn(nodes, grid[2], grid[3], grid[4], lr, li, t) if sliding else (0.0, 0.0)
            spread = math.exp(1.000001 * lr * t) if lr > 0.0 else 1.0
            end = (cr, ci, yr, yi)
            while parts <= SPLITS and not _certified(grid, piece, number, -1, w, lr, li, t, spread, end, parts, nodes):
                parts *= 2
            done = parts <= SPLITS
        if not done:
            break
        # the piece stands: write it, carry the state over
        laps_out[count], times_out[count], modes_out[count] = clock[0], clock[1], mode
        durations_out[count], exits_out[count] = t, leaving
        states_out[count, 0], states_out[count, 1] = x, v
        for i in range(2, states_out.shape[1]):
            states_out[count, i] = state[i]
        count += 1
        slot = ring[0]
        past_mode[slot], past_exit[slot], past_time[slot], past_parts[slot] = mode, leaving, t, parts
        ring[0] = (slot + 1) & (past_mode.shape[0] - 1)
        ring[1] = (ring[1] + 1) & (past_mode.shape[0] - 1)
        ec, es = ec * cr - es * ci, ec * ci + es * cr
        gap = t - clock[2]
        now = clock[1] + gap
        clock[2] = (now - clock[1]) - gap
        wraps = now >= period
        if leaving < 0:
            wraps, now, clock[2] = clock[0] < limit[0], limit[1], 0.0
        elif wraps:
            now -= period
        if wraps:
            clock[0] += 1.0
            ring[1] = ring[2]
            ring[2] = ring[0]
        clock[1] = now
        since += 1
        if since >= 64:
            ec, es = math.cos(w * now + phase), math.sin(w * now + phase)
            since = 0
        if sliding:
            fr, fi = hr * ec - hi * es, hr * es + hi * ec
            ar, ai = zr * yr - zi * yi, zr * yi + zi * yr
            x = centre + fr + ar
            v = -w * fi + lr * ar - li * ai
        if leaving < 0:
            settled = True
            break
        if exits[leaving, 8] == STOPS:
            v = 0.0
        elif exits[leaving, 8] == CARRIES:
            state[0], state[1], state[size - 2], state[size - 1] = x, v, ec, es
            _carry(reset[leaving], state, fresh, size)
            v = state[1]
        mode = target[leaving]
        chain = 0
    state[0], state[1], state[size - 2], state[size - 1] = x, v, ec, es
    return count, mode, settled


@compiled(**FAST)
def _carry(matrix, state, fresh, size):
    """Take the velocity and the memory over an exit; displacement and drive go on."""
    for i in range(1, size - 3):
        total = 0.0
        for q in range(size):
            total += matrix[i, q] * state[q]
        fresh[i] = total
    for i in range(1, size - 3):
        state[i] = fresh[i]
