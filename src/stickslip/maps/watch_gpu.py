"""The watch on an NVIDIA GPU: one motion to a thread."""

from __future__ import annotations

from numba import cuda

from stickslip.maps.watch import watch_one

THREADS = 64  # of a block


@cuda.jit
def each(given, out, rooms):
    """March and count the motion of this thread."""
    i = cuda.grid(1)
    if i < given.states.shape[0]:
        watch_one(i, i, given, out, rooms)
