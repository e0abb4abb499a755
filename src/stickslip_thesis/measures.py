"""What the text says that one should see, and whether our figures show it, by numbers measured on what they draw."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

import stickslip as ss
from stickslip_thesis import chapter2, chapter3, chapter4, chapter5, chapter6, chapter7
from stickslip_thesis.drawing import around
from stickslip_thesis.printed import Given, Ours, read

Array = NDArray[np.float64]

INNER = slice(400, -400)  # a tenth of a second at either end, where the delayed reading has no samples
SLIDING, STICKING = (0, 1, 2), 3  # cases of section 2.4
MOST_TOLD = 6  # numbers that are told one by one


@dataclass(frozen=True)
class Observation:
    """One thing to see.

    Attributes
    ----------
    chapter, section : str
        Where the text says it.
    figures : tuple of str
        In which figures; none where it is not drawn.
    says : str
        What is to be seen, in our words.
    measure : str
        Its name among the measures of its chapter: a number or several.
    above, below : float
        Between which all of them have to lie.
    why : str
        Why ours does not show it; empty where it has to.
    """

    chapter: str
    section: str
    figures: tuple[str, ...]
    says: str
    measure: str
    above: float = -np.inf
    below: float = np.inf
    why: str = ""

    def shown(self, values: Sequence[float]) -> bool:
        """Do all of its numbers lie where they should?

        Examples
        --------
        >>> Observation("2", "2.3", ("2.3",), "what is left is noise", "left", -np.inf, 0.1, "").shown([0.02, 0.05])
        True
        """
        return all(self.above < value < self.below for value in values)


@dataclass(frozen=True)
class Seen:
    """An observation with its numbers."""

    observation: Observation
    values: tuple[float, ...]

    @property
    def shown(self) -> bool:
        """Whether ours shows it."""
        return self.observation.shown(self.values)

    @property
    def text(self) -> str:
        """The numbers and what they should be.

        Examples
        --------
        >>> Seen(Observation("2", "2.3", (), "what is left is noise", "left", -np.inf, 0.1, ""), (0.0213,)).text
        'left: 0.0213, below 0.1'
        """
        bounds = [("above", self.observation.above), ("below", self.observation.below)]
        wanted = " and ".join(f"{word} {bound:g}" for word, bound in bounds if np.isfinite(bound))
        numbers = ", ".join(f"{value:.3g}" for value in self.values)
        if len(self.values) > MOST_TOLD:
            numbers = f"{min(self.values):.3g} to {max(self.values):.3g}"
        return f"{self.observation.measure}: {numbers}, {wanted}"


@functools.cache
def observations() -> tuple[Observation, ...]:
    """All of them, in the order of the text."""
    return tuple(
        Observation(entry["section"].partition(".")[0], **{**entry, "figures": tuple(entry.get("figures", ()))})
        for entry in read("observations.toml")["observation"]
    )


def seen(chapter: str, given: Given) -> tuple[Seen, ...]:
    """The observations of a chapter, measured on what its figures show."""
    own = [one for one in observations() if one.chapter == chapter]
    if not own:
        return ()
    values = MEASURES[chapter](given)
    return tuple(Seen(one, tuple(float(value) for value in np.atleast_1d(values[one.measure]))) for one in own)


def of_chapter_2(given: Given) -> Ours:
    """Of the air track, the sensors, and both frictions."""
    free = chapter2.free_vibration(given)
    half = free.duration / 2
    damping = [
        ss.decay.log_decrement(part).damping_ratio.value
        for part in (free.between(half, free.duration), free.between(0, half))
    ]
    left = chapter2.resultant(given, free)[INNER]
    forced = [chapter2.forced(given, case) for case in range(3)]
    records = [chapter2.rubbing(given, case) for case in range(4)]
    both = [chapter2.both(given, record) for record in records]
    lines = {f"{frequency} Hz": frequency for frequency in (47, 125, 250)}
    struck = chapter2.impact(given)
    return {
        "late damping over early": damping[0] / damping[1],
        "resultant over spring force": np.std(left) / np.std(chapter2.forces(given, free)["spring"]),
        "averaged resultant over raw": np.std(np.convolve(left, np.full(5, 0.2), "valid")) / np.std(left),
        "resultant over inertial force": [
            np.std(chapter2.resultant(given, one)[INNER]) / np.std(chapter2.forces(given, one)["inertia"])
            for one in forced
        ],
        "level by cell over level computed": [np.median(np.abs(f2)) / np.median(np.abs(f1)) for _, f1, f2 in both],
        "half of the record over the other": [_steady(both[case][2]) for case in SLIDING],
        "F2 over F1, 60 to 177 Hz": [chapter2.transients(given, record, chapter2.HEARD) for record in records],
        "F2 over F1, 60 to 1900 Hz": [chapter2.transients(given, record, (60.0, 1900.0)) for record in records],
        "F2 over F1, 180 to 400 Hz": [chapter2.transients(given, record, chapter2.CELL_BAND) for record in records],
        "strongest transient of F1 [Hz]": [strongest(both[case][1], 4000.0, (60.0, 400.0)) for case in SLIDING],
        "averaging, of F2 over of F": [_averaged(given, record) for record in records],
        "share of sticks": ss.find_sticks(chapter2.balanced(given, STICKING)).share.value,
        "share of sticks while sliding": [
            ss.find_sticks(chapter2.balanced(given, case)).share.value for case in SLIDING
        ],
        "transition oscillation [Hz]": strongest(both[STICKING][2], 4000.0, (25.0, 80.0)),
        **{f"acceleration: {name} over its sides [dB]": _over_sides(struck, "a", f) for name, f in lines.items()},
        "force: 47 Hz over its sides [dB]": _over_sides(struck, "load", 47.0),
    }


def _steady(friction: Array) -> float:
    first, second = np.array_split(np.abs(friction[INNER]), 2)
    return float(np.median(first) / np.median(second))


def _averaged(given: Given, record: ss.Record) -> float:
    """What the five-point average takes from the cell's friction, over what it takes from the computed one."""
    computed, smooth, felt_smooth = chapter2.both(given, record)
    felt = record["load"] - float(record.channels["load"].inertia) * record["a"]
    return float(np.std((felt - felt_smooth)[INNER]) / np.std((computed - smooth)[INNER]))


