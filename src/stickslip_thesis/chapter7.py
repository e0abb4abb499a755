"""Chapter 7: why rubber on wet steel squeals."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

import stickslip as ss
from stickslip.figures.bifurcation import plot_stability
from stickslip.figures.style import BLUE, GREEN, INK, ORANGE, PURPLE, Plate, envelope, styled
from stickslip_thesis.drawing import figure, panels, responses, tag, transducers
from stickslip_thesis.printed import Given, Ours

Array = NDArray[np.float64]

TITLE = "Why rubber on wet steel squeals"
STARTS_FROM = ("squeak", "bearing")  # sections of given.toml
SETTLED = 20  # cycles: near its resonance of 5.5 Hz the mass takes that long, by trial with each condition
KEPT = 2  # cycles that are looked at
HERTZ = 1.5  # power of the load of a sphere
POWERS = {"virtual rig": 1.0, "spheres, 1.5": HERTZ, "rough surfaces, 2.5": 2.5}  # Oden and Martins: 2 to 3.3
TOWARDS = -0.1  # m/s: the side on which the rig squeals
LOADS, COARSE = (0.5, 40.0), 12  # N, and at how many of them the critical one is looked for
LOUDEST = 0.125  # s: over what a sound level meter averages on "fast"
CONDITIONS = (("dry", "heavy"), ("wet", "heavy"), ("dry", "light"), ("wet", "light"))
SIGNALS = {
    "x": ("displacement [mm]", BLUE), "v": ("velocity [mm/s]", GREEN),
    "a": ("tangential acceleration [m/s²]", PURPLE), "friction": ("friction [N]", ORANGE),
    "sound": ("sound [Pa]", INK), "torsion_velocity": ("torsional velocity [rad/s]", GREEN),
    "normal_acceleration": ("normal acceleration [m/s²]", BLUE),
}  # fmt: skip


def numbers(given: Given) -> Ours:
    """The chapter's numbers."""
    squeaking = record_of(given, "wet", "heavy")
    level = {surface: slow_friction(record_of(given, surface, "heavy")) for surface in ("dry", "wet")}
    bearing = given["bearing"]["kinetic"]
    return {
        "squeaks": [float(squeaks(given, *condition)) for condition in CONDITIONS],
        "friction over the bearing's": [level[surface] / bearing for surface in ("dry", "wet")],
        "harmonic": [strongest(squeaking, name) for name in ("a", "friction", "normal_acceleration", "sound")],
        "torsion": strongest(squeaking, "torsion_velocity"),
        "sound level": loudest(squeaking),
        "bending": bending(ss.squeak.squeak_rig()),
        "surroundings": level_of(room(given, len(squeaking))),
    }


def plates(given: Given) -> Iterator[Plate]:
    """The chapter's figures."""
    words = (
        "The virtual squeak rig: friction, loads and frequencies of the chapter, levers and slopes chosen so that its "
        f"observations hold together; driven so that the mass moves {1e3 * given['squeak']['amplitude']:g} mm."
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
        f"{words} The laser sees the torsion through the beam that carries the reflector, which bends at "
        f"{given['squeak']['reflector']:g} Hz.",
    )
    yield figure("7.11", _spectra(wet, ("friction", "a", "sound")), words)
    yield from _critical(given)


def _critical(given: Given) -> Iterator[Plate]:
    """Figures of ours: the load from which it squeals over wetness, and what feeds it."""
    (dry, wet), (dry_sphere, wet_sphere) = (
        [critical_load(given, wetness, power) for wetness in (0.0, 1.0)] for power in (1.0, HERTZ)
    )
    yield figure(
        "critical-load",
        _thresholds(given),
        "(a) Load from which sliding is not stable, between dry and wet rubber (friction and slope in proportion): "
        f"{dry:.1f} N dry and {wet:.1f} N wet of the virtual rig, whose contacts are springs that the preload sets. "
        "Under a load that grows with a power, as Tworzydło and Oden and Martins have it, friction's moment makes one "
        f"contact stiffer than the other: {dry_sphere:.1f} N and {wet_sphere:.1f} N of spheres; dry rubber would then "
        f"squeal under {given['squeak']['heavy']:g} N, where all are equally stiff at rest. (b) Frequencies of bending "
        "and torsion, wet: whatever the power, they meet where it begins (dotted).",
        title="The critical load against wetness, and against the normal law",
    )
    light = ss.squeak.squeak_rig("wet", given["squeak"]["light"])
    steep = ss.squeak.critical_value(light, "slope", between=(-2.5, 0.0), speed=TOWARDS)
    yield figure(
        "mechanisms",
        plot_stability(mechanisms(), labels=("slope of the friction coefficient [s/m]", "normal load [N]")),
        "What feeds the squeal of the virtual rig, wet: each mechanism is switched off in turn. Its own slope is "
        f"{light.contacts[0].law.slope:g} s/m; under {given['squeak']['light']:g} N it would have to be "
        f"{steep.value:.2g} s/m: friction falls there, and sliding is stable.",
        title="Coupling and slope: which of them feeds the squeal",
    )


