"""What the page shows of a system is what the library says of it, to the last digit."""

from __future__ import annotations

import io
import json
import runpy
import time
from collections.abc import Iterator
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("starlette", reason="the extra [lab] is not installed")
from starlette.testclient import TestClient

import stickslip as ss
from labs import received
from stickslip.lab import worker
from stickslip.lab.server import lab_app
from stickslip.lab.workers import frame, unframed

COMPLIANT = ss.systems.scenario_case("THESIS compliant 2.5Hz fk=1.1 Ky=192000 z.0174(k+Ky)").lasting(cycles=40)
STATE = json.loads(ss.systems.export_system(COMPLIANT, format="json"))
HOME, BEARER = "http://127.0.0.1:8723", {"authorization": "Bearer t"}
RIGID = {**STATE, "law": {"name": "Coulomb", "kinetic": 1.1}}
PLAYED = ["FD-4", "BS-1", "THESIS rigid 2.5Hz fk=1.1", "FM-1", "MC-1", "SQUEAK wet 6.13 N", "DI-1 v=0.1",
          "RS-1"]  # fmt: skip


@pytest.fixture(scope="module")
def client() -> Iterator[TestClient]:
    with TestClient(lab_app(token="t", port=8723), base_url=HOME, headers=BEARER) as found:
        yield found


def asked(client: TestClient, want: str, state: Any, **more: Any) -> tuple[dict[str, Any], dict[str, Any]]:
    with client.websocket_connect("ws://127.0.0.1:8723/play", headers=BEARER) as socket:
        socket.send_text(json.dumps({"id": 1, "want": want, "state": state, **more}))
        return received(socket)


def state_of(client: TestClient, name: str) -> Any:
    return client.get(f"/scenarios/{name}").json()["state"]


def test_a_frame_is_read_as_it_was_written() -> None:
    arrays = {"a": np.arange(3.0), "kinds": np.arange(5, dtype=np.int16), "levels": np.arange(7, dtype=np.uint8)}
    header, found = unframed(frame({"words": "µ"}, arrays))
    assert header == {"words": "µ"}
    for name, values in arrays.items():
        np.testing.assert_array_equal(found[name], values)


@pytest.mark.parametrize("name", PLAYED)
def test_the_numbers_are_those_that_the_library_prints(client: TestClient, name: str) -> None:
    header, _ = asked(client, "tell", state_of(client, name))
    result = ss.story.outcome(ss.systems.scenario_case(name))
    assert header["sentences"] == list(result.sentences)
    assert [tuple(row) for row in header["rows"]] == result.rows


@pytest.mark.parametrize("name", PLAYED)
def test_the_traces_are_the_exact_motion(client: TestClient, name: str) -> None:
    header, arrays = asked(client, "run", state_of(client, name))
    case = ss.systems.scenario_case(name)
    run = ss.simulate(case.system, start=case.start, **case.run)
    names = [each["name"] for each in header["series"]]
    outputs = dict.fromkeys(("x", "v", "a", "friction"))
    expected, _ = run.sample(arrays["time"], tuple(outputs))
    labels = [label for output in outputs for label in run.labels(output)]
    for label, row in zip(labels, expected, strict=True):
        np.testing.assert_array_equal(arrays[label], row, err_msg=label)
    assert set(labels) <= set(names)
    assert np.all(np.diff(arrays["time"]) > 0)


def test_sticks_are_marked_where_the_engine_holds() -> None:
    _, arrays = worker.run({"state": RIGID}, lambda share: None)
    run = ss.simulate(worker.read_case(RIGID).system, cycles=40)
    held = arrays["kinds"] == worker.KINDS.index("stick")
    stuck = [piece for piece in run.pieces if piece.mode == "stuck"]
    np.testing.assert_array_equal(arrays["begins"][held], [piece.start for piece in stuck])
    np.testing.assert_allclose(
        arrays["ends"][held] - arrays["begins"][held], [piece.duration for piece in stuck], atol=1e-12
    )
    middle = arrays["time"][:, None]
    inside = ((middle > arrays["begins"][held]) & (middle < arrays["ends"][held])).any(axis=1)
    assert 0.1 < inside.mean() < 0.5
    assert not np.any(arrays["v"][inside])


