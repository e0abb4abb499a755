"""Values between samples, and in place of lost ones: band-limited where samples exist, autoregressive where not.

Channels that lag what they measure: the stated delays taken out, before anything compares one with another.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from stickslip.errors import RecordError
from stickslip.record.flaws import runs_of
from stickslip.record.record import Record, Step

Array = NDArray[np.float64]

LOBES = 32  # zero crossings of the sinc kept on each side
KAISER = 9.0  # window parameter: stop band below -90 dB
SAME = 1e-9  # samples: distances that differ by less are one
BLOCK = 4096  # samples found at a time
ORDER = 32  # of the autoregression that bridges lost samples


def band_limited(values: Array, times: Array, *, cutoff: float = 1.0) -> Array:
    """The band-limited signals through uniform samples, at other times.

    ``y(t) = sum_k x_k c sinc(c (t - k)) w((t - k) c / 32)`` with Kaiser's window w and cut-off c, normalised to unit
    gain at zero frequency (Smith and Gossett 1984, "A flexible sampling-rate conversion method", ICASSP). Beyond its
    ends the record is continued by odd reflection.

    Parameters
    ----------
    values : ndarray, shape (..., n)
        Uniform samples, of one signal or of several.
    times : ndarray, shape (m,)
        Where the signals are wanted, in samples from the first; within 0 and n - 1.
    cutoff : float
        Upper end of the band relative to the samples' Nyquist frequency, at most 1.

    Returns
    -------
    ndarray, shape (..., m)

    Examples
    --------
    >>> wave = np.sin(0.3 * np.arange(200))
    >>> float(np.abs(band_limited(wave, np.array([100.5])) - np.sin(0.3 * 100.5))[0]) < 1e-4
    True
    """
    reach = int(np.ceil(LOBES / cutoff))
    n = values.shape[-1]
    if n <= reach:
        raise RecordError(
            f"a channel of {n} samples", f"interpolation at this rate needs {reach + 1}", "give a longer record"
        )
    before = 2 * values[..., :1] - values[..., reach:0:-1]
    after = 2 * values[..., -1:] - values[..., -2 : -reach - 2 : -1]
    around = np.lib.stride_tricks.sliding_window_view(np.concatenate([before, values, after], axis=-1), 2 * reach, -1)
    result = np.empty((*values.shape[:-1], len(times)))
    taps = np.arange(-reach + 1, reach + 1)
    for first in range(0, len(times), BLOCK):
        block = times[first : first + BLOCK]
        base = np.minimum(np.floor(block).astype(int), n - 1)
        past = block - base
        if np.ptp(past) < SAME and np.all(np.diff(base) == 1):  # a plain delay: the same weights everywhere
            weights = _weights(past[0] - taps, cutoff)
            products = around[..., base[0] + 1 : base[-1] + 2, :] @ weights
        else:
            weights = _weights(past[:, None] - taps, cutoff)
            products = np.einsum("...ij,ij->...i", around[..., base + 1, :], weights)
        result[..., first : first + BLOCK] = products / np.sum(weights, axis=-1)
    return result


def _weights(distance: Array, cutoff: float) -> Array:
    inside = np.clip(1 - (distance * cutoff / LOBES) ** 2, 0, None)
    from scipy.special import i0

    return np.asarray(np.sinc(cutoff * distance) * i0(KAISER * np.sqrt(inside)) * (inside > 0))


def bridge(values: Array, lost: NDArray[np.bool_]) -> Array:
    """Put values in place of lost samples, so that an autoregression of the rest is kept as well as possible.

    Minimises ``sum_i (x_i - sum_j a_j x_{i-j})^2`` over the lost samples, in both directions of time (Janssen,
    Veldhuis and Vries, IEEE Trans. ASSP 34, 1986, eq. 8; the coefficients a come from the complete stretches).
    A record too short, or too broken, for that is bridged by straight lines.

    Parameters
    ----------
    values : ndarray, shape (n,)
        Samples; what they hold where `lost` is ignored.
    lost : ndarray of bool, shape (n,)

    Returns
    -------
    ndarray, shape (n,)
    """
    rows = np.arange(len(values))
    result = np.array(values, dtype=float)
    if not lost.any():
        return result
    result[lost] = np.interp(rows[lost], rows[~lost], values[~lost])
    # outside the first and last known sample nothing can be bridged: the last known value is held there
    inner = lost & (rows > rows[~lost][0]) & (rows < rows[~lost][-1])
    for first, last in _neighbourhoods(inner):
        part = slice(first, last)
        result[part] = _bridged(result[part], inner[part])
    return result


def _neighbourhoods(lost: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Stretches around lost samples, wide enough to learn from, merged where they meet."""
    rows = np.flatnonzero(lost)
    margin = 40 * ORDER
    merged: list[tuple[int, int]] = []
    for row in rows:
        first, last = max(0, int(row) - margin), min(len(lost), int(row) + margin + 1)
        if merged and first <= merged[-1][1]:
            merged[-1] = (merged[-1][0], last)
        else:
            merged.append((first, last))
    return merged