def strongest(values: Array, fs: float, band: tuple[float, float]) -> float:
    """The strongest line of a signal in a band [Hz]."""
    frequency, level = _spectrum(values[INNER], fs)
    inside = (frequency > band[0]) & (frequency < band[1])
    return float(frequency[inside][np.argmax(level[inside])])


def _spectrum(values: Array, fs: float) -> tuple[Array, Array]:
    """Frequencies [Hz] and level [dB]."""
    size = 1 << max(14, (len(values) - 1).bit_length())
    power = np.abs(np.fft.rfft((values - np.mean(values)) * np.hanning(len(values)), size)) ** 2
    return np.fft.rfftfreq(size, 1 / fs), 10 * np.log10(power + np.finfo(float).tiny)


def _over_sides(record: ss.Record, name: str, frequency: float) -> float:
    """How far [dB] a line of what rings after the tap stands over the louder of its two sides, a sixth away."""
    values = record[name][record.time > 0.1]
    power = np.abs(np.fft.rfft(values - np.mean(values), 1 << 14)) ** 2
    f = np.fft.rfftfreq(1 << 14, 1 / record.fs)

    def level(centre: float, width: float) -> float:
        return 10 * math.log10(float(np.mean(power[np.abs(f - centre) < width * frequency])))

    return level(frequency, 0.03) - max(level(frequency * (1 + side), 0.03) for side in (-1 / 6, 1 / 6))


def of_chapter_3(given: Given) -> Ours:
    """Of the compliant contact in sliding."""
    section, soft = given["sliding"], given["schematic"]
    orbits = [chapter3.sliding(given, case) for case in chapter3.CASES]
    slopes = [float(np.mean(chapter3.slopes_of_sticks(chapter3.measured(given, case)))) for case in chapter3.CASES]
    read = [
        float(np.mean(ss.contact.transition_speed(chapter3.measured(given, case)).turns)) for case in chapter3.CASES
    ]
    simulated = [orbit.transition_speed for orbit in orbits]
    _, ideal = chapter3.imposed(ss.laws.CompliantContact(1.0, stiffness=soft["stiffness"]))
    _, over = chapter3.imposed(ss.laws.CompliantContact(1.0, stiffness=soft["stiffness"], static=soft["static"]))
    begins = np.abs(ideal["v"][1:])[np.diff(ideal["sliding"].astype(int)) > 0]
    give = 1 / soft["stiffness"]
    harmonics = chapter3.harmonics(given)
    return {
        "V_s over equation 3.4, imposed": begins / (2 * math.sqrt(give - give**2)),
        "slope over K_y": _slope(ideal) / soft["stiffness"],
        "peak over sliding friction": np.max(np.abs(over["friction"])),
        "harmonics over the fundamental, power": sum(1 / harmonics.ratio(n) ** 2 for n in (2, 3, 4, 5)),
        "spread of the slopes": (max(slopes) - min(slopes)) / float(np.mean(slopes)),
        "V_s read off over equation 3.4": [v / chapter3.equation_3_4(section, case) for case, v in enumerate(read)],
        "V_s read off, over that at the next lower frequency": [b / a for a, b in pairwise(read)],
        "V_s simulated, over that at the next lower frequency": [b / a for a, b in pairwise(simulated)],
        "V_s simulated over equation 3.4": [_over_equation(section, case, orbit) for case, orbit in enumerate(orbits)],
        "rise by the contact's damping up to V_s, over the whole": [
            chapter3.contact(given, case).damping * orbit.transition_speed / (2 * section["kinetic"][case])
            for case, orbit in enumerate(orbits)
        ],
        "friction at the largest speed over its peak": _fall(chapter3.stribeck_behind_a_spring(soft)[2]),
    }  # fmt: skip


