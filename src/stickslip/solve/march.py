"""The march through a motion: Taylor steps, long implicit ones where they are worth it, and exits. No allocation."""

from __future__ import annotations

import math

from stickslip.compiled import compiled
from stickslip.solve.collocation import at, landing, leap
from stickslip.solve.roots import NOISE
from stickslip.solve.taylor import (
    EXACT,
    advance,
    awake,
    coded,
    length,
    resolved,
    rise,
    set_tones,
    surely_below,
    woken,
)  # fmt: skip

DONE, FULL, CHATTER, STALL, UNPROVED = range(5)
CHAIN = 16  # most transitions without time between them
LEAP = 40.0  # Taylor steps that a leap replaces, at least half of them: it costs as much as about 40
PATIENCE = 256.0  # Taylor steps without event after which a leap is tried


@compiled(**EXACT)
def _polish(series, numbers, node, tones, mode, h, time, state, order, s):
    """Newton's step onto the zero of an exit that holds the drive: the delay [s], and the state at it.

    The step's series has the drive to the tolerance only; what follows a release must not hang on that.
    """
    total, width = 0.0, order + 1
    for _ in range(2):
        set_tones(tones, time + total, state)
        series(numbers, mode, state, h, s)
        at, slope = s[width * node], s[width * node + 1]
        if not abs(at) <= 1e-2 * abs(slope):
            return total
        delay = -at / slope
        advance(s, width, len(state), order, delay, state)
        total += delay * h
    return total


@compiled(**EXACT, forceinline=True)
def _explicit(sums, exits, guards, mode, size, h, u, order, big, tolerance, s, c, noise):
    """The Taylor step, shortened to where a function wakes or an exit ends the mode, and that exit (-1: none).

    A negative length: a root could neither be found nor excluded.
    """
    width, asleep, safe = order + 1, 4.0 - math.log(tolerance), max(NOISE, 1e3 * tolerance)
    node, _, crossing, _, bound, _, scale = exits
    kind, argument, mind = guards
    rows, leaving = len(sums[3]) - len(node), -1
    for g in range(mind[mode], mind[mode + 1]):
        a = argument[g] * width
        if not awake(kind[g], s[a], asleep):
            u = woken(kind[g], s, a, order, u, asleep, c, noise)
            if u < 0.0:
                return u, leaving
    for e in range(bound[mode], bound[mode + 1]):
        i = node[e]
        far = i < size and scale[e] * s[i * width] < -abs(scale[e]) * safe * big[i]
        if far and surely_below(s, i * width, order, scale[e], 0.0, u):
            continue
        top = order if i < size else order - 1
        clear = resolved(s, i * width, top, NOISE * (big[i] if i < size else abs(s[i * width])), u)
        leaving, u = leaving if clear == u else -1, clear
        when = rise(sums, rows + e, mode * size, crossing[e], i, scale[e], size, h, u, order, width, big, s, c, noise)
        if when < u or (when == u and leaving < 0):
            leaving, u = e, when
            if u <= 0.0:
                break
    return u, leaving


@compiled(**EXACT)
def _arrived(clock, until, period, remaining, step, leaving):
    """The clock after a step; whole periods count as laps."""
    if leaving < 0 and step >= remaining:
        clock[0], clock[1] = until[0], until[1]
    else:
        clock[1] += step
    while clock[1] >= period:
        clock[0] += 1.0
        clock[1] -= period


