"""A Kalman smoother for a linear motion that is pushed by one unknown, with as many sensors as there are."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from stickslip.arrays import Array, Rows
from stickslip.compiled import FAST, compiled

ROUNDING = 1e-12  # share of a variance before the readings that is left of it at least


class Motion(NamedTuple):
    """A linear motion in steps, :math:`s' = T s + u + r w`, and what is read of it, :math:`y = H s + e`.

    Attributes
    ----------
    transition : ndarray (g, n, n)
        T, over one sample, of each regime.
    spread : ndarray (g, n)
        r: what one unit of the unknown does in a step.
    readings : ndarray (m, n)
        H.
    noise : ndarray (m,)
        Variance of e, of each sensor.
    start : ndarray (n,)
        State before the first reading.
    doubt : ndarray (n,)
        Its variances.
    drift : ndarray (n,)
        Variance by which each state strays in a step beside what the unknown does; zeros where left out.
    """

    transition: Array
    spread: Array
    readings: Array
    noise: Array
    start: Array
    doubt: Array
    drift: Array | None = None


class Smoothed(NamedTuple):
    """What all readings together say of the motion.

    Attributes
    ----------
    values, variance : ndarray (p, n)
        Of the linear forms asked for, at each sample.
    score : ndarray (n,)
        r, the slope of the likelihood by the unknown of each step: w is q r.
    information : ndarray (n,)
        Variance of the score, were the variance q of the unknown true.
    likelihood : float
        Its logarithm.
    """

    values: Array
    variance: Array
    score: Array
    information: Array
    likelihood: float


class Seen(NamedTuple):
    """What was read of a motion, and what drove it.

    Attributes
    ----------
    readings : ndarray (N, m)
        NaN where nothing was read.
    inputs : ndarray (N, n)
        u of each step.
    regime : ndarray (N,)
        Which of the motion's regimes each step is in.
    """

    readings: Array
    inputs: Array
    regime: Rows


class Filtered(NamedTuple):
    """What the way back needs of each sample: state and covariance before its readings, and of each reading its gains,
    its surprise and that one's variance (0 where nothing was read)."""

    ahead: Array
    doubt: Array
    gains: Array
    surprises: Array
    variances: Array


class Work(NamedTuple):
    """What a recursion carries, a vector and a matrix, and room for one of each."""

    vector: Array
    matrix: Array
    line: Array
    square: Array


def smooth_motion(motion: Motion, seen: Seen, *, unknown: Array, forms: Array) -> Smoothed:
    """What was the motion, from everything that was read before and after?

    The Kalman filter, one sensor at a time, and the backward recursion of de Jong (1989) and of Koopman (1993), which
    needs no inverse.

    Parameters
    ----------
    motion : Motion
    seen : Seen
    unknown : ndarray (N,)
        Variance q of the unknown w of each step.
    forms : ndarray (p, n)
        Linear forms of the state that are wanted.

    Returns
    -------
    Smoothed
    """
    motion, kept, likelihood = _filtered(motion, seen, unknown)
    count, size = len(unknown), len(motion.start)
    smoothed = Smoothed(
        np.empty((len(forms), count)), np.empty((len(forms), count)), np.empty(count), np.empty(count), likelihood
    )
    work = Work(np.zeros(size), np.zeros((size, size)), np.empty(size), np.empty((size, size)))
    _backward(motion, seen, kept, forms, smoothed, work)
    return smoothed


def log_likelihood(motion: Motion, seen: Seen, *, unknown: Array) -> float:
    """How likely are the readings?

    Parameters
    ----------
    motion : Motion
    seen : Seen
    unknown : ndarray (N,)
        Variance q of the unknown w of each step.

    Returns
    -------
    float
        Logarithm of the likelihood, from the filter's surprises.
    """
    return _filtered(motion, seen, unknown)[2]


