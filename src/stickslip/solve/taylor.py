"""Taylor steps along any tape of operations, and the march through exits: compiled, without allocation.

A tape is a list of nodes; node j is a function of earlier ones (Jorba and Zou, Experimental Mathematics 14, 2005).
Its first nodes are the entries of the state, whose coefficient k + 1 is the coefficient k of their rate over k + 1.
Time is measured in the last step's length h, so that coefficients neither grow nor vanish with the order.

Exits are polynomials of the same series: their first root in a step is found with the certificate of `roots`, so that
two crossings within one step are two.
"""

from __future__ import annotations

import math

from stickslip.compiled import compiled
from stickslip.solve.roots import NOISE, NONE, first_rise

OPTIONS = {"error_model": "numpy", "fastmath": {"contract"}}
EXACT = {"error_model": "numpy"}

LINEAR, PRODUCT, SQUARE, QUOTIENT, POWER, EXP, TANH, SLOPE, LOG, ASINH = range(10)
DONE, FULL, CHATTER, STALL = range(4)
GROWTH = 6.0  # longest step in units of the one before
CHAIN = 16  # most transitions without time between them
STILL = 1e-10  # a power's base below this is zero: there the power is not analytic


@compiled(**OPTIONS)
def _value(kind, at, power):
    """A function's value, the coefficient of order 0."""
    if kind == EXP:
        return math.exp(at)
    if kind == TANH:
        return math.tanh(at)
    if kind == SLOPE:  # of tanh: 1 - tanh^2 without its cancellation
        fall = math.exp(-2.0 * abs(at))
        return 4.0 * fall / (1.0 + fall) ** 2
    if kind == LOG:
        return math.log(at) if at > 0.0 else math.nan
    if kind == ASINH:
        return math.asinh(at)
    return at**power if at > STILL else (0.0 if power > 0.0 else math.nan)


