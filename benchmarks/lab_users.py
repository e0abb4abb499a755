"""A lab under a hundred users: does it answer them all, does its memory stay, and are half requests closed?

python benchmarks/lab_users.py [--users 100] [--seconds 600]

Users are HTTP and WebSocket clients, not browsers: they play a system, draw a map, send a record, ask about it and
remove it, with pauses between. Beside them somebody opens half requests, without the token, and never ends them.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import random
import re
import socket
import ssl
import sys
import time
from collections import Counter, defaultdict
from contextlib import suppress
from pathlib import Path
from typing import Any

import httpx2 as httpx
from websockets.asyncio.client import connect

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))
from labs import Lab, running_lab
from stickslip.lab.workers import unframed

DRIVE = {"name": "HarmonicForce", "amplitude": 1.0, "frequency": 0.1}
SYSTEM = {"system": {"mass": 1.0, "stiffness": 1.0}, "drive": DRIVE, "run": {"cycles": 20}}
MAP = {"id": 1, "want": "map", "measure": "stops", "x": {"name": "drive.frequency", "from": 0.1, "to": 0.2, "count": 4},
       "y": {"name": "law.kinetic", "from": 0.2, "to": 0.8, "count": 4}}  # fmt: skip
RECORD = ("t [s],x [mm]\n" + "".join(f"{k / 100},{k % 7}\n" for k in range(500))).encode()
BUSY = 503
PAUSE = 5.0  # s at most between two things that a user does
HALVES = (
    b"", b"GET /al", b"GET /alive HTTP/1.1\r\nHost: 127.0.0.1\r\nAuth",
    b"GET /play HTTP/1.1\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n",
    b"POST /jobs HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 900\r\n\r\nabc",
)  # fmt: skip
HALVES_AT_ONCE = 400
CONTEXT = ssl.create_default_context()  # made once: a client that makes its own stands still meanwhile


class Tally:
    """What was asked, how long it took, and what went wrong."""

    def __init__(self) -> None:
        self.times: defaultdict[str, list[float]] = defaultdict(list)
        self.busy: Counter[str] = Counter()
        self.errors: Counter[str] = Counter()
        self.opened, self.closed, self.longest = 0, 0, 0.0


class Busy(Exception):
    """The lab said in order that it has too much to do."""


def held(answer: httpx.Response, status: int) -> Any:
    if answer.status_code == BUSY and "error" in answer.json():
        raise Busy
    if answer.status_code != status:
        raise AssertionError(f"{answer.status_code}: {answer.text[:200]}")
    return answer.json() if answer.content else None


async def played(socket: Any, chance: random.Random) -> None:
    """A slider's event: the motion and what is said of it."""
    state = {**SYSTEM, "law": {"name": "Coulomb", "kinetic": round(chance.uniform(0.2, 0.8), 3)}}
    for number, want in enumerate(("run", "tell")):
        await socket.send(json.dumps({"id": number, "want": want, "state": state}))
        await answered(socket, {want})


async def mapped(socket: Any, chance: random.Random) -> None:
    state = {**SYSTEM, "law": {"name": "Coulomb", "kinetic": 0.5}}
    await socket.send(json.dumps({**MAP, "state": state}))
    await answered(socket, {"done"})


async def answered(socket: Any, kinds: set[str]) -> None:
    while True:
        header, _ = unframed(await socket.recv())
        if header["kind"] == "error":
            raise AssertionError(header["error"])
        if header["kind"] in kinds:
            return


async def asked(client: httpx.AsyncClient, chance: random.Random) -> None:
    """A record sent, a question about it answered, and both removed."""
    key = held(await client.post("/files", params={"name": "run.csv"}, content=RECORD), 201)["id"]
    try:
        ask = {"question": "describe", "records": [[key]]}
        job = held(await client.post("/jobs", json=ask), 202)["id"]
        while (told := held(await client.get(f"/jobs/{job}"), 200))["state"] in ("waiting", "running"):
            await asyncio.sleep(0.5)
        if told["state"] != "done":
            raise AssertionError(f"{told['state']}: {told['message']}")
        held(await client.delete(f"/jobs/{job}"), 200)
    finally:
        held(await client.delete(f"/files/{key}"), 204)


async def fetched(client: httpx.AsyncClient, chance: random.Random) -> None:
    """What a page loads."""
    for path in ("/", "/lab.js", "/play.js", "/alive"):
        answer = await client.get(path)
        if answer.status_code != 200:
            raise AssertionError(f"{path}: {answer.status_code}")


async def user(lab: Lab, number: int, until: float, tally: Tally) -> None:
    """Somebody who comes, stays, and comes again if the door was shut."""
    chance = random.Random(number)
    await asyncio.sleep(chance.uniform(0, PAUSE))
    while time.monotonic() < until:
        try:
            await visit(lab, chance, until, tally)
        except Exception as error:  # noqa: BLE001  # as below
            tally.errors[f"open: {type(error).__name__}: {error}"[:200]] += 1


