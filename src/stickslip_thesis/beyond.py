"""Section 8.2, future studies: other laws in the compliant contact, what the ringing depends on, and dither."""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

import stickslip as ss
from stickslip.figures.style import BLUE, FAINT, GREEN, INK, ORANGE, PURPLE, Plate, styled
from stickslip.maps.dither import longest_stick
from stickslip_thesis import chapter3, chapter4, small
from stickslip_thesis.drawing import around, exact, figure, panels, tag
from stickslip_thesis.printed import Given, Ours

Array = NDArray[np.float64]

TITLE = "Beyond the thesis: what section 8.2 leaves for future studies"
STRONGER = 1.1  # times the smallest dither
LAPS = (16, 40)  # cycles of the slow motion: let pass, and in all, as the search for a dither has them
OFTEN = {"stiffness": "stiffness", "kinetic": "friction"}  # what a contact changes by a tenth
STARTS_FROM = ("beyond", "stick_slip", "sliding")  # sections of given.toml


def numbers(given: Given) -> Ours:
    """None is printed."""
    return {}


def plates(given: Given) -> Iterator[Plate]:
    """Figures of ours."""
    told = given["beyond"]
    yield figure(
        "laws",
        _laws(given),
        f"The contact of 8.7 Hz with friction that falls by {told['fall']:g} N with the sliding speed (Stribeck), and "
        f"with friction that follows its level late (state variable, {told['lag']:g} s). Falling friction "
        "overshoots where sliding begins; memory rounds the corner: sliding begins earlier, and friction rises on.",
        title="Stribeck friction and memory behind the contact's spring",
    )
    ends = [abs(identity(orbit)[1][-1]) for orbit in orbits(given).values()]
    yield figure(
        "identity",
        _identity(given),
        "Friction of each kind behind the contact's spring, and stick-slip of case 2. Of any motion with the drive's "
        "period and without a viscous damper, ∮ (ẍ + ω²x) df = 0, whichever law f "
        f"follows: equation 3.4 is the case of one microstick at each reversal. Left after a period: {max(ends):.0e} "
        "of what went to and fro, by the drawing's points.",
        title="An identity that every friction law obeys",
    )
    yield figure(
        "ringing",
        _ringing(given),
        "Frequency of the transition oscillation, found in the acceleration of simulated stick-slip (dots), and "
        "√((k + K_y)/m)/2π (line): (a) against the contact's stiffness; (b) against the normal load on hemispheres, "
        "where friction grows as the load, stiffness as its cube root, and the base moves in proportion to the load; "
        "3.53 N is the thesis's. The load changes the frequency through the stiffness alone. Softer ones than "
        "shown ring too slowly to be read within one stick.",
        title="What the transition oscillation depends on",
    )
    designed, ring = dither(given)
    period = 1 / designed.frequency
    left = [name for name, (_, after) in tried(given, 1.0).items() if after > period]
    more = [name for name, (_, after) in tried(given, STRONGER).items() if after > period]
    yield figure(
        "dither",
        _dithered(given),
        f"A record of the virtual rig, with its sensors' faults, tells how the contact rings ({ring:.1f} Hz), and by "
        f"that and the loops' level a contact is built. What removes its sticks, {1e6 * designed.amplitude.value:.2f} "
        f"µm along the contact at {designed.frequency:.0f} Hz, is tried on rigs that are not the one identified: (a) "
        f"the rig that was measured; (b) the longest stick without and with it, and with {STRONGER:g} times as much "
        f"(dotted: a period of the dither). It leaves sticks in {' and '.join(left) or 'none'}; with more, in "
        f"{' and '.join(more) or 'none'}.",
        title="A dither designed from what was identified, on rigs that were not",
    )
    yield from small.plates(given)


def behind_the_spring(given: Given) -> dict[str, Any]:
    """The contact of 8.7 Hz with Coulomb friction, Stribeck friction and memory."""
    told, contact = given["beyond"], chapter3.contact(given, 1)
    speed = np.linspace(0, 20 * told["speed"], 201)
    falling = contact.kinetic + told["fall"] * np.exp(-((speed / told["speed"]) ** 2))
    spring = {"stiffness": contact.stiffness}
    return {
        "Coulomb": contact,
        "Stribeck": ss.laws.InSeries(ss.laws.Tabulated(speed, falling), damping=told["damping"], **spring),
        "state variable": ss.laws.InSeries(
            ss.laws.StateVariable(contact.kinetic, rate=1 / told["lag"]), damping=contact.damping, **spring
        ),
    }


