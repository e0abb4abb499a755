"""The live view: for this page alone, twenty of them at once; what it records is a record."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import ExitStack
from multiprocessing import active_children
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from starlette.testclient import TestClient
from starlette.websockets import WebSocketDisconnect

import stickslip as ss
from stickslip.bench import Block, Monitor, Sim
from stickslip.lab.live import Place, Session
from stickslip.lab.server import lab_app
from stickslip.lab.workers import unframed

TOKEN, PORT = "secret of this start", 8723
HEADERS = {"Authorization": f"Bearer {TOKEN}"}
LIVE = f"ws://127.0.0.1:{PORT}/live"
TABLES = {"rig": {"kind": "sim", "rig": "perfect", "fs": 2000}}


@pytest.fixture
def client(tmp_path: Path) -> Iterator[TestClient]:
    app = lab_app(token=TOKEN, port=PORT, place=Place(TABLES, records=tmp_path))
    with TestClient(app, base_url=f"http://127.0.0.1:{PORT}") as client:
        yield client


def until(socket: Any, kind: str, **like: Any) -> tuple[dict[str, Any], dict[str, Any]]:
    """The next message of a kind."""
    for _ in range(2000):
        header, arrays = unframed(socket.receive_bytes())
        if header["kind"] == kind and all(header.get(name) == value for name, value in like.items()):
            return header, arrays
    raise AssertionError(f"no {kind} came")


def send(socket: Any, want: str, **more: Any) -> None:
    socket.send_text(json.dumps({"id": 1, "want": want, **more}))


@pytest.mark.parametrize(
    "headers",
    [
        {},
        {"Authorization": "Bearer another"},
        {**HEADERS, "Origin": "http://evil.example"},
        {**HEADERS, "Host": "rig.lan"},
    ],
    ids=["no token", "another token", "another page", "another host"],
)
def test_nobody_else_watches(client: TestClient, headers: dict[str, str]) -> None:
    with pytest.raises(WebSocketDisconnect), client.websocket_connect(LIVE, headers=headers) as socket:
        socket.receive_bytes()


def test_twenty_watch_and_one_records(client: TestClient, tmp_path: Path) -> None:
    with ExitStack() as stack:
        pages = [stack.enter_context(client.websocket_connect(LIVE, headers=HEADERS)) for _ in range(20)]
        assert until(pages[0], "state")[0]["devices"] == ["rig", "sim"]
        send(pages[0], "open", device="rig")
        for page in pages:
            until(page, "state", open="rig")
            header, arrays = until(page, "block")
            assert set(arrays) == {f"{edge} {name}" for edge in ("low", "high") for name in ("x", "z", "a", "load")}
            assert header["step"] == 1 / 250
        send(pages[3], "record")
        while until(pages[7], "block")[0]["recorded"] is None:
            pass
        send(pages[5], "mark", text="the <b>third</b> cycle")
        assert until(pages[0], "cycle")[1]["friction"].size > 100
        rows = until(pages[0], "numbers")[0]["rows"]
        assert rows[0][0] == "sliding friction"
        assert rows[0][1].endswith(" N")
        assert 1.0 < float(rows[0][1][:-2]) < 1.2  # the virtual rig's is 1.1
        send(pages[9], "drive", output="base", amplitude=1.0, frequency=float("1e9"))
        send(pages[2], "drive", output="table", amplitude=1.0, frequency=1.0)
        send(pages[0], "stop")
        while "samples" not in (said := until(pages[0], "block")[0]["said"]):
            pass
        send(pages[1], "close")
        until(pages[1], "state", open=None)
    (path,) = tmp_path.iterdir()
    assert said.startswith(path.name)
    record = ss.read_record(path)
    assert len(record) > 100
    assert [step.outcome for step in record.history if step.action == "mark"] == ["the <b>third</b> cycle"]


def test_a_recording_outlives_the_process_that_finds_the_numbers(client: TestClient, tmp_path: Path) -> None:
    before = set(active_children())
    with client.websocket_connect(LIVE, headers=HEADERS) as page:
        send(page, "open", device="rig")
        send(page, "record")
        assert until(page, "numbers")[0]["rows"]
        for process in set(active_children()) - before:
            process.kill()
        killed = until(page, "block")[0]["recorded"]  # s
        assert "another one begins" in until(page, "numbers", rows=[])[0]["untold"][0]
        while not until(page, "numbers")[0]["rows"]:
            pass
        send(page, "stop")
        while "samples" not in until(page, "block")[0]["said"]:
            pass
    (path,) = tmp_path.iterdir()
    record = ss.read_record(path)
    assert len(record) > (killed + 1.0) * record.fs
    assert not [fault for fault in record.check() if fault.kind == "gap"]


def test_what_a_page_may_not_ask_is_told_to_it(client: TestClient) -> None:
    with client.websocket_connect(LIVE, headers=HEADERS) as page:
        for text in ("no JSON", json.dumps({"id": 1, "want": "format the disk"}), json.dumps([1])):
            page.send_text(text)
            assert until(page, "error")[0]["error"].startswith("A message to the lab")
        send(page, "open", device="/etc/passwd")
        assert "no device is called" in until(page, "error")[0]["error"]
        send(page, "record")  # nothing is open
        send(page, "open", device="sim")
        assert until(page, "state", open="sim")[0]["fs"] == 4000
        send(page, "drive", output="base", amplitude="much", frequency=2.5)
        assert "amplitude = 'much'" in until(page, "error")[0]["error"]


def test_a_block_is_shown_before_what_ends_in_it_is_judged(monkeypatch: pytest.MonkeyPatch) -> None:
    """A cycle at 20 kHz took 85 ms of processor to judge, and the samples that had come with its end waited so long."""
    shown: list[bytes] = []
    session = Session("rig", Sim(fast=True), Place(), shown.append, lambda: None)
    monkeypatch.setattr(Monitor, "feed", lambda monitor, block: [shown.append(b"judged")][1:])
    session._look(Block(0, 0.0, np.zeros((4, 80))))
    session.processes.shutdown()
    assert unframed(shown[0])[0]["kind"] == "block"
    assert shown[1:] == [b"judged"]
