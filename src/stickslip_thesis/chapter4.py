"""Chapter 4: the same contact where it sticks, and laws with a memory.

The thesis gives the damping of the contact as a ratio and not of what, and no friction for the motion at 2.5 Hz; it
prints two micro-slips in each sticking interval at the smaller ratio and none at the larger one (sections 4.3, 5.3). A
`Reading` is what the ratio may be of; the chapters start from the one that gives these numbers.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

import stickslip as ss
from stickslip.figures.style import BLUE, FAINT, GREEN, INK, ORANGE, PURPLE, Plate, styled
from stickslip_thesis.chapter3 import on_rig, steady
from stickslip_thesis.drawing import around, characteristics, contact_with_inertia, figure, panels, responses, tag
from stickslip_thesis.printed import Given, Ours

Array = NDArray[np.float64]

TITLE = "The same contact where it sticks, and laws with a memory"
STARTS_FROM = ("stick_slip", "state_variable", "inertial")  # sections of given.toml
FRICTIONS = tuple(float(level) for level in np.round(np.arange(1.06, 1.33, 0.02), 2))  # N: from Table 3.2's least on
LARGEST = 1.28  # N: Table 3.2's
STIFFNESSES = (181e3, 192e3, 201e3)  # N/m: the least, the mean and the largest of Table 3.1
COUNTS = (0, 2)  # micro-slips printed for case 1 and case 2


def numbers(given: Given) -> Ours:
    """The chapter's numbers."""
    section, inertial = given["stick_slip"], given["inertial"]
    time, _, friction = free_vibration(given)
    orbits = [inertial_contact(given, case) for case in (0, 1)]
    return {
        "coupled frequency": math.sqrt((section["spring"] + section["stiffness"]) / section["mass"]) / (2 * math.pi),
        "free frequency": strongest(time, friction),
        "bases of stick-slip": [1e3 * section["base"], 1e3 * given["state_variable"]["base"][0], math.nan],
        "base of the state variable": [base_of_state_variable(given, case) for case in (1, 2)],
        "micro-slips": [micro_slips(stick_slip(given, section[name])) for name in ("case1", "case2")],
        "abnormal stops": orbits[0].stops[1] / 2,
        "static deflection": inertial["kinetic"] / inertial["stiffness"],
    }


def plates(given: Given) -> Iterator[Plate]:
    """The chapter's figures."""
    yield from _experiments(given)
    section = given["stick_slip"]
    for time, loops, name in (("4.4", "4.5", "case1"), ("4.6", "4.7", "case2")):
        orbit = stick_slip(given, section[name])
        slips = micro_slips(orbit)
        words = (
            f"Steady motion, exactly solved, of damping ratio {section[name]} and f_k = {section['kinetic']:g} N, "
            f"read as c = {section['critical']:g} ζ √(m (k + K_y)): in each sticking interval the contact slips "
            f"{slips or 'no'} time{'s' * (slips != 1)}{', and the ringing dies away' * (slips == 0)}."
        )
        yield figure(time, responses(*around(orbit, cycles=2)), words)
        yield figure(
            loops,
            characteristics(around(orbit)[1], way=3e-5, speed=1e-2),
            "The loops in (c) are the transition oscillation; where they touch the friction's level the contact slips.",
        )
    yield figure(
        "micro-slips",
        _readings(given),
        "Not in the thesis: micro-slips in each sticking interval of case 1 (.0558) and case 2 (.0174), one before the "
        "other, by what the damping ratio is of, the contact's stiffness (Table 3.1's least, mean and largest) and the "
        "friction, which is not printed (shaded: Table 3.2's range). Bold: none and two, as printed.",
        title="Which reading gives the printed micro-slips",
    )
    for case, (time, loops) in enumerate((("4.8", "4.9"), ("4.10", "4.11"), ("4.12", "4.13"))):
        orbit = state_variable(given, case)
        yield figure(
            time,
            responses(*around(orbit, cycles=2)),
            f"By the curved solver, with the f_k that equation 4.2's backbone lacks: the mass moves "
            f"{1e3 * orbit.amplitude:.3f} mm.",
        )
        yield figure(
            loops,
            characteristics(around(orbit)[1], way=1.5e-4, speed=2e-2),
            "Friction follows the backbone late: it never sticks.",
        )
    yield from _inertial(given)


@dataclass(frozen=True)
class Reading:
    """What a damping ratio may be of: ``c = factor ζ sqrt(m s)``, s the spring, with the contact's or without."""

    factor: float
    coupled: bool

    @property
    def formula(self) -> str:
        """As the page writes it."""
        return f"{self.factor:g}ζ√(m{'(k + K_y)' if self.coupled else 'k'})"

    def damping(self, ratio: float, *, mass: float, spring: float, stiffness: float) -> float:
        """The contact's damping [N s/m]."""
        return self.factor * ratio * math.sqrt(mass * (spring + stiffness * self.coupled))


