"""March one oscillator and count as it goes, without keeping its motion: compiled, for CPU and GPU alike.

A march writes a handful of pieces, they are counted, and their room is used again: a map needs no more memory per
motion than its answers. A motion that is again, to the last digits, where it was some laps before is not marched
through the laps in which it only repeats: they are skipped, and counted as the laps between.
"""

from __future__ import annotations

import math

from stickslip.compiled import OPTIONS, compiled
from stickslip.solve.batch import fast_of, slow_of
from stickslip.solve.kernel import DONE, FULL, advance, follow, march, measure, set_tones, settle
from stickslip.solve.tangent import carry_tangents
from stickslip.sweeps.measures import AT_REST, CLOSE, FAILED, MOVING, ORDERS
from stickslip.sweeps.tally import ABNORMAL, ENTRIES, HELD, NORMAL, REACH, SHORT, SLIP, WORK, note

ROOM = 16  # pieces written before they are counted
LAP = 64  # pieces remembered for the fast path, a power of two
BUDGET = 10_000  # events in a period; more is taken for chatter
TIRELESS = 2**62
PARTS = 256  # steps of a run, a lap each where it is short: what moves less than STILL in a step or more is steady,
STILL = 4e-15  # and would not move by more than PARTS times as much, some 1e-12, in the rest
STEPS = 4  # after which a mark is made anew
# of a mark: lap from which on the next look is due, lap of the mark (-1: none), laps after which the motion was there
# again (0: not yet), laps of a step, and time within the lap; then mode and state
NEXT, BEGUN, SPAN, STEP, PLACE = range(5)
MARK = 5
CONSTANT, VARIES = 1, 2  # what friction does in a mode, beside none (0)
# Gauss-Legendre points and weights on (0, 1)
POINTS = (
    0.019855071751231884, 0.10166676129318664, 0.2372337950418355, 0.4082826787521751,
    0.5917173212478249, 0.7627662049581645, 0.8983332387068134, 0.9801449282487681,
)  # fmt: skip
WEIGHTS = (
    0.05061426814518813, 0.11119051722668724, 0.15685332293894363, 0.1813418916891810,
    0.1813418916891810, 0.15685332293894363, 0.11119051722668724, 0.05061426814518813,
)  # fmt: skip


@compiled(**OPTIONS)
def watch_one(i, s, given, out, scratch):
    """March motion i with scratch s, and leave its status, what is counted, and its last states at phase zero."""
    opened, modes, periods, units, slow, fast, look, wants, leaps, weights = given
    statuses, sums, sections, growths, jacobians = out
    works, names, times, parts, rings, clocks, room, tangents, marks = scratch
    n, physical, period = opened.shape[1], sections.shape[2], periods[i]
    state, work = works[s, 16, :n], works[s]
    past = (names[0, s], names[1, s], times[s], parts[s], rings[s])
    pieces = (room[0][s], room[1][s], room[2][s], room[3][s], room[4][s], room[5][s])
    motion = (slow_of(slow, i), fast_of(fast, i), clocks[s], state, period, units[i], past, pieces, work, marks[s])
    settled, total, rows = wants[0], wants[0] + wants[1], sections.shape[1]
    each, driven = wants[2] == 1, math.isfinite(period)
    mode = _begin(motion, opened[i], modes[i], total)
    tangent = tangents[s, :1]
    for k in range(n):
        tangent[0, k] = (1.0 - 0.5 * k / max(1, physical - 1)) / weights[i, k] if k < physical else 0.0
    growths[i] = 0.0
    _unmarked(marks[s], math.ceil(total / PARTS) if driven and not each else 0.0)
    lap, last, lasted = 0, 0, 0.0
    while lap < total and mode >= 0:
        until = total - max(0, rows - 1)
        if each or lap >= until:
            until = lap + 1
        mode, last, lasted = _to(i, lap, until, motion, mode, settled, look, each, leaps, tangent, sums[i])
        lap = until
        if each and mode >= 0 and not _grown(i, tangent[0], weights, lap > settled, growths):
            break
        if lap > total - rows:
            for k in range(physical):
                sections[i, lap - (total - rows) - 1, k] = state[k]
    if driven:
        rests = look[4][last] and lasted >= (1.0 - 1e-9) * period
    else:
        rests = mode >= 0 and _stands(motion[0][0][mode], state)
    statuses[i] = FAILED if mode < 0 else AT_REST if rests else MOVING
    if mode >= 0 and wants[3] == 1:
        _differentiate(i, total, motion, mode, leaps, tangents[s], sections[i], jacobians[i])


