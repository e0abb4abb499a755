"""The wheel alone, outside the checkout: nothing that it needs may hide in the source tree.

Builds the wheel, installs it with its required packages into a new environment, and runs the main job there.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
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
    with tempfile.TemporaryDirectory(prefix="stickslip-smoke-") as name:
        folder = Path(name)
        run(sys.executable, "-m", "build", "--wheel", "--outdir", folder, ROOT, folder=folder)
        (wheel,) = folder.glob("stickslip-*.whl")
        venv.create(folder / "env", with_pip=True)
        binaries = folder / "env" / ("Scripts" if os.name == "nt" else "bin")
        run(binaries / "python", "-m", "pip", "install", "--quiet", "--disable-pip-version-check", wheel, folder=folder)
        place = run(binaries / "python", "-c", STEPS[0], folder=folder).strip()
        if not Path(place).resolve().is_relative_to((folder / "env").resolve()):
            sys.exit(f"smoke: stickslip was imported from {place}, not from the wheel")
        print(run(binaries / "python", "-c", STEPS[1], folder=folder).strip())
        if "analyze" not in run(binaries / "stickslip", "--help", folder=folder):
            sys.exit("smoke: stickslip --help does not offer analyze")
        print(run(binaries / "stickslip", "demo", "--output", "out", folder=folder).strip())
        check(folder / "out")
        print(f"smoke: {wheel.name} works outside the checkout")


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
