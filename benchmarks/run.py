"""Figures against peers, in one run: ``make bench`` prints one table a question.

Candidates are run in turn, round by round, so that what else the machine does falls on all of them; the median counts,
and the ratio is against the first. Beside every time stands how right the answer was.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy.interpolate import make_smoothing_spline
from scipy.signal import savgol_filter

import stickslip as ss

ROOT = Path(__file__).resolve().parents[1]
SAMPLES = 1_000_000

ANALYZE = """
import json, re, resource, sys, tempfile, time
import stickslip as ss
began = time.perf_counter()
record = ss.read_record(sys.argv[1])
read = time.perf_counter()
findings = ss.analyze(record, mass=2.42, stiffness=2310, damping=0.1196)
asked = time.perf_counter()
with tempfile.TemporaryDirectory() as folder:
    ss.publish(findings, folder=folder + "/results")
done = time.perf_counter()
used = resource.getrusage(resource.RUSAGE_SELF)
peak = int(re.search(r"VmHWM:\\s+(\\d+)", open("/proc/self/status").read())[1])  # kB; ru_maxrss knows the parent's too
print(json.dumps({
    "read": read - began, "analyze": asked - read, "publish": done - asked, "processor": used.ru_utime + used.ru_stime,
    "peak": peak / 1024, "level": findings.level.value, "share": findings.sticks.share.value, "samples": len(record),
}))
"""

# What others take to read the same file, smooth, differentiate and transform its channels, and draw six figures of
# them: the measure of a machine, as fast or slow this minute as it is for the main job.
YARDSTICK = """
import io, resource, sys
import matplotlib
matplotlib.use("agg")
import matplotlib.pyplot as plt
import pandas as pd
from scipy import optimize, signal
frame = pd.read_parquet(sys.argv[1])
channels = [frame[name].to_numpy() for name in list(frame)[1:]]
for values in channels:
    velocity, acceleration = (signal.savgol_filter(values, 31, 3, deriv=order) for order in (1, 2))
    signal.filtfilt(*signal.butter(4, 0.1), acceleration)
    signal.csd(values, velocity, nperseg=4096)
for number in range(6):
    figure, axes = plt.subplots(4, sharex=True)
    for line, values in zip(axes, channels):
        line.plot(values[number * 5000 : (number + 1) * 5000])
    for form in ("svg", "png"):
        figure.savefig(io.BytesIO(), format=form, dpi=150)
    plt.close(figure)
used = resource.getrusage(resource.RUSAGE_SELF)
print(used.ru_utime + used.ru_stime)
"""


def interleaved(candidates: Mapping[str, Callable[[], Any]], *, rounds: int = 5) -> dict[str, tuple[float, Any]]:
    """Median seconds of each candidate over the rounds, and what it returned last."""
    seconds: dict[str, list[float]] = {name: [] for name in candidates}
    results: dict[str, Any] = {}
    for _ in range(rounds):
        for name, run in candidates.items():
            began = time.perf_counter()
            results[name] = run()
            seconds[name].append(time.perf_counter() - began)
    return {name: (statistics.median(seconds[name]), results[name]) for name in candidates}


def table(title: str, heads: list[str], rows: list[list[str]]) -> None:
    """Print one table."""
    widths = [max(len(row[column]) for row in [heads, *rows]) for column in range(len(heads))]
    print(f"\n{title}")
    for row in [heads, ["-" * width for width in widths], *rows]:
        print("  " + "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip())


def long_record() -> ss.Record:
    """A million samples of four channels: the bundled record, cycle after cycle, with fresh noise."""
    demo = ss.datasets.demo()
    rows = int(demo.fs / demo.truth["forcing frequency"]) * 30
    times = SAMPLES // rows + 1
    rng = np.random.default_rng(7)
    noise = {"x": 1e-6, "z": 1e-6, "a": 0.04, "load": 2e-3}
    channels = {
        name: np.tile(demo[name][:rows], times)[:SAMPLES] + rng.normal(0, sd, SAMPLES) for name, sd in noise.items()
    }
    return ss.Record.of(channels, fs=demo.fs)


def analyzed(file: Path) -> dict[str, float]:
    """Seconds, processor seconds (start included), megabytes and answers of the main job, in a process of its own."""
    return dict(json.loads(_alone(ANALYZE, file)))


def yardstick(file: Path) -> float:
    """Processor seconds that pandas, scipy and matplotlib take for a like job, in a process of its own."""
    return float(_alone(YARDSTICK, file))


def _alone(code: str, file: Path) -> str:
    """What a program prints on one thread: a second one of the linear algebra's waits in a loop, counted as work."""
    one = os.environ | {"OPENBLAS_NUM_THREADS": "1"}
    run = subprocess.run([sys.executable, "-c", code, str(file)], capture_output=True, text=True, check=True, env=one)
    return run.stdout


