"""Chapter 2: friction measured two ways, by a load cell and from the forces that balance it.

The flange before the cell is a mass of its own: section 2.4 takes its inertia off the cell's reading, so that it stands
between contact and cell; section 2.5 gives the cell with its mounting 250 Hz. Contact and mounting are two springs in
series, and in series they have the stiffness of section 3.5. What the cell feels is then the force on the slider, and
the flange shakes the slider: its 250 Hz are heard in the acceleration too.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

import stickslip as ss
from stickslip.errors import ModelError
from stickslip.figures.style import BLUE, GREEN, INK, ORANGE, PURPLE, Plate, envelope, styled
from stickslip.signals.derivatives import five_point_average
from stickslip_thesis.drawing import apparatus, figure, panels, tag
from stickslip_thesis.printed import Given, Ours

Array = NDArray[np.float64]

TITLE = "Friction measured two ways, by a load cell and from the forces that balance it"
STARTS_FROM = ("rig",)  # sections of given.toml
SETTLED = 40.0  # s: the air track hardly damps
HEARD = (60.0, 177.0)  # Hz: above the contact's ringing, and up to sqrt(2) times the accelerometer mount's 125 Hz
CELL_BAND = (180.0, 400.0)  # Hz: around the load cell's 250 Hz


def numbers(given: Given) -> Ours:
    """The chapter's numbers."""
    section, free = given["rig"], free_vibration(given)
    lines = {
        resonance.name: resonance.frequency.value
        for resonance in ss.balance.impact_test(impact(given), mass=section["mass"]).resonances
    }
    return {
        "damping ratio": ss.decay.log_decrement(free).damping_ratio.value,
        "natural frequency": math.sqrt(section["spring"] / section["mass"]),
        "phase": lead(given, free),
        "contact": lines["coupled contact"],
        "accelerometer": lines["mount of the accelerometer"],
        "load cell": lines["mount of the load cell"],
    }


def plates(given: Given) -> Iterator[Plate]:
    """The chapter's figures."""
    words = "The virtual rig of chapter 2; amplitude and noise are ours."
    yield figure("2.1", apparatus(given), "Drawn from the chapter's parameters and the virtual rig's sensors.")
    yield figure("2.2", _free_response(given), words)
    late, early = (np.std(resultant(given, free_vibration(given), sign)[400:-400]) for sign in (1, -1))
    yield figure(
        "2.3",
        _balance(given, free_vibration(given), smoothed=True),
        f"{words} The accelerometer leads and is read at t - τ: what is left deviates by {late:.3f} N; "
        f"at t + τ, as the text writes it, by {early:.2f} N.",
    )
    for number, case in (("2.4", 0), ("2.5", 1), ("2.6", 2)):
        share = (given["rig"]["forced"][case] / 125) ** 2
        yield figure(
            number,
            _balance(given, forced(given, case)),
            f"{words} What is left: noise, and the {100 * share:.1f} % that the accelerometer's mount of 125 Hz adds.",
        )
    for number, case in (("2.7", 0), ("2.8", 1), ("2.9", 2), ("2.10", 3)):
        record = rubbing(given, case)
        comparison = ss.balance.compare_force(balanced(given, case))
        heard, ringing = (transients(given, record, band) for band in (HEARD, CELL_BAND))
        yield figure(
            number,
            _both_forces(given, record),
            f"{words} Computed and felt force agree within a tenth up to {comparison.agree_up_to.value:.0f} Hz. Of "
            f"what rings from {HEARD[0]:g} to {HEARD[1]:g} Hz F2 has {heard:.2f} of F1; from {CELL_BAND[0]:g} to "
            f"{CELL_BAND[1]:g} Hz {ringing:.2f}, where the accelerometer on its mount of 125 Hz hears less, too.",
        )
    slow, fast = coupled(given["rig"])
    yield figure(
        "2.11",
        _impact(given),
        "The virtual rig, struck for 2 ms: slider and flange ring together at "
        f"{slow:.1f} and {fast:.0f} Hz, heard in both signals, the accelerometer's mount in (c) alone.",
    )


@functools.lru_cache(16)
def _measured(system: Any, release: float, first: float, seconds: float, *, fs: float, lag: float) -> ss.Record:
    start = {"x": release} if release else None
    run = ss.simulate(system, start=start, duration=first + seconds)
    rig = ss.Rig().having("x", lag=lag).having("z", lag=lag)
    return rig.stated(rig.measure(run, fs=fs, rng=2, start=first))


def _driven(amplitude: float, frequency: float) -> ss.drives.HarmonicBase:
    """A motion of the base that the shaker of section 2.2 can make: 8 mm, from 1 Hz on."""
    ss.rig.Shaker().require(frequency, amplitude)
    return ss.drives.HarmonicBase(amplitude, frequency=frequency)


