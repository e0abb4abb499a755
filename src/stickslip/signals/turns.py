"""Where an oscillation turns, and when it passes from one turning point to the next; compiled."""

from __future__ import annotations

from stickslip.compiled import FAST, compiled

SHARES = (0.25, 0.5, 0.75)
EQUAL = 1e-12  # of a swing: running means that differ by less are alike


@compiled(**FAST)
def turning_points(values, least, rows):
    """Rows where `values` turn back by `least` or more, alternately up and down, with the first and last extreme.

    They are written to `rows`, as many as it holds; returns how many there are.
    """
    count, low, high, direction = 0, 0, 0, 0
    for row in range(values.shape[0]):
        if count == rows.shape[0]:
            return count
        if direction >= 0:
            if values[row] >= values[high]:
                high = row
            elif values[high] - values[row] >= least:
                rows[count] = high
                count += 1
                direction, low = -1, row
                continue
        if direction <= 0:
            if values[row] <= values[low]:
                low = row
            elif values[row] - values[low] >= least:
                rows[count] = low
                count += 1
                direction, high = 1, row
    if 0 < count < rows.shape[0]:
        rows[count] = high if direction > 0 else low
        count += 1
    return count


@compiled(**FAST)
def crossings(values, turns, places):
    """Rows, with fractions, where each swing passes `SHARES` of its way; the last time before it is through.

    `turns` are the k + 1 turning points, `places` is (k, 3).
    """
    for k in range(turns.shape[0] - 1):
        first, last = turns[k], turns[k + 1]
        begin, length = values[first], values[last] - values[first]
        through = first
        while (values[through] - begin) / length < SHARES[2]:
            through += 1
        for j in range(3):
            row = through
            while row > first and (values[row] - begin) / length >= SHARES[j]:
                row -= 1
            rise = (values[min(row + 1, last)] - values[row]) / length
            places[k, j] = row + ((SHARES[j] - (values[row] - begin) / length) / rise if rise > 0.0 else 0.0)


@compiled(**FAST)
def extreme(values, first, last, side):
    """Row of the extreme, up (`side` 1) or down (-1), of running means over a sixth of `first` to `last`."""
    width = max(1, (last - first + 1) // 6) | 1
    reach, level = width // 2, values[first]
    total, span = 0.0, 0.0
    for row in range(first, last + 1):
        span = max(span, abs(values[row] - level))
    for row in range(first - reach, first + reach + 1):
        total += side * (values[min(max(row, first), last)] - level)
    best, best_row = total, first
    for row in range(first + 1, last + 1):
        total += side * (values[min(row + reach, last)] - values[max(row - reach - 1, first)])
        if total > best + EQUAL * width * span:
            best, best_row = total, row
    return best_row
