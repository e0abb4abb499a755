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

import numpy as np
from numba import njit
from numpy.typing import NDArray

from stickslip.solve.automaton import Array, Automaton
from stickslip.solve.roots import NOISE, OPTIONS

FAST = {**OPTIONS, "fastmath": {"contract"}}
HALF_STEP = 0.09  # rad between a node and the edge of its polynomial; degree 9 leaves 1e-17
LONGEST = 8192  # nodes of one table
HISTORY = 4096  # pieces remembered; the guess is one lap old
SLIDING, HELD = 1.0, 0.0
SPLITS = 64


@dataclass(frozen=True, eq=False)
class Phasors:
    """The tables of the fast path; M modes, E exits, C entries that rest (memory and the constant).

    Attributes
    ----------
    drive : ndarray (4,)
        Angular frequency [rad/s], phase [rad], node distance [s] and number of nodes of the drive's table.
    mode : ndarray (M, 10)
        Kind, real and imaginary part of l, real and imaginary part of the forced amplitude, 1 / (k/m), |l|, node
        distance, first node, number of nodes.
    level : ndarray (M, C)
        Constant forcing of each mode as a linear form of what rests.
    exit : ndarray (E, 7)
        Coefficient of x and v, D (complex), W per unit of free amplitude (complex), velocity coefficient's modulus.
    rest : ndarray (E, C)
        G of each exit as a linear form of what rests.
    nodes : ndarray (K, 2)
        e^{i w t} and, mode by mode, e^{l t} at their nodes.
    """

    drive: Array
    mode: Array
    level: Array
    exit: Array
    rest: Array
    nodes: Array

    @property
    def tables(self) -> tuple[Array, ...]:
        """The arrays the kernel reads, in their order."""
        return self.drive, self.mode, self.level, self.exit, self.rest, self.nodes


def phasors(table: Automaton) -> Phasors | None:
    """The tables of the fast path, or None where the system is not of its kind."""
    size, resting = len(table.names), slice(2, table.physical + 1)
    if len(table.tones) != 1 or size != table.physical + 3 or len(table.target) == 0:
        return None
    omega, phase = table.tones[0, 2:]
    period = 2 * math.pi / omega
    turning = slice(size - 2, size)
    nodes = [_nodes(1j * omega, period)]
    if nodes[0] is None:
        return None
    modes, levels, exits, rests = [], [], [], []
    for j, flow in enumerate(table.flow):
        if np.any(flow[resting]):
            return None
        rows = table.series[table.first[j] : table.first[j + 1], 0]
        if not np.any(flow[:2]):
            modes.append([HELD, *[0.0] * 9])
            levels.append(np.zeros(resting.stop - 2))
            exits += [[q[0], q[1], q[-2], -q[-1], 0.0, 0.0, 0.0] for q in rows]
            rests += [q[resting] for q in rows]
            continue
        stiffness, damping = -flow[1, 0], -flow[1, 1]
        turn = stiffness - damping**2 / 4
        response = stiffness - omega**2 + 1j * omega * damping
        if turn <= 1e-3 * abs(stiffness) or abs(response) < 1e-2 * max(stiffness, omega**2) or flow[0, 1] != 1.0:
            return None
        free = complex(-damping / 2, math.sqrt(turn))
        forced = complex(flow[1, turning][0], -flow[1, turning][1]) / response
        grid = _nodes(free, period)
        if grid is None:
            return None
        offset = sum(len(values) for values in nodes)
        nodes.append(grid)
        modes.append([SLIDING, free.real, free.imag, forced.real, forced.imag, 1 / stiffness, abs(free),
                      2 * HALF_STEP / abs(free), offset, len(grid)])  # fmt: skip
        levels.append(flow[1, resting])
        for q in rows:
            drive = complex(q[-2], -q[-1]) + (q[0] + 1j * omega * q[1]) * forced
            weight = q[0] + q[1] * free
            exits.append([q[0], q[1], drive.real, drive.imag, weight.real, weight.imag, abs(weight)])
            rests.append(q[resting] + q[0] * flow[1, resting] / stiffness)
    values = np.concatenate(nodes)
    return Phasors(
        np.array([omega, phase, 2 * HALF_STEP / omega, len(nodes[0])]),
        np.array(modes),
        np.array(levels),
        np.array(exits),
        np.array(rests),
        np.ascontiguousarray(np.column_stack([values.real, values.imag])),
    )


