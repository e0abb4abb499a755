"""Appendices A and B: the moving average, and the discharge of the load cell."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from scipy.optimize import brentq

from stickslip.figures.style import BLUE, ORANGE, Plate, styled
from stickslip.signals.derivatives import five_point_response
from stickslip_thesis.drawing import figure, panels, tag
from stickslip_thesis.printed import Given, Ours

TITLE = "Appendices: the moving average, and the discharge of the load cell"
STARTS_FROM = ("rig", "discharge")  # sections of given.toml


def numbers(given: Given) -> Ours:
    """The appendices' numbers."""
    fs, section = given["rig"]["fs"], given["discharge"]
    zero = brentq(lambda frequency: float(five_point_response(frequency, fs)), 0.15 * fs, 0.25 * fs)
    lost = 1 - math.exp(-section["hold"] / section["constant"])
    return {
        "folding frequency": fs / 2e3,
        "phase kept up to": float(zero),
        "left after the constant": 100 * math.exp(-1),
        "lost in a tenth": 100 * (1 - math.exp(-0.1)),
        "tenth of the constant": 0.1 * section["constant"],
        "share of the constant": 100 * section["hold"] / section["constant"],
        "lost while held": 100 * lost,
        "drift": lost * section["friction"],
    }


def plates(given: Given) -> Iterator[Plate]:
    """The appendices' figures."""
    fs = given["rig"]["fs"]
    gains = five_point_response([250, 500, 750], fs)
    yield figure(
        "A.1",
        _response(fs),
        f"Zero phase is not all that matters: the gain is {gains[0]:.3f} at 250 Hz, {gains[1]:.3f} at "
        f"500 Hz and {gains[2]:.3f} at 750 Hz, and zero at a fifth of the sampling rate.",
    )
    yield figure(
        "B.1", _discharge(given["discharge"]["constant"]), "A step held for two minutes, as the load cell reads it."
    )


@styled
def _response(fs: float) -> Any:
    frequency = np.linspace(0, fs / 2, 2001)
    gain = five_point_response(frequency, fs)
    drawn, axes = panels(2, height=4.2)
    axes[0].plot(frequency, np.abs(gain), color=BLUE)
    axes[0].set(ylabel="magnitude")
    axes[1].plot(frequency, np.where(gain < 0, 180, 0), color=ORANGE)
    axes[1].set(xlabel="frequency [Hz]", ylabel="phase [°]")
    for ax, letter in zip(axes, "ab", strict=True):
        tag(ax, letter)
    return drawn


@styled
def _discharge(constant: float) -> Any:
    time = np.linspace(-10, 2.4 * constant, 600)
    drawn, ax = panels(1, height=3.0)
    ax.plot(time, np.where(time < 0, 0, np.exp(-np.maximum(time, 0) / constant)), color=BLUE)
    ax.axhline(math.exp(-1), color=ORANGE, linestyle="--", linewidth=0.9)
    ax.axvline(constant, color=ORANGE, linestyle="--", linewidth=0.9)
    ax.set(xlabel="time [s]", ylabel="reading, relative")
    return drawn