def _slope(motion: dict[str, Array]) -> float:
    stuck = ~motion["sliding"][1:] & ~motion["sliding"][:-1]
    return float(np.median(np.diff(motion["friction"])[stuck] / np.diff(motion["x"])[stuck]))


def _fall(motion: dict[str, Array]) -> float:
    return float(motion["friction"][np.argmax(motion["v"])] / np.max(motion["friction"]))


def _over_equation(section: Any, case: int, orbit: ss.solve.SteadyState) -> float:
    """By the simulated amplitude, as equation 3.4 has it."""
    give = section["kinetic"][case] / section["stiffness"][case]
    return orbit.transition_speed / (
        4 * math.pi * section["frequency"][case] * math.sqrt(orbit.amplitude * give - give**2)
    )


def of_chapter_4(given: Given) -> Ours:
    """Of sticks, their ringing, and the state-variable law."""
    section, record = given["stick_slip"], chapter4.measured(given)
    time, acceleration, friction = chapter4.free_vibration(given)
    cases = [chapter4.stick_slip(given, section[name]) for name in ("case1", "case2")]
    late = [chapter4.state_variable(given, case) for case in range(3)]
    turns = [_turn(orbit) for orbit in late]
    give = [1.5 * kinetic / section["stiffness"] for kinetic in given["state_variable"]["kinetic"]]
    rings = ss.contact.transition(record)
    return {
        "transition oscillation [Hz]": rings.frequency.value,
        "its damping ratio": rings.damping.value,
        "frequency in acceleration over in friction": chapter4.strongest(time, acceleration)
        / chapter4.strongest(time, friction),
        "frequency over that of m, k and K_y": chapter4.strongest(time, friction)
        / (math.sqrt((section["spring"] + section["stiffness"]) / section["mass"]) / (2 * math.pi)),
        "reversals before the stick": _reversals(given),
        "swings of friction within a stick": _swings(cases[1]),
        "micro-slips, case 1": chapter4.micro_slips(cases[0]),
        "micro-slips, case 2": chapter4.micro_slips(cases[1]),
        "way to half of the friction, over that of the contact": [
            way / own for (way, _), own in zip(turns, give, strict=True)
        ],
        "speed there over the largest, at 8.7 Hz over 5.61 Hz": turns[2][1] / turns[1][1],
        "largest step of friction in 0.25 ms, over its range": [_step(orbit) for orbit in late],
        "abnormal stops in half a cycle": [chapter4.inertial_contact(given, case).stops[1] / 2 for case in (0, 1)],
    }


def _turn(orbit: ss.solve.SteadyState) -> tuple[float, float]:
    """Way [m] from the lower turn to where friction has half of its level, and the speed there over the largest."""
    times = np.linspace(0, orbit.period, 4001)[:-1]
    x, v, friction = orbit.orbit.sample(times, ("x", "v", "friction"))[0]
    x, v, friction = (np.roll(row, -int(np.argmin(x))) for row in (x, v, friction))
    there = int(np.argmax(friction > np.max(friction) / 2))
    return float(x[there] - x[0]), float(v[there] / np.max(v))


def _step(orbit: ss.solve.SteadyState) -> float:
    times = np.arange(round(orbit.period * 4000)) / 4000
    friction = orbit.orbit.sample(times, ("friction",))[0][0]
    return float(np.max(np.abs(np.diff(friction))) / np.ptp(friction))


def _reversals(given: Given) -> int:
    """Turns of the released mass before it sticks for good, each farther from the one before than a contact gives."""
    section = given["stick_slip"]
    turns = chapter4.turns_of_release(given)
    far = 4 * section["kinetic"] / section["stiffness"]
    return sum(abs(b - a) > far for a, b in pairwise(turns))


