"""The compiled march through the mode tables: plain scalar loops on arrays the caller owns, no allocation.

The same functions run on the CPU and, called from a CUDA kernel, on a GPU.
"""

from __future__ import annotations

import math

from stickslip.compiled import OPTIONS, compiled
from stickslip.solve.phasors import glide
from stickslip.solve.roots import NOISE, NONE, UNSURE, first_rise, opening_order
from stickslip.solve.tables import SPLITTER

DONE, FULL, CHATTER, LOST, UNPROVED = 0, 1, 2, 3, 4
CHAIN = 64  # transitions without time in between before a run is given up


@compiled(**OPTIONS)
def set_tones(tones, state, time):
    """Keep the turning signals of the drive true.

    One tone is put where it is at `time`, which stays within its period. Several have no period in common: each is
    only brought back to unit length, because far from zero a time no longer tells its phase to the last digit.
    """
    for j in range(tones.shape[0]):
        c, s = int(tones[j, 0]), int(tones[j, 1])
        if tones.shape[0] == 1:
            angle = tones[j, 2] * time + tones[j, 3]
            state[c], state[s] = math.cos(angle), math.sin(angle)
        else:
            length = 1.5 - 0.5 * (state[c] * state[c] + state[s] * state[s])
            state[c] *= length
            state[s] *= length


@compiled(**OPTIONS)
def measure(tones, state, scale, faded):
    """What the rounding of each entry is measured by: its size now, or a part of what it was; turning signals have 1.

    A cosine that starts at zero carries the rounding of a cosine.
    """
    for i in range(state.shape[0]):
        scale[i] = max(abs(state[i]), faded * scale[i])
    for j in range(tones.shape[0]):
        scale[int(tones[j, 0])] = 1.0
        scale[int(tones[j, 1])] = 1.0


@compiled(**OPTIONS)
def multiply(matrix, state, out):
    """out = matrix state."""
    n = state.shape[0]
    for i in range(n):
        total = 0.0
        for j in range(n):
            total += matrix[i, j] * state[j]
        out[i] = total


@compiled(**OPTIONS)
def leap(hop, state, tail, work):
    """state + tail = exp(A cell) (state + tail), in twice the digits: a long piece has thousands of cells.

    `hop` is (3, N, N), see :func:`stickslip.solve.tables.halved`; `tail` is what rounding took from the state.
    """
    n = state.shape[0]
    for i in range(n):
        total, rest = 0.0, 0.0
        for j in range(n):
            a, b = hop[0, i, j], hop[1, i, j]
            if a == 0.0:
                continue
            # upper halves have 26 bits: their product is exact
            x = SPLITTER * state[j]
            x -= x - state[j]
            y = state[j] - x
            term = a * x
            step = total + term
            seen = step - total
            rest += (total - (step - seen)) + (term - seen)
            rest += a * y + (b * state[j] + (a * tail[j] + hop[2, i, j] * state[j]))
            total = step
        work[0, i] = total + rest
        work[1, i] = rest - (work[0, i] - total)
    for i in range(n):
        state[i], tail[i] = work[0, i], work[1, i]


@compiled(**OPTIONS)
def advance(flow, state, tail, time, work):
    """state + tail = exp(A time) (state + tail) by the Taylor series, for a time within one cell; `work` is (2, N)."""
    n = state.shape[0]
    for i in range(n):
        work[0, i] = state[i]
    for k in range(1, 24):
        scale = time / k
        for i in range(n):
            total = 0.0
            for j in range(n):
                total += flow[i, j] * work[0, j]
            work[1, i] = total * scale
        small = True
        for i in range(n):
            work[0, i] = work[1, i]
            before = state[i] + tail[i]
            tail[i] += work[1, i]
            small = small and before + work[1, i] == before
        if small and k > 4:
            break
    for i in range(n):
        whole = state[i] + tail[i]
        seen = whole - state[i]
        tail[i] = (state[i] - (whole - seen)) + (tail[i] - seen)
        state[i] = whole


