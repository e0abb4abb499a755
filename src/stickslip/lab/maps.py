"""A regime map while one looks: coarse in strips, then finer in each where the answer changes."""

from __future__ import annotations

import asyncio
import math
from collections.abc import AsyncIterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from starlette.routing import BaseRoute, WebSocketRoute
from starlette.websockets import WebSocket

from stickslip.lab.frames import frame, unframed
from stickslip.lab.play import asked, conversation, readable, telling

WANTED = ("map", "cancel")
COUNTED = ("stops", "micro_slips", "period")  # where an answer jumps, its border is refined
STRIP, MOST, HALVINGS = 2, 64, 3  # columns at a time, points along an axis, of a border


class Unanswered(Exception):
    """A part of the map has no answer: the message says why."""


async def _map(socket: WebSocket) -> None:
    """One map at a time: a new request, or the word cancel, ends the one before."""
    newest: list[dict[str, Any]] = []
    come = asyncio.Event()
    drawing: list[asyncio.Task[None]] = []

    def heard(message: Mapping[str, Any]) -> None:
        newest[:] = [readable(message, WANTED)]
        for task in drawing:
            task.cancel()
        come.set()

    async def drawn(request: dict[str, Any]) -> None:
        reply = {"id": request["id"], "want": "map"}
        try:
            async for header, arrays in _parts(socket, request):
                await socket.send_bytes(frame({**reply, "kind": "part", **header}, arrays))
            await socket.send_bytes(frame({**reply, "kind": "done"}))
        except Unanswered as error:
            await socket.send_bytes(frame({**reply, "kind": "error", "error": str(error)}))

    async def work() -> None:
        while await come.wait():
            come.clear()
            request = newest.pop()
            if request["want"] == "cancel":
                await socket.send_bytes(frame({"id": request["id"], "want": "map", "kind": "cancelled"}))
                continue
            drawing[:] = [asyncio.create_task(drawn(request))]
            try:
                await asyncio.wait(drawing)
            finally:
                (done := drawing.pop()).cancel()
            if not done.cancelled():
                done.result()  # a fault of ours is told as one, and ends the conversation

    await conversation(socket, heard, work)


async def _parts(
    socket: WebSocket, request: Mapping[str, Any]
) -> AsyncIterator[tuple[dict[str, Any], dict[str, NDArray[np.float64]]]]:
    """Values on rectangles of the map, with the share that is done."""
    names, (xs, ys) = _axes(request)
    values = np.full((len(xs), len(ys)), math.nan)
    coarse = range(0, len(xs), STRIP)
    for number, begin in enumerate(coarse, start=1):
        part = xs[begin : begin + STRIP]
        values[begin : begin + STRIP] = await _asked(socket, request, names, part, ys, want="sweep")
        yield (
            {"level": "coarse", "done": number, "of": len(coarse)},
            {"x": part, "y": ys, "values": values[begin : begin + STRIP].ravel()},
        )
    strips = _changing(values) if request["measure"] in COUNTED else []
    for number, (i, begin, end) in enumerate(strips, start=1):
        x, y = xs[i : i + 2], ys[begin:end]
        found = await _asked(socket, request, names, x, y, want="refine")
        yield (
            {"level": "fine", "done": number, "of": len(strips)},
            {"x": _finer(x), "y": _finer(y), "values": found.ravel()},
        )


def _finer(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Each interval halved as often as a border is."""
    part = 2**HALVINGS
    finer: NDArray[np.float64] = np.interp(
        np.arange((len(values) - 1) * part + 1) / part, np.arange(len(values)), values
    )
    return finer


def _axes(request: Mapping[str, Any]) -> tuple[list[str], list[NDArray[np.float64]]]:
    """Names and values of the two parameters."""
    names, values = [], []
    for side in ("x", "y"):
        axis = request.get(side)
        try:
            name, low, high, count = str(axis["name"]), float(axis["from"]), float(axis["to"]), int(axis["count"])  # type: ignore[index]
        except (TypeError, KeyError, ValueError, OverflowError):
            raise Unanswered(f"The map's {side} has a name, from, to, and count; give all four.") from None
        if not (math.isfinite(low) and math.isfinite(high) and low < high and 2 <= count <= MOST):
            raise Unanswered(f"The map's {side} goes from a number to a larger one in 2 to {MOST} points; correct it.")
        names.append(name)
        values.append(np.linspace(low, high, count))
    if names[0] == names[1] or not isinstance(request.get("measure"), str):
        raise Unanswered("A map is of one measure over two different parameters; choose others.")
    return names, values


async def _asked(
    socket: WebSocket, request: Mapping[str, Any], names: list[str], x: Any, y: Any, *, want: str
) -> NDArray[np.float64]:
    grid = {names[0]: x.tolist(), names[1]: y.tolist()}
    asking = {"id": request["id"], "want": want, "state": request.get("state"), "measure": request["measure"],
              "grid": grid, "halvings": HALVINGS}  # fmt: skip
    header, arrays = unframed(await asked(socket.app.state.workers, asking, tell=telling(socket)))
    if header["kind"] != want:
        raise Unanswered(header.get("error", "The map was given up; draw it again."))
    values: NDArray[np.float64] = arrays["values"].reshape(header["shape"])
    return values


def _changing(values: NDArray[np.float64]) -> list[tuple[int, int, int]]:
    """Between which neighbouring columns, and from which to before which row, the answer changes."""
    whole = np.nan_to_num(np.round(values), nan=-3.0)
    corners = np.stack([whole[:-1, :-1], whole[1:, :-1], whole[:-1, 1:], whole[1:, 1:]])
    cells = []
    for i, unlike in enumerate(corners.min(axis=0) != corners.max(axis=0)):
        rows = np.flatnonzero(unlike)
        if len(rows):
            cells.append((i, int(rows[0]), int(rows[-1]) + 2))
    return cells


routes: list[BaseRoute] = [WebSocketRoute("/map", _map)]
