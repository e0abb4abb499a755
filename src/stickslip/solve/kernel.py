"""The compiled march through the mode tables: plain scalar loops on arrays the caller owns, no allocation.

The same functions run on the CPU and, called from a CUDA kernel, on a GPU.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from stickslip.arrays import Array
from stickslip.compiled import OPTIONS, compiled
from stickslip.solve.cells import DEGREE, SPLITTER
from stickslip.solve.glide import Clock, Pieces, glide, later, new_lap, remember, until
from stickslip.solve.roots import NOISE, NONE, UNSURE, first_rise, opening_order

DONE, FULL, CHATTER, LOST, UNPROVED = 0, 1, 2, 3, 4
CHAIN = 64  # transitions without time in between before a run is given up
UNTOLD = -2  # an exit that could neither be found nor excluded


class Scratch(NamedTuple):
    """What a march writes on: two states, the state within a piece and what rounding took from it, what the rounding of
    each entry is measured by, the coefficients of an exit with the noise of each, and room for the fast path."""

    pair: Array
    moving: Array
    tail: Array
    scale: Array
    c: Array
    noise: Array
    fast: Array


def scratch(size: int, rows: int = 16) -> Array:
    """Scratch for the march of a state of so many entries."""
    return np.zeros((rows, max(size, DEGREE + 1, 16)))


@compiled(**OPTIONS)
def parts_of(work, size):
    """Scratch by name."""
    c, noise = work[4, : DEGREE + 1], work[5, : DEGREE + 1]
    return Scratch(work[:2, :size], work[2, :size], work[15, :size], work[3, :size], c, noise, work[6:15])


@compiled(**OPTIONS)
def set_tones(tones, state, time, period):
    """Keep the turning signals of the drive true: `tones` is (J, 4) as in ``Linear``, `time` and `period` are in s.

    One tone whose period is the drive's is put where it is at `time`, which stays within it. Several have no period in
    common, and beside a belt time goes on and on: each is only brought back to unit length, because far from zero a
    time no longer tells its phase to the last digit.
    """
    for j in range(tones.shape[0]):
        c, s = int(tones[j, 0]), int(tones[j, 1])
        if tones.shape[0] == 1 and period < math.inf:
            angle = tones[j, 2] * time + tones[j, 3]
            state[c], state[s] = math.cos(angle), math.sin(angle)
        else:
            # one step of Newton for 1 / sqrt(q), which near q = 1 is 1.5 - q / 2
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

    `hop` is (3, N, N), see :func:`stickslip.solve.cells.halved`; `tail` (N,) is what rounding took from the state (N,);
    `work` is (2, N). Sums are those of Dot2 (Ogita, Rump and Oishi, SIAM J. Sci. Comput. 26, 2005).
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
            # two-sum (Knuth): what this addition rounds away
            step = total + term
            seen = step - total
            rest += (total - (step - seen)) + (term - seen)
            # lower products: their own rounding is of second order
            rest += a * y + (b * state[j] + (a * tail[j] + hop[2, i, j] * state[j]))
            total = step
        # normalised: state and tail overlap in no bit
        work[0, i] = total + rest
        work[1, i] = rest - (work[0, i] - total)
    for i in range(n):
        state[i], tail[i] = work[0, i], work[1, i]


@compiled(**OPTIONS)
def advance(flow, state, tail, time, work):
    """state + tail = exp(A time) (state + tail) by the Taylor series, for a time [s] within one cell.

    `flow` is A (N, N) [1/s], `state` and `tail` are (N,), `work` (2, N).
    """
    n = state.shape[0]
    for i in range(n):
        work[0, i] = state[i]
    # rate * time <= 1 within a cell: term k is 1 / k! of its scale, the 23rd far below rounding
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
            # terms gather in the tail, so that the state rounds once, at the end
            before = state[i] + tail[i]
            tail[i] += work[1, i]
            small = small and before + work[1, i] == before
        # near rest an early term may be lost in every entry, and the next one not
        if small and k > 4:
            break
    for i in range(n):
        # two-sum: the tail keeps what the state has no room for
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
def settle(linear, mode, state, cell, work):
    """Take every exit that is due at once; returns the mode in which time passes, or -1 if the chain does not end.

    `state` (N,) is carried over; exits are expanded over `cell` [s]; `work` is :class:`Scratch`.
    """
    for _ in range(CHAIN + linear.first.shape[0]):  # a table of speeds may have to be gone through line by line
        fired = -1
        for e in range(linear.first[mode], linear.first[mode + 1]):
            # what counts by a crossing must have been below zero first
            if linear.crossing[e]:
                continue
            # the first derivative that stands out from its noise decides (rules of roots)
            expand(linear.series[e], state, work.scale, cell, work.c, work.noise)
            order = opening_order(work.c, work.noise, work.c.shape[0])
            if order < work.c.shape[0] and work.c[order] > 0.0:
                fired = e
                break
        if fired < 0:
            return mode
        # one at a time, in the order of the table: the mode behind is asked anew
        multiply(linear.reset[fired], state, work.pair[0])
        for i in range(state.shape[0]):
            state[i] = work.pair[0, i]
        mode = linear.target[fired]
    return -1


@compiled(**OPTIONS)
def begin(linear, mode, state, span, faded, work):
    """Enter the motion at a state: measure its rounding, where `faded` of what it was before counts, and settle it; the
    mode in which time passes, -1 where there is none. `span` is the time [s] ahead, `work` :func:`scratch`."""
    room = parts_of(work, state.shape[0])
    measure(linear.tones, state, room.scale, faded)
    return settle(linear, mode, state, min(linear.cell[mode], span), room)


@compiled(**OPTIONS)
def next_exit(linear, mode, opened, armed, span, work):
    """The first exit within `span` [s] of the cell ahead of the state `work.moving`: (time, exit, armed).

    The exit is -1 where there is none, UNTOLD where that is not proved. `opened` is true in the first cell of a piece,
    where roots at the very start are the way in, not the way out. `armed` has a bit for each exit that has been below
    zero, so that a crossing at the seam of two cells is seen.
    """
    c, noise = work.c, work.noise
    cell = min(linear.cell[mode], span)
    best, which = NONE, -1
    count = c.shape[0]
    for e in range(linear.first[mode], linear.first[mode + 1]):
        # over u = t / cell, with the noise of each coefficient
        expand(linear.series[e], work.moving, work.scale, cell, c, noise)
        low = opening_order(c, noise, count)
        if low == count:
            continue  # on the tie, and staying there
        low = low if opened else 0
        # sought no farther than the first found so far; at a tie the earlier row of the table wins
        limit = min(1.0, best)
        start = 0.0
        bit = 1 << (e - linear.first[mode])
        if c[low] < -noise[low]:
            armed |= bit
        elif c[low] > 0.0:
            if opened or (linear.crossing[e] and not armed & bit):
                # above zero by the rule of the crossing, or by rounding on the tie: wait for it to fall first
                start = first_rise(c, noise, count, low, -1.0, 0.0, limit)
                if start == NONE:
                    continue
                if start == UNSURE:
                    return -1.0, UNTOLD, armed
                start = min(limit, start + 1e-12)
            elif c[low] > noise[low]:
                return 0.0, e, armed
        root = first_rise(c, noise, count, low, 1.0, start, limit)
        if root == UNSURE:
            return -1.0, UNTOLD, armed
        if root < best:
            best, which = root, e
    return (best * cell, which, armed) if which >= 0 else (-1.0, -1, armed)


@compiled(**OPTIONS)
def _polished(linear, mode, leaving, dt, work):
    """Newton's last step, to where the state itself, not the polynomial, has the exit at zero: its length [s]."""
    g, d = 0.0, 0.0
    for j in range(work.moving.shape[0]):
        g += linear.series[leaving, 0, j] * work.moving[j]
        d += linear.series[leaving, 1, j] * work.moving[j]
    if not (d > 0.0 and abs(g) < 1e-9 * d * min(linear.cell[mode], dt)):
        return 0.0
    advance(linear.flow[mode], work.moving, work.tail, -g / d, work.pair)
    return -g / d