def test_micro_slips_are_the_short_slips() -> None:
    _, arrays = worker.run({"state": STATE}, lambda share: None)
    run = ss.simulate(worker.read_case(STATE).system, cycles=40)
    slips = [
        piece
        for piece in run.pieces[1:-1]
        if run.table.modes[[m.name for m in run.table.modes].index(piece.mode)].kind == "slip"
    ]
    longest = max(piece.duration for piece in slips)
    short = [piece.start + piece.duration / 2 for piece in slips if piece.duration < 0.1 * longest]
    np.testing.assert_allclose(arrays["microslips"], short, rtol=1e-12)
    assert len(short) > 40  # several a cycle


def test_the_spectrum_of_a_pure_tone_is_its_amplitude() -> None:
    state = {"system": {"mass": 1.0, "stiffness": 40.0, "damping": 3.0}, "law": {"name": "Coulomb", "kinetic": 0.0},
             "drive": {"name": "HarmonicForce", "amplitude": 2.0, "frequency": 1.5}, "run": {"cycles": 40}}  # fmt: skip
    _, arrays = worker.run({"state": state}, lambda share: None)
    w = 2 * np.pi * 1.5
    exact = 2.0 * w**2 / np.hypot(40 - w**2, 3.0 * w)
    peak = np.argmax(arrays["amplitude"])
    assert arrays["frequency"][peak] == pytest.approx(1.5)
    assert arrays["amplitude"][peak] == pytest.approx(exact, rel=1e-9)


@pytest.mark.parametrize("name", PLAYED)
def test_the_python_and_the_toml_reproduce_what_is_on_screen(client: TestClient, name: str, tmp_path: Path) -> None:
    state = state_of(client, name)
    texts = client.post("/export", json=state).json()
    header, _ = asked(client, "tell", state)
    file = tmp_path / "system.toml"
    file.write_text(texts["toml"], encoding="utf-8")
    assert [list(row) for row in ss.story.outcome(ss.systems.read_system(file)).rows] == header["rows"]
    program = tmp_path / "lab.py"
    program.write_text(texts["python"], encoding="utf-8")
    printed = io.StringIO()
    with redirect_stdout(printed):
        runpy.run_path(str(program))
    for row in header["rows"]:
        assert ": ".join(row) in printed.getvalue()
    assert client.post("/open", content=texts["toml"]).json()["state"] == {**state, "about": state["about"]}


def test_a_state_may_hold_text_with_units(client: TestClient) -> None:
    state = {
        **STATE,
        "drive": {**STATE["drive"], "amplitude": "0.65 mm"},
        "law": {**STATE["law"], "stiffness": "192 N/mm"},
    }
    plain, told = (asked(client, "tell", each)[0]["rows"] for each in (STATE, state))
    assert plain[:-1] == told[:-1]  # all but what the rounding of the energy leaves


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"law": {"name": "Coulomb", "kinetic": -1}}, "kinetic"),
        ({"system": {"mass": 0, "stiffness": 1}}, "mass"),
        ({"law": {"name": "Nobody"}}, "Nobody"),
        ({"run": {"cycles": 1e6}}, "5000 cycles"),
        ({"drive": {"name": "Recorded", "record": "/etc/passwd", "channel": "x"}}, "hold the samples"),
        ({"law": {"name": "FrictionCurve", "curve": "__import__('os')"}}, "curve"),
        ({"nonsense": 1}, "nonsense"),
    ],
)
def test_what_the_library_refuses_is_told_in_its_sentence(client: TestClient, change: Any, words: str) -> None:
    header, _ = asked(client, "run", {**STATE, **change})
    assert header["kind"] == "error"
    assert words in header["error"]
    assert header["error"].endswith(".")


