"""A rig watched live: one device at a time, for every page that is open; record, mark, stop, move its outputs."""

from __future__ import annotations

import asyncio
import math
import queue
import threading
import time
from collections.abc import AsyncIterator, Callable, Iterable, Mapping
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass, field, replace
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from starlette.applications import Starlette
from starlette.routing import BaseRoute, WebSocketRoute
from starlette.websockets import WebSocket

import stickslip as ss
import stickslip.bench as bench
from stickslip.lab.play import conversation, readable
from stickslip.lab.workers import frame
from stickslip.workers import pool

WANTED = ("open", "close", "record", "stop", "mark", "drive")
BINS = 250.0  # a second of each trace: the lowest and the highest sample in each are drawn
WATCHERS = 64  # pages at a time
BEHIND = 8  # messages that a page may be behind; older ones are skipped
LONGEST_MARK = 200  # letters
EVERY = 0.5  # s between two answers: each takes a processor for 0.2 s at 4 channels of 20 kHz, and one reads no faster


@dataclass(frozen=True)
class Place:
    """What the lab may open, and where it writes.

    Attributes
    ----------
    tables : mapping
        ``[devices.NAME]`` of the rig's file.
    folder : Path
        Where paths in them begin.
    records : Path
        Where recordings go.
    constants : mapping of str to float
        mass, stiffness and damping, where stated.
    log : Log or None
        What goes with every record.
    """

    tables: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    folder: Path = Path()
    records: Path = Path()
    constants: Mapping[str, float] = field(default_factory=dict)
    log: Any = None


def place_of(rig: Path | None, records: Path | None) -> Place:
    """What a rig's file allows to open, and where recordings go."""
    folder = records or Path()
    if rig is None:
        return Place(records=folder)
    settings = ss.rig.read_rig(rig)
    stated = {name: getattr(settings, name) for name in ("mass", "stiffness", "damping")}
    constants = {name: float(value) for name, value in stated.items() if value is not None}
    return Place(settings.devices, rig.parent, folder, constants, settings.log)


class Live:
    """The device that is open, and who watches. Lives as long as the lab."""

    def __init__(self, place: Place) -> None:
        self.place, self.watchers = place, set[asyncio.Queue[bytes]]()
        self.session: Session | None = None
        self.last: bytes | None = None
        self.loop = asyncio.get_running_loop()
        self.changing = asyncio.Lock()

    @property
    def names(self) -> list[str]:
        """What can be opened."""
        return [*self.place.tables, *([] if "sim" in self.place.tables else ["sim"])]

    def state(self, **more: Any) -> bytes:
        """What a page has to know first."""
        session = self.session
        state: dict[str, Any] = {"kind": "state", "devices": self.names, "open": None, **more}
        if session is not None:
            device = session.device
            state |= {"open": session.name, "model": device.model, "fs": device.fs, "failed": session.failed}
            state["inputs"] = [
                {"name": one.name, "unit": one.unit, "limit": one.limit if math.isfinite(one.limit) else None}
                for one in device.inputs
            ]
            state["outputs"] = [{"name": one.name, "unit": one.unit} for one in device.outputs]
        return frame(state)

    def publish(self, message: bytes) -> None:
        """Send to everybody; who is behind misses the oldest."""
        for watcher in self.watchers:
            if watcher.full():
                watcher.get_nowait()
            watcher.put_nowait(message)

    def tell(self, message: bytes) -> None:
        """The same, from the thread that measures."""
        with suppress(RuntimeError):  # the lab ends
            self.loop.call_soon_threadsafe(self.publish, message)

    async def open(self, name: str) -> None:
        """Open a device, after closing the one that is."""
        if name not in self.names:
            raise ss.errors.ModelError(
                f"no device is called '{name}'", f"there are {', '.join(self.names)}", "choose one"
            )
        async with self.changing:
            await self._close()
            place = self.place
            device = await asyncio.to_thread(bench.find_device, name, place.tables, folder=place.folder)
            if isinstance(device, bench.Sim):
                device = replace(device, fast=False)
            self.session = Session(name, device, place, self.tell, lambda: self.tell(self.state()))
            await asyncio.to_thread(self.session.start)
        self.publish(self.state())

    async def close(self) -> None:
        """Close what is open."""
        async with self.changing:
            await self._close()
        self.publish(self.state())

    async def _close(self) -> None:
        if self.session is not None:
            await asyncio.to_thread(self.session.end)
            self.session = None