@compiled(**OPTIONS)
def expand(series, state, scale, cell, c, noise):
    """Coefficients of an exit in the cell ahead, with the rounding noise of each.

    An entry of the state carries the rounding of what it was a moment ago (`scale`), though it be next to zero now.
    """
    power = 1.0
    for k in range(series.shape[0]):
        total, size = 0.0, 0.0
        for j in range(state.shape[0]):
            total += series[k, j] * state[j]
            size += abs(series[k, j]) * max(scale[j], abs(state[j]))
        c[k] = total * power
        noise[k] = NOISE * size * power
        power *= cell / (k + 1)


@compiled(**OPTIONS)
def settle(tables, mode, state, scale, cell, work, c, noise):
    """Take every exit that is due at once; returns the mode in which time passes, or -1 if the chain does not end."""
    _, _, _, series, target, crossing, reset, first, _ = tables
    for _ in range(CHAIN):
        fired = -1
        for e in range(first[mode], first[mode + 1]):
            if crossing[e]:
                continue
            expand(series[e], state, scale, cell, c, noise)
            order = opening_order(c, noise, c.shape[0])
            if order < c.shape[0] and c[order] > 0.0:
                fired = e
                break
        if fired < 0:
            return mode
        multiply(reset[fired], state, work[0])
        for i in range(state.shape[0]):
            state[i] = work[0, i]
        mode = target[fired]
    return -1


@compiled(**OPTIONS)
def next_exit(tables, mode, state, scale, opened, armed, span, c, noise):
    """The first exit within `span` [s] of the cell ahead: (time, exit, armed), or (-1, -1, armed); -2 if unproved.

    `opened` is true in the first cell of a piece, where roots at the very start are the way in, not the way out.
    `armed` has a bit for each exit that has been below zero, so that a crossing at the seam of two cells is seen.
    """
    _, cells, _, series, _, crossing, _, first, _ = tables
    cell = min(cells[mode], span)
    best, which = NONE, -1
    count = c.shape[0]
    for e in range(first[mode], first[mode + 1]):
        expand(series[e], state, scale, cell, c, noise)
        low = opening_order(c, noise, count) if opened else 0
        if low == count:
            continue
        limit = min(1.0, best)
        start = 0.0
        bit = 1 << (e - first[mode])
        if c[low] < -noise[low]:
            armed |= bit
        elif c[low] > 0.0:
            if opened or (crossing[e] and not armed & bit):
                # above zero by the rule of the crossing, or by rounding on the tie: wait for it to fall first
                start = first_rise(c, noise, count, low, -1.0, 0.0, limit)
                if start == NONE:
                    continue
                if start == UNSURE:
                    return -1.0, -2, armed
                start = min(limit, start + 1e-12)
            elif c[low] > noise[low]:
                return 0.0, e, armed
        root = first_rise(c, noise, count, low, 1.0, start, limit)
        if root == UNSURE:
            return -1.0, -2, armed
        if root < best:
            best, which = root, e
    return (best * cell, which, armed) if which >= 0 else (-1.0, -1, armed)


