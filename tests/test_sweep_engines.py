"""Every engine gives the answers of one motion simulated by itself, and the known ones."""

from __future__ import annotations

import importlib.util
import math
import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import stickslip as ss
from stickslip.errors import ModelError, SolveError
from stickslip.maps.crowd import _alone, run_block
from stickslip.maps.engines import threads
from stickslip.maps.measures import LOG, MEASURES
from stickslip.maps.sweep import planned
from stickslip.solve import cells
from stickslip.solve.assembly import table_of, tables_of
from stickslip.solve.tables import systems_of

xarray = pytest.importorskip("xarray")
COUNTED = [measure for measure in MEASURES if measure != LOG]  # what a march counts without keeping the motion
RIGID = ss.Oscillator(
    mass=2.42,
    stiffness=2310,
    damping=0.12,
    law=ss.laws.Coulomb(1.1),
    drive=ss.drives.HarmonicBase(0.65e-3, frequency=2.5),
)
COMPLIANT = RIGID.having(law=ss.laws.CompliantContact(1.1, 192000, 23.9))
BELT = ss.Oscillator(mass=1, stiffness=1, damping=0.1, law=ss.laws.Coulomb(1.0, static=1.5), drive=ss.drives.Belt(0.5))
TWO_BLOCKS = ss.Structure(
    np.eye(2),
    np.zeros((2, 2)),
    np.array([[2.2, -1.2], [-1.2, 2.2]]),
    contacts=[
        ss.Contact(ss.laws.Coulomb(0.8, static=1.0), [1, 0]),
        ss.Contact(ss.laws.Coulomb(1.0, static=1.25), [0, 1]),
    ],
    drive=ss.drives.Belt(0.02),
)
TWO_TONES = ss.drives.MultiTone([(0.65e-3, 2.5, 0.0), (0.3e-3, 2.5 * math.sqrt(2), 0.0)])
CASES: dict[str, tuple[ss.Oscillator, dict[Any, Any], int, int]] = {
    "rigid": (RIGID, {"frequency": [1.3, 5.61, 20.0], "kinetic": [0.3, 1.1, 1.6]}, 30, 40),
    "compliant": (COMPLIANT, {"frequency": [2.5, 5.61], "kinetic": [0.7, 1.28]}, 30, 40),
    "starts": (RIGID, {("start.x", "start.v"): [(0, 0), (1e-3, 0.02)], "mass": [1.0, 2.42]}, 30, 40),
    "laws": (RIGID, {"law": [ss.laws.Coulomb(1.0), COMPLIANT.law, ss.laws.LinearSlope(1.0, 0.5)]}, 30, 40),
    "a belt": (BELT, {"speed": [0.1, 0.5]}, 30, 40),
    "free": (ss.Oscillator(mass=1, stiffness=4, law=ss.laws.Coulomb(1.0)), {"start.x": [1.25, 3.7]}, 2, 30),
}


@pytest.mark.parametrize(
    "systems",
    [
        [RIGID.having(frequency=f, kinetic=k) for f in (2.5, 9.0) for k in (0.5, 1.1)],
        [COMPLIANT.having(kinetic=k, mass=m) for k in (0.5, 1.1) for m in (1.0, 2.42)],
        [BELT.having(speed=v, damping=c) for v in (0.1, 0.5) for c in (0.0, 0.1)],
        [RIGID.having(law=ss.laws.PositionLoad(1.0, gradient=g)) for g in (0.5, 1.5)],
    ],
    ids=["rigid", "compliant", "belt", "position"],
)
def test_systems_together_have_the_tables_of_each_alone(systems: list[ss.Oscillator]) -> None:
    together = tables_of(systems_of(systems))
    for row, system in enumerate(systems):
        own, alone = together.of(row), table_of(system)
        for name in (*own.linear._fields, "friction", "opening", "begin", "period"):
            one, other = (np.asarray(getattr(table, name)) for table in (own, alone))
            assert np.array_equal(one, other), name
        assert own.outputs.keys() == alone.outputs.keys()
        assert all(np.array_equal(own.outputs[name], alone.outputs[name]) for name in alone.outputs)
        assert (own.entry, own.names, own.motion) == (alone.entry, alone.names, alone.motion)