READINGS = tuple(Reading(factor, coupled) for factor in (2.0, 4.0) for coupled in (False, True))


def damping(given: Given, ratio: float) -> float:
    """The contact's damping under the reading from which the chapters start [N s/m]."""
    section = given["stick_slip"]
    reading = Reading(section["critical"], coupled=True)
    return reading.damping(ratio, mass=section["mass"], spring=section["spring"], stiffness=section["stiffness"])


def micro_slips(orbit: ss.solve.SteadyState) -> int:
    """Slips within a macroscopic sticking interval: one less than its microsticks, of which a cycle has two sets."""
    return orbit.orbit.event_counts()["microstick"] // 2 - 1


def counts(section: Mapping[str, Any], reading: Reading, *, stiffness: float, kinetic: float) -> tuple[int, int]:
    """Micro-slips in case 1 and case 2 under a reading."""
    mass, spring = section["mass"], section["spring"]

    def slips(ratio: float) -> int:
        damping = reading.damping(ratio, mass=mass, spring=spring, stiffness=stiffness)
        law = ss.laws.CompliantContact(kinetic, stiffness=stiffness, damping=damping)
        return micro_slips(steady(mass, spring, law, section["base"], section["frequency"]))

    return slips(section["case1"]), slips(section["case2"])


@styled
def _readings(given: Given) -> Any:
    """Counts of both cases against friction, for each reading and contact stiffness."""
    section = given["stick_slip"]
    rows = [(reading, stiffness) for reading in READINGS for stiffness in STIFFNESSES]
    sheet, ax = panels(1, height=4.4)
    ax.axvspan(FRICTIONS[0], LARGEST, color=FAINT, alpha=0.25, linewidth=0)
    for place, (reading, stiffness) in enumerate(rows):
        for kinetic in FRICTIONS:
            pair = counts(section, reading, stiffness=stiffness, kinetic=kinetic)
            as_printed = pair == COUNTS
            ax.text(
                kinetic,
                place,
                f"{pair[0]}·{pair[1]}",
                ha="center",
                va="center",
                fontsize=7,
                color=BLUE if as_printed else INK,
                fontweight="bold" if as_printed else "normal",
            )
        label = f"{reading.formula}, {stiffness / 1e3:g} kN/m"
        ax.text(FRICTIONS[0] - 0.02, place, label, ha="right", va="center", fontsize=7)
    ax.set(xlabel="friction f_k [N]", xlim=(FRICTIONS[0] - 0.12, FRICTIONS[-1] + 0.02), ylim=(len(rows) - 0.4, -0.6))
    ax.set(yticks=[], xticks=[1.06, 1.1, 1.15, 1.2, 1.25, 1.3])
    ax.grid(visible=False)
    return sheet


def stick_slip(given: Given, ratio: float) -> ss.solve.SteadyState:
    """The motion of section 4.3 with a damping ratio in the contact."""
    section = given["stick_slip"]
    return steady(section["mass"], section["spring"], _contact(given, ratio), section["base"], section["frequency"])


def _contact(given: Given, ratio: float) -> ss.laws.CompliantContact:
    section = given["stick_slip"]
    return ss.laws.CompliantContact(section["kinetic"], stiffness=section["stiffness"], damping=damping(given, ratio))


def state_variable(given: Given, case: int, *, base: float | None = None) -> ss.solve.SteadyState:
    """The motion of section 4.4 at 2.5, 5.61 or 8.7 Hz."""
    section, slider = given["state_variable"], given["stick_slip"]
    law = ss.laws.SmoothStateVariable(section["kinetic"][case], rate=section["rate"], steepness=section["steepness"])
    base = section["base"][case] if base is None else base
    return steady(slider["mass"], slider["spring"], law, base, section["frequency"][case])


def base_of_state_variable(given: Given, case: int) -> float | None:
    """The base amplitude [mm] under which the state-variable model moves as far as the experiment of Table 3.2.

    None where the motion jumps from less to more as the base moves farther.
    """
    wanted = given["sliding"]["amplitude"][case - 1]

    def excess(base: float) -> float:
        return state_variable(given, case, base=base).amplitude - wanted

    most = given["state_variable"]["base"][case]
    root = float(brentq(excess, 0.7 * most, most, xtol=1e-7))
    return 1e3 * root if abs(excess(root)) < 0.01 * wanted else None