def level_of(sound: Array) -> float:
    """Sound pressure level [dB re 20 µPa]."""
    return float(20 * np.log10(np.std(sound) / 20e-6))


def bending(rig: ss.Structure) -> float:
    """Frequency of the beam's mode across the mass without its contacts [Hz]."""
    return float(np.sqrt(rig.stiffness[1, 1] / rig.mass[1, 1]) / (2 * np.pi))


def slow_friction(record: ss.Record) -> float:
    """Its median where the mass moves with less than a fifth of its largest speed, stops left out [N]."""
    speed = np.abs(record["v"]) / np.max(np.abs(record["v"]))
    return float(np.median(np.abs(record["friction"][(speed > 0.01) & (speed < 0.2)])))


def loudest(record: ss.Record) -> float:
    """The largest level within an eighth of a second [dB]."""
    long = round(LOUDEST * record.fs)
    power = np.convolve(record["sound"] ** 2, np.full(long, 1 / long), "valid")
    return float(10 * np.log10(np.max(power) / 20e-6**2))


def room(given: Given, count: int) -> Array:
    """What the microphone hears of the room alone [Pa]."""
    noise = ss.rig.Noise(20e-6 * 10 ** (given["squeak"]["room"] / 20))
    return noise.samples(count, fs=given["squeak"]["fs"], rng=np.random.default_rng(5))


def rig_of(given: Given, surface: str, load: str) -> ss.Structure:
    """The virtual squeak rig, its base moving as far as the mass alone needs for the amplitude."""
    section = given["squeak"]
    rig = ss.squeak.squeak_rig(surface, section[load])
    return rig.having(amplitude=base_for(rig, section["amplitude"]))


def base_for(rig: ss.Structure, amplitude: float) -> float:
    """How far the base has to move [m] for the mass to move so far under its friction, without beam and contacts."""
    first = ss.Oscillator(
        mass=rig.mass[0, 0],
        stiffness=rig.stiffness[0, 0],
        damping=rig.damping[0, 0],
        law=_together(rig),
        drive=rig.drive,
    )
    near = rig.drive.amplitude
    root = brentq(
        lambda base: ss.steady_state(first.having(amplitude=base)).amplitude - amplitude, near / 2, 2 * near, xtol=1e-7
    )
    return float(root)


def _together(rig: ss.Structure) -> ss.laws.LinearSlope:
    """Both contacts' friction as one, under their preloads."""
    level = sum(contact.law.kinetic * contact.preload for contact in rig.contacts)
    slope = sum(contact.law.slope * contact.preload for contact in rig.contacts)
    return ss.laws.LinearSlope(level, slope=slope)


def record_of(given: Given, surface: str, load: str) -> ss.Record:
    """What the squeak rig's sensors write of two cycles, settled."""
    return _record(surface, load, tuple(given["squeak"].items()))


@functools.lru_cache(8)
def _record(surface: str, load: str, constants: tuple[tuple[str, float], ...]) -> ss.Record:
    given = {"squeak": dict(constants)}
    section = given["squeak"]
    run = ss.simulate(rig_of(given, surface, load), cycles=SETTLED + KEPT)
    heard = ss.squeak.squeak_record(
        run, fs=section["fs"], snr=60, rng=1, area=section["radiator"], distance=section["microphone"], baffled=True
    )
    beam = ss.rig.Mount(section["reflector"], section["reflector_damping"])
    laser = ss.Rig((ss.rig.Sensor("torsion_velocity", of="v3", mount=beam),)).measure(run, fs=section["fs"])
    record = heard.with_channel("torsion_velocity", laser["torsion_velocity"][: len(heard)], unit="rad/s")
    record = record.with_channel("sound", record["sound"] + room(given, len(record)), unit="Pa")
    return record.between(SETTLED / section["frequency"], (SETTLED + KEPT) / section["frequency"])


def squeaks(given: Given, surface: str, load: str) -> bool:
    """Does friction make a sound of the sliding?"""
    squeaks = ss.find_squeaks(record_of(given, surface, load))
    return any(burst.friction == "shown" for burst in squeaks.bursts)


