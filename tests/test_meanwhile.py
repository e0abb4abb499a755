"""What is not compiled yet Python runs, while another process compiles it: the same motion, and nobody waits."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import stickslip as ss
from stickslip import compiled, drives, laws
from stickslip.compiled import Meanwhile, by_python
from stickslip.solve import assembly, cells, kernel, simulate, trajectory

SQUARE = "from stickslip.compiled import compiled\n\n@compiled()\ndef square(x):\n    return x * x\n"
FOURTH = f"{SQUARE}\n@compiled()\ndef fourth(x):\n    return square(square(x)) + 1.0 / x\n"
HELPER = f"""
from stickslip.compiled import beside, generated
with beside():
    generated({FOURTH!r}).fourth(2.0)
"""
BASE = drives.HarmonicBase(2e-3, frequency=2.5)


def rig(law: Any, drive: Any = BASE) -> ss.Oscillator:
    return ss.Oscillator(2.42, 2310.0, law, drive, 0.1)


RUNS: dict[str, tuple[Any, dict[str, Any]]] = {
    "Coulomb": (rig(laws.Coulomb(1.1)), {"cycles": 10}),
    "static": (rig(laws.Coulomb(1.1, 1.4)), {"cycles": 10}),
    "belt": (rig(laws.Coulomb(1.1, 1.4), drives.Belt(0.01)), {"cycles": 10}),
    "compliant": (rig(laws.CompliantContact(1.1, 192000, 24.0)), {"cycles": 5}),
    "elements": (rig(laws.ElastoSlip.iwan(192000, width=1e-4, elements=6)), {"cycles": 2}),
    "state variable": (rig(laws.StateVariable(1.1, 1e4)), {"cycles": 0.05}),
    "tones": (rig(laws.Coulomb(1.1), drives.MultiTone([(2e-3, 2.5, 0.0), (1e-3, 7.5, 0.0)])), {"cycles": 5}),
    "recorded": (
        rig(laws.Coulomb(1.1), drives.Recorded(5 * np.sin(np.arange(40)), fs=20, on="force")),
        {"duration": 1.9},
    ),
    "released": (rig(laws.Coulomb(1.1), drives.Release()), {"duration": 3.0, "start": {"x": 5e-3}}),
    "two masses": (
        ss.Structure(
            [[1, 0], [0, 1]],
            [[0, 0], [0, 0]],
            [[23.25, 3.9], [3.9, 7.75]],
            contacts=[ss.Contact(laws.Coulomb(0.6), [1, 0], normal=[0, 1], stiffness=11.0, preload=5.0)],
            drive=drives.Belt(0.8),
        ),
        {"duration": 10.0, "start": {"x1": 0.3, "v1": 0.0}},
    ),
}


@pytest.fixture
def uncompiled(monkeypatch: pytest.MonkeyPatch) -> Callable[[int], None]:
    """Calls from the given one on are compiled, those before Python's own."""

    def until(count: int) -> None:
        asked = iter(range(count))

        def now(self: Meanwhile, kernel_: Any, steps: int = 1) -> Any:
            left = kernel_ in self._ready or next(asked, None) is None
            return kernel_ if left else self._timed(by_python(kernel_))

        assembly._known.cache_clear()  # tables are made anew, which calls kernels too
        cells._known_turns.clear()
        monkeypatch.setattr(Meanwhile, "now", now)
        monkeypatch.setattr(compiled.meanwhile, "_ready", set())

    return until


def asked(name: str) -> tuple[ss.Trajectory, Any]:
    system, arguments = RUNS[name]
    run = ss.simulate(system, **arguments)
    return run, run.sample(np.linspace(0, run.duration, 2500), ("x", "v", "friction"))[0]


@pytest.mark.parametrize("count", [10**9, 5], ids=["all of it", "its beginning"])
@pytest.mark.parametrize("name", RUNS)
def test_python_runs_what_the_compiled_kernels_do(name: str, count: int, uncompiled: Callable[[int], None]) -> None:
    """The two round otherwise: compiled code takes a product and a sum as one."""
    whole, expected = asked(name)
    signatures = len(kernel.march.signatures), len(kernel.course.signatures)
    uncompiled(count)
    run, values = asked(name)
    assert signatures == (len(kernel.march.signatures), len(kernel.course.signatures))  # none is compiled anew
    assert count < 10**6 or compiled.meanwhile._ready.isdisjoint((kernel.march, kernel.course))
    assert (run.modes.tolist(), run.exits.tolist(), run.status) == (
        whole.modes.tolist(),
        whole.exits.tolist(),
        whole.status,
    )
    np.testing.assert_allclose(run.starts, whole.starts, rtol=1e-12, atol=1e-12)
    largest = np.abs(expected).max(axis=1, keepdims=True)
    assert np.max(np.abs(values - expected) / largest) < 1e-12


