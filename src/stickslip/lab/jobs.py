"""Long work in processes of its own: started, watched line by line, limited, stopped."""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import secrets
import shutil
import signal
import sys
import time
from collections.abc import AsyncIterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from starlette.exceptions import HTTPException

from stickslip.lab.task import ANSWER, ASK
from stickslip.workers import processors

LONGEST_ANSWER = 64 << 20  # bytes
LONGEST_LINE = 1 << 16
KEPT_WORDS = 2000  # characters of what a broken worker said
PASSED_ON = (
    "PATH", "HOME", "LANG", "LC_", "TZ", "PYTHON", "VIRTUAL_ENV", "LD_LIBRARY_PATH", "DYLD_", "SYSTEMROOT", "APPDATA",
    "LOCALAPPDATA", "USERPROFILE", "XDG_CACHE_HOME", "XDG_CONFIG_HOME", "MPLCONFIGDIR", "NUMBA_", "COVERAGE_",
)  # fmt: skip


@dataclass(frozen=True)
class Limits:
    """What one analysis may take, and how many there may be.

    Attributes
    ----------
    memory : int
        Address space [bytes].
    processor, wall : float
        Processor time, and time by the clock [s].
    written : int
        Size of a file that it writes [bytes].
    at_once, waiting, kept : int
        Analyses that run at a time, that may wait for their turn, and whose answers are kept.
    """

    memory: int = 6 << 30
    processor: float = 1800.0
    wall: float = 3600.0
    written: int = 1 << 30
    at_once: int = processors()
    waiting: int = 64
    kept: int = 64


class Job:
    """One analysis: where it stands, and in which folder it leaves its answer.

    Its state is waiting, then running, then done, refused (by the library), broken (by itself) or cancelled.
    """

    def __init__(self, folder: Path, names: Mapping[str, str]) -> None:
        self.key, self.folder, self.names = folder.name, folder, names
        self.state, self.words, self.share, self.message = "waiting", "waiting for its turn", 0.0, ""
        self.answer: Any = None
        self.ended: float | None = None
        self.process: asyncio.subprocess.Process | None = None
        self.task: asyncio.Task[None] | None = None
        self.changed = asyncio.Event()

    def report(self) -> dict[str, Any]:
        """Where it stands, for the page."""
        return {"state": self.state, "words": self.words, "share": self.share, "message": self.message}

    def tell(self, **news: Any) -> None:
        """Take the news, and wake whoever watches."""
        for name, value in news.items():
            setattr(self, name, value)
        self.changed.set()
        self.changed = asyncio.Event()


