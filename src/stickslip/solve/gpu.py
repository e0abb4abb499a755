"""The batch on an NVIDIA GPU: one motion to a thread."""

from __future__ import annotations

import math
from typing import Any

from numba import cuda

from stickslip.errors import SolveError
from stickslip.solve.batch import march_one

THREADS = 64  # of a block


@cuda.jit
def each(given, out, scratch):
    """March the motion of this thread."""
    i = cuda.grid(1)
    if i < given[0].shape[0]:
        march_one(i, given, out, scratch)


def march_all(given: tuple[Any, ...], out: tuple[Any, ...], scratch: tuple[Any, ...]) -> None:
    """March every motion on the GPU and bring home what was written."""
    require_gpu("gpu=False")
    written = carried(out)
    each[math.ceil(len(given[0]) / THREADS), THREADS](carried(given), written, carried(scratch))
    for array, found in zip(out, written, strict=True):
        array[...] = found.copy_to_host()


def carried(values: tuple[Any, ...]) -> tuple[Any, ...]:
    """Arrays, however nested, on the GPU."""
    return tuple(carried(v) if isinstance(v, tuple) else cuda.to_device(v) for v in values)


def require_gpu(instead: str) -> None:
    """Refuse to go on where numba finds no GPU that it can drive; `instead` is what to take."""
    if not cuda.is_available():
        raise SolveError("numba finds no NVIDIA GPU", "this needs one and its driver", f"take {instead}")
