"""Blocks on an NVIDIA GPU, one motion to a thread, in the compiled functions of the CPU."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from numba import cuda
from numba.cuda.cudadrv.driver import CudaAPIError

from stickslip.compiled import dispatcher_of
from stickslip.errors import ModelError, SolveError
from stickslip.maps import watch
from stickslip.maps.crowd import rooms, run_block
from stickslip.maps.measures import LOG
from stickslip.maps.plan import Keep, Plan
from stickslip.maps.watch import Counted, Given

THREADS = 64  # of a block of the GPU
FLOAT64 = (1, 3)  # compute capability with which NVIDIA's GPUs have it
INSTEAD = 'take engine="threads"'

watch_one = dispatcher_of(watch.watch_one)


def run(plan: Plan, numbers: Sequence[int], keep: Keep) -> None:
    """Run the blocks on the GPU in turn.

    Raises
    ------
    ModelError
        A GPU with double precision or its driver is not there; the system is not of the kind that marches on a GPU, or
        every event is asked for.
    SolveError
        The driver refuses the work.
    """
    _require_gpu()
    if LOG in plan.measures:
        raise ModelError(
            f"measures has '{LOG}'", "a GPU counts events and keeps none", f"{INSTEAD}, or leave '{LOG}' out"
        )
    for number in numbers:
        keep(number, *run_block(plan, number, _watch, alone=_refuse))


@cuda.jit
def _watch_thread(given, out, rooms):
    """March and count the motion of this thread."""
    i = cuda.grid(1)
    if i < given.states.shape[0]:
        watch_one(i, i, given, out, rooms)


def _watch(given: Given, out: Counted, size: int, physical: int) -> None:
    count = len(given.states)
    with _driven():
        written = carried(out)
        _watch_thread[math.ceil(count / THREADS), THREADS](
            carried(given), written, carried(rooms(count, size, physical))
        )
        for name in out._fields:
            getattr(out, name)[...] = getattr(written, name).copy_to_host()


def carried(values: Any) -> Any:
    """Arrays, however nested by name, on the GPU."""
    return type(values)(*(carried(v) if isinstance(v, tuple) else cuda.to_device(v) for v in values))


def _refuse(plan: Plan, steps: tuple[int, ...]) -> Any:
    raise ModelError(
        repr(plan.at(steps)[0]),
        "a GPU marches one mass under laws of linear modes with at most one tone, and tells its exponent under one",
        INSTEAD,
    )


@contextmanager
def _driven() -> Iterator[None]:
    """What a driver refuses (too old, without its libraries, no memory left) in one sentence."""
    try:
        yield
    except (CudaAPIError, ImportError) as refusal:
        raise SolveError(
            f"the GPU's driver refuses: {refusal}",
            "a GPU is driven by a driver as new as numba-cuda",
            f"bring the driver up to date, or {INSTEAD}",
        ) from refusal


def _require_gpu() -> None:
    """Refuse to go on where numba finds no GPU that it can drive."""
    if not cuda.is_available():
        raise ModelError("numba finds no NVIDIA GPU", "this needs one and its driver", INSTEAD)
    with _driven():
        capability = cuda.get_current_device().compute_capability
    if capability < FLOAT64:
        raise ModelError(
            f"the GPU has compute capability {'.'.join(map(str, capability))}",
            "motions are marched in double precision, which begins at 1.3",
            INSTEAD,
        )