@compiled(**EXACT)
def march(
    series,
    numbers,
    rates,
    scheme,
    sums,
    exits,
    guards,
    tones,
    clock,
    state,
    mode,
    until,
    period,
    physical,
    tolerance,
    order,
    big,
    steps,
    polys,
    reach,
    work,
    long_work,
):
    """Steps from `clock` to `until` (laps, offset): the outcome, the steps written, the leaps among them, the mode.

    `clock` holds laps, offset [s], the length of the Taylor step to try [s], that of the leap to try [s] (0: none), the
    steps since the last event or failed leap, and how many of them call for the next.
    """
    laps, offsets, lengths, modes, states, ends, leaps = steps
    series, rates = coded(series), coded(rates)
    s, c, noise = work
    node, target, _, held, _, face, _ = exits
    size, room, written, chain, leapt, width = len(state), len(laps), 0, 0, 0, order + 1
    while True:
        remaining = until[1] - clock[1]
        if until[0] != clock[0]:
            remaining += (until[0] - clock[0]) * period
        if remaining <= 4e-16 * (clock[1] + clock[2]):
            return DONE, written, leapt, mode
        set_tones(tones, clock[1], state)
        h = clock[2]
        series(numbers, mode, state, h, s)
        full = length(s, width, order, size, tolerance, big)
        if not (full * h > 1e-15 * (clock[1] + 1e-300)) or full <= 0.0:
            return STALL, written, leapt, mode
        if written == room or leapt == len(polys):
            return FULL, written, leapt, mode
        step, leaving, which = 0.0, -1, -1
        if clock[4] >= clock[5]:
            clock[3] = LEAP * full * h if clock[3] == 0.0 else clock[3]
            attempt = min(clock[3], remaining)
            poly = polys[leapt]
            grow = leap(
                rates, numbers, scheme, tones, face, mode, clock[1], state, attempt, h, s, width, physical, big,
                tolerance, poly, long_work,
            )  # fmt: skip
            if grow >= 0.9:
                asleep = 4.0 - math.log(tolerance)
                w, leaving = landing(mode, exits, guards, scheme, s, width, size, big, asleep, long_work, c, noise)
                step = 0.5 * (w + 1.0) * attempt
                if step > 0.0:
                    which = leapt
                    leapt += 1
                    clock[5] = PATIENCE
            if grow < 0.9 or attempt == clock[3]:
                clock[3] = attempt * max(grow, 0.2)
            if step == 0.0 and (grow >= 0.9 or clock[3] < 0.5 * LEAP * full * h):
                clock[3], clock[4], clock[5] = 0.0, 0.0, min(2.0 * clock[5], 64.0 * PATIENCE)
            if step == 0.0:
                continue
        else:
            u, leaving = _explicit(
                sums, exits, guards, mode, size, h, min(full, remaining / h), order, big, tolerance, s, c, noise
            )
            if u < 0.0:
                return UNPROVED, written, leapt, mode
            step = u * h
            clock[4] += 1.0
        if step > 0.0:
            chain = 0
            laps[written], offsets[written], lengths[written] = clock[0], clock[1], step
            modes[written], ends[written], leaps[written] = mode, leaving, which
            for i in range(size):
                states[written, i] = state[i]
            written += 1
            if which < 0:
                advance(s, width, size, order, step / h, state)
            else:
                for i in range(size):
                    state[i] = at(polys[which, i], 2.0 * step / attempt - 1.0)
                reach[which] = attempt
            for i in range(size):
                big[i] = max(big[i], abs(state[i]))
            clock[2] = full * h
            _arrived(clock, until, period, remaining, step, leaving)
        else:
            if written > 0 and ends[written - 1] < 0:
                ends[written - 1] = leaving
            chain += 1
            if chain > CHAIN:
                return CHATTER, written, leapt, mode
        if leaving >= 0:
            if step > 0.0 and not held[leaving]:
                delay = _polish(series, numbers, node[leaving], tones, mode, h, clock[1], state, order, s)
                lengths[written - 1] += delay
                clock[1] += delay
            if held[leaving]:
                set_tones(tones, clock[1], state)
                speed = 0.0
                for i in range(size):
                    speed += face[i] * state[i]
                state[1] = speed
            mode = target[leaving]
            clock[3], clock[4] = 0.0, 0.0


@compiled(**EXACT)
def rests(series, numbers, mode, state, order, s):
    """Whether nothing moves."""
    series = coded(series)
    series(numbers, mode, state, 1.0, s)
    most = 0.0
    for i in range(len(state)):
        most = max(most, abs(s[i * (order + 1) + 1]))
    return most == 0.0


@compiled(**EXACT)
def sample(
    series,
    numbers,
    outputs,
    others,
    order,
    starts,
    lengths,
    modes,
    states,
    leaps,
    polys,
    reach,
    times,
    nodes,
    out,
    step,
    work,
):
    """Values of nodes (by mode) at increasing times, from the step each one falls in."""
    series, outputs = coded(series), coded(outputs)
    s, state, values = work
    j, known, width = 0, -1, order + 1
    for t in range(len(times)):
        while j + 1 < len(starts) and starts[j + 1] <= times[t]:
            j += 1
        step[t] = j
        h, mode = lengths[j], modes[j]
        passed = max(0.0, times[t] - starts[j])
        if leaps[j] >= 0:
            poly, whole = polys[leaps[j]], reach[leaps[j]]
            for i in range(len(state)):
                state[i] = at(poly[i], 2.0 * min(h, passed) / whole - 1.0)
        else:
            if known != j:
                series(numbers, mode, states[j], h, s)
                known = j
            advance(s, width, len(state), order, min(1.0, passed / h), state)
        outputs(others, mode, state, 1.0, values)
        for r in range(nodes.shape[1]):
            out[r, t] = values[nodes[mode, r]]