def surprises(motion: Motion, seen: Seen, *, unknown: Array) -> Array:
    """How far is each reading from what all before it foretold, in standard deviations?

    Parameters
    ----------
    motion : Motion
    seen : Seen
    unknown : ndarray (N,)
        Variance q of the unknown w of each step.

    Returns
    -------
    ndarray (N, m)
        Of mean square 1 where the motion is as stated; NaN where nothing was read.
    """
    kept = _filtered(motion, seen, unknown)[1]
    return kept.surprises / np.sqrt(np.where(kept.variances > 0, kept.variances, np.nan))


def _filtered(motion: Motion, seen: Seen, unknown: Array) -> tuple[Motion, Filtered, float]:
    """The motion with its drift, what the filter leaves, and the log likelihood."""
    count, size, sensors = len(unknown), len(motion.start), seen.readings.shape[1]
    motion = motion._replace(drift=np.zeros(size) if motion.drift is None else motion.drift)
    kept = Filtered(
        np.empty((count, size)),
        np.empty((count, size, size)),
        np.empty((count, sensors, size)),
        np.zeros((count, sensors)),
        np.zeros((count, sensors)),
    )
    work = Work(motion.start.copy(), np.diag(motion.doubt), np.empty(size), np.empty((size, size)))
    return motion, kept, float(_forward(motion, seen, unknown, kept, work))


@compiled(**FAST)
def _forward(motion, seen, unknown, kept, work):
    """The filter from a state and its covariance: the log likelihood; `kept` takes what the way back needs."""
    a, p = work.vector, work.matrix
    n, total = a.shape[0], 0.0
    for t in range(seen.readings.shape[0]):
        for i in range(n):
            kept.ahead[t, i] = a[i]
            for j in range(n):
                kept.doubt[t, i, j] = p[i, j]
        for k in range(seen.readings.shape[1]):
            if not math.isnan(seen.readings[t, k]):
                total += _update(t, k, motion, seen, kept, work)
        _predict(t, motion, seen, unknown, work)
    return total


@compiled(**FAST, forceinline=True)
def _update(t, k, motion, seen, kept, work):
    """Take reading k of sample t: its log likelihood. State a (n,) and covariance P (n, n) are `work`'s."""
    a, p, line, form = work.vector, work.matrix, work.line, motion.readings[k]
    n, surprise, width = a.shape[0], seen.readings[t, k], motion.noise[k]
    # Surprise v = y - h a, and its variance F = h P h' + noise; line = P h'.
    for i in range(n):
        surprise -= form[i] * a[i]
        total = 0.0
        for j in range(n):
            total += p[i, j] * form[j]
        line[i] = total
    for i in range(n):
        width += form[i] * line[i]
    kept.surprises[t, k], kept.variances[t, k] = surprise, width
    # Gain K = P h' / F; P - K h P by one triangle, so that it stays symmetric.
    for i in range(n):
        gain = line[i] / width
        kept.gains[t, k, i] = gain
        a[i] += gain * surprise
        for j in range(i + 1):
            p[i, j] -= gain * line[j]
            p[j, i] = p[i, j]
    return -0.5 * (math.log(2 * math.pi * width) + surprise * surprise / width)


@compiled(**FAST, forceinline=True)
def _predict(t, motion, seen, unknown, work):
    """Step to the next sample: a (n,) and P (n, n) of `work`."""
    a, p, line, square = work
    transition, spread = motion.transition[seen.regime[t]], motion.spread[seen.regime[t]]
    n = a.shape[0]
    # State: T a + u.
    for i in range(n):
        total = seen.inputs[t, i]
        for j in range(n):
            total += transition[i, j] * a[j]
        line[i] = total
    # T P
    for i in range(n):
        a[i] = line[i]
        for j in range(n):
            total = 0.0
            for k in range(n):
                total += transition[i, k] * p[k, j]
            square[i, j] = total
    # Covariance: (T P) T' + q r r' + drift, by one triangle; q is the unknown's variance.
    for i in range(n):
        for j in range(i + 1):
            total = spread[i] * unknown[t] * spread[j]
            for k in range(n):
                total += square[i, k] * transition[j, k]
            p[i, j] = total
            p[j, i] = total
        p[i, i] += motion.drift[i]