class Jobs:
    """The analyses of this run."""

    def __init__(self, folder: Path, limits: Limits | None = None, *, worker: str = "stickslip.lab.task") -> None:
        self.folder, self.limits, self.worker = folder, limits or Limits(), worker
        self._jobs: dict[str, Job] = {}
        self._slots = asyncio.Semaphore(self.limits.at_once)

    def start(self, ask: Mapping[str, Any], *, names: Mapping[str, str]) -> Job:
        """Queue an analysis; `names` are the users' own of the files, to be told for ours."""
        if sum(job.state == "waiting" for job in self._jobs.values()) >= self.limits.waiting:
            raise HTTPException(503, f"{self.limits.waiting} analyses are waiting already; try again in a minute.")
        key = secrets.token_hex(16)
        job = Job(self.folder / key, names)
        limits = {"memory": self.limits.memory, "processor": self.limits.processor, "written": self.limits.written}
        try:
            job.folder.mkdir()
            (job.folder / ASK).write_text(json.dumps({**ask, "names": dict(names), "limits": limits}), encoding="utf-8")
        except OSError as error:
            shutil.rmtree(job.folder, ignore_errors=True)
            raise HTTPException(
                507, f"The question can not be written down ({error.strerror}); make room on the disk."
            ) from error
        self._jobs[key] = job
        job.task = asyncio.create_task(self._attend(job))
        return job

    def get(self, key: str) -> Job:
        """The analysis of that key."""
        if key not in self._jobs:
            raise HTTPException(404, "This analysis is not here (any more); start it again.")
        return self._jobs[key]

    async def watch(self, job: Job, *, pause: float = 15.0) -> AsyncIterator[dict[str, Any] | None]:
        """Where it stands, now and at each change until it ends; None where nothing was new for a while."""
        while True:
            changed = job.changed
            yield job.report()
            if job.ended is not None:
                return
            while not changed.is_set():
                try:
                    async with asyncio.timeout(pause):
                        await changed.wait()
                except TimeoutError:
                    yield None

    async def cancel(self, job: Job) -> None:
        """Stop it, with every process that it started; of what has ended, the answer is removed."""
        if job.ended is not None:
            await self._remove(job)
        elif job.task is not None:
            job.tell(state="cancelled", words="cancelled", message="Cancelled; nothing of it was kept.", ended=now())
            job.task.cancel()
            await asyncio.gather(job.task, return_exceptions=True)
            shutil.rmtree(job.folder, ignore_errors=True)

    async def remove_ended(self, *, before: float) -> None:
        """Remove the answers that are older, and the oldest of more than are kept."""
        ended = sorted((job.ended, key) for key, job in self._jobs.items() if job.ended is not None)
        for number, (when, key) in enumerate(reversed(ended)):
            if when < before or number >= self.limits.kept:
                await self._remove(self._jobs[key])

    async def _remove(self, job: Job) -> None:
        self._jobs.pop(job.key, None)
        await asyncio.to_thread(shutil.rmtree, job.folder, ignore_errors=True)

    async def close(self) -> None:
        """Stop all."""
        await asyncio.gather(*(self.cancel(job) for job in self._jobs.values()))

    async def _attend(self, job: Job) -> None:
        async with self._slots:
            job.tell(state="running", words="starting")
            try:
                news = await self._run(job)
            except OSError as error:
                news = {"state": "broken", "message": f"The analysis could not be started ({error}); try again."}
            job.tell(**news, words="", ended=now())

    async def _run(self, job: Job) -> dict[str, Any]:
        """Run the worker to its end: what became of it."""
        with (job.folder / "words.txt").open("wb") as log:
            job.process = process = await asyncio.create_subprocess_exec(
                sys.executable,
                "-P",
                "-m",
                self.worker,
                str(job.folder),
                env=_environment(job.folder),
                stdin=asyncio.subprocess.DEVNULL,
                stdout=asyncio.subprocess.PIPE,
                stderr=log,
                limit=LONGEST_LINE,
                start_new_session=True,
            )
        try:
            async with asyncio.timeout(self.limits.wall):
                await _follow(job, process)
                await process.wait()
        except TimeoutError:
            return broken(f"it took longer than {self.limits.wall:g} s")
        except ValueError:
            return broken("it said something that is no word of ours")
        finally:
            _kill(process)
            await process.communicate()  # what it still said is read away: a full pipe would keep it from having ended
        answer = await asyncio.to_thread(_read, job.folder / ANSWER)
        if isinstance(answer, dict) and process.returncode == 0 and "answer" in answer:
            return {"state": "done", "answer": answer["answer"], "share": 1.0}
        if isinstance(answer, dict) and process.returncode == 1 and "refused" in answer:
            return {"state": "refused", "message": with_names(str(answer["refused"]), job.names)}
        return broken(_why(process.returncode, job.folder / "words.txt", self.limits))


async def _follow(job: Job, process: asyncio.subprocess.Process) -> None:
    """Take the worker's lines: each is how far it is."""
    assert process.stdout is not None
    async for line in process.stdout:
        progress = json.loads(line)
        if not (
            isinstance(progress, dict) and isinstance(progress.get("words"), str) and _is_share(progress.get("share"))
        ):
            raise ValueError(line)
        job.tell(words=with_names(progress["words"], job.names), share=float(progress["share"]))


def _is_share(value: object) -> bool:
    return isinstance(value, int | float) and 0 <= value <= 1


def _kill(process: asyncio.subprocess.Process) -> None:
    """End the worker and whatever it started."""
    with contextlib.suppress(ProcessLookupError):
        if hasattr(os, "killpg"):
            os.killpg(process.pid, signal.SIGKILL)
        elif process.returncode is None:
            process.kill()


def _read(path: Path) -> Any:
    """What a worker left, as plain data; None where that is no JSON, too long, or no file of its own."""
    if path.is_symlink() or not path.is_file() or path.stat().st_size > LONGEST_ANSWER:
        return None
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (ValueError, RecursionError):
        return None


def _why(code: int | None, log: Path, limits: Limits) -> str:
    if code == -getattr(signal, "SIGXCPU", 24):
        return f"it took more than {limits.processor:g} s of processor time"
    if code is not None and code < 0:
        return f"its process was ended by {signal.Signals(-code).name}, perhaps for want of memory"
    with log.open("rb") as file:
        file.seek(max(0, log.stat().st_size - KEPT_WORDS))
        last = file.read(KEPT_WORDS).decode("utf-8", "replace").strip().splitlines()
    return f"a fault of the program ({last[-1][:200] if last else f'exit code {code}'})"


def broken(why: str) -> dict[str, Any]:
    """An analysis that ended without an answer."""
    return {"state": "broken", "message": f"The analysis ended early: {why}; your files are still here to ask again."}


def with_names(text: str, names: Mapping[str, str]) -> str:
    """A sentence with the users' own names of the files for ours."""
    for ours, theirs in names.items():
        text = text.replace(ours, theirs)
    return text


def _environment(folder: Path) -> dict[str, str]:
    """What a worker may know of ours: where programs and caches are, no more."""
    kept = {name: value for name, value in os.environ.items() if name.startswith(PASSED_ON)}
    one = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    return {**kept, **one, "MPLBACKEND": "agg", "TMPDIR": str(folder), "PYTHONUNBUFFERED": "1"}


def now() -> float:
    return time.monotonic()
