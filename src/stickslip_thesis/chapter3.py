"""Chapter 3: a contact that gives before it slides: sliding without stops."""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

import stickslip as ss
from stickslip.contact.contact import branch_slopes
from stickslip.figures.style import BLUE, FAINT, GREEN, ORANGE, PURPLE, Plate, styled
from stickslip_thesis.drawing import (
    RESPONSES,
    around,
    characteristics,
    exact,
    figure,
    massless_contact,
    panels,
    responses,
    tag,
)
from stickslip_thesis.printed import Given, Ours

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from stickslip.signals import Harmonics

Array = NDArray[np.float64]

TITLE = "A contact that gives before it slides: sliding without stops"
STARTS_FROM = ("sliding", "schematic")  # sections of given.toml
CASES = (0, 1, 2)  # 5.61, 8.7 and 11.1 Hz


def numbers(given: Given) -> Ours:
    """The chapter's numbers."""
    section = given["sliding"]
    orbits = [sliding(given, case) for case in CASES]
    slopes = [slopes_of_sticks(measured(given, case)) for case in CASES]
    speeds = [ss.contact.transition_speed(measured(given, case)).turns for case in CASES]
    return {
        "stiffness": [float(np.mean(slope)) / 1e4 for slope in slopes],
        "stiffness scatter": [float(np.std(slope, ddof=1)) / 1e4 for slope in slopes],
        "mean stiffness": float(np.mean(section["stiffness"])),
        "amplitude": [1e3 * orbit.amplitude for orbit in orbits],
        "speed by equation": [equation_3_4(section, case) for case in CASES],
        "speed read off": [float(np.mean(speed)) for speed in speeds],
        "speed scatter": [float(np.std(speed, ddof=1)) for speed in speeds],
        "base": [1e3 * base_for(given, case) for case in CASES],
        "harmonics": harmonics(given).ratio(2),
    }  # fmt: skip


def plates(given: Given) -> Iterator[Plate]:
    """The chapter's figures."""
    yield figure("3.1", massless_contact(given), "Drawn from the parameters of the case of 8.7 Hz.")
    yield from _schematics(given)
    sensors = "The virtual rig of chapter 2 on a slightly rough contact, driven so that it moves as in Table 3.2. "
    for number, case in (("3.8", 0), ("3.10", 1), ("3.11", 2)):
        yield figure(number, _measured_responses(given, case), sensors.strip())
        if case == 0:
            yield figure(
                "3.9",
                _spectra(given),
                f"{sensors}The fundamental is {harmonics(given).ratio(2):.0f} times the second harmonic, which the "
                f"roughness makes alone, and {harmonics(given).ratio(3):.0f} times the third.",
            )
    for number, case in (("3.12", 0), ("3.13", 1), ("3.14", 2)):
        record = measured(given, case)
        motion = {name: record[name] for name in ("x", "v", "friction")}
        mark = equation_3_4(given["sliding"], case)
        yield figure(
            number,
            characteristics(motion, way=4e-5, speed=1.5e-2, mark=mark),
            f"{sensors}Dashed: the transition speed by equation 3.4.",
        )
    yield figure(
        "3.15",
        _averaged(given),
        f"{sensors}Averaged over the cycles, as the text says of this figure; its printed "
        "caption is that of Figure 3.14. Dashed: equation 3.4.",
    )
    for number, case in (("3.16", 0), ("3.17", 1), ("3.18", 2)):
        orbit = sliding(given, case)
        yield figure(number, responses(*around(orbit, cycles=4)), _of_orbit(orbit))
    for number, case in (("3.19", 0), ("3.20", 1), ("3.21", 2)):
        orbit = sliding(given, case)
        yield figure(
            number,
            characteristics(around(orbit)[1], way=3e-5, speed=1e-2, mark=orbit.transition_speed),
            f"Dashed: sliding begins at {1e3 * orbit.transition_speed:.2f} mm/s. With damping in the contact the "
            "friction leaves the line of sliding with the slope c, not horizontally.",
        )