@compiled(**FAST)
def _backward(motion, seen, kept, forms, smoothed, work):
    """The way back; what it carries are slope r and curvature m of the likelihood by the state."""
    for t in range(seen.readings.shape[0] - 1, -1, -1):
        _score(t, motion, seen, smoothed, work)
        _step_back(motion.transition[seen.regime[t]], work)
        for k in range(seen.readings.shape[1] - 1, -1, -1):
            if kept.variances[t, k] != 0.0:
                _give_back(t, k, motion, kept, work)
        _tell(t, kept, forms, smoothed, work)


@compiled(**FAST, forceinline=True)
def _score(t, motion, seen, smoothed, work):
    """Slope and curvature by the unknown of a step."""
    r, m, spread = work.vector, work.matrix, motion.spread[seen.regime[t]]
    n, first, second = r.shape[0], 0.0, 0.0
    for i in range(n):
        first += spread[i] * r[i]
        total = 0.0
        for j in range(n):
            total += m[i, j] * spread[j]
        second += spread[i] * total
    smoothed.score[t], smoothed.information[t] = first, second


@compiled(**FAST, forceinline=True)
def _step_back(transition, work):
    """Slope r (n,) and curvature m (n, n) by the state after a sample's readings: r = T' r, m = T' m T."""
    r, m, line, square = work
    n = r.shape[0]
    # T' r, and m T: r is still needed whole
    for i in range(n):
        total = 0.0
        for j in range(n):
            total += transition[j, i] * r[j]
        line[i] = total
        for j in range(n):
            total = 0.0
            for k in range(n):
                total += m[i, k] * transition[k, j]
            square[i, j] = total
    # T' (m T), by one triangle
    for i in range(n):
        r[i] = line[i]
        for j in range(i + 1):
            total = 0.0
            for k in range(n):
                total += transition[k, i] * square[k, j]
            m[i, j] = total
            m[j, i] = total


@compiled(**FAST, forceinline=True)
def _give_back(t, k, motion, kept, work):
    """Slope r (n,) and curvature m (n, n) by the state before reading k of sample t.

    With L = I - K h: r = h' v / F + L' r, m = h' h / F + L' m L, multiplied out as h is one row.
    """
    r, m, line, form, gains = work.vector, work.matrix, work.line, motion.readings[k], kept.gains[t, k]
    n, width = r.shape[0], kept.variances[t, k]
    # r changes along h' alone, by v / F - K' r; m by h' h (1 / F + K' m K) and what is mixed, with line = m K
    along, across = kept.surprises[t, k] / width, 1.0 / width
    for i in range(n):
        along -= gains[i] * r[i]
        total = 0.0
        for j in range(n):
            total += m[i, j] * gains[j]
        line[i] = total
        across += gains[i] * total
    # no inverse of P: a state that is known exactly does no harm
    for i in range(n):
        r[i] += form[i] * along
        for j in range(n):
            m[i, j] += form[i] * form[j] * across - line[i] * form[j] - form[i] * line[j]


@compiled(**FAST, forceinline=True)
def _tell(t, kept, forms, smoothed, work):
    """The linear forms (p, n) that are wanted, at a sample: z (a + P r), of variance z (P - P m P) z'."""
    r, m, line, n = work.vector, work.matrix, work.line, work.vector.shape[0]
    for o in range(forms.shape[0]):
        value, doubt = 0.0, 0.0
        for i in range(n):
            # line = P z', from before the readings of the sample, as r and m are
            total = 0.0
            for j in range(n):
                total += kept.doubt[t, i, j] * forms[o, j]
            line[i] = total
            value += forms[o, i] * kept.ahead[t, i] + total * r[i]
            doubt += forms[o, i] * total
        # the difference of nearly equal variances may round below zero
        least = ROUNDING * doubt
        for i in range(n):
            for j in range(n):
                doubt -= line[i] * m[i, j] * line[j]
        smoothed.values[o, t], smoothed.variance[o, t] = value, max(doubt, least)
