"""The processes that compute for the page: one that is stuck holds nobody else up."""

from __future__ import annotations

import asyncio
import io
import json
import os
import signal
import time
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("starlette", reason="the extra [lab] is not installed")
from stickslip.lab import worker, workers
from stickslip.lab.workers import Workers, unframed

CATALOG = json.dumps({"id": 1, "want": "catalog"}).encode()


def test_no_file_of_the_folder_it_was_started_in_is_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "numpy.py").write_text("raise SystemExit('not numpy')", encoding="utf-8")
    monkeypatch.chdir(tmp_path)

    async def asked() -> bytes:
        async with Workers(1) as some:
            return await some.ask(CATALOG)

    assert unframed(asyncio.run(asked()))[0]["kind"] == "catalog"


def served(monkeypatch: pytest.MonkeyPatch, answer: Any) -> list[dict[str, Any]]:
    """What a worker says when it is asked for `answer`, header by header."""
    monkeypatch.setitem(worker.ANSWERS, "made", answer)
    asked, said = json.dumps({"id": 7, "want": "made"}).encode(), io.BytesIO()
    before = signal.getsignal(signal.SIGINT)
    try:
        worker.serve(io.BytesIO(workers.HEAD.pack(len(asked)) + asked), said)
    finally:
        signal.signal(signal.SIGINT, before)
    said.seek(0)
    found = []
    while head := said.read(workers.ANSWER.size):
        last, length = workers.ANSWER.unpack(head)
        found.append({**unframed(said.read(length))[0], "last": last})
    return found


def test_a_worker_says_that_it_compiles_once_and_only_where_it_does(monkeypatch: pytest.MonkeyPatch) -> None:
    from numba import njit

    twice, thrice = njit(lambda x: 2 * x), njit(lambda x: 3 * x)

    def answer(request: Any, go_on: Any) -> Any:
        return {"value": twice(1.0) + thrice(1.0)}, {}

    kinds = [(each["kind"], each["id"], each["last"]) for each in served(monkeypatch, answer)]
    assert kinds == [("compiling", 7, False), ("made", 7, True)]
    assert [each["kind"] for each in served(monkeypatch, answer)] == ["made"]


@pytest.mark.skipif(not workers.INTERRUPTIBLE, reason="no signals to stop a process with")
def test_a_part_of_a_map_ends_when_no_one_waits_for_it(monkeypatch: pytest.MonkeyPatch) -> None:
    def answer(request: Any, go_on: Any) -> Any:
        os.kill(os.getpid(), signal.SIGINT)  # as the server does
        for _ in range(1000):
            time.sleep(0.01)
        return {"finished": True}, {}

    monkeypatch.setitem(worker.MAPS, "made", answer)
    (said,) = served(monkeypatch, answer)
    assert said["kind"] == "overtaken"  # and not "finished", as after all its thousand steps


@pytest.mark.skipif(not workers.INTERRUPTIBLE, reason="no signals to stop a process with")
def test_work_that_no_one_waits_for_is_ended_and_its_worker_answers_the_next(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(workers, "ABANDONED", 0.2)

    async def left_and_asked_again() -> bytes:
        async with Workers(1) as some:
            stuck = (await some.all[0].started()).pid
            os.kill(stuck, signal.SIGSTOP)
            asking = asyncio.create_task(some.ask(CATALOG))
            await asyncio.sleep(0.1)
            asking.cancel()
            async with asyncio.timeout(600):
                answer = await some.ask(CATALOG)
            assert (await some.all[0].started()).pid != stuck
            return answer

    header, _ = unframed(asyncio.run(left_and_asked_again()))
    assert header["kind"] == "catalog"
