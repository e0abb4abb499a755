"""A lab that runs, as `stickslip lab` starts it, for the tests that speak with it from outside."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from stickslip.lab.workers import unframed


@dataclass(frozen=True)
class Lab:
    """Where it listens, with which token, in which process."""

    port: int
    token: str
    process: subprocess.Popen[str]

    @property
    def base(self) -> str:
        return f"http://127.0.0.1:{self.port}"

    @property
    def address(self) -> str:
        return f"{self.base}/?token={self.token}"

    @property
    def headers(self) -> dict[str, str]:
        return {"Authorization": f"Bearer {self.token}"}

    def workers(self) -> list[int]:
        """The processes that compute for it."""
        found = []
        for place in Path("/proc").glob("[0-9]*"):
            with suppress(OSError):
                parent = int((place / "stat").read_text().rpartition(")")[2].split()[1])
                if parent == self.process.pid and b"stickslip.lab.worker" in (place / "cmdline").read_bytes():
                    found.append(int(place.name))
        return found


@contextmanager
def running_lab(browser: Path | None = None) -> Iterator[Lab]:
    """A lab on a port of its own, ended at the end; it opens a browser only if one is given."""
    command = [sys.executable, "-u", "-m", "stickslip", "lab", "--port", "0"]
    command += [] if browser else ["--no-browser"]
    environment = {**os.environ, "PYTHONUNBUFFERED": "1", **({"BROWSER": str(browser)} if browser else {})}
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=environment, start_new_session=True
    )
    assert process.stdout is not None
    said = ""
    for line in process.stdout:
        said += line
        if match := re.search(r"http://127\.0\.0\.1:(\d+)/\?token=(\S+)", line):
            break
    else:
        raise AssertionError(f"the lab did not start: {said}")
    try:
        yield Lab(int(match[1]), match[2], process)
    finally:
        process.send_signal(signal.SIGINT)
        try:
            process.wait(600)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            raise
        finally:
            process.stdout.close()


def received(socket: Any) -> tuple[dict[str, Any], dict[str, Any]]:
    """The next answer on a socket, but for the word that kernels are compiled, which comes on a machine's first run."""
    while (frame := unframed(socket.receive_bytes()))[0]["kind"] == "compiling":
        pass
    return frame
