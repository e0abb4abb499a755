"""A Kalman smoother for a linear motion that is pushed by one unknown, with as many sensors as there are."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stickslip.compiled import FAST, compiled

Array = NDArray[np.float64]

ROUNDING = 1e-12  # share of a variance before the readings that is left of it at least


@dataclass(frozen=True, eq=False)
class Motion:
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


@dataclass(frozen=True, eq=False)
class Smoothed:
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


@dataclass(frozen=True, eq=False)
class Seen:
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
    regime: NDArray[np.intp]


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
    kept, likelihood = _filtered(motion, seen, unknown)
    count, size = len(unknown), len(motion.start)
    values, variance = np.empty((len(forms), count)), np.empty((len(forms), count))
    score, information = np.empty(count), np.empty(count)
    _backward(
        (motion.transition, motion.spread, motion.readings, seen.regime), kept, forms, values, variance, score,
        information, np.zeros((size, size)), np.empty((size, size)), np.zeros(size), np.empty(size),
    )  # fmt: skip
    return Smoothed(values, variance, score, information, likelihood)


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
    return _filtered(motion, seen, unknown)[1]


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
    _, _, _, surprise, variance = _filtered(motion, seen, unknown)[0]
    return surprise / np.sqrt(np.where(variance > 0, variance, np.nan))


def _filtered(motion: Motion, seen: Seen, unknown: Array) -> tuple[tuple[Array, ...], float]:
    count, size, sensors = len(unknown), len(motion.start), seen.readings.shape[1]
    kept = (
        np.empty((count, size)), np.empty((count, size, size)), np.empty((count, sensors, size)),
        np.zeros((count, sensors)), np.zeros((count, sensors)),
    )  # fmt: skip
    tables = (motion.transition, motion.spread, motion.readings, seen.regime)
    drift = np.zeros(size) if motion.drift is None else motion.drift
    likelihood = _forward(
        tables, motion.noise, drift, seen.readings, seen.inputs, unknown, motion.start.copy(), np.diag(motion.doubt),
        kept, np.empty((size, size)), np.empty(size),
    )  # fmt: skip
    return kept, float(likelihood)


@compiled(**FAST)
def _forward(tables, noise, drift, readings, inputs, unknown, a, p, kept, square, line):
    """The filter from state a and covariance p: the log likelihood; `kept` takes what the way back needs."""
    transitions, spreads_, forms, regime = tables
    ahead, doubts, gains, surprises, spreads = kept
    count, sensors = readings.shape
    n = a.shape[0]
    total_likelihood = 0.0
    for t in range(count):
        for i in range(n):
            ahead[t, i] = a[i]
            for j in range(n):
                doubts[t, i, j] = p[i, j]
        for k in range(sensors):
            surprise = readings[t, k]
            if math.isnan(surprise):
                continue
            width = noise[k]
            for i in range(n):
                surprise -= forms[k, i] * a[i]
                total = 0.0
                for j in range(n):
                    total += p[i, j] * forms[k, j]
                line[i] = total
            for i in range(n):
                width += forms[k, i] * line[i]
            surprises[t, k], spreads[t, k] = surprise, width
            total_likelihood -= 0.5 * (math.log(2 * math.pi * width) + surprise * surprise / width)
            for i in range(n):
                gain = line[i] / width
                gains[t, k, i] = gain
                a[i] += gain * surprise
                for j in range(i + 1):
                    p[i, j] -= gain * line[j]
                    p[j, i] = p[i, j]
        transition, spread = transitions[regime[t]], spreads_[regime[t]]
        for i in range(n):
            total = inputs[t, i]
            for j in range(n):
                total += transition[i, j] * a[j]
            line[i] = total
        for i in range(n):
            a[i] = line[i]
            for j in range(n):
                total = 0.0
                for k in range(n):
                    total += transition[i, k] * p[k, j]
                square[i, j] = total
        for i in range(n):
            for j in range(i + 1):
                total = spread[i] * unknown[t] * spread[j]
                for k in range(n):
                    total += square[i, k] * transition[j, k]
                p[i, j] = total
                p[j, i] = total
            p[i, i] += drift[i]
    return total_likelihood


@compiled(**FAST)
def _backward(tables, kept, forms, values, variance, score, information, m, square, r, line):
    """The way back: r and m are the slope and the curvature of the likelihood by the state."""
    transitions, spreads_, readings, regime = tables
    ahead, doubts, gains, surprises, spreads = kept
    count, sensors = surprises.shape
    n = r.shape[0]
    for t in range(count - 1, -1, -1):
        transition, spread = transitions[regime[t]], spreads_[regime[t]]
        first, second = 0.0, 0.0
        for i in range(n):
            first += spread[i] * r[i]
            total = 0.0
            for j in range(n):
                total += m[i, j] * spread[j]
            second += spread[i] * total
        score[t], information[t] = first, second
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
        for i in range(n):
            r[i] = line[i]
            for j in range(i + 1):
                total = 0.0
                for k in range(n):
                    total += transition[k, i] * square[k, j]
                m[i, j] = total
                m[j, i] = total
        for k in range(sensors - 1, -1, -1):
            width = spreads[t, k]
            if width == 0.0:
                continue
            along, across = surprises[t, k] / width, 1.0 / width
            for i in range(n):
                along -= gains[t, k, i] * r[i]
                total = 0.0
                for j in range(n):
                    total += m[i, j] * gains[t, k, j]
                line[i] = total
                across += gains[t, k, i] * total
            for i in range(n):
                r[i] += readings[k, i] * along
                for j in range(n):
                    m[i, j] += (
                        readings[k, i] * readings[k, j] * across - line[i] * readings[k, j] - readings[k, i] * line[j]
                    )
        for o in range(forms.shape[0]):
            value, doubt = 0.0, 0.0
            for i in range(n):
                total = 0.0
                for j in range(n):
                    total += doubts[t, i, j] * forms[o, j]
                line[i] = total
                value += forms[o, i] * ahead[t, i] + total * r[i]
                doubt += forms[o, i] * total
            least = ROUNDING * doubt
            for i in range(n):
                for j in range(n):
                    doubt -= line[i] * m[i, j] * line[j]
            values[o, t], variance[o, t] = value, max(doubt, least)
