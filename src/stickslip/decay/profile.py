"""The best fit for each number of half cycles, and how far each parameter may go before the fit is too bad.

The profile likelihood of a parameter is found without maximising along a path of fixed values: its ends are where the
parameter is extreme on the surface of equal likelihood. There the sum of squares S is replaced by its Gauss-Newton
quadratic, whose extreme in direction j is ``d* +- u sqrt((level - S*) / u_j)`` with ``u = H^-1 e_j``, and the step is
repeated from that point (Venzon and Moolgavkar 1988).

A motion of n half cycles whose last one is shorter than nothing (its turning point lies within the dry friction) is
none. At that edge it is the motion of n - 1 half cycles, so what an interval loses there the other number gives.
"""

from __future__ import annotations

import math

from stickslip.compiled import FAST, compiled
from stickslip.decay.waveform import AMPLITUDE, DAMPING, DRY, RATE, RELEASE, normal_equations

STEPS = 60  # at most, of a fit or onto an end
CLOSE = 1e-5  # of the variance: what the sum of squares may still fall
STEEPEST = 0.9  # damping ratio
WORSE = 20.0  # variances by which another number of half cycles may fit worse and still count


@compiled(**FAST)
def solve(matrix, right, answer, factor, extra):
    """Solve (matrix + extra diag(matrix)) answer = right by Cholesky of the matrix scaled to a unit diagonal; whether
    it could. `matrix` and `factor` are (n, n), `right` and `answer` (n,)."""
    n = right.shape[0]
    # Factor L L': scaled, as the parameters have units of their own; a pivot of rounding tells a singular matrix.
    for j in range(n):
        for k in range(j + 1):
            total = matrix[j, k] / math.sqrt(matrix[j, j] * matrix[k, k])
            if j == k:
                total = 1.0 + extra
            for i in range(k):
                total -= factor[j, i] * factor[k, i]
            if j == k:
                if not total > 1e-15:
                    return False
                factor[j, j] = math.sqrt(total)
            else:
                factor[j, k] = total / factor[k, k]
    # Substitute: L y = right, L' x = y, and the scale taken back.
    for j in range(n):
        total = right[j] / math.sqrt(matrix[j, j])
        for i in range(j):
            total -= factor[j, i] * answer[i]
        answer[j] = total / factor[j, j]
    # back, from the last
    for j in range(n - 1, -1, -1):
        total = answer[j]
        for i in range(j + 1, n):
            total -= factor[i, j] * answer[i]
        answer[j] = total / factor[j, j]
    for j in range(n):
        answer[j] /= math.sqrt(matrix[j, j])
    return True


@compiled(**FAST)
def last_swing(p, n):
    """Half the length of the last half cycle, and the distance from the rest position where it ends."""
    ratio = math.exp(-math.pi * p[DAMPING] / math.sqrt(1.0 - p[DAMPING] * p[DAMPING]))
    d = abs(p[AMPLITUDE]) - p[DRY]
    for _ in range(n - 1):
        d = ratio * d - 2.0 * p[DRY]
    return d, ratio * d - p[DRY]


@compiled(**FAST)
def moved(p, step, share, trial):
    """`trial` = p and a share of a step, along which the half period changes evenly and not the natural frequency.

    The record tells the half period whatever the damping: in the natural frequency the likelihood's ridge is bent.
    """
    here, there = 1.0 - p[DAMPING] ** 2, 1.0 - (p[DAMPING] + share * step[DAMPING]) ** 2
    rate = p[RATE] + share * step[RATE]
    if min(here, there) > 0.0:
        rate = (rate - share * step[DAMPING] * p[RATE] * p[DAMPING] / here) * math.sqrt(here / there)
    for k in range(p.shape[0]):
        trial[k] = p[k] + share * step[k]
    trial[RATE] = rate


@compiled(**FAST)
def _possible(p, before):
    """Whether trial parameters are those of an oscillation, near enough the ones before for the steps to be trusted."""
    return (
        abs(p[DAMPING]) < STEEPEST
        and abs(p[RATE] - before[RATE]) < 0.2 * before[RATE]
        and p[AMPLITUDE] * before[AMPLITUDE] > 0.0
        and abs(p[DAMPING] - before[DAMPING]) < 0.3
        and abs(p[RELEASE] - before[RELEASE]) * before[RATE] < 0.7
    )