@compiled(**OPTIONS)
def _crossed(model, mode, clock, left, patience, work):
    """Take the state `work.moving` through a mode until an exit ends it, the time that is left is over, or `patience`
    cells are gone through: the time [s], the exit (-1: none) and the cells. `left` is in s, `work` :class:`Scratch`."""
    linear, moving, tail = model.linear, work.moving, work.tail
    cell, gone, armed, cells = linear.cell[mode], 0.0, np.int64(0), 0
    while True:
        span = left - gone
        # Exit: the first of this cell, if any.
        dt, leaving, armed = next_exit(linear, mode, cells == 0, armed, span, work)
        if leaving == UNTOLD:
            return gone, leaving, cells
        if leaving >= 0:
            advance(linear.flow[mode], moving, tail, dt, work.pair)
            gone += dt
            gone += _polished(linear, mode, leaving, dt, work)
            return gone, leaving, cells
        # Limit: the cell holds all the time that is left.
        if span <= cell:
            advance(linear.flow[mode], moving, tail, span, work.pair)
            return left, leaving, cells
        # Cell: over its whole length, in twice the digits: a long piece has thousands of cells.
        leap(linear.hop[mode], moving, tail, work.pair)
        # an entry keeps the rounding of the largest that it was in this piece
        for i in range(moving.shape[0]):
            work.scale[i] = max(work.scale[i], abs(moving[i]))
        cells += 1
        gone = cells * cell
        # the phase by the clock: thousands of turns would gather rounding
        if linear.tones.shape[0] == 1 and model.period < math.inf:
            set_tones(linear.tones, moving, clock.time + gone, model.period)
            tail[int(linear.tones[0, 0])], tail[int(linear.tones[0, 1])] = 0.0, 0.0
        if gone > 2.0 * model.period and _rests(linear.flow[mode], linear.tones):
            return left, leaving, cells  # held through two periods of the drive: held for good
        if cells >= patience:
            return gone, leaving, cells