@compiled(**OPTIONS)
def _begin(motion, opened, mode, total):
    """Set the state and forget the motion before; the mode in which time passes, -1 where there is none."""
    tables, _, clock, state, _, unit, past, _, work, _ = motion
    n, degree = state.shape[0], tables[3].shape[1]
    for k in range(n):
        state[k] = opened[k]
    for k in range(LAP):
        past[0][k], past[1][k], past[2][k], past[3][k] = -1, -1, 0.0, 1
    for k in range(3):
        clock[k], past[4][k] = 0.0, 0
    measure(tables[8], state, work[3], 0.0)
    cell = min(tables[1][mode], total * unit)
    return settle(tables, mode, state, work[3, :n], cell, work[:2, :n], work[4, :degree], work[5, :degree])


@compiled(**OPTIONS)
def _to(i, lap, until, motion, mode, settled, look, each, leaps, tangent, sums):
    """March to a lap and count; the mode there (-1: the march failed), that of the last piece, and how long it lasted
    where nothing ended it."""
    tables, quick, clock, state, period, unit, past, pieces, work, marks = motion
    driven = math.isfinite(period)
    limit = (float(until), 0.0) if driven else (0.0, until * unit)
    outcome, events, last, lasted = FULL, 0, mode, 0.0
    while outcome == FULL:
        outcome, count, mode = march(tables, quick, clock, state, mode, limit, period, past, pieces, work, TIRELESS)
        events += count
        if (outcome != FULL and outcome != DONE) or not math.isfinite(state[0]) or events > BUDGET * (until - lap):
            return -1, last, 0.0
        if count > 0:
            last, lasted = pieces[2][count - 1], pieces[3][count - 1] if pieces[5][count - 1] < 0 else 0.0
        _count(i, count, motion, settled, look, sums)
        if marks[0, SPAN] > 0.0 and outcome == FULL:
            _skip(clock, marks, settled, until, sums)
        if each:
            _carry(i, count, motion, mode, leaps, tangent)
    return mode, last, lasted


@compiled(**OPTIONS)
def _carry(i, count, motion, mode, leaps, tangents):
    """Carry small differences through the pieces just written."""
    tables, pieces, work = motion[0], motion[7], motion[8]
    for p in range(count):
        set_tones(tables[8], pieces[4][p], pieces[1][p])
    carry_tangents(
        tables, leaps[i], pieces[2][:count], pieces[4][:count], pieces[3][:count], pieces[5][:count], mode, tangents,
        work[7:16, : motion[3].shape[0]],
    )  # fmt: skip


@compiled(**OPTIONS)
def _differentiate(i, total, motion, mode, leaps, tangents, section, jacobian):
    """The derivative of the motion over the laps after which it repeats, where it does."""
    tables, quick, clock, state, period, _, past, pieces, work, _ = motion
    physical, order, outcome = jacobian.shape[0], repeats(section), FULL
    for a in range(physical):
        for k in range(state.shape[0]):
            tangents[a, k] = 1.0 if a == k else 0.0
    clock[0], clock[1], clock[2] = float(total), 0.0, 0.0
    limit = (float(total + order), 0.0)
    while outcome == FULL and order > 0:
        outcome, count, mode = march(tables, quick, clock, state, mode, limit, period, past, pieces, work, TIRELESS)
        _carry(i, count, motion, mode, leaps, tangents)
    for a in range(physical):
        for k in range(physical):
            jacobian[k, a] = tangents[a, k] if outcome == DONE else math.nan


@compiled(**OPTIONS)
def _stands(flow, state):
    """Whether nothing changes any more."""
    for k in range(flow.shape[0]):
        rate = 0.0
        for j in range(flow.shape[0]):
            rate += flow[k, j] * state[j]
        if rate != 0.0:
            return False
    return True


