"""Other processes: none outlives the one that asked it."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from stickslip.workers import workers

ASKS = """
import os, time
from stickslip.workers import pool
if __name__ == "__main__":
    processes = pool(1, "stickslip")
    print(processes.submit(os.getpid).result(), flush=True)
    time.sleep(600)
"""

UNGUARDED = """
import time
from stickslip.workers import workers
with workers(2, "stickslip", among=True) as mapped:
    for _ in range(1000):
        list(mapped(time.sleep, [0.1] * 5))
"""


def _slowly(number: int) -> tuple[int, int]:
    time.sleep(0.05)
    return number, os.getpid()


def test_the_one_that_asks_takes_its_part_and_results_stay_in_order() -> None:
    by, end = set[int](), time.monotonic() + 120
    with workers(2, "stickslip", among=True) as mapped:
        while len(by) < 2 and time.monotonic() < end:  # alone while the other process begins, and then with it
            numbers, asked = zip(*mapped(_slowly, range(20)), strict=True)
            assert numbers == tuple(range(20))
            assert os.getpid() in asked
            by |= set(asked)
    assert len(by) == 2


def test_a_script_that_every_process_runs_anew_is_told_so(tmp_path: Path) -> None:
    """It ended in a traceback of concurrent.futures, and then never."""
    path = tmp_path / "asks.py"
    path.write_text(UNGUARDED, encoding="utf-8")
    ended = subprocess.run([sys.executable, path], capture_output=True, text=True, timeout=300, check=False)
    assert ended.returncode == 1
    assert ended.stderr.splitlines()[-1].startswith("stickslip.errors.StickslipError: another process ended before")


@pytest.mark.skipif(os.name != "posix", reason="nothing is killed by a signal here")
def test_a_process_ends_with_the_one_that_asked_it(tmp_path: Path) -> None:
    path = tmp_path / "asks.py"
    path.write_text(ASKS, encoding="utf-8")
    with subprocess.Popen([sys.executable, path], stdout=subprocess.PIPE, text=True) as asking:
        assert asking.stdout is not None
        worker = int(asking.stdout.readline())
        asking.send_signal(signal.SIGKILL)
        asking.wait()
    end = time.monotonic() + 60
    while time.monotonic() < end:
        try:
            os.kill(worker, 0)
        except ProcessLookupError:
            return
        time.sleep(0.05)
    os.kill(worker, signal.SIGKILL)
    pytest.fail("it lives on")
