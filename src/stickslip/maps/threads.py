"""One block on each processor of this machine: the kernels let go of Python's lock while they march."""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, wait
from itertools import islice

from stickslip.maps.block import run_block
from stickslip.maps.plan import Keep, Plan


def processors() -> int:
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def threads(plan: Plan, numbers: Sequence[int], keep: Keep, address: str | None = None) -> None:
    """Run the blocks on as many threads as there are processors, or as `address` says; keep each in this thread.

    No more blocks are under way than twice the threads, so that memory stays flat; on an interrupt those not begun
    are dropped and those under way are kept.
    """
    count = int(address) if address else processors()
    left = iter(numbers)
    with ThreadPoolExecutor(count, "sweep") as pool:
        running = {pool.submit(run_block, plan, number): number for number in islice(left, 2 * count)}
        try:
            while running:
                for task in wait(running, return_when=FIRST_COMPLETED).done:
                    keep(running.pop(task), *task.result())
                    running |= {pool.submit(run_block, plan, number): number for number in islice(left, 1)}
        except KeyboardInterrupt:
            for task, number in running.items():
                if not task.cancel():
                    keep(number, *task.result())
            raise