@compiled(**OPTIONS)
def expand(tape, mode, state, h, order, width, s):
    """Coefficients 0 .. order of every node in a mode; the state's rows are complete, the others lack the last.

    With order 0 all nodes are evaluated. Row j of the series starts at ``s[j * width]``: views would cost more than
    the arithmetic.
    """
    kinds, left, right, power, low, weight, index, constant, first, rate, factor = tape
    size = len(state)
    begin = first[mode]
    count = first[mode + 1] - begin
    for i in range(size):
        s[i * width] = state[i]
    for k in range(order + 1):
        if k > 0:
            step = h / k
            for i in range(size):
                r = rate[mode, i]
                s[i * width + k] = s[r * width + k - 1] * (step * factor[mode, i]) if r >= 0 else 0.0
            if k == order:
                return
        for j in range(size, count):
            g = begin + j
            kind = kinds[g]
            a = left[g] * width
            b = right[g] * width
            out = j * width
            total = 0.0
            if kind == LINEAR:
                if k == 0:
                    total = constant[g]
                for t in range(low[g], low[g + 1]):
                    total += weight[t] * s[index[t] * width + k]
                s[out + k] = total
            elif kind == PRODUCT:
                for i in range(k + 1):
                    total += s[a + i] * s[b + k - i]
                s[out + k] = total
            elif kind == SQUARE:
                for i in range((k + 1) // 2):
                    total += s[a + i] * s[a + k - i]
                total *= 2.0
                if k % 2 == 0:
                    total += s[a + k // 2] * s[a + k // 2]
                s[out + k] = total
            elif kind == QUOTIENT:
                for i in range(k):
                    total += s[out + i] * s[b + k - i]
                s[out + k] = (s[a + k] - total) / s[b]
            elif k == 0:
                s[out] = _value(kind, s[a], power[g])
            elif kind == EXP:
                for i in range(1, k + 1):
                    total += i * s[a + i] * s[out + k - i]
                s[out + k] = total / k
            elif kind == TANH:
                for i in range(1, k + 1):
                    total += i * s[a + i] * s[b + k - i]
                s[out + k] = total / k
            elif kind == SLOPE:
                s[out + k] = -s[b + k]
            elif kind == POWER:
                if s[a] > STILL:
                    for i in range(k):
                        total += (power[g] * (k - i) - i) * s[a + k - i] * s[out + i]
                    total /= k * s[a]
                s[out + k] = total
            else:  # LOG and ASINH: derivative a' / b
                for i in range(1, k):
                    total += i * s[out + i] * s[b + k - i]
                s[out + k] = (k * s[a + k] - total) / (k * s[b])


@compiled(**EXACT)
def _entry_rounding(tape, mode, i, k, size, h, width, big, s):
    """Noise of coefficient k of a state entry: what rounds the sum that is its rate."""
    kinds, _, _, _, low, weight, index, constant, first, rate, factor = tape
    if k == 0:
        return NOISE * 1e-2 * big[i]
    r = rate[mode, i]
    if r < 0:
        return 0.0
    g = first[mode] + r
    if r < size or kinds[g] != LINEAR:
        return NOISE * abs(s[r * width + k - 1] * factor[mode, i]) * h / k
    total = abs(constant[g]) if k == 1 else 0.0
    for t in range(low[g], low[g + 1]):
        total += abs(weight[t] * s[index[t] * width + k - 1])
    return NOISE * total * abs(factor[mode, i]) * h / k


@compiled(**EXACT)
def _rounding(tape, mode, node, k, size, h, width, big, s):
    """Noise of coefficient k of a state entry or of a linear node."""
    if node < size:
        return _entry_rounding(tape, mode, node, k, size, h, width, big, s)
    g = tape[8][mode] + node
    if tape[0][g] != LINEAR:
        return NOISE * abs(s[node * width + k])
    total = NOISE * 1e-2 * abs(tape[7][g]) if k == 0 else 0.0
    for t in range(tape[4][g], tape[4][g + 1]):
        i = tape[6][t]
        entry = i < size
        noise = _entry_rounding(tape, mode, i, k, size, h, width, big, s) if entry else NOISE * abs(s[i * width + k])
        total += abs(tape[5][t]) * noise
    return total


@compiled(**EXACT)
def _surely_below(s, start, top, sign, level, u):
    """Whether sign * polynomial stays below a level up to u <= GROWTH, by its coefficients alone."""
    total, power = sign * s[start] - level, 1.0
    for k in range(1, top + 1):
        power *= u
        total += max(sign * s[start + k], 0.0) * power
        if total >= 0.0:
            return False
    return total < 0.0


@compiled(**EXACT)
def _length(s, width, order, size, tolerance, big):
    """Step in units of h at which the last two terms of every entry are its tolerance."""
    last, before = 0.0, 0.0
    for i in range(size):
        j = i * width
        scale = max(big[i], 1e-3 * (abs(s[j + 1]) + abs(s[j + 2])))
        if scale > 0.0:
            last = max(last, abs(s[j + order]) / scale)
            before = max(before, abs(s[j + order - 1]) / scale)
        elif s[j + 1] != s[j + 1]:
            return math.nan
    if not (last + before < math.inf):
        return math.nan
    u = GROWTH
    if last > 0.0:
        u = min(u, (tolerance / last) ** (1.0 / order))
    if before > 0.0:
        u = min(u, (tolerance / before) ** (1.0 / (order - 1)))
    return u


@compiled(**EXACT)
def _guarded(tape, guards, mode, u, asleep, order, width, s, c, noise):
    """The step, shortened to where a saturated exponential wakes: until then its series does not know of it."""
    kinds, left = tape[0], tape[1]
    node, bound = guards
    for j in range(bound[mode], bound[mode + 1]):
        g = tape[8][mode] + node[j]
        a = left[g] * width
        if kinds[g] == POWER:
            level, sign = (-2.0 * STILL, 1.0) if s[a] <= STILL else (0.5 * STILL, -1.0)
        else:
            level, sign = asleep, 1.0
        if kinds[g] == TANH:
            level *= 0.5
            sign = -1.0 if s[a] > 0.0 else 1.0
        if (kinds[g] != POWER and sign * s[a] > -level - 0.25) or _surely_below(s, a, order - 1, sign, -level, u):
            continue
        power = 1.0
        for k in range(order):
            c[k], noise[k] = sign * s[a + k] * power, 0.0
            power *= u
        c[0] += level
        at = first_rise(c, noise, order, 0, 1.0, 0.0, 1.0)
        if at != NONE:
            u *= at
    return u


@compiled(**EXACT)
def advance(s, width, size, order, u, state):
    """The state at u by Horner's rule."""
    for i in range(size):
        j = i * width
        total = s[j + order]
        for k in range(order - 1, -1, -1):
            total = total * u + s[j + k]
        state[i] = total


@compiled(**EXACT)
def _first_exit(tape, exits, mode, size, h, u, order, width, big, s, c, noise):
    """The exit that ends the mode first within u, and when; -1 where none does."""
    node, _, crossing, _, bound, _, scale = exits
    found, best = -1, u
    for e in range(bound[mode], bound[mode + 1]):
        j = node[e] * width
        top = order if node[e] < size else order - 1
        low = 0
        sign = scale[e]
        floor = _rounding(tape, mode, node[e], 0, size, h, width, big, s)
        if sign * s[j] < -floor and _surely_below(s, j, top, sign, 0.0, best):
            continue
        while abs(s[j + low]) <= floor:
            low += 1
            if low > top:
                break
            floor = _rounding(tape, mode, node[e], low, size, h, width, big, s)
        if low > top:
            continue
        if sign * s[j + low] > 0.0:
            if not crossing[e]:
                return e, 0.0
            continue
        power = 1.0
        for k in range(top + 1):
            c[k] = sign * s[j + k] * power
            noise[k] = floor * power
            power *= best
        at = first_rise(c, noise, top + 1, low, 1.0, 0.0, 1.0)
        if at != NONE and (found < 0 or at < 1.0):
            found, best = e, at * best
    return found, best


@compiled(**EXACT)
def _set_tones(tones, time, state):
    """The drive's tones by the clock: they gather no error of the steps."""
    for j in range(len(tones)):
        angle = tones[j, 2] * time + tones[j, 3]
        state[int(tones[j, 0])], state[int(tones[j, 1])] = math.cos(angle), math.sin(angle)


@compiled(**EXACT)
def _polish(tape, node, tones, mode, h, time, state, s):
    """Newton's step onto the zero of an exit that holds the drive: the delay [s], and the state at it.

    The step's series has the drive to the tolerance only; what follows a release must not hang on that.
    """
    total, size = 0.0, len(state)
    for _ in range(2):
        _set_tones(tones, time + total, state)
        expand(tape, mode, state, h, 2, 3, s)
        value, slope = s[3 * node], s[3 * node + 1]
        if not abs(value) <= 1e-2 * abs(slope):
            return total
        delay = -value / slope
        advance(s, 3, size, 2, delay, state)
        total += delay * h
    return total


@compiled(**EXACT)
def march(tape, exits, guards, tones, clock, state, mode, until, period, tolerance, order, big, steps, work):
    """Steps from `clock` to `until` (laps, offset): the outcome, the steps written, and the mode.

    `clock` holds laps, offset [s] and the length of the step to try [s].
    """
    laps, offsets, lengths, modes, states, ends = steps
    s, c, noise = work
    width, asleep = order + 1, 4.0 - math.log(tolerance)
    node, target, _, held, _, face, _ = exits
    size, room, written, chain = len(state), len(laps), 0, 0
    while True:
        remaining = until[1] - clock[1]
        if until[0] != clock[0]:
            remaining += (until[0] - clock[0]) * period
        if remaining <= 4e-16 * (clock[1] + clock[2]):
            return DONE, written, mode
        _set_tones(tones, clock[1], state)
        h = clock[2]
        expand(tape, mode, state, h, order, width, s)
        u = _length(s, width, order, size, tolerance, big)
        if not (u * h > 1e-15 * (clock[1] + 1e-300)) or u <= 0.0:
            return STALL, written, mode
        full = u
        u = min(_guarded(tape, guards, mode, u, asleep, order, width, s, c, noise), remaining / h)
        leaving, u = _first_exit(tape, exits, mode, size, h, u, order, width, big, s, c, noise)
        if u > 0.0:
            if written == room:
                return FULL, written, mode
            chain = 0
            laps[written], offsets[written], lengths[written] = clock[0], clock[1], u * h
            modes[written], ends[written] = mode, leaving
            states[written] = state
            written += 1
            advance(s, width, size, order, u, state)
            for i in range(size):
                big[i] = max(big[i], abs(state[i]))
            if leaving < 0 and u * h >= remaining:
                clock[0], clock[1] = until[0], until[1]
            else:
                clock[1] += u * h
            while clock[1] >= period:
                clock[0] += 1.0
                clock[1] -= period
            clock[2] = full * h
        else:
            if written > 0 and ends[written - 1] < 0:
                ends[written - 1] = leaving
            chain += 1
            if chain > CHAIN:
                return CHATTER, written, mode
        if leaving >= 0:
            if u > 0.0 and not held[leaving]:
                delay = _polish(tape, node[leaving], tones, mode, h, clock[1], state, s)
                lengths[written - 1] += delay
                clock[1] += delay
            if held[leaving]:
                _set_tones(tones, clock[1], state)
                speed = 0.0
                for i in range(size):
                    speed += face[i] * state[i]
                state[1] = speed
            mode = target[leaving]


@compiled(**EXACT)
def sample(tape, order, starts, lengths, modes, states, times, nodes, out, step, work):
    """Values of nodes (by mode) at increasing times, from the series of the step each one falls in."""
    s, state, values = work
    j, known, width = 0, -1, order + 1
    for t in range(len(times)):
        while j + 1 < len(starts) and starts[j + 1] <= times[t]:
            j += 1
        step[t] = j
        h, mode = lengths[j], modes[j]
        if known != j:
            expand(tape, mode, states[j], h, order, width, s)
            known = j
        advance(s, width, len(state), order, min(1.0, max(0.0, (times[t] - starts[j]) / h)), state)
        expand(tape, mode, state, 1.0, 0, 1, values)
        for r in range(nodes.shape[1]):
            out[r, t] = values[nodes[mode, r]]
