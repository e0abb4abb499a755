"""The march through a motion: Taylor steps, long implicit ones where they are worth it, and exits. No allocation."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from stickslip.compiled import compiled
from stickslip.solve.collocation import at, landing, leap
from stickslip.solve.roots import NOISE
from stickslip.solve.taylor import (
    EXACT,
    Array,
    advance,
    awake,
    coded,
    length,
    resolved,
    rise,
    set_tones,
    surely_below,
    woken,
)

DONE, FULL, CHATTER, STALL, UNPROVED = range(5)
CHAIN = 16  # most transitions without time between them
LEAP = 40.0  # Taylor steps that a leap replaces, at least half of them: it costs as much as about 40
PATIENCE = 256.0  # Taylor steps without event after which a leap is tried
# what a clock holds: laps, offset [s], the length of the Taylor step to try [s], that of the leap to try [s] (0: none),
# the steps since the last event or failed leap, and how many of them call for the next
LAPS, OFFSET, TAYLOR, LONG, SINCE, CALL = range(6)


class Steps(NamedTuple):
    """Room for steps: laps, offset, length, mode, state, exit (-1: none), number among the leaps (-1: none)."""

    laps: Array
    offsets: Array
    lengths: Array
    modes: NDArray[np.int64]
    states: Array
    ends: NDArray[np.int16]
    leaps: NDArray[np.int64]

    def part(self, begin: int, end: int) -> Steps:
        """Some of them."""
        return Steps(self.laps[begin:end], self.offsets[begin:end], self.lengths[begin:end], self.modes[begin:end],
                     self.states[begin:end], self.ends[begin:end], self.leaps[begin:end])  # fmt: skip


class Leaps(NamedTuple):
    """Room for leaps: the state as polynomials of w, and the time from w = -1 to w = 1."""

    polys: Array
    reach: Array


@compiled(**EXACT)
def _polish(series, curve, e, mode, h, time, state, s):
    """Newton's step onto the zero of an exit that holds the drive: the delay [s], and the state at it.

    The step's series has the drive to the tolerance only; what follows a release must not hang on that.
    """
    total, width, node = 0.0, curve.order + 1, curve.exits.node[e]
    for _ in range(2):
        set_tones(curve.tones, time + total, state)
        series(curve.numbers, mode, state, h, s)
        here, slope = s[width * node], s[width * node + 1]
        if not abs(here) <= 1e-2 * abs(slope):
            return total
        delay = -here / slope
        advance(s, width, len(state), curve.order, delay, state)
        total += delay * h
    return total


@compiled(**EXACT, forceinline=True)
def _explicit(curve, mode, h, u, work):
    """The Taylor step, shortened to where a function wakes or an exit ends the mode, and that exit (-1: none).

    A negative length: a root could neither be found nor excluded.
    """
    s, big, order, size = work.s, work.big, curve.order, len(work.big)
    width, asleep = order + 1, 4.0 - math.log(curve.tolerance)
    exits, guards, leaving = curve.exits, curve.guards, -1
    for g in range(guards.first[mode], guards.first[mode + 1]):
        a = guards.argument[g] * width
        if not awake(guards.kind[g], s[a], asleep):
            u = woken(guards.kind[g], s, a, order, u, asleep, work.c, work.noise)
            if u < 0.0:
                return u, leaving
    safe = max(NOISE, 1e3 * curve.tolerance)
    for e in range(exits.first[mode], exits.first[mode + 1]):
        i, scale = exits.node[e], exits.scale[e]
        far = i < size and scale * s[i * width] < -abs(scale) * safe * big[i]
        if far and surely_below(s, i * width, order, scale, 0.0, u):
            continue
        top = order if i < size else order - 1
        clear = resolved(s, i * width, top, NOISE * (big[i] if i < size else abs(s[i * width])), u)
        leaving, u = leaving if clear == u else -1, clear
        when = rise(curve, mode, e, h, u, work)
        if when < u or (when == u and leaving < 0):
            leaving, u = e, when
            if u <= 0.0:
                break
    return u, leaving


@compiled(**EXACT)
def _leapt(rates, curve, mode, clock, state, taylor, remaining, poly, work):
    """Try a leap, where a Taylor step would be `taylor` long: its length [s] (0: none), its reach, and the exit."""
    least = LEAP * taylor
    clock[LONG] = least if clock[LONG] == 0.0 else clock[LONG]
    attempt, step, leaving = min(clock[LONG], remaining), 0.0, -1
    grow = leap(rates, curve, mode, clock[OFFSET], state, attempt, clock[TAYLOR], poly, work)
    if grow >= 0.9:
        w, leaving = landing(curve, mode, 4.0 - math.log(curve.tolerance), work)
        step = 0.5 * (w + 1.0) * attempt
        if step > 0.0:
            clock[CALL] = PATIENCE
    if grow < 0.9 or attempt == clock[LONG]:
        clock[LONG] = attempt * max(grow, 0.2)
    if step == 0.0 and (grow >= 0.9 or clock[LONG] < 0.5 * least):
        # not worth its cost: Taylor steps, and twice as many before the next is tried
        clock[LONG], clock[SINCE], clock[CALL] = 0.0, 0.0, min(2.0 * clock[CALL], 64.0 * PATIENCE)
    return step, attempt, leaving


@compiled(**EXACT)
def _arrived(clock, until, period, remaining, step, leaving):
    """The clock after a step; whole periods count as laps."""
    if leaving < 0 and step >= remaining:
        clock[LAPS], clock[OFFSET] = until[0], until[1]
    else:
        clock[OFFSET] += step
    while clock[OFFSET] >= period:
        clock[LAPS] += 1.0
        clock[OFFSET] -= period


@compiled(**EXACT)
def _write(steps, j, clock, mode, state, step, leaving, which):
    """Write a step down."""
    steps.laps[j], steps.offsets[j], steps.lengths[j] = clock[LAPS], clock[OFFSET], step
    steps.modes[j], steps.ends[j], steps.leaps[j] = mode, leaving, which
    for i in range(len(state)):
        steps.states[j, i] = state[i]


@compiled(**EXACT)
def _hold(curve, time, state):
    """Give the mass the counter-face's velocity."""
    set_tones(curve.tones, time, state)
    speed = 0.0
    for i in range(len(state)):
        speed += curve.exits.face[i] * state[i]
    state[1] = speed