def contact(given: Given, case: int) -> ss.laws.CompliantContact:
    """The contact of one of the three cases, with the damping ratio that the thesis states, of m and k + K_y."""
    section = given["sliding"]
    stiffness = section["stiffness"][case]
    whole = math.sqrt(section["mass"] * (section["spring"] + stiffness))
    return ss.laws.CompliantContact(
        section["kinetic"][case], stiffness=stiffness, damping=2 * section["damping_ratio"] * whole
    )


def sliding(given: Given, case: int, *, base: float | None = None) -> ss.solve.SteadyState:
    """The steady motion at a base amplitude [m], that of Table 3.3 if none is told."""
    section = given["sliding"]
    base = section["base"][case] if base is None else base
    return steady(section["mass"], section["spring"], contact(given, case), base, section["frequency"][case])


@functools.lru_cache(2048)
def steady(mass: float, spring: float, law: Any, base: float, frequency: float) -> ss.solve.SteadyState:
    """The steady motion of a mass on its spring, the base moving as a cosine."""
    drive = ss.drives.HarmonicBase(base, frequency=frequency)
    return ss.steady_state(ss.Oscillator(mass=mass, stiffness=spring, law=law, drive=drive))


def base_for(given: Given, case: int) -> float:
    """The base amplitude [m] under which the model moves as far as the experiment of Table 3.2."""
    section = given["sliding"]
    root = brentq(
        lambda base: sliding(given, case, base=base).amplitude - section["amplitude"][case],
        0.98 * section["base"][case],
        1.15 * section["base"][case],
        xtol=1e-9,
    )
    return float(root)


def equation_3_4(section: Mapping[str, Any], case: int) -> float:
    """V_s [m/s] of equation 3.4, from the entries of Table 3.2."""
    give = section["kinetic"][case] / section["stiffness"][case]
    return 4 * math.pi * section["frequency"][case] * math.sqrt(section["amplitude"][case] * give - give**2)


@functools.lru_cache(8)
def on_rig(mass: float, spring: float, law: Any, base: float, frequency: float) -> ss.Record:
    """What the virtual rig makes of that motion: two seconds, with friction."""
    drive = ss.drives.HarmonicBase(base, frequency=frequency)
    run = ss.simulate(ss.Oscillator(mass=mass, stiffness=spring, law=law, drive=drive), duration=10)
    rig = ss.Rig()
    record = rig.stated(rig.measure(run, fs=4000, rng=7, start=8.0))
    return ss.friction_force(record, mass=mass, stiffness=spring, method="fusion")


def measured(given: Given, case: int, *, surface: int = 4) -> ss.Record:
    """What the virtual rig makes of one of the three cases: two seconds, with friction, on one of many surfaces."""
    section = given["sliding"]
    law = ss.laws.RoughSurface(contact(given, case), share=section["roughness"], length=2e-4, span=2e-3, seed=surface)
    return on_rig(section["mass"], section["spring"], law, base_for(given, case), section["frequency"][case])


def slopes_of_sticks(record: ss.Record) -> Array:
    """As in section 3.5.1: the slope of a line through friction against displacement in each stick [N/m]."""
    loops = ss.friction_loops(record)
    return branch_slopes(record["x"], record["friction"] - loops.offset.value, loops.level.value)


def harmonics(given: Given) -> Harmonics:
    """Of the displacement in the twin's record at 5.61 Hz (Figure 3.9c)."""
    return ss.signals.harmonics(measured(given, 0), frequency=given["sliding"]["frequency"][0])


def _of_orbit(orbit: ss.solve.SteadyState) -> str:
    return (
        f"Steady motion by the exact solver: the mass moves {1e3 * orbit.amplitude:.3f} mm, and sliding begins at "
        f"{1e3 * orbit.transition_speed:.2f} mm/s."
    )