async def visit(lab: Lab, chance: random.Random, until: float, tally: Tally) -> None:
    sockets = f"ws://127.0.0.1:{lab.port}"
    options: dict[str, Any] = {"additional_headers": lab.headers, "max_size": None, "open_timeout": 120}
    async with (
        httpx.AsyncClient(base_url=lab.base, headers=lab.headers, timeout=300, verify=CONTEXT) as client,
        connect(f"{sockets}/play", **options) as play,
        connect(f"{sockets}/map", **options) as map_,
    ):
        deeds = {"play": (played, play), "map": (mapped, map_), "ask": (asked, client), "page": (fetched, client)}
        while time.monotonic() < until:
            name = chance.choices(list(deeds), weights=(10, 1, 1, 3))[0]
            deed, through = deeds[name]
            begun = time.monotonic()
            try:
                await deed(through, chance)
                tally.times[name].append(time.monotonic() - begun)
            except Busy:
                tally.busy[name] += 1
            except Exception as error:  # noqa: BLE001  # each one is counted, and any makes the benchmark fail
                tally.errors[f"{name}: {type(error).__name__}: {error}"[:200]] += 1
            await asyncio.sleep(chance.uniform(0, PAUSE))


async def half(lab: Lab, contents: bytes, tally: Tally) -> None:
    """A request that is never ended: how long until the lab closes it."""
    begun = time.monotonic()
    reader, writer = await asyncio.open_connection("127.0.0.1", lab.port)
    tally.opened += 1
    with suppress(ConnectionError):
        writer.write(contents)
        while await reader.read(4096):
            pass
    writer.close()
    tally.closed += 1
    tally.longest = max(tally.longest, time.monotonic() - begun)


async def halves(lab: Lab, until: float, tally: Tally) -> None:
    """Half requests, as many at once as there is room for, and each anew when it is closed."""

    async def over_and_over(number: int) -> None:
        while time.monotonic() < until:
            await half(lab, HALVES[number % len(HALVES)], tally)
            await asyncio.sleep(1.0)

    async with asyncio.TaskGroup() as group:
        for number in range(HALVES_AT_ONCE):
            group.create_task(over_and_over(number))


def resident(process: int) -> float:
    """Memory that a process holds [MB]."""
    return int(re.search(r"VmRSS:\s+(\d+)", Path(f"/proc/{process}/status").read_text())[1]) / 1e3  # type: ignore[index]


def connections(lab: Lab) -> int:
    """Open files of the server."""
    return len(list(Path(f"/proc/{lab.process.pid}/fd").iterdir()))


async def watched(lab: Lab, seconds: float, samples: list[tuple[float, float, float, int]]) -> None:
    begun = time.monotonic()
    while True:
        with suppress(OSError, TypeError):  # a worker that ended meanwhile
            workers = sum(resident(process) for process in lab.workers())
            samples.append((time.monotonic() - begun, resident(lab.process.pid), workers, connections(lab)))
        await asyncio.sleep(seconds / 100)


async def main(users: int, seconds: float) -> int:
    tally, samples = Tally(), list[tuple[float, float, float, int]]()
    with running_lab() as lab:
        until = time.monotonic() + seconds
        watching = asyncio.create_task(watched(lab, seconds, samples))
        async with asyncio.TaskGroup() as group:
            for number in range(users):
                group.create_task(user(lab, number, until, tally))
            group.create_task(halves(lab, until, tally))
        await asyncio.sleep(1)
        with socket.create_connection(("127.0.0.1", lab.port), timeout=10):
            still = connections(lab)
        alive = httpx.get(f"{lab.base}/alive", headers=lab.headers, timeout=60).status_code == 200
        watching.cancel()
    return told(tally, samples, users, seconds, alive, still)


def told(
    tally: Tally, samples: list[tuple[float, float, float, int]], users: int, seconds: float, alive: bool, still: int
) -> int:
    print(f"{users} users, {seconds:g} s")
    for name, times in sorted(tally.times.items()):
        times.sort()
        median, late = times[len(times) // 2], times[int(0.95 * len(times))]
        print(f"{name:5} {len(times):6} answered, median {median:.2f} s, 95 % {late:.2f} s, slowest {times[-1]:.2f} s")
    print(f"told to come back later: {sum(tally.busy.values())}; errors: {sum(tally.errors.values())}")
    for words, count in tally.errors.most_common(20):
        print(f"  {count} x {words}")
    for share in (0.02, 0.1, 0.25, 0.5, 0.75, 0.99):
        at, server, workers, files = samples[int(share * (len(samples) - 1))]
        print(f"after {at:5.0f} s: server {server:.0f} MB, workers {workers:.0f} MB, {files} open files")
    print(f"half requests: {tally.opened} opened, {tally.closed} closed, the longest after {tally.longest:.1f} s")
    print(f"alive at the end: {alive}, {still} open files")
    return int(bool(tally.errors) or tally.opened != tally.closed or not alive)


if __name__ == "__main__":
    asked_for = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked_for.add_argument("--users", type=int, default=100)
    asked_for.add_argument("--seconds", type=float, default=600)
    given = asked_for.parse_args()
    sys.exit(asyncio.run(main(given.users, given.seconds)))
