"""A rig as it is watched: cycle after cycle its loop, and which sensor is flat, noisy, clipped or late.

For a person at the rig, whose hands are busy, what the sensors read is drawn by letters."""

from __future__ import annotations

import itertools
import math
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from stickslip.arrays import Array
from stickslip.balance.force import friction_force
from stickslip.bench.device import Block, Device, Input, in_si
from stickslip.cycle.loops import friction_loops
from stickslip.cycle.sticks import find_sticks
from stickslip.errors import StickslipError
from stickslip.estimate import Estimate
from stickslip.record.record import Record
from stickslip.signals.response import resonance
from stickslip.squeak.bursts import find_squeaks
from stickslip.units import prefixed

COLUMNS, SPAN = 40, 4.0  # letters of a trace, and the s that they hold
HEIGHTS = "▁▂▃▄▅▆▇█"

NONE: Array = np.empty(0)
SHORTEST = 16  # samples of a cycle
# Times its noise is the least span of what tells cycles: the largest of 300,000 samples of noise, which `SLOWEST` holds
# at 20 kHz, and the least lie 9.3 deviations apart, and `RECENT` samples tell a sixth too little of it at times.
MOVES, RECENT = 12.0, 1024

POINTS = 240  # of a loop: more is not seen
KEPT = 20.0  # s of samples that are looked back to, at the most
CYCLES = 2  # that a check of the sensors looks at
AROUND = slice(CYCLES - 1, CYCLES + 4)  # lines of their spectrum: the motion's, one below, and three above
TOLD = 8  # that the numbers are of, where there are so many; three at the least
SOUNDS = ("sound", "ay")  # that squeak: of the microphone, of an accelerometer across
LISTENED = 0.5  # s that are looked at in place of a cycle where a sound alone is measured
HIGH = 0.2  # of the span of the motion, on either side of its middle: where a cycle is said to begin
SLOWEST = 15.0  # s that a cycle may last
# Set on the virtual rig's two presets with each fault, at 2.5, 5.6 and 11.1 Hz, and on none:
ONLY_NOISE = 1.7  # times its noise: a channel whose deviation is less holds nothing else
NOISIER = 3.0  # times the noise that it had in its first cycles
NOISY = 0.5  # of its deviation: so much noise is said from the beginning
STALLED = 1.6  # periods without a new cycle: then the channel that tells cycles is another one
LEAST_LATE = 1.5  # samples
BEYOND = 2.5  # times the motion's frequency: above its tone, under Hann's window of two cycles
# Set on random simulated rigs, sound and with each fault: benchmarks/sensors.py, seeds from 2001, 3001 and 5001:
MATTERS = 0.001  # of its deviation: less than that may be the curvature of the motion, which grows with it
LEAST_CYCLES = 1.5  # that a window has to hold for a phase
LATE = 5.0  # standard deviations


class Picture:
    """The last seconds of every channel: lowest and highest reading of each column.

    Parameters
    ----------
    seconds : float
        That will be recorded.

    Examples
    --------
    >>> from stickslip.bench import Sim
    >>> device, seen = Sim(fast=True), Picture(5.0)
    >>> with device.open() as stream:
    ...     seen.add(device, stream.read())
    >>> seen.lines(device)[0]
    '0.0 of 5 s'
    """

    def __init__(self, seconds: float) -> None:
        self.seconds, self.after = seconds, 0
        self.parts: deque[tuple[int, NDArray[np.float64], NDArray[np.float64]]] = deque()

    def add(self, device: Device, block: Block) -> None:
        """One more block."""
        values = in_si(device, block)
        self.after = block.after
        self.parts.append((block.after, np.fmin.reduce(values, axis=1), np.fmax.reduce(values, axis=1)))
        while self.parts[0][0] < self.after - SPAN * device.fs:
            self.parts.popleft()

    def lines(self, device: Device) -> list[str]:
        """How far it is, and a line for each channel."""
        ends = np.array([after for after, _, _ in self.parts])
        columns = np.floor((ends - self.after) * COLUMNS / (SPAN * device.fs)).astype(int) + COLUMNS - 1
        lows, tops = (np.array([part[k] for part in self.parts]).T for k in (1, 2))
        traces = zip(device.inputs, lows, tops, strict=True)
        lines = [_line(one, low, top, np.maximum(columns, 0)) for one, low, top in traces]
        return [f"{self.after / device.fs:.1f} of {self.seconds:g} s", *lines]


