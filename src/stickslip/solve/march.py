"""The march through a motion: Taylor steps, long implicit ones where they are worth it, and exits. No allocation."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from stickslip.arrays import Array, Index
from stickslip.compiled import compiled
from stickslip.solve.collocation import Stages, at, landing, leap
from stickslip.solve.roots import NOISE
from stickslip.solve.taylor import (
    EXACT,
    Step,
    advance,
    awake,
    coded,
    due,
    length,
    resolved,
    rise,
    set_tones,
    surely_below,
    turn,
    woken,
)

DONE, FULL, CHATTER, STALL, UNPROVED, STIFF, HALT = range(7)
CHAIN = 16  # most transitions without time between them
BRIEFEST = 1e-19  # of the time: a step below its rounding is one of many while a velocity falls to nothing
LEAP = 40.0  # Taylor steps that a leap replaces, at least half of them: it costs as much as about 40
PATIENCE = 256.0  # Taylor steps without event after which a leap is tried

# The clock: laps, time within the lap [s], the Taylor step to try [s], the leap to try [s] (0: none), the steps since
# the last event or failed leap, and how many of them call for the next leap.
LAPS, TIME, TRY, REACH, STEADY, DUE = range(6)


class Steps(NamedTuple):
    """Steps as they are written: start, length [s], mode, state at the start, exit (-1: none), number among the leaps
    (-1: a Taylor step)."""

    laps: Array
    offsets: Array
    lengths: Array
    modes: Index
    states: Array
    ends: NDArray[np.int16]
    leaps: Index


class Leaps(NamedTuple):
    """Leaps as they are written: their polynomials and the time that they span [s]."""

    polys: Array
    reach: Array


class Work(NamedTuple):
    """What a march writes on: the series of a step, the stages of a leap, and the leaps."""

    step: Step
    stages: Stages
    leaps: Leaps


class Dense(NamedTuple):
    """Steps as the state between them is read: where each begins [s], and what else :class:`Steps` says of it."""

    starts: Array
    lengths: Array
    modes: Index
    states: Array
    leaps: Index
    polys: Array
    reach: Array


class Shown(NamedTuple):
    """What values between the steps need: code of the series with its numbers, and of the outputs with theirs."""

    series: int
    numbers: Array
    outputs: int
    others: Array
    order: int


@compiled(**EXACT)
def _polish(model, node, mode, h, state, step):
    """Newton's step onto the zero of an exit that holds the drive: the delay [s], and the state at it.

    The step's series has the drive to the tolerance only; what follows a release must not hang on that.
    """
    series = coded(model.series)  # by itself: numba makes a type of functions of a tuple that holds one
    s, total, width = step.s, 0.0, step.order + 1
    for _ in range(2):
        series(model.numbers, mode, state, h, s)
        at, slope = s[width * node], s[width * node + 1]
        if not abs(at) <= 1e-2 * abs(slope):
            return total
        delay = -at / slope
        advance(s, step.order, delay, state)
        total += delay * h
    return total


@compiled(**EXACT)
def _rounds(model, node, mode, h, state, big, step):
    """Whether rounding of the state tells the sign of a node's rate: two modes may then send it to and fro."""
    series = coded(model.series)  # by itself, as above
    s = step.s
    at, before, change = node * (step.order + 1) + 1, step.before, 0.0
    series(model.numbers, mode, state, h, s)
    rate = s[at]
    for i in range(len(state)):
        before[i] = state[i]
    for i in range(len(state)):
        before[i] = state[i] + NOISE * big[i]
        series(model.numbers, mode, before, h, s)
        change += abs(s[at] - rate)
        before[i] = state[i]
    return abs(rate) <= change


