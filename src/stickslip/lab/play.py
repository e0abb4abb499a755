"""The page's questions of a system: over a socket while sliders move, the newest first; the rest by plain requests.

A regime map while one looks is coarse in strips, then finer in each where the answer changes.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import math
from collections.abc import AsyncIterator, Callable, Coroutine, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import BaseRoute, Route, WebSocketRoute
from starlette.websockets import WebSocket, WebSocketDisconnect

from stickslip.lab.openapi import described
from stickslip.lab.workers import Tell, Worker, Workers, frame, unframed

COUNTED = ("stops", "micro_slips", "period")  # where an answer jumps, its border is refined
STRIP, SIDE, HALVINGS = 2, 64, 3  # columns at a time, points along an axis, of a border


class Unanswered(Exception):
    """A part of the map has no answer: the message says why."""


async def _map(socket: WebSocket) -> None:
    """One map at a time: a new request, or the word cancel, ends the one before."""
    newest: list[dict[str, Any]] = []
    come = asyncio.Event()
    drawing: list[asyncio.Task[None]] = []

    def heard(message: Mapping[str, Any]) -> None:
        newest[:] = [readable(message, ("map", "cancel"))]
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
        values[begin : begin + STRIP] = await _values_of(socket, request, names, part, ys, want="sweep")
        part_values = values[begin : begin + STRIP].ravel()
        yield {"level": "coarse", "done": number, "of": len(coarse)}, {"x": part, "y": ys, "values": part_values}
    strips = _changing(values) if request["measure"] in COUNTED else []
    for number, (i, begin, end) in enumerate(strips, start=1):
        x, y = xs[i : i + 2], ys[begin:end]
        finer = await _values_of(socket, request, names, x, y, want="refine")
        arrays = {"x": _finer(x), "y": _finer(y), "values": finer.ravel()}
        yield {"level": "fine", "done": number, "of": len(strips)}, arrays


def _finer(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Each interval halved as often as a border is."""
    part = 2**HALVINGS
    at = np.arange((len(values) - 1) * part + 1) / part
    finer: NDArray[np.float64] = np.interp(at, np.arange(len(values)), values)
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
        if not (math.isfinite(low) and math.isfinite(high) and low < high and 2 <= count <= SIDE):
            raise Unanswered(f"The map's {side} goes from a number to a larger one in 2 to {SIDE} points; correct it.")
        names.append(name)
        values.append(np.linspace(low, high, count))
    if names[0] == names[1] or not isinstance(request.get("measure"), str):
        raise Unanswered("A map is of one measure over two different parameters; choose others.")
    return names, values


