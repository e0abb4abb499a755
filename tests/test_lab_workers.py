"""The processes that compute for the page: one that is stuck holds nobody else up."""

from __future__ import annotations

import asyncio
import json
import os
import signal
from pathlib import Path

import pytest

pytest.importorskip("starlette", reason="the extra [lab] is not installed")
from stickslip.lab import workers
from stickslip.lab.frames import unframed
from stickslip.lab.workers import Workers

CATALOG = json.dumps({"id": 1, "want": "catalog"}).encode()


def test_no_file_of_the_folder_it_was_started_in_is_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "numpy.py").write_text("raise SystemExit('not numpy')", encoding="utf-8")
    monkeypatch.chdir(tmp_path)

    async def asked() -> bytes:
        async with Workers(1) as some:
            return await some.ask(CATALOG)

    assert unframed(asyncio.run(asked()))[0]["kind"] == "catalog"


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
            async with asyncio.timeout(60):
                answer = await some.ask(CATALOG)
            assert (await some.all[0].started()).pid != stuck
            return answer

    header, _ = unframed(asyncio.run(left_and_asked_again()))
    assert header["kind"] == "catalog"
