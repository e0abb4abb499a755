r"""A free decay under viscous and dry friction: the exact motion, its Jacobian, and its normal equations.

The equation of motion is ``x'' + 2 zeta w x' + w^2 (x - b) + w^2 x_k sgn(x') = 0`` (thesis, chapter 6). Held at
amplitude A until its release at t_0, the mass turns every ``T = pi / (w sqrt(1 - zeta^2))``, whatever the friction
and the amplitude. In half cycle i, with ``tau = t - t_0 - i T`` and ``s_i = (-1)^i sgn A``,

    x = b + s_i (x_k + d_i E(tau)),   E = Re((1 - i beta) exp(lam tau)),   lam = w (-zeta + i sqrt(1 - zeta^2)),

    d_0 = |A| - x_k,   d_{i+1} = exp(-pi beta) d_i - 2 x_k,   beta = zeta / sqrt(1 - zeta^2),

and after n half cycles it rests at ``b + s_n (d_n + x_k)``. Velocity and acceleration multiply E by lam once and twice.

The data are means over blocks of equally many samples. A block's mean of exp(lam tau) is the value at its centre times
``sinh(m lam dt / 2) / (m sinh(lam dt / 2))``, so the means of the model are exact at any sampling rate; a block across
a turning point is split there. Within a half cycle the Jacobian is spanned by five functions, 1, Re z, Im z, tau Re z
and tau Im z of ``z = exp(lam tau)``: their products are summed over the blocks, and turned into normal equations once.

Parameters of the motion, in this order: angular frequency w [rad/s], damping ratio zeta, dry-friction displacement x_k,
rest position b, amplitude A (signed, from b), release time t_0 [s] from the first sample.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from stickslip.arrays import Array
from stickslip.compiled import FAST, compiled

RATE, DAMPING, DRY, REST, AMPLITUDE, RELEASE = range(6)
VALUE = 6  # the row of the value itself, after those of its derivatives


class Blocks(NamedTuple):
    """One release as a fit sees it: means of `size` samples each (of the last block, of what is left), `total` samples,
    their step [s], and the order of the derivative: 0, 1, 2 for displacement, velocity, acceleration."""

    means: Array
    size: int
    total: int
    dt: float
    order: int

    @property
    def freedom(self) -> float:
        """Degrees of freedom that the six parameters leave."""
        return max(1.0, self.total / self.size - 6.0)

    @property
    def centres(self) -> Array:
        """Time [s] of the blocks' centres, from the first sample."""
        edges = np.minimum(np.arange(len(self.means) + 1) * self.size, self.total)
        return np.asarray((edges[1:] + edges[:-1] - 1) / 2 * self.dt)

    def motion(self, p: Array, n: int) -> tuple[Array, Array]:
        """Means (blocks,) of a motion of n half cycles, and their derivatives (6, blocks) by its parameters."""
        values, jacobian = np.empty_like(self.means), np.empty((6, len(self.means)))
        sample_motion(p, n, self, values, jacobian, np.empty((3, 7, 6)))
        return values, jacobian

    def leave_out_release(self, p: Array, values: Array, jacobian: Array) -> None:
        """Take the block in which an acceleration jumps, as it is released, as it was measured: it tells nothing.

        A release within microseconds of a sample, as simulated records have it, else leaves all of the jump there.
        """
        jump = block_of(p[RELEASE], self.dt, self.size) if self.order == 2 else -1
        if 0 <= jump < len(values):
            values[jump], jacobian[:, jump] = self.means[jump], 0.0


@compiled(**FAST)
def fall(p, state, advance):
    """Set (`advance` False) or carry on by a half cycle d_i and its derivatives to damping, dry friction and |A|."""
    if advance:
        root = 1.0 - p[DAMPING] * p[DAMPING]
        ratio = math.exp(-math.pi * p[DAMPING] / math.sqrt(root))
        slope = -math.pi * ratio / (root * math.sqrt(root))
        state[1] = slope * state[0] + ratio * state[1]
        state[0] = ratio * state[0] - 2.0 * p[DRY]
        state[2] = ratio * state[2] - 2.0
        state[3] = ratio * state[3]
    else:
        state[0] = abs(p[AMPLITUDE]) - p[DRY]
        state[1], state[2], state[3] = 0.0, -1.0, 1.0