@compiled(**EXACT, forceinline=True)
def _explicit(model, mode, h, u, big, ignored, step):
    """The Taylor step, shortened to where a function wakes or an exit ends the mode, and that exit (-1: none).

    A negative length: a root could neither be found nor excluded. `h` is the unit of the series [s], `u` and the length
    are in units of it; `big` (N,) is what each entry is measured by.
    """
    exits, guards, s, order, size = model.exits, model.guards, step.s, step.order, len(big)
    width, asleep, safe = order + 1, 4.0 - math.log(model.tolerance), max(NOISE, 1e3 * model.tolerance)
    leaving = -1
    # Wake: until then the series does not know of the function.
    for g in range(guards.first[mode], guards.first[mode + 1]):
        a = guards.argument[g] * width
        if not awake(guards.kind[g], s[a], asleep):
            u = resolved(s, a, order - 1, NOISE * abs(s[a]), u)  # its argument may be a function that ends sooner
            u = woken(guards.kind[g], a, u, asleep, step)
            if u < 0.0:
                return u, leaving
    for e in range(exits.first[mode], exits.first[mode + 1]):
        if e == ignored:
            continue
        i, factor = exits.node[e], exits.factor[e]
        # Exit: most are shown by their coefficients alone to stay below zero.
        far = i < size and factor * s[i * width] < -abs(factor) * safe * big[i]
        if far and surely_below(s, i * width, order, factor, 0.0, u):
            continue
        # no farther than its own series is resolved; a step that is cut no longer reaches an exit beyond
        top = order if i < size else order - 1
        clear = resolved(s, i * width, top, NOISE * (big[i] if i < size else abs(s[i * width])), u)
        leaving, u = leaving if clear == u else -1, clear
        when = rise(model.sums, exits, e, mode, h, u, big, step)
        if when < u or (when == u and leaving < 0):
            leaving, u = e, when
            if u <= 0.0:
                break
    return u, leaving


@compiled(**EXACT)
def remaining_of(clock, until, period):
    """Time [s] to an end (laps, time)."""
    remaining = until[1] - clock[TIME]
    if until[0] != clock[LAPS]:
        remaining += (until[0] - clock[LAPS]) * period
    return remaining


@compiled(**EXACT)
def _arrived(clock, until, model, remaining, ahead, leaving, state):
    """The clock after a step; whole periods count as laps.

    The tones are turned from step to step: a release must find them as they were a moment before, to rounding. Each
    lap sets them anew, so that they gather no error of the steps. `until` is (laps, time [s]); `remaining` and `ahead`
    are in s.
    """
    laps, period = clock[LAPS], model.period
    if leaving < 0 and ahead >= remaining:
        # the end itself, not a sum that rounds
        clock[LAPS], clock[TIME] = until[0], until[1]
    else:
        clock[TIME] += ahead
    while clock[TIME] >= period:
        clock[LAPS] += 1.0
        clock[TIME] -= period
    if clock[LAPS] != laps:
        set_tones(model.tones, clock[TIME], state)


@compiled(**EXACT)
def write(steps, row, clock, state, mode, ahead, leaving, which):
    """Put a step down."""
    steps.laps[row], steps.offsets[row], steps.lengths[row] = clock[LAPS], clock[TIME], ahead
    steps.modes[row], steps.ends[row], steps.leaps[row] = mode, leaving, which
    for i in range(len(state)):
        steps.states[row, i] = state[i]


@compiled(**EXACT)
def passed(model, clock, until, remaining, ahead, leaving, before, state, big):
    """What else a step changes: the drive's tones since the state before, the largest values, and the clock."""
    turn(model.tones, before, ahead, state)
    for i in range(len(state)):
        big[i] = max(big[i], abs(state[i]))
    _arrived(clock, until, model, remaining, ahead, leaving, state)


@compiled(**EXACT)
def _carry_over(reset, state, before):
    """The state behind an exit; `before` is scratch."""
    for i in range(len(state)):
        before[i] = state[i]
    for i in range(len(state)):
        total = 0.0
        for j in range(len(state)):
            total += reset[i, j] * before[j]
        state[i] = total


@compiled(**EXACT)
def _left(model, clock, state, mode, h, leaving, ahead, steps, row, step):
    """Leave a mode by an exit, after a step in units of h in the row before: the mode behind it."""
    exits = model.exits
    if exits.polished[leaving] and ahead > 0.0:
        delay = _polish(model, exits.node[leaving], mode, h, state, step)
        steps.lengths[row - 1] += delay
        clock[TIME] += delay
    if exits.carried[leaving]:
        _carry_over(exits.reset[leaving], state, step.before)
    clock[REACH], clock[STEADY] = 0.0, 0.0
    return exits.target[leaving]


