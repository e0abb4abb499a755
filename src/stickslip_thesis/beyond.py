"""Section 8.2, future studies: other laws in the compliant contact, what the ringing depends on, and dither; then
materials, micro-slips and their sound, and a lag behind the contact."""

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
from stickslip_thesis import chapter3, chapter4
from stickslip_thesis.drawing import around, exact, figure, panels, tag
from stickslip_thesis.printed import Given, Ours

Array = NDArray[np.float64]

TITLE = "Beyond the thesis: what section 8.2 leaves for future studies"
STRONGER = 1.1  # times the smallest dither
LAPS = (16, 40)  # cycles of the slow motion: let pass, and in all, as the search for a dither has them
OFTEN = {"stiffness": "stiffness", "kinetic": "friction"}  # what a contact changes by a tenth
STARTS_FROM = ("beyond", "stick_slip", "sliding")  # sections of given.toml
PAIRS = ("steel on steel", "aluminium on steel", "Teflon on steel", "rubber on steel")
GEOMETRIES = {"flat": 0.0, "sphere": 1 / 3, "rough": 1.0}  # power of the load with which the contact stiffens
LOADS, RATIOS = np.geomspace(0.5, 4.0, 13), np.geomspace(0.008, 0.08, 11)
CYCLES = 16  # of the slow motion, of which the last two are heard: what is left of the start is below 1e-4 then
AUDIBLE = 100.0  # Hz: below it is the motion itself


def numbers(given: Given) -> Ours:
    """None is printed."""
    return {}


