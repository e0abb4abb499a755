"""A few processes that compute for the page, and the messages that pass: JSON and arrays as they lie in memory.

None of what such a process meets can take the server with it."""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import signal
import struct
import sys
from collections.abc import Awaitable, Callable, Mapping
from types import TracebackType
from typing import Any

import numpy as np

EDGE = 8  # bytes: where arrays of doubles may begin
KINDS = {"f": "<f8", "i": "<i4", "u": "u1"}
LONGEST = 180.0  # s of one answer, the first compilation of a law included
ABANDONED = 5.0  # s that a worker may go on with what no one waits for: a compilation that ends by then is kept
HEAD = struct.Struct("<I")  # of a request: its length
ANSWER = struct.Struct("<?I")  # of what comes back: whether it is the answer, or word on the way; its length
Tell = Callable[[bytes], Awaitable[None]]
INTERRUPTIBLE = os.name == "posix"


def frame(header: Mapping[str, Any], arrays: Mapping[str, Any] | None = None) -> bytes:
    """Length of the header, the header, and the arrays that it names, each on an edge of eight bytes."""
    kept = {name: np.ascontiguousarray(values) for name, values in (arrays or {}).items()}
    kept = {name: values.astype(KINDS[values.dtype.kind], copy=False) for name, values in kept.items()}
    table = [[name, KINDS[values.dtype.kind], values.size] for name, values in kept.items()]
    text = json.dumps({**header, "arrays": table}, ensure_ascii=False, allow_nan=False).encode()
    text += b" " * (-(len(text) + 4) % EDGE)
    bodies = (values.tobytes() for values in kept.values())
    return b"".join([struct.pack("<I", len(text)), text, *(body + bytes(-len(body) % EDGE) for body in bodies)])


def unframed(message: bytes) -> tuple[dict[str, Any], dict[str, Any]]:
    """The header and the arrays of a message, as the page reads them."""
    (length,) = struct.unpack_from("<I", message)
    header = json.loads(message[4 : 4 + length])
    arrays, place = {}, 4 + length
    for name, kind, size in header.pop("arrays"):
        arrays[name] = np.frombuffer(message, kind, size, place)
        place += arrays[name].nbytes + -arrays[name].nbytes % EDGE
    return header, arrays


class Worker:
    """One process: a request in, an answer out."""

    def __init__(self) -> None:
        self.process: asyncio.subprocess.Process | None = None
        self.answers, self.ready = 0, False  # ready: it has answered, and listens to an interrupt
        self.word: bytes | None = None  # what it said last on the way to its answer: that it compiles

    async def answer(self, request: bytes, tell: Tell | None = None) -> bytes:
        """The answer to a request; the process is started where it does not run, and ended where it takes too long.

        What it says on the way is passed on to `tell`.
        """
        process = await self.started()
        assert process.stdin is not None
        assert process.stdout is not None
        try:
            process.stdin.write(HEAD.pack(len(request)) + request)
            await process.stdin.drain()
            async with asyncio.timeout(LONGEST):
                last = False
                while not last:
                    last, length = ANSWER.unpack(await process.stdout.readexactly(ANSWER.size))
                    answer = await process.stdout.readexactly(length)
                    self.word = None if last else answer
                    if tell is not None and not last:
                        await tell(answer)
                self.answers, self.ready = self.answers + 1, True
                return answer
        except BaseException:
            await self.end()  # what it would still say belongs to no one
            raise

    async def started(self) -> asyncio.subprocess.Process:
        """The process, running."""
        if self.process is None or self.process.returncode is not None:
            self.ready = False
            self.process = await asyncio.create_subprocess_exec(
                sys.executable,
                "-P",
                "-m",
                "stickslip.lab.worker",
                stdin=asyncio.subprocess.PIPE,
                stdout=asyncio.subprocess.PIPE,
                limit=2**22,
                env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
            )
        return self.process

    def interrupt(self, *, within: float | None = None) -> None:
        """Tell it that no one waits any more: a long run ends early, a short one is done before.

        What does not end within some seconds, as a compilation, is ended with its process.
        """
        if INTERRUPTIBLE and self.ready:
            self._signal(signal.SIGINT)
        if within is not None:
            asyncio.get_running_loop().call_later(within, self._end_at, self.process, self.answers)

    def _end_at(self, process: asyncio.subprocess.Process | None, answers: int) -> None:
        if process is self.process and answers == self.answers:
            self._signal(signal.SIGKILL if INTERRUPTIBLE else signal.SIGTERM)

    def _signal(self, number: int) -> None:
        """A signal, sent without asking for the exit status, which asyncio waits for."""
        if self.process is not None and self.process.returncode is None:
            with contextlib.suppress(ProcessLookupError):
                os.kill(self.process.pid, number)

    async def end(self) -> None:
        """End the process."""
        self._signal(signal.SIGKILL if INTERRUPTIBLE else signal.SIGTERM)
        process, self.process, self.word = self.process, None, None
        if process is not None:
            await process.wait()


class Workers:
    """Some of them, each lent to one request at a time.

    Parameters
    ----------
    count : int
        How many.
    """

    def __init__(self, count: int) -> None:
        self.all = [Worker() for _ in range(count)]
        self.free: asyncio.LifoQueue[Worker] = asyncio.LifoQueue()  # who has worked is warm
        self.slow = asyncio.Semaphore(max(1, count - 1))  # slow answers leave one worker to the quick ones

    async def __aenter__(self) -> Workers:
        for worker in self.all:
            self.free.put_nowait(worker)
        await self.all[-1].started()  # the others when they are needed
        return self

    async def __aexit__(self, kind: type | None, error: BaseException | None, trace: TracebackType | None) -> None:
        for worker in self.all:
            await worker.end()

    @property
    def compiling(self) -> bool:
        """Whether one of them compiles."""
        return any(worker.word is not None for worker in self.all)

    async def ask(
        self, request: bytes, *, lent: list[Worker] | None = None, tell: Tell | None = None, rested: bool = False
    ) -> bytes:
        """The answer of the first that is free; while it works it stands in `lent`, where it can be interrupted.

        Of several that are free it is the one that worked last, or with `rested` the one that did not.

        That it compiles is passed on to `tell`.

        Raises
        ------
        TimeoutError
            It took too long.
        EOFError
            The process ended over it.
        """
        worker = self._rested() if rested and not self.free.empty() else await self.free.get()
        lent = [] if lent is None else lent
        lent.append(worker)
        answer = asyncio.create_task(worker.answer(request, tell))
        answer.add_done_callback(lambda done: self._freed(worker, done))
        try:
            return await asyncio.shield(answer)
        except asyncio.CancelledError:
            worker.interrupt(within=ABANDONED)  # it ends what it does, and is free then
            raise
        except (ConnectionError, asyncio.IncompleteReadError) as error:
            raise EOFError("the process ended") from error
        finally:
            lent.remove(worker)

    def _rested(self) -> Worker:
        """Of those that are free, the one that has worked least lately."""
        free = [self.free.get_nowait() for _ in range(self.free.qsize())]
        for worker in reversed(free[:-1]):
            self.free.put_nowait(worker)
        return free[-1]

    def _freed(self, worker: Worker, answer: asyncio.Task[bytes]) -> None:
        if not answer.cancelled():
            answer.exception()  # told to who asked, where someone still waits
        self.free.put_nowait(worker)
