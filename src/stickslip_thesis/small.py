"""Section 8.2 in the small: materials, micro-slips and their sound, and a lag behind the contact."""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

import stickslip as ss
from stickslip.figures.style import BLUE, FAINT, GREEN, INK, ORANGE, PURPLE, Plate, styled
from stickslip_thesis import chapter3, readings
from stickslip_thesis.drawing import figure, panels, tag
from stickslip_thesis.printed import Given

Array = NDArray[np.float64]

PAIRS = ("steel on steel", "aluminium on steel", "Teflon on steel", "rubber on steel")
GEOMETRIES = {"flat": 0.0, "sphere": 1 / 3, "rough": 1.0}  # power of the load with which the contact stiffens
LOADS, RATIOS = np.geomspace(0.5, 4.0, 13), np.geomspace(0.008, 0.08, 11)
CYCLES = 16  # of the slow motion, of which the last two are heard: what is left of the start is below 1e-4 then
AUDIBLE = 100.0  # Hz: below it is the motion itself


def plates(given: Given) -> Iterator[Plate]:
    """Figures of ours."""
    told = given["beyond"]
    steel = ring(given, ss.laws.pair("steel on steel").stiffness(told["load"], radius=told["radius"]))
    yield figure(
        "materials",
        _materials(given),
        f"A sphere of {1e3 * told['radius']:g} mm under {told['load']:g} N, of four materials on steel: (a) friction "
        "from rest, over sliding friction, as the contact slips from its rim inwards (Mindlin); it is nowhere "
        "straight. (b) Frequency at which the thesis's mass would ring on it, over the load. Its own contact, of "
        f"steel, rings at {ring(given, given['stick_slip']['stiffness']):.0f} Hz (dot) where that sphere would at "
        f"{steel:.0f} Hz: most of what gives way is not the touching surfaces, which section 3.3 leaves open.",
        title="Materials: microsticks that are no straight lines",
    )
    yield figure(
        "micro-slips",
        _micro_slips(given),
        "Micro-slips in each stick of the motion at 2.5 Hz, over load and damping ratio: of a flat contact, whose "
        "stiffness does not follow the load, a sphere's, whose follows its cube root, and a rough one's, in "
        "proportion. The base moves in proportion to the load.",
        title="Micro-slips over load, damping and geometry",
    )
    loud, silent = (level(sound(given, case)) for case in ("case2", "case1"))
    yield figure(
        "noise",
        _noise(given),
        f"What is heard {1e3 * told['distance']:g} mm from the mass, above {AUDIBLE:g} Hz: {loud:.0f} dB with two "
        f"micro-slips in each stick (case 2), {silent:.0f} dB with none (case 1). Each micro-slip ends in an impulse "
        "of its own, between those of the stick's beginning and its end. Of so heavy and slow a mass nobody would "
        "hear either.",
        title="Micro-slips as a source of noise",
    )
    yield figure(
        "delay",
        _delay(given),
        f"Friction that falls by {told['fall']:g} N with the speed and answers it {1e3 * told['delay']:g} ms late "
        "(Hess and Soom), behind the contact's spring. The contact has a mass here, as in section 4.5, of "
        f"{1e3 * told['slider']:g} g, and the motion at 8.7 Hz is imposed: without a mass, its own speed would be no "
        "state from which a lag can be recalled, and that is refused.",
        title="A lag behind the contact's spring",
    )


def ring(given: Given, stiffness: Any) -> Any:
    """Frequency of the thesis's mass on its spring and a contact [Hz]."""
    return np.sqrt((given["stick_slip"]["spring"] + stiffness) / given["stick_slip"]["mass"]) / (2 * np.pi)


def _fast(record: ss.Record) -> Array:
    """The sound above what the motion itself makes."""
    spectrum = np.fft.rfft(record["sound"] - np.mean(record["sound"]))
    spectrum[np.fft.rfftfreq(len(record), 1 / record.fs) < AUDIBLE] = 0
    return np.fft.irfft(spectrum, len(record))


