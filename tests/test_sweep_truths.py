"""What is known of maps, from every engine: first the same events in the same order, then the same values."""

from __future__ import annotations

import importlib.util
import math
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import stickslip as ss
from batches import simulate_batch
from stickslip.errors import ModelError
from stickslip.scenarios import forced, grid
from stickslip.solve.assembly import table_of

pytest.importorskip("xarray")
CIRCLE = 2 * math.pi
SHAW = 0.72697564257968176  # friction over force at which sliding begins to stick, b = 0.8, static 1.5 of kinetic
STRIBECK = ss.Oscillator(
    mass=1,
    stiffness=1,
    damping=0.3,
    drive=ss.drives.Belt(0.1),
    law=ss.laws.Stribeck(kinetic=1.0, static=1.5, speed=0.1, exponent=2.0, viscous=0.2),
)
BAND = (0.0050125787690136614, 0.19084020979734697)  # belt speeds [m/s] between which its steady sliding is lost
CHAOS = ss.scenarios.get("FM-1").system
STUCK = ss.scenarios.get("FM-1").known["stuck_positions"]


@pytest.fixture(scope="module")
def cluster() -> Iterator[str]:
    """Two Dask workers, for all tests of this file."""
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address="127.0.0.1:0") as running:
        yield "dask://" + running.scheduler_address.removeprefix("tcp://")


@pytest.fixture(params=["serial", "threads", "dask", "cuda"])
def engine(request: pytest.FixtureRequest) -> str:
    """Every engine; "cuda" where there is a GPU, for its simulator is too slow for a whole truth."""
    if request.param == "dask":
        return str(request.getfixturevalue("cluster"))
    if request.param == "cuda" and not importlib.import_module("numba.cuda").is_available():
        pytest.skip("no NVIDIA GPU here")
    return str(request.param)


def belts() -> list[dict[str, float]]:
    """Starts beside the steady sliding, 3 % outside and inside of either end of the band."""
    points = []
    for speed in (0.97 * BAND[0], 1.03 * BAND[0], 0.97 * BAND[1], 1.03 * BAND[1]):
        steady = ss.solve.steady_sliding(STRIBECK.having(drive=ss.drives.Belt(speed))).state["x"]
        points.append({"drive.speed": speed, "start.x": steady + 1e-5, "start.v": 0.0})
    return points


def shaw(gap: float) -> list[dict[str, float]]:
    """From rest and sliding, a part `gap` below and above Shaw's boundary; the static friction exceeds the force."""
    loads = [SHAW * (1 - gap), SHAW * (1 + gap)]
    return [{"kinetic": load, "static": 1.5 * load, "start.x": x} for load in loads for x in (0.0, 2.0)]


def border(gap: float, rows: list[list[float]]) -> list[dict[str, float]]:
    """A part `gap` below and above Den Hartog's boundary, at ratios of frequency and damping."""
    return [
        {"frequency": ratio / CIRCLE, "damping": 2 * damping, "kinetic": edge * (1 + side), "start.x": 2.0}
        for ratio, damping, edge in rows
        for side in (-gap, gap)
    ]


DAMPED = [row for row in grid("DH-2")["boundary"] if row[1] == 0.2 and 0.5 <= row[0] <= 0.8]
CASES: dict[str, tuple[ss.Oscillator, list[dict[str, float]], int]] = {
    "HL-1": (forced(0.1, 0.5), [{"frequency": 0.1 / CIRCLE, "kinetic": load} for load in (0.1, 0.4, 0.7, 0.9)], 3),
    "DH-2": (forced(0.8, 0.5), border(1e-8, DAMPED[-1:]), 12),
    "SHAW": (forced(0.8, 0.5, static_ratio=1.5), shaw(1e-4), 10),
    "FM-1": (CHAOS, [{"start.x": 0.5}], 8),
}


def answers(name: str, engine: str) -> dict[str, Any]:
    system, points, settle = CASES[name]
    asked = ["stops", "amplitude", "stick_share", "energy", "micro_slips"]
    swept = ss.sweep(system, points, measures=asked, settle=settle, cycles=1, engine=engine)
    return {str(key): column.values for key, column in swept.data_vars.items()}