@compiled(**OPTIONS)
def march(model, clock, state, mode, limit, past, out, work, patience):
    """March until `limit`, until the buffers are full, or until a piece is longer than `patience` cells.

    Parameters
    ----------
    model : Model
        What moves; with an empty table of nodes there is no fast path.
    clock : Clock
        When the march begins.
    state : ndarray (N,)
        Updated.
    mode : int
        Mode in which time passes (settled).
    limit : Clock
        When the march ends.
    past : Past
        Pieces gone by, updated.
    out : Pieces
        Where the pieces are written; of the state as many entries as there is room.
    work : ndarray
        :func:`scratch`.
    patience : int
        Cells after which a march ends FULL: at the next event, or by cutting a piece that is longer itself (exit -1),
        so that the caller hears of a long run while it lasts.

    Returns
    -------
    tuple of (int, int, int, Clock)
        Status, number of pieces, mode, and the clock.
    """
    n, linear, spent = state.shape[0], model.linear, 0
    count = 0
    room, moving = parts_of(work, n), parts_of(work, n).moving
    capacity, quick = out.laps.shape[0], model.fast.nodes.shape[0] > 0
    while True:
        if quick:
            # as far as two phasors tell it; the piece in doubt is the general march's
            count, following, settled, clock = glide(model, clock, state, mode, limit, past, out, count, room.fast)
            mode = following if settled else settle(linear, following, state, linear.cell[following], room)
            if mode < 0:
                return CHATTER, count, following, clock
        # Room and patience: the caller takes the pieces and calls again.
        if count == capacity or spent >= patience:
            return FULL, count, mode, clock
        # Time: less than two roundings of the clock is none.
        left = until(clock, limit, model.period)
        if left <= 4e-16 * limit.time:
            return DONE, count, mode, clock
        set_tones(linear.tones, state, clock.time, model.period)
        # Piece: how it begins, and through its mode to its end.
        out.laps[count], out.offsets[count], out.modes[count] = clock.laps, clock.time, mode
        for i in range(out.states.shape[1]):
            out.states[count, i] = state[i]
        for i in range(n):
            moving[i], room.tail[i] = state[i], 0.0
        gone, leaving, cells = _crossed(model, mode, clock, left, patience, room)
        spent += cells
        if leaving == UNTOLD:
            return UNPROVED, count, mode, clock
        # End: an exit, the limit, or (exit -1, time left) cut for lack of patience.
        out.durations[count], out.exits[count] = gone, leaving
        count += 1
        remember(past, mode, leaving, gone, 1)
        over = leaving < 0 and gone >= left
        # the limit itself, not a sum that rounds: the next stop begins there
        now = Clock(limit.laps, limit.time, 0.0) if over else later(clock, gone, model.period)
        if now.laps > clock.laps:
            new_lap(past)
        clock = now
        for i in range(n):
            state[i] = moving[i]
        if over:
            set_tones(linear.tones, state, clock.time, model.period)
            return DONE, count, mode, clock
        if leaving < 0:
            return FULL, count, mode, clock
        # the event: carry the state over, and take what is due at once
        set_tones(linear.tones, state, clock.time, model.period)
        multiply(linear.reset[leaving], state, moving)
        for i in range(n):
            state[i] = moving[i]
        # what an entry was counts by half at each event: one next to zero still has its rounding
        measure(linear.tones, state, room.scale, 0.5)
        following = linear.target[leaving]
        mode = settle(linear, following, state, min(linear.cell[following], left), room)
        if mode < 0:
            return CHATTER, count, following, clock
        # settled, and yet left without time: rounding decides, and it would go on for ever
        if gone <= 0.0:
            return LOST, count, mode, clock


