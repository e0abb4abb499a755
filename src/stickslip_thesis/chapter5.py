"""Chapter 5: stick-slip in time and frequency, by wavelets."""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

import stickslip as ss
from stickslip.figures.maps import plot_wavelet
from stickslip.figures.style import BLUE, FAINT, ORANGE, PURPLE, Plate, styled
from stickslip_thesis import chapter4
from stickslip_thesis.drawing import figure, panels, tag
from stickslip_thesis.printed import Given, Ours

Array = NDArray[np.float64]

TITLE = "Stick-slip in time and frequency, by wavelets"
STARTS_FROM = ("wavelet", "stick_slip")  # sections of given.toml
CYCLES = 4


def numbers(given: Given) -> Ours:
    """The chapter's numbers."""
    section, case1 = given["wavelet"], accelerations(given, "case1")
    near = (0.5 * section["transition"], 2 * section["transition"])
    peaks = ss.signals.local_maxima(ss.wavelet_map(case1, "a", frequencies=near, wavelet_frequency=section["centre"]))
    slow = ss.wavelet_map(case1, "a", frequencies=(1.6, 8.0), wavelet_frequency=section["centre"])
    strongest = np.unravel_index(int(np.argmax(np.abs(slow.values))), slow.shape)[0]
    return {
        "local maximum": float(np.median([peak.frequency for peak in peaks])),
        "global maximum": float(slow.frequency[strongest]),
        "spikes within a stick": [
            round(ss.contact.find_microslips(accelerations(given, name)).per_stick.value) for name in ("case1", "case2")
        ],
    }


def plates(given: Given) -> Iterator[Plate]:
    """The chapter's figures."""
    section = given["wavelet"]
    yield figure(
        "5.1",
        _wavelet(section["shown_centre"]),
        "As equation 5.3 prints it, the phase of h runs backwards and H has its peak at -ω_c; drawn is the wavelet "
        "to which equation 5.4 belongs.",
    )
    yield figure("5.2", _windows(), "Each box is as long and as wide as its window's deviations in time and frequency.")
    for number, record, low in zip(("5.3", "5.4"), signals(), (8.0, 4.0), strict=True):
        yield figure(number, _contours(given, record, (low, 256.0)), "The signal's rate and amplitude are ours.")
    words = "Contours over 80 dB, 18 of them, as in the thesis. "
    for number, kind, remark in (
        ("5.5", "coulomb", "Every jump is a spike over all frequencies."),
        ("5.6", "state variable", "No jumps: the spikes are blunt."),
        ("5.7", "case1", "The local maxima are the transition oscillation."),
        ("5.8", "measured", "The virtual rig of chapter 2 on the contact of case 2."),
        ("5.9", "case2", "The local maxima are the transition oscillation."),
    ):
        yield figure(number, _contours(given, accelerations(given, kind), (1.6, 200.0)), words + remark)
    for number, kind in (("5.10", "case1"), ("5.11", "case2")):
        record = accelerations(given, kind).between(0.35, 0.75)
        slips = ss.contact.find_microslips(accelerations(given, kind))
        yield figure(
            number,
            _contours(given, record, (20.0, 1000.0), span=120.0),
            f"Up to 1 kHz over a span of 120 dB: in each stick {slips.per_stick.value:.0f} micro-slips show as spikes"
            f"{', where the thesis has none' if kind == 'case1' and slips.per_stick.value else ''}.",
        )


def signals() -> tuple[ss.Record, ss.Record]:
    """An impulse, and a tone of 12 Hz with one: both after one of two seconds."""
    time = np.arange(2048) / 1024
    impulse = np.where(np.arange(2048) == 1024, 1.0, 0.0)
    tone = np.sin(2 * math.pi * 12 * time) + 10 * impulse
    return ss.Record.of({"a": impulse}, fs=1024), ss.Record.of({"a": tone}, fs=1024)


def accelerations(given: Given, kind: str) -> ss.Record:
    """A stick-slip acceleration of chapter 4, some cycles of the steady motion sampled at 4 kHz."""
    section = given["stick_slip"]
    if kind == "measured":
        record = chapter4.measured(given)
        return ss.Record.of({"a": record["a"][: round(CYCLES / section["frequency"] * record.fs)]}, fs=record.fs)
    if kind == "coulomb":
        drive = ss.drives.HarmonicBase(section["base"], frequency=section["frequency"])
        orbit = _coulomb(section["mass"], section["spring"], section["kinetic"], drive)
    elif kind == "state variable":
        orbit = chapter4.state_variable(given, 0)
    else:
        orbit = chapter4.stick_slip(given, section[kind])
    fs = given["wavelet"]["fs"]
    times = np.arange(round(orbit.period * fs)) / fs
    values = orbit.orbit.sample(times, ("a",))[0][0]
    return ss.Record.of({"a": np.tile(values, CYCLES)}, fs=fs)


@functools.lru_cache(4)
def _coulomb(mass: float, spring: float, kinetic: float, drive: Any) -> ss.solve.SteadyState:
    return ss.steady_state(ss.Oscillator(mass=mass, stiffness=spring, law=ss.laws.Coulomb(kinetic), drive=drive))


def _contours(given: Given, record: ss.Record, band: tuple[float, float], *, span: float = 80.0) -> Any:
    wavelets = ss.wavelet_map(record, "a", frequencies=band, wavelet_frequency=given["wavelet"]["centre"])
    return plot_wavelet(wavelets, record=record, span=span, levels=18, style="lines")


@styled
def _wavelet(centre: float) -> Any:
    """Figure 5.1."""
    time, angular = np.linspace(-4, 4, 801), np.linspace(-2, 10, 601)
    bell = math.pi**-0.25 * np.exp(-(time**2) / 2)
    drawn, axes = panels(3, height=4.8)
    axes[0].plot(time, bell * np.cos(centre * time), color=BLUE)
    axes[1].plot(time, bell * np.sin(centre * time), color=ORANGE)
    axes[2].plot(angular, math.pi**-0.25 * np.exp(-((angular - centre) ** 2) / 2), color=PURPLE)
    for ax, letter, label, across in zip(axes, "abc", ("Re h", "Im h", "H"), ("t", "t", "ω"), strict=True):
        ax.set(ylabel=label, xlabel=across)
        tag(ax, letter)
    return drawn


@styled
def _windows() -> Any:
    """Figure 5.2: the plane of time and frequency, cut by a Fourier transform, an STFT and dyadic wavelets."""
    drawn, axes = panels(1, 3, height=2.8)
    fourier = [(0.0, k / 8, 1.0, 1 / 8) for k in range(8)]
    short = [(j / 4, k / 4, 1 / 4, 1 / 4) for j in range(4) for k in range(4)]
    wavelets = [(j / 2**m, 2**m / 16, 1 / 2**m, 2**m / 16) for m in range(4) for j in range(2**m)]
    edges = (fourier, short, wavelets)
    for ax, letter, boxes in zip(axes, "abc", edges, strict=True):
        for left, low, width, height in boxes:
            ax.plot(
                [left, left + width, left + width, left, left],
                [low, low, low + height, low + height, low],
                color=BLUE,
                linewidth=0.9,
            )
        ax.set(xlabel="time", xticks=[], yticks=[])
        tag(ax, letter)
    axes[0].set_ylabel("frequency")
    axes[2].axhspan(0, 1 / 16, color=FAINT, alpha=0.3)
    return drawn