def fast_tables(table: Automaton) -> tuple[Array, ...]:
    """The arrays of the fast path; with no nodes at all where the system has none."""
    found = phasors(table)
    if found is not None:
        return found.tables
    return np.zeros(4), np.zeros((1, 10)), np.zeros((1, 1)), np.zeros((1, 7)), np.zeros((1, 1)), np.zeros((0, 2))


def blank_past() -> tuple[NDArray[np.int64], NDArray[np.int64], Array, NDArray[np.int64]]:
    """The ring of pieces before the first one."""
    return (np.full(HISTORY, -1, np.int64), np.full(HISTORY, -1, np.int64), np.zeros(HISTORY),
            np.zeros(3, np.int64))  # fmt: skip


def _nodes(rate: complex, period: float) -> NDArray[np.complex128] | None:
    """e^{rate t} at distances that the polynomial bridges, over one period."""
    count = int(period * abs(rate) / (2 * HALF_STEP)) + 3
    if count > LONGEST:
        return None
    steps = np.arange(count, dtype=np.longdouble) * (2 * HALF_STEP / abs(rate))
    turned = np.exp(np.longdouble(rate.real) * steps)
    angle = np.longdouble(rate.imag) * steps
    return np.asarray(turned * np.cos(angle), np.float64) + 1j * np.asarray(turned * np.sin(angle), np.float64)


@njit(**FAST)
def _turn(nodes, first, count, distance, decay, turn, t):
    """e^{(decay + i turn) t} from the nearest node."""
    j = int(t / distance + 0.5)
    if j >= count:
        j = count - 1
    r = t - j * distance
    z = turn * r
    q = z * z
    c = 1.0 + q * (-0.5 + q * (1 / 24 + q * (-1 / 720 + q * (1 / 40320))))
    s = z * (1.0 + q * (-1 / 6 + q * (1 / 120 + q * (-1 / 5040 + q * (1 / 362880)))))
    if decay != 0.0:
        y = decay * r
        e = 1.0 + y * (1.0 + y * (0.5 + y * (1 / 6 + y * (1 / 24 + y * (1 / 120 + y * (1 / 720 + y * (1 / 5040 + y * (
            1 / 40320 + y * (1 / 362880)))))))))  # fmt: skip
        c *= e
        s *= e
    a, b = nodes[first + j, 0], nodes[first + j, 1]
    return a * c - b * s, a * s + b * c


@njit(**FAST)
def _below(g, d, h, j, fourth, length):
    """Whether g + d t + h t^2/2 + j t^3/6 + fourth t^4/24 stays below zero on (0, length]: Bernstein coefficients."""
    a, b, c = d * length, h * length * length, j * length * length * length
    e = fourth * length * length * length * length
    last = g + a + 0.5 * b + c / 6 + e / 24
    return (
        g <= 0.0
        and g + a / 4 <= 0.0
        and g + a / 2 + b / 12 <= 0.0
        and g + 0.75 * a + b / 4 + c / 24 <= 0.0
        and last < 0.0
    )