def events(name: str, engine: str, folder: Path) -> pd.DataFrame:
    """Every event of a case, point after point."""
    system, points, settle = CASES[name]
    ss.sweep(system, points, measures=["events"], settle=0, cycles=settle, engine=engine, store=folder / "map.zarr")
    found = pd.concat([pd.read_parquet(part) for part in sorted((folder / "map.zarr.events").glob("*.parquet"))])
    return found.sort_values(["point", "time"], kind="stable", ignore_index=True)


@pytest.mark.parametrize("name", CASES)
def test_engines_agree_in_the_events_and_then_in_values(name: str, engine: str, tmp_path: Path) -> None:
    if engine != "cuda":
        here, there = events(name, "serial", tmp_path / "serial"), events(name, engine, tmp_path / "other")
        sequence = [column for column in here.columns if column != "time"]
        pd.testing.assert_frame_equal(here[sequence], there[sequence], check_exact=True)
        assert len(here) >= 10
        assert np.allclose(here["time"], there["time"], rtol=1e-12, atol=0)
    agree(answers(name, "serial"), answers(name, engine))


def agree(here: dict[str, Any], there: dict[str, Any]) -> None:
    for key, values in here.items():
        if key in ("status", "normal_stops", "abnormal_stops", "micro_slips"):
            assert np.array_equal(values, there[key]), key
        assert np.allclose(values, there[key], rtol=1e-12, atol=1e-14, equal_nan=True), key


def test_the_grid_of_stops(engine: str) -> None:
    """Stops over frequency ratio and friction (Hong and Liu 2000), undamped, from rest."""
    known = grid("HL-1")
    values = {"frequency": np.array(known["ratios"]) / CIRCLE, "kinetic": known["loads"]}
    swept = ss.sweep(forced(0.5, 0.5), values, measures=["stops"], settle=4000, cycles=4, engine=engine)
    assert np.array_equal(swept.normal_stops, np.array(known["normal"], float))
    assert np.array_equal(swept.abnormal_stops, np.array(known["abnormal"], float))


@pytest.mark.parametrize(
    "engine", ["serial", "threads", pytest.param("dask", marks=pytest.mark.soak), "cuda"], indirect=True
)
def test_den_hartogs_boundary_by_bisection(engine: str) -> None:
    """Where the stops begin, halved down to 1e-8 for all rows together.

    A cluster, which is asked seventeen times, is held against `serial` in the events and values of this system above.
    """
    rows = [row for row in grid("DH-2")["boundary"] if abs(1 / row[0] / 2 - round(1 / row[0] / 2)) > 1e-12]
    bisected([row for row in rows if abs(row[0] - 1) > 0.02], 1000, engine)


def test_den_hartogs_boundary_next_to_resonance() -> None:
    """There a motion settles late."""
    bisected([row for row in grid("DH-2")["boundary"] if abs(row[0] - 1) < 0.02], 20_000, "threads")


def bisected(rows: list[list[float]], settle: int, engine: str) -> None:
    edge = np.array([row[2] for row in rows])
    low, high = edge * (1 - 1e-3), edge * (1 + 1e-3)
    while np.max((high - low) / edge) > 1e-8:
        middle = (low + high) / 2
        points = border(0.0, [[*row[:2], force] for row, force in zip(rows, middle, strict=True)])[::2]
        swept = ss.sweep(forced(0.5, 0.5), points, measures=["stops"], settle=settle, cycles=4, engine=engine)
        stops = (swept.normal_stops + swept.abnormal_stops).values > 0
        low, high = np.where(stops, low, middle), np.where(stops, middle, high)
    assert np.max(np.abs((low + high) / 2 - edge) / edge) < 1e-8


def test_rest_and_sliding_stand_beside_each_other(engine: str) -> None:
    """Static friction above the force: what rests stays; what slides does so up to Shaw's boundary, and then sticks."""
    bistable(answers("SHAW", engine))


def bistable(found: dict[str, Any]) -> None:
    assert found["status"].tolist() == [1, 0, 1, 0]
    assert found["normal_stops"].tolist() == [0, 0, 0, 2]
    assert np.all(found["amplitude"][::2] == 0)
    assert np.all(found["amplitude"][1::2] > 1.7)


def test_the_band_in_which_steady_sliding_is_lost(engine: str) -> None:
    """ST-1: Stribeck's curve, exponent 2; 0.005013 < V < 0.190840 m/s. A GPU does not march curves, and says so."""
    if engine == "cuda":
        with pytest.raises(ModelError, match=r"Stribeck.*linear modes.*threads"):
            ss.sweep(STRIBECK, belts(), settle=1, cycles=1, engine=engine)
        return
    swept = ss.sweep(STRIBECK, belts(), measures=["stick_share"], settle=600, cycles=5, engine=engine)
    assert (swept.stick_share > 0).values.tolist() == [False, True, True, False]


