"""The first root of an exit, certified: no earlier one was jumped over.

Rules
-----
An exit quantity g is negative while its mode lasts. In a cell it is a polynomial c[0] + c[1] u + ... on 0 <= u <= 1,
with a noise level per coefficient that bounds its rounding.

* At the start: leading coefficients within their noise are exact zeros (a velocity that has just vanished; the double
  zero when a stick is released). The first coefficient that is not decides: positive fires at once, negative is
  inside the mode, and the zeros are divided out so that the root at the start is not found again. All zero: the
  quantity is constant and on the tie (a rest exactly at the break-away force); the mode lasts.
* Marching: where g < 0, and g'' <= M on the rest of the cell, g + g' d + M d^2/2 < 0 certifies that no root lies
  within d. Steps of that length never pass a root and converge to it quadratically.
* A near tangency whose crest stays within the noise counts as no crossing.
* A quantity that falls through zero first is followed down as far as its slope provably stays negative.
* A root at the very end of the time span belongs to the span.
"""

from __future__ import annotations

import math

from stickslip.compiled import OPTIONS, compiled

NONE = 2.0  # no root in the cell
STEPS = 20_000  # of the march through a cell
UNSURE = 3.0  # the march through the cell ran out of steps: nothing is proved
NOISE = 64 * 2.220446049250313e-16  # of the terms' sizes: what rounding may leave of a sum of some tens of them


@compiled(**OPTIONS)
def opening_order(c, noise, count):
    """Number of leading coefficients that are zeros within their noise (`count` if all are)."""
    order = 0
    while order < count and abs(c[order]) <= noise[order]:
        order += 1
    return order


@compiled(**OPTIONS)
def _curve(c, low, count, u):
    """Value, slope and curvature at u of the polynomial whose coefficients start at `low`."""
    g, d, h = 0.0, 0.0, 0.0
    for k in range(count - 1, low - 1, -1):
        h = h * u + d
        d = d * u + g
        g = g * u + c[k]
    return g, d, 2.0 * h


@compiled(**OPTIONS)
def _clear(g, d, most, left):
    """How far g + d t + most t^2 / 2 stays below zero from g < 0; `left` where it never rises."""
    if most > 0.0:
        root = math.sqrt(d * d - 2.0 * most * g)
        return -2.0 * g / (d + root) if d > 0.0 else (root - d) / most
    return -g / d if d > 0.0 else left


@compiled(**OPTIONS)
def _walk(d, h, third, floor):
    """How far to go on from a value within the noise: no rise that stands out from it lies before.

    Down a slope d < 0 as far as neither h nor a third derivative of up to `third` can turn it; else until value and
    crest are told from the noise.
    """
    bend, twist = max(abs(h), 1e-300), max(third, 1e-300)
    far = min(2.0 * math.sqrt(2.0 * floor / bend) + max(d, 0.0) / bend, 2.0 * (6.0 * floor / twist) ** (1.0 / 3.0))
    if d < 0.0:
        up = max(h, 0.0)
        far = max(far, -2.0 * d / (up + math.sqrt(up * up - 2.0 * twist * d)))
    return far


@compiled(**OPTIONS)
def first_rise(c, noise, count, low, sign, start, limit):
    """First u in (start, limit] at which sign * polynomial rises through zero; else `NONE` or `UNSURE`.

    The polynomial starts at coefficient `low` (the zeros at the start divided out) and is negative at `start` once
    multiplied by `sign`. `c` and `noise` are (`count` or more,), in one unit; |u| <= 1.
    """
    # a bound of |g'''| where |u| <= 1: the moduli of its terms there
    third = 0.0
    for k in range(low + 3, count):
        j = k - low
        third += j * (j - 1) * (j - 2) * abs(c[k])
    floor = noise[low]
    u = start
    for _ in range(STEPS):
        g, d, h = _curve(c, low, count, u)
        g, d, h = sign * g, sign * d, sign * h
        left = limit - u
        most = h + third * left
        if g >= -floor:
            if d > 0.0 and (g >= 0.0 or d * d >= 2.0 * floor * abs(h)):
                return min(limit, max(start, u - g / d))
            # past a crest within the noise, or down from the zero; a crossing counts once it stands out
            ahead = min(limit, u + max(_walk(d, h, third, floor), 1e-9))
            if sign * _curve(c, low, count, ahead)[0] > floor:
                return ahead
            if ahead >= limit:
                return NONE
            u = ahead
            continue
        # clear to the end by the largest slope and curvature that are left
        if g + max(d, 0.0) * left + 0.5 * max(most, 0.0) * left * left < 0.0:
            return NONE
        step = _clear(g, d, most, left)
        near = 8.0 * step
        if near < left:
            # nearer by, the curvature is bound more closely
            step = max(step, min(near, _clear(g, d, h + third * near, near)))
        if step >= left:
            end = sign * _curve(c, low, count, limit)[0]
            return limit if end >= 0.0 else NONE
        # steps below rounding end at the root
        if step <= 4e-16 * max(abs(u), 1e-3):
            return u if d > 0.0 else NONE
        u += step
    return UNSURE