def bench_analyze(file: Path, rounds: int) -> None:
    """The main job on a million samples and four channels."""
    runs = [analyzed(file) | {"yardstick": yardstick(file)} for _ in range(rounds)]
    found = {key: statistics.median(run[key] for run in runs) for key in runs[0]}
    ratio = statistics.median(run["processor"] / run["yardstick"] for run in runs)
    truth = ss.datasets.demo().truth
    table(
        f"analyze, {found['samples']:,.0f} samples of four channels (allowed: 10 s, 1 GB)",
        [
            "read Parquet",
            "analyze",
            "publish",
            "processor in all",
            "over a like job of pandas, scipy, matplotlib",
            "peak memory",
            "friction level (true)",
            "stuck share (true)",
        ],
        [
            [
                *(f"{found[key]:.2f} s" for key in ("read", "analyze", "publish", "processor")),
                f"{ratio:.2f}",
                f"{found['peak']:.0f} MB",
                f"{found['level']:.4f} ({truth['sliding friction']}) N",
                f"{found['share']:.3f} ({truth['stuck share of the time']:.3f})",
            ]
        ],
    )


def bench_reading(files: Mapping[str, Path], rounds: int) -> None:
    """read_record, which checks, hashes and turns to SI, against pandas, which does not."""
    rows = []
    for kind, file in files.items():
        plain = {"CSV": pd.read_csv, "Parquet": pd.read_parquet}[kind]
        skip = {"skiprows": _comment_lines(file)} if kind == "CSV" else {}
        peers = {
            "pandas": lambda plain=plain, file=file, skip=skip: plain(file, **skip),
            "stickslip": lambda file=file: ss.read_record(file),
        }
        decay = interleaved(peers, rounds=rounds)
        frame, record = decay["pandas"][1], decay["stickslip"][1]
        column = next(name for name in frame.columns if name.split()[0] == "x")
        apart = float(np.max(np.abs(frame[column].to_numpy() - record["x"])))
        for name, (seconds, _) in decay.items():
            ratio = seconds / decay["pandas"][0]
            rows.append([kind, name, f"{seconds:.2f} s", f"{ratio:.2f}", f"{len(record):,}", f"{apart:.1g}"])
    table("reading, five columns", ["format", "reader", "median", "ratio", "rows", "largest difference in x [m]"], rows)


def _comment_lines(file: Path) -> int:
    with file.open(encoding="utf-8") as lines:
        return next(number for number, line in enumerate(lines) if not line.startswith("#"))


