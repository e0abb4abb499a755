"""Compiled kernels are kept on disk, and made anew when any file that holds one changes."""

from __future__ import annotations

import gc
import math
import os
import pickle
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import stickslip
from stickslip import compiled, compiler
from stickslip.cli.terminal import compiling
from stickslip.signals.pieces import turning_points

PACKAGE = Path(stickslip.__file__).parent
ASK = (
    "import stickslip.solve.kernel as k, stickslip.compiled as c; import numpy as np; from pathlib import Path;"
    "order = k.opening_order(np.zeros(3), np.zeros(3), 3);"
    "stats = k.opening_order.stats; print(order, sum(stats.cache_hits.values()), c.folder(Path(k.__file__)))"
)


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """The package in a folder of its own, without what was compiled."""
    shutil.copytree(PACKAGE, tmp_path / "site" / "stickslip", ignore=shutil.ignore_patterns("__pycache__"))
    return tmp_path / "site"


def ask(site: Path, **variables: str) -> tuple[int, int, Path]:
    """What a fresh process computes, how often it found it on disk, and where."""
    environment = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    environment |= {"PYTHONPATH": str(site), "PYTHONDONTWRITEBYTECODE": "1", **variables}
    run = subprocess.run([sys.executable, "-c", ASK], capture_output=True, text=True, env=environment)
    assert run.returncode == 0, run.stderr
    order, hits, folder = run.stdout.split(maxsplit=2)
    return int(order), int(hits), Path(folder.strip())


def test_a_second_process_finds_what_the_first_compiled(copy: Path) -> None:
    assert ask(copy)[:2] == (3, 0)
    order, hits, folder = ask(copy)
    assert (order, hits) == (3, 1)
    assert folder.is_relative_to(copy)


def test_a_change_in_one_file_is_seen_by_its_callers_in_others(copy: Path) -> None:
    first = ask(copy)[2]
    constant = copy / "stickslip" / "solve" / "roots.py"
    constant.write_text(constant.read_text("utf-8").replace("NOISE = 64 *", "NOISE = 65 *"), "utf-8")
    assert ask(copy)[2] != first


def test_a_change_in_one_file_leaves_the_kernels_of_others(copy: Path) -> None:
    first = ask(copy)[2]
    other = copy / "stickslip" / "signals" / "pieces.py"
    other.write_text(other.read_text("utf-8") + "\n# another word\n", "utf-8")
    order, hits, folder = ask(copy)
    assert (order, hits, folder) == (3, 1, first)


def test_what_nothing_has_loaded_for_long_is_removed(copy: Path) -> None:
    kept = ask(copy)[2]
    stale, recent = kept.with_name("generated_0-0"), kept.with_name("generated_1-1")
    for folder in (stale, recent):
        folder.mkdir()
    os.utime(stale, (0, 0))
    constant = copy / "stickslip" / "solve" / "roots.py"
    constant.write_text(constant.read_text("utf-8").replace("NOISE = 64 *", "NOISE = 65 *"), "utf-8")
    ask(copy)
    assert not stale.exists()
    assert recent.exists()
    assert kept.exists()


def test_an_install_that_may_not_be_written_keeps_them_with_the_user(copy: Path, tmp_path: Path) -> None:
    (copy / "stickslip" / "__pycache__").write_text("a file where the folder would be", "utf-8")
    user = {"XDG_CACHE_HOME": str(tmp_path / "user"), "LOCALAPPDATA": str(tmp_path / "user")}
    first, second = ask(copy, **user), ask(copy, **user)
    assert (first[1], second[1]) == (0, 1)
    assert not second[2].is_relative_to(copy)


def test_a_folder_named_by_the_user_goes_first(copy: Path, tmp_path: Path) -> None:
    assert ask(copy, NUMBA_CACHE_DIR=str(tmp_path / "named"))[2].is_relative_to(tmp_path / "named")


SQUARE = "from stickslip.compiled import compiled\n\n@compiled()\ndef square(x):\n    return x * x\n"


