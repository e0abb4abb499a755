"""How neighbouring motions part: the derivative of the motion, events included."""

from __future__ import annotations

from stickslip.compiled import OPTIONS, compiled
from stickslip.solve.kernel import follow, multiply


@compiled(**OPTIONS)
def carry_tangents(linear, leap, pieces, after, tangents, work):
    """Carry small differences of the state through pieces and the events between them.

    At an event the difference jumps by the saltation matrix R + (f' - R f) q / (q f), where f = A S before and
    f' = A' R S after it: the neighbour meets the exit at another time.

    Parameters
    ----------
    linear : Linear
    leap : ndarray (M, M, N, N)
        Of :class:`stickslip.solve.tables.Tables`.
    pieces : Pieces
    after : int
        Mode that follows the last piece.
    tangents : ndarray (K, N)
        Differences of the state, updated.
    work : ndarray (9, N)
        Scratch.

    Returns
    -------
    float
        Smallest speed of an exit through zero relative to its terms: near zero, the motion grazes and the derivative
        means nothing.
    """
    flow, series, target, reset = linear.flow, linear.series, linear.target, linear.reset
    modes, states, durations, exits = pieces.modes, pieces.states, pieces.durations, pieces.exits
    n = states.shape[1]
    least = 1.0
    scratch, end, begin, before, carried, fresh = work[:3], work[3], work[4], work[5], work[6], work[7]
    for j in range(modes.shape[0]):
        mode, e = modes[j], exits[j]
        for k in range(tangents.shape[0]):
            follow(linear, mode, tangents[k], durations[j], scratch)
        if e < 0:
            continue
        following = modes[j + 1] if j + 1 < modes.shape[0] else after
        for i in range(n):
            end[i] = states[j, i]
        follow(linear, mode, end, durations[j], scratch)
        multiply(reset[e], end, scratch[0])
        multiply(leap[target[e], following], scratch[0], begin)
        multiply(flow[mode], end, before)
        speed, size = 0.0, 0.0
        for i in range(n):
            term = series[e, 0, i] * before[i]
            speed += term
            size += abs(term)
        if size > 0.0:
            least = min(least, abs(speed) / size)
        multiply(reset[e], before, scratch[0])
        multiply(leap[target[e], following], scratch[0], carried)
        multiply(flow[following], begin, fresh)
        for k in range(tangents.shape[0]):
            shift = 0.0
            for i in range(n):
                shift += series[e, 0, i] * tangents[k, i]
            shift = shift / speed if speed != 0.0 else 0.0
            multiply(reset[e], tangents[k], scratch[0])
            multiply(leap[target[e], following], scratch[0], scratch[1])
            for i in range(n):
                tangents[k, i] = scratch[1, i] + (fresh[i] - carried[i]) * shift
    return least
