"""What runs in a worker's process: requests come by its standard input, answers leave by its standard output."""

from __future__ import annotations

import json
import math
import os
import signal
import sys
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from typing import Any, BinaryIO

import stickslip as ss
from stickslip.lab import drawn
from stickslip.lab.task import bound
from stickslip.lab.workers import ANSWER, HEAD, frame

MEMORY = 4 * 2**30  # bytes of data
PATIENCE = 30.0  # s of one run
ANSWERS = {**drawn.ANSWERS, **drawn.MAPS}


class Overtaken(BaseException):
    """No one waits for this answer any more."""


class Patience:
    """What a long run asks some ten times a second: whether to go on."""

    def __init__(self) -> None:
        self.overtaken, self.until = False, math.inf
        self.unasked, self.compiling = False, 0
        signal.signal(signal.SIGINT, self._interrupted)

    def _interrupted(self, *_: object) -> None:
        self.overtaken = True
        if self.unasked and not self.compiling:  # numba is not left in the middle: it ends, or its process is ended
            raise Overtaken

    @contextmanager
    def interrupting(self) -> Iterator[None]:
        """What does not ask whether to go on is interrupted as by Ctrl-C."""
        self.unasked = True
        try:
            self()
            yield
        finally:
            self.unasked = False

    def begin(self) -> None:
        """A new request; its time runs from its first question, when all is compiled."""
        self.overtaken, self.until, self.compiling = False, math.inf, 0

    def __call__(self, share: float = 0.0) -> None:
        """Go on, or raise."""
        if self.overtaken:
            raise Overtaken
        self.until = min(self.until, time.monotonic() + PATIENCE)
        if time.monotonic() > self.until:
            raise ss.errors.SolveError(
                f"the run is {100 * share:.0f} % done after {PATIENCE:g} s",
                "the page waits no longer",
                "ask for fewer cycles, or run it with stickslip simulate",
            )


def answered(request: dict[str, Any], patience: Patience) -> bytes:
    """The answer to a request, whatever it is."""
    reply = {"id": request.get("id"), "want": request.get("want")}
    patience.begin()
    try:
        with patience.interrupting() if request["want"] in drawn.MAPS else nullcontext():
            header, arrays = ANSWERS[request["want"]](request, patience)
        return frame({**reply, "kind": request["want"], **header}, arrays)
    except Overtaken:
        return frame({**reply, "kind": "overtaken"})
    except ss.StickslipError as error:
        return frame({**reply, "kind": "error", "error": str(error)})
    except MemoryError:
        return frame(
            {**reply, "kind": "error", "error": "This needs more memory than the page may take; ask for less."}
        )
    except Exception as error:  # noqa: BLE001  # one sentence to one user; the others go on
        sentence = f"The lab can not answer this ({type(error).__name__}: {error}); change what was changed last."
        return frame({**reply, "kind": "error", "error": sentence})


def listen(patience: Patience, say: Callable[[], None]) -> None:
    """Have it said whenever numba begins to compile, which it does not for what it finds on disk."""
    from numba.core import event

    class Listener(event.Listener):  # type: ignore[misc]  # numba tells no types
        def on_start(self, event: Any) -> None:
            patience.compiling += 1
            say()

        def on_end(self, event: Any) -> None:
            patience.compiling -= 1

    event.register("numba:compile", Listener())


def serve(requests: BinaryIO, answers: BinaryIO) -> None:
    """Answer one request after the other until there are no more; say of each once that it compiles, where it does."""
    patience = Patience()
    under_way: dict[str, Any] = {}

    def write(answer: bytes, *, last: bool) -> None:
        answers.write(ANSWER.pack(last, len(answer)) + answer)
        answers.flush()

    def compiling() -> None:
        if under_way:
            write(frame({**under_way, "kind": "compiling"}), last=False)
            under_way.clear()

    def answer(request: dict[str, Any]) -> bytes:
        under_way.update(id=request.get("id"), want=request.get("want"))
        try:
            return answered(request, patience)
        finally:
            under_way.clear()

    listening = False
    while len(head := requests.read(HEAD.size)) == HEAD.size:
        request = json.loads(requests.read(HEAD.unpack(head)[0]))
        catalog = request.get("want") == "catalog"  # which needs no kernel, and comes first
        if catalog:
            write(answer(request), last=True)
        if not listening:
            listen(patience, compiling)
            listening = True
        if catalog:  # while the page draws its form, the kernels are loaded
            answer({"want": "run", "state": drawn.first_state()})
        else:
            write(answer(request), last=True)


def main() -> None:
    """Serve on this process's own pipes; what else is printed goes to the error stream."""
    bound(RLIMIT_DATA=MEMORY)
    # what overflows is refused in a sentence; the terminal is the user's
    warnings.simplefilter("ignore", RuntimeWarning)
    with os.fdopen(os.dup(1), "wb") as answers:
        os.dup2(2, 1)
        serve(sys.stdin.buffer, answers)


if __name__ == "__main__":
    main()