@functools.lru_cache(8)
def _released(mass: float, spring: float, law: Any, release: float) -> ss.solve.Trajectory:
    return ss.simulate(ss.Oscillator(mass=mass, stiffness=spring, law=law), start={"x": release}, duration=1.2)


@functools.lru_cache(8)
def _free(*released: Any) -> ss.Record:
    return ss.Rig().measure(_released(*released), fs=4000, rng=3)


def turns_of_release(given: Given) -> list[float]:
    """Where [m] the released mass turns: the release, and where each microstick begins."""
    section = given["stick_slip"]
    run = _released(section["mass"], section["spring"], _contact(given, section["case2"]), section["release"])
    return [section["release"], *(piece.state["x"] for piece in run.pieces if piece.mode == "microstuck")]


def free_vibration(given: Given) -> tuple[Array, Array, Array]:
    """Figure 4.2: time, smoothed acceleration and friction as the load cell feels it, of a released mass."""
    section = given["stick_slip"]
    record = _free(section["mass"], section["spring"], _contact(given, section["case2"]), section["release"])
    smooth = np.convolve(record["a"], np.full(5, 0.2), mode="same")
    return record.time, smooth, record["load"]


def strongest(time: Array, friction: Array) -> float:
    """Frequency of the strongest line between 20 and 200 Hz in the ringing after the last reversal [Hz]."""
    frequency, power = _spectrum(time, friction)
    band = (frequency > 20) & (frequency < 200)
    return float(frequency[band][np.argmax(power[band])])