def plates(given: Given) -> Iterator[Plate]:
    """Figures of ours."""
    section = given["beyond"]
    yield figure(
        "laws",
        _laws(given),
        f"The contact of 8.7 Hz with friction that falls by {section['fall']:g} N with the sliding speed (Stribeck), "
        f"and with friction that follows its level late (state variable, {section['lag']:g} s). Falling friction "
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
    yield from _in_the_small(given)


def _in_the_small(given: Given) -> Iterator[Plate]:
    """Materials, micro-slips and their sound, and a lag behind the contact."""
    section = given["beyond"]
    steel = ring(given, ss.laws.pair("steel on steel").stiffness(section["load"], radius=section["radius"]))
    yield figure(
        "materials",
        _materials(given),
        f"A sphere of {1e3 * section['radius']:g} mm under {section['load']:g} N, of four materials on steel: (a) "
        "friction from rest, over sliding friction, as the contact slips from its rim inwards (Mindlin); it is nowhere "
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
        f"What is heard {1e3 * section['distance']:g} mm from the mass, above {AUDIBLE:g} Hz: {loud:.0f} dB with two "
        f"micro-slips in each stick (case 2), {silent:.0f} dB with none (case 1). Each micro-slip ends in an impulse "
        "of its own, between those of the stick's beginning and its end. Of so heavy and slow a mass nobody would "
        "hear either.",
        title="Micro-slips as a source of noise",
    )
    yield figure(
        "delay",
        _delay(given),
        f"Friction that falls by {section['fall']:g} N with the speed and answers it {1e3 * section['delay']:g} ms "
        "late (Hess and Soom), behind the contact's spring. The contact has a mass here, as in section 4.5, of "
        f"{1e3 * section['slider']:g} g, and the motion at 8.7 Hz is imposed: without a mass, its own speed would be "
        "no state from which a lag can be recalled, and that is refused.",
        title="A lag behind the contact's spring",
    )


def behind_the_spring(given: Given) -> dict[str, Any]:
    """The contact of 8.7 Hz with Coulomb friction, Stribeck friction and memory."""
    section, contact = given["beyond"], chapter3.contact(given, 1)
    speed = np.linspace(0, 20 * section["speed"], 201)
    falling = contact.kinetic + section["fall"] * np.exp(-((speed / section["speed"]) ** 2))
    spring = {"stiffness": contact.stiffness}
    return {
        "Coulomb": contact,
        "Stribeck": ss.laws.InSeries(ss.laws.Tabulated(speed, falling), damping=section["damping"], **spring),
        "state variable": ss.laws.InSeries(
            ss.laws.StateVariable(contact.kinetic, rate=1 / section["lag"]), damping=contact.damping, **spring
        ),
    }


def orbits(given: Given) -> dict[str, ss.solve.SteadyState]:
    """The steady motion at 8.7 Hz with each of them."""
    section = given["sliding"]
    drive = ss.drives.HarmonicBase(chapter3.base_for(given, 1), frequency=section["frequency"][1])
    return {
        name: _orbit(section["mass"], section["spring"], law, drive) for name, law in behind_the_spring(given).items()
    }


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


def stick_slip(
    given: Given, case: str | float = "case2", *, stiffness: float = 1.0, load: float = 1.0, stiffening: float = 1 / 3
) -> ss.Oscillator:
    """A case of chapter 4, or one of another damping ratio, with relative contact stiffness and load.

    The contact stiffens with the load by a power: that of hemispheres unless another is given.
    """
    section = given["stick_slip"]
    ratio = section[case] if isinstance(case, str) else case
    stiff = section["stiffness"] * stiffness * load**stiffening
    damping = section["critical"] * ratio * math.sqrt(section["mass"] * (section["spring"] + stiff))
    law = ss.laws.CompliantContact(section["kinetic"] * load, stiffness=stiff, damping=damping)
    drive = ss.drives.HarmonicBase(section["base"] * load, frequency=section["frequency"])
    return ss.Oscillator(mass=section["mass"], stiffness=section["spring"], law=law, drive=drive)


@styled
def _ringing(given: Given) -> Any:
    section, nominal = given["stick_slip"], given["beyond"]["load"]
    steps = np.geomspace(0.9, 4.0, 5)
    fine = np.geomspace(0.5, 4.0, 200)

    def coupled(stiffness: Any) -> Any:
        return np.sqrt((section["spring"] + stiffness) / section["mass"]) / (2 * np.pi)

    drawn, axes = panels(1, 2, height=3.0)
    axes[0].plot(section["stiffness"] * fine / 1e3, coupled(section["stiffness"] * fine), color=FAINT)
    frequencies = [ringing(stick_slip(given, stiffness=float(step))) for step in steps]
    axes[0].plot(section["stiffness"] * steps / 1e3, frequencies, "o", color=BLUE, markersize=4)
    axes[0].set(xlabel="contact stiffness [N/mm]", ylabel="frequency [Hz]")
    axes[1].plot(nominal * fine, coupled(section["stiffness"] * fine ** (1 / 3)), color=FAINT)
    frequencies = [ringing(stick_slip(given, load=float(step))) for step in steps]
    axes[1].plot(nominal * steps, frequencies, "o", color=ORANGE, markersize=4)
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


def sound(given: Given, case: str) -> ss.Record:
    """What is heard of two settled cycles of a case of chapter 4, its face a disk in a wall."""
    section = given["beyond"]
    system = stick_slip(given, case)
    return _heard(system, section["face"], section["distance"])


@functools.lru_cache(4)
def _heard(system: ss.Oscillator, area: float, distance: float) -> ss.Record:
    run = ss.simulate(system, cycles=CYCLES)
    heard = ss.squeak.sound_pressure(run, fs=1e4, area=area, distance=distance, normal=[1.0], baffled=True)
    return heard.between((CYCLES - 2) / system.drive.frequency, CYCLES / system.drive.frequency)


@styled
def _materials(given: Given) -> Any:
    section = given["beyond"]
    drawn, axes = panels(1, 2, height=3.0)
    loads = np.geomspace(0.3, 30.0, 40)
    for name, colour in zip(PAIRS, (BLUE, GREEN, ORANGE, PURPLE), strict=True):
        pair = ss.laws.pair(name)
        law = pair.sphere(section["load"], radius=section["radius"], elements=60)
        springs, forces = np.array(law.stiffnesses), np.array(law.forces)
        way = np.geomspace(1e-3, 2.0, 200) * np.max(forces / springs)
        friction = np.minimum(np.outer(way, springs), forces).sum(axis=1)
        axes[0].plot(1e6 * way, friction / np.sum(forces), color=colour, label=name)
        stiffness = np.array([pair.stiffness(float(load), radius=section["radius"]) for load in loads])
        axes[1].plot(loads, ring(given, stiffness), color=colour)
    axes[1].plot([section["load"]], [ring(given, given["stick_slip"]["stiffness"])], "o", color=INK, markersize=4)
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
                chapter4.micro_slips(
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
    section, sliding = given["beyond"], given["sliding"]
    reach, frequency = sliding["amplitude"][1], sliding["frequency"][1]
    run = _delayed(
        chapter3.contact(given, 1), section["slider"], section["fall"], section["speed"], lag, reach, frequency
    )
    times = np.linspace(1.0, 2.0, 4000) / frequency
    own, friction = run.sample(times, ("a", "friction"))[0]
    rate = 2 * math.pi * frequency
    return {
        "x": reach * np.cos(rate * times),
        "v": -rate * reach * np.sin(rate * times),
        "a": -(rate**2) * reach * np.cos(rate * times),
        "friction": friction + section["slider"] * own,
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
