"""One analysis in a process of its own: reads what was asked from a file, tells how far it is, leaves its answer."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

ASK, ANSWER = "ask.json", "answer.json"
# What a page's analysis has no use for, and a file that takes over its reader would.
FORBIDDEN = (
    "socket.connect", "socket.bind", "socket.sendto", "socket.getaddrinfo", "subprocess.Popen", "os.system", "os.exec",
    "os.posix_spawn", "os.fork", "os.forkpty", "os.startfile",
)  # fmt: skip


def main() -> int:
    """Answer what ask.json of a folder asks, into its answer.json."""
    os.chdir(sys.argv[1])
    from stickslip import StickslipError

    ask = json.loads(Path(ASK).read_text(encoding="utf-8"))
    limit(**ask.pop("limits"))
    from stickslip.lab.questions import QUESTIONS, Query, on_the_page

    say = _line_by_line()
    try:
        answer = QUESTIONS[ask["question"]](Query.of(ask, say))
    except StickslipError as error:
        return _leave({"refused": on_the_page(str(error))}, 1)
    except MemoryError:
        return _leave({"refused": "The record and what is made of it do not fit in memory; cut it to fewer rows."}, 1)
    return _leave({"answer": answer}, 0)


def limit(*, memory: int, processor: float, written: int) -> None:
    """Bound what this process may take, and what it may do: no network, no other program."""
    sys.addaudithook(_forbid)
    bound(RLIMIT_AS=memory, RLIMIT_CPU=int(processor), RLIMIT_FSIZE=written, RLIMIT_CORE=0)


def _forbid(event: str, arguments: tuple[Any, ...]) -> None:
    if event in FORBIDDEN:
        raise PermissionError(f"{event} is not for an analysis")


def _line_by_line() -> Callable[[str, float], None]:
    """How far it is, on the line to the lab; whatever else is printed goes to the error stream."""
    line = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)

    def say(sentence: str, share: float) -> None:
        line.write(json.dumps({"words": sentence, "share": min(max(share, 0.0), 1.0)}) + "\n")
        line.flush()

    return say


def _leave(answer: Mapping[str, Any], code: int) -> int:
    text = json.dumps(answer, ensure_ascii=False, allow_nan=False)
    Path(ANSWER).write_text(text, encoding="utf-8")
    return code


def bound(**most: int) -> None:
    """Bound this process, by the names of `resource`: ``RLIMIT_AS`` in bytes, ``RLIMIT_CPU`` in s of processor time.

    Where the system has no such limit (Windows), or refuses it (macOS, of memory), the time that is given for an answer
    is the only bound.
    """
    try:
        import resource
    except ImportError:
        return
    for name, value in most.items():
        what = getattr(resource, name, None)
        if what is None:
            continue
        hard = resource.getrlimit(what)[1]
        with suppress(ValueError, OSError):
            resource.setrlimit(what, (value if hard < 0 else min(value, hard), hard))


if __name__ == "__main__":
    sys.exit(main())