@pytest.mark.parametrize("engine", ["serial", "threads"])
@pytest.mark.parametrize(
    ("system", "name", "values"),
    [
        (BELT, "speed", (0.1, 0.5)),
        (BELT.having(law=COMPLIANT.law), "mass", (1.0, 2.0)),
        (TWO_BLOCKS, "speed", (0.02, 0.05)),
        (RIGID.having(drive=TWO_TONES), "mass", (1.0, 2.0)),
    ],
    ids=["rigid", "compliant", "two blocks", "tones"],
)
def test_exponents_without_a_period_of_the_drive_are_those_of_each_alone(
    system: ss.Oscillator, name: str, values: tuple[float, ...], engine: str
) -> None:
    swept = ss.sweep(system, {name: values}, measures=["lyapunov", "amplitude"], cycles=25, settle=5, engine=engine)
    for value, exponent in zip(values, swept.lyapunov.values, strict=True):
        assert exponent == ss.solve.lyapunov(system.having(**{name: value}), cycles=25, transient=5).value
    assert np.all(swept.amplitude > 0)


@pytest.mark.parametrize("measures", [["lyapunov"], ["amplitude", "lyapunov"]])
def test_no_exponent_is_asked_of_what_nothing_drives(measures: list[str]) -> None:
    with pytest.raises(SolveError, match=r"no period.*a belt"):
        ss.sweep(CASES["free"][0], {"mass": [1.0, 2.0]}, measures=measures, settle=1, cycles=30)


def test_an_exponent_on_a_belt_is_for_other_engines_than_a_gpu() -> None:
    cuda = pytest.importorskip("stickslip.maps.cuda")
    plan = planned(BELT, {"mass": [1.0]}, measures=["lyapunov"], cycles=30, settle=0, start={})
    with pytest.raises(ModelError, match=r"tells its exponent under one; take engine=\"threads\""):
        run_block(plan, 0, alone=cuda._refuse)


@pytest.mark.parametrize("name", CASES)
def test_marched_together_they_are_as_each_alone(name: str) -> None:
    """The counted march against a Trajectory of each motion, whose measures are taken in another way."""
    system, values, settle, cycles = CASES[name]
    asked = [measure for measure in COUNTED if name != "free" or measure != "lyapunov"]
    plan = planned(system, values, measures=asked, cycles=cycles, settle=settle, start={})
    for number in plan.blocks:
        found, _ = run_block(plan, number)
        for row, steps in enumerate(plan.points(number)):
            known = _alone(plan, steps)
            for key, column in found.items():
                assert column.ravel()[row] == pytest.approx(
                    known.get(key, math.nan), rel=1e-11, abs=1e-15, nan_ok=True
                ), key


@pytest.mark.parametrize("system", [RIGID, COMPLIANT], ids=["rigid", "compliant"])
def test_what_repeats_is_counted_as_if_it_were_marched(system: ss.Oscillator) -> None:
    """The exponent is carried through every lap; the other measures alone skip those in which a motion repeats."""
    values = {"frequency": [2.5, 4.1, 9.0], "kinetic": [0.3, 1.1]}
    whole = ss.sweep(system, values, measures=COUNTED, settle=200, cycles=41)
    for measure in COUNTED:
        alone = ss.sweep(system, values, measures=[measure], settle=200, cycles=41)
        for name in alone.data_vars:
            assert np.allclose(alone[name], whole[name], rtol=1e-12, atol=1e-15, equal_nan=True), name


@pytest.mark.parametrize("engine", ["threads", "threads://1", "threads://5"])
def test_threads_give_the_same_bytes(engine: str) -> None:
    values = {"frequency": np.linspace(2, 9, 9), "kinetic": np.linspace(0.2, 1.6, 9)}
    one, other = (
        ss.sweep(COMPLIANT, values, measures=COUNTED, settle=20, cycles=30, engine=e) for e in ("serial", engine)
    )
    for name in one.data_vars:
        assert one[name].values.tobytes() == other[name].values.tobytes(), name


def test_an_interrupt_keeps_what_is_done() -> None:
    calls: list[int] = []

    def stop(run: ss.solve.Trajectory) -> float:
        calls.append(1)
        if len(calls) == 5:
            raise KeyboardInterrupt
        return float(len(run.events))

    swept = ss.sweep(RIGID, {"kinetic": np.linspace(0.2, 1.6, 8)}, measures=[stop], settle=1, cycles=1, engine="serial")
    assert swept.attrs["status"].startswith("interrupted: 4 of 8")
    assert np.isfinite(swept.stop).sum() == 4


def test_a_failed_point_does_not_stop_the_threads() -> None:
    def broken(run: ss.solve.Trajectory) -> float:
        raise ZeroDivisionError("a user's mistake is a user's")

    with pytest.raises(ZeroDivisionError):
        ss.sweep(RIGID, {"kinetic": [0.5, 1.0]}, measures=[broken], settle=1, cycles=1, engine="threads")


def test_no_gpu_is_one_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    numba_cuda = pytest.importorskip("numba.cuda")
    monkeypatch.setattr(numba_cuda, "is_available", lambda: False)
    with pytest.raises(ModelError, match=r"finds no NVIDIA GPU.*threads"):
        ss.sweep(RIGID, {"kinetic": [0.5]}, engine="cuda", settle=1, cycles=1)