@compiled(**OPTIONS)
def march(tables, fast, clock, state, mode, limit, period, past, out, work, patience):
    """March until `limit`, until the buffers are full, or until a piece is longer than `patience` cells.

    Parameters
    ----------
    tables : tuple of arrays
        See :class:`stickslip.solve.tables.Linear`.
    fast : tuple of arrays
        See :class:`stickslip.solve.phasors.Phasors`; with an empty table of nodes there is no fast path.
    clock : ndarray (3,)
        Laps of the drive, time [s] within the lap, its compensation; updated.
    state : ndarray (N,)
        Updated.
    mode : int
        Mode in which time passes (settled).
    limit : tuple of (float, float)
        Laps and time within the lap at which the march ends.
    period : float
        Period of the drive [s]; infinite where there is none.
    past : tuple of arrays
        Ring of pieces gone by, see :func:`stickslip.solve.phasors.glide`.
    out : tuple of arrays
        Laps, times, modes, durations, states, exits of the pieces; of the state as many entries as there is room.
    work : ndarray (16, N or more)
        Scratch.
    patience : int
        Cells after which a march ends FULL: at the next event, or by cutting a piece that is longer itself (exit -1),
        so that the caller hears of a long run while it lasts.

    Returns
    -------
    tuple of int
        Status, number of pieces, mode.
    """
    flow, cells, hop, series, target, _, reset, _, tones = tables
    laps, times, modes, durations, states, exits = out
    n = state.shape[0]
    c, noise = work[4], work[5]
    scratch = work[:2, :n]
    held, scale, tail = work[2, :n], work[3, :n], work[15, :n]
    count, capacity, spent = 0, laps.shape[0], 0
    quick = fast[5].shape[0] > 0
    past_mode, past_exit, past_time, past_parts, ring = past
    while True:
        if quick:
            count, came, settled = glide(fast, tables, clock, state, mode, limit, period, past, out, count, work[6:])
            mode = came if settled else settle(tables, came, state, scale, cells[came], scratch, c, noise)
            if mode < 0:
                return CHATTER, count, came
        if count == capacity or spent >= patience:
            return FULL, count, mode
        left = (limit[0] - clock[0]) * period if limit[0] != clock[0] else 0.0
        left += limit[1] - clock[1]
        if left <= 4e-16 * limit[1]:
            return DONE, count, mode
        set_tones(tones, state, clock[1])
        laps[count], times[count], modes[count] = clock[0], clock[1], mode
        for i in range(states.shape[1]):
            states[count, i] = state[i]
        for i in range(n):
            held[i], tail[i] = state[i], 0.0
        gone, leaving, armed, begun = 0.0, -1, 0, spent
        opened = True
        while True:
            span = left - gone
            cell = cells[mode]
            dt, leaving, armed = next_exit(tables, mode, held, scale, opened, armed, span, c, noise)
            opened = False
            if leaving == -2:
                return UNPROVED, count, mode
            if leaving >= 0:
                advance(flow[mode], held, tail, dt, scratch)
                gone += dt
                # the last digits: where the state itself, not the polynomial, has the exit at zero
                g, d = 0.0, 0.0
                for j in range(n):
                    g += series[leaving, 0, j] * held[j]
                    d += series[leaving, 1, j] * held[j]
                if d > 0.0 and abs(g) < 1e-9 * d * min(cell, dt):
                    advance(flow[mode], held, tail, -g / d, scratch)
                    gone -= g / d
                break
            if span <= cell:
                advance(flow[mode], held, tail, span, scratch)
                gone = left
                break
            leap(hop[mode], held, tail, scratch)
            for i in range(n):
                scale[i] = max(scale[i], abs(held[i]))
            spent += 1
            gone = (spent - begun) * cell
            if tones.shape[0] == 1:
                set_tones(tones, held, clock[1] + gone)
                tail[int(tones[0, 0])], tail[int(tones[0, 1])] = 0.0, 0.0
            if gone > 2.0 * period and _rests(flow[mode], tones):
                gone = left  # held through two periods of the drive: held for good
                break
            if spent - begun == patience:
                break
        durations[count] = gone
        exits[count] = leaving
        count += 1
        slot = ring[0]
        past_mode[slot], past_exit[slot], past_time[slot], past_parts[slot] = mode, leaving, gone, 1
        ring[0] = (slot + 1) & (past_mode.shape[0] - 1)
        ring[1] = (ring[1] + 1) & (past_mode.shape[0] - 1)
        # compensated clock, wrapped at the period
        step = gone - clock[2]
        now = clock[1] + step
        clock[2] = (now - clock[1]) - step
        if now >= period:
            whole = math.floor(now / period)
            now -= whole * period
            clock[0] += whole
            ring[1] = ring[2]
            ring[2] = ring[0]
        clock[1] = now
        for i in range(n):
            state[i] = held[i]
        if leaving < 0 and gone < left:
            return FULL, count, mode
        if leaving < 0:
            if clock[0] < limit[0]:
                ring[1] = ring[2]
                ring[2] = ring[0]
            clock[0], clock[1], clock[2] = limit[0], limit[1], 0.0
            set_tones(tones, state, clock[1])
            return DONE, count, mode
        set_tones(tones, state, now)
        multiply(reset[leaving], state, held)
        for i in range(n):
            state[i] = held[i]
        measure(tones, state, scale, 0.5)
        cell = cells[target[leaving]]
        mode = settle(tables, target[leaving], state, scale, min(cell, left), scratch, c, noise)
        if mode < 0:
            return CHATTER, count, target[leaving]
        if gone <= 0.0:
            return LOST, count, mode