def level(record: ss.Record) -> float:
    """Sound pressure level above `AUDIBLE` [dB re 20 µPa]."""
    return float(20 * np.log10(np.std(_fast(record)) / 20e-6))


def stick_slip(given: Given, ratio: float, *, load: float = 1.0, stiffening: float = 0.0) -> ss.Oscillator:
    """The motion of chapter 4 with another damping ratio, relative load, and stiffness that follows it by a power."""
    told = given["stick_slip"]
    stiff = told["stiffness"] * load**stiffening
    damping = told["critical"] * ratio * math.sqrt(told["mass"] * (told["spring"] + stiff))
    law = ss.laws.CompliantContact(told["kinetic"] * load, stiffness=stiff, damping=damping)
    drive = ss.drives.HarmonicBase(told["base"] * load, frequency=told["frequency"])
    return ss.Oscillator(mass=told["mass"], stiffness=told["spring"], law=law, drive=drive)


def sound(given: Given, case: str) -> ss.Record:
    """What is heard of two settled cycles of a case of chapter 4, its face a disk in a wall."""
    told = given["beyond"]
    system = stick_slip(given, given["stick_slip"][case])
    return _heard(system, told["face"], told["distance"])


@functools.lru_cache(4)
def _heard(system: ss.Oscillator, area: float, distance: float) -> ss.Record:
    run = ss.simulate(system, cycles=CYCLES)
    heard = ss.squeak.sound_pressure(run, fs=1e4, area=area, distance=distance, normal=[1.0], baffled=True)
    return heard.between((CYCLES - 2) / system.drive.frequency, CYCLES / system.drive.frequency)


@styled
def _materials(given: Given) -> Any:
    told = given["beyond"]
    drawn, axes = panels(1, 2, height=3.0)
    loads = np.geomspace(0.3, 30.0, 40)
    for name, colour in zip(PAIRS, (BLUE, GREEN, ORANGE, PURPLE), strict=True):
        pair = ss.laws.pair(name)
        law = pair.sphere(told["load"], radius=told["radius"], elements=60)
        springs, forces = np.array(law.stiffnesses), np.array(law.forces)
        way = np.geomspace(1e-3, 2.0, 200) * np.max(forces / springs)
        friction = np.minimum(np.outer(way, springs), forces).sum(axis=1)
        axes[0].plot(1e6 * way, friction / np.sum(forces), color=colour, label=name)
        stiffness = np.array([pair.stiffness(float(load), radius=told["radius"]) for load in loads])
        axes[1].plot(loads, ring(given, stiffness), color=colour)
    axes[1].plot([told["load"]], [ring(given, given["stick_slip"]["stiffness"])], "o", color=INK, markersize=4)
    axes[0].set(xlabel="displacement [µm]", ylabel="friction over its level", xscale="log")
    axes[1].set(xlabel="normal load [N]", ylabel="frequency [Hz]", xscale="log", yscale="log")
    for ax in axes:
        ax.xaxis.set_major_formatter("{x:g}")
    axes[1].yaxis.set_major_formatter("{x:g}")
    axes[1].set_yticks([10, 20, 50, 100, 200, 500])
    axes[1].minorticks_off()
    axes[1].legend(axes[0].get_lines(), PAIRS, fontsize=7, loc="lower right", bbox_to_anchor=(1, 0.12))
    for ax, letter in zip(axes, "ab", strict=True):
        tag(ax, letter)
    return drawn


@functools.lru_cache(2)
def _counted(constants: tuple[tuple[str, float], ...], stiffening: float) -> Array:
    given = {"stick_slip": dict(constants)}
    return np.array(
        [
            [
                readings.micro_slips(
                    ss.steady_state(stick_slip(given, float(ratio), load=float(load), stiffening=stiffening))
                )
                for load in LOADS
            ]
            for ratio in RATIOS
        ]
    )


def counted(given: Given, geometry: str) -> Array:
    """Micro-slips in each stick, over `RATIOS` and `LOADS`."""
    return _counted(tuple(given["stick_slip"].items()), GEOMETRIES[geometry])


