"""One block after another: the engine that the others are held to."""

from __future__ import annotations

from collections.abc import Sequence

from stickslip.maps.block import run_block
from stickslip.maps.plan import Keep, Plan


def serial(plan: Plan, numbers: Sequence[int], keep: Keep, address: str | None = None) -> None:
    """Run the blocks in turn."""
    for number in numbers:
        keep(number, *run_block(plan, number))