def _line(one: Input, low: NDArray[np.float64], top: NDArray[np.float64], columns: NDArray[np.int_]) -> str:
    """Name, trace, and between which readings it lies; what stands at the range's end is said."""
    ends = float(np.fmin.reduce(low)), float(np.fmax.reduce(top))
    if not np.all(np.isfinite(ends)):
        return f"{one.name:<8} gives no numbers"
    factor, unit = prefixed(np.array(ends), one.unit)
    letters = [" "] * COLUMNS
    for column in np.unique(columns[np.isfinite(top)]):
        share = (np.fmax.reduce(top[columns == column]) - ends[0]) / ((ends[1] - ends[0]) or 1.0)
        letters[column] = HEIGHTS[min(len(HEIGHTS) - 1, int(share * len(HEIGHTS)))]
    clipped = "  at the end of its range" if max(map(abs, ends)) >= one.limit * (1 - 1e-9) else ""
    return f"{one.name:<8} {''.join(letters)} {ends[0] * factor:.4g} to {ends[1] * factor:.4g} {unit}{clipped}"


class Flaw(NamedTuple):
    """What is wrong with a channel: "flat", "noisy", "clipped", "late" or "lost", and in words."""

    channel: str
    kind: str
    words: str


class Cycle(NamedTuple):
    """One cycle: counter of its first sample, its length [s], its loop, what is wrong with the sensors, and by how much
    [s] x or a would have to be late to be named; infinite where that can not be told."""

    first: int
    period: float
    x: Array
    v: Array
    friction: Array
    flaws: tuple[Flaw, ...]
    least_late: float = math.inf


