"""The package where a system has no POSIX modules, opens no folder and prints in a code page, as Windows does."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

# Found by every Python whose path holds its folder, the lab's workers too.
FOREIGN = """
import os, shutil, signal, sys, warnings

for name in ("fcntl", "grp", "pty", "pwd", "resource", "syslog", "termios", "tty"):
    sys.modules[name] = None
for name in ("O_DIRECTORY", "fork", "forkpty", "getuid", "geteuid", "killpg", "setsid", "sched_getaffinity", "sysconf"):
    if hasattr(os, name):
        delattr(os, name)
del signal.SIGHUP
shutil._use_fd_functions = False  # as where folders can not be opened
opened = os.open


def open_file(path, flags, mode=0o777, *, dir_fd=None):
    if isinstance(path, (str, bytes, os.PathLike)) and os.path.isdir(path):
        raise PermissionError(13, "Permission denied", os.fspath(path))
    return opened(path, flags, mode, dir_fd=dir_fd)


os.open = open_file
warnings.filterwarnings("error", category=EncodingWarning, module=r"stickslip($|[.])")
"""

EVERY_MODULE = """
import importlib, pkgutil, sys, stickslip
for module in pkgutil.walk_packages(stickslip.__path__, "stickslip."):
    if module.name not in ("stickslip.__main__",) and "_gpu" not in module.name and not module.name.endswith("cuda"):
        importlib.import_module(module.name)
assert sys.modules["fcntl"] is None and sys.modules["resource"] is None
"""

SLIDER = """
system = { mass = 2.42, stiffness = "2.31 N/mm", damping = 0.12 }
law = { name = "Coulomb", kinetic = 1.1 }
drive = { name = "HarmonicBase", amplitude = "0.65 mm", frequency = 2.5 }
"""
GRID = """
system = "slider.toml"
measures = ["stops", "amplitude"]
cycles = 4
settle = 40
[grid]
frequency = { from = "2 Hz", to = 9, points = 8 }
"""


@pytest.fixture
def abroad(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder to work in; every Python started from here finds itself on such a system."""
    ground, place = tmp_path / "ground", tmp_path / "work"
    ground.mkdir()
    place.mkdir()
    (ground / "sitecustomize.py").write_text(FOREIGN, encoding="utf-8")
    for name, value in {
        "PYTHONPATH": str(ground),
        "PYTHONUTF8": "0",
        "PYTHONIOENCODING": "cp1252",
        "PYTHONWARNDEFAULTENCODING": "1",
    }.items():
        monkeypatch.setenv(name, value)
    (place / "slider.toml").write_text(SLIDER, encoding="utf-8")
    (place / "grid.toml").write_text(GRID, encoding="utf-8")
    return place


def python(*words: str, folder: Path) -> str:
    done = subprocess.run([sys.executable, *words], cwd=folder, capture_output=True)
    assert done.returncode == 0, (done.stdout + done.stderr).decode("cp1252", "replace")
    return done.stdout.decode("cp1252")


def test_every_module_is_imported(abroad: Path) -> None:
    python("-c", EVERY_MODULE, folder=abroad)


@pytest.mark.parametrize(
    ("words", "made"),
    [
        ("demo --output demo", "demo/report.html"),
        ("simulate slider.toml --cycles 12 --output run", "run/results.json"),
        ("sweep grid.toml --store map.zarr --output map", "map/report.html"),
    ],
)
def test_the_program_does_its_jobs(abroad: Path, words: str, made: str) -> None:
    python("-m", "stickslip", *words.split(), folder=abroad)
    assert (abroad / made).stat().st_size > 0


def test_a_record_is_analysed_to_the_same_numbers(abroad: Path) -> None:
    write = "import stickslip as ss; ss.write_record(ss.datasets.demo().between(0, 4), 'run.csv')"
    python("-c", write, folder=abroad)
    words = ["analyze", "run.csv", "--mass", "2.42", "--stiffness", "2310", "--json"]
    data = json.loads(python("-m", "stickslip", *words, folder=abroad))
    (friction,) = [estimate for estimate in data["estimates"] if estimate["name"] == "sliding friction"]
    assert friction["value"] == pytest.approx(1.1, abs=0.03)  # the truth of the bundled record


def test_the_lab_opens_and_answers(abroad: Path) -> None:
    pytest.importorskip("starlette", reason="the extra [lab] is not installed")
    import httpx2 as httpx

    from labs import running_lab

    with running_lab() as lab, httpx.Client(base_url=lab.base, headers=lab.headers, timeout=600) as client:
        assert client.get("/").status_code == 200
        key = client.post("/files/example").json()["id"]
        job = client.post("/jobs", json={"question": "describe", "records": [[key]]}).json()["id"]
        while (told := client.get(f"/jobs/{job}").json())["state"] in ("waiting", "running"):
            time.sleep(0.1)
        assert told["state"] == "done", told
    assert "PYTHONPATH" in os.environ