def test_a_piece_too_long_for_python_is_left_to_the_compiled_kernel(uncompiled: Callable[[int], None]) -> None:
    """It would be cut into other pieces; here it has 20,000 cells."""
    mass, start = (
        ss.Oscillator(mass=1, stiffness=1e6, law=laws.Coulomb(1.0), drive=drives.Belt(10.0)),
        {"x": 1e-3, "v": 0.0},
    )
    whole = ss.simulate(mass, duration=20.0, start=start)
    uncompiled(10**9)
    run = ss.simulate(mass, duration=20.0, start=start)
    assert len(run.modes) == len(whole.modes) == 1
    np.testing.assert_array_equal(run.kept, whole.kept)
    assert kernel.march in compiled.meanwhile._ready


def test_where_python_divides_by_zero_the_compiled_kernel_goes_on(
    uncompiled: Callable[[int], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = asked("Coulomb")[0]
    uncompiled(10**9)
    calls = iter(range(1000))

    def march(*arguments: Any) -> Any:
        written = by_python(kernel.march)(*arguments)
        if next(calls) == 1:
            return written[0] / 0.0
        return written

    timed = Meanwhile._timed
    monkeypatch.setattr(Meanwhile, "_timed", lambda self, own: timed(self, march if own.__name__ == "march" else own))
    run = asked("Coulomb")[0]
    assert next(calls) > 1
    np.testing.assert_allclose(run.starts, whole.starts, rtol=1e-12, atol=1e-12)


def test_an_interrupted_run_has_what_python_did(uncompiled: Callable[[int], None]) -> None:
    shares: list[float] = []

    def stop(share: float) -> None:
        shares.append(share)
        raise KeyboardInterrupt

    uncompiled(10**9)
    run = ss.simulate(RUNS["tones"][0], cycles=1000, progress=stop)
    assert run.status == "interrupted"
    assert 0 < run.starts[-1] + run.durations[-1] == pytest.approx(run.duration)
    assert run.duration < 1000 / 2.5


# ---- the other process


@pytest.fixture
def cold(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """A kernel that is not compiled, and a process of another's that would compile it; none is left behind."""
    monkeypatch.delenv("STICKSLIP_WAIT")
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(compiled, "AHEAD", HELPER)
    root = tmp_path / "kernels"
    root.mkdir()
    monkeypatch.setattr(compiled, "_root", lambda: root)
    yield compiled.generated(FOURTH).fourth
    until(lambda: not (root / compiled.LOCK).exists())


def until(done: Callable[[], bool]) -> None:
    """Wait, at most a minute."""
    last = time.monotonic() + 60
    while not done():
        assert time.monotonic() < last
        time.sleep(0.02)


def test_python_answers_until_the_other_process_is_done(cold: Any) -> None:
    meanwhile = Meanwhile()
    by_hand = meanwhile.now(cold)
    assert by_hand is not cold
    assert by_hand(2.0) == 16.5
    assert np.isinf(by_hand(np.float64(0.0)))  # as compiled, and without a warning
    assert meanwhile.seconds > 0
    assert not cold.overloads
    until(lambda: meanwhile.now(cold) is cold)
    assert cold(2.0) == 16.5
    assert sum(cold.stats.cache_hits.values()) == 1


def test_who_has_waited_long_enough_waits_for_the_other_process(cold: Any) -> None:
    meanwhile = Meanwhile()
    assert meanwhile.now(cold) is not cold
    meanwhile.seconds = 2 * compiled.PATIENCE
    assert meanwhile.now(cold)(2.0) == 16.5
    assert sum(cold.stats.cache_hits.values()) == 1


def test_several_begin_one_process_together(cold: Any) -> None:
    lock = compiled._root() / compiled.LOCK  # type: ignore[operator]
    first = compiled._begun(lock)
    assert first is not None
    assert compiled._begun(lock) is None
    other = Meanwhile()
    assert other.now(cold) is not cold  # it is not alone, and runs meanwhile
    assert other._own is None
    assert first.wait(60) == 0


def test_one_that_was_killed_holds_nobody_up(cold: Any) -> None:
    lock = compiled._root() / compiled.LOCK  # type: ignore[operator]
    lock.touch()
    assert compiled._begun(lock) is None
    os.utime(lock, (0, 0))
    other = compiled._begun(lock)
    assert other is not None
    assert other.wait(60) == 0


@pytest.mark.parametrize("script", ["raise SystemExit(1)", "import os; os.abort()", "import no_such_module"])
def test_one_that_fails_harms_nothing(script: str, cold: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compiled, "AHEAD", script)
    meanwhile = Meanwhile()
    assert meanwhile.now(cold)(2.0) == 16.5
    until(lambda: meanwhile.now(cold) is cold)
    assert cold(2.0) == 16.5
    assert not sum(cold.stats.cache_hits.values())
    (compiled._root() / compiled.LOCK).unlink()  # type: ignore[operator]


@pytest.mark.parametrize("program", ["", "/usr/bin/blender", "/nowhere/python3"])
def test_none_is_begun_where_python_is_part_of_a_program(
    program: str, cold: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "executable", program)
    meanwhile = Meanwhile()
    assert meanwhile.now(cold) is cold
    assert meanwhile.awaited(cold)(2.0) == 16.5


def test_who_would_rather_wait_begins_none(cold: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("STICKSLIP_WAIT", "1")
    assert Meanwhile().now(cold) is cold
    assert not (compiled._root() / compiled.LOCK).exists()  # type: ignore[operator]


def test_long_work_begins_none(cold: Any) -> None:
    with compiled.waiting():
        assert os.environ["STICKSLIP_WAIT"] == "1"
        assert Meanwhile().now(cold) is cold
    assert "STICKSLIP_WAIT" not in os.environ
    assert not (compiled._root() / compiled.LOCK).exists()  # type: ignore[operator]


def test_who_waits_for_a_slow_process_compiles_itself_at_last(cold: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    lock = compiled._root() / compiled.LOCK  # type: ignore[operator]
    lock.touch()
    monkeypatch.setattr(compiled, "LONGEST", 0.2)
    meanwhile = Meanwhile()
    assert meanwhile.now(cold) is not cold
    assert meanwhile.awaited(cold)(2.0) == 16.5
    assert lock.exists()
    assert not sum(cold.stats.cache_hits.values())
    lock.unlink()


def test_what_takes_python_long_is_compiled_at_once(cold: Any) -> None:
    assert Meanwhile().now(cold, compiled.MOST + 1) is cold


def test_all_that_a_run_calls_is_compiled_ahead() -> None:
    simulate.ahead()
    called = (
        assembly.derive, cells.distinct, kernel.begin, kernel.march, kernel.course, trajectory.sample, trajectory.follow
    )  # fmt: skip
    assert [own.__name__ for own in called if not compiled._on_disk(own)] == []


OUTLIVED = """
import warnings
import stickslip as ss
from stickslip.compiled import meanwhile
from stickslip.solve import kernel
slider = ss.Oscillator(2.42, 2310.0, ss.laws.Coulomb(1.1), ss.drives.HarmonicBase(2e-3, 2.5), 0.1)
run = ss.simulate(slider, cycles=2)
print(len(run.modes), meanwhile.seconds > 0, len(kernel.march.overloads), meanwhile._own.pid)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="the process is ended by a signal")
def test_a_first_run_does_not_wait_and_what_it_begins_outlives_it_in_silence(tmp_path: Path) -> None:
    environment = {name: value for name, value in os.environ.items() if name != compiled.WAITS}
    environment["NUMBA_CACHE_DIR"] = str(tmp_path)
    command = [sys.executable, "-X", "dev", "-W", "error", "-c", OUTLIVED]
    run = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=60)
    pieces, by_hand, overloads, other = run.stdout.split()
    assert (pieces, by_hand, overloads, run.stderr) == ("7", "True", "0", "")
    os.kill(int(other), 9)


# ---- releases of numba that are not known


STRANGE = """
import numba, numba.core.codegen, numba.core.compiler
numba.__version__ = "0.99.0"
del numba.core.codegen.JITCodeLibrary  # called otherwise
from stickslip import compiled, compiler
fourth = compiled.generated({text!r}).fourth
print(compiler.KNOWN, fourth(2.0), len(fourth.overloads))
"""


def test_an_unknown_release_of_numba_compiles_as_it_does_by_itself(tmp_path: Path) -> None:
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    command = [sys.executable, "-c", STRANGE.format(text=FOURTH)]
    run = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=60)
    assert run.stdout.split() == ["False", "16.5", "1"], run.stderr