class Monitor:
    """Watches the blocks of one device. Lives as long as it is open.

    Parameters
    ----------
    device : Device
        What measures.
    constants : mapping of str to float
        mass [kg], stiffness [N/m] and damping [N s/m] of the rig, where known.
    """

    def __init__(self, device: Device, constants: Mapping[str, float] | None = None) -> None:
        self.device, self.constants = device, constants or {}
        self.names = [one.name for one in self.device.inputs]
        self.held: deque[tuple[int, Array]] = deque()
        self.begins: deque[int] = deque(maxlen=TOLD + 1)  # counters at which cycles began
        self.quiet: dict[str, list[float]] = {name: [] for name in self.names}
        moving = [name for name in ("z", "x", "v", "a") if name in self.names]
        order = moving or [name for name in self.names if name not in SOUNDS][:1]
        self.order = deque(self.names.index(name) for name in order)  # the base tells cycles if it moves, else the mass
        self._afresh()
        self.after, self.lost = 0, 0

    def feed(self, block: Block) -> list[Cycle]:
        """Look at a block; the cycles that end in it."""
        if self.held and block.first != self.after:
            self.lost += block.first - self.after
            self.held.clear()  # nothing is looked at across a gap
            self.begins.clear()
        values = in_si(self.device, block)
        self.held.append((block.first, values))
        self.after = block.after
        while self.after - self.held[0][0] > KEPT * self.device.fs:
            self.held.popleft()
        begun = self._beginnings(block.first, values)
        if not begun and self._stalled():
            return self._stall()
        return [cycle for at in begun if (cycle := self._cycle(at)) is not None]

    def _stall(self) -> list[Cycle]:
        """What told cycles tells none any more: what is wrong since, and another channel's turn."""
        period, first, name = self._longest(), self.begins[-1], self.names[self.order[0]]
        rows = self._rows(self.after - period // 2, self.after)  # before that it still told cycles
        self.order.rotate(-1)
        self._afresh()
        seen = self._rows(first, self.after)
        span = np.empty(0) if seen is None else seen[self.order[0]][np.isfinite(seen[self.order[0]])]
        if len(span):  # it may stick now: its motion is that of the last cycle, and not what it rings meanwhile
            self.low, self.top = float(span.min()), float(span.max())
        self.begins.clear()
        if rows is None or rows.shape[1] < SHORTEST:
            return []
        # half a cycle is too little to judge the others by: a mass that sticks there is not flat
        flaws = tuple(flaw for flaw in self._flaws({}, rows, period / self.device.fs)[0] if flaw.channel == name)
        return [Cycle(first, period / self.device.fs, NONE, NONE, NONE, flaws)]

    def _afresh(self) -> None:
        """Nothing is known yet of the motion that tells cycles."""
        self.low, self.top, self.recent = math.inf, -math.inf, NONE
        self.above: bool | None = None

    def _stalled(self) -> bool:
        """Whether cycles went on, and do no more."""
        return len(self.begins) > 1 and self.after - self.begins[-1] > STALLED * self._longest()

    def _longest(self) -> int:
        """Samples of the longest of the last cycles: what breaks may begin a short one."""
        return max(after - before for before, after in itertools.pairwise(self.begins))

    def window(self) -> Record | None:
        """The last whole cycles; None before there are three."""
        if len(self.begins) < 4:
            return None
        first, last = self.begins[max(0, len(self.begins) - 1 - TOLD)], self.begins[-1]
        rows = self._rows(first, last)
        if rows is None or not np.all(np.isfinite(rows)):
            return None
        channels = {one.name: one.channel for one in self.device.inputs}
        samples = dict(zip(self.names, rows, strict=True))
        return Record(samples, channels, self.device.fs, first / self.device.fs)

    def _beginnings(self, first: int, values: Array) -> list[int]:
        """Counters at which the base, or where it stands the mass, passes its middle upwards; else by the clock."""
        if not self.order:
            size = round(LISTENED * self.device.fs)
            return list(range(-(-first // size) * size, first + values.shape[1], size))
        row = values[self.order[0]]
        row = row[np.isfinite(row)]
        if not len(row):
            return []
        share = min(1.0, len(row) / (SLOWEST * self.device.fs))  # the extremes are forgotten slowly
        middle = (self.low + self.top) / 2 if self.low < self.top else float(row[0])
        self.low = min(self.low + share * (middle - self.low) if self.low < self.top else math.inf, float(row.min()))
        self.top = max(self.top + share * (middle - self.top) if self.top > self.low else -math.inf, float(row.max()))
        span, middle = self.top - self.low, (self.low + self.top) / 2
        self.recent = np.append(self.recent, row)[-RECENT:]  # a block may hold two samples
        if not span > MOVES * max(noise_of(self.recent), _count(self.recent) / math.sqrt(12)):
            return []
        marks = (row > middle + HIGH * span).astype(np.int8) - (row < middle - HIGH * span)
        known = np.flatnonzero(marks)
        rows = []
        for at in known[np.append(True, np.diff(marks[known]) != 0)[: len(known)]].tolist():
            if marks[at] > 0 and self.above is False:
                rows.append(first + at)
            self.above = bool(marks[at] > 0)
        return rows

    def _rows(self, first: int, last: int) -> Array | None:
        """Samples of all channels from one counter to another."""
        if not self.held or self.held[0][0] > first:
            return None
        parts = [values[:, max(0, first - at) : last - at] for at, values in self.held if at < last]
        return np.concatenate([part for part in parts if part.shape[1]], axis=1)

    def _cycle(self, at: int) -> Cycle | None:
        """The cycle that ends here."""
        self.begins.append(at)
        if len(self.begins) < 2:
            return None
        first, fs = self.begins[-2], self.device.fs
        rows = self._rows(first, at)
        if rows is None or rows.shape[1] < SHORTEST:
            return None
        channels = dict(zip(self.names, rows, strict=True))
        x, v, friction = _loop(channels, self.constants, fs)
        since = self.begins[max(0, len(self.begins) - 1 - CYCLES)]
        last = self._rows(since, at)
        several = dict(zip(self.names, rows if last is None else last, strict=True))
        count = 1 if last is None else len(self.begins) - 1 - max(0, len(self.begins) - 1 - CYCLES)
        flaws, least_late = self._flaws(several, rows, len(several[self.names[0]]) / count / fs)
        return Cycle(first, (at - first) / fs, x, v, friction, tuple(flaws), least_late)

    def _flaws(self, channels: Mapping[str, Array], last: Array, period: float) -> tuple[list[Flaw], float]:
        """What is wrong with each sensor in the last cycles, and from which delay [s] on it would be."""
        flaws = []
        for one, cycle in zip(self.device.inputs, last, strict=True):
            noise = noise_of(cycle, _ringing(one, self.device.fs))
            known = self.quiet[one.name]
            flaw = _flaw(one, cycle, noise, float(np.median(known)) if known else math.nan)
            if flaw is None and len(known) < 3:
                known.append(max(noise, _count(cycle[np.isfinite(cycle)]) / math.sqrt(12)))
            flaws += [flaw] if flaw else []
        broken = {flaw.channel for flaw in flaws}
        sound = {name: values for name, values in channels.items() if name not in broken}
        late, least = _late(sound, self.device.inputs, self.constants, (period, self.device.fs))
        return flaws + late, least


def noise_of(values: Array, ringing: Sequence[float] = (1.0,)) -> float:
    """Standard deviation of white noise, by third differences, of which jumps spoil the upper half.

    What a mount rings of them, samples long, vanishes under the differences that `ringing` gives.
    """
    kernel, finite = np.convolve((1.0, -3.0, 3.0, -1.0), ringing), values[np.isfinite(values)]
    if len(finite) < len(kernel):
        return math.nan
    steps = np.sort(np.abs(np.convolve(finite, kernel, "valid")))
    # the lower half of |normal| has the mean 0.3247
    return float(np.mean(steps[: math.ceil(0.5 * len(steps))]) / 0.3247 / np.linalg.norm(kernel))


def _ringing(one: Input, fs: float) -> list[float]:
    """The differences under which a stated mount's free ringing vanishes; none where no mount is stated."""
    mount = one.details.get("mount")
    return np.real(np.poly(np.exp(np.array(resonance(*mount).poles) / fs))).tolist() if mount else [1.0]


def _flaw(one: Input, values: Array, noise: float, before: float) -> Flaw | None:
    """What is wrong with one channel in a cycle, the worst first."""
    finite = values[np.isfinite(values)]
    if len(finite) < 0.5 * len(values):
        return Flaw(one.name, "lost", f"{one.name} gives no numbers")
    clipped = int(np.sum(np.abs(finite) >= one.limit * (1 - 1e-9)))
    if clipped:
        return Flaw(one.name, "clipped", f"{one.name} stands at the end of its range in {clipped} samples of the cycle")
    deviation = float(np.std(finite))
    least = ONLY_NOISE * max(noise, _count(finite))
    if one.name in SOUNDS:  # a quiet room is noise alone, and squeaks come into it: a dead line stays within a count
        noise, least = 0.0, _count(finite)
    louder = noise > NOISIER * before > 0 and noise > MATTERS * deviation
    if not louder and deviation <= least:
        return Flaw(one.name, "flat", f"{one.name} is flat: nothing but noise of {deviation:.2g} {one.unit}")
    usual = f", {noise / before:.1f} times its usual one" if before > 0 else ""
    if louder or noise > NOISY * deviation:
        return Flaw(one.name, "noisy", f"{one.name} is noisy: {noise:.2g} {one.unit}{usual}")
    return None


def _count(values: Array) -> float:
    """What a digitiser's count is worth: the least step between readings; below it differences tell no noise."""
    steps = np.diff(np.unique(values))
    return float(steps.min()) if len(steps) else 0.0


def _late(
    channels: Mapping[str, Array], inputs: Sequence[Input], constants: Mapping[str, float], times: tuple[float, float]
) -> tuple[list[Flaw], float]:
    """Which of displacement and acceleration comes after the other, and whether the load does after both.

    And from which delay [s] of x or a on it would be told. By a = x'', and by the friction's jumps, of which load and
    acceleration speak alike. Delays that are stated are expected.
    """
    period, fs = times
    if not {"x", "a"} <= set(channels) or len(channels["x"]) < LEAST_CYCLES * period * fs:
        return [], math.inf
    expected = {one.name: _expected(one) for one in inputs}
    count = len(channels["a"])
    known = channels["x"][np.isfinite(channels["x"])]
    # less a straight line, which has no acceleration, its ends meet: under a delay the window reaches over them
    ends = {"x": channels["x"] - np.linspace(0.0, known[-1] - known[0], count)}
    spectra = {name: _spectrum(values) for name, values in {**channels, **ends}.items() if name in ("x", "a", "load")}
    frequency = np.asarray(np.fft.rfftfreq(count, 1 / fs), dtype=np.float64)
    lines = _Lines({name: spectrum[AROUND] for name, spectrum in spectra.items()}, math.tau * frequency[AROUND])
    lag, error = lines.lag(lambda late: lines.of("x", 2, expected["x"] + late), lines.of("a", 0, expected["a"]))
    doubts = [lines.doubt(name, math.sqrt(count) * noise_of(channels[name]), n) for name, n in (("x", 2), ("a", 0))]
    error = math.hypot(error, *doubts)
    flaws, least = _judged("x", lag, error, fs) or _judged("a", -lag, error, fs), _least_late(error, fs)
    if not ("load" in channels and {"mass", "stiffness"} <= set(constants)):
        return flaws, least
    natural = math.sqrt(constants["stiffness"] / constants["mass"]) / math.tau
    felt = {one.name: _felt(spectra[one.name], one, frequency) for one in inputs if one.name in ("load", "a")}
    after, error = _apart(felt["load"], felt["a"], frequency[1:-1], max(BEYOND / period, 2 * natural))
    if any(flaw.channel == "a" for flaw in flaws):
        return [*flaws, *_judged("load", after - lag, error, fs)], least
    return [*flaws, *_judged("a", -after, error, fs), *_judged("load", after, error, fs)], least


def _spectrum(values: Array) -> NDArray[np.complex128]:
    """Of a channel about its mean, which what is not known is taken for."""
    known = np.isfinite(values)
    return np.asarray(np.fft.rfft(np.where(known, values - np.mean(values[known]), 0.0)))


def _windowed(spectrum: NDArray[Any]) -> NDArray[Any]:
    """The same under Hann's window, which mixes each line with its neighbours; the first and the last have but one."""
    return np.asarray(0.5 * spectrum[1:-1] - 0.25 * (spectrum[:-2] + spectrum[2:]))


def _felt(spectrum: NDArray[np.complex128], one: Input, frequency: Array) -> NDArray[np.complex128]:
    """Spectrum of a channel under Hann's window, its stated delay and mount taken out."""
    inner, mount = frequency[1:-1], one.details.get("mount")
    held = resonance(*mount).at(inner) if mount else 1.0
    turned = np.exp(2j * np.pi * inner * one.details.get("delay", 0.0)) / held
    return np.asarray(_windowed(spectrum) * turned)


def _apart(
    load: NDArray[np.complex128], a: NDArray[np.complex128], frequency: Array, lowest: float
) -> tuple[float, float]:
    """By how much [s] the load comes after the acceleration, and its deviation.

    Of m a + k x = -f each line beyond the base's tone and the resonance is m (1 - (natural / frequency)^2) a = -f: load
    and acceleration turn alike, whatever mass, spring and gains are. Noise turns them at random.
    """
    band = (frequency > lowest) & (frequency < min(10 * lowest, frequency[-1] / 2))
    omega, cross = math.tau * frequency[band], -np.conj(a[band]) * load[band]
    if len(cross) < 4:
        return 0.0, math.inf
    tried = np.linspace(-0.25, 0.25, 401) / lowest
    late = float(tried[np.argmax(np.real(np.exp(1j * np.outer(tried, omega)) @ cross))])
    turned, weight = np.angle(cross * np.exp(1j * omega * late)), np.abs(cross)
    power = float(weight @ omega**2)
    late -= float(weight @ (omega * turned)) / power
    turned = np.angle(cross * np.exp(1j * omega * late))
    lines = float(weight.sum() ** 2 / (weight @ weight)) / 1.5  # Hann's window makes neighbours alike
    return late, math.sqrt(float(weight @ turned**2) / power / max(1.0, lines - 1))


class _Lines(NamedTuple):
    """Channels at the motion's frequency and the next two, under a window that vanishes with its slope at both ends.

    That is Hann's, which mixes each line with its neighbours. Two cycles turn twice in it, so that the line below, of
    one turn, would take in that of none, which is the offset of the sensor: it is left out.

    By parts, the integral of a derivative times the window is that of the samples times the window's derivative; the
    motion need not repeat. Of each line a derivative, and a delay, is a factor: the samples are gone through but once,
    as the device waits meanwhile to be read.
    """

    turns: Mapping[str, NDArray[np.complex128]]  # five lines of each channel's spectrum
    omega: Array  # rad/s

    def of(self, name: str, order: int = 0, delay: float = 0.0) -> NDArray[np.complex128]:
        """Three lines of a channel's derivative, whose samples come so late [s]."""
        return _windowed((1j * self.omega) ** order * np.exp(1j * self.omega * delay) * self.turns[name])

    def doubt(self, name: str, noise: float, order: int = 0) -> float:
        """Standard deviation [s] of a channel's phase by its noise, which is so large in each line."""
        share = float(np.linalg.norm(self.omega[:3] ** order * (0.25, 0.5, 0.25)))
        return noise * share / max(float(np.linalg.norm(self.of(name, order))), 1e-300) / float(self.omega[1])

    def lag(self, late: Callable[[float], NDArray[Any]], early: NDArray[Any]) -> tuple[float, float]:
        """By how much [s] what is late has to be taken forward; its deviation by what is unlike the other even then.

        Three lines less one ratio leave four numbers, of which the phase takes a share as large as each.
        """
        lag = 0.0
        for _ in range(3):  # it is off by a hundredth of itself after one, by the window that moves too
            lag -= float(np.angle(np.vdot(early, late(lag)))) / float(self.omega[1])
        after = late(lag)
        unlike = after - early * np.vdot(early, after) / max(np.vdot(early, early).real, 1e-300)
        return lag, float(np.linalg.norm(unlike) / max(float(np.linalg.norm(after)), 1e-300)) / 2 / float(self.omega[1])


def _least_late(error: float, fs: float) -> float:
    """The least delay [s] that is told."""
    return max(LATE * error, LEAST_LATE / fs)


def _judged(name: str, lag: float, error: float, fs: float) -> list[Flaw]:
    """Whether a channel is late by more than chance and a sample; told with twice its deviation."""
    if lag <= _least_late(error, fs):
        return []
    return [Flaw(name, "late", f"{name} comes {1e3 * lag:.2f} ± {max(2e3 * error, 0.01):.2f} ms late")]


def _expected(one: Input) -> float:
    """How late [s] a channel is known to be: its delay, and its mount's well below the resonance."""
    frequency, damping = one.details.get("mount") or (math.inf, 0.0)
    return float(one.details.get("delay", 0.0)) + 2 * damping / (2 * math.pi * frequency)


def _loop(channels: Mapping[str, Array], constants: Mapping[str, float], fs: float) -> tuple[Array, Array, Array]:
    """Displacement, velocity and friction of a cycle, averaged in `POINTS` parts of it; empty where not measured."""
    count = len(next(iter(channels.values())))
    points = min(POINTS, count // 4)
    edges = np.linspace(0, count, points + 1).astype(int)[:-1]
    means = {name: np.add.reduceat(v, edges) / np.diff(np.append(edges, count)) for name, v in channels.items()}
    step = count / points / fs
    x = means.get("x", np.empty(0))
    v = means["v"] if "v" in means else np.gradient(x, step) if len(x) else x
    measured = next((name for name in ("load", "friction") if name in means), None)
    if measured is not None:
        return x, v, means[measured]
    if not len(x) or not {"mass", "stiffness"} <= set(constants):
        return x, v, np.empty(0)
    a = means["a"] if "a" in means else np.gradient(v, step)
    spring = constants["stiffness"] * (x - means.get("z", np.zeros(points)))
    return x, v, -constants["mass"] * a - constants.get("damping", 0.0) * v - spring


def answers(record: Record, constants: Mapping[str, float]) -> tuple[list[Estimate], list[str]]:
    """What do a few cycles tell, by the questions that any record is asked?

    Parameters
    ----------
    record : Record
        Some whole cycles.
    constants : mapping
        mass, stiffness, damping.

    Returns
    -------
    estimates : list of Estimate
        Sliding friction, stops per cycle, stuck share, and the pitch of the loudest squeak.
    untold : list of str
        A sentence for each question that could not be answered.
    """
    estimates: list[Estimate] = []
    untold: list[str] = []
    stated = {"mass", "stiffness"} <= set(constants) and "x" in record
    asked = [partial(_squeaks, record, name) for name in SOUNDS if name in record]
    questions: list[Callable[[], list[Estimate]]] = [*asked]
    if stated or "load" in record or "friction" in record:
        questions.insert(0, partial(_friction, record, constants))
    elif "x" in record:
        untold.append("Friction needs mass and stiffness in rig.toml, or a load cell.")
    for question in questions:
        try:
            estimates += question()
        except StickslipError as error:
            untold.append(str(error))
    return estimates, untold


def _friction(record: Record, constants: Mapping[str, float]) -> list[Estimate]:
    forced = _forced(record, constants)
    level, sticks = friction_loops(forced).level, find_sticks(forced)
    return [level, sticks.per_cycle, sticks.share]


def _forced(record: Record, constants: Mapping[str, float]) -> Record:
    if {"mass", "stiffness"} <= set(constants) and "x" in record:
        known = {name: constants.get(name, 0.0) for name in ("mass", "stiffness", "damping")}
        return friction_force(record, **known)  # type: ignore[arg-type]
    if "friction" in record:
        return record
    return record.with_channel("friction", record["load"], unit="N", source="load")


def _squeaks(record: Record, channel: str) -> list[Estimate]:
    bursts = [burst for burst in find_squeaks(record, channel=channel).bursts if burst.kind != "noise"]
    if not bursts:
        return []
    loudest = max(bursts, key=lambda burst: burst.level)
    name, unknown = f"pitch in {channel} ({loudest.kind})", (math.nan, math.nan)
    return [Estimate(name, loudest.frequency, unknown, math.nan, "Hz", "frequency of the loudest burst")]