def imposed(law: Any, memory: tuple[str, ...] = ()) -> tuple[Array, dict[str, Array]]:
    """A contact under the imposed motion x = -cos t, from turn to turn."""
    drive = ss.drives.Imposed(ss.drives.HarmonicBase(-1.0, frequency=1 / (2 * math.pi)))
    run = ss.simulate(ss.Oscillator(mass=1, stiffness=0, law=law, drive=drive), cycles=3)
    turn = 2 * math.pi
    times, motion = exact(run, first=turn, last=2 * turn, names=("x", "v", "friction", *memory))
    sliding_now = np.array([mode.kind == "slip" for mode in run.table.modes])[run.modes]
    piece = np.searchsorted(run.starts, times, side="right") - 1
    return times - turn, {**motion, "sliding": sliding_now[piece]}


def _two_phases(ax: Axes, across: Array, up: Array, sliding_now: Array) -> None:
    """Sliding dashed, microsticking solid."""
    ax.plot(across, np.where(sliding_now, up, np.nan), color=FAINT, linestyle="--", linewidth=1.2)
    ax.plot(across, np.where(sliding_now, np.nan, up), color=BLUE, linewidth=1.6)


def _schematics(given: Given) -> Iterator[Plate]:
    """Figures 3.2 to 3.7, computed with a contact much softer than the rig's, so that its give can be seen."""
    soft = given["schematic"]
    words = (
        f"Computed, not sketched: the model under an imposed motion, with a contact so soft that 2f_k/K_y is "
        f"{2 / soft['stiffness']:.2g} of the amplitude. "
    )
    time, motion = imposed(ss.laws.CompliantContact(1.0, stiffness=soft["stiffness"]))
    yield figure("3.2", _hypothetical(time, motion), words.strip())
    for number, axis, label in (("3.3", "x", "x / X_m"), ("3.4", "v", "ẋ / ωX_m")):
        yield figure(number, _phases(motion, axis, label), _corners(number, soft["stiffness"], words))
    _, over = imposed(ss.laws.CompliantContact(1.0, stiffness=soft["stiffness"], static=soft["static"]))
    for number, axis, label in (("3.5", "x", "x / X_m"), ("3.6", "v", "ẋ / ωX_m")):
        yield figure(
            number,
            _phases(over, axis, label),
            f"{words}f_s = {soft['static']:g} f_k: friction falls where sliding begins.",
        )
    yield figure(
        "3.7",
        _stribeck(soft),
        f"{words}The friction of (a) at the slider, behind the contact's spring. The "
        "printed caption calls both (b) and (c) f - ẋ; (c) is f - x.",
    )


def _corners(number: str, stiffness: float, words: str) -> str:
    """Where sliding begins, by equations 3.2 and 3.4, of f_k = X_m = ω = 1."""
    speed = 2 * math.sqrt(1 / stiffness - 1 / stiffness**2)
    if number == "3.3":
        return f"{words}Its slope while it sticks is K_y."
    return f"{words}Sliding begins at V_s = {speed:.3f} ωX_m, as equation 3.4 says."


@styled
def _hypothetical(time: Array, motion: Mapping[str, Array]) -> Any:
    """Figure 3.2."""
    drawn, axes = panels(4, height=6.0)
    rows = ((motion["x"], "x / X_m"), (motion["v"], "ẋ / ωX_m"), (motion["friction"], "y / Y_m"),
            (motion["friction"], "f / f_k"))  # fmt: skip
    for ax, letter, (values, label) in zip(axes, "abcd", rows, strict=True):
        _two_phases(ax, time, values, motion["sliding"])
        ax.set_ylabel(label)
        tag(ax, letter)
    axes[-1].set_xlabel("ωt")
    return drawn


@styled
def _phases(motion: Mapping[str, Array], axis: str, label: str) -> Any:
    drawn, ax = panels(1, height=3.2)
    _two_phases(ax, motion[axis], motion["friction"], motion["sliding"])
    ax.set(xlabel=label, ylabel="f / f_k")
    return drawn