def merging(given: Given) -> tuple[float, float]:
    """Frequencies [Hz] of bending and torsion of the wet rig where it begins to squeal."""
    section = given["squeak"]

    def at(load: float) -> ss.Structure:
        return ss.squeak.squeak_rig("wet", load)

    critical = ss.squeak.critical_value(
        at(section["heavy"]), at, between=(section["light"], section["heavy"]), speed=-0.1
    )
    high = sorted(mode.frequency for mode in ss.stability(at(critical.value), speed=-0.1).modes)[-2:]
    return high[0], high[1]


def rig_between(given: Given, wetness: float, load: float, power: float) -> ss.Structure:
    """The rig between dry (0) and wet (1), with a normal law of a power; at rest all are alike under the heavy load."""
    heavy = given["squeak"]["heavy"]
    dry, wet = (_pad(surface, heavy) for surface in ("dry", "wet"))
    kinetic, slope = (
        (1 - wetness) * getattr(dry.law, name) + wetness * getattr(wet.law, name) for name in ("kinetic", "slope")
    )
    law, stiffness = (
        replace(dry.law, kinetic=kinetic, slope=slope),
        dry.stiffness * (load / heavy) ** (1 - 1 / max(power, HERTZ)),
    )
    rig = ss.squeak.squeak_rig("wet", load)
    return replace(rig, contacts=[replace(pad, law=law, stiffness=stiffness, power=power) for pad in rig.contacts])


@functools.lru_cache(4)
def _pad(surface: str, load: float) -> ss.Contact:
    """One of the two contacts, which are alike in all that is read of it."""
    return ss.squeak.squeak_rig(surface, load).contacts[0]


@functools.lru_cache(64)
def _critical_load(wetness: float, power: float, heavy: float) -> float:
    given = {"squeak": {"heavy": heavy}}

    def growth(load: float) -> float:
        return ss.stability(rig_between(given, wetness, load, power), speed=TOWARDS).growth

    loads = np.geomspace(*LOADS, COARSE)
    growing = np.array([growth(float(load)) > 0 for load in loads])
    first = int(np.argmax(growing))
    return float(brentq(growth, loads[first - 1], loads[first], rtol=1e-6)) if first else np.nan


def critical_load(given: Given, wetness: float, power: float) -> float:
    """Load from which sliding is not stable [N]; nan where there is none."""
    return _critical_load(wetness, power, given["squeak"]["heavy"])


def mechanisms() -> Any:
    """What ends the steady sliding of the wet rig, over slope and load."""
    return ss.squeak.stability_map(
        lambda slope, load: ss.squeak.squeak_rig("wet", load).having(slope=slope),
        grid={"slope": np.linspace(-4, 4, 17), "load": np.linspace(0.5, 15.5, 16)},
        speed=TOWARDS,
    )


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
    if condition[1] == "heavy":
        return responses(record.time, {name: record[name] for name in ("x", "v", "a", "friction")})
    return _signals(record, ("x", "v", "a", "friction", "sound"))


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
    drawn, axes = panels(len(names), height=1.6 * len(names))
    for ax, name, letter in zip(axes, names, "abcde", strict=False):
        label, colour = SIGNALS[name]
        factor = 1e3 if "[mm" in label else 1.0
        ax.plot(*envelope(record.time - record.time[0], factor * record[name]), color=colour, linewidth=0.6)
        ax.set_ylabel(label.replace(" [", "\n["))
        tag(ax, letter)
    axes[-1].set_xlabel("time [s]")
    drawn.align_ylabels(list(axes))
    return drawn


@styled
def _thresholds(given: Given) -> Any:
    drawn, axes = panels(1, 2, height=3.0)
    wetness, loads = np.linspace(0, 1, 7), np.linspace(0.5, 12.0, 24)
    for (name, power), colour in zip(POWERS.items(), (GREEN, BLUE, ORANGE), strict=True):
        critical = [critical_load(given, float(share), power) for share in wetness]
        axes[0].plot(wetness, critical, color=colour, label=name)
        sliding = [ss.stability(rig_between(given, 1.0, float(load), power), speed=TOWARDS) for load in loads]
        modes = [sorted(mode.frequency for mode in state.modes)[-2:] for state in sliding]
        axes[1].plot(loads, modes, color=colour)
        axes[1].axvline(critical[-1], color=colour, linestyle=":", linewidth=0.9)
    axes[0].set(xlabel="wetness: 0 dry, 1 wet", ylabel="critical load [N]", ylim=(0, None))
    axes[0].legend()
    axes[1].set(xlabel="normal load [N]", ylabel="frequency [Hz]")
    for ax, letter in zip(axes, "ab", strict=True):
        tag(ax, letter)
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