class Session:
    """An open device, read by a thread of its own."""

    def __init__(
        self, name: str, device: bench.Device, place: Place, tell: Callable[[bytes], None], changed: Callable[[], None]
    ) -> None:
        self.name, self.device, self.place, self.tell, self.changed = name, device, place, tell, changed
        self.orders: queue.Queue[Mapping[str, Any]] = queue.Queue()
        self.ending, self.failed = threading.Event(), ""
        system = getattr(device, "system", None)
        names = ("mass", "stiffness", "damping") if isinstance(system, ss.Oscillator) else ()
        own = {name: getattr(system, name) for name in names}
        self.constants = {**own, **place.constants}
        self.monitor = bench.Monitor(device, self.constants)
        self.tape: bench.Tape | None = None
        self.began, self.rest, self.rest_at = 0.0, np.empty((len(device.inputs), 0)), 0
        self.said = ""
        self.thread = threading.Thread(target=self._run, daemon=True)
        # Numbers are found in another process: beside the reading, they kept samples from the page for 0.2 s a cycle.
        self.processes = pool(1, "stickslip.bench")
        self.numbers: Future[Any] | None = None
        self.due = 0.0

    def start(self) -> None:
        """Begin to read."""
        self.thread.start()

    def end(self) -> None:
        """Close the device; a recording under way becomes a record."""
        self.ending.set()
        self.thread.join()
        self.processes.shutdown(cancel_futures=True)

    def _run(self) -> None:
        try:
            with self.device.open() as stream:
                while not self.ending.is_set():
                    self._obey(stream)
                    block = stream.read(0.1)
                    if block is None:
                        self.failed = "The device has ended."
                        break
                    if block.samples.shape[1]:
                        self._look(block)
        except (ss.StickslipError, OSError) as error:
            self.failed = str(error)
        finally:
            self._stop()
            if self.failed:
                self.changed()

    def _obey(self, stream: bench.Stream) -> None:
        """Do what pages have ordered since."""
        while not self.orders.empty():
            order = self.orders.get()
            try:
                self._do(order, stream)
            except (ss.StickslipError, OSError) as error:
                self.said = str(error)

    def _do(self, order: Mapping[str, Any], stream: bench.Stream) -> None:
        want = order["want"]
        if want == "record" and self.tape is None:
            path = self.place.records / f"live-{datetime.now():%Y%m%d-%H%M%S}.h5"
            self.tape, self.began = bench.Tape(self.device, path, log=self.place.log), time.monotonic()
            self.said = f"Recording {path.name}."
        elif want == "stop":
            self._stop()
        elif want == "mark" and self.tape is not None:
            self.tape.mark(str(order.get("text") or "mark")[:LONGEST_MARK])
            self.said = "Marked."
        elif want == "drive":
            amplitude, frequency = float(order.get("amplitude") or 0.0), float(order.get("frequency") or 0.0)
            stream.drive(str(order.get("output")), bench.Tone(amplitude, frequency) if amplitude else None)
            self.said = (
                f"The {order.get('output')} moves by {amplitude:g} at {frequency:g} Hz." if amplitude else "It rests."
            )

    def _stop(self) -> None:
        tape, self.tape = self.tape, None
        if tape is None:
            return
        try:
            outcome = tape.close()
            self.said = f"{tape.finish().name}: {outcome}."
        except (ss.StickslipError, OSError) as error:
            self.said = str(error)

    def _look(self, block: bench.Block) -> None:
        """Keep a block, show it, and then judge what ended in it, which takes longer than the next one to come."""
        if self.tape is not None:
            self.tape.write(block)
        self.tell(self._frame(block))
        cycles = self.monitor.feed(block)
        for cycle in cycles:
            self.tell(_cycle(cycle, self.device.fs))
        if cycles and time.monotonic() > self.due and (self.numbers is None or self.numbers.done()):
            self._ask()

    def _frame(self, block: bench.Block) -> bytes:
        """A block as it is drawn: lowest and highest of each channel, bin by bin; the rest waits for the next one."""
        values, fs = bench.in_si(self.device, block), self.device.fs
        size = max(1, round(fs / BINS))
        if self.rest_at + self.rest.shape[1] == block.first:
            values = np.concatenate([self.rest, values], axis=1)
        first = block.after - values.shape[1]
        whole = values.shape[1] - values.shape[1] % size
        self.rest, self.rest_at = values[:, whole:], first + whole
        bins = values[:, :whole].reshape(len(values), -1, size)
        arrays: dict[str, NDArray[Any]] = {}
        for one, rows in zip(self.device.inputs, bins, strict=True):
            arrays[f"low {one.name}"], arrays[f"high {one.name}"] = rows.min(axis=1), rows.max(axis=1)
        oldest = time.time() - (time.monotonic() - block.clock) - values.shape[1] / fs
        recorded = time.monotonic() - self.began if self.tape is not None else None
        header = {"kind": "block", "first": first, "step": size / fs, "start": first / fs, "oldest": oldest}
        header |= {"recorded": recorded, "said": self.said, "lost": self.monitor.lost}
        return frame(header, arrays)

    def _ask(self) -> None:
        """Have the numbers of the last cycles found."""
        record = self.monitor.window()
        if record is not None:
            self.due = time.monotonic() + EVERY
            try:
                self.numbers = self.processes.submit(bench.answers, record, self.constants)
            except BrokenProcessPool:  # the reading goes on, and a recording with it; the next cycle asks the new one
                self.processes = pool(1, "stickslip.bench")
                self._show([], ["The process that finds the numbers was ended; another one begins."])
            else:
                self.numbers.add_done_callback(self._answered)

    def _answered(self, numbers: Future[Any]) -> None:
        """They came, or their process was ended: then the next cycle begins another."""
        if not numbers.cancelled() and not isinstance(numbers.exception(), BrokenProcessPool):
            self._show(*numbers.result())

    def _show(self, estimates: Iterable[ss.Estimate], untold: list[str]) -> None:
        """Numbers on every page, and why some are not there."""
        rows = [(line.name, line.value, line.interval) for line in map(ss.story.Line.of, estimates)]
        self.tell(frame({"kind": "numbers", "rows": rows, "untold": untold}))