@compiled(**FAST)
def minimise(p, n, blocks, hessian, gradient, work):
    """Least squares by Levenberg and Marquardt from `p`, which becomes the answer; the sum of squares, or infinity.

    `hessian` (6, 6) is left as J'J there, `gradient` (6,) as J'r; `p` is (6,), `work` (8, 7, 6).
    """
    step, trial, factor = work[3, 0], work[3, 1], work[4]
    other, slope, scratch = work[5, :6], work[6, 0], work[:3]
    freedom = max(1.0, blocks.total / blocks.size - 6.0)
    squares = normal_equations(p, n, blocks, hessian, gradient, scratch)
    extra = 0.0
    for _ in range(STEPS):
        # Step: damped where the normal equations are singular.
        if not solve(hessian, gradient, step, factor, extra):
            extra = max(10.0 * extra, 1e-6)
            if extra > 1e6:
                return math.inf
            continue
        # Judge: by what the quadratic foretells that the sum of squares falls.
        fall = 0.0
        for k in range(6):
            fall += step[k] * gradient[k]
        moved(p, step, 1.0, trial)
        if _possible(trial, p):
            # done: the last step is taken on the word of the quadratic
            if fall <= CLOSE * squares / freedom:
                for k in range(6):
                    p[k] = trial[k]
                return squares - fall
            now = normal_equations(trial, n, blocks, other, slope, scratch)
            # better: taken, with less damping; none where it was small, as Gauss and Newton's step converges fastest
            if now < squares:
                squares = now
                for k in range(6):
                    p[k], gradient[k] = trial[k], slope[k]
                    for j in range(6):
                        hessian[k, j] = other[k, j]
                extra = 0.0 if extra < 1e-3 else 0.1 * extra
                continue
        # Worse, or no oscillation: a shorter step, nearer the steepest descent.
        extra = max(4.0 * extra, 1e-3)
        if extra > 1e8:
            return squares
    return squares


@compiled(**FAST)
def extreme(p, n, which, side, level, least, blocks, hessian, gradient, work):
    """Carry `p` (6,) to the extreme (`side` +1, -1) of one parameter where the sum of squares is `level`; whether it
    did.

    `least` is the sum of squares at the best fit; `hessian` (6, 6), `gradient` (6,) and `work` (8, 7, 6) are scratch.
    """
    step, across, factor, aim = work[3, 0], work[3, 1], work[4], work[3, 2]
    for k in range(6):
        aim[k] = 0.0
    aim[which] = 1.0
    for _ in range(STEPS):
        # Quadratic about p: the step to its minimum, and u = H^-1 e_j.
        squares = normal_equations(p, n, blocks, hessian, gradient, work[:3])
        if not solve(hessian, gradient, step, factor, 0.0) or not solve(hessian, aim, across, factor, 0.0):
            return False
        fall = 0.0
        for k in range(6):
            fall += step[k] * gradient[k]
        # Reach: what its minimum leaves up to the level, as far as u carries; nothing where it lies above.
        room = max(level - squares + fall, 0.0)
        reach = side * math.sqrt(room / across[which])
        whole = math.sqrt((level - least) * across[which])
        # Step: two half widths of the interval at the most, as far as a quadratic may be trusted.
        move, share = 0.0, 1.0
        for k in range(6):
            step[k] += reach * across[k]
        move = abs(step[which])
        if move > 2.0 * whole:
            share = 2.0 * whole / move
        moved(p, step, share, p)
        if not abs(p[DAMPING]) < STEEPEST or not p[RATE] > 0.0:
            return False
        if move < 2e-3 * whole and abs(squares - level) < 0.05 * (level - least):
            return True
    return False