def orbits(given: Given) -> dict[str, ss.solve.SteadyState]:
    """The steady motion at 8.7 Hz with each of them."""
    told = given["sliding"]
    drive = ss.drives.HarmonicBase(chapter3.base_for(given, 1), frequency=told["frequency"][1])
    return {name: _orbit(told["mass"], told["spring"], law, drive) for name, law in behind_the_spring(given).items()}


@functools.lru_cache(8)
def _orbit(mass: float, spring: float, law: Any, drive: Any) -> ss.solve.SteadyState:
    return ss.steady_state(ss.Oscillator(mass=mass, stiffness=spring, law=law, drive=drive))


def identity(orbit: ss.solve.SteadyState) -> tuple[Array, Array]:
    """Time, and the integral of (x" + w^2 x) df up to it, over that of its magnitude: zero after a whole period."""
    time, motion = around(orbit)
    level = motion["a"] + (2 * math.pi / orbit.period) ** 2 * motion["x"]
    steps = (level[1:] + level[:-1]) / 2 * np.diff(motion["friction"])
    return time, np.concatenate([[0.0], np.cumsum(steps)]) / np.sum(np.abs(steps))


@styled
def _identity(given: Given) -> Any:
    drawn, ax = panels(1, height=3.0)
    shown = {**orbits(given), "stick-slip": ss.steady_state(stick_slip(given))}
    for (name, orbit), colour in zip(shown.items(), (BLUE, ORANGE, GREEN, PURPLE), strict=True):
        time, running = identity(orbit)
        ax.plot(time / orbit.period, running, color=colour, linewidth=1.0, label=name)
    ax.set(xlabel="time / period", ylabel="∫ (ẍ + ω²x) df, relative")
    ax.legend(ncols=4, loc="lower right", bbox_to_anchor=(1, 1))
    return drawn


@styled
def _laws(given: Given) -> Any:
    drawn, axes = panels(2, 3, height=4.8)
    for (name, orbit), column, colour in zip(orbits(given).items(), axes.T, (BLUE, ORANGE, GREEN), strict=True):
        _, motion = around(orbit)
        column[0].plot(1e6 * (motion["x"] - np.min(motion["x"])), motion["friction"], color=colour, linewidth=0.9)
        column[0].set(xlabel="displacement [µm]", xlim=(-4, 60), title=name)
        column[1].plot(1e3 * motion["v"], motion["friction"], color=colour, linewidth=0.9)
        column[1].set(xlabel="velocity [mm/s]")
    level = max(1.05 * ax.get_ylim()[1] for ax in axes.flat)
    for ax in axes.flat:
        ax.set_ylim(-level, level)
    for ax in axes[:, 0]:
        ax.set_ylabel("friction [N]")
    return drawn


@functools.lru_cache(64)
def ringing(system: ss.Oscillator) -> float:
    """Frequency of the transition oscillation [Hz], found in the last two of four cycles of simulated acceleration."""
    record = ss.simulate(system, cycles=4).record(fs=4000)
    return ss.contact.transition(record.between(2 / system.drive.frequency, record.duration)).frequency.value


def stick_slip(given: Given, *, stiffness: float = 1.0, load: float = 1.0) -> ss.Oscillator:
    """Case 2 of chapter 4 with another contact stiffness or, of hemispheres, another load; both relative."""
    told = given["stick_slip"]
    stiff = told["stiffness"] * stiffness * load ** (1 / 3)
    damping = told["critical"] * told["case2"] * math.sqrt(told["mass"] * (told["spring"] + stiff))
    law = ss.laws.CompliantContact(told["kinetic"] * load, stiffness=stiff, damping=damping)
    drive = ss.drives.HarmonicBase(told["base"] * load, frequency=told["frequency"])
    return ss.Oscillator(mass=told["mass"], stiffness=told["spring"], law=law, drive=drive)


@styled
def _ringing(given: Given) -> Any:
    told, nominal = given["stick_slip"], given["beyond"]["load"]
    steps = np.geomspace(0.9, 4.0, 5)
    fine = np.geomspace(0.5, 4.0, 200)

    def coupled(stiffness: Any) -> Any:
        return np.sqrt((told["spring"] + stiffness) / told["mass"]) / (2 * np.pi)

    drawn, axes = panels(1, 2, height=3.0)
    axes[0].plot(told["stiffness"] * fine / 1e3, coupled(told["stiffness"] * fine), color=FAINT)
    found = [ringing(stick_slip(given, stiffness=float(step))) for step in steps]
    axes[0].plot(told["stiffness"] * steps / 1e3, found, "o", color=BLUE, markersize=4)
    axes[0].set(xlabel="contact stiffness [N/mm]", ylabel="frequency [Hz]")
    axes[1].plot(nominal * fine, coupled(told["stiffness"] * fine ** (1 / 3)), color=FAINT)
    found = [ringing(stick_slip(given, load=float(step))) for step in steps]
    axes[1].plot(nominal * steps, found, "o", color=ORANGE, markersize=4)
    axes[1].set(xlabel="normal load [N]", ylim=axes[0].get_ylim())
    for ax, letter in zip(axes, "ab", strict=True):
        tag(ax, letter)
    return drawn