def _sensors(given: Given) -> dict[str, float]:
    """Rate, and a lag of the LVDTs under which the accelerometer leads by the printed phase in a free vibration.

    It is late by its own mount; and where the motion decays, the acceleration leads by twice the damping ratio anyhow.
    """
    section = given["rig"]
    mount = next(sensor.mount for sensor in ss.Rig().sensors if sensor.channel == "a")
    assert mount is not None
    late = mount.damping / (math.pi * mount.frequency)
    return {"fs": section["fs"], "lag": (section["phase"] - 2 * section["damping_ratio"]) / section["natural"] + late}


def lead(given: Given, free: ss.Record) -> float:
    """The phase by which the accelerometer leads the LVDT in a free vibration, at its frequency (section 2.3)."""
    turning = np.exp(-1j * math.sqrt(given["rig"]["spring"] / given["rig"]["mass"]) * free.time)
    window = np.hanning(len(free.time)) * turning
    return float(np.angle(np.sum(window * free["a"]) / np.sum(window * -free["x"])))


@dataclass(frozen=True)
class Flange:
    """Mass [kg] of the flange, stiffness [N/m] of the contact before it and of the cell's mounting behind it."""

    mass: float
    contact: float
    mounting: float

    @classmethod
    def of(cls, section: Mapping[str, Any]) -> Flange:
        """From the series stiffness, the share of its give that is the mounting's, and the frequency when engaged.

        At w the pencil of slider and flange is singular, a quadratic in the flange's mass; the lighter one is meant.

        Raises
        ------
        ModelError
            No flange rings so low, or a share that is none.
        """
        if not 0 < section["mounting_share"] < 1:
            raise ModelError(
                f"mounting_share = {section['mounting_share']}", "a share is between 0 and 1", "correct it"
            )
        contact = section["stiffness"] / (1 - section["mounting_share"])
        mounting = section["stiffness"] / section["mounting_share"]
        square = (2 * math.pi * section["mounting_frequency"]) ** 2
        slider, flange = section["spring"] + mounting - square * section["mass"], mounting + contact
        roots = np.roots([square**2, square * (slider - flange), mounting**2 - slider * flange])
        if np.iscomplex(roots).any():
            raise ModelError(
                f"mounting_share = {section['mounting_share']:g} at {section['mounting_frequency']:g} Hz",
                "no flange on so stiff a mounting rings so low",
                "give the mounting a larger share",
            )
        return cls(float(np.min(roots.real)), contact, mounting)


def with_flange(section: Mapping[str, Any], drive: Any) -> ss.Structure:
    """Slider and flange on the air track, the friction contact at the flange, the base on the slider's spring."""
    flange = Flange.of(section)
    track = 2 * section["damping_ratio"] * math.sqrt(section["mass"] * section["spring"])
    lost = section["contact_damping"] * (flange.contact / section["stiffness"]) ** 2  # in series, what the slider feels
    law = ss.laws.CompliantContact(section["kinetic"], stiffness=flange.contact, damping=lost)
    between = 2 * section["mounting_damping"] * math.sqrt(flange.mounting * flange.mass)
    link = np.array([[1.0, -1.0], [-1.0, 1.0]])
    return ss.Structure(
        np.diag([section["mass"] - flange.mass, flange.mass]),
        np.diag([track, 0.0]) + between * link,
        np.diag([section["spring"], 0.0]) + flange.mounting * link,
        contacts=[ss.Contact(law, [0, 1])],
        drive=drive,  # moves both alike: the link between them does not feel it
    )


def coupled(section: Mapping[str, Any]) -> tuple[float, float]:
    """Frequencies [Hz] of slider and flange with the contact engaged."""
    flange, system = Flange.of(section), with_flange(section, ss.drives.Release())
    stiffness = np.asarray(system.stiffness) + np.diag([0.0, flange.contact])
    squares = np.sort(np.linalg.eigvals(np.linalg.solve(np.asarray(system.mass), stiffness)).real)
    slow, fast = np.sqrt(squares) / (2 * math.pi)
    return float(slow), float(fast)


def felt_by_cell(section: Mapping[str, Any], rig: ss.Rig) -> ss.Rig:
    """A rig whose cell feels the friction and the flange's inertia, its mounting being the structure's own."""
    mount = ss.rig.Mount(math.inf, 0.0, mass=Flange.of(section).mass, on="a2")
    return rig.having("load", of="friction", mount=mount).having("x", of="x1").having("a", of="a1")