def _bridged(values: Array, lost: NDArray[np.bool_]) -> Array:
    mean = float(np.mean(values[~lost]))
    signal = values - mean
    order = min(ORDER, int(np.sum(~lost)) // 6)
    coefficients = _autoregression(signal, lost, order) if order >= 2 else None
    if coefficients is None:
        return values
    result = values.copy()
    # lost samples further apart than the order do not meet in any prediction: each group is a problem of its own
    near = np.convolve(lost, np.ones(2 * order + 1), "same") > 0.5
    for first, last in runs_of(near):
        part = slice(first, last + 1)
        result[part][lost[part]] = _solved(signal[part], lost[part], coefficients) + mean
    return result


def _solved(signal: Array, lost: NDArray[np.bool_], coefficients: Array) -> Array:
    """The lost samples by least squares of all predictions that they are part of."""
    from scipy.sparse import diags
    from scipy.sparse.linalg import spsolve

    n, order = len(signal), len(coefficients)
    backward = np.concatenate([[1.0], -coefficients])
    predictors = [diags(list(f), list(range(order + 1)), shape=(n - order, n)) for f in (backward, backward[::-1])]
    normal = (predictors[0].T @ predictors[0] + predictors[1].T @ predictors[1]).tocsc()
    unknown, known = np.flatnonzero(lost), np.flatnonzero(~lost)
    rows = normal[unknown]
    return np.atleast_1d(spsolve(rows[:, unknown].tocsc(), -(rows[:, known] @ signal[known])))


def _autoregression(signal: Array, lost: NDArray[np.bool_], order: int) -> Array | None:
    """Coefficients of the forward-backward least-squares autoregression over complete stretches; None if too few."""
    windows = np.lib.stride_tricks.sliding_window_view(signal, order + 1)
    complete = ~np.lib.stride_tricks.sliding_window_view(lost, order + 1).any(axis=1)
    rows = windows[complete][:: max(1, int(complete.sum()) // 20_000)]
    if len(rows) < 2 * order:
        return None
    past = np.concatenate([rows[:, -2::-1], rows[:, 1:]])
    present = np.concatenate([rows[:, -1], rows[:, 0]])
    gram = past.T @ past
    gram[np.diag_indices(order)] += 1e-10 * np.trace(gram) / order + 1e-300
    solution: Array = np.linalg.solve(gram, past.T @ present)
    return solution


def without_delays(record: Record, *channels: str, question: str = "taking delays out", samples: int = 2) -> Record:
    """What would the channels read, had none of them come late?

    Each named channel whose delay is stated is moved by band-limited interpolation, ``y(t) = x(t + delay)``; then all
    channels are cut to the rows that every moved one reaches. Channels not named keep their values and their delay.

    Parameters
    ----------
    record : Record
        Delays [s] stated in its channels, see :meth:`~stickslip.record.record.Record.with_details`.
    *channels : str
        Those to move; all where none is named.
    question : str
        Who asks, for the words of a refusal.
    samples : int
        Least number of rows that must be left.

    Returns
    -------
    Record
        The same record where no named channel is delayed; else with the step in its history and delays of zero. A
        channel's stated noise is kept: white noise loses 2 % at most to the interpolation.

    Raises
    ------
    RecordError
        A delayed channel that is missing or not finite, a broken clock, or too few rows left.

    Examples
    --------
    >>> t = np.arange(1000) / 1000
    >>> late = Record.of({"x": np.sin(9 * t), "v": 9 * np.cos(9 * (t - 0.0125))}, fs=1000.0)
    >>> record = without_delays(late.with_details("v", delay=0.0125), "x", "v")
    >>> len(record), bool(np.allclose(record["v"][50:-50], 9 * np.cos(9 * record.time[50:-50]), atol=1e-4))
    (987, True)
    """
    record.require(*channels, question=question)
    delays = {name: record.channels[name].delay for name in channels or record if record.channels[name].delay}
    if not delays:
        return record
    record.require_clean(*delays, question=question)
    shifts = {name: delay * record.fs for name, delay in delays.items()}
    first = max(0, math.ceil(-min(shifts.values())))
    last = len(record) - max(0, math.ceil(max(shifts.values())))
    if last - first < samples or len(record) <= LOBES:
        raise RecordError(
            f"delays of {', '.join(f'{name} {delay:g} s' for name, delay in delays.items())}",
            f"{question} needs {max(samples, LOBES + 1)} rows that every channel reaches, "
            f"and {max(0, last - first)} of {len(record)} are left",
            "correct the delays, in seconds, or give a longer record",
        )
    rows = np.arange(first, last, dtype=float)
    moved = {
        name: band_limited(values, rows + shifts[name]) if name in shifts else values[first:last]
        for name, values in record.samples.items()
    }
    step = Step(
        "without_delays", {"delays": delays}, f"delays taken out; {last - first} of {len(record)} rows reached by all"
    )
    result = record.with_samples(moved, step, start=record.start + first / record.fs)
    punctual = {name: replace(record.channels[name], delay=0.0) for name in delays}
    return replace(result, channels={**record.channels, **punctual})
