"""A first run is answered by Python, as the compiled kernels answer it, while another process compiles them."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numba import njit

import stickslip as ss
from stickslip import drives, interpreted, laws
from stickslip.compiled import compilation
from stickslip.solve import kernel
from stickslip.solve.assembly import table_of
from stickslip.solve.glide import Model
from stickslip.solve.phasors import fast_tables

SYSTEMS: dict[str, Callable[[], Any]] = {
    "decay": lambda: ss.Oscillator(2.42, 2310.0, laws.Coulomb(1.1), drives.Release()),
    "rigid": lambda: ss.Oscillator(2.42, 2310.0, laws.Coulomb(1.1), drives.HarmonicBase(1e-3, 2.5), 0.1),
    "compliant": lambda: ss.Oscillator(
        2.42, 2310.0, laws.CompliantContact(1.1, 192000, 10.0), drives.HarmonicBase(0.65e-3, 2.5), 0.1
    ),
    "two tones": lambda: ss.Oscillator(
        1.0, 100.0, laws.Coulomb(1.0), drives.MultiTone([(0.02, 1.0, 0.0), (0.01, 1.7, 0.3)], on="base"), 0.1
    ),
    "elements": lambda: ss.Oscillator(
        1.0, 100.0, laws.ElastoSlip.iwan(500.0, width=0.01, elements=4), drives.HarmonicForce(4.0, 1.0), 0.2
    ),
    "stribeck": lambda: ss.Oscillator(1.0, 100.0, laws.Stribeck(1.0, 1.4, speed=0.02), drives.Belt(0.01), 0.1),
    "lugre": lambda: ss.Oscillator(
        1.0, 100.0, laws.LuGre(1.0, 1.3, 0.05, 1e4, 10.0), drives.HarmonicForce(4.0, 1.0), 0.1
    ),
    "delay": lambda: ss.Oscillator(
        1.0, 100.0, laws.TimeDelay(laws.LinearSlope(1.0, slope=0.5), 0.05), drives.HarmonicBase(0.05, 1.0), 0.1
    ),
}
START = {"decay": {"x": 0.01}}


def told(name: str) -> dict[str, Any]:
    run = ss.simulate(SYSTEMS[name](), duration=3.0, start=START.get(name, {}))
    grid = np.linspace(0.0, 3.0, 200)
    return {
        "events": [[event.time, event.kind, event.mode] for event in run.events],
        "motion": run.sample(grid, ("x", "v"))[0].tolist(),
        "status": run.status,
    }


def cold(folder: Path, code: str) -> Any:
    """What a process with nothing compiled prints."""
    where = os.pathsep.join([str(Path(__file__).parent), str(Path(ss.__file__).parents[1])])
    kept = {**os.environ, "NUMBA_CACHE_DIR": str(folder), "PYTHONPATH": where}
    done = subprocess.run([sys.executable, "-W", "error", "-c", code], env=kept, capture_output=True, text=True)
    assert not done.stderr, done.stderr
    return json.loads(done.stdout)


ALONE = """
import json, threading
from stickslip import interpreted
from stickslip.compiled import compilation
interpreted.PATIENCE = 1e9
interpreted._Order.given = lambda order: threading.Event()  # the compiler is never done
import test_interpreted as here
print(json.dumps({**{name: here.told(name) for name in here.SYSTEMS}, "seconds": compilation.seconds}))
"""


def test_python_answers_as_the_compiled_kernels_do(tmp_path: Path) -> None:
    alone = cold(tmp_path, ALONE)
    assert alone.pop("seconds") == 0.0  # nothing was compiled
    for name, got in alone.items():
        want = told(name)
        assert [event[1:] for event in got["events"]] == [event[1:] for event in want["events"]], name
        assert got["status"] == want["status"]
        times = [event[0] for event in got["events"]], [event[0] for event in want["events"]]
        np.testing.assert_allclose(*times, rtol=0, atol=3e-12, err_msg=name)
        scale = np.max(np.abs(want["motion"]), axis=1, keepdims=True)
        np.testing.assert_allclose(got["motion"] / scale, want["motion"] / scale, rtol=0, atol=1e-11, err_msg=name)


FIRST = """
import json, os
import stickslip as ss
from stickslip import interpreted
from stickslip.compiled import compilation
import test_interpreted as here
here.told("rigid")
first = compilation.seconds
for order in interpreted._compiler(os.getpid()).told.values():
    order.wait()
here.told("rigid")
print(json.dumps([first, compilation.seconds, len(here.kernel.march.overloads)]))
"""


def test_another_process_compiles_what_a_first_run_called(tmp_path: Path) -> None:
    assert cold(tmp_path, FIRST) == [0.0, 0.0, 1]


@njit
def total(state: Any) -> Any:
    return state[0] + state[1]


@njit
def counted(state: Any) -> Any:
    state[0] += 1.0
    return total(state)


def test_what_takes_python_long_is_left_to_the_compiled_kernel_as_if_it_had_not_begun(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    done = threading.Event()
    done.set()
    monkeypatch.setattr(interpreted._Order, "given", lambda order: done)
    state = np.array([1.0, 2.0])
    assert interpreted.at_once(counted, state) == 4.0
    assert state.tolist() == [2.0, 2.0]


def test_without_another_process_kernels_are_compiled_here(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "executable", "/nowhere/python")
    compiler = interpreted._Compiler()
    assert compiler.tell(b"job").is_set()


def test_a_process_that_fails_is_not_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(interpreted, "SERVE", "raise SystemExit(1)")
    assert interpreted._Compiler().tell(b"job").wait(60.0)


def test_a_refused_compilation_counts_for_nothing() -> None:
    before = compilation.seconds
    types = kernel.multiply.typeof_pyval(np.zeros((2, 2), np.float32)), *[kernel.multiply.typeof_pyval(np.zeros(2))] * 2
    with pytest.raises(interpreted.Uncompiled), compilation.refused():
        kernel.multiply.compile(types)
    assert compilation.seconds == before


def test_types_are_told_to_another_process_as_they_are() -> None:
    model = Model(table_of(SYSTEMS["rigid"]()).linear, fast_tables(table_of(SYSTEMS["rigid"]())), 0.4)
    shared = np.zeros((2, 3))[:, :2]
    shared.flags.writeable = False
    values = model, kernel.Scratch(*[shared] * 7), (1.0, 2), np.array([True]), np.int16(3), 7, 2.5, False
    kinds = [kernel.march.typeof_pyval(value) for value in values]
    again = [interpreted._type_of(json.loads(json.dumps(interpreted._told(kind)))) for kind in kinds]
    assert again == kinds