def slider(given: Given, *, drive: Any = None) -> ss.Oscillator:
    """Mass and spring on the air track, the friction contact taken off."""
    section = given["rig"]
    damping = 2 * section["damping_ratio"] * math.sqrt(section["mass"] * section["spring"])
    drive = {} if drive is None else {"drive": drive}
    return ss.Oscillator(
        mass=section["mass"], stiffness=section["spring"], damping=damping, law=ss.laws.Coulomb(0.0), **drive
    )


def free_vibration(given: Given) -> ss.Record:
    """Figures 2.2 and 2.3: the mass let go, without friction."""
    return _measured(slider(given), given["rig"]["release"], 0.0, 10.0, **_sensors(given))


def forced(given: Given, case: int) -> ss.Record:
    """Figures 2.4 to 2.6: the base moves, without friction; settled."""
    section = given["rig"]
    drive = _driven(section["forced_base"][case], section["forced"][case])
    return _measured(slider(given, drive=drive), 0.0, SETTLED, 1.0, **_sensors(given))


def rubbing(given: Given, case: int) -> ss.Record:
    """Figures 2.7 to 2.10: with friction at the flange, as the sensors read."""
    section = given["rig"]
    drive = _driven(section["base"][case], section["frequency"][case])
    sensors = _sensors(given)
    return _rubbing(_constants(section), drive, **sensors)


def _constants(section: Mapping[str, Any]) -> tuple[tuple[str, float], ...]:
    """The rig's numbers without what differs from case to case, as a key."""
    return tuple(sorted((name, value) for name, value in section.items() if not isinstance(value, list)))


@functools.lru_cache(16)
def _rubbing(constants: tuple[tuple[str, float], ...], drive: Any, *, fs: float, lag: float) -> ss.Record:
    section = dict(constants)
    run = ss.simulate(with_flange(section, drive), duration=SETTLED + 2.0)
    rig = felt_by_cell(section, ss.Rig().having("x", lag=lag).having("z", lag=lag))
    return rig.stated(rig.measure(run, fs=fs, rng=2, start=SETTLED))


def balanced(given: Given, case: int) -> ss.Record:
    """The same by the package's own balance, which takes the stated delays out."""
    section = given["rig"]
    return ss.friction_force(rubbing(given, case), mass=section["mass"], stiffness=section["spring"])


def impact(given: Given) -> ss.Record:
    """Figure 2.11: the base held but for a half sine of 2 ms, which acts on the mass as a blow through the spring."""
    section = given["rig"]
    fs = 20_000.0
    time = np.arange(round(0.6 * fs)) / fs
    blow = np.where((time > 0.1) & (time < 0.102), section["blow"] * np.sin(math.pi * (time - 0.1) / 2e-3), 0.0)
    return _struck(_constants(section), tuple(blow / section["spring"]), fs)


@functools.lru_cache(2)
def _struck(constants: tuple[tuple[str, float], ...], base: tuple[float, ...], fs: float) -> ss.Record:
    section = dict(constants)
    run = ss.simulate(with_flange(section, ss.drives.Recorded(base, fs=fs)), duration=(len(base) - 1) / fs)
    return felt_by_cell(section, ss.Rig()).measure(run, fs=4000, rng=4)


def delayed(given: Given, values: Array, sign: int = 1) -> Array:
    """S(t - tau), tau = phi / omega_n; with `sign` -1 S(t + tau)."""
    section = given["rig"]
    time = np.arange(len(values)) / section["fs"]
    return np.interp(time - sign * section["phase"] / section["natural"], time, values)


def forces(given: Given, record: ss.Record, sign: int = 1) -> dict[str, Array]:
    """Spring, inertial and excitation force of section 2.3, from the sensors as they read."""
    section = given["rig"]
    terms = {"spring": section["spring"] * record["x"], "inertia": section["mass"] * delayed(given, record["a"], sign)}
    return terms | ({"excitation": section["spring"] * record["z"]} if "z" in record else {})


def resultant(given: Given, record: ss.Record, sign: int = 1) -> Array:
    """What does not cancel: kS_3 - kS_1 - mS_2, the friction where there is a contact."""
    terms = forces(given, record, sign)
    return terms.get("excitation", 0.0) - terms["spring"] - terms["inertia"]


def both(given: Given, record: ss.Record) -> tuple[Array, Array, Array]:
    """F, its average F1, and F2: the load cell's reading less the flange's inertia, averaged alike (section 2.4)."""
    computed = resultant(given, record)
    felt = record["load"] - float(record.channels["load"].inertia) * record["a"]
    return computed, five_point_average(computed), five_point_average(felt)