@compiled(**OPTIONS)
def repeats(section):
    """The least number of rows after which the last ones are there again; 0: none."""
    rows, width = section.shape
    for step in range(1, min(ORDERS, rows // 2) + 1):
        same = True
        for k in range(width):
            size = 0.0
            for j in range(rows):
                size = max(size, abs(section[j, k]))
            for j in range(rows - step, rows):
                same = same and abs(section[j, k] - section[j - step, k]) <= CLOSE * size
        if same:
            return step
    return 0


@compiled(**OPTIONS)
def _grown(i, tangent, weights, counted, growths):
    """Take the growth of a small difference over a period and make it small again; False where nothing is left."""
    physical, length = weights.shape[1], 0.0
    for k in range(physical):
        length += (tangent[k] * weights[i, k]) ** 2
    length = math.sqrt(length)
    if length == 0.0:
        growths[i] = -math.inf
        return False
    for k in range(physical):
        tangent[k] /= length
    if counted:
        growths[i] += math.log(length)
    return True


@compiled(**OPTIONS)
def _read(row, state, tones, time):
    """A linear form of a state whose turning signals are those of a time."""
    total = 0.0
    turning = tones.shape[0] == 1
    c, s = (int(tones[0, 0]), int(tones[0, 1])) if turning else (-1, -1)
    for j in range(row.shape[0]):
        if row[j] != 0.0 and j != c and j != s:
            total += row[j] * state[j]
    if turning and (row[c] != 0.0 or row[s] != 0.0):
        angle = tones[0, 2] * time + tones[0, 3]
        total += row[c] * math.cos(angle) + row[s] * math.sin(angle)
    return total


@compiled(**OPTIONS)
def _count(i, count, motion, settled, look, sums):
    """Count the pieces just written."""
    tables, _, clock, state, period, unit, _, pieces, work, marks = motion
    laps, offsets, modes, durations, states, _ = pieces
    kinds, sides, inner, works, _, slip, gap, friction, fixed = look
    paths = fixed[1] == 1
    n, tones = state.shape[0], tables[8]
    held = work[6, :n]
    if count == 0:
        return
    place, after, speed = _read(gap[i], states[0], tones, offsets[0]) if paths else 0.0, 0.0, 0.0
    for p in range(count):
        m, length = modes[p], durations[p]
        if laps[p] >= marks[0, NEXT]:
            _mark(laps[p], offsets[p] / period, m, states[p], tones, settled, sums, marks)
        begin = (laps[p] - settled) * period + offsets[p] if math.isfinite(period) else offsets[p] - settled * unit
        last = p == count - 1
        x = state[0] if last else states[p + 1, 0]
        if paths:
            follows, then = (state, clock[1]) if last else (states[p + 1], offsets[p + 1])
            after = _read(gap[i], follows, tones, then)
            speed = abs(_read(slip[i], states[p], tones, offsets[p])) if kinds[m] == SLIP else 0.0
        note(kinds[m], sides[m], begin, length, abs(after - place), speed, sums)
        if begin + length > 0.0:
            first, span = begin >= 0.0, min(length, begin + length)
            if inner[m] or works[m] == VARIES or not first:
                for k in range(n):
                    held[k] = states[p, k]
                set_tones(tones, held, offsets[p])
                if not first:
                    follow(tables, m, held, -begin, work[7:10, :n])
                    place = _read(gap[i], held, tones, offsets[p] - begin)
            sums[REACH] = max(sums[REACH], abs(x), abs(states[p, 0] if first else held[0]))
            if works[m] == CONSTANT:
                sums[WORK] += friction[i, m, fixed[0]] * (after - place)
            if inner[m] or works[m] == VARIES:
                _inside(tables, m, held, span, inner[m], works[m] == VARIES, friction[i, m], slip[i], sums, work)
        place = after


@compiled(**OPTIONS)
def _unmarked(marks, step):
    """Forget the motion before; without a step, none is looked for."""
    marks[0, NEXT], marks[0, BEGUN], marks[0, SPAN], marks[0, STEP] = 0.0 if step else math.inf, -1.0, 0.0, step
    for k in range(marks.shape[1]):
        marks[1, k] = 0.0


@compiled(**OPTIONS)
def _mark(lap, place, mode, state, tones, settled, sums, marks):
    """Tell at the first event of a lap whether the motion is where the mark is; after some steps, make another."""
    here, size, before, gains = marks[0], marks[1], marks[2], marks[3]
    fresh = here[BEGUN] < 0.0 or here[BEGUN] < settled <= lap
    again = not fresh and mode == here[MARK] and abs(place - here[PLACE]) <= STILL
    fresh = fresh or lap >= here[BEGUN] + STEPS * here[STEP]
    for k in range(state.shape[0]):
        turns = tones.shape[0] == 1 and (k == int(tones[0, 0]) or k == int(tones[0, 1]))
        size[k] = max(size[k], abs(state[k]))
        if not turns:
            again = again and abs(state[k] - here[MARK + 1 + k]) <= STILL * size[k]
            if fresh:
                here[MARK + 1 + k] = state[k]
    here[NEXT] = lap + here[STEP]
    if again:
        here[SPAN], here[NEXT] = lap - here[BEGUN], math.inf
        for k in range(ENTRIES):
            gains[k] = sums[k] - before[k]
    elif fresh:
        here[PLACE], here[MARK], here[BEGUN] = place, mode, lap
        for k in range(ENTRIES):
            before[k] = sums[k]


@compiled(**OPTIONS)
def _skip(clock, marks, settled, until, sums):
    """Leave out the laps in which a motion repeats: all but the last that is not measured, or the last."""
    here, gains = marks[0], marks[3]
    span, measured = here[SPAN], here[BEGUN] >= settled
    end = until if measured else min(settled, until)
    times = max(0.0, math.floor((end - 1.0 - clock[0]) / span))
    if measured:
        for k in (NORMAL, ABNORMAL, HELD, SHORT, WORK):
            sums[k] += times * gains[k]
    clock[0] += times * span
    here[BEGUN], here[NEXT], here[SPAN] = -1.0, end, 0.0


@compiled(**OPTIONS)
def _inside(tables, mode, held, span, turns, varies, friction, slip, sums, work):
    """The farthest turn within a piece, and the work of a friction that changes in it, cell by cell."""
    flow, n = tables[0][mode], held.shape[0]
    scratch, here, tail = work[7:9, :n], work[9, :n], work[10, :n]
    steps = 1 + int(2.0 * span / tables[1][mode])
    step = span / steps
    for _ in range(steps):
        before, reached = held[1], 0.0
        if varies:
            for j in range(len(POINTS)):
                for k in range(n):
                    here[k], tail[k] = held[k], 0.0
                advance(flow, here, tail, POINTS[j] * step, scratch)
                force, speed = 0.0, 0.0
                for k in range(n):
                    force += friction[k] * here[k]
                    speed += slip[k] * here[k]
                sums[WORK] += WEIGHTS[j] * step * force * speed
        for k in range(n):
            here[k], tail[k] = held[k], 0.0
        advance(flow, here, tail, step, scratch)
        if turns and before * here[1] < 0.0:
            near = step * before / (before - here[1])
            after, tip = here[1], work[11, :n]
            for _ in range(5):
                for k in range(n):
                    tip[k], tail[k] = held[k], 0.0
                advance(flow, tip, tail, near, scratch)
                rate = 0.0
                for k in range(n):
                    rate += flow[1, k] * tip[k]
                if rate != 0.0:
                    near = min(step, max(0.0, near - tip[1] / rate))
                reached = max(reached, abs(tip[0]))
            here[1] = after
        sums[REACH] = max(sums[REACH], reached, abs(here[0]) if turns else 0.0)
        for k in range(n):
            held[k] = here[k]


@compiled(**OPTIONS, nogil=True)
def watch_all(given, out, scratch):
    """One motion after another, in one scratch."""
    for i in range(given[0].shape[0]):
        watch_one(i, 0, given, out, scratch)