@njit(**FAST)
def glide(fast, tables, clock, state, mode, limit, period, past, out, begun, work):
    """March by phasors as far as every piece is certified.

    Parameters
    ----------
    fast : tuple of arrays
        See :class:`Phasors`.
    tables : tuple of arrays
        See :class:`stickslip.solve.automaton.Automaton`.
    clock, state, mode, limit, period, out
        As in :func:`stickslip.solve.kernel.march`.
    past : tuple of arrays
        Modes, exits and durations of the pieces gone by, in a ring, and (newest, guess, start of lap) within it.
    begun : int
        Pieces already in `out`.
    work : ndarray (9, 16 or more)
        Scratch.

    Returns
    -------
    tuple of int
        Number of pieces in `out`, and the mode; the general march takes the next piece.
    """
    drive, modes, level, exits, rest, nodes = fast
    target, reset, first = tables[4], tables[6], tables[7]
    laps_out, times_out, modes_out, durations_out, states_out, exits_out = out
    past_mode, past_exit, past_time, ring = past
    size = state.shape[0]
    resting = level.shape[1]
    w, phase, spacing, turns = drive[0], drive[1], drive[2], int(drive[3])
    # rows of `piece`: G, D, D, W, W, then g and two derivatives at the start; eight columns on: the third, a bound of
    # the fourth
    piece, fresh = work[:8], work[8]
    count, capacity = begun, laps_out.shape[0]
    x, v = state[0], state[1]
    ec, es = state[size - 2], state[size - 1]
    since = 0
    while count < capacity:
        slot = ring[1]
        if past_mode[slot] != mode or past_exit[slot] < 0:
            break
        guess, leaving = past_time[slot], past_exit[slot]
        left = (limit[0] - clock[0]) * period if limit[0] != clock[0] else 0.0
        left += limit[1] - clock[1]
        if not guess < 0.999 * min(left, period):
            break
        sliding = modes[mode, 0] == SLIDING
        lr, li = modes[mode, 1], modes[mode, 2]
        lam = modes[mode, 6]
        low, high = first[mode], first[mode + 1]
        zr, zi, centre, free_noise = 0.0, 0.0, 0.0, 0.0
        hr, hi = modes[mode, 3], modes[mode, 4]
        if high - low > 8:
            break
        if sliding:
            force = 0.0
            for i in range(resting):
                force += level[mode, i] * state[2 + i]
            centre = force * modes[mode, 5]
            fr, fi = hr * ec - hi * es, hr * es + hi * ec
            p = x - centre - fr
            dp = v + w * fi
            zr = p
            zi = -(dp - lr * p) / li
            reach = abs(x) + abs(centre) + abs(hr) + abs(hi)
            free_noise = NOISE * (reach + (abs(v) + w * (abs(hr) + abs(hi)) - lr * reach) / li)
        grow = math.exp(lr * guess) if lr > 0.0 else 1.0
        sure = True
        for e in range(low, high):
            k = e - low
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
            size_d, size_w = math.sqrt(dr * dr + di * di), math.sqrt(wr * wr + wi * wi) * grow
            # derivatives at the start: (i w)^k D and l^k W
            g0 = g + dr + wr
            ar, ai = lr * wr - li * wi, lr * wi + li * wr
            g1 = -w * di + ar
            br, bi = lr * ar - li * ai, lr * ai + li * ar
            g2 = -w * w * dr + br
            g3 = w * w * w * di + lr * br - li * bi
            doubt = exits[e, 6] * free_noise
            if abs(g0) <= NOISE * (scale + size_d) + doubt:
                g0 = 0.0
                if abs(g1) <= NOISE * size_d * w + doubt * lam:
                    g1 = 0.0
                    if g2 >= 0.0:
                        sure = False
                elif g1 > 0.0:
                    sure = False
            elif g0 > 0.0:
                sure = False
            piece[0, k], piece[1, k], piece[2, k], piece[3, k], piece[4, k] = g, dr, di, wr, wi
            piece[5, k], piece[6, k] = g0, g1
            piece[7, k] = g2
            piece[0, 8 + k] = g3
            piece[1, 8 + k] = size_d * w * w * w * w + size_w * lam * lam * lam * lam
        if not sure:
            break
        # polish the guess
        k = leaving - low
        t = guess
        done = False
        cr, ci, yr, yi = 1.0, 0.0, 1.0, 0.0
        for _ in range(6):
            cr, ci = _turn(nodes, 0, turns, spacing, 0.0, w, t)
            dr, di = piece[1, k] * cr - piece[2, k] * ci, piece[1, k] * ci + piece[2, k] * cr
            wr, wi = 0.0, 0.0
            if sliding:
                yr, yi = _turn(nodes, int(modes[mode, 8]), int(modes[mode, 9]), modes[mode, 7], lr, li, t)
                wr, wi = piece[3, k] * yr - piece[4, k] * yi, piece[3, k] * yi + piece[4, k] * yr
            g = piece[0, k] + dr + wr
            ar, ai = lr * wr - li * wi, lr * wi + li * wr
            d = -w * di + ar
            h = -w * w * dr + lr * ar - li * ai
            step = -2.0 * g * d / (2.0 * d * d - g * h)
            if not (d > 0.0 and abs(step) < 0.2 * t):
                break
            t += step
            if abs(step) * max(w, lam) < 2e-6:
                done = True
                # the state follows the last correction by its Taylor polynomial
                z = w * step
                cr, ci = cr - z * ci - 0.5 * z * z * cr, ci + z * cr - 0.5 * z * z * ci
                if sliding:
                    a, b = lr * step, li * step
                    a, b = a + 0.5 * (a * a - b * b), b + a * b
                    yr, yi = yr + a * yr - b * yi, yi + a * yi + b * yr
                break
        if not done or t >= left or t >= period:
            break
        # certify: no exit before t
        parts = 1
        certified = False
        while parts <= SPLITS and not certified:
            certified = True
            half = 0.5 * t / parts
            for j in range(parts, -1, -1):
                if j == parts:
                    nr, ni, mr, mi = cr, ci, yr, yi
                elif j > 0:
                    at = t * j / parts
                    nr, ni = _turn(nodes, 0, turns, spacing, 0.0, w, at)
                    mr, mi = 0.0, 0.0
                    if sliding:
                        mr, mi = _turn(nodes, int(modes[mode, 8]), int(modes[mode, 9]), modes[mode, 7], lr, li, at)
                for q in range(high - low):
                    fourth = piece[1, 8 + q]
                    if j == 0:
                        if not _below(piece[5, q], piece[6, q], piece[7, q], piece[0, 8 + q], fourth, half):
                            certified = False
                            break
                        continue
                    dr, di = piece[1, q] * nr - piece[2, q] * ni, piece[1, q] * ni + piece[2, q] * nr
                    g, d, h, jerk = piece[0, q] + dr, -w * di, -w * w * dr, w * w * w * di
                    if sliding:
                        wr, wi = piece[3, q] * mr - piece[4, q] * mi, piece[3, q] * mi + piece[4, q] * mr
                        ar, ai = lr * wr - li * wi, lr * wi + li * wr
                        br, bi = lr * ar - li * ai, lr * ai + li * ar
                        g, d, h, jerk = g + wr, d + ar, h + br, jerk + lr * br - li * bi
                    if j == parts and q == leaving - low:
                        g = 0.0
                    if not _below(g, -d, h, -jerk, fourth, half) or (
                        j < parts and not _below(g, d, h, jerk, fourth, half)
                    ):
                        certified = False
                        break
                if not certified:
                    break
            parts *= 2
        if not certified:
            break
        # the piece stands: write it, carry the state over
        laps_out[count], times_out[count], modes_out[count] = clock[0], clock[1], mode
        durations_out[count], exits_out[count] = t, leaving
        states_out[count, 0], states_out[count, 1] = x, v
        for i in range(2, size - 2):
            states_out[count, i] = state[i]
        states_out[count, size - 2], states_out[count, size - 1] = ec, es
        count += 1
        past_mode[ring[0]], past_exit[ring[0]], past_time[ring[0]] = mode, leaving, t
        ring[0] = (ring[0] + 1) % HISTORY
        ring[1] = (ring[1] + 1) % HISTORY
        ec, es = ec * cr - es * ci, ec * ci + es * cr
        gap = t - clock[2]
        now = clock[1] + gap
        clock[2] = (now - clock[1]) - gap
        since += 1
        if now >= period:
            now -= period
            clock[0] += 1.0
            ring[1] = ring[2]
            ring[2] = ring[0]
        clock[1] = now
        if since >= 64:
            ec, es = math.cos(w * now + phase), math.sin(w * now + phase)
            since = 0
        if sliding:
            fr, fi = hr * ec - hi * es, hr * es + hi * ec
            ar, ai = zr * yr - zi * yi, zr * yi + zi * yr
            x = centre + fr + ar
            v = -w * fi + lr * ar - li * ai
        state[0], state[1], state[size - 2], state[size - 1] = x, v, ec, es
        # transitions that are due at once: told by value, or by the first derivatives at a tie
        for _ in range(8):
            for i in range(1, size - 2):
                total = 0.0
                for q in range(size):
                    total += reset[leaving, i, q] * state[q]
                fresh[i] = total
            for i in range(1, size - 2):
                state[i] = fresh[i]
            v = state[1]
            mode = target[leaving]
            leaving = _due(fast, tables, mode, state)
            if leaving < 0:
                break
        if leaving != -1:
            mode = -2 - mode  # the general march settles what is in doubt
            break
    state[0], state[1], state[size - 2], state[size - 1] = x, v, ec, es
    return count, mode