SIMULATED = {name: CASES[name] for name in ("rigid", "compliant", "a belt")}


@pytest.fixture(scope="module")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """What the simulated GPU gives for some cases, from a process of its own."""
    if importlib.util.find_spec("numba.cuda") is None:
        pytest.skip('numba has no CUDA target: pip install ".[gpu]"')
    folder = tmp_path_factory.mktemp("cuda")
    environment = os.environ | {"NUMBA_ENABLE_CUDASIM": "1", "NUMBA_DISABLE_JIT": "1"}
    command = [sys.executable, "-W", "error", __file__, str(folder)]
    run = subprocess.run(command, capture_output=True, text=True, env=environment)
    assert run.returncode == 0, run.stderr[-3000:]
    return {name: dict(np.load(folder / f"{j}.npz")) for j, name in enumerate(SIMULATED)}


def on_gpu(name: str, engine: str) -> Any:
    system, values, _, _ = SIMULATED[name]
    few = {key: list(column)[-2:] for key, column in values.items()}
    return ss.sweep(system, few, measures=[m for m in COUNTED if m != "lyapunov"], settle=2, cycles=4, engine=engine)


@pytest.mark.parametrize("name", SIMULATED)
def test_a_gpu_gives_the_same(name: str, simulated: dict[str, Any]) -> None:
    here = on_gpu(name, "serial")
    for key in here.data_vars:
        values, other = here[key].values, simulated[name][key]
        if key in ("status", "normal_stops", "abnormal_stops", "micro_slips", "order"):
            assert np.array_equal(values, other), key
        assert np.allclose(values, other, rtol=1e-12, atol=1e-16, equal_nan=True), key


def test_a_gpu_without_double_precision_or_a_driver_that_fits_is_one_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    numba_cuda = pytest.importorskip("numba.cuda")
    monkeypatch.setattr(numba_cuda, "is_available", lambda: True)
    monkeypatch.setattr(numba_cuda, "get_current_device", lambda: SimpleNamespace(compute_capability=(1, 1)))
    with pytest.raises(ModelError, match=r"compute capability 1\.1; .*double precision.*engine=\"threads\""):
        ss.sweep(RIGID, {"kinetic": [0.5]}, engine="cuda", settle=1, cycles=1)

    def too_old() -> None:
        raise ImportError("CUDA driver version is insufficient")

    monkeypatch.setattr(numba_cuda, "get_current_device", too_old)
    with pytest.raises(SolveError, match=r"driver refuses: CUDA driver version is insufficient;.*up to date"):
        ss.sweep(RIGID, {"kinetic": [0.5]}, engine="cuda", settle=1, cycles=1)


def test_a_gpu_refuses_what_it_cannot_march(monkeypatch: pytest.MonkeyPatch) -> None:
    numba_cuda = pytest.importorskip("numba.cuda")
    monkeypatch.setattr(numba_cuda, "is_available", lambda: True)
    monkeypatch.setattr(numba_cuda, "get_current_device", lambda: SimpleNamespace(compute_capability=(9, 0)))
    slider = RIGID.having(law=ss.laws.LuGre(1.1, 1.3, speed=1e-3, stiffness=2e5, damping=20.0))
    with pytest.raises(ModelError, match=r'LuGre.*take engine="threads"'):
        ss.sweep(slider, {"kinetic": [1.0]}, engine="cuda", settle=1, cycles=1)
    with pytest.raises(ModelError, match=r"'events'.*keeps none.*threads"):
        ss.sweep(RIGID, {"kinetic": [1.0]}, measures=["events"], engine="cuda", settle=1, cycles=1)


def test_the_threads_engine_is_the_default_of_this_machine() -> None:
    plan = planned(RIGID, {"kinetic": [0.5, 0.7, 0.9]}, measures=["stops"], cycles=2, settle=2, start={})
    kept: dict[int, Any] = {}
    threads(plan, plan.blocks, lambda number, arrays, events: kept.update({number: arrays}))
    assert sorted(kept) == list(plan.blocks)


if __name__ == "__main__":
    for j, case in enumerate(SIMULATED):
        np.savez(Path(sys.argv[1]) / f"{j}.npz", **{k: v.values for k, v in on_gpu(case, "cuda").data_vars.items()})


def test_more_single_systems_than_are_kept_have_the_tables_of_each_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cells, "MOST_KNOWN", 3)
    systems = [RIGID.having(mass=m) for m in (1.0, 1.5, 2.0, 2.5, 1.0)]  # which have their stick in common
    together = tables_of(systems_of(systems))
    for row, system in enumerate(systems):
        assert np.array_equal(together.hop[row], tables_of(systems_of([system])).hop[0])
