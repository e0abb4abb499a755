"""March one oscillator and count as it goes, without keeping its motion: compiled, for CPU and GPU alike.

A march writes a handful of pieces, they are counted, and their room is used again: a map needs no more memory per
motion than its answers. A motion that is again, to the last digits, where it was some laps before is not marched
through the laps in which it only repeats: they are skipped, and counted as the laps between.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from stickslip.arrays import Array, Index, Mask
from stickslip.compiled import OPTIONS, compiled
from stickslip.maps.measures import (
    ABNORMAL,
    AT_REST,
    CLOSE,
    ENTRIES,
    FAILED,
    HELD,
    MOVING,
    NORMAL,
    ORDERS,
    REACH,
    SHORT,
    SLIP,
    WORK,
    note,
)
from stickslip.solve.cells import Linear
from stickslip.solve.glide import Clock, Model, Past, Pieces
from stickslip.solve.kernel import DONE, FULL, advance, begin, follow, march, set_tones
from stickslip.solve.phasors import Phasors
from stickslip.solve.poincare import carry_tangents
from stickslip.solve.refusal import Budget

TIRELESS = 2**62  # cells: a march of many motions is not interrupted
LAP = 64  # pieces remembered of a motion, a power of two; a lap of the drive with more has no fast path
ROOM = 16  # pieces written before they are counted
BUDGET = 10_000  # events in a period; more is taken for chatter
SILENT = Budget.SILENT
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


class Look(NamedTuple):
    """What is looked at: of each mode its kind, side, whether the mass may turn within, what friction does there and
    whether nothing moves; of each motion slip, displacement from the counter-face and, by mode, friction as linear
    forms."""

    kinds: Index
    sides: Array
    inner: Mask
    works: Index
    still: Mask
    slip: Array
    gap: Array
    friction: Array


class Given(NamedTuple):
    """What a watch is asked: of each motion its state and mode at the start, unit of time [s] and what moves, with a
    leading axis; what is looked at and wanted; what carries tangents, and what each entry is measured by."""

    states: Array
    modes: Index
    units: Array
    models: Model
    look: Look
    wants: Index
    leaps: Array
    weights: Array


SETTLE, CYCLES, GROWTH, TURNS, ONE, PATHS = range(6)  # wants: periods before and while it is counted, exponents,
# multipliers, the entry that is constant, and whether it matters how far the contact slips


class Counted(NamedTuple):
    """What a watch leaves of each motion: status, sums, states at phase zero, growth of a small difference, derivative
    over the laps after which it repeats."""

    statuses: Index
    sums: Array
    sections: Array
    growths: Array
    jacobians: Array


class Rooms(NamedTuple):
    """Scratch of each motion that is under way, with a leading axis."""

    works: Array
    pasts: Past
    pieces: Pieces
    tangents: Array
    marks: Array


class Motion(NamedTuple):
    """One motion under way."""

    model: Model
    state: Array
    unit: float
    past: Past
    pieces: Pieces
    work: Array
    marks: Array


@compiled(**OPTIONS)
def model_of(models, j):
    """One of many systems, as :func:`stickslip.solve.kernel.march` reads it; what is shared has no leading axis."""
    linear, fast = models.linear, models.fast
    # nodes of all systems stand one after another, as many as each needs
    nodes = fast.nodes[fast.span[j, 0] : fast.span[j, 1]]
    # column by column: compiled code has no loop over the fields of a tuple
    return Model(
        Linear(
            linear.flow[j],
            linear.cell[j],
            linear.hop[j],
            linear.series[j],
            linear.target,
            linear.crossing,
            linear.reset[j],
            linear.first,
            linear.tones[j],
        ),
        Phasors(fast.drive[j], fast.mode[j], fast.level[j], fast.exit[j], fast.rest[j], nodes, fast.span[j]),
        models.period[j],
    )


@compiled(**OPTIONS)
def past_of(pasts, i):
    """The ring of one motion."""
    return Past(pasts.modes[i], pasts.exits[i], pasts.times[i], pasts.parts[i], pasts.places[i])


@compiled(**OPTIONS)
def watch_one(i, s, given, out, rooms):
    """March motion i with scratch s, and leave its status, what is counted, and its last states at phase zero.

    Of `out` with a leading axis: `sums` (ENTRIES,), `sections` (rows, physical), `jacobians` (physical, physical); of
    `rooms`: `works` (17, N or more), `tangents` (physical, N), `marks` (4, MARK + 1 + N or more).
    """
    n, physical, wants = given.states.shape[1], out.sections.shape[2], given.wants
    room, marks, tangents = rooms.pieces, rooms.marks[s], rooms.tangents[s]
    pieces = Pieces(room.laps[s], room.offsets[s], room.modes[s], room.durations[s], room.states[s], room.exits[s])
    state, model = rooms.works[s, 16, :n], model_of(given.models, i)
    motion = Motion(model, state, given.units[i], past_of(rooms.pasts, s), pieces, rooms.works[s], marks)
    settled, total, rows = wants[SETTLE], wants[SETTLE] + wants[CYCLES], out.sections.shape[1]
    growing, driven = wants[GROWTH] == 1, math.isfinite(model.period)
    mode, clock = _begin(motion, given.states[i], given.modes[i], total), Clock(0.0, 0.0, 0.0)
    # Start: a small difference with a part along each entry, lest it miss the direction that grows.
    tangent = tangents[:1]
    for k in range(n):
        tangent[0, k] = (1.0 - 0.5 * k / max(1, physical - 1)) / given.weights[i, k] if k < physical else 0.0
    out.growths[i] = 0.0
    _unmarked(marks, math.ceil(total / PARTS) if driven and not growing else 0.0)
    # Laps: at once as far as no state at phase zero is wanted, then one by one; exponents need each.
    lap, last, lasted = 0, 0, 0.0
    while lap < total and mode >= 0:
        until = total - max(0, rows - 1)
        if growing or lap >= until:
            until = lap + 1
        mode, last, lasted, clock = _to(i, lap, until, motion, mode, clock, given, tangent, out.sums[i])
        lap = until
        if growing and mode >= 0 and not _grown(i, tangent[0], given.weights, lap > settled, out.growths):
            break
        if lap > total - rows:
            for k in range(physical):
                out.sections[i, lap - (total - rows) - 1, k] = state[k]
    # Rest: held through a whole lap, or without a drive where nothing changes.
    if driven:
        rests = given.look.still[last] and lasted >= (1.0 - 1e-9) * model.period
    else:
        rests = mode >= 0 and _stands(model.linear.flow[mode], state)
    out.statuses[i] = FAILED if mode < 0 else AT_REST if rests else MOVING
    if mode >= 0 and wants[TURNS] == 1:
        _differentiate(i, total, motion, mode, given.leaps, tangents, out.sections[i], out.jacobians[i])


@compiled(**OPTIONS)
def _begin(motion, opened, mode, total):
    """Set the state and forget the motion before; the mode in which time passes, -1 where there is none."""
    past = motion.past
    for k in range(motion.state.shape[0]):
        motion.state[k] = opened[k]
    for k in range(LAP):
        past.modes[k], past.exits[k], past.times[k], past.parts[k] = -1, -1, 0.0, 1
    for k in range(3):
        past.places[k] = 0
    return begin(motion.model.linear, mode, motion.state, total * motion.unit, 0.0, motion.work)


@compiled(**OPTIONS)
def _to(i, lap, until, motion, mode, clock, given, tangent, sums):
    """March to a lap and count; the mode there (-1: the march failed), that of the last piece, how long it lasted
    where nothing ended it, and the clock. `tangent` is (1, N), `sums` (ENTRIES,)."""
    model, pieces, marks, settled = motion.model, motion.pieces, motion.marks, given.wants[SETTLE]
    # without a period a lap is a unit of time, and the clock has none
    limit = Clock(float(until), 0.0, 0.0) if math.isfinite(model.period) else Clock(0.0, until * motion.unit, 0.0)
    outcome, events, last, lasted = FULL, 0.0, mode, 0.0
    while outcome == FULL:
        outcome, count, mode, clock = march(
            model, clock, motion.state, mode, limit, motion.past, pieces, motion.work, TIRELESS
        )
        events += _events(pieces.modes, count, given.look)
        if outcome != FULL and outcome != DONE:
            return -1, last, 0.0, clock
        # failed: outgrown the numbers, or more events than a motion has (chatter)
        if not math.isfinite(motion.state[0]) or events > BUDGET * (until - lap):
            return -1, last, 0.0, clock
        if count > 0:
            last, lasted = pieces.modes[count - 1], pieces.durations[count - 1] if pieces.exits[count - 1] < 0 else 0.0
        # count, then use the room again: what is asked must be had from the pieces now
        _count(i, count, motion, clock, settled, given, sums)
        if marks[0, SPAN] > 0.0 and outcome == FULL:
            clock = _skip(clock, marks, settled, until, sums)
        if given.wants[GROWTH] == 1:
            _carry(i, count, motion, mode, given.leaps, tangent)
    return mode, last, lasted, clock


@compiled(**OPTIONS)
def _events(modes, count, look):
    """How many of the changes of mode among pieces are events to the contact; others take a small part of one."""
    events = 0.0
    for p in range(count):
        m, before = modes[p], modes[p - 1] if p > 0 else -1
        silent = p > 0 and look.kinds[m] == look.kinds[before] and look.sides[m] == look.sides[before]
        events += SILENT if silent else 1.0
    return events


@compiled(**OPTIONS)
def _carry(i, count, motion, mode, leaps, tangents):
    """Carry small differences through the pieces just written."""
    linear, pieces = motion.model.linear, motion.pieces
    for p in range(count):
        set_tones(linear.tones, pieces.states[p], pieces.offsets[p], motion.model.period)
    written = Pieces(
        pieces.laps[:count],
        pieces.offsets[:count],
        pieces.modes[:count],
        pieces.durations[:count],
        pieces.states[:count],
        pieces.exits[:count],
    )
    carry_tangents(linear, leaps[i], written, mode, tangents, motion.work[7:16, : motion.state.shape[0]])


@compiled(**OPTIONS)
def _differentiate(i, total, motion, mode, leaps, tangents, section, jacobian):
    """The derivative of the motion over the laps after which it repeats, where it does."""
    physical, order, outcome = jacobian.shape[0], repeats(section), FULL
    for a in range(physical):
        for k in range(motion.state.shape[0]):
            tangents[a, k] = 1.0 if a == k else 0.0
    clock, limit = Clock(float(total), 0.0, 0.0), Clock(float(total + order), 0.0, 0.0)
    while outcome == FULL and order > 0:
        outcome, count, mode, clock = march(
            motion.model, clock, motion.state, mode, limit, motion.past, motion.pieces, motion.work, TIRELESS
        )
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
def _count(i, count, motion, clock, settled, given, sums):
    """Count the pieces just written, `count` of them, into `sums` (ENTRIES,); rows 6 to 11 of the march's work are free
    between two calls."""
    linear, period, state = motion.model.linear, motion.model.period, motion.state
    unit, pieces = motion.unit, motion.pieces
    look, paths, one = given.look, given.wants[PATHS] == 1, given.wants[ONE]
    n, tones = state.shape[0], linear.tones
    moving = motion.work[6, :n]
    if count == 0:
        return
    place, after, speed = _read(look.gap[i], pieces.states[0], tones, pieces.offsets[0]) if paths else 0.0, 0.0, 0.0
    for p in range(count):
        m, length, lap, offset = pieces.modes[p], pieces.durations[p], pieces.laps[p], pieces.offsets[p]
        # Mark: at the first event of the lap that is due.
        if lap >= motion.marks[0, NEXT]:
            _mark(lap, offset / period, m, pieces.states[p], tones, settled, sums, motion.marks)
        begun = (lap - settled) * period + offset if math.isfinite(period) else offset - settled * unit
        # Path: from where this piece begins to where the next one does, measured from the counter-face.
        last = p == count - 1
        x = state[0] if last else pieces.states[p + 1, 0]
        if paths:
            follows, then = (state, clock.time) if last else (pieces.states[p + 1], pieces.offsets[p + 1])
            after = _read(look.gap[i], follows, tones, then)
            speed = abs(_read(look.slip[i], pieces.states[p], tones, offset)) if look.kinds[m] == SLIP else 0.0
        # Note: events and durations.
        note(look.kinds[m], look.sides[m], begun, length, abs(after - place), speed, sums)
        # Measured time: a piece that began before it counts from its beginning on.
        if begun + length > 0.0:
            first, span = begun >= 0.0, min(length, begun + length)
            varies = look.works[m] == VARIES
            if look.inner[m] or varies or not first:
                for k in range(n):
                    moving[k] = pieces.states[p, k]
                set_tones(tones, moving, offset, period)
                if not first:
                    follow(linear, m, moving, -begun, motion.work[7:10, :n])
                    place = _read(look.gap[i], moving, tones, offset - begun)
            sums[REACH] = max(sums[REACH], abs(x), abs(pieces.states[p, 0] if first else moving[0]))
            # a constant friction works by the path alone; no quadrature is needed
            if look.works[m] == CONSTANT:
                sums[WORK] += look.friction[i, m, one] * (after - place)
            if look.inner[m] or varies:
                friction, slip = look.friction[i, m], look.slip[i]
                _inside(linear, m, moving, span, look.inner[m], varies, friction, slip, sums, motion.work)
        place = after


@compiled(**OPTIONS)
def _unmarked(marks, step):
    """Forget the motion before; without a step, none is looked for."""
    marks[0, NEXT], marks[0, BEGUN], marks[0, SPAN], marks[0, STEP] = 0.0 if step else math.inf, -1.0, 0.0, step
    for k in range(marks.shape[1]):
        marks[1, k] = 0.0


@compiled(**OPTIONS)
def _mark(lap, place, mode, state, tones, settled, sums, marks):
    """Tell at the first event of a lap whether the motion is where the mark is; after some steps, make another.

    `marks` is (4, ...): the mark, the largest size of each entry, the sums at the mark, and what a step adds to them.
    """
    here, size, before, gains = marks[0], marks[1], marks[2], marks[3]
    # a mark of before the measured time would count what is not measured
    fresh = here[BEGUN] < 0.0 or here[BEGUN] < settled <= lap
    again = not fresh and mode == here[MARK] and abs(place - here[PLACE]) <= STILL
    fresh = fresh or lap >= here[BEGUN] + STEPS * here[STEP]
    for k in range(state.shape[0]):
        # the phase of the drive is in `place` already
        turns = tones.shape[0] == 1 and (k == int(tones[0, 0]) or k == int(tones[0, 1]))
        size[k] = max(size[k], abs(state[k]))
        if not turns:
            again = again and abs(state[k] - here[MARK + 1 + k]) <= STILL * size[k]
            if fresh:
                here[MARK + 1 + k] = state[k]
    # Repeats: nothing more is looked for, and each such step adds the same to the sums.
    here[NEXT] = lap + here[STEP]
    if again:
        here[SPAN], here[NEXT] = lap - here[BEGUN], math.inf
        for k in range(ENTRIES):
            gains[k] = sums[k] - before[k]
    # Mark: where the motion is now, and what was counted up to here.
    elif fresh:
        here[PLACE], here[MARK], here[BEGUN] = place, mode, lap
        for k in range(ENTRIES):
            before[k] = sums[k]


@compiled(**OPTIONS)
def _skip(clock, marks, settled, until, sums):
    """Leave out the laps in which a motion repeats: all but the last that is not measured, or the last. The clock."""
    here, gains = marks[0], marks[3]
    span, measured = here[SPAN], here[BEGUN] >= settled
    end = until if measured else min(settled, until)
    times = max(0.0, math.floor((end - 1.0 - clock.laps) / span))
    if measured:
        for k in (NORMAL, ABNORMAL, HELD, SHORT, WORK):
            sums[k] += times * gains[k]
    here[BEGUN], here[NEXT], here[SPAN] = -1.0, end, 0.0
    return Clock(clock.laps + times * span, clock.time, clock.rest)


@compiled(**OPTIONS)
def _inside(linear, mode, moving, span, turns, varies, friction, slip, sums, work):
    """The farthest turn within a piece, and the work of a friction that changes in it, cell by cell.

    `moving` (N,) is the state at its beginning, carried to its end; `span` is in s, `friction` [N] and `slip` [m/s] are
    forms (N,) of the state.
    """
    flow, n = linear.flow[mode], moving.shape[0]
    scratch, here, tail = work[7:9, :n], work[9, :n], work[10, :n]
    # half a cell, half a radian of the fastest motion: a turn shows as a change of sign, and the power is smooth
    steps = 1 + int(2.0 * span / linear.cell[mode])
    step = span / steps
    for _ in range(steps):
        before, reached = moving[1], 0.0
        # Work: the power by the quadrature of Gauss and Legendre.
        if varies:
            for j in range(len(POINTS)):
                for k in range(n):
                    here[k], tail[k] = moving[k], 0.0
                advance(flow, here, tail, POINTS[j] * step, scratch)
                force, speed = 0.0, 0.0
                for k in range(n):
                    force += friction[k] * here[k]
                    speed += slip[k] * here[k]
                sums[WORK] += WEIGHTS[j] * step * force * speed
        for k in range(n):
            here[k], tail[k] = moving[k], 0.0
        advance(flow, here, tail, step, scratch)
        # Turn: the chord of the velocity, then Newton on it; the displacement is extreme there.
        if turns and before * here[1] < 0.0:
            near = step * before / (before - here[1])
            after, tip = here[1], work[11, :n]
            for _ in range(5):
                for k in range(n):
                    tip[k], tail[k] = moving[k], 0.0
                advance(flow, tip, tail, near, scratch)
                rate = 0.0
                for k in range(n):
                    rate += flow[1, k] * tip[k]
                if rate != 0.0:
                    near = min(step, max(0.0, near - tip[1] / rate))
                reached = max(reached, abs(tip[0]))
            here[1] = after
        # the seam too: a turn that falls on it changes no sign on either side
        sums[REACH] = max(sums[REACH], reached, abs(here[0]) if turns else 0.0)
        for k in range(n):
            moving[k] = here[k]


@compiled(**OPTIONS, nogil=True)
def watch_all(given, out, rooms, first, last):
    """One motion after another, from the first up to the last, in one scratch."""
    for i in range(first, last):
        watch_one(i, 0, given, out, rooms)