@styled
def _micro_slips(given: Given) -> Any:
    drawn, axes = panels(1, 3, height=2.6)
    load = given["beyond"]["load"]
    for ax, geometry, letter in zip(axes, GEOMETRIES, "abc", strict=True):
        counts = counted(given, geometry)
        shown = ax.pcolormesh(load * LOADS, 100 * RATIOS, counts, cmap="Blues", vmin=0, vmax=6, shading="nearest")
        ax.set(xlabel="normal load [N]", xscale="log", yscale="log", xticks=[2, 5, 10], yticks=[1, 2, 5])
        ax.minorticks_off()
        ax.xaxis.set_major_formatter("{x:g}")
        ax.yaxis.set_major_formatter("{x:g}")
        tag(ax, letter)
        ax.set_title(geometry, fontsize=9)
    axes[0].set_ylabel("damping ratio [%]")
    drawn.colorbar(shown, ax=list(axes), label="micro-slips in a stick", ticks=range(7))
    return drawn


@styled
def _noise(given: Given) -> Any:
    drawn, axes = panels(2, height=4.0)
    for ax, case, colour, letter in zip(axes, ("case2", "case1"), (ORANGE, BLUE), "ab", strict=True):
        record = sound(given, case)
        ax.plot(record.time - record.time[0], 1e3 * _fast(record), color=colour, linewidth=0.6)
        ax.set_ylabel("sound [mPa]")
        tag(ax, letter)
    axes[1].set(xlabel="time [s]", ylim=axes[0].get_ylim())
    return drawn


@functools.lru_cache(2)
def _delayed(contact: Any, mass: float, fall: float, speed: float, lag: float, reach: float, frequency: float) -> Any:
    """The run of a contact's mass under an imposed motion of its spring's other end."""
    curve = ss.laws.Stribeck(contact.kinetic, contact.kinetic + fall, speed=speed)
    law = ss.laws.TimeDelay(curve, lag=lag) if lag else curve
    damping = 2 * 0.3 * math.sqrt(contact.stiffness * mass)
    drive = ss.drives.HarmonicBase(reach, frequency=frequency)
    system = ss.Oscillator(mass=mass, stiffness=contact.stiffness, law=law, drive=drive, damping=damping, damper="base")
    return ss.simulate(system, cycles=2)


def delayed(given: Given, lag: float) -> dict[str, Array]:
    """A period of the imposed motion, and the friction that spring and damper of the contact pass on to the mass."""
    told, sliding = given["beyond"], given["sliding"]
    reach, frequency = sliding["amplitude"][1], sliding["frequency"][1]
    run = _delayed(chapter3.contact(given, 1), told["slider"], told["fall"], told["speed"], lag, reach, frequency)
    times = np.linspace(1.0, 2.0, 4000) / frequency
    own, friction = run.sample(times, ("a", "friction"))[0]
    rate = 2 * math.pi * frequency
    return {
        "x": reach * np.cos(rate * times),
        "v": -rate * reach * np.sin(rate * times),
        "a": -(rate**2) * reach * np.cos(rate * times),
        "friction": friction + told["slider"] * own,
    }


@styled
def _delay(given: Given) -> Any:
    drawn, axes = panels(1, 2, height=3.0)
    for lag, colour, label in ((0.0, FAINT, "at once"), (given["beyond"]["delay"], PURPLE, "late")):
        motion = delayed(given, lag)
        axes[0].plot(1e3 * motion["x"], motion["friction"], color=colour, linewidth=0.9, label=label)
        axes[1].plot(1e3 * motion["v"], motion["friction"], color=colour, linewidth=0.9)
    axes[0].set(xlabel="displacement [mm]", ylabel="friction [N]")
    axes[1].set(xlabel="velocity [mm/s]")
    axes[0].legend()
    for ax, letter in zip(axes, "ab", strict=True):
        tag(ax, letter)
    return drawn
