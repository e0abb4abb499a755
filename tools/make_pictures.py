"""Draw the pictures of the README and of the pages, with the project's own figures.

python tools/make_pictures.py
"""

from __future__ import annotations

import re
import runpy
from pathlib import Path

import matplotlib as mpl

mpl.use("agg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

import stickslip as ss
from stickslip.figures.contact import plot_displacement_loop, plot_velocity_loop
from stickslip.figures.decay import plot_decay, plot_differences

IMAGES = Path(__file__).resolve().parents[1] / "docs" / "images"


EXAMPLES = IMAGES.parent / "examples"
HOWTO = {  # of pages, by the gallery's example that draws it
    "sticks": "plot_03_microslips", "rig": "plot_05_sensors", "simulate": "plot_02_laws",
    "wavelets": "plot_07_wavelets", "sweep": "plot_08_map", "attractors": "plot_09_bifurcation",
}  # fmt: skip
PAGES = ("fit", "joints", "tribometer")  # whose first example's answer is the picture


def pages() -> None:
    """The pictures of pages whose first example, as it is printed, ends in `found`."""
    for page in PAGES:
        names: dict[str, object] = {}
        example = re.findall(r"```python\n(.*?)```", (IMAGES.parent / f"{page}.md").read_text(), re.DOTALL)[0]
        exec(example, names)
        saved(ss.plot(names["found"]).figure, f"{page}.png")


def howto() -> None:
    """The pictures of pages that a gallery's example draws too."""
    for page, example in HOWTO.items():
        names = runpy.run_path(str(EXAMPLES / f"{example}.py"))
        drawn = [getattr(value, "figure", value) for value in names.values()]
        saved([figure for figure in drawn if isinstance(figure, Figure)][-1], f"{page}.png")


def records() -> None:
    """A record as it is read, its mended clipping, and the curve of its friction."""
    record = ss.datasets.demo().rows(2000, 6000)
    saved(ss.plot(record).figure, "reading.png")
    rig = {name: record.truth[name] for name in ("mass", "stiffness", "damping")}
    findings = ss.analyze(record, **rig)
    saved(ss.plot(findings).figure, "forced.png")
    saved(ss.plot(ss.tried(findings, twins=8).trial).figure, "twins.png")
    saved(ss.plot(ss.fit_curve(findings.record, curve="coulomb")).figure, "curves.png")
    x = np.clip(record["x"], -6.5e-4, 6.5e-4)
    clipped = ss.Record.of({"x": x}, fs=record.fs)
    figure, ax = plt.subplots(figsize=(6.2, 2.8), layout="constrained")
    ax.plot(clipped.time[:1200], 1e3 * ss.signals.restore_clipped(clipped, "x")["x"][:1200], label="restored")
    ax.plot(clipped.time[:1200], 1e3 * x[:1200], label="clipped, as recorded")
    ax.set(xlabel="time [s]", ylabel="displacement [mm]")
    ax.legend(loc="upper right")
    saved(figure, "repairs.png")


def loops() -> None:
    """Friction against velocity and displacement of the bundled record."""
    record = ss.datasets.demo()
    rig = {name: record.truth[name] for name in ("mass", "stiffness", "damping")}
    findings = ss.analyze(record, **rig)
    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 3.8), layout="constrained")
    plot_velocity_loop(findings, ax=left)
    plot_displacement_loop(findings, ax=right)
    handles, labels = left.get_legend_handles_labels()
    for axes in (left, right):
        if axes.get_legend() is not None:
            axes.get_legend().remove()
    figure.legend(handles, labels, loc="outside upper center", ncols=3, frameon=False)
    saved(figure, "loops.png")


def squeak() -> None:
    """The squeaking rig: where sliding is stable, and the limit cycle over the load."""

    def rig(load: float, slope: float = -0.26) -> ss.Structure:
        return ss.squeak.squeak_rig("wet", load).having(slope=slope)

    grid = {"slope": np.linspace(-4, 4, 121), "load": np.linspace(0.5, 8, 151)}
    stable = ss.squeak.stability_map(rig, grid=grid, speed=-0.1)
    saved(ss.plot(stable, labels=("slope of friction over speed [s/m]", "load [N]")).figure, "stability.png")
    branches = ss.squeak.limit_cycles(rig(2.0), rig, values=np.linspace(1.3, 6.5, 27), speed=-0.1)
    saved(ss.plot(branches, label="load [N]").figure, "limit_cycles.png")


def decay() -> None:
    """The example of the page on free decay: its envelopes, and its amplitude differences."""
    slider = ss.Oscillator(mass=1.0, stiffness=10.0, damping=0.2, law=ss.laws.Coulomb(0.2))
    x = ss.simulate(slider, duration=20.0, start={"x": 1.0}).record(fs=100)["x"]
    noisy = x + 5e-3 * np.random.default_rng(1).standard_normal(len(x))
    findings = ss.analyze_decay(ss.Record.of({"x": noisy}, fs=100), stiffness=10.0)
    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 3.8), layout="constrained")
    plot_decay(findings.decay, ax=left)
    plot_differences(findings.decay.thesis, ax=right)
    for axes in (left, right):
        axes.legend(ncols=1, loc="lower right" if axes is left else "upper right", fontsize="small")
    saved(figure, "decay.png")


def saved(figure: Figure, name: str) -> None:
    IMAGES.mkdir(exist_ok=True)
    figure.savefig(IMAGES / name, dpi=110, facecolor="white")
    print(f"{IMAGES / name}: {(IMAGES / name).stat().st_size / 1024:.0f} kB")


if __name__ == "__main__":
    loops()
    decay()
    squeak()
    howto()
    pages()
    records()