FOURTH = f"{SQUARE}\n@compiled()\ndef fourth(x):\n    return square(square(x))\n"


def test_what_compiled_code_calls_answers_python_as_well(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compiled, "_root", lambda: tmp_path)
    for _ in range(2):  # compiled, and found on disk: what is kept for compiled callers has no entrance for Python
        module = compiled.generated(FOURTH)
        assert (module.fourth(2.0), module.square(3.0)) == (16.0, 9.0)
        assert gc.isenabled()
    assert sum(module.square.stats.cache_hits.values()) == 1


FIRST = """
import sys
import numpy as np
from stickslip.signals.pieces import turning_points
before, rows = "numba" in sys.modules, np.zeros(9, dtype=np.int64)
print(before, turning_points(np.array([0.0, 2.0, 0.0, 3.0]), 1.0, rows), "numba" in sys.modules)
"""


def test_numba_is_imported_with_the_first_kernel_that_is_called() -> None:
    run = subprocess.run([sys.executable, "-c", FIRST], capture_output=True, text=True, check=True)
    assert run.stdout.split() == ["False", "4", "True"]


def test_a_kernel_crosses_to_another_process_by_its_name() -> None:
    assert pickle.loads(pickle.dumps(turning_points)) is turning_points


LINES = """
a = y[0] * q[1] + h
b = exp(-2.0 * fabs(a)) / (1.0 + tanh(y[1]))
c = log(a) if a > 0.0 else (0.5 if a < -1.0 else nan)
s[0] = b - asinh(c)
s[1] = power(y[1], q[0]) if y[1] < 2.0 else 0.1
"""
FILLED = f"""
from stickslip.compiled import compiled
from stickslip.solve.straight import straight

lines = straight('''{LINES}''')

@compiled()
def filled(q, y, h, s):
    lines(q, y, h, s)
"""


@pytest.mark.parametrize("first", [-3.0, -0.5, 0.7])
@pytest.mark.parametrize("second", [0.4, 3.0])
def test_straight_lines_give_what_python_makes_of_them(
    first: float, second: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(compiled, "_root", lambda: tmp_path)
    q, y, h, s, plain = np.array([1.7, 2.3]), np.array([first, second]), 0.3, np.zeros(2), np.zeros(2)
    compiled.generated(FILLED).filled(q, y, h, s)
    known = {name: getattr(math, name) for name in ("exp", "fabs", "tanh", "log", "asinh", "nan")}
    exec(LINES, {**known, "power": math.pow, "q": q, "y": y, "h": h, "s": plain})
    np.testing.assert_allclose(s, plain, rtol=1e-15)


def test_who_watches_is_told_that_it_compiles_and_for_how_long(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(compiled, "_root", lambda: tmp_path)
    monkeypatch.setattr(compiler.compilation, "seconds", 0.0)
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    with compiling():
        assert compiled.generated(f"{SQUARE}# watched\n").square(3.0) == 9.0
        assert compiler.compilation.seconds > 0
        monkeypatch.setattr(compiler.compilation, "seconds", 7.0)
    lines = capsys.readouterr().err.splitlines()
    assert lines == [
        "stickslip: compiling for this machine, once; what is compiled is kept",
        "stickslip: compiled in 7 s; the next run finds it",
    ]


def test_who_does_not_watch_reads_nothing_of_it(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(compiler.compilation, "seconds", 7.0)
    with compiling():
        pass
    assert not capsys.readouterr().err


def test_the_log_tells_that_it_compiles(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(compiled, "_root", lambda: tmp_path)
    monkeypatch.setattr(compiler.compilation, "seconds", 0.0)
    with caplog.at_level("INFO", logger="stickslip"):
        compiled.generated(SQUARE).square(3.0)
    assert caplog.messages == ["compiling for this machine, once; what is compiled is kept"]


def test_what_another_process_removes_meanwhile_is_no_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    listed = [tmp_path / "gone", tmp_path]
    monkeypatch.setattr(Path, "iterdir", lambda self: iter(listed))
    compiled._prune(tmp_path)
    assert tmp_path.exists()