async def _values_of(
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


QUICK, SLOW = ("run", "tell"), ("sound", "wavelet", "sweep", "refine", "warm")
WARMED_AFTER = 2.0  # s after a page was opened: it is drawn by then
AFRESH = 1.5  # s: a run of another law does not wait longer for one that no one wants any more
WANTED = (*QUICK, "sound", "wavelet")  # of the page, in the order in which they are answered
STATE = {
    "type": "object",
    "required": ["system"],
    "properties": {
        "about": {"type": "string"}, "system": {"type": "object"}, "law": {"type": "object"},
        "contacts": {"type": "array", "items": {"type": "object"}}, "drive": {"type": "object"},
        "start": {"type": "object"}, "run": {"type": "object"},
    },
}  # fmt: skip


async def asked(
    workers: Workers, request: Mapping[str, Any], *, lent: list[Worker] | None = None, tell: Tell | None = None
) -> bytes:
    """A worker's answer, or in one sentence what befell the worker; that it compiles is told to `tell`."""
    header = {"id": request.get("id"), "want": request.get("want"), "kind": "error"}
    slow = request["want"] in SLOW
    try:
        if tell is not None and slow and workers.slow.locked() and workers.compiling:
            await tell(frame({**header, "kind": "compiling"}))
        async with workers.slow if slow else contextlib.nullcontext():
            asking = json.dumps(request).encode()
            return await workers.ask(asking, lent=lent, tell=tell, rested=request["want"] == "warm")
    except TimeoutError:
        return frame({**header, "error": "This takes longer than the page waits; ask for less."})
    except EOFError:
        return frame({**header, "error": "The computation ended without an answer; change what was changed last."})


async def warmed(workers: Workers, opened: asyncio.Event) -> None:
    """Beside a page that was opened, load or compile what its first map needs."""
    await opened.wait()
    await asyncio.sleep(WARMED_AFTER)
    await asked(workers, {"id": None, "want": "warm"})


def readable(message: Mapping[str, Any], wanted: tuple[str, ...]) -> dict[str, Any]:
    """The request in a socket's message.

    Raises
    ------
    ValueError
        It is none; the words say what is missing.
    """
    try:
        request = json.loads(message.get("text") or "")
    except (ValueError, RecursionError) as error:
        raise ValueError("A message to the lab is text in JSON.") from error
    if not isinstance(request, dict) or request.get("want") not in wanted or not isinstance(request.get("id"), int):
        raise ValueError(f"A message to the lab has a whole number as id, and wants one of {', '.join(wanted)}.")
    return request


async def conversation(
    socket: WebSocket, heard: Callable[[Mapping[str, Any]], None], work: Callable[[], Coroutine[Any, Any, None]]
) -> None:
    """Hear each message while the work goes on, until the page has gone."""
    await socket.accept()
    working = asyncio.create_task(work())
    hearing = asyncio.create_task(socket.receive())
    try:
        while True:
            await asyncio.wait((working, hearing), return_when=asyncio.FIRST_COMPLETED)
            if working.done() or (message := hearing.result())["type"] == "websocket.disconnect":
                break
            hearing = asyncio.create_task(socket.receive())
            try:
                heard(message)
            except ValueError as error:
                await socket.send_bytes(frame({"id": None, "kind": "error", "error": str(error)}))
    except (WebSocketDisconnect, RuntimeError):  # it went while it was spoken to
        pass
    finally:
        for task in (working, hearing):
            task.cancel()
        await asyncio.wait((working, hearing))
        failed = None if working.cancelled() else working.exception()
        if failed is not None:
            _require_gone(failed)


def telling(socket: WebSocket) -> Tell:
    """What sends word to a page, if it is still there."""

    async def tell(message: bytes) -> None:
        with contextlib.suppress(WebSocketDisconnect, RuntimeError):
            await socket.send_bytes(message)

    return tell


def _require_gone(error: BaseException) -> None:
    """Work may end because the page went; anything else is raised."""
    inner = error.exceptions if isinstance(error, BaseExceptionGroup) else (error,)
    if not all(isinstance(error, WebSocketDisconnect | RuntimeError) for error in inner):
        raise error


async def _play(socket: WebSocket) -> None:
    """Of each kind of request the newest is answered, slow ones beside the quick; what is overtaken ends early."""
    quick, slow = _Line(socket), _Line(socket)

    def heard(message: Mapping[str, Any]) -> None:
        request = readable(message, (*WANTED, "cancel"))
        cancelled = request["want"] == "cancel"
        if cancelled:
            quick.waiting.clear()
            slow.waiting.clear()
        else:
            (quick if request["want"] in QUICK else slow).put(request)
        if cancelled or request["want"] == "run":
            for worker in (*quick.lent, *slow.lent):
                worker.interrupt(within=AFRESH if cancelled or request.get("afresh") else None)

    async def work() -> None:
        async with asyncio.TaskGroup() as both:
            both.create_task(quick.work())
            both.create_task(slow.work())

    await conversation(socket, heard, work)


class _Line:
    """Requests of one page that wait for a worker one after the other, the newest of each kind."""

    def __init__(self, socket: WebSocket) -> None:
        self.socket, self.come = socket, asyncio.Event()
        self.waiting: dict[str, dict[str, Any]] = {}
        self.lent: list[Worker] = []

    def put(self, request: dict[str, Any]) -> None:
        """Let a request wait; an older one of its kind is forgotten."""
        self.waiting[request["want"]] = request
        self.come.set()

    async def work(self) -> None:
        """Answer what waits."""
        while await self.come.wait():
            self.come.clear()
            while self.waiting:
                request = self.waiting.pop(min(self.waiting, key=WANTED.index))
                tell = telling(self.socket)
                answer = await asked(self.socket.app.state.workers, request, lent=self.lent, tell=tell)
                await self.socket.send_bytes(answer)


async def _answer(request: Request, asking: Mapping[str, Any]) -> Response:
    header, _ = unframed(await asked(request.app.state.workers, asking))
    if header["kind"] == "error":
        raise HTTPException(422, header["error"])
    return JSONResponse({name: value for name, value in header.items() if name not in ("id", "want", "kind")})


async def _body(request: Request) -> Any:
    try:
        return json.loads(await request.body())
    except (ValueError, RecursionError) as error:
        raise HTTPException(400, "The request holds no JSON; send an object.") from error


@described("All laws and drives with their parameters, and what plays first", answer={"type": "object"})
async def _catalog(request: Request) -> Response:
    request.app.state.opened.set()
    return await _answer(request, {"want": "catalog"})


@described("Den Hartog's line over the frequency ratio", answer={"type": "object", "required": ["boundary"]})
async def _boundary(request: Request) -> Response:
    return await _answer(request, {"want": "boundary"})


@described("The scenarios, and what is said of them", answer={"type": "object", "required": ["presets"]})
async def _presets(request: Request) -> Response:
    return await _answer(request, {"want": "presets"})


@described("The state of a scenario", answer={"type": "object", "required": ["state"]})
async def _preset(request: Request) -> Response:
    return await _answer(request, {"want": "preset", "name": request.path_params["name"]})


@described(
    "A state as a system's file in TOML and as a Python program",
    body=STATE,
    answer={"type": "object", "required": ["toml", "python"]},
)
async def _export(request: Request) -> Response:
    return await _answer(request, {"want": "export", "state": await _body(request)})


@described(
    "The state of a system's file",
    body={"type": "string"},
    media="text/plain",
    answer={"type": "object", "required": ["state"]},
)
async def _open(request: Request) -> Response:
    return await _answer(request, {"want": "open", "text": (await request.body()).decode("utf-8", "replace")})


routes: list[BaseRoute] = [
    WebSocketRoute("/play", _play),
    WebSocketRoute("/map", _map),
    Route("/catalog", _catalog),
    Route("/boundary", _boundary),
    Route("/scenarios", _presets),
    Route("/scenarios/{name}", _preset),
    Route("/export", _export, methods=["POST"]),
    Route("/open", _open, methods=["POST"]),
]