@compiled(**FAST)
def over_half_cycles(start, first, blocks, fits, work):
    """Fit every number of half cycles that may be, from `first` on upwards and downwards; how many were kept.

    A row of `fits` (rows, 9) holds n, the sum of squares, the log determinant of J'J, and the parameters. `start` is
    (6,), `work` (10, 7, 6).
    """
    hessian, gradient, p = work[8, :6], work[9, 0], work[9, 1]
    kept, best, rows = 0, math.inf, fits.shape[0]
    worse = 1.0 + WORSE / max(1.0, blocks.total / blocks.size - 6.0)
    # Upwards from the start, then downwards from the first fit kept: the answer of one number begins the next.
    for direction in (1, -1):
        for k in range(6):
            p[k] = start[k] if direction == 1 or kept == 0 else fits[0, 3 + k]
        n = first if direction == 1 else first - 1
        bad = 0
        while n >= 1 and kept < rows and bad < 2:
            squares = minimise(p, n, blocks, hessian, gradient, work[:8])
            limit = best * worse
            # a last swing shorter than nothing is none, nor is any after it
            possible = last_swing(p, n)[0] > 0.0
            if possible and squares < math.inf and squares <= limit:
                # a new best may put earlier ones out of reach
                if squares < best:
                    best = squares
                    kept = _keep(fits, kept, best * worse)
                fits[kept, 0], fits[kept, 1], fits[kept, 2] = n, squares, log_determinant(hessian, work[4])
                for k in range(6):
                    fits[kept, 3 + k] = p[k]
                kept += 1
                bad = 0
            else:
                # given up after two misses in a row, once something was kept
                bad += 2 if direction == 1 and not possible else 1 if kept > 0 else 0
            # half cycles after the end of the record show in no sample
            half = math.pi / (p[RATE] * math.sqrt(1.0 - p[DAMPING] ** 2))
            if direction == 1 and p[RELEASE] + n * half > blocks.total * blocks.dt:
                break
            n += direction
    return kept


@compiled(**FAST)
def _keep(fits, count, limit):
    """Drop the rows whose sum of squares is above the limit; how many are left."""
    kept = 0
    for row in range(count):
        if fits[row, 1] <= limit:
            for column in range(fits.shape[1]):
                fits[kept, column] = fits[row, column]
            kept += 1
    return kept


@compiled(**FAST)
def log_determinant(matrix, factor):
    """Logarithm of the determinant of a positive definite matrix."""
    n = matrix.shape[0]
    answer = 0.0
    for j in range(n):
        for k in range(j + 1):
            total = matrix[j, k] / math.sqrt(matrix[j, j] * matrix[k, k])
            for i in range(k):
                total -= factor[j, i] * factor[k, i]
            if j == k:
                factor[j, j] = math.sqrt(max(total, 1e-300))
                answer += 2.0 * math.log(factor[j, j]) + math.log(matrix[j, j])
            else:
                factor[j, k] = total / factor[k, k]
    return answer


@compiled(**FAST)
def intervals(fits, kept, level, blocks, ends, work):
    """Ends (6, 2) of the profile likelihood of each parameter, by the best number of half cycles at each end.

    Returns how many ends were not found; they are left at the edge of the quadratic. `fits` is (rows, 9) as
    :func:`over_half_cycles` leaves it, the first `kept` rows; `level` a sum of squares; `work` (10, 7, 6).
    """
    hessian, gradient, p = work[8, :6], work[9, 0], work[9, 1]
    missed = 0
    for which in range(6):
        for e in range(2):
            side = 2.0 * e - 1.0
            ends[which, e] = -side * math.inf
            # every number of half cycles below the level has ends of its own: the outermost are the answer
            for row in range(kept):
                if fits[row, 1] >= level:
                    continue
                for k in range(6):
                    p[k] = fits[row, 3 + k]
                n = int(fits[row, 0])
                # which blocks an acceleration leaves out changes with the parameters: the quadratic serves there
                bounded = blocks.order < 2 and extreme(
                    p, n, which, side, level, fits[row, 1], blocks, hessian, gradient, work[:8]
                )
                if not bounded:
                    missed += blocks.order < 2
                    for k in range(6):
                        p[k] = fits[row, 3 + k]
                    normal_equations(p, n, blocks, hessian, gradient, work[:3])
                    aim, across = work[3, 2], work[3, 1]
                    for k in range(6):
                        aim[k] = 1.0 if k == which else 0.0
                    solve(hessian, aim, across, work[4], 1e-12)
                    p[which] += side * math.sqrt((level - fits[row, 1]) * across[which])
                if bounded and last_swing(p, n)[0] < 0.0 and n > 1:
                    continue  # the motion of n - 1 half cycles goes on from here
                if side * (p[which] - ends[which, e]) > 0.0:
                    ends[which, e] = p[which]
    return missed