def _spectrum(time: Array, values: Array) -> tuple[Array, Array]:
    """Power over frequency, of the second half of the record."""
    part = values[len(values) // 4 :]
    window = np.hanning(2 * len(part))[len(part) :]  # from the largest ringing on
    size = 1 << 17
    power = np.abs(np.fft.rfft((part - np.mean(part)) * window, size)) ** 2
    return np.fft.rfftfreq(size, time[1] - time[0]), power / np.max(power)


def measured(given: Given) -> ss.Record:
    """What the virtual rig makes of case 2: two seconds, with friction."""
    section = given["stick_slip"]
    return on_rig(
        section["mass"], section["spring"], _contact(given, section["case2"]), section["base"], section["frequency"]
    )


def _experiments(given: Given) -> Iterator[Plate]:
    """Figures 4.1 to 4.3."""
    record, words = measured(given), "The virtual rig of chapter 2, on the contact of case 2."
    v = ss.signals.differentiate(record["x"], record.fs, method="five-point").values
    motion = {"x": record["x"], "v": v, "a": record["a"], "friction": record["friction"]}
    part = slice(0, round(record.fs))
    yield figure("4.1", responses(record.time[part], {name: values[part] for name, values in motion.items()}), words)
    yield figure(
        "4.2",
        _free_vibration(given),
        "The virtual rig: a mass let go reverses twice and sticks. Its friction rings at "
        f"{strongest(*free_vibration(given)[::2]):.1f} Hz, the coupled frequency of the contact.",
    )
    motion["v"] = record["v"]
    yield figure("4.3", characteristics(motion, way=4e-5, speed=1.2e-2), words)


@styled
def _free_vibration(given: Given) -> Any:
    time, acceleration, friction = free_vibration(given)
    drawn, axes = panels(3, height=5.4)
    axes[0].plot(time, friction, color=ORANGE, linewidth=0.8)
    axes[0].set(xlabel="time [s]", ylabel="friction [N]", xlim=(0, 0.8))
    axes[1].plot(time, acceleration, color=PURPLE, linewidth=0.8)
    axes[1].set(xlabel="time [s]", ylabel="acceleration [m/s²]", xlim=(0, 0.8))
    frequency, power = _spectrum(time, friction)
    shown = frequency < 120
    axes[2].plot(frequency[shown], 10 * np.log10(power[shown]), color=INK, linewidth=0.9)
    axes[2].set(xlabel="frequency [Hz]", ylabel="power [dB]", ylim=(-60, 3))
    for ax, letter in zip(axes, "abc", strict=True):
        tag(ax, letter)
    return drawn


def inertial_contact(given: Given, case: int) -> ss.solve.SteadyState:
    """z of equation 4.7 at its steady state, with the friction's sign set-valued at rest."""
    section = given["inertial"]
    alpha = section["amplitude"][case] * section["stiffness"] / section["kinetic"] * (section["ratio"] ** 2 - 1)
    return _normalised(alpha, section["ratio"])


@functools.lru_cache(8)
def _normalised(alpha: float, ratio: float) -> ss.solve.SteadyState:
    drive = ss.drives.HarmonicForce(abs(alpha), ratio / (2 * math.pi), phase=math.pi * (alpha < 0))
    return ss.steady_state(ss.Oscillator(mass=1, stiffness=1, law=ss.laws.Coulomb(1.0), drive=drive))


def of_contact(given: Given, case: int, *, cycles: int = 1) -> tuple[Array, dict[str, Array]]:
    """tau, and z, z', y, y' (of the contact: y = z f_k/k + X_m cos Omega tau)."""
    section = given["inertial"]
    tau, motion = around(inertial_contact(given, case), cycles=cycles, names=("x", "v"))
    give, ratio, amplitude = section["kinetic"] / section["stiffness"], section["ratio"], section["amplitude"][case]
    y = give * motion["x"] + amplitude * np.cos(ratio * tau)
    return tau, {
        "z": motion["x"],
        "z'": motion["v"],
        "y": y,
        "y'": give * motion["v"] - amplitude * ratio * np.sin(ratio * tau),
    }


def _inertial(given: Given) -> Iterator[Plate]:
    """Figures 4.14 to 4.19."""
    yield figure("4.14", contact_with_inertia(given), "Drawn from the parameters of section 4.5, which have no units.")
    for number, case in (("4.15", 0), ("4.16", 1)):
        orbit = inertial_contact(given, case)
        normal, abnormal = orbit.stops
        yield figure(
            number,
            _inertial_motion(given, case),
            f"Equation 4.7 by the exact solver, friction set-valued at rest: Z_0 = {orbit.amplitude:.4f}, and in each "
            f"half cycle {normal // 2} normal and {abnormal // 2} abnormal stops.",
        )
    yield figure("4.17", _boundaries(given), "The boundaries of equations 4.9 and of y' = -X_m Ω sin Ωτ.")
    yield figure(
        "4.18",
        _portraits(given, 0),
        "Stops are marked in (a): of A, B and C in the text two are stops, at the third z' "
        "comes down to its least and does not reach zero.",
    )
    yield figure("4.19", _portraits(given, 1), "Stops are marked in (a).")


@styled
def _inertial_motion(given: Given, case: int) -> Any:
    tau, motion = of_contact(given, case, cycles=2)
    drawn, axes = panels(2, 2, height=4.4)
    for ax, letter, (name, values), colour in zip(
        axes.flat, "abcd", motion.items(), (BLUE, GREEN, BLUE, GREEN), strict=True
    ):
        ax.plot(tau, values, color=colour, linewidth=0.9)
        ax.set_ylabel(name)
        tag(ax, letter)
    for ax in axes[1]:
        ax.set_xlabel("τ")
    return drawn


@styled
def _boundaries(given: Given) -> Any:
    """Figure 4.17: the macroscopic sticking boundary and the microscopic one, case 2."""
    section, orbit = given["inertial"], inertial_contact(given, 1)
    tau, motion = of_contact(given, 1)
    imposed = section["amplitude"][1] * np.cos(section["ratio"] * tau)
    drawn, axes = panels(2, height=5.0)
    for side in (-1, 1):
        axes[0].plot(
            tau,
            side * orbit.amplitude * section["kinetic"] / section["stiffness"] + imposed,
            color=ORANGE,
            linestyle="--",
            linewidth=0.9,
            label="boundary" if side > 0 else None,
        )
    axes[0].plot(tau, motion["y"], color=BLUE, linewidth=1.0, label="y")
    axes[0].set(xlabel="τ", ylabel="y")
    slope = -section["amplitude"][1] * section["ratio"] * np.sin(section["ratio"] * tau)
    axes[1].plot(tau, slope, color=ORANGE, linestyle="--", linewidth=0.9, label="boundary")
    axes[1].plot(tau, motion["y'"], color=BLUE, linewidth=1.0, label="y'")
    axes[1].set(xlabel="τ", ylabel="y'")
    for ax, letter in zip(axes, "ab", strict=True):
        tag(ax, letter)
        ax.legend(loc="lower right", bbox_to_anchor=(1, 1), ncols=2)
    return drawn


@styled
def _portraits(given: Given, case: int) -> Any:
    _, motion = of_contact(given, case)
    orbit = inertial_contact(given, case)
    drawn, axes = panels(1, 2, height=3.2)
    axes[0].plot(motion["z"], motion["z'"], color=BLUE, linewidth=0.9)
    stops = [piece.state["x"] for piece in orbit.orbit.pieces if piece.mode == "stuck"]
    axes[0].plot(stops, np.zeros(len(stops)), "o", color=ORANGE, markersize=4)
    axes[0].set(xlabel="z", ylabel="z'")
    axes[1].plot(motion["y"], motion["y'"], color=BLUE, linewidth=0.9)
    axes[1].set(xlabel="y", ylabel="y'")
    for ax, letter in zip(axes, "ab", strict=True):
        tag(ax, letter)
    return drawn
