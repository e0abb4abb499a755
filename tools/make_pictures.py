"""Draw the picture of the README from the bundled record, with the project's own figures.

python tools/make_pictures.py          writes docs/images/loops.png
"""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl

mpl.use("agg")

import matplotlib.pyplot as plt

import stickslip as ss
from stickslip.plot.contact import plot_displacement_loop, plot_velocity_loop

IMAGES = Path(__file__).resolve().parents[1] / "docs" / "images"


def main() -> None:
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
    IMAGES.mkdir(exist_ok=True)
    figure.savefig(IMAGES / "loops.png", dpi=110)
    print(f"{IMAGES / 'loops.png'}: {(IMAGES / 'loops.png').stat().st_size / 1024:.0f} kB; {findings.level}")


if __name__ == "__main__":
    main()