def _cycle(cycle: bench.Cycle, fs: float) -> bytes:
    flaws = [flaw._asdict() for flaw in cycle.flaws]
    arrays = {name: getattr(cycle, name) for name in ("x", "v", "friction")}
    late = cycle.least_late if math.isfinite(cycle.least_late) else None
    about = {"kind": "cycle", "start": cycle.first / fs, "period": cycle.period, "flaws": flaws, "late": late}
    return frame(about, arrays)


async def _watch(socket: WebSocket) -> None:
    """One page that watches, and what it orders."""
    live: Live = socket.app.state.live
    if len(live.watchers) >= WATCHERS:
        await socket.close(1013, "as many pages watch as may")
        return
    watcher: asyncio.Queue[bytes] = asyncio.Queue(BEHIND)
    tasks: set[asyncio.Task[None]] = set()

    def heard(message: Mapping[str, Any]) -> None:
        request = readable(message, WANTED)
        task = asyncio.create_task(_ordered(live, request, watcher))
        tasks.add(task)
        task.add_done_callback(tasks.discard)

    async def work() -> None:
        await socket.send_bytes(live.state())
        while True:
            await socket.send_bytes(await watcher.get())

    live.watchers.add(watcher)
    try:
        await conversation(socket, heard, work)
    finally:
        live.watchers.discard(watcher)


async def _ordered(live: Live, request: Mapping[str, Any], watcher: asyncio.Queue[bytes]) -> None:
    """Do what a page asks; what can not be is told to it alone."""
    try:
        if request["want"] == "open":
            await live.open(str(request.get("device")))
        elif request["want"] == "close":
            await live.close()
        elif live.session is not None:
            live.session.orders.put(_order(request))
    except (ss.StickslipError, OSError) as error:
        message = frame({"kind": "error", "id": request["id"], "error": str(error)})
        if watcher.full():
            watcher.get_nowait()
        watcher.put_nowait(message)


def _order(request: Mapping[str, Any]) -> dict[str, Any]:
    """What a page orders, cut to what is known; nothing is no motion."""
    order = {"want": request["want"], "text": request.get("text"), "output": request.get("output")}
    for name in ("amplitude", "frequency"):
        value = request.get(name) or 0.0
        if not (isinstance(value, int | float) and math.isfinite(value)):
            raise ss.errors.ModelError(f"{name} = {str(value)[:20]!r}", "a motion is told in SI numbers", "correct it")
        order[name] = float(value)
    return order


@asynccontextmanager
async def lifespan(app: Starlette, place: Place) -> AsyncIterator[None]:
    """The live view, closed with the lab: a recording under way becomes a record."""
    app.state.live = Live(place)
    try:
        yield
    finally:
        await app.state.live.close()


routes: list[BaseRoute] = [WebSocketRoute("/live", _watch)]
