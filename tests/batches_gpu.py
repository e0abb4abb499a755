"""The compiled march of many oscillators on a GPU, one to a thread."""

from __future__ import annotations

import math

from numba import cuda

import batches
from batches import Batch, Given, Rooms
from stickslip.compiled import dispatcher_of
from stickslip.maps.cuda import THREADS, carried

march_one = dispatcher_of(batches.march_one)


@cuda.jit
def march_thread(given, out, rooms):
    """March the motion of this thread."""
    i = cuda.grid(1)
    if i < given.which.shape[0]:
        march_one(i, given, out, rooms)


def march_all(given: Given, out: Batch, rooms: Rooms) -> None:
    """March every motion on the GPU and bring home what was written."""
    written = carried(out)
    march_thread[math.ceil(len(given.which) / THREADS), THREADS](carried(given), written, carried(rooms))
    for name in Batch._fields:
        getattr(out, name)[...] = getattr(written, name).copy_to_host()
