"""The likelihood of counts: what a digitiser of coarse steps says of the motion before it.

A count y says that signal plus noise lay between y - q/2 and y + q/2: its probability is ``Phi(b) - Phi(a)`` with
``a, b = (y -+ q/2 - x) / sigma``.
"""

from __future__ import annotations

import math

from stickslip.compiled import FAST, compiled

SURE = 9.0  # standard deviations from which a count tells nothing


@compiled(**FAST)
def mills(a):
    """Probability beyond a >= 0 over the density there, of the normal law."""
    if a < 30.0:
        return 0.5 * math.erfc(a / math.sqrt(2.0)) * math.exp(0.5 * a * a) * math.sqrt(2.0 * math.pi)
    return (1.0 - 1.0 / (a * a)) / a


@compiled(**FAST)
def add_counts(values, jacobian, counts, step, level, slope, curvature):
    """Minus twice the log likelihood of counts; half its slope and curvature (7), the last for the noise's logarithm.

    log(Phi(b) - Phi(a)) is concave in (a, b), so the curvature is positive.
    """
    total = 0.0
    for k in range(7):
        slope[k] = 0.0
        for j in range(7):
            curvature[k, j] = 0.0
    for i in range(values.shape[0]):
        a, b = (counts[i] - 0.5 * step - values[i]) / level, (counts[i] + 0.5 * step - values[i]) / level
        if a < -SURE and b > SURE:
            continue
        side = 1.0
        if a + b < 0.0:
            a, b, side = -b, -a, -1.0
        fade = math.exp(-0.5 * (b - a) * (b + a))
        if a >= 0.0:
            share = mills(a) - fade * mills(b)
        else:
            density = math.exp(-0.5 * a * a) / math.sqrt(2.0 * math.pi)
            share = 0.5 * (math.erf(b / math.sqrt(2.0)) - math.erf(a / math.sqrt(2.0))) / max(density, 1e-300)
        low = 1.0 / share
        high = fade * low
        total += a * a + math.log(2.0 * math.pi) - 2.0 * math.log(share)
        aa, bb, ab = low * (low - a), high * (high + b), -low * high
        # a and b fall with the value and, in size, with the noise
        d_value = -side / level
        s_value, s_noise = (high - low) * d_value, -(high * b - low * a)
        c_value = (aa + 2.0 * ab + bb) / (level * level)
        c_mixed = -d_value * ((aa + ab) * a + (ab + bb) * b)
        c_noise = aa * a * a + 2.0 * ab * a * b + bb * b * b
        for k in range(6):
            slope[k] += s_value * jacobian[k, i]
            curvature[6, k] += c_mixed * jacobian[k, i]
            for j in range(k + 1):
                curvature[k, j] += c_value * jacobian[k, i] * jacobian[j, i]
        slope[6] += s_noise
        curvature[6, 6] += c_noise
    for k in range(7):
        for j in range(k):
            curvature[j, k] = curvature[k, j]
    return total