def stribeck_behind_a_spring(soft: Mapping[str, float]) -> tuple[Array, Array, dict[str, Array]]:
    """Speeds, friction that falls with them, and the motion of a compliant contact with it."""
    speed = np.linspace(0, 1.2, 241)
    friction = 1 + (soft["static"] - 1) * np.exp(-((speed / soft["stribeck_speed"]) ** 2))
    law = ss.laws.InSeries(ss.laws.Tabulated(speed, friction), stiffness=soft["stiffness"], damping=soft["damping"])
    return speed, friction, imposed(law)[1]


@styled
def _stribeck(soft: Mapping[str, float]) -> Any:
    """Figure 3.7: friction that falls with the sliding speed, rigid and behind a compliant contact."""
    speed, friction, motion = stribeck_behind_a_spring(soft)
    drawn, axes = panels(1, 3, height=2.6)
    axes[0].plot(np.concatenate([-speed[::-1], speed]), np.concatenate([-friction[::-1], friction]), color=ORANGE)
    axes[0].set(xlabel="v_r / ωX_m", ylabel="f / f_k")
    _two_phases(axes[1], motion["v"], motion["friction"], motion["sliding"])
    axes[1].set_xlabel("ẋ / ωX_m")
    _two_phases(axes[2], motion["x"], motion["friction"], motion["sliding"])
    axes[2].set_xlabel("x / X_m")
    for ax, letter in zip(axes, "abc", strict=True):
        tag(ax, letter)
    return drawn


def _measured_responses(given: Given, case: int) -> Any:
    """Figures 3.8, 3.10, 3.11: half a second of the record, its velocity by the five-point average as in the thesis."""
    record = measured(given, case)
    part = slice(0, round(0.6 * record.fs))
    v = ss.signals.differentiate(record["x"], record.fs, method="five-point").values
    motion = {"x": record["x"], "v": v, "a": record["a"], "friction": record["friction"]}
    cut = {name: values[part] for name, values in motion.items()}
    if case == 0:  # printed in another order
        return responses(record.time[part], cut, words={name: RESPONSES[name] for name in ("x", "v", "friction", "a")})
    return responses(record.time[part], cut)


@styled
def _spectra(given: Given) -> Any:
    """Figure 3.9."""
    record = measured(given, 0)
    drawn, axes = panels(3, height=5.2)
    axes[0].plot(record.time, 1e3 * record["x"], color=BLUE, linewidth=0.9)
    axes[0].set(xlabel="time [s]", ylabel="displacement [mm]")
    x = record["x"] - np.mean(record["x"])
    frequency = np.fft.rfftfreq(len(x), 1 / record.fs)
    power = (2 * np.abs(np.fft.rfft(x * np.hanning(len(x)))) / np.sum(np.hanning(len(x)))) ** 2
    shown = frequency < 60
    axes[1].plot(frequency[shown], 1e6 * power[shown], color=PURPLE)
    axes[2].plot(frequency[shown], 10 * np.log10(1e6 * power[shown]), color=PURPLE)
    axes[1].set_ylabel("power [mm²]")
    axes[2].set_ylabel("power [dB of mm²]")
    for ax in axes[1:]:
        ax.set_xlabel("frequency [Hz]")
    for ax, letter in zip(axes, "abc", strict=True):
        tag(ax, letter)
    return drawn


@styled
def _averaged(given: Given) -> Any:
    """Figure 3.15: friction against velocity, averaged over the cycles."""
    drawn, axes = panels(1, 3, height=2.8)
    for ax, case, letter in zip(axes, CASES, "abc", strict=True):
        loops = ss.friction_loops(measured(given, case))
        v, f = loops.velocity, loops.friction
        ax.plot(1e3 * np.append(v, v[0]), np.append(f, f[0]), color=(BLUE, GREEN, ORANGE)[case], linewidth=1.0)
        for side in (-1, 1):
            ax.axvline(1e3 * side * equation_3_4(given["sliding"], case), color=FAINT, linestyle="--", linewidth=0.9)
        ax.set(xlabel="velocity [mm/s]", xlim=(-15, 15))
        ax.set_title(f"({letter}) {given['sliding']['frequency'][case]:g} Hz", loc="left", fontsize=9)
    axes[0].set_ylabel("friction [N]")
    return drawn
