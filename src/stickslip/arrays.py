"""Arrays of numbers: what annotations call them, and where a mask holds."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Index = NDArray[np.int64]
Mask = NDArray[np.bool_]
Rows = NDArray[np.intp]


def stretches(inside: Mask) -> tuple[Rows, Rows]:
    """First samples of the stretches where `inside` holds, and the samples after their last.

    Examples
    --------
    >>> [rows.tolist() for rows in stretches(np.array([True, False, True, True]))]
    [[0, 2], [1, 4]]
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[False], inside, [False]]).astype(np.int8)))
    return edges[::2], edges[1::2]