@compiled(**EXACT)
def march(model, clock, state, big, mode, until, steps, row, step):
    """Taylor steps from `clock` to `until` (laps, time), written from a row on: the outcome, the row behind them, the
    mode. STIFF where after many steps without event a leap is due, see :func:`strides`; HALT where an exit leads to no
    mode (a negative number): what follows is no linear form of the state, and whoever marches goes on from there."""
    series, exits, chain = coded(model.series), model.exits, 0
    ignored = -1
    while True:
        # Due: what is left, the series of a step, and how far it holds.
        remaining = remaining_of(clock, until, model.period)
        if remaining <= 4e-16 * (clock[TIME] + clock[TRY]):
            return DONE, row, mode
        h = clock[TRY]
        series(model.numbers, mode, state, h, step.s)
        full = length(step.s, step.order, big, model.tolerance)
        while math.isnan(full) and h > BRIEFEST * (clock[TIME] + 1e-300):
            h *= 1e-3  # the coefficients outgrow the numbers where the step before was far longer than this one can be
            series(model.numbers, mode, state, h, step.s)
            full = length(step.s, step.order, big, model.tolerance)
        stalled = not (full * h > BRIEFEST * (clock[TIME] + 1e-300)) or full <= 0.0
        leaving = due(model.sums, exits, mode, h, big, step) if stalled else -1
        if stalled and leaving < 0:
            return STALL, row, mode
        clock[TRY] = clock[TRY] if stalled else h  # a mode that is left at once tells nothing of the next one's steps
        if row == len(steps.laps):
            return FULL, row, mode
        # Certify: to the first exit at the most.
        ahead = 0.0
        if leaving < 0:
            if clock[STEADY] >= clock[DUE]:
                return STIFF, row, mode
            u, leaving = _explicit(model, mode, h, min(full, remaining / h), big, ignored, step)
            if u < 0.0:
                return UNPROVED, row, mode
            ahead = u * h
            clock[STEADY] += 1.0
        # Step: write it down and carry the state on.
        if ahead > 0.0:
            chain, ignored = 0, -1
            write(steps, row, clock, state, mode, ahead, leaving, -1)
            advance(step.s, step.order, ahead / h, state)
            clock[TRY] = full * h
            passed(model, clock, until, remaining, ahead, leaving, steps.states[row], state, big)
            row += 1
        else:
            chain += 1
            if 2 * chain > CHAIN and _rounds(model, exits.node[leaving], mode, h, state, big, step):
                ignored = leaving  # a motion that dies out: either mode is as good
                continue
            if row > 0 and steps.ends[row - 1] < 0:
                steps.ends[row - 1] = leaving
            if chain > CHAIN:
                return CHATTER, row, mode
        if leaving >= 0:
            mode = _left(model, clock, state, mode, h, leaving, ahead, steps, row, step)
            if mode < 0:
                return HALT, row, mode


@compiled(**EXACT)
def _attempt(implicit, clock, state, big, mode, remaining, poly, work):
    """Try a leap: how far its polynomials reach [s], how far they are followed (0: it failed), and to which exit.

    The clock takes what to try next, and when: whatever made a leap fail, a Taylor step brings the march on. `state`
    and `big` are (N,), `remaining` is in s, `poly` (N, WIDTH).
    """
    # Reach: as the leap before foretold; the first, as far as the Taylor steps that it costs.
    h, full = clock[TRY], length(work.step.s, work.step.order, big, implicit.model.tolerance)
    clock[REACH] = LEAP * full * h if clock[REACH] == 0.0 else clock[REACH]
    reach, ahead, leaving = min(clock[REACH], remaining), 0.0, -1
    grow = leap(implicit, mode, h, state, big, reach, poly, work)
    # Accept: the error is the tolerance where `growth` leaves its tenth for safety.
    if grow >= 0.9:
        w, leaving = landing(implicit, mode, big, work)
        ahead = 0.5 * (w + 1.0) * reach
        if ahead > 0.0:
            clock[DUE] = PATIENCE
    # Next: one cut short by the end of the time tells nothing, unless it failed.
    if not grow >= 0.9 or reach == clock[REACH]:
        clock[REACH] = reach * max(grow, 0.2)
    # Given up: an exit too near, or no longer than half of what it costs; tried again ever more seldom.
    if ahead == 0.0 and (grow >= 0.9 or clock[REACH] < 0.5 * LEAP * full * h):
        clock[REACH], clock[STEADY], clock[DUE] = 0.0, 0.0, min(2.0 * clock[DUE], 64.0 * PATIENCE)
    elif ahead == 0.0:
        # shorter, after one Taylor step
        clock[STEADY] = clock[DUE] - 1.0
    return reach, ahead, leaving