@compiled(**FAST)
def describe(p, n, order, piece, count, dt, state, rows):
    """Rows of the five functions that make the mean over `count` samples, and its derivatives, in a piece.

    Piece -1 is the hold, 0 to n - 1 are the half cycles, n is the rest. `p` is (6,), `state` (4,) as :func:`fall`
    leaves it, `rows` (7, 5 or more): a parameter each and the value, by 1, Re z, Im z, tau Re z, tau Im z; `dt` in s.
    """
    for k in range(7):
        for j in range(5):
            rows[k, j] = 0.0
    # in every piece; of a velocity or an acceleration it is the zero of the sensor
    rows[REST, 0] = 1.0
    rows[VALUE, 0] = p[REST]
    side = 1.0 if p[AMPLITUDE] >= 0.0 else -1.0
    # Hold: at the amplitude, not moving.
    if piece < 0:
        if order == 0:
            rows[AMPLITUDE, 0] = 1.0
            rows[VALUE, 0] += p[AMPLITUDE]
        return
    sign = side if piece % 2 == 0 else -side
    # Rest: where the last half cycle ended, b + s_n (d_n + x_k).
    if piece >= n:
        if order == 0:
            rows[DAMPING, 0] = sign * state[1]
            rows[DRY, 0] = sign * (state[2] + 1.0)
            rows[AMPLITUDE, 0] = sign * side * state[3]
            rows[VALUE, 0] += sign * (state[0] + p[DRY])
        return
    # Half cycle: rate lam by w and zeta, and how much later half cycle i begins.
    w, zeta = p[RATE], p[DAMPING]
    square = 1.0 - zeta * zeta
    root = math.sqrt(square)
    lam = complex(-zeta * w, root * w)
    lam_zeta = complex(-w, -zeta * w / root)
    half = math.pi / (w * root)
    late_zeta, late_w = piece * half * zeta / square, -piece * half / w
    c, c_zeta = complex(1.0, -zeta / root), complex(0.0, -1.0 / (square * root))
    # block mean sinh(m q / 2) / (m sinh(q / 2)) to fourth order: of a fortieth of a period 5e-11 is left
    q = lam * dt
    first, second = (count * count - 1.0) / 24.0, (count * count - 1.0) * (3.0 * count * count - 7.0) / 5760.0
    mean = 1.0 + q * q * (first + q * q * second)
    mean_lam = dt * q * (2.0 * first + 4.0 * q * q * second)
    if order == 0:
        power, power_lam = complex(1.0, 0.0), complex(0.0, 0.0)
    elif order == 1:
        power, power_lam = lam, complex(1.0, 0.0)
    else:
        power, power_lam = lam * lam, 2.0 * lam
    # Product rule: through d_i, through lam in the factor, through lam in z (tau times it), through the beginning.
    a = c * power * mean
    a_lam = c * (power_lam * mean + power * mean_lam)
    d = sign * state[0]
    _row(rows, DAMPING, d * (c_zeta * power * mean + a_lam * lam_zeta - a * lam * late_zeta) + sign * state[1] * a)
    _turned(rows, DAMPING, d * a * lam_zeta)
    _row(rows, RATE, d * (a_lam * lam / w - a * lam * late_w))
    _turned(rows, RATE, d * a * lam / w)
    _row(rows, DRY, sign * state[2] * a)
    _row(rows, AMPLITUDE, sign * side * state[3] * a)
    _row(rows, RELEASE, -d * a * lam)
    _row(rows, VALUE, d * a)
    if order == 0:
        rows[DRY, 0] = sign
        rows[VALUE, 0] += sign * p[DRY]


@compiled(**FAST)
def _row(rows, k, factor):
    """Re(factor z) by its parts."""
    rows[k, 1], rows[k, 2] = factor.real, -factor.imag


@compiled(**FAST)
def _turned(rows, k, factor):
    """tau Re(factor z) by its parts."""
    rows[k, 3], rows[k, 4] = factor.real, -factor.imag


@compiled(**FAST)
def _exponential(lam, tau):
    size = math.exp(lam.real * tau)
    return complex(size * math.cos(lam.imag * tau), size * math.sin(lam.imag * tau))


@compiled(**FAST)
def first_sample(time, dt, total):
    """Number of the first sample at or after `time`."""
    return int(min(max(math.ceil(time / dt - 1e-9), 0.0), float(total)))


