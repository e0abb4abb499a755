"""The same kernels on a GPU: in numba's simulator of one, where they run as plain Python, thread by thread."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numba
import numpy as np
import pytest

import stickslip as ss
from batches import Batch, simulate_batch
from stickslip.errors import ModelError
from stickslip.maps.crowd import rooms

MASS, SPRING = 2.42, 2310.0
RIGID = ss.Oscillator(
    mass=MASS, stiffness=SPRING, damping=0.12, law=ss.laws.Coulomb(1.1), drive=ss.drives.HarmonicBase(0.65e-3, 2.5)
)
DRIVEN = 0.65e-3 * np.array([1.0, 2 * np.pi * 2.5])  # displacement [m] and velocity [m/s] of the base


def grazing(gap: float) -> list[ss.Oscillator]:
    """Friction a part `gap` below and above the largest pull of the spring: out for an instant, or not at all."""
    return [RIGID.having(law=ss.laws.Coulomb(0.65e-3 * SPRING * (1 + d))) for d in (-gap, gap)]


CASES = {
    "rigid, many stops": ([RIGID], 12.0, [{}]),
    "rigid, a map": ([RIGID.having(frequency=f) for f in (2.5, 4.0, 5.61, 8.7, 11.0)], 10.0, None),
    "rigid, a basin": ([RIGID], 6.0, [{"x": x, "v": v} for x in (-1e-3, 2e-3) for v in (-0.05, 0.0, 0.02)]),
    "compliant": (
        [RIGID.having(law=ss.laws.CompliantContact(1.1, 192000.0, 20.0), frequency=5.61)],
        4.0,
        [{}, {"x": 1e-4}],
    ),
    "sticking for good": ([RIGID.having(amplitude=0.3e-3)], 3.0, [{}, {"x": 1e-4}]),
    "grazing": (grazing(1e-6), 3.0, None),
    "grazing closer": (grazing(1e-9), 3.0, None),
    "free, no drive": ([ss.Oscillator(mass=1, stiffness=4, law=ss.laws.Coulomb(1.0))], 3.0, [{"x": 1.25}, {"x": 3.7}]),
}


def solve(name: str, *, gpu: bool) -> Batch:
    systems, cycles, starts = CASES[name]
    return simulate_batch(systems, cycles=cycles, starts=starts, room=160, gpu=gpu)


def packed(batch: Batch) -> dict[str, np.ndarray]:
    """The arrays by name, with nothing after the last piece of a row."""
    arrays = {key: value.copy() for key, value in batch._asdict().items()}
    late = np.arange(batch.modes.shape[1]) >= batch.counts[:, None]
    for key in ("laps", "offsets", "modes", "durations", "states", "exits"):
        arrays[key][late] = 0
    return arrays


@pytest.fixture(scope="module")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict[str, np.ndarray]]:
    """What the simulated GPU gives for each case, from a process of its own."""
    if importlib.util.find_spec("numba.cuda") is None:
        pytest.skip('numba has no CUDA target: pip install ".[gpu]"')
    folder = tmp_path_factory.mktemp("cuda")
    environment = os.environ | {"NUMBA_ENABLE_CUDASIM": "1", "NUMBA_DISABLE_JIT": "1"}
    command = [sys.executable, "-W", "error", __file__, str(folder)]
    run = subprocess.run(command, capture_output=True, text=True, env=environment)
    assert run.returncode == 0, run.stderr[-3000:]
    return {name: dict(np.load(folder / f"{j}.npz")) for j, name in enumerate(CASES)}


@pytest.mark.parametrize("name", CASES)
def test_a_gpu_gives_the_same_events_and_states(name: str, simulated: dict[str, dict[str, np.ndarray]]) -> None:
    here, there = packed(solve(name, gpu=False)), simulated[name]
    for key in ("counts", "statuses", "laps", "modes", "exits"):
        assert np.array_equal(here[key], there[key]), key
    assert here["counts"].min() >= 1
    # a break-away a part d below the crest turns one rounding into 1 / (2 pi sqrt(2 d)) of a period: 3,600 at 1e-9
    allowed = 1e-11 if name == "grazing closer" else 1e-13
    period = CASES[name][0][0].drive.motion().period
    period = period if np.isfinite(period) else np.pi
    for key, scale in (("offsets", period), ("durations", period)):
        assert np.max(np.abs(here[key] - there[key])) <= allowed * scale, key
    own = 2 + len(CASES[name][0][0].law.memory)  # the drive's signals follow the clock, which is compared above
    for key in ("states", "final"):
        mine, theirs = here[key][..., :own], there[key][..., :own]
        scale = np.max(np.abs(mine), axis=tuple(range(mine.ndim - 1)))
        scale[:2] = np.maximum(scale[:2], DRIVEN)  # a motion out of a graze is small beside what moves it
        assert np.all(np.abs(mine - theirs) <= 1e-13 * scale), key


def test_the_kernel_is_typed_and_lowered_for_a_gpu(monkeypatch: pytest.MonkeyPatch) -> None:
    """By numba-cuda's own compiler, as far as NVIDIA's, which needs no card: the simulated GPU runs plain Python."""
    compiler = pytest.importorskip("numba.cuda.compiler", reason='numba has no CUDA target: pip install ".[gpu]"')
    from stickslip.maps import cuda

    blocks: list[tuple[Any, ...]] = []

    def refused(given: Any, out: Any, size: int, physical: int) -> None:
        blocks.append((given, out, rooms(len(given.states), size, physical)))
        raise KeyboardInterrupt

    card = SimpleNamespace(compute_capability=(9, 0))
    monkeypatch.setattr("numba.cuda.dispatcher.get_current_device", lambda: card)
    monkeypatch.setattr(cuda, "_require_gpu", lambda: None)
    monkeypatch.setattr(cuda, "_watch", refused)
    with pytest.raises(KeyboardInterrupt):
        ss.sweep(RIGID, {"kinetic": [0.5, 1.0]}, engine="cuda", settle=1, cycles=1)
    kernel, types = cuda._watch_thread.py_func, tuple(map(numba.typeof, blocks[0]))
    code = compiler.compile_cuda(kernel, numba.types.void, types, cc=card.compute_capability)._asdict()["library"]
    assert "double" in code.get_llvm_str()


@pytest.mark.parametrize("name", CASES)
def test_a_batch_is_each_motion_alone(name: str) -> None:
    systems, cycles, starts = CASES[name]
    batch = solve(name, gpu=False)
    for i in range(len(batch.counts)):
        system = systems[i if len(systems) > 1 else 0]
        run = ss.simulate(system, cycles=cycles, start=starts[i] if starts else None)
        count = batch.counts[i]
        assert np.array_equal(run.modes, batch.modes[i, :count])
        assert np.allclose(run.durations, batch.durations[i, :count], rtol=1e-10, atol=1e-13)


def test_the_cases_cover_what_they_say() -> None:
    assert solve("rigid, many stops", gpu=False).counts[0] > 40
    assert solve("sticking for good", gpu=False).counts[0] == 1
    for name in ("grazing", "grazing closer"):
        out, held = solve(name, gpu=False).counts
        assert out > 1
        assert held == 1


def test_a_batch_refuses_what_it_cannot_march() -> None:
    with pytest.raises(ModelError, match="different modes"):
        simulate_batch([RIGID, RIGID.having(law=ss.laws.CompliantContact(1.1, 1e5, 1.0))], cycles=1)
    with pytest.raises(ModelError, match="2 systems for 3 starts"):
        simulate_batch([RIGID, RIGID], cycles=1, starts=[{}, {}, {}])


if __name__ == "__main__":
    for j, case in enumerate(CASES):
        np.savez(Path(sys.argv[1]) / f"{j}.npz", **packed(solve(case, gpu=True)))
