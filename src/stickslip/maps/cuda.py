"""A block at a time on an NVIDIA GPU, one motion to a thread, in the same compiled functions."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from stickslip.errors import ModelError
from stickslip.maps.block import run_block
from stickslip.maps.crowd import rooms
from stickslip.maps.measures import LOG
from stickslip.maps.plan import Keep, Plan

INSTEAD = 'engine="threads"'


def cuda(plan: Plan, numbers: Sequence[int], keep: Keep, address: str | None = None) -> None:
    """Run the blocks on the GPU in turn.

    Raises
    ------
    ModelError
        numba-cuda, a GPU with double precision or its driver is not there; the system is not of the kind that marches
        on a GPU, or every event is asked for.
    SolveError
        The driver refuses the work.
    """
    try:
        from stickslip.maps.watch_gpu import THREADS, each
        from stickslip.solve.gpu import carried, driven, require_gpu
    except ImportError as absent:
        raise ModelError(
            "numba-cuda is not installed", "a GPU is driven by numba-cuda", 'pip install ".[gpu]" in the checkout'
        ) from absent
    require_gpu(INSTEAD)
    if LOG in plan.measures:
        raise ModelError(
            f"measures has '{LOG}'", "a GPU counts events and keeps none",
            f'take engine="threads", or leave \'{LOG}\' out',
        )  # fmt: skip

    def watch(given: Any, out: Any, size: int, physical: int) -> None:
        with driven(INSTEAD):
            written = carried(out)
            each[math.ceil(len(given.states) / THREADS), THREADS](
                carried(given), written, carried(rooms(len(given.states), size, physical))
            )
            for name in out._fields:
                getattr(out, name)[...] = getattr(written, name).copy_to_host()

    for number in numbers:
        keep(number, *run_block(plan, number, watch, alone=_refused))


def _refused(plan: Plan, steps: tuple[int, ...]) -> Any:
    raise ModelError(
        repr(plan.at(steps)[0]),
        "a GPU marches one mass under laws of linear modes with at most one tone",
        'take engine="threads"',
    )