def _swings(orbit: ss.solve.SteadyState) -> float:
    """Extremes of friction within the longest macroscopic stick, its ends not counted."""
    time, motion = around(orbit, cycles=2)
    slow = np.abs(motion["v"]) < 0.1 * np.max(np.abs(motion["v"]))
    edges = np.flatnonzero(np.diff(slow.astype(int)))
    begin, end = max(
        pairwise([0, *edges, len(time) - 1]),
        key=lambda pair: np.mean(slow[pair[0] + 1 : pair[1]]) * (time[pair[1]] - time[pair[0]]),
    )
    steps = np.sign(np.diff(motion["friction"][begin:end]))
    return float(np.sum(np.diff(steps[steps != 0]) != 0))


def of_chapter_5(given: Given) -> Ours:
    """Of the wavelet maps."""
    section = given["wavelet"]
    impulse, tone = chapter5.signals()
    spike = ss.wavelet_map(impulse, "a", frequencies=(32.0, 256.0), wavelet_frequency=section["centre"])
    band = ss.wavelet_map(tone, "a", frequencies=(4.0, 64.0), wavelet_frequency=section["centre"])
    early = np.abs(band.values[:, 400:600]).mean(axis=1)
    maps = {kind: chapter5.accelerations(given, kind) for kind in ("coulomb", "state variable", "case1", "case2")}
    measured = chapter5.accelerations(given, "measured")
    cycles = chapter5.CYCLES
    high = {kind: _high(given, record) for kind, record in maps.items()}
    return {
        "time of the spike [s]": np.array([impulse.time[k] for k in np.argmax(np.abs(spike.values), axis=1)]),
        "frequency of the band [Hz]": band.frequency[int(np.argmax(early))],
        "spikes a cycle, Coulomb": len(ss.signals.find_spikes(maps["coulomb"], "a")) / cycles,
        "100 to 200 Hz, over Coulomb's": high["state variable"] / high["coulomb"],
        "local maxima a stick, Coulomb": _maxima(given, maps["coulomb"]),
        "local maxima a stick, state variable": _maxima(given, maps["state variable"]),
        "local maxima a stick, case 1": _maxima(given, maps["case1"]),
        "local maxima a stick, case 2": _maxima(given, maps["case2"]),
        "local maxima a stick, measured": _maxima(given, measured),
        "spikes in a stick, case 1": ss.contact.find_microslips(maps["case1"]).per_stick.value,
        "spikes in a stick, case 2": ss.contact.find_microslips(maps["case2"]).per_stick.value,
    }


def _maxima(given: Given, record: ss.Record) -> float:
    """Local maxima of the map between 30 and 70 Hz, for each of the two sticks of a cycle, over the drawn 80 dB."""
    wavelets = ss.wavelet_map(record, "a", frequencies=(25.0, 90.0), wavelet_frequency=given["wavelet"]["centre"])
    peaks = ss.signals.local_maxima(wavelets)
    return sum(30 < peak.frequency < 70 for peak in peaks) / (2 * chapter5.CYCLES)


def _high(given: Given, record: ss.Record) -> float:
    wavelets = ss.wavelet_map(record, "a", frequencies=(100.0, 200.0), wavelet_frequency=given["wavelet"]["centre"])
    return float(np.max(np.abs(wavelets.values[:, 400:-400])))


def of_chapter_6(given: Given) -> Ours:
    """Of decays under both frictions."""
    ours = chapter6.numbers(given)
    true = np.asarray(ours["extremes"])
    sums = np.abs(true[1:] + true[:-1])
    falls = np.diff(np.abs(true))
    return {
        "spread of the logarithmic steps of X_i + X_(i+1)": np.ptp(np.diff(np.log(sums))),
        "spread of the logarithmic steps of X_i": np.ptp(np.diff(np.log(np.abs(true)))),
        "last fall of the peaks over the first": falls[-1] / falls[0],
        "largest step off a line, dry": [_off_line(given, case) for case in (1, 2)],
        "spread of the logarithmic steps, viscous": [_off_exponential(given, case) for case in (1, 2)],
        "error of β over its bound": [
            np.max(np.asarray(ours[f"{kind}.rate off"]) / np.asarray(ours[f"{kind}.alpha"])) for kind in chapter6.KINDS
        ],
    }


def _peaks(given: Given, case: int, kind: str) -> Array:
    return np.abs(ss.decrement(chapter6.on_paper(given, case, kind)).extremes[:8])


