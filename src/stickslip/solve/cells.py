"""The cells in which a mode's motion is a short Taylor polynomial: lengths, exits as polynomials, leaps over them."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from stickslip.arrays import Array, Complex, Index, Mask
from stickslip.compiled import OPTIONS, compiled, meanwhile

Rows = NDArray[np.floating[Any]]

DEGREE = 20  # of the Taylor polynomial in a cell; with rate * cell <= 1 the remainder is 1/21! = 2e-20 of its scale
CANCELLED = 8 * 2.220446049250313e-16  # of the terms: what rounding leaves of a difference of equals
SPLITTER = 134217729.0  # 2^27 + 1: halves a number into 26 bits and the rest
PART = 4  # a cell turns one radian; its exponential is summed over a fourth of it, and squared twice
TERMS = 40  # of that sum at most: it ends where a term changes nothing
SETTLED = 16  # terms of an exponential after which one that changes nothing is followed by none that does
ROOM = 2**17  # numbers of the flows whose exponentials are summed together
ROUNDED = 1e-13  # of a flow's fastest rate: an eigenvalue below is the rounding of zero
MOST_KNOWN = 512  # flows of single systems whose exponentials are kept
NEAR = 256  # different rows among which an equal one is looked for


class Linear(NamedTuple):
    """What the kernels read of a system; with a leading axis of many, but for what all share.

    Attributes
    ----------
    flow : ndarray (M, N, N)
        A of each mode.
    cell : ndarray (M,)
        Length [s] of a Taylor cell: the reciprocal of the mode's fastest rate; infinite where nothing turns.
    hop : ndarray (M, 3, N, N)
        exp(A cell), in the three parts of :func:`halved`.
    series : ndarray (E, DEGREE + 1, N)
        q A^k of each exit: its derivatives as linear forms of the state.
    target, crossing : ndarray (E,)
        Mode that follows; whether only a crossing counts. Shared.
    reset : ndarray (E, N, N)
        R of each exit, with the stuck velocity set where the next mode holds the mass.
    first : ndarray (M + 1,)
        Exits of mode j are ``first[j]`` to ``first[j + 1]``. Shared.
    tones : ndarray (J, 4)
        Index of cosine, index of sine, angular frequency, phase.
    """

    flow: Array
    cell: Array
    hop: Array
    series: Array
    target: Index
    crossing: Mask
    reset: Array
    first: Index
    tones: Array


def derivatives(quantity: Rows, flow: Rows) -> Rows:
    """q A^k of exits (B, E, N); where terms cancel but for their rounding, nothing is left."""
    rows = [quantity]
    sizes = np.abs(flow)
    for _ in range(DEGREE):
        if not np.any(rows[-1]):
            break
        row, size = rows[-1] @ flow, np.abs(rows[-1]) @ sizes
        rows.append(np.where(np.abs(row) > CANCELLED * size, row, 0.0))
    rows += [np.zeros_like(quantity)] * (DEGREE + 1 - len(rows))
    return np.stack(rows, axis=2)


@compiled(**OPTIONS, nogil=True)
def derive(flows, first, series, places, work):
    """As :func:`derivatives`, of every exit of many systems in doubles.

    `flows` is (B, M, N, N) [1/s], `first` (M + 1,); `series` (B, E, DEGREE + 1, N) holds the quantities in its first
    row; `places` (2, N^2) and `work` (N^2,) are scratch.
    """
    count, modes, n, _ = flows.shape
    for b in range(count):
        for m in range(modes):
            filled = 0  # entries of the flow, column by column
            for j in range(n):
                for i in range(n):
                    if flows[b, m, i, j] != 0.0:
                        places[0, filled], work[filled] = i, flows[b, m, i, j]
                        filled += 1
                places[1, j] = filled
            for e in range(first[m], first[m + 1]):
                # row k + 1 is row k times A, over the entries that are there: most of a flow is zero
                for k in range(series.shape[2] - 1):
                    f = 0
                    for j in range(n):
                        total, size = 0.0, 0.0
                        while f < places[1, j]:
                            term = series[b, e, k, places[0, f]] * work[f]
                            total += term
                            size += abs(term)
                            f += 1
                        # the rounding of equals that cancel is no derivative: a root at the start would not be seen
                        series[b, e, k + 1, j] = total if abs(total) > CANCELLED * size else 0.0


def cells_of(flow: Array, constant: int) -> tuple[Array, Array]:
    """Length of a Taylor cell [s] of each flow (B, M, N, N), and exp(A cell) as `hop` has it.

    The column of the constant stands for a force that does not change: the exponential is linear in it, and that of
    the rest is the same for all flows that differ in that force alone. So do the columns of other entries that no flow
    moves, as the places where elements hold: the exponential is that of the entries that move.
    """
    count, modes, size, _ = flow.shape
    whole = flow.reshape(-1, size, size)
    still = ~np.any(whole, axis=(0, 2))
    still[constant] = True
    moving, resting = np.flatnonzero(~still), np.flatnonzero(still)
    core = np.ascontiguousarray(whole[:, moving[:, None], moving])
    where, which = np.empty((2, len(core)), np.int64)
    where = where[: meanwhile.now(distinct, core.size)(core.reshape(len(core), -1), where, which)]
    cell, turned, integral = _one_by_one(core[where]) if count == 1 else _turned(core[where], where % modes)
    hop = np.zeros((len(whole), 3, size, size))
    hop[:, 0, resting, resting] = 1.0
    hop[:, :, moving[:, None], moving] = np.moveaxis(halved(turned), 0, 1)[which]
    pushed = integral[which] @ whole[:, moving[:, None], resting].astype(np.longdouble)
    hop[:, :, moving[:, None], resting] = np.moveaxis(halved(pushed), 0, 1)
    return cell[which].reshape(count, modes), hop.reshape(count, modes, 3, size, size)


_known_turns: dict[bytes, tuple[Any, ...]] = {}


def _one_by_one(core: Array) -> tuple[Any, ...]:
    """As :func:`_turned`, of flows some of which are known: the systems of a fit have most of theirs in common."""
    keys = [flow.tobytes() for flow in core]
    known = {key: turned for key in keys if (turned := _known_turns.get(key)) is not None}
    new = {key: flow for key, flow in zip(keys, core, strict=True) if key not in known}
    if new:
        turned = _turned(np.array(list(new.values())), np.arange(len(new)))
        made = dict(zip(new, zip(*turned, strict=True), strict=True))
        if len(_known_turns) > MOST_KNOWN:
            _known_turns.clear()
        _known_turns.update(made)
        known |= made
    return tuple(np.array(part) for part in zip(*(known[key] for key in keys), strict=True))


def _turned(core: Array, modes: Index) -> tuple[Array, Any, Any]:
    """Cells of flows without their constant column, the flows' exponentials over them and the integrals of those.

    Flows of one mode have their strongly connected parts in common.
    """
    size = core.shape[1]
    rate = np.zeros(len(core))
    for mode in range(np.max(modes) + 1):
        own = modes == mode
        if np.any(own):
            rate[own] = _fastest(core[own])
    cell = np.divide(1.0, rate, out=np.full(len(core), np.inf), where=rate > 0)
    time = np.where(rate > 0, cell, 0.0)
    step = max(1, ROOM // size**2)
    parts = [_exponentials(core[j : j + step], time[j : j + step]) for j in range(0, len(core), step)]
    turned, integral = (np.concatenate(part) for part in zip(*parts, strict=True))
    return cell, turned, integral


def _fastest(flow: Array) -> Array:
    """The fastest rate of each flow [1/s]: the largest modulus of its eigenvalues.

    They are found part by part of what is strongly connected in any of the flows: the eigenvalues of nilpotent parts
    come out of a general solver as small noise instead of zero.
    """
    rates = np.zeros(len(flow))
    for part in _parts(np.any(flow != 0, axis=0).tobytes(), flow.shape[1]):
        own = flow[:, part][:, :, part]
        values = own[:, :, 0] if len(part) == 1 else np.linalg.eigvals(own)
        rates = np.maximum(rates, np.max(np.abs(values), axis=1))
    return rates


def eigenvalues(flow: Array) -> Complex:
    """Those of one flow, part by part, for the same reason; what rounding leaves of a zero is one."""
    parts = _parts((flow != 0).tobytes(), len(flow))
    return np.concatenate([_spectrum(flow[np.ix_(part, part)].tobytes(), len(part)) for part in parts])


@lru_cache(maxsize=1024)  # the systems of a fit have most of their parts in common
def _spectrum(part: bytes, size: int) -> Complex:
    values = np.linalg.eigvals(np.frombuffer(part).reshape(size, size)).astype(complex)
    return np.where(np.abs(values) > ROUNDED * np.max(np.abs(values)), values, 0.0)


@lru_cache(maxsize=256)
def _parts(pattern: bytes, size: int) -> list[tuple[int, ...]]:
    """Strongly connected parts of a flow, by where it is not zero."""
    reach = np.frombuffer(pattern, dtype=bool).reshape(size, size) | np.eye(size, dtype=bool)
    for _ in range(max(1, size.bit_length())):
        reach = reach @ reach
    return sorted({tuple(np.flatnonzero(reach[j] & reach[:, j]).tolist()) for j in range(size)})


def _exponentials(flow: Array, time: Array) -> tuple[Any, Any]:
    """exp(A t) of each flow in extended precision, and its integral over the time, in which it turns one radian.

    Each entry is summed on its own, so entries of very different units keep their digits.
    """
    part = time.astype(np.longdouble)[:, None, None] / PART
    rows = np.flatnonzero(np.any(flow, axis=(0, 2)))  # of the flow and of what it turns; all others are zero
    step = flow[:, rows].astype(np.longdouble) * part
    unit = np.broadcast_to(np.eye(flow.shape[1], dtype=np.longdouble), flow.shape)
    term, turned, integral = unit[:, rows], np.zeros_like(step), unit.copy()
    for k in range(1, TERMS):
        term = term[:, :, rows] @ step / k
        before = turned
        turned = turned + term
        integral[:, rows] += term / (k + 1)
        if k >= SETTLED and np.array_equal(turned, before):
            break
    integral *= part
    for _ in range(int(math.log2(PART))):
        pushed = turned @ integral
        integral = 2 * integral
        integral[:, rows] += pushed
        turned = 2 * turned + turned[:, :, rows] @ turned
    whole = unit.copy()
    whole[:, rows] += turned
    return whole, integral


@compiled(**OPTIONS)
def distinct(rows, where, which):
    """Where each different row (R, W) stands first, and which of them each is, both (R,); how many there are. Rows that
    are far apart may count as different though they are equal."""
    count, width = 0, rows.shape[1]
    for r in range(rows.shape[0]):
        which[r] = -1
        # the latest NEAR alone, newest first: neighbours of a sweep are alike,
        # and all pairs would cost the square of their number
        for u in range(count - 1, max(-1, count - 1 - NEAR), -1):
            j = 0
            while j < width and rows[where[u], j] == rows[r, j]:
                j += 1
            if j == width:
                which[r] = u
                break
        if which[r] < 0:
            where[count], which[r] = r, count
            count += 1
    return count


def halved(matrix: Any) -> Array:
    """A matrix as a sum of three: its first 26 bits, the rest of a double, and what a double has no room for."""
    whole = np.asarray(matrix, dtype=np.float64)
    spread = SPLITTER * whole
    upper = spread - (spread - whole)
    return np.array([upper, whole - upper, np.asarray(matrix - whole, dtype=np.float64)])