def test_of_many_states_the_newest_is_answered(client: TestClient) -> None:
    """Sent faster than they are answered: the last one is, and not after all the others."""
    with client.websocket_connect("ws://127.0.0.1:8723/play", headers=BEARER) as socket:
        for number in range(1, 201):
            law = {"name": "Coulomb", "kinetic": 0.5 + number / 400}
            socket.send_text(json.dumps({"id": number, "want": "run", "state": {**STATE, "law": law}}))
        answered = [received(socket)[0]["id"]]
        while answered[-1] != 200:
            answered.append(received(socket)[0]["id"])
    assert answered == sorted(answered)
    assert len(answered) < 200


def test_a_long_run_ends_when_another_is_asked(client: TestClient) -> None:
    long = {**STATE, "drive": {"name": "MultiTone", "tones": [[1e-3, 2.5, 0], [1e-4, 4000.0, 0]]},
            "run": {"duration": 2000.0}}  # fmt: skip
    with client.websocket_connect("ws://127.0.0.1:8723/play", headers=BEARER) as socket:
        socket.send_text(json.dumps({"id": 1, "want": "run", "state": long}))
        time.sleep(1.0)
        socket.send_text(json.dumps({"id": 2, "want": "run", "state": STATE, "afresh": True}))
        first, _ = received(socket)
        assert (first["id"], first["kind"]) in ((1, "overtaken"), (1, "error"))  # an error where the worker was new
        assert received(socket)[0]["kind"] == "run"


def test_the_wavelet_map_is_the_librarys(client: TestClient) -> None:
    header, arrays = asked(client, "wavelet", RIGID)
    case = worker.read_case(RIGID)
    record = ss.simulate(case.system, cycles=40).record(fs=worker.MAP / 16.0)
    level = np.abs(ss.signals.wavelet_overview(record, "a", columns=worker.COLUMNS, voices=6).values)
    shown = arrays["levels"].reshape(header["rows"], -1) / 255 * worker.SPAN - worker.SPAN
    seen = shown > -worker.SPAN
    np.testing.assert_allclose(shown[seen], (20 * np.log10(level / level.max()))[seen], atol=worker.SPAN / 255)


@pytest.mark.parametrize(
    ("name", "words"), [("THESIS rigid 2.5Hz fk=1.1", "44 times as fast"), ("SQUEAK wet 6.13 N", "pressure")]
)
def test_a_motion_can_be_heard(client: TestClient, name: str, words: str) -> None:
    header, arrays = asked(client, "sound", state_of(client, name))
    assert words in header["words"]
    assert np.abs(arrays["sound"]).max() == pytest.approx(1.0)
    assert len(arrays["sound"]) <= 3 * header["fs"]


@pytest.mark.parametrize(
    ("name", "springs"),
    [
        ("FD-4", [[-1, 0]]),
        ("MC-1", [[-1, 0], [-1, 1], [0, 1]]),  # an oblique spring joins the two
        ("MC-2 eta=0.02,0.02", [[-1, 0], [-1, 1]]),  # those of its contacts
    ],
)
def test_the_springs_of_a_system_are_those_of_its_stiffness(client: TestClient, name: str, springs: Any) -> None:
    header, _ = asked(client, "run", state_of(client, name))
    assert header["springs"] == springs


def test_word_that_a_worker_compiles_is_passed_on_to_the_page(
    client: TestClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def ask(request: bytes, *, tell: Any, **more: Any) -> bytes:
        data = json.loads(request)
        await tell(frame({"id": data["id"], "want": data["want"], "kind": "compiling"}))
        return frame({"id": data["id"], "want": data["want"], "kind": "run"})

    monkeypatch.setattr(client.app.state.workers, "ask", ask)
    with client.websocket_connect("ws://127.0.0.1:8723/play", headers=BEARER) as socket:
        socket.send_text(json.dumps({"id": 3, "want": "run", "state": STATE}))
        kinds = [unframed(socket.receive_bytes())[0] for _ in range(2)]
    assert [(kind["id"], kind["kind"]) for kind in kinds] == [(3, "compiling"), (3, "run")]
