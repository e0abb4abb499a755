"""The regime map of the page says at each point what a sweep of the library says there."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

pytest.importorskip("starlette", reason="the extra [lab] is not installed")
from starlette.testclient import TestClient

import stickslip as ss
from labs import received
from stickslip.lab.server import lab_app
from stickslip.lab.worker import AT_REST, CYCLES, SETTLE

HOME, BEARER = "http://127.0.0.1:8723", {"authorization": "Bearer t"}
UNIT = {"system": {"mass": 1.0, "stiffness": 1.0}, "law": {"name": "Coulomb", "kinetic": 0.5},
        "drive": {"name": "HarmonicForce", "amplitude": 1.0, "frequency": 0.1}, "run": {"cycles": 20}}  # fmt: skip
ASKED = {
    "id": 1, "want": "map", "state": UNIT, "measure": "stops",
    "x": {"name": "drive.frequency", "from": 0.7 / (2 * math.pi), "to": 1.5 / (2 * math.pi), "count": 5},
    "y": {"name": "law.kinetic", "from": 0.4, "to": 1.1, "count": 6},
}  # fmt: skip


@pytest.fixture(scope="module")
def client() -> Iterator[TestClient]:
    with TestClient(lab_app(token="t", port=8723), base_url=HOME, headers=BEARER) as found:
        yield found


def drawn(client: TestClient, request: dict[str, Any]) -> list[tuple[dict[str, Any], dict[str, Any]]]:
    """All that comes until the map is done or refused."""
    with client.websocket_connect("ws://127.0.0.1:8723/map", headers=BEARER) as socket:
        socket.send_text(json.dumps(request))
        found = [received(socket)]
        while found[-1][0]["kind"] == "part":
            found.append(received(socket))
    return found


@pytest.fixture(scope="module")
def parts(client: TestClient) -> list[tuple[dict[str, Any], dict[str, Any]]]:
    rig = drawn(client, ASKED)
    assert rig[-1][0]["kind"] == "done"
    return rig[:-1]


def test_the_coarse_map_is_that_of_a_sweep(parts: list[tuple[dict[str, Any], dict[str, Any]]]) -> None:
    coarse = [arrays for header, arrays in parts if header["level"] == "coarse"]
    xs = np.concatenate([arrays["x"] for arrays in coarse])
    values = np.concatenate([arrays["values"] for arrays in coarse]).reshape(len(xs), -1)
    system = ss.systems.read_system(UNIT).system
    grid = {"frequency": xs.tolist(), "kinetic": coarse[0]["y"].tolist()}
    swept = ss.sweep(system, grid, measures=["stops"], cycles=CYCLES, settle=SETTLE, engine="serial")
    moving = swept.status.values == 0
    np.testing.assert_array_equal(values[moving], (swept.normal_stops + swept.abnormal_stops).values[moving])
    assert np.all(values[:, coarse[0]["y"] > 1] == AT_REST)  # friction above the force


def test_borders_are_refined_to_where_they_are(parts: list[tuple[dict[str, Any], dict[str, Any]]]) -> None:
    """Den Hartog's boundary at b = 0.8, r = 0.8174, is found to an eighth of a cell."""
    cells = [arrays for header, arrays in parts if header["level"] == "fine"]
    assert cells
    b, border = next(each[::2] for each in ss.scenarios.grid("DH-2")["boundary"] if each[:2] == [1.1, 0.0])
    column = [
        (y, value)
        for arrays in cells
        for i, x in enumerate(arrays["x"])
        if abs(2 * math.pi * x - b) < 1e-9
        for y, value in zip(arrays["y"], arrays["values"].reshape(9, -1)[i], strict=True)
    ]
    slides, stops = max(y for y, value in column if value == 0), min(y for y, value in column if value > 0)
    assert slides <= border <= stops
    assert stops - slides == pytest.approx(0.14 / 8)


def test_only_strips_where_the_answer_changes_are_refined(parts: list[tuple[dict[str, Any], dict[str, Any]]]) -> None:
    coarse = np.concatenate([arrays["y"] for header, arrays in parts if header["level"] == "coarse"][:1])
    for header, arrays in parts:
        if header["level"] == "fine":
            values = arrays["values"].reshape(9, -1)
            assert len(set(np.round(values[:, 0]))) > 1 or len(set(np.round(values[:, :9].ravel()))) > 1
            assert set(arrays["y"][::8]) <= set(coarse)


def test_a_map_can_be_cancelled_and_another_asked(client: TestClient) -> None:
    large = {**ASKED, "x": {**ASKED["x"], "count": 60}, "y": {**ASKED["y"], "count": 60}}
    with client.websocket_connect("ws://127.0.0.1:8723/map", headers=BEARER) as socket:
        socket.send_text(json.dumps(large))
        assert received(socket)[0]["kind"] == "part"
        socket.send_text(json.dumps({"id": 2, "want": "cancel"}))
        count = 1
        while received(socket)[0]["kind"] != "cancelled":
            count += 1
        assert count < 30  # of 30 strips alone
        socket.send_text(json.dumps({**ASKED, "id": 3}))
        assert received(socket)[0]["id"] == 3


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"x": None}, "x has a name"),
        ({"x": {**ASKED["x"], "to": 0.0}}, "from a number to a larger one"),
        ({"y": {**ASKED["y"], "count": 10_000}}, "2 to 64 points"),
        ({"measure": "beauty"}, "beauty"),
        ({"x": {**ASKED["y"]}}, "different"),
        ({"x": {**ASKED["x"], "name": "nobody"}}, "nobody"),
        ({"state": {"system": 3}}, "system"),
        ({"x": {**ASKED["x"], "from": "a"}}, "x has a name"),
    ],
)
def test_a_map_that_can_not_be_drawn_is_refused_in_one_sentence(client: TestClient, change: Any, words: str) -> None:
    header, _ = drawn(client, {**ASKED, **change})[-1]
    assert header["kind"] == "error"
    assert words in header["error"]


def test_a_map_of_a_share_is_not_refined(client: TestClient) -> None:
    rig = drawn(client, {**ASKED, "measure": "stick_share"})
    assert {header.get("level") for header, _ in rig} == {"coarse", None}
    values = np.concatenate([arrays["values"] for header, arrays in rig if header["kind"] == "part"])
    assert 0 < np.max(values) < 1