@compiled(**FAST)
def block_of(time, dt, size):
    """Number of the block that a time falls into."""
    return math.floor((time / dt + 0.5) / size)


@compiled(**FAST)
def normal_equations(p, n, blocks, hessian, gradient, work):
    """Sum of squares of data minus model over the blocks, J'J in `hessian` (6, 6) and J'r in `gradient` (6).

    An acceleration jumps at every turning point. The blocks that hold one are left out, and the others count for them.
    Residual and J are in the data's unit over those of the parameters.

    Parameters
    ----------
    p : ndarray (6,)
        Parameters of the motion.
    n : int
        Half cycles until rest.
    blocks : Blocks
        The last one counts less, by the samples that it has.
    work : ndarray (3, 7, 6)
        Scratch.
    """
    means, size, total, dt, order = blocks
    rows, state, pending, mixed = work[0], work[1, 0], work[1, 1], work[2]
    for j in range(6):
        gradient[j], pending[j] = 0.0, 0.0
        for k in range(6):
            hessian[j, k] = 0.0
    lam, half = _pole(p)
    turn = _exponential(lam, size * dt)
    squares, counted, mean, used = 0.0, 0, 0.0, 0
    fall(p, state, False)
    i = 0
    for piece in range(-1, n + 1):
        # Piece: d_i is carried on from the one before; it ends where the next one's first sample is.
        if piece > 0:
            fall(p, state, True)
        stop = total if piece == n else first_sample(p[RELEASE] + (piece + 1) * half, dt, total)
        begin = p[RELEASE] + piece * half
        # acceleration: from behind the block of this turn to before that of the next
        if order == 2:
            i = min(total, max(i, (block_of(begin, dt, size) + 1) * size)) if piece >= 0 else 0
            stop = stop if piece == n else min(total, block_of(begin + half, dt, size) * size)
            used += max(stop - i, 0)
        described = 0
        while i < stop:
            count = min(stop - i, size - i % size)
            if count != described:
                describe(p, n, order, piece, count, dt, state, rows)
                described = count
            tau = (i + 0.5 * (count - 1)) * dt - begin
            z = complex(1.0, 0.0) if piece < 0 or piece >= n else _exponential(lam, tau)
            if count == size:  # whole blocks, to the piece's end
                first, last = i // size, i // size + (stop - i) // size
                squares += _add_blocks(rows, means[first:last], z, turn, tau, size * dt, hessian, gradient, mixed)
                i += (last - first) * size
                continue
            # a part of a block, which several pieces share
            mean = _add_part(rows, count / size, z, tau, mean, pending)
            counted += count
            i += count
            if i % size == 0 or i == total:
                squares += _add_block(means[(i - 1) // size], mean, counted / size, pending, hessian, gradient)
                mean, counted = 0.0, 0
    # the blocks left out count as the others do; below the diagonal alone was summed
    share = total / used if order == 2 and used > 0 else 1.0
    for j in range(6):
        gradient[j] *= share
        for k in range(j + 1):
            hessian[j, k] *= share
            hessian[k, j] = hessian[j, k]
    return share * squares


@compiled(**FAST)
def _pole(p):
    """The oscillation's complex rate [1/s], and half its period [s]."""
    root = math.sqrt(1.0 - p[DAMPING] * p[DAMPING])
    return complex(-p[DAMPING] * p[RATE], root * p[RATE]), math.pi / (p[RATE] * root)


@compiled(**FAST)
def _add_part(rows, share, z, tau, mean, pending):
    """Add a part of a block to its derivatives, `pending`; the block's mean with that part."""
    basis = (1.0, z.real, z.imag, tau * z.real, tau * z.imag)
    for j in range(5):
        mean += share * rows[VALUE, j] * basis[j]
        for k in range(6):
            pending[k] += share * rows[k, j] * basis[j]
    return mean


@compiled(**FAST)
def _add_block(measured, mean, filled, pending, hessian, gradient):
    """Add a block made of parts, which fill that share of it, and forget its derivatives; its square."""
    left = measured - mean / filled
    for j in range(6):
        gradient[j] += pending[j] * left
        for k in range(j + 1):
            hessian[j, k] += pending[j] * pending[k] / filled
    for k in range(6):
        pending[k] = 0.0
    return filled * left * left


@compiled(**FAST)
def _add_blocks(rows, means, z, turn, tau, step, hessian, gradient, mixed):
    """Add the whole blocks of one piece, by the products of the five functions; their sum of squares.

    `rows` is (7, 5 or more) of :func:`describe`, `means` (b,) the data; z and `tau` [s] are those of the first centre,
    `turn` and `step` [s] lead from one to the next. `hessian` (6, 6) takes its lower half, `mixed` (6, 5 or more) is
    scratch.
    """
    # the value itself has no part in tau
    v0, v1, v2 = rows[6, 0], rows[6, 1], rows[6, 2]
    squares, r0, r1, r2, r3, r4 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    g01, g02, g03, g04, g11, g12, g13, g14 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    g22, g23, g24, g33, g34, g44 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    # Sums over the blocks, of residual and functions: the parameters come in once, not block by block.
    for j in range(means.shape[0]):
        c, s = z.real, z.imag
        tc, ts = tau * c, tau * s
        left = means[j] - (v0 + v1 * c + v2 * s)
        squares += left * left
        r0 += left
        r1 += left * c
        r2 += left * s
        r3 += left * tc
        r4 += left * ts
        g01 += c
        g02 += s
        g03 += tc
        g04 += ts
        g11 += c * c
        g12 += c * s
        g13 += c * tc
        g14 += c * ts
        g22 += s * s
        g23 += s * tc
        g24 += s * ts
        g33 += tc * tc
        g34 += tc * ts
        g44 += ts * ts
        # a product for a cosine and a sine, at one rounding a block
        z *= turn
        tau += step
    # Gram matrix G of the five functions.
    gram = (
        (float(means.shape[0]), g01, g02, g03, g04),
        (g01, g11, g12, g13, g14),
        (g02, g12, g22, g23, g24),
        (g03, g13, g23, g33, g34),
        (g04, g14, g24, g34, g44),
    )
    # J'r = rows r, and J'J = rows G rows'.
    for k in range(6):
        gradient[k] += rows[k, 0] * r0 + rows[k, 1] * r1 + rows[k, 2] * r2 + rows[k, 3] * r3 + rows[k, 4] * r4
        for j in range(5):
            line = gram[j]
            mixed[k, j] = (
                rows[k, 0] * line[0]
                + rows[k, 1] * line[1]
                + rows[k, 2] * line[2]
                + rows[k, 3] * line[3]
                + rows[k, 4] * line[4]
            )
    for k in range(6):
        for m in range(k + 1):
            for j in range(5):
                hessian[k, m] += mixed[k, j] * rows[m, j]
    return squares


@compiled(**FAST)
def sample_motion(p, n, blocks, values, jacobian, work):
    """The model's block means, `values` (blocks,), and their derivatives, `jacobian` (6, blocks); `p` is (6,), `work`
    (3, 7, 6) scratch."""
    _, size, total, dt, order = blocks
    rows, state = work[0], work[1, 0]
    for j in range(values.shape[0]):
        values[j] = 0.0
        for k in range(6):
            jacobian[k, j] = 0.0
    lam, half = _pole(p)
    turn, z = _exponential(lam, size * dt), complex(1.0, 0.0)
    fall(p, state, False)
    i = 0
    for piece in range(-1, n + 1):
        # Piece: as in the normal equations, but no block is left out.
        if piece > 0:
            fall(p, state, True)
        stop = total if piece == n else first_sample(p[RELEASE] + (piece + 1) * half, dt, total)
        begin = p[RELEASE] + piece * half
        described = 0
        while i < stop:
            count = min(stop - i, size - i % size)
            tau = (i + 0.5 * (count - 1)) * dt - begin
            # z by a product while whole blocks follow one another; anew where a part of a block comes between
            if piece < 0 or piece >= n:
                z = complex(1.0, 0.0)
            else:
                z = z * turn if count == size == described else _exponential(lam, tau)
            if count != described:
                describe(p, n, order, piece, count, dt, state, rows)
                described = count
            # a block across a turning point is the mean of its parts, by their samples
            block = i // size
            share = count / min(size, total - block * size)
            basis = (1.0, z.real, z.imag, tau * z.real, tau * z.imag)
            # as in `_add_part`, with a column for each block
            for j in range(5):
                values[block] += share * rows[VALUE, j] * basis[j]
                for k in range(6):
                    jacobian[k, block] += share * rows[k, j] * basis[j]
            i += count
