"""The batch on an NVIDIA GPU: one motion to a thread."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from numba import cuda
from numba.cuda.cudadrv.driver import CudaAPIError

from stickslip.errors import ModelError, SolveError
from stickslip.solve.batch import Batch, Given, Rooms, march_one

THREADS = 64  # of a block
FLOAT64 = (1, 3)  # compute capability with which NVIDIA's GPUs have it


@cuda.jit
def each(given, out, rooms):
    """March the motion of this thread."""
    i = cuda.grid(1)
    if i < given.which.shape[0]:
        march_one(i, given, out, rooms)


def march_all(given: Given, out: Batch, rooms: Rooms) -> None:
    """March every motion on the GPU and bring home what was written."""
    require_gpu("gpu=False")
    written = carried(out)
    each[math.ceil(len(given.which) / THREADS), THREADS](carried(given), written, carried(rooms))
    for name in Batch._fields:
        getattr(out, name)[...] = getattr(written, name).copy_to_host()


def carried(values: Any) -> Any:
    """Arrays, however nested by name, on the GPU."""
    return type(values)(*(carried(v) if isinstance(v, tuple) else cuda.to_device(v) for v in values))


@contextmanager
def driven(instead: str) -> Iterator[None]:
    """What a driver refuses (too old, without its libraries, no memory left) in one sentence."""
    try:
        yield
    except (CudaAPIError, ImportError) as refusal:
        raise SolveError(
            f"the GPU's driver refuses: {refusal}",
            "a GPU is driven by a driver as new as numba-cuda",
            f"bring the driver up to date, or take {instead}",
        ) from refusal


def require_gpu(instead: str) -> None:
    """Refuse to go on where numba finds no GPU that it can drive; `instead` is what to take."""
    if not cuda.is_available():
        raise ModelError("numba finds no NVIDIA GPU", "this needs one and its driver", f"take {instead}")
    with driven(instead):
        capability = cuda.get_current_device().compute_capability
    if capability < FLOAT64:
        raise ModelError(
            f"the GPU has compute capability {'.'.join(map(str, capability))}",
            "motions are marched in double precision, which begins at 1.3", f"take {instead}",
        )  # fmt: skip