def _off_line(given: Given, case: int) -> float:
    steps = np.diff(_peaks(given, case, "dry"))
    return float(np.max(np.abs(steps / np.mean(steps) - 1)))


def _off_exponential(given: Given, case: int) -> float:
    return float(np.ptp(np.diff(np.log(_peaks(given, case, "viscous")))))


def of_chapter_7(given: Given) -> Ours:
    """Of rubber on steel: four conditions, in the order of chapter7.CONDITIONS."""
    records = [chapter7.record_of(given, *condition) for condition in chapter7.CONDITIONS]
    squeal = records[1]
    amplitudes = np.array([np.ptp(record["x"]) / 2 for record in records])
    shaking = np.array([_while_sliding(record) for record in records])
    levels = np.array([chapter7.level_of(record["sound"]) for record in records])
    slopes = [ss.friction_loops(record).slope.value for record in records]
    friction = [chapter7.slow_friction(record) for record in records]
    bending, torsion = chapter7.merging(given)
    return {
        "amplitude over their mean": amplitudes / np.mean(amplitudes),
        "share below 1 mm/s, dry and heavy": np.mean(np.abs(records[0]["v"]) < 1e-3),
        "vibration above 100 Hz while it slides, over the others'": shaking[1] / shaking[[0, 2, 3]],
        "wet friction over dry": [friction[1] / friction[0], friction[3] / friction[2]],
        "slope, dry [N s/m]": [slopes[0], slopes[2]],
        "slope, wet [N s/m]": [slopes[1], slopes[3]],
        "bearing's friction over the contact's": [given["bearing"]["kinetic"] / level for level in friction[:2]],
        "squeals at the light load": [
            float(chapter7.squeaks(given, *condition)) for condition in chapter7.CONDITIONS[2:]
        ],
        "level over that at the light load [dB]": levels[1] - levels[2:],
        "loudness with that of the sound, correlated": [
            _together(squeal, name) for name in ("a", "friction", "normal_acceleration", "torsion_velocity")
        ],
        "line of all but the torsion [Hz]": [
            chapter7.strongest(squeal, name) for name in ("a", "friction", "normal_acceleration", "sound")
        ],
        "line of the torsion [Hz]": chapter7.strongest(squeal, "torsion_velocity"),
        "line near 500 Hz in the torsion, under its strongest [dB]": _under(squeal),
        "power within 5 Hz of the line": _pure(squeal),
        "torsion over bending where it begins to squeal": torsion / bending,
    }


def _fast(record: ss.Record, name: str) -> float:
    return chapter2.loudness(record[name], record.fs, (100.0, 4000.0))


def _quick(record: ss.Record, name: str) -> Array:
    """A channel above 100 Hz."""
    spectrum = np.fft.rfft(record[name] - np.mean(record[name]))
    spectrum[np.fft.rfftfreq(len(record), 1 / record.fs) < 100] = 0
    return np.asarray(np.fft.irfft(spectrum, len(record)))


def _while_sliding(record: ss.Record) -> float:
    """Deviation of the tangential acceleration above 100 Hz, where the mass has more than half of its largest speed."""
    speed = np.abs(record["v"])
    return float(np.std(_quick(record, "a")[speed > 0.5 * np.max(speed)]))


def _together(record: ss.Record, name: str) -> float:
    """Correlation of the levels in windows of 10 ms, above 100 Hz."""
    rows = []
    for channel in (name, "sound"):
        windows = _quick(record, channel)[: len(record) // 100 * 100].reshape(-1, 100)
        rows.append(np.sqrt(np.mean(windows**2, axis=1)))
    return float(np.corrcoef(rows)[0, 1])


def _under(record: ss.Record) -> float:
    frequency, level = _spectrum(record["torsion_velocity"], record.fs)
    audible = frequency > 100
    return float(np.max(level[audible]) - np.max(level[(frequency > 450) & (frequency < 500)]))


def _pure(record: ss.Record) -> float:
    """Share of the normal acceleration's power that lies next to its strongest line."""
    line = chapter7.strongest(record, "normal_acceleration")
    near = chapter2.loudness(record["normal_acceleration"], record.fs, (line - 5, line + 5))
    return (near / _fast(record, "normal_acceleration")) ** 2


MEASURES: dict[str, Callable[[Given], Ours]] = {
    "2": of_chapter_2,
    "3": of_chapter_3,
    "4": of_chapter_4,
    "5": of_chapter_5,
    "6": of_chapter_6,
    "7": of_chapter_7,
}