@compiled(**OPTIONS)
def _rests(flow, tones):
    """Whether nothing but the one tone of the drive moves in a mode."""
    if tones.shape[0] != 1:
        return False
    for i in range(flow.shape[0]):
        if i != int(tones[0, 0]) and i != int(tones[0, 1]):
            for j in range(flow.shape[0]):
                if flow[i, j] != 0.0:
                    return False
    return True


@compiled(**OPTIONS)
def follow(tables, mode, state, time, work):
    """state = exp(A time) state, however long the time; `work` is (3, N)."""
    flow, cells, hop, _, _, _, _, _, _ = tables
    cell, tail, count = cells[mode], work[2], 0
    for i in range(state.shape[0]):
        tail[i] = 0.0
    while (time - count * cell if count else time) > cell:
        leap(hop[mode], state, tail, work)
        count += 1
    advance(flow[mode], state, tail, time - count * cell if count else time, work)


@compiled(**OPTIONS)
def outputs(flow, state, tail, rows, cell, c, work):
    """Taylor coefficients of linear forms of the state, by time over the cell; returns how many there are.

    `rows` is (R, N), `c` (R, DEGREE + 1), `work` (2, N).
    """
    n = state.shape[0]
    for i in range(n):
        work[0, i] = state[i]
    for k in range(c.shape[1]):
        for r in range(rows.shape[0]):
            total = 0.0
            for i in range(n):
                total += rows[r, i] * work[0, i]
            if k == 0:
                for i in range(n):
                    total += rows[r, i] * tail[i]
            c[r, k] = total
        small = True
        for i in range(n):
            total = 0.0
            for j in range(n):
                total += flow[i, j] * work[0, j]
            work[1, i] = total * (cell / (k + 1))
            small = small and state[i] + work[1, i] == state[i]
        for i in range(n):
            work[0, i] = work[1, i]
        if small and k > 4:
            return k + 1
    return c.shape[1]


@compiled(**OPTIONS)
def sample(tables, begin, modes, states, times, rows, piece, out, work, c):
    """Values of linear forms at increasing `times` [s], one polynomial of time for each cell.

    Parameters
    ----------
    tables : tuple of arrays
        See :class:`stickslip.solve.tables.Linear`.
    begin, modes, states : ndarray
        Start [s], mode and state of each piece.
    times : ndarray (T,)
        Where to look, increasing, not before the first piece.
    rows : ndarray (M, R, N)
        Linear forms, by mode.
    piece : ndarray (T,)
        Set to the piece each time falls in.
    out : ndarray (R, T)
        Set to the values.
    work : ndarray (4, N)
        Scratch.
    c : ndarray (R, DEGREE + 1)
        Scratch.
    """
    flow, cells, hop, _, _, _, _, _, _ = tables
    n, last = states.shape[1], begin.shape[0] - 1
    scratch, held, tail = work[:2], work[2], work[3]
    j, count, known = -1, 0, 0
    for t in range(times.shape[0]):
        if j < 0 or (j < last and begin[j + 1] <= times[t]):
            j = max(j, 0)
            while j < last and begin[j + 1] <= times[t]:
                j += 1
            count, known = 0, 0
            for i in range(n):
                held[i], tail[i] = states[j, i], 0.0
        mode = modes[j]
        cell = cells[mode]
        time = times[t] - begin[j]
        while time - count * cell > cell:
            leap(hop[mode], held, tail, scratch)
            count += 1
            known = 0
        unit = cell if cell < math.inf else 1.0
        if known == 0:
            known = outputs(flow[mode], held, tail, rows[mode], unit, c, scratch)
        share = (time - count * cell if count else time) / unit
        piece[t] = j
        for r in range(rows.shape[1]):
            total = 0.0
            for k in range(known - 1, -1, -1):
                total = total * share + c[r, k]
            out[r, t] = total