def dither(given: Given) -> tuple[Any, float]:
    """The smallest dither that removes the sticks of what was identified, and the frequency of its ringing [Hz]."""
    return _dither(chapter4.measured(given), stick_slip(given))


@functools.lru_cache(4)
def _dither(record: ss.Record, rig: ss.Oscillator) -> tuple[Any, float]:
    """Of the rig its mass, spring and base are known; its contact is what the record tells."""
    ringing = ss.contact.transition(record)
    ratio = ringing.damping.value
    natural = 2 * math.pi * ringing.frequency.value / math.sqrt(1 - ratio**2)
    law = ss.laws.CompliantContact(
        ss.friction_loops(record).level.value,
        stiffness=rig.mass * natural**2 - rig.stiffness,
        damping=2 * ratio * rig.mass * natural,
    )
    return ss.dither(rig.having(law=law), transition=ringing), ringing.frequency.value


def tried(given: Given, times: float) -> dict[str, tuple[float, float]]:
    """The longest stick [s] of rigs that were not identified, without the dither and with some times as much."""
    designed, _ = dither(given)
    amplitude = times * designed.amplitude.value
    return {name: _sticks(rig, amplitude, designed.frequency) for name, rig in others(given).items()}


def others(given: Given) -> dict[str, ss.Oscillator]:
    """The rig that was measured, and such as differ from it by what a contact changes from day to day: ours."""
    rig = stick_slip(given)
    law = rig.law
    rigs = {"the rig": rig}
    for name in ("stiffness", "kinetic"):
        for share, words in ((0.9, "less"), (1.1, "more")):
            rigs[f"{words} {OFTEN[name]}"] = rig.having(**{f"law.{name}": share * getattr(law, name)})
    for share, words in ((0.5, "half"), (2.0, "twice")):
        rigs[f"{words} the damping"] = rig.having(**{"law.damping": share * law.damping})
    return rigs


@functools.lru_cache(32)
def _sticks(rig: ss.Oscillator, amplitude: float, frequency: float) -> tuple[float, float]:
    dithered = rig.having(drive=ss.drives.Dithered(rig.drive, amplitude=amplitude, frequency=frequency))
    settled, whole = (laps / rig.drive.frequency for laps in LAPS)
    before, after = (longest_stick(ss.simulate(one, duration=whole), settled) for one in (rig, dithered))
    return before, after


@styled
def _dithered(given: Given) -> Any:
    designed, _ = dither(given)
    drawn, axes = panels(1, 2, height=3.2)
    rig, period = stick_slip(given), 1 / given["stick_slip"]["frequency"]
    tone = {"amplitude": designed.amplitude.value, "frequency": designed.frequency}
    dithered = rig.having(drive=ss.drives.Dithered(rig.drive, **tone))
    for system, label, colour in ((rig, "without", FAINT), (dithered, "with dither", BLUE)):
        run = ss.simulate(system, duration=12 * period)
        time, motion = exact(run, first=11 * period, last=12 * period, names=("v",))
        axes[0].plot(time - time[0], 1e3 * motion["v"], color=colour, linewidth=0.9, label=label)
    axes[0].set(xlabel="time [s]", ylabel="velocity [mm/s]")
    axes[0].legend(loc="lower right", bbox_to_anchor=(1, 1), ncols=2)
    rows = {times: tried(given, times) for times in (1.0, STRONGER)}
    for place, name in enumerate(rows[1.0]):
        axes[1].plot(1e3 * rows[1.0][name][0], place, "o", color=FAINT, markersize=5)
        axes[1].plot(1e3 * rows[1.0][name][1], place, "o", color=BLUE, markersize=5)
        axes[1].plot(1e3 * rows[STRONGER][name][1], place, "|", color=INK, markersize=8)
    axes[1].axvline(1e3 / designed.frequency, color=INK, linestyle=":", linewidth=0.9)
    axes[1].set(xlabel="longest stick [ms]", xscale="log", xticks=[3, 5, 10, 20, 50])
    axes[1].minorticks_off()
    axes[1].xaxis.set_major_formatter("{x:g}")
    axes[1].set_yticks(range(len(rows[1.0])), list(rows[1.0]))
    axes[1].invert_yaxis()
    for ax, letter in zip(axes, "ab", strict=True):
        tag(ax, letter)
    return drawn