def transients(given: Given, record: ss.Record, band: tuple[float, float]) -> float:
    """Root mean square of F2 in a band [Hz] over that of F1."""
    _, computed, felt = both(given, record)
    inside = slice(100, -100)  # the delayed reading has no first samples
    return loudness(felt[inside], record.fs, band) / loudness(computed[inside], record.fs, band)


def loudness(values: Array, fs: float, band: tuple[float, float]) -> float:
    """Root mean square within a band [Hz], of a Hann-windowed record."""
    window = np.hanning(len(values))
    power = np.abs(np.fft.rfft((values - np.mean(values)) * window)) ** 2
    frequency = np.fft.rfftfreq(len(values), 1 / fs)
    inside = (frequency >= band[0]) & (frequency < band[1])
    return math.sqrt(2 * float(np.sum(power[inside])) / len(values) / float(np.sum(window**2)))


LABELS = {"spring": ("f1 = kS1", BLUE), "inertia": ("f2 = mS2(t - τ)", ORANGE), "excitation": ("f3 = kS3", GREEN)}


def _draw_forces(given: Given, record: ss.Record, ax: Any, part: slice) -> None:
    for name, values in forces(given, record).items():
        label, colour = LABELS[name]
        ax.plot(record.time[part], values[part], color=colour, linewidth=1.0, label=label)
    ax.set_ylabel("force [N]")
    ax.legend(ncols=3, loc="lower right", bbox_to_anchor=(1, 1))


@styled
def _free_response(given: Given) -> Any:
    record = free_vibration(given)
    drawn, ax = panels(1, height=2.8)
    ax.plot(*envelope(record.time, 1e3 * record["x"]), color=BLUE, linewidth=0.8)
    ax.set(xlabel="time [s]", ylabel="displacement [mm]")
    return drawn


@styled
def _balance(given: Given, record: ss.Record, *, smoothed: bool = False) -> Any:
    """Figures 2.3 to 2.6: the forces, and what is left of them."""
    left = resultant(given, record)
    part = slice(40, 40 + round((1.0 if smoothed else 0.8) * record.fs))
    drawn, axes = panels(2 + smoothed, height=4.6 + smoothed)
    _draw_forces(given, record, axes[0], part)
    axes[1].plot(record.time[part], left[part], color=PURPLE, linewidth=0.7)
    axes[1].set_ylabel("resultant [N]")
    if smoothed:
        axes[2].plot(record.time[part], five_point_average(left)[part], color=PURPLE, linewidth=0.7)
        axes[2].set(ylabel="smoothed [N]", ylim=axes[1].get_ylim())
    axes[-1].set_xlabel("time [s]")
    for ax, letter in zip(axes, "abc", strict=False):
        tag(ax, letter)
    return drawn


@styled
def _both_forces(given: Given, record: ss.Record) -> Any:
    """Figures 2.7 to 2.10: the forces; F; its average F1; F2, of the load cell less the flange's inertia, averaged."""
    computed, averaged, felt = both(given, record)
    part = slice(40, 40 + round(record.fs))
    drawn, axes = panels(4, height=7.0)
    _draw_forces(given, record, axes[0], part)
    rows = (
        ("F [N]", computed, INK),
        ("F1 [N]", averaged, ORANGE),
        ("F2 [N]", felt, BLUE),
    )
    for ax, (label, values, colour) in zip(axes[1:], rows, strict=True):
        ax.plot(record.time[part], values[part], color=colour, linewidth=0.7)
        ax.set_ylabel(label)
    axes[3].set_ylim(axes[2].get_ylim())
    axes[-1].set_xlabel("time [s]")
    for ax, letter in zip(axes, "abcd", strict=True):
        tag(ax, letter)
    return drawn


@styled
def _impact(given: Given) -> Any:
    record = impact(given)
    drawn, axes = panels(2, 2, height=4.6)
    part = (record.time > 0.08) & (record.time < 0.4)
    rows = (("a", "acceleration [m/s²]", PURPLE), ("load", "friction [N]", ORANGE))
    for ax, below, (name, label, colour) in zip(axes[0], axes[1], rows, strict=True):
        ax.plot(record.time[part], record[name][part], color=colour, linewidth=0.8)
        ax.set(xlabel="time [s]", ylabel=label)
        values = record[name][record.time > 0.1]
        power = np.abs(np.fft.rfft(values - np.mean(values), 1 << 14)) ** 2
        frequency = np.fft.rfftfreq(1 << 14, 1 / record.fs)
        shown = frequency < 400
        below.plot(frequency[shown], 10 * np.log10(power[shown] / np.max(power)), color=colour, linewidth=0.9)
        below.set(xlabel="frequency [Hz]", ylabel="power [dB]", ylim=(-60, 3))
    for ax, letter in zip(axes.flat, "abcd", strict=True):
        tag(ax, letter)
    return drawn
