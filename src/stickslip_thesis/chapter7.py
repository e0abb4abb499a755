"""Chapter 7: why rubber on wet steel squeals."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

import stickslip as ss
from stickslip.figures.plate import Plate
from stickslip.figures.style import BLUE, GREEN, INK, ORANGE, PURPLE, envelope, styled
from stickslip_thesis.drawing import figure, panels, responses, tag
from stickslip_thesis.printed import Given, Ours
from stickslip_thesis.sketches import transducers

Array = NDArray[np.float64]

TITLE = "Why rubber on wet steel squeals"
STARTS_FROM = ("squeak", "bearing")  # sections of given.toml
CONDITIONS = (("dry", "heavy"), ("wet", "heavy"), ("dry", "light"), ("wet", "light"))
SIGNALS = {
    "a": ("tangential acceleration [m/s²]", PURPLE), "friction": ("friction [N]", ORANGE),
    "sound": ("sound [Pa]", INK), "torsion_velocity": ("torsional velocity [rad/s]", GREEN),
    "normal_acceleration": ("normal acceleration [m/s²]", BLUE),
}  # fmt: skip


def numbers(given: Given) -> Ours:
    """The chapter's numbers."""
    squeaking = record_of(given, "wet", "heavy")
    level = {surface: np.median(np.abs(record_of(given, surface, "heavy")["friction"])) for surface in ("dry", "wet")}
    bearing = given["bearing"]["kinetic"]
    return {
        "squeaks": [float(squeaks(given, *condition)) for condition in CONDITIONS],
        "friction over the bearing's": [level[surface] / bearing for surface in ("dry", "wet")],
        "harmonic": [strongest(squeaking, name) for name in ("a", "friction", "normal_acceleration", "sound")],
        "torsion": strongest(squeaking, "torsion_velocity"),
        "sound level": level_of(squeaking["sound"]),
        "bending": bending(ss.squeak.squeak_rig()),
        "surroundings": level_of(record_of(given, "dry", "light")["sound"]),
    }


def plates(given: Given) -> Iterator[Plate]:
    """The chapter's figures."""
    words = (
        "The virtual squeak rig: friction, loads and frequencies of the chapter, levers and slopes chosen so that its "
        "observations hold together."
    )
    for number, condition in (("7.1", CONDITIONS[0]), ("7.2", CONDITIONS[1])):
        yield figure(number, _responses(given, condition), words)
    yield figure("7.3", _compared(given, CONDITIONS[:2]), words)
    for number, condition in (("7.4", CONDITIONS[2]), ("7.5", CONDITIONS[3])):
        yield figure(number, _responses(given, condition), words)
    yield figure("7.6", _compared(given, CONDITIONS[2:]), words)
    yield figure("7.7", transducers(given), "Drawn from the parameters of the virtual squeak rig.")
    wet = record_of(given, "wet", "heavy")
    yield figure("7.8", _signals(wet, ("a", "friction", "sound", "torsion_velocity")), words)
    yield figure("7.9", _signals(wet, ("normal_acceleration", "friction", "sound", "torsion_velocity")), words)
    yield figure(
        "7.10",
        _spectra(wet, ("normal_acceleration", "torsion_velocity")),
        f"{words} The printed 250 Hz of (b) are of the beam that carries the reflector, which the model does not have.",
    )
    yield figure("7.11", _spectra(wet, ("friction", "a", "sound")), words)


def level_of(sound: Array) -> float:
    """Sound pressure level [dB re 20 µPa]."""
    return float(20 * np.log10(np.std(sound) / 20e-6))


def bending(rig: ss.Structure) -> float:
    """Frequency of the beam's mode across the mass without its contacts [Hz]."""
    return float(np.sqrt(rig.stiffness[1, 1] / rig.mass[1, 1]) / (2 * np.pi))


def record_of(given: Given, surface: str, load: str) -> ss.Record:
    """What the squeak rig's sensors write of two cycles, settled."""
    told = given["squeak"]
    return _record(surface, told[load], told["fs"], told["frequency"])


@functools.lru_cache(8)
def _record(surface: str, load: float, fs: float, frequency: float) -> ss.Record:
    run = ss.simulate(ss.squeak.squeak_rig(surface, load), cycles=5)
    return ss.squeak.squeak_record(run, fs=fs, snr=60, rng=1).between(3 / frequency, 5 / frequency)


def squeaks(given: Given, surface: str, load: str) -> bool:
    """Does friction make a sound of the sliding?"""
    found = ss.find_squeaks(record_of(given, surface, load))
    return any(each.friction == "shown" for each in found.bursts)


def strongest(record: ss.Record, name: str) -> float:
    """The strongest line of a signal above 100 Hz [Hz]."""
    frequency, power = _spectrum(record, name)
    above = frequency > 100
    return float(frequency[above][np.argmax(power[above])])


def _spectrum(record: ss.Record, name: str) -> tuple[Array, Array]:
    values = record[name] - np.mean(record[name])
    power = np.abs(np.fft.rfft(values * np.hanning(len(values)))) ** 2
    return np.fft.rfftfreq(len(values), 1 / record.fs), power


def _responses(given: Given, condition: tuple[str, str]) -> Any:
    record = record_of(given, *condition)
    return responses(record.time, {name: record[name] for name in ("x", "v", "a", "friction")})


@styled
def _compared(given: Given, conditions: tuple[tuple[str, str], ...]) -> Any:
    """Figures 7.3 and 7.6: friction over displacement and velocity, dry above wet."""
    drawn, axes = panels(2, 2, height=4.8)
    for row, condition in zip(axes, conditions, strict=True):
        record = record_of(given, *condition)
        for ax, name, label in zip(row, ("x", "v"), ("displacement [mm]", "velocity [mm/s]"), strict=True):
            ax.plot(1e3 * record[name], record["friction"], color=ORANGE, linewidth=0.5)
            ax.set(xlabel=label, ylabel=f"friction, {condition[0]} [N]")
    for ax, letter in zip(axes.flat, "abcd", strict=True):
        tag(ax, letter)
    return drawn


@styled
def _signals(record: ss.Record, names: tuple[str, ...]) -> Any:
    drawn, axes = panels(len(names), height=6.4)
    for ax, name, letter in zip(axes, names, "abcd", strict=True):
        label, colour = SIGNALS[name]
        ax.plot(*envelope(record.time - record.time[0], record[name]), color=colour, linewidth=0.6)
        ax.set_ylabel(label.replace(" [", "\n["))
        tag(ax, letter)
    axes[-1].set_xlabel("time [s]")
    drawn.align_ylabels(list(axes))
    return drawn


@styled
def _spectra(record: ss.Record, names: tuple[str, ...]) -> Any:
    drawn, axes = panels(len(names), height=1.9 * len(names))
    for ax, name, letter in zip(axes, names, "abc", strict=False):
        frequency, power = _spectrum(record, name)
        shown = (frequency > 20) & (frequency < 1500)
        level = 10 * np.log10(power[shown] / np.max(power[shown]))
        ax.plot(frequency[shown], level, color=SIGNALS[name][1], linewidth=0.8)
        ax.set(ylabel=f"{SIGNALS[name][0].split(' [')[0]}\n[dB]", ylim=(-70, 3))
        tag(ax, letter)
    axes[-1].set_xlabel("frequency [Hz]")
    return drawn
