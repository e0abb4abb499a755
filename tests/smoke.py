"""The wheel alone, outside the checkout: nothing that it needs may hide in the source tree, no stated bound may lie.

Builds the wheel and installs it into new environments: with its required packages alone, where the main job is run, and
with its extras twice, at the newest releases and at the lowest that pyproject.toml allows, where smoke_jobs.py is run.
"""

from __future__ import annotations

import importlib.util
import json
import os
import subprocess
import sys
import tempfile
import venv
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
JOBS = ROOT / "tests" / "smoke_jobs.py"
OLDEST = "3.11"  # the Python of the lowest releases: for a later one not all of them were built
STEPS = (
    "import stickslip, pathlib; print(pathlib.Path(stickslip.__file__).parent)",
    "from stickslip import datasets; print(len(datasets.names()), 'public sets,', datasets.demo())",
)


def run(*command: str | Path, folder: Path) -> str:
    """The command's output; what it said and a non-zero exit when it fails."""
    clean = {key: value for key, value in os.environ.items() if key not in ("PYTHONPATH", "STICKSLIP_DATA")}
    done = subprocess.run([str(part) for part in command], cwd=folder, env=clean, capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"smoke: {' '.join(map(str, command))} ended with {done.returncode}\n{done.stdout}{done.stderr}")
    return done.stdout


def main() -> None:
    if importlib.util.find_spec("uv") is None:
        sys.exit("smoke: uv, which finds the lowest releases, is not installed: pip install '.[dev]' brings it")
    with tempfile.TemporaryDirectory(prefix="stickslip-smoke-") as name:
        folder = Path(name)
        run(sys.executable, "-m", "build", "--wheel", "--outdir", folder, ROOT, folder=folder)
        (wheel,) = folder.glob("stickslip-*.whl")
        required_alone(wheel, folder)
        with_extras(wheel, folder)
        print(f"smoke: {wheel.name} works outside the checkout, at the newest and at the lowest releases")


def binaries(env: Path) -> Path:
    return env / ("Scripts" if os.name == "nt" else "bin")


def required_alone(wheel: Path, folder: Path) -> None:
    """The main job, with the required packages alone."""
    env = binaries(folder / "env")
    venv.create(env.parent, with_pip=True)
    run(env / "python", "-m", "pip", "install", "--quiet", "--disable-pip-version-check", wheel, folder=folder)
    place = run(env / "python", "-c", STEPS[0], folder=folder).strip()
    if not Path(place).resolve().is_relative_to(env.parent.resolve()):
        sys.exit(f"smoke: stickslip was imported from {place}, not from the wheel")
    print(run(env / "python", "-c", STEPS[1], folder=folder).strip())
    if "analyze" not in run(env / "stickslip", "--help", folder=folder):
        sys.exit("smoke: stickslip --help does not offer analyze")
    print(run(env / "stickslip", "demo", "--output", "out", folder=folder).strip())
    check(folder / "out")


def with_extras(wheel: Path, folder: Path) -> None:
    """Every job at the newest and at the lowest releases, side by side: most of their time is compiling."""
    same = sys.version_info[:2] == tuple(map(int, OLDEST.split(".")))
    with ThreadPoolExecutor() as pool:
        ends = [pool.submit(jobs, wheel, folder / "highest", sys.executable),
                pool.submit(jobs, wheel, folder / "lowest-direct", sys.executable if same else OLDEST)]  # fmt: skip
        for end in ends:
            print(end.result())


def jobs(wheel: Path, env: Path, python: str) -> str:
    """What smoke_jobs.py says in an environment with releases chosen as the folder is called."""
    uv = (sys.executable, "-m", "uv")
    out = env.with_suffix(".out")
    out.mkdir()
    run(*uv, "venv", "--quiet", "--python", python, env, folder=out)
    run(
        *uv,
        "pip",
        "install",
        "--quiet",
        "--python",
        binaries(env) / "python",
        "--resolution",
        env.name,
        f"{wheel}[io,lab,maps,sound]",
        folder=out,
    )
    return f"{env.name} releases:\n" + run(binaries(env) / "python", JOBS, out, folder=out)


def check(out: Path) -> None:
    """The report is one page that needs nothing beside it; the results are numbers."""
    page = (out / "report.html").read_text("utf-8")
    if "<svg" not in page and "data:image" not in page:
        sys.exit("smoke: the report holds no figure")
    json.loads((out / "results.json").read_text("utf-8"))
    if not list(out.rglob("*.svg")) or not list(out.rglob("*.png")):
        sys.exit(f"smoke: no SVG or PNG figure in {sorted(path.name for path in out.rglob('*'))}")


if __name__ == "__main__":
    main()