@compiled(**EXACT)
def strides(implicit, clock, state, big, mode, until, steps, row, leapt, work):
    """As :func:`march`, with a leap where one is due, if it can be: also the number behind those written, `leapt`."""
    model, leaps = implicit.model, work.leaps
    while True:
        # Taylor steps, until a leap is due.
        outcome, row, mode = march(model, clock, state, big, mode, until, steps, row, work.step)
        if outcome != STIFF:
            return outcome, row, leapt, mode
        if leapt == len(leaps.polys):
            return FULL, row, leapt, mode
        # Leap: tried, and where it comes to nothing a Taylor step is next.
        h, remaining, poly = clock[TRY], remaining_of(clock, until, model.period), leaps.polys[leapt]
        reach, ahead, leaving = _attempt(implicit, clock, state, big, mode, remaining, poly, work)
        if ahead > 0.0:
            write(steps, row, clock, state, mode, ahead, leaving, leapt)
            for i in range(len(state)):
                state[i] = at(poly[i], 2.0 * ahead / reach - 1.0)
            leaps.reach[leapt] = reach
            # the Taylor step to come: a leap leaves the series of before as it was
            clock[TRY] = h * length(work.step.s, work.step.order, big, model.tolerance)
            passed(model, clock, until, remaining, ahead, leaving, steps.states[row], state, big)
            row, leapt = row + 1, leapt + 1
            if leaving >= 0:
                mode = _left(model, clock, state, mode, h, leaving, ahead, steps, row, work.step)
                if mode < 0:
                    return HALT, row, leapt, mode


@compiled(**EXACT)
def course(implicit, clock, state, big, mode, stops, stop, longest, steps, work):
    """As :func:`strides`, on the way to stop `stop` of several (:class:`~stickslip.solve.tables.Stops`) and to those
    behind it; returns also the stop that it is on its way to. A Taylor step is at most `longest` [s] to begin with: at
    rest steps would grow for ever."""
    row, leapt = 0, 0
    while True:
        until = (stops.ends[stop, 0], stops.ends[stop, 1])
        outcome, row, leapt, mode = strides(implicit, clock, state, big, mode, until, steps, row, leapt, work)
        if outcome != DONE or stop + 1 == stops.ends.shape[0]:
            return outcome, row, leapt, mode, stop
        stop += 1
        for j in range(stops.places.shape[0]):
            state[stops.places[j]] = stops.values[stop, j]
        clock[TRY] = min(clock[TRY], longest)


@compiled(**EXACT)
def rests(series, numbers, mode, state, step):
    """Whether nothing moves."""
    code = coded(series)
    code(numbers, mode, state, 1.0, step.s)
    most = 0.0
    for i in range(len(state)):
        most = max(most, abs(step.s[i * (step.order + 1) + 1]))
    return most == 0.0


@compiled(**EXACT)
def sample(shown, steps, times, nodes, plain, out, row, work):
    """Values of nodes (M, R), by mode, at increasing times (T,) [s] to `out` (R, T), and the step that each falls in to
    `row` (T,); `plain` where all nodes are entries of the state, so that nothing else need be worked out. `work` has a
    series, a state and the outputs."""
    series = coded(shown.series)
    outputs = coded(shown.outputs)
    s, state, values = work
    j, known = 0, -1
    for t in range(len(times)):
        # Step: the one that the instant falls in; rounding may put it before the first.
        while j + 1 < len(steps.starts) and steps.starts[j + 1] <= times[t]:
            j += 1
        row[t] = j
        h, mode = steps.lengths[j], steps.modes[j]
        passed = max(0.0, times[t] - steps.starts[j])
        # State: by the polynomial of a leap, or by a series worked out once a step.
        if steps.leaps[j] >= 0:
            poly, whole = steps.polys[steps.leaps[j]], steps.reach[steps.leaps[j]]
            for i in range(len(state)):
                state[i] = at(poly[i], 2.0 * min(h, passed) / whole - 1.0)
        else:
            if known != j:
                series(shown.numbers, mode, steps.states[j], h, s)
                known = j
            advance(s, shown.order, min(1.0, passed / h), state)
        # Outputs.
        if plain:
            for r in range(nodes.shape[1]):
                out[r, t] = state[nodes[mode, r]]
            continue
        outputs(shown.others, mode, state, 1.0, values)
        for r in range(nodes.shape[1]):
            out[r, t] = values[nodes[mode, r]]