def test_the_exponent_of_chaos(engine: str) -> None:
    """Feeny and Moon's load that grows with position: 0.596 +- 0.004 per forcing period."""
    starts = {"start.x": np.linspace(0.4, 0.6, 8)}
    swept = ss.sweep(CHAOS, starts, measures=["lyapunov", "period"], settle=200, cycles=10_000, engine=engine)
    assert float(swept.lyapunov.mean()) / CHAOS.drive.frequency == pytest.approx(0.596, abs=0.004)  # type: ignore[union-attr]
    assert not swept.order.any()


@pytest.fixture(scope="module")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict[str, Any]]:
    """What the simulated GPU gives for the cases, from a process of its own."""
    if importlib.util.find_spec("numba.cuda") is None:
        pytest.skip('numba has no CUDA target: pip install ".[gpu]"')
    folder = tmp_path_factory.mktemp("cuda")
    environment = os.environ | {"NUMBA_ENABLE_CUDASIM": "1", "NUMBA_DISABLE_JIT": "1"}
    run = subprocess.run(
        [sys.executable, "-W", "error", __file__, str(folder)],
        capture_output=True,
        text=True,
        env=environment,
    )
    assert run.returncode == 0, run.stderr[-3000:]
    return {name: dict(np.load(folder / f"{name}.npz")) for name in CASES}


def pieces(name: str, *, gpu: bool) -> dict[str, Any]:
    """The modes that a case goes through, point by point, and how long it is in each."""
    system, points, _ = CASES[name]
    starts = [{key[6:]: value for key, value in point.items() if key.startswith("start.")} for point in points]
    changes = [{key: value for key, value in point.items() if not key.startswith("start.")} for point in points]
    cycles = 3 if name != "FM-1" else 7
    batch = simulate_batch(
        [system.having(**change) for change in changes], cycles=cycles, starts=starts, room=64, gpu=gpu
    )
    late = np.arange(64) >= batch.counts[:, None]
    found = {key: np.where(late, 0, getattr(batch, key)) for key in ("modes", "exits", "durations")}
    return {**found, "places": np.where(late, 0, batch.states[..., 0])}


def exponent(engine: str) -> float:
    """Feeny and Moon's, of so few periods that roundings do not grow to a part in a million [1/s]."""
    swept = ss.sweep(CHAOS, {"start.x": [0.5]}, measures=["lyapunov"], settle=0, cycles=25, engine=engine)
    return float(swept.lyapunov[0])


@pytest.mark.parametrize("name", CASES)
def test_a_simulated_gpu_agrees_too(name: str, simulated: dict[str, dict[str, Any]]) -> None:
    there, here = simulated[name], pieces(name, gpu=False)
    assert np.array_equal(here["modes"], there["modes"])
    assert np.array_equal(here["exits"], there["exits"])
    assert np.allclose(here["durations"], there["durations"], rtol=0, atol=1e-12)
    agree(answers(name, "serial"), there)


def test_a_simulated_gpu_tells_the_truths(simulated: dict[str, dict[str, Any]]) -> None:
    """The samples of each that its simulator can march in seconds."""
    stops = {name: found["normal_stops"] + 1j * found["abnormal_stops"] for name, found in simulated.items()}
    assert stops["HL-1"].tolist() == [2, 2 + 4j, 2 + 2j, 2]
    assert stops["DH-2"].tolist() == [0, 2]
    bistable(simulated["SHAW"])
    stuck = [mode.kind == "stick" for mode in table_of(CHAOS).modes]
    places = simulated["FM-1"]["places"][np.array(stuck)[simulated["FM-1"]["modes"]]]
    assert places[: len(STUCK)] == pytest.approx(STUCK, rel=1e-10)
    assert simulated["FM-1"]["exponent"] == pytest.approx(exponent("serial"), rel=1e-6)


if __name__ == "__main__":
    for case in CASES:
        more = {"exponent": exponent("cuda")} if case == "FM-1" else {}
        np.savez(Path(sys.argv[1]) / f"{case}.npz", **pieces(case, gpu=True), **answers(case, "cuda"), **more)
