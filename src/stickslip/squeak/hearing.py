"""The short-time spectrum of a sound cut into stretches: tonal ones along a line, and what remains."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from stickslip.arrays import Array, Mask, Rows, stretches
from stickslip.errors import ABSENT
from stickslip.record.check import find_clipping
from stickslip.record.record import Record

HEARD = ("sound", "normal_acceleration", "a", "friction", "ch1")  # the first of these, unless told
WINDOW = 0.0232  # s
OVERLAP = 4  # windows that share a sample
LOWEST = 50.0  # Hz of what is listened to
STANDS_OUT = 18.0  # dB of a line over the median of its neighbours: noise alone has 10
OF_POWER = 0.3  # share of the power in the line and its harmonics
LOBE = 2  # bins to either side of a line that are its own
AROUND = 15  # bins to either side that are its neighbours
JUMP = 1 / 8  # octaves from frame to frame that a gliding tone makes at most
DIP = 10.0  # dB: two bursts of one tone have a valley between them
SHORTEST, LASTS = 10, 100.0  # cycles of a tone, and of one that is told from what is broad about it
LEANS = 1e-6  # dB a frame
AUDIBLE = 30.0  # dB below the loudest moment
ABOVE = 6.0  # dB above the quiet level
TOGETHER = 0.08  # s: broad bursts nearer are one
SPARSE = 0.75  # share of the time that clicks are heard at most, soon after one another: a window holds each for 23 ms
HARMONICS = 6
PULSE, DEEP, APART = 2e-3, 6.0, 0.25  # s, dB, and the change of the logarithm of an interval
# dB, s: how soon a pulse is there. Of 22 creaks all took under 6 ms, of 6 trains of chirps over 9
HALF, SUDDEN = 6.0, 7e-3
PULSES, SLIM = 8, 0.5  # pulses at least, and their width against their interval
STEADY = 5  # frames of the median that a level is taken over: no dip of two frames cuts a burst
PARTIALS = 0.1  # of the power in steady lines
# DROWNED to FLOOR were set on seeds 1000 to 5100 of tests/sound_sources.py and on the scrapes among the real sounds.
DROWNED = 0.05  # s that a tone may be lost in noise for, and be the same
WHOLE, COMMON = 0.03, 0.1  # how near a whole ratio is to it, and of the frames that have the fundamental as their line
DEEPER = -20.0  # dB below its line from which a deeper partial is a burst's own
GLIDING = 32  # cycles over which a pitch is told: in fewer, noise moves it
FLOOR = 4.0  # times the noise before it, from which on a tone is seen to grow
COARSE = 10.0  # bins of a window, below which a line is sought in the whole stretch: they are 23 Hz wide
NEARLY = 0.9  # of the lowest frequency heard, from which on a line may lie there
# A hum of the mains, whose pitch wanders by 0.1 % where grids are tied together and by 0.4 % on islands:
MAINS, HUMS, OF_MAINS = (50.0, 60.0), 8, 0.004  # Hz, orders, share of the pitch
SHORTLY, STEADILY = 1.0, 8.0  # s in which a pitch is seen to be kept, and in which no grid's wanders
LEAK, BETWEEN = 0.75, 1.38  # of Hann's window: sum over bins of a mean square, and what a line between two bins loses
STILL = 0.4  # s: the window in which steady partials are told from each other
FORCES = ("N", "N m")
HELD, LEAP = 3, 1e-3  # samples at the extreme, how often, and the jump beside them, of the span
TONAL = 0.5  # of a stretch that tones fill


def chosen_channel(record: Record, channel: str | None) -> str:
    """The channel asked for, or the first that is usual."""
    if channel is not None:
        record.require(channel, question="hearing squeaks", kind=ABSENT)
        return channel
    return next((name for name in HEARD if name in record), next(iter(record)))


@dataclass(frozen=True)
class Span:
    """Rows of a burst.

    Of a tonal one its line [Hz], cycles of growth, share before half of its energy, whether it fades and comes
    again, and whether what sounds before it hides how it began; of pulses their rate [Hz], and by which factor it
    wanders.
    """

    first: int
    last: int
    tonal: bool
    line: float = math.nan
    growth: float = math.nan
    middle: float = math.nan
    swells: bool = False
    hidden: bool = False
    rate: float = math.nan
    wander: float = math.nan
    throughout: bool = False


@dataclass(frozen=True, eq=False)
class Hearing:
    """A sound in its band, and the frames of its short-time spectrum."""

    values: Array
    fs: float
    band: tuple[float, float]
    span: float
    frequencies: Array
    power: Array
    size: int
    hop: int

    @classmethod
    def of(cls, values: Array, fs: float, band: tuple[float, float], span: float) -> Hearing:
        from scipy.signal import stft

        size = min(len(values), max(64, 2 ** round(math.log2(WINDOW * fs))))
        hop = size // OVERLAP
        heard = filtered(values, fs, band)
        frequencies, _, map_ = stft(heard, fs, nperseg=size, noverlap=size - hop, boundary="even", padded=True)
        inside = frequencies <= band[1]
        return cls(heard, fs, band, span, frequencies[inside], np.abs(map_[inside]) ** 2, size, hop)

    @cached_property
    def lines(self) -> tuple[Array, Array, Mask]:
        """Of each frame the strongest line [Hz], its level [dB], and whether it is a tone."""
        power, count = self.power, len(self.frequencies)
        peak = np.argmax(power, axis=0)
        columns = np.arange(power.shape[1])
        strong = power[peak, columns]
        lowest = int(np.searchsorted(self.frequencies, self.band[0]))
        around = np.clip(peak, lowest + AROUND, count - 1 - AROUND) + np.arange(-AROUND, AROUND + 1)[:, None]
        around = np.clip(around, 0, count - 1)
        beside = np.nanmedian(np.where(np.abs(around - peak) > LOBE, power[around, columns], np.nan), axis=0)
        lobes = [(order, step) for order in range(1, HARMONICS + 1) for step in range(-LOBE, LOBE + 1)]
        own = sum(power[np.clip(order * peak + step, 0, count - 1), columns] for order, step in lobes)
        whole = np.maximum(power.sum(axis=0), np.finfo(float).tiny)
        lobe = sum(power[np.clip(peak + step, 0, count - 1), columns] for step in range(-LOBE, LOBE + 1))
        tonal = (_decibel(strong) - _decibel(beside) > STANDS_OUT) & (np.minimum(own / whole, 1) > OF_POWER)
        return self._refined(peak), _decibel(np.asarray(lobe)), tonal & (strong > 0)

    @property
    def spans(self) -> tuple[Span, ...]:
        """The bursts: creaks and broad ones where the sound is not tonal, tonal ones elsewhere."""
        return self._heard[0]

    @property
    def clicks(self) -> int:
        """How often something is heard for no longer than a window, apart from the bursts."""
        return self._heard[1]

    @cached_property
    def _heard(self) -> tuple[tuple[Span, ...], int]:
        active, throughout = self._active()
        least = 2 * self.size if throughout else 0  # in noise, two windows that share no sample have to agree
        spans = [part for part in self._tonal_spans() if part.last - part.first >= least]
        tonal = [part for part in spans if active[self._frame(part.first) : self._frame(part.last)].any()]
        covered = np.zeros(len(active), dtype=bool)
        for part in tonal:
            covered[self._frame(part.first) : self._frame(part.last) + 1] = True
        broad, clicks = [], 0
        runs = _runs(active)
        for first, last in _joined(runs, round(TOGETHER * self.fs / self.hop)):
            rows = self._rows(first, last)
            rate, wander = pulse_train(self.values[rows[0] : rows[1]], self.fs)
            background = throughout and bool(covered.any())  # what stands out of it is told, and not the noise itself
            loud = self.power[:, first:last].sum(axis=0)
            if loud[self.lines[2][first:last]].sum() > TONAL * loud.sum():  # pulses of tones are beeps or notes
                rate = wander = math.nan
            short = [end - begin <= OVERLAP for begin, end in runs if first <= begin < last]
            apart = all(short) and active[first:last].mean() < SPARSE  # clicks that happen to come soon after another
            pulses, long = not math.isnan(rate), last - first > OVERLAP and not apart
            if covered[first:last].mean() < TONAL and (pulses or (long and not background)):
                broad.append(Span(*rows, False, rate=rate, wander=wander, throughout=bool(active.mean() > 0.97)))
            clicks += 0 if long or pulses or covered[first:last].any() else len(short)
        return (*(part for part in tonal if self._stands(part, broad)), *broad), clicks

    def _stands(self, part: Span, broad: list[Span]) -> bool:
        """Whether a tone is a burst by itself: it lasts, or no broad burst holds it."""
        lasts = (part.last - part.first) * part.line > LASTS * self.fs
        return lasts or not any(noise.first <= (part.first + part.last) / 2 < noise.last for noise in broad)

    def tones(self, part: Span) -> tuple[float, tuple[tuple[float, float], ...], float]:
        """Dominant frequency [Hz], the harmonics that stand out, and the share of the power in both."""
        values = self.values[part.first : part.last]
        power, step = _spectrum(values, self.fs)
        line = part.line if part.tonal else float(np.argmax(power)) * step
        frequency = line if line in self.hums else _centre(power, step, 0.9 * line, 1.1 * line)
        wide = max(4 * self.fs / len(values), 0.02 * frequency)
        lobe = power[_bins(step, frequency, wide, len(power))]
        strength, own, overtones, inside = lobe.max(), lobe.sum(), [], 0.0
        for order in range(2, HARMONICS + 1):
            if order * frequency + wide > self.band[1]:
                break
            place = _bins(step, order * frequency, order * wide, len(power))
            beside = _bins(step, order * frequency, 8 * order * wide, len(power))
            if _decibel(power[place].max()) - _decibel(np.median(power[beside])) > STANDS_OUT:
                overtones.append((order * frequency, float(_decibel(power[place].max()) - _decibel(strength))))
                inside += power[place].sum()
        return frequency, tuple(overtones), float(min(1.0, (own + inside) / max(power.sum(), np.finfo(float).tiny)))

    def glide(self, part: Span) -> float:
        """Range of the pitch over its median: of nine tenths of the burst's power, in stretches of many cycles."""
        from scipy.signal import hilbert

        before, after = max(0, part.first - self.size), part.last + self.size
        near = filtered(self.values[before:after], self.fs, (0.85 * part.line, min(1.15 * part.line, 0.49 * self.fs)))
        wave = hilbert(near)[part.first - before : part.last - before]
        size = max(2, round(GLIDING * self.fs / part.line))
        count = len(wave) // size
        if count < 3:
            return 0.0
        turns = (wave[1:] * np.conj(wave[:-1]))[: count * size - 1]
        parts = np.array([piece.sum() for piece in np.array_split(turns, count)])
        loud = np.abs(parts) > 0.1 * np.abs(parts).max()
        pitch = np.angle(parts[loud]) * self.fs / (2 * np.pi)
        low, middle, high = np.quantile(pitch, [0.05, 0.5, 0.95])
        return float((high - low) / middle)

    def deeper(self, part: Span) -> float:
        """The lowest frequency [Hz] that stands out in a tonal burst: its line, where nothing lies below."""
        from scipy.ndimage import median_filter

        values = self.values[part.first : part.last]
        power = np.abs(np.fft.rfft(values * np.hanning(len(values)))) ** 2
        step = self.fs / len(values)
        below = power[: max(1, int(part.line / step) - 2 * LOBE)]
        beside = median_filter(power, 2 * AROUND + 1)[: len(below)]
        out = (below > power.max() * 10 ** (DEEPER / 10)) & (below > 10 ** (STANDS_OUT / 10) * beside)
        return float(np.argmax(out) * step) if out.any() else part.line

    def partials(self, part: Span) -> float:
        """Share of its power in lines that stay where they are."""
        return steady_share(self.values[part.first : part.last], self.fs)

    def loudest(self, part: Span) -> tuple[int, tuple[int, int]]:
        """Row of its loudest moment, and the rows about it that are within ten decibel of it."""
        energy = _smooth(self.values[part.first : part.last] ** 2, self.size // 2)
        peak = int(np.argmax(energy))
        soft = np.flatnonzero(energy < energy[peak] * 10 ** (-DIP / 10))
        first, last = soft[soft < peak].max(initial=-1) + 1, soft[soft > peak].min(initial=len(energy))
        return part.first + peak, (part.first + int(first), part.first + int(last))

    @cached_property
    def threshold(self) -> float:
        """Power from which on a tone of any frequency would be told as one, in 95 of 100 frames.

        It has to stand out of its neighbours, to be stronger than any line there, to hold its share of the power, and
        not to be hidden by what is loudest. A line has half of its power in one bin, and up to 1.4 dB less between two.
        """
        from scipy.ndimage import median_filter

        power, inside = self.power[:, ::OVERLAP], self.frequencies >= self.band[0]
        rest = power.sum(axis=0) / LEAK  # of all that sounds, as a mean square
        beside = median_filter(power, (2 * AROUND + 1, 1))[inside].max(axis=0)
        line = 2 * BETWEEN * np.maximum(10 ** (STANDS_OUT / 10) * beside, power.max(axis=0))
        needed = np.maximum(line, OF_POWER / (1 - OF_POWER) * rest)
        _, throughout = self._active()
        if not throughout:
            least = max(rest.max() * 10 ** (-AUDIBLE / 10), float(np.quantile(rest, 0.1)) * 10 ** (ABOVE / 10))
            needed = np.maximum(needed, least)
        return float(np.quantile(needed, 0.95))

    def _active(self) -> tuple[Mask, bool]:
        """Frames in which something sounds, and whether it does from end to end."""
        loud = _decibel(self.power.sum(axis=0))
        quiet = float(np.quantile(loud, 0.1))
        if loud.max() - quiet < 2 * ABOVE + 3:
            return np.ones(len(loud), dtype=bool), True
        return np.asarray(loud > max(loud.max() - AUDIBLE, quiet + ABOVE)), False

    def _tonal_spans(self) -> list[Span]:
        from scipy.ndimage import median_filter
        from scipy.signal import find_peaks

        line, strength, tonal = self.lines
        spans = []
        for first, last in self._one_pitch(line, tonal):
            stretch = median_filter(strength[first : last + 1], STEADY, mode="nearest")
            # of two peaks of one height neither would count as lower
            unlike = stretch + LEANS * np.arange(len(stretch))
            padded = np.concatenate([[stretch.min() - DIP], unlike, [stretch.min() - DIP]])
            peaks, _ = find_peaks(padded, prominence=DIP)
            peaks = peaks - 1
            cuts = [int(a + np.argmin(stretch[a:b])) for a, b in itertools.pairwise(peaks)]
            for begin, end, peak in zip([0, *cuts], [*cuts, len(stretch)], peaks, strict=False):
                near = np.flatnonzero(stretch[begin:end] < stretch[peak] - self.span) + begin
                begin = int(max(near[near < peak].max(initial=-1) + 1, begin))
                end = int(min(near[near > peak].min(initial=len(stretch)), end))
                part = slice(first + begin, first + end)
                sounding = tonal[part]
                if sounding.any():
                    middle = self._fine(part, _fundamental(line[part][sounding], strength[part][sounding]))
                    spans.append(self._tonal(part.start, part.stop, middle, swells=len(peaks) > 1))
        return [part for part in spans if (part.last - part.first) * part.line > SHORTEST * self.fs]

    def _fine(self, frames: slice, line: float) -> float:
        """A low line [Hz], which a window's bins tell too coarsely, by the whole stretch and the hum beside it."""
        bin_ = float(self.frequencies[1])
        if line < COARSE * bin_:
            first, last = self._rows(frames.start, frames.stop)
            power, step = _spectrum(self.values[first:last], self.fs)
            low, high = max(line - bin_, NEARLY * self.band[0]), max(line, self.band[0]) + bin_
            near = _bins(step, (low + high) / 2, (high - low) / 2, len(power))
            line = max(float(near.start + np.argmax(power[near])) * step, low)  # a short stretch's bins are wide
            own = max(OF_MAINS * line, self.fs / (last - first))
            near_hums = [hum for hum in self.hums if abs(hum - line) < own]
            line = min(near_hums, key=lambda hum: abs(hum - line), default=line)
        return line

    @cached_property
    def hums(self) -> tuple[float, ...]:
        """Lines [Hz] at multiples of 50 or 60 Hz that keep their pitch from end to end, as those of the mains do."""
        from scipy.signal import stft

        size = min(len(self.values), round(STEADILY * self.fs))
        if size < SHORTLY * self.fs:
            return ()
        _, _, waves = stft(self.values, self.fs, nperseg=size, boundary=None, padded=False)
        power, step, hums = np.min(np.abs(waves) ** 2, axis=1), self.fs / size, set()
        for hum in (order * mains for mains in MAINS for order in range(1, HUMS + 1) if order * mains < 0.4 * self.fs):
            reach = max(2 * OF_MAINS * hum, step)
            near = _bins(step, hum, reach, len(power))
            peak = near.start + int(np.argmax(power[near]))
            beside = np.concatenate([power[max(0, peak - 9) : max(0, peak - 3)], power[peak + 4 : peak + 10]])
            line = _centre(power, step, (peak - 2) * step, (peak + 2) * step)
            alone = power[peak] > 10 ** (STANDS_OUT / 10) * beside.max(initial=0.0)
            if alone and abs(line - hum) < reach / 2 and self._goes_on(line):
                hums.add(line)
        return tuple(sorted(hums))

    def _goes_on(self, line: float) -> bool:
        """Whether a line [Hz] is there from end to end, never less than half as strong as it is at most."""
        time = np.arange(len(self.values)) / self.fs
        parts = np.array_split(self.values * np.exp(-2j * np.pi * line * time), max(4, round(time[-1] / SHORTLY)))
        sizes = np.array([abs(part.mean()) for part in parts])
        return bool(sizes.min() > sizes.max() / 2)

    def mains(self, line: float) -> str:
        """Which multiple of the mains a line is that keeps its pitch from end to end, in words; empty where none."""
        if line not in self.hums:
            return ""
        mains = min(MAINS, key=lambda mains: abs(line / mains - round(line / mains)) * mains)
        times = f"{round(line / mains)} times " if round(line / mains) > 1 else ""
        return f"it keeps {line:.1f} Hz from end to end, {times}the {mains:g} Hz of the mains, as their hum does"

    def _one_pitch(self, line: Array, tonal: Mask) -> list[tuple[int, int]]:
        """Runs of frames of one tone: it may glide, leap to a multiple, or be drowned for a moment."""
        octaves = np.abs(np.diff(np.log2(np.maximum(line, 1e-9))))
        bins = np.abs(np.diff(line)) / self.frequencies[1]
        near = (octaves < JUMP) | (bins < 2) | _multiples(line[1:], line[:-1])
        joined: list[tuple[int, int]] = []
        for first, last in _runs(tonal[1:] & tonal[:-1] & near):
            if joined and self._same(line, joined[-1], (first, last)):
                joined[-1] = (joined[-1][0], last)
            else:
                joined.append((first, last))
        return joined

    def _same(self, line: Array, one: tuple[int, int], other: tuple[int, int]) -> bool:
        """Whether two runs of frames are one tone with a gap shorter than what sounds on either side."""
        ended, begun = line[one[1]], line[other[0]]
        gap, shorter = other[0] - one[1], min(one[1] - one[0], other[1] - other[0])
        pitch = abs(math.log2(begun / ended)) < JUMP or bool(_multiples(begun, ended))
        return pitch and gap <= min(shorter, DROWNED * self.fs / self.hop)

    def _tonal(self, begin: int, end: int, middle: float, *, swells: bool) -> Span:
        """A stretch of frames about a line [Hz] as a burst, with how it grew."""
        first, last = self._rows(begin, end)
        before = max(0, first - self.size)
        near = self.values[before : last + self.size]
        around = filtered(near, self.fs, (0.7 * middle, min(1.4 * middle, 0.49 * self.fs)))
        smooth = _smooth(around**2, max(3, round(2 * self.fs / middle)))
        energy_before, energy = smooth[: (first - before) // 2], smooth[first - before :][: last - first]
        peak = int(np.argmax(energy))
        usual = float(np.quantile(energy, 0.75))  # of the burst: in noise the peak itself comes anywhere
        floor = FLOOR * float(np.mean(energy_before)) if len(energy_before) else 0.0
        low = np.flatnonzero(energy[:peak] < max(energy[peak] / 100, floor))
        grown = (np.flatnonzero(energy[: peak + 1] > 0.8 * usual)[0] - low.max(initial=0)) * middle / self.fs
        total = np.cumsum(energy)
        half = float(np.searchsorted(total, total[-1] / 2) / max(1, len(total)))
        loud = np.flatnonzero(energy > usual / 2)
        dips = bool(energy[loud[0] : loud[-1] + 1].min() < usual * 10 ** (-DIP / 10))
        hidden = bool(floor > energy[peak] / 100)
        return Span(first, last, True, middle, float(max(grown, 0.0)), half, swells or dips, hidden)

    def _rows(self, begin: int, end: int) -> tuple[int, int]:
        """Samples of frames: each is centred on a multiple of the hop."""
        return max(0, begin * self.hop - self.hop // 2), min(len(self.values), (end - 1) * self.hop + self.hop // 2 + 1)

    def _frame(self, row: int) -> int:
        return int(min(self.power.shape[1], round(row / self.hop)))

    def _refined(self, peak: Rows) -> Array:
        inner = np.clip(peak, 1, len(self.frequencies) - 2)
        columns = np.arange(len(peak))
        low, middle, high = (_decibel(self.power[inner + side, columns]) for side in (-1, 0, 1))
        bend = low - 2 * middle + high
        shift = np.where(bend < 0, 0.5 * (low - high) / np.where(bend < 0, bend, -1.0), 0.0)
        return np.asarray((inner + np.clip(shift, -0.5, 0.5)) * self.frequencies[1])


def pulse_train(values: Array, fs: float) -> tuple[float, float]:
    """Rate [Hz] of pulses at intervals that change slowly, and by which factor it wanders; NaN where there are none.

    Two partials beat at even intervals, too: what consists of lines that stay where they are has no pulses, nor has
    what swells, as chirps of a bird do: a slip is sudden.
    """
    from scipy.ndimage import median_filter
    from scipy.signal import find_peaks, peak_widths

    none = (math.nan, math.nan)
    if len(values) < 64:
        return none
    level = short_time_level(values, fs)
    peaks, _ = find_peaks(level, prominence=DEEP, height=level.max() - AUDIBLE)
    if len(peaks) < PULSES:
        return none
    intervals = np.diff(peaks) / fs
    change = np.abs(np.diff(np.log(intervals)))
    width = float(np.median(peak_widths(10 ** (level / 10), peaks, rel_height=0.5)[0][:-1] / fs / intervals))
    rate = float(1 / np.median(intervals))
    uneven = float(np.median(change))
    swelling = float(np.median([_rise(level[: peak + 1]) for peak in peaks])) / fs
    if uneven > APART or width > SLIM or swelling > SUDDEN or steady_share(values, fs) > PARTIALS:
        return none
    single = intervals / np.maximum(1, np.rint(rate * intervals))  # where one is not heard the next comes later
    shortest, longest = np.quantile(median_filter(single, STEADY, mode="mirror"), [0.1, 0.9])
    return rate, float(longest / shortest) * math.exp(-uneven)  # what one differs from the next is no wandering


def _rise(level: Array) -> int:
    """Samples in which a level has come to its last value from `HALF` below it."""
    below = np.flatnonzero(level < level[-1] - HALF)
    return len(level) - 1 - int(below[-1]) if len(below) else len(level)


def steady_share(values: Array, fs: float) -> float:
    """Share of the power in lines that stay where they are: those of a long window that stand out."""
    from scipy.ndimage import median_filter
    from scipy.signal import welch

    _, power = welch(values, fs, nperseg=min(len(values), round(STILL * fs)))
    apart = power > 10 ** (STANDS_OUT / 10) * median_filter(power, 2 * AROUND + 1)
    return float(power[apart].sum() / max(power.sum(), np.finfo(float).tiny))


def clipped_rows(record: Record, channel: str) -> list[tuple[int, int]]:
    """First and last rows of what stands at the end of its sensor's range.

    As :meth:`Record.check` finds it; and, since a sound has no plateaus by nature, wherever its extreme is held three
    times for three samples, each entered and left with a jump. A friction force has plateaus, and is not asked.
    """
    if record.channels[channel].unit in FORCES:
        return []
    values = record[channel]
    fault = find_clipping(record, channel)
    return [*(() if fault is None else fault.rows), *_cut_tops(values), *_cut_tops(-values)]


def _cut_tops(values: Array) -> list[tuple[int, int]]:
    top, span = float(values.max()), float(np.ptp(values))
    runs = _runs(values == top)
    long = [(first, last) for first, last in runs if last - first >= HELD and 0 < first < last < len(values)]
    edges = [(values[first - 1], values[last]) for first, last in long]
    if len(edges) < HELD or top - float(np.median(edges)) < LEAP * span:
        return []
    return [(first, last - 1) for first, last in runs]


def short_time_level(values: Array, fs: float) -> Array:
    """Level in windows as short as a pulse [dB]."""
    from scipy.signal import hilbert

    return _decibel(_smooth(np.abs(hilbert(values)) ** 2, max(3, round(PULSE * fs))))


def filtered(values: Array, fs: float, band: tuple[float, float]) -> Array:
    """What lies between two frequencies [Hz], without delay."""
    from scipy.signal import butter, sosfiltfilt

    order = butter(4, [band[0], min(band[1], 0.499 * fs)], "bandpass", fs=fs, output="sos")
    return np.asarray(sosfiltfilt(order, values - values.mean(), padlen=min(len(values) - 1, int(fs / band[0]))))


def _smooth(values: Array, width: int) -> Array:
    from scipy.ndimage import uniform_filter1d

    return np.asarray(uniform_filter1d(uniform_filter1d(values, width), width))


def _middle(values: Array, levels: Array) -> float:
    """Median weighted by power: what fades into noise has long tails, and little power in them."""
    order = np.argsort(values)
    share = np.cumsum(10 ** ((levels[order] - levels.max()) / 10))
    return float(values[order][np.searchsorted(share, share[-1] / 2)])


def _multiples(one: Array | float, other: Array | float) -> Mask:
    """Whether one frequency is two to six times another."""
    ratio = np.maximum(one, other) / np.maximum(np.minimum(one, other), 1e-9)
    whole = np.rint(ratio)
    return np.asarray((whole >= 2) & (whole <= HARMONICS) & (np.abs(ratio / whole - 1) < WHOLE))


def _fundamental(lines: Array, levels: Array) -> float:
    """Median by power of the lines, those at multiples of the lowest one that is common brought down to it."""
    base = float(np.quantile(lines, COMMON))
    orders = np.maximum(1, np.rint(lines / base))
    return _middle(lines / np.where(np.abs(lines / base / orders - 1) < JUMP, orders, 1.0), levels)


def _spectrum(values: Array, fs: float) -> tuple[Array, float]:
    """Power under Hann's window in fine bins, and their width [Hz]."""
    size = 4 * 2 ** math.ceil(math.log2(max(len(values), 16)))
    return np.abs(np.fft.rfft(values * np.hanning(len(values)), size)) ** 2, fs / size


def _decibel(power: Array | float) -> Array:
    return np.asarray(10 * np.log10(np.maximum(power, 1e-300)))


def _runs(flags: Mask) -> list[tuple[int, int]]:
    return [(int(first), int(end)) for first, end in zip(*stretches(flags), strict=True)]


def _joined(runs: list[tuple[int, int]], gap: int) -> list[tuple[int, int]]:
    joined: list[tuple[int, int]] = []
    for first, last in runs:
        if joined and first - joined[-1][1] <= gap:
            joined[-1] = (joined[-1][0], last)
        else:
            joined.append((first, last))
    return joined


def _bins(step: float, centre: float, reach: float, count: int) -> slice:
    last = math.ceil((centre + reach) / step) + 1
    return slice(max(0, math.floor((centre - reach) / step)), max(1, min(count, last)))


def _centre(power: Array, step: float, low: float, high: float) -> float:
    """Mean frequency by power of the line between two, where it stands out; the middle where there is no power."""
    part = _bins(step, (low + high) / 2, (high - low) / 2, len(power))
    weights = np.where(power[part] > power[part].max() / 100, power[part], 0.0)
    if not weights.any():
        return (low + high) / 2
    return float(np.average(np.arange(part.start, part.stop), weights=weights) * step)