@compiled(**OPTIONS)
def course(model, clock, state, mode, stops, stop, past, out, work, patience):
    """As :func:`march`, on the way to stop `stop` of several (:class:`~stickslip.solve.tables.Stops`) and to those
    behind it; returns also the stop that it is on its way to."""
    done = 0
    last = Clock(stops.ends[-1, 0], stops.ends[-1, 1], 0.0)
    while True:
        end = Clock(stops.ends[stop, 0], stops.ends[stop, 1], 0.0)
        # the room behind the pieces written so far
        rest = Pieces(
            out.laps[done:],
            out.offsets[done:],
            out.modes[done:],
            out.durations[done:],
            out.states[done:],
            out.exits[done:],
        )
        status, count, mode, clock = march(model, clock, state, mode, end, past, rest, work, patience)
        done += count
        if status != DONE or stop + 1 == stops.ends.shape[0]:
            return status, done, mode, clock, stop
        # Stop: entries take new values, as a recorded drive has a new polynomial; the mode may end there.
        stop += 1
        for j in range(stops.places.shape[0]):
            state[stops.places[j]] = stops.values[stop, j]
        # no time passes in it: the rounding measured so far counts in full (1.0)
        entered, mode = mode, begin(model.linear, mode, state, until(clock, last, model.period), 1.0, work)
        if mode < 0:
            return CHATTER, done, entered, clock, stop


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
def follow(linear, mode, state, time, work):
    """state = exp(A time) state, however long the time; `work` is (3, N)."""
    cell, tail, count = linear.cell[mode], work[2], 0
    for i in range(state.shape[0]):
        tail[i] = 0.0
    while (time - count * cell if count else time) > cell:
        leap(linear.hop[mode], state, tail, work)
        count += 1
    advance(linear.flow[mode], state, tail, time - count * cell if count else time, work)


@compiled(**OPTIONS)
def outputs(flow, state, tail, rows, cell, c, work):
    """Taylor coefficients of linear forms of the state, by time over the cell; returns how many there are.

    `flow` is (N, N) [1/s], `state` and `tail` (N,), `rows` (R, N), `cell` in s, `c` (R, DEGREE + 1), `work` (2, N).
    """
    n = state.shape[0]
    for i in range(n):
        work[0, i] = state[i]
    # coefficient k: each row times A^k S cell^k / k!
    for k in range(c.shape[1]):
        for r in range(rows.shape[0]):
            total = 0.0
            for i in range(n):
                total += rows[r, i] * work[0, i]
            # the tail counts in the value alone; in a derivative it is below rounding
            if k == 0:
                for i in range(n):
                    total += rows[r, i] * tail[i]
            c[r, k] = total
        # the series ends where a term changes no entry, as in `advance`
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
def sample(linear, begin, modes, states, times, rows, piece, out, work, c):
    """Values of linear forms at increasing `times` [s], one polynomial of time for each cell.

    Parameters
    ----------
    linear : Linear
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
    n, last = states.shape[1], begin.shape[0] - 1
    scratch, moving, tail = work[:2], work[2], work[3]
    j, count, known = -1, 0, 0
    for t in range(times.shape[0]):
        # Piece: the state where it begins.
        if j < 0 or (j < last and begin[j + 1] <= times[t]):
            j = max(j, 0)
            while j < last and begin[j + 1] <= times[t]:
                j += 1
            count, known = 0, 0
            for i in range(n):
                moving[i], tail[i] = states[j, i], 0.0
        mode = modes[j]
        cell = linear.cell[mode]
        time = times[t] - begin[j]
        # Cell: carried over those that are over, in twice the digits.
        while time - count * cell > cell:
            leap(linear.hop[mode], moving, tail, scratch)
            count += 1
            known = 0
        # where nothing turns one cell lasts for ever, and any unit of time serves
        unit = cell if cell < math.inf else 1.0
        if known == 0:
            known = outputs(linear.flow[mode], moving, tail, rows[mode], unit, c, scratch)
        # Instant: Horner's rule.
        share = (time - count * cell if count else time) / unit
        piece[t] = j
        for r in range(rows.shape[1]):
            total = 0.0
            for k in range(known - 1, -1, -1):
                total = total * share + c[r, k]
            out[r, t] = total