@compiled(**EXACT)
def march(curve, clock, state, mode, until, steps, leaps, work):
    """Steps from `clock` to `until` (laps, offset): the outcome, the steps written, the leaps among them, the mode."""
    series, rates = coded(curve.series), coded(curve.rates)
    exits, order = curve.exits, curve.order
    s, big, size, width = work.s, work.big, len(state), order + 1
    written, chain, leapt = 0, 0, 0
    while True:
        remaining = until[1] - clock[OFFSET]
        if until[0] != clock[LAPS]:
            remaining += (until[0] - clock[LAPS]) * curve.period
        if remaining <= 4e-16 * (clock[OFFSET] + clock[TAYLOR]):
            return DONE, written, leapt, mode
        set_tones(curve.tones, clock[OFFSET], state)
        h = clock[TAYLOR]
        series(curve.numbers, mode, state, h, s)
        full = length(s, width, order, size, curve.tolerance, big)
        if not (full * h > 1e-15 * (clock[OFFSET] + 1e-300)) or full <= 0.0:
            return STALL, written, leapt, mode
        if written == len(steps.laps) or leapt == len(leaps.polys):
            return FULL, written, leapt, mode
        which, reach = -1, 0.0
        if clock[SINCE] >= clock[CALL]:
            step, reach, leaving = _leapt(
                rates, curve, mode, clock, state, full * h, remaining, leaps.polys[leapt], work
            )
            if step == 0.0:
                continue
            which = leapt
            leapt += 1
        else:
            u, leaving = _explicit(curve, mode, h, min(full, remaining / h), work)
            if u < 0.0:
                return UNPROVED, written, leapt, mode
            step = u * h
            clock[SINCE] += 1.0
        if step > 0.0:
            chain = 0
            _write(steps, written, clock, mode, state, step, leaving, which)
            written += 1
            if which < 0:
                advance(s, width, size, order, step / h, state)
            else:
                for i in range(size):
                    state[i] = at(leaps.polys[which, i], 2.0 * step / reach - 1.0)
                leaps.reach[which] = reach
            for i in range(size):
                big[i] = max(big[i], abs(state[i]))
            clock[TAYLOR] = full * h
            _arrived(clock, until, curve.period, remaining, step, leaving)
        else:
            if written > 0 and steps.ends[written - 1] < 0:
                steps.ends[written - 1] = leaving
            chain += 1
            if chain > CHAIN:
                return CHATTER, written, leapt, mode
        if leaving >= 0:
            if step > 0.0 and not exits.held[leaving]:
                delay = _polish(series, curve, leaving, mode, h, clock[OFFSET], state, s)
                steps.lengths[written - 1] += delay
                clock[OFFSET] += delay
            if exits.held[leaving]:
                _hold(curve, clock[OFFSET], state)
            mode = exits.target[leaving]
            clock[LONG], clock[SINCE] = 0.0, 0.0


@compiled(**EXACT)
def rests(curve, mode, state, s):
    """Whether nothing moves."""
    series = coded(curve.series)
    series(curve.numbers, mode, state, 1.0, s)
    most = 0.0
    for i in range(len(state)):
        most = max(most, abs(s[i * (curve.order + 1) + 1]))
    return most == 0.0


class View(NamedTuple):
    """What values between the steps need: code and its constants of the series and of the outputs, and the degree."""

    series: int
    numbers: Array
    outputs: int
    others: Array
    order: int


@compiled(**EXACT)
def sample(view, starts, steps, leaps, times, nodes, out, step, work):
    """Values of nodes (by mode) at increasing times, from the step each one falls in.

    `starts` are those of the steps [s], `work` room for the series, a state and the values of the outputs.
    """
    series, outputs = coded(view.series), coded(view.outputs)
    s, state, values = work
    order = view.order
    j, known = 0, -1
    for t in range(len(times)):
        while j + 1 < len(starts) and starts[j + 1] <= times[t]:
            j += 1
        step[t] = j
        h, mode, which = steps.lengths[j], steps.modes[j], steps.leaps[j]
        passed = max(0.0, times[t] - starts[j])
        if which >= 0:
            for i in range(len(state)):
                state[i] = at(leaps.polys[which, i], 2.0 * min(h, passed) / leaps.reach[which] - 1.0)
        else:
            if known != j:
                series(view.numbers, mode, steps.states[j], h, s)
                known = j
            advance(s, order + 1, len(state), order, min(1.0, passed / h), state)
        outputs(view.others, mode, state, 1.0, values)
        for r in range(nodes.shape[1]):
            out[r, t] = values[nodes[mode, r]]