def bench_smoothing(rounds: int) -> None:
    """Velocity and acceleration of a noisy stick-slip displacement, against the true ones."""
    time_, x, v, a, noisy = stick_slip_truth()
    fs = 1 / (time_[1] - time_[0])
    window = {order: best_window(noisy, fs, true, order) for order, true in ((1, v), (2, a))}
    peers: dict[str, Callable[[], tuple[Any, Any]]] = {
        "stickslip smoother": lambda: tuple(ss.signals.differentiate(noisy, fs=fs, order=n).values for n in (1, 2)),
        "stickslip five-point": lambda: tuple(
            ss.signals.differentiate(noisy, fs=fs, order=n, method="five-point").values for n in (1, 2)
        ),
        "savgol_filter, window chosen by the truth": lambda: tuple(
            savgol_filter(noisy, window[n], 3, deriv=n, delta=1 / fs) for n in (1, 2)
        ),
        "make_smoothing_spline (GCV)": lambda: spline(time_, noisy),
    }
    decay = interleaved(peers, rounds=rounds)
    first = next(iter(decay.values()))[0]
    rows = [
        [
            name,
            f"{1e3 * seconds:.1f} ms",
            f"{seconds / first:.2f}",
            f"{relative(got[0], v):.2%}",
            f"{relative(got[1], a):.1%}",
        ]
        for name, (seconds, got) in decay.items()
    ]
    heads = ["method", "median, both orders", "ratio", "rms error of v", "rms error of a"]
    table(f"differentiation, {len(x):,} samples of stick-slip, noise and counts of an LVDT", heads, rows)


def spline(times: Any, noisy: Any) -> tuple[Any, Any]:
    """Both derivatives of scipy's smoothing spline, its penalty by generalised cross-validation."""
    fitted = make_smoothing_spline(times, noisy)
    return fitted.derivative(1)(times), fitted.derivative(2)(times)


def stick_slip_truth() -> tuple[Any, ...]:
    """Time, true x, v, a, and x as an LVDT writes it: 1 um of noise, counts of 2.5 um."""
    maker = _tool("make_demo_record")
    rig = maker.Rig()
    times = 4.0 + np.arange(6_000) / 2000
    pieces = maker.simulate(rig, times, 4.0)
    t, x, v = (np.concatenate(part) for part in zip(*[(p.times, *p.states) for p in pieces], strict=True))
    friction = np.concatenate([maker.friction(rig, piece) for piece in pieces])
    a = (rig.stiffness * (rig.base(t) - x) - rig.damping * v - friction) / rig.mass
    counts = np.rint((x + np.random.default_rng(3).normal(0, 1e-6, len(x))) / 2.5e-6)
    return t, x, v, a, 2.5e-6 * counts


def best_window(noisy: Any, fs: float, true: Any, order: int) -> int:
    """The Savitzky-Golay window, cubic, that comes nearest to the truth: no user could do better with it."""
    windows = range(5, 121, 4)
    return min(windows, key=lambda w: relative(savgol_filter(noisy, w, 3, deriv=order, delta=1 / fs), true))


def relative(found: Any, true: Any) -> float:
    """Root mean square error over the root mean square of the truth."""
    return float(np.sqrt(np.mean((found - true) ** 2) / np.mean(true**2)))


def bench_start(rounds: int) -> None:
    """How long a start takes, against the interpreter alone."""
    commands = {
        "python -c pass": ["-c", "pass"],
        "import stickslip": ["-c", "import stickslip"],
        "stickslip --help": ["-m", "stickslip", "--help"],
    }
    peers = {
        name: lambda command=command: subprocess.run([sys.executable, *command], capture_output=True, check=True)
        for name, command in commands.items()
    }
    decay = interleaved(peers, rounds=rounds)
    table("start", ["command", "median"], [[name, f"{1e3 * seconds:.0f} ms"] for name, (seconds, _) in decay.items()])


def _tool(name: str) -> Any:
    spec = importlib.util.spec_from_file_location(name, ROOT / "tools" / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=5, help="rounds of each comparison (default 5)")
    rounds = parser.parse_args().rounds
    with tempfile.TemporaryDirectory() as folder:
        record = long_record()
        files = {kind: Path(folder, f"long.{suffix}") for kind, suffix in (("CSV", "csv"), ("Parquet", "parquet"))}
        for file in files.values():
            ss.write_record(record, file)
        del record
        bench_start(max(rounds, 5))
        bench_smoothing(rounds)
        bench_reading(files, rounds)
        bench_analyze(files["Parquet"], min(rounds, 3))


if __name__ == "__main__":
    main()