@njit(**FAST)
def _due(fast, tables, mode, state):
    """The exit that is due at once in a mode just entered; -1: none; -2: too close to call by three derivatives."""
    drive, modes, level, exits, rest, _ = fast
    crossing, first = tables[5], tables[7]
    size = state.shape[0]
    w = drive[0]
    x, v, ec, es = state[0], state[1], state[size - 2], state[size - 1]
    sliding = modes[mode, 0] == SLIDING
    lr, li, hr, hi = modes[mode, 1], modes[mode, 2], modes[mode, 3], modes[mode, 4]
    zr, zi, free_noise = 0.0, 0.0, 0.0
    if sliding:
        force = 0.0
        for i in range(level.shape[1]):
            force += level[mode, i] * state[2 + i]
        centre = force * modes[mode, 5]
        fr, fi = hr * ec - hi * es, hr * es + hi * ec
        zr = x - centre - fr
        zi = -(v + w * fi - lr * zr) / li
        reach = abs(x) + abs(centre) + abs(hr) + abs(hi)
        free_noise = NOISE * (reach + (abs(v) + w * (abs(hr) + abs(hi)) - lr * reach) / li)
    for e in range(first[mode], first[mode + 1]):
        if crossing[e]:
            continue
        g, scale = 0.0, 0.0
        for i in range(level.shape[1]):
            term = rest[e, i] * state[2 + i]
            g += term
            scale += abs(term)
        if not sliding:
            g += exits[e, 0] * x + exits[e, 1] * v
            scale += abs(exits[e, 0] * x)
        dr, di = exits[e, 2] * ec - exits[e, 3] * es, exits[e, 2] * es + exits[e, 3] * ec
        wr, wi = exits[e, 4] * zr - exits[e, 5] * zi, exits[e, 4] * zi + exits[e, 5] * zr
        size_d = abs(exits[e, 2]) + abs(exits[e, 3])
        doubt = exits[e, 6] * free_noise
        g += dr + wr
        if abs(g) > NOISE * (scale + size_d) + doubt:
            if g > 0.0:
                return e
            continue
        ar, ai = lr * wr - li * wi, lr * wi + li * wr
        d = -w * di + ar
        if abs(d) > NOISE * size_d * w + doubt * modes[mode, 6]:
            if d > 0.0:
                return e
            continue
        h = -w * w * dr + lr * ar - li * ai
        if abs(h) > NOISE * size_d * w * w + doubt * modes[mode, 6] ** 2:
            if h > 0.0:
                return e
            continue
        return -2
    return -1
