"""Bursts of sound or vibration: where they are, how they sound, whether friction makes them, and what was heard."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import EstimateError, RecordError
from stickslip.estimate import Estimate, Plain, Result, Status, plain
from stickslip.record.record import Record, require_record
from stickslip.squeak.hearing import LASTS, LOWEST, PARTIALS, Hearing, Span, chosen_channel, clipped_rows, filtered
from stickslip.squeak.sound import REFERENCES, level, reference_of
from stickslip.statistics import mean_of_cycles

WORDS = {
    "squeak": "intermittent and tonal", "squeal": "sustained and tonal", "creak": "a train of stick-slip pulses",
    "scrape": "broad band", "tonal": "tonal, with no sign of friction", "noise": "broad band throughout",
}  # fmt: skip
OF_MEDIAN = math.sqrt(math.pi / 2)  # its standard deviation over that of the mean

GROWN = 12.0  # cycles of growth to the peak: what is struck is there within fewer
EVEN = 0.35  # of a burst's length at which half of its energy has come: a ring that dies away has it earlier
SUSTAINED = 0.25  # s: a squeak is shorter
LOCKED, WEAK = 2, -35.0  # overtones that a contact's limit cycle has, and dB below the fundamental at which they count
PLAYED = 2100.0  # Hz: C7, up to which voices and instruments reach; higher notes are struck, and die away
# Set on seeds 1000 to 5100 of tests/sound_sources.py, where beeps glide by 0.3 % in noise and clocks wander by 1.1:
GLIDES = 0.01  # of the pitch: what is switched on electrically keeps it
VOICED = 60.0  # pulses in a second, from which on they may be those of a voice
WANDERS = 1.2  # factor by which the rate of stick-slip changes as it goes on; that of a machine or a clock does not
FREE, FED = 0.21, 0.3  # of the friction's level: it swings less beneath a free ringing, and more beneath a squeak
# Set on seeds 1 to 60 and 910000 to 910029 of tests/sound_strangers.py:
ONE_PITCH, CLEAR = 0.06, 0.4  # of the pitch of a contact's tones, and the share of the power in what has a pitch
GOES_ON, EVENLY = 0.6, 0.015  # s that a tone lasts, and that the intervals of a signal differ by at most
THROUGH = 1.5  # periods of the forced motion: what sounds longer goes on through reversals
QUIET = 45.0  # dB re 20 µPa: less is not heard beside a running rig
RINGS = 30.0  # cycles around a burst that a filter about its tone needs
RISEN = 0.1  # of the largest sliding speed: slower is no sliding
MOSTLY = 0.5  # of a burst that the contact slides through
ALIKE = 0.1  # of a rate: two that differ by less are the same
TANGENTIAL = ("a", "v", "x", "friction", "load", "force")  # channels in which dry friction jumps at every reversal
FRICTION = ("squeak", "squeal", "creak", "scrape")


@dataclass(frozen=True)
class Squeak(Plain):
    """A burst.

    Attributes
    ----------
    start, duration : float
        When it begins, and how long it lasts [s].
    frequency : float
        Dominant frequency [Hz], averaged by power over the burst; of a creak that of its spectrum.
    kind : str
        "squeak" (intermittent and tonal), "squeal" (sustained and tonal), "creak" (stick-slip pulses), "scrape" (broad
        band), "tonal" (tonal, with no sign of friction) or "noise".
    friction : str
        Whether friction makes it: "shown" by the motion beside it, "likely" by the sound alone, "not told", or "no".
    evidence : str
        Why it is called so, and what can not be told.
    level : float
        RMS [dB]: re 20 µPa of a calibrated sound, 1 µm/s^2, 1 nm/s or 1 µN (ISO 1683); re 1 where the unit is none of
        these, as :attr:`Squeaks.reference` says. NaN where it is clipped.
    weighted_level : float
        A-weighted level of a calibrated sound [dB]; else NaN.
    levels : dict of str to float
        Of every vibrating channel meanwhile [dB], with the references of ISO 1683.
    harmonics : tuple of (float, float)
        Frequency [Hz] and level [dB] against the dominant one of each harmonic that stands out.
    tonality : float
        Share of the power in the dominant frequency and its harmonics, 0 to 1.
    rate : float
        Pulses in a second of a creak [Hz]; else NaN.
    phase : float
        Where its loudest moment lies in the forcing cycle, 0 to 1 from the largest displacement on; NaN where no motion
        is recorded.
    speed : float
        Velocity of sliding at that moment [m/s]; NaN where no motion is recorded.
    loud : tuple of float
        From when to when it is within ten decibel of its loudest moment [s].
    status : str
        "ok", or what is wrong with it.
    """

    start: float
    duration: float
    frequency: float
    kind: str
    friction: str
    evidence: str
    level: float
    weighted_level: float
    levels: dict[str, float]
    harmonics: tuple[tuple[float, float], ...]
    tonality: float
    rate: float
    phase: float
    speed: float
    loud: tuple[float, float]
    status: str

    @property
    def end(self) -> float:
        """When it ends [s]."""
        return self.start + self.duration


@dataclass(frozen=True, eq=False)
class Squeaks(Result):
    """The bursts of a record.

    Attributes
    ----------
    bursts : tuple of Squeak
        In the order of time.
    channel : str
        Where they were heard.
    reference : str
        What levels are relative to ("20 µPa").
    forcing : float
        Frequency of the forced motion [Hz]; NaN where none is recorded.
    record : Record
        Where they were found.
    notes : tuple of str
        What could not be told, and why.
    cautions : tuple of str
        Those of the notes that all of the numbers rest on.
    band : tuple of float
        Lowest and highest frequency that were listened to [Hz].
    threshold : float
        Level [dB] from which on a squeak of a tenth of a second and a hundred cycles would have been heard, at any
        frequency in the band (19 in 20); NaN where the channel is clipped.
    clicks : int
        How often something sounded for too short a time to be a burst.
    """

    bursts: tuple[Squeak, ...]
    channel: str
    reference: str
    forcing: float
    record: Record
    notes: tuple[str, ...] = ()
    band: tuple[float, float] = (0.0, math.inf)
    cautions: tuple[str, ...] = ()
    threshold: float = math.nan
    clicks: int = 0

    @property
    def kind(self) -> str:
        """The kind that most of the sounding time has; "quiet" where there is no burst."""
        time = {kind: sum(b.duration for b in self.bursts if b.kind == kind) for kind in WORDS}
        return max(time, key=lambda kind: time[kind]) if self.bursts else "quiet"

    @property
    def squeaking(self) -> bool:
        """Whether any burst is a squeak or a squeal."""
        return any(burst.kind in ("squeak", "squeal") for burst in self.bursts)

    @property
    def untold(self) -> tuple[Squeak, ...]:
        """The bursts of which it can not be told whether friction makes them."""
        return tuple(burst for burst in self.bursts if burst.friction == "not told")

    @property
    def answer(self) -> str:
        """Whether it "squeaks", "squeals", "creaks" or "does not squeak", or that this "can not be told"."""
        if self.squeaking:
            return "squeals" if len(self.of("squeal")) > len(self.of("squeak")) else "squeaks"
        if self.of("creak"):
            return "creaks"
        return "can not be told" if self.untold else "does not squeak"

    @property
    def loudest(self) -> Squeak | None:
        """The loudest of the squeaks and squeals, or of all bursts where there are none; if clipped, the longest."""
        bursts = self.of("squeak", "squeal") or self.bursts
        return max(bursts, key=lambda burst: (np.nan_to_num(burst.level, nan=-math.inf), burst.duration), default=None)

    @property
    def frequency(self) -> Estimate | None:
        """Median frequency of the squeaks and squeals [Hz], its interval from the scatter between them.

        One burst that is told at a multiple of its pitch moves only the interval.
        """
        heard = [burst.frequency for burst in self.of("squeak", "squeal")]
        if not heard:
            return None
        mean = mean_of_cycles("frequency of the squeaks", heard, unit="Hz", method="median of the bursts", of="burst")
        median, reach = float(np.median(heard)), OF_MEDIAN * (mean.interval[1] - mean.value)
        return replace(mean, value=median, interval=(median - reach, median + reach), sd=OF_MEDIAN * mean.sd)

    @property
    def estimates(self) -> tuple[Estimate, ...]:
        """The median frequency, where anything squeaks."""
        return () if self.frequency is None else (self.frequency,)

    def of(self, *kinds: str) -> tuple[Squeak, ...]:
        """The bursts of some kinds."""
        unknown = [kind for kind in kinds if kind not in WORDS]
        if unknown:
            raise RecordError(f"no kind of burst is called '{unknown[0]}'", f"there are {', '.join(WORDS)}", "name one")
        return tuple(burst for burst in self.bursts if burst.kind in kinds)

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        names = ("channel", "kind", "squeaking", "reference", "forcing", "threshold", "clicks", "bursts", "notes")
        history = [str(step) for step in self.record.history]
        return {**plain({name: getattr(self, name) for name in names}), "history": history}

    def __repr__(self) -> str:
        rows = [
            f"{b.start:.3f} to {b.end:.3f} s: {b.kind}, {b.frequency:.4g} Hz, "
            + ("clipped, no level" if math.isnan(b.level) else f"{b.level:.1f} dB re {self.reference}")
            for b in self.bursts
        ]
        return "\n  ".join([f"Squeaks in {self.channel}: {self.kind}", *rows])


def find_squeaks(
    record: Record, *, channel: str | None = None, frequencies: tuple[float, float] | None = None, span: float = 20.0
) -> Squeaks:
    """Does it squeak: when, at which frequency, how loudly, and does friction make the sound?

    A burst is tonal where one line of the short-time spectrum stands out and goes on without a jump; it is cut where
    its level falls by ten decibel and rises again. What remains is a creak where pulses follow each other at
    intervals that change slowly, else broad band. Which tonal bursts are friction's is told by what is recorded beside
    them:

    - motion and friction: those in which the contact slides and the friction force swings by 30 % of its level or more
      at that frequency; from 21 % on it can not be told, as near the load or speed at which squeaking begins;
    - motion alone: those that are not struck (they grow for twelve cycles, or half of their energy comes later than a
      third of their length) while the contact slides;
    - sound alone: those of a hundred cycles with two overtones at least in whole ratios (one, where the band holds no
      more), as the limit cycle of a contact has, above the 2.1 kHz that voices and most instruments reach, that grow
      for twelve cycles or glide by 1 %, which what is switched on electrically does not; and only where the record is
      as of one contact: one pitch, no even intervals as of a signal, nothing that goes on as a drive or a whistle does.
      A creak's rate wanders, and that of a clock does not.

    Of everything else it can not be told; `threshold` says how loud a squeak would have been heard.

    Parameters
    ----------
    record : Record
        With a sound, or a vibration.
    channel : str, optional
        Where to listen; the first of sound, normal_acceleration, a, friction, ch1, or any other.
    frequencies : tuple of float, optional
        Lowest and highest that are listened to [Hz]; 50 Hz to 0.45 of the rate where left out.
    span : float
        Decibel below its peak where a burst begins and ends.

    Returns
    -------
    Squeaks

    Raises
    ------
    RecordError
        The channel is missing or broken, or its rate too low.
    EstimateError
        It is silent or constant throughout.

    Examples
    --------
    >>> from stickslip.solve.simulate import simulate
    >>> from stickslip.squeak.sound import squeak_record
    >>> from stickslip.squeak.stability import squeak_rig
    >>> squeaks = find_squeaks(squeak_record(simulate(squeak_rig("wet", 6.13), duration=1.0), snr=30, rng=1))
    >>> squeaks.kind, all(475 < burst.frequency < 500 for burst in squeaks.of("squeak"))
    ('squeak', True)
    """
    require_record(record)
    name = chosen_channel(record, channel)
    record.require_clean(name, question="hearing squeaks", samples=256)
    low, high = frequencies or (LOWEST, 0.45 * record.fs)
    if not 0 < low < high <= 0.5 * record.fs or high < 4 * low:
        raise RecordError(
            f"{low:g} to {high:g} Hz at {record.fs:g} samples a second",
            "squeaks are heard over two octaves at least, below half the rate",
            "give frequencies=, or record at a higher rate",
        )
    if not span > 3:
        raise RecordError(f"span = {span} dB", "a burst ends some decibel below its peak", "leave it out, or give 20")
    values = record[name] - record[name].mean()
    if not values.any():
        what = "constant" if record[name].any() else "silent"
        raise EstimateError(f"channel {name} is {what}", "a burst needs a sound", "name another channel=")
    hearing = Hearing.of(values, record.fs, (low, high), span)
    motion = ForcedMotion.of(record)
    unit = record.channels[name].unit
    listener = _Listener(record, name, hearing, motion, clipped_rows(record, name))
    bursts = _of_one_contact(sorted((listener.burst(part) for part in hearing.spans), key=lambda burst: burst.start))
    cautions = tuple(listener.cautions(unit))
    notes = (*cautions, *listener.notes(unit))
    power = math.nan if listener.clipped else max(hearing.threshold, 1e-300)
    heard = 10 * math.log10(power / REFERENCES.get(unit, 1.0) ** 2)
    rest = ((low, high), cautions, heard, hearing.clicks)
    return Squeaks(tuple(bursts), name, reference_of(unit), motion.frequency, record, notes, *rest)


@dataclass(frozen=True, eq=False)
class ForcedMotion:
    """The forced motion beside the sound: its frequency [Hz], velocity of sliding [m/s] and phase, where recorded."""

    frequency: float = math.nan
    velocity: Array | None = None
    phase: Array | None = None

    @classmethod
    def of(cls, record: Record) -> ForcedMotion:
        from scipy.signal import butter, hilbert, sosfiltfilt

        name = next((channel for channel in ("x", "v") if channel in record and np.ptp(record[channel]) > 0), None)
        if name is None or not np.all(np.isfinite(record[name])):
            return cls()
        values = record[name] - record[name].mean()
        power = np.abs(np.fft.rfft(values * np.hanning(len(values)))) ** 2
        frequency = float(np.argmax(power) * record.fs / len(values))
        if not 1.5 / record.duration < frequency < 0.02 * record.fs:
            return cls()
        order = butter(3, min(8 * frequency, LOWEST, 0.4 * record.fs), fs=record.fs, output="sos")
        slow = sosfiltfilt(order, values)
        velocity = slow if name == "v" else np.gradient(slow) * record.fs
        place = butter(2, [0.5 * frequency, 1.5 * frequency], "bandpass", fs=record.fs, output="sos")
        turn = np.angle(hilbert(sosfiltfilt(place, values))) / (2 * np.pi)
        return cls(frequency, velocity, np.mod(turn - (0.25 if name == "v" else 0.0), 1.0))

    @property
    def slowest(self) -> float:
        """Speed [m/s] below which nothing slides."""
        return math.nan if self.velocity is None else float(RISEN * np.max(np.abs(self.velocity)))

    def sliding(self, first: int, last: int) -> float:
        """Share of the rows in which it slides."""
        return 0.0 if self.velocity is None else float(np.mean(np.abs(self.velocity[first:last]) > self.slowest))


@dataclass(frozen=True, eq=False)
class _Listener:
    """What turns a stretch of a record into a burst."""

    record: Record
    name: str
    hearing: Hearing
    motion: ForcedMotion
    clipped: list[tuple[int, int]]

    def burst(self, part: Span) -> Squeak:
        record, hearing, motion = self.record, self.hearing, self.motion
        rows = slice(part.first, part.last)
        values, unit = record[self.name][rows] - record[self.name].mean(), record.channels[self.name].unit
        spoilt = any(first < part.last and last >= part.first for first, last in self.clipped)
        frequency, harmonics, tonality = hearing.tones(part)
        kind, friction, evidence = self._kind(part, () if spoilt else harmonics)
        loudest, loud = hearing.loudest(part)
        reference = REFERENCES.get(unit, 1.0)
        calibrated = unit == "Pa" and not spoilt
        ends = " and ".join(self._cut(part))
        cut = f"cut by the {ends} of the record: it may last longer" if ends else ""
        clipped = "clipped: its level and harmonics can not be told" if spoilt else ""
        return Squeak(
            start=float(record.time[part.first]),
            duration=(part.last - part.first) / record.fs,
            frequency=frequency,
            kind=kind,
            friction=friction,
            evidence=evidence,
            level=math.nan if spoilt else level(values, reference, fs=record.fs),
            weighted_level=level(values, reference, fs=record.fs, weighted=True) if calibrated else math.nan,
            levels=self._levels(rows),
            harmonics=() if spoilt else harmonics,
            tonality=tonality,
            rate=part.rate if kind == "creak" else math.nan,
            phase=float(motion.phase[loudest]) if motion.phase is not None else math.nan,
            speed=float(motion.velocity[loudest]) if motion.velocity is not None else math.nan,
            loud=(float(record.time[loud[0]]), float(record.time[loud[1] - 1])),
            status=Status(cut, clipped),
        )

    @cached_property
    def vibrations(self) -> dict[str, Array]:
        """Every channel that vibrates, in the band that is listened to."""
        units = {name: channel.unit for name, channel in self.record.channels.items()}
        return {
            name: filtered(self.record[name], self.record.fs, self.hearing.band)
            for name, unit in units.items()
            if unit in REFERENCES and np.all(np.isfinite(self.record[name]))
        }

    def _levels(self, rows: slice) -> dict[str, float]:
        references = {name: REFERENCES[self.record.channels[name].unit] for name in self.vibrations}
        fs = self.record.fs
        return {name: level(values[rows], references[name], fs=fs) for name, values in self.vibrations.items()}

    def _kind(self, part: Span, harmonics: tuple[tuple[float, float], ...]) -> tuple[str, str, str]:
        """Its kind, whether friction makes it, and why."""
        duration = (part.last - part.first) / self.record.fs
        sliding = self.motion.sliding(part.first, part.last)
        slides = sliding > MOSTLY
        if not part.tonal:
            return self._broad(part, slides=slides)
        if self.motion.velocity is not None and not slides:
            much = (
                f"the contact slides (faster than {1e3 * self.motion.slowest:.2g} mm/s) for {100 * sliding:.0f} % of it"
            )
            return "tonal", "no", f"{much}, less than a squeak needs" if sliding else "nothing slides meanwhile"
        if self.motion.velocity is None and (hum := self.hearing.mains(part.line)):
            return "tonal", "not told", f"of sound alone: {hum}"
        kind = "squeal" if duration * self.motion.frequency > THROUGH else "squeak"
        if self.motion.velocity is not None and "friction" in self.record:
            return self._swinging(part, kind)
        if part.growth < GROWN and self._cut(part):
            return "tonal", "not told", "cut by the record: whether it grew or was struck can not be told"
        heard = self.hearing.values[part.first : part.last]
        if self.record.channels[self.name].unit == "Pa" and level(heard, REFERENCES["Pa"], fs=self.record.fs) < QUIET:
            return "tonal", "no", f"quieter than {QUIET:g} dB: it would not be heard"
        if part.growth < GROWN and part.middle < EVEN and part.hidden:
            return "tonal", "not told", "what sounds before it hides whether it grew or was struck"
        if part.growth < GROWN and part.middle < EVEN:
            return "tonal", "no", f"it is there after {part.growth:.1f} cycles and dies away: it is struck, not fed"
        if self.motion.velocity is not None:
            return kind, "likely", f"it grows for {part.growth:.0f} cycles while the contact slides"
        return self._by_overtones(part, duration, harmonics)

    def _by_overtones(
        self, part: Span, duration: float, harmonics: tuple[tuple[float, float], ...]
    ) -> tuple[str, str, str]:
        """Of a tone that is heard alone: a rubbing contact repeats, so that its overtones stand in whole ratios."""
        locked, cycles = sum(strength > WEAK for _, strength in harmonics), duration * part.line
        needed = max(1, min(LOCKED, int(self.hearing.band[1] / part.line / (1 + ALIKE)) - 1))  # as the band holds
        if cycles < LASTS:
            short = (
                f"of sound alone: it lasts {cycles:.0f} cycles of its tone; {LASTS:g} are needed to tell overtones in"
            )
            return "tonal", "not told", f"{short} whole ratios, as a rubbing contact has, from those of a bell"
        if locked < needed:
            many = "one overtone" if locked else "no overtone"
            return "tonal", "not told", f"of sound alone: {many} in a whole ratio, and a rubbing contact has {needed}"
        deepest = self.hearing.deeper(part)
        if deepest < PLAYED:
            reach = (
                f"of sound alone: at {deepest:.0f} Hz it may be a voice, an instrument or a machine, which reach up to"
            )
            return "tonal", "not told", f"{reach} {PLAYED:g} Hz"
        if self.hearing.glide(part) < GLIDES and (why := self._steady(part)):
            return "tonal", "not told", f"of sound alone: it keeps one pitch, and {why}"
        return (
            "squeal" if duration > SUSTAINED else "squeak",
            "likely",
            (
                f"{locked} overtone{'s' * (locked > 1)} in whole ratios, at one pitch, growing or gliding, as of a "
                "rubbing contact; sound alone does not prove friction: a reed or a voice sounds so too"
            ),
        )

    def _steady(self, part: Span) -> str:
        """Why a tone that keeps one pitch may be a machine's; empty where it is seen to grow, and stays."""
        if part.first <= self.hearing.hop:
            return "how it began is not recorded"
        if part.swells:
            return "it swells and fades, as two tones that beat do"
        if part.growth < GROWN:
            return f"is there after {part.growth:.1f} cycles, as what is switched on electrically is"
        return ""

    def _swinging(self, part: Span, kind: str) -> tuple[str, str, str]:
        """Of a tone while the contact slides: whether the friction force swings with it as it must to feed it."""
        share = self._modulation(part)
        evidence = f"the friction force swings by {100 * share:.0f} % of its level at {part.line:.0f} Hz as it slides"
        if share >= FED:
            return kind, "shown", evidence
        if share <= FREE:
            return "tonal", "no", f"{evidence}: too little to feed it"
        between = (
            f"more than beneath a free ringing, {100 * FREE:.0f} %, and less than beneath a squeak, {100 * FED:.0f} %"
        )
        return "tonal", "not told", f"{evidence}: {between}; near the threshold it can not be told"

    def _broad(self, part: Span, *, slides: bool) -> tuple[str, str, str]:
        rate = part.rate
        if (
            not math.isnan(rate)
            and self.name in TANGENTIAL  # the jumps of dry friction come once or twice in a forcing cycle
            and any(abs(rate / (turns * self.motion.frequency) - 1) < ALIKE for turns in (1, 2))
        ):
            return "noise", "no", f"its {rate:.3g} jumps in a second are the reversals of the motion"
        if not math.isnan(rate) and (slides or (rate < VOICED and part.wander > WANDERS)):
            evidence = (
                f"pulses follow each other at intervals that change slowly, {rate:.3g} in a second, as in stick-slip"
            )
            return "creak", "shown" if slides else "likely", evidence
        if slides:
            return "scrape", "shown", "broad band while the contact slides"
        if self.hearing.partials(part) > PARTIALS:
            return "tonal", "not told", "several partials that do not glide, as those of a bell"
        if not math.isnan(rate):
            evidence = f"of sound alone: {rate:.3g} pulses in a second"
            if rate >= VOICED:
                return "scrape", "not told", f"{evidence}, as a voice has from {VOICED:g} on"
            return "scrape", "not told", f"{evidence} keep their rate, as those of a machine or a clock do"
        if part.throughout:
            return "noise", "not told", "broad band from end to end: what makes it can not be told"
        evidence = "broad band, and it begins and ends; of sound alone it can not be told whether anything rubs"
        return "scrape", "not told", evidence

    def _modulation(self, part: Span) -> float:
        """Amplitude of the friction force about the tone, over the friction's level."""
        band = (0.8 * part.line, min(1.2 * part.line, 0.49 * self.record.fs))
        before = max(0, part.first - round(RINGS * self.record.fs / part.line))
        near = self.record["friction"][before : part.last + part.first - before]
        rows = slice(part.first - before, part.last - before)
        beats = filtered(near, self.record.fs, band)[rows]
        return float(math.sqrt(2) * np.std(beats) / max(np.mean(np.abs(near[rows])), np.finfo(float).tiny))

    def _cut(self, part: Span) -> list[str]:
        """Which ends of the record cut it."""
        margin = self.hearing.hop
        return [*["beginning"] * (part.first <= margin), *["end"] * (part.last >= len(self.record) - margin)]

    def cautions(self, unit: str) -> list[str]:
        """What every level and every burst rests on."""
        cautions = []
        if unit == "1":
            cautions.append(
                f"Channel {self.name} is not calibrated: its levels are relative to 1, and no sound pressure level is "
                f'told; state its sensitivity when reading, as in channels={{"sound": "{self.name} * 2.5 [Pa]"}}.'
            )
        return [*cautions, *self._unheard(unit)]

    def notes(self, unit: str) -> list[str]:
        """What could not be told, beside the cautions."""
        notes = []
        if unit not in ("1", *REFERENCES):
            notes.append(f"Levels of channel {self.name} are re 1 {unit}: it is neither a sound nor a vibration.")
        if self.motion.velocity is None:
            notes.append("No forced motion is recorded beside it: phase and sliding speed can not be told.")
        return notes

    def _unheard(self, unit: str) -> list[str]:
        """Which channels of a stereo file were not listened to; nothing where another than the first was chosen."""
        channels = self.record.channels
        others = [name for name in self.record if name.startswith("ch") and channels[name].unit == unit][1:]
        if self.name != "ch1" or not others:
            return []
        power = {name: float(np.mean(np.nan_to_num(self.record[name]) ** 2)) for name in others}
        loudest = max(power, key=lambda name: power[name])
        louder = 10 * math.log10(max(power[loudest], 1e-300) / float(np.mean(self.record[self.name] ** 2)))
        more = f", {louder:.0f} dB louder" if louder > 1 else ""
        return [
            f"Heard in {self.name} alone; the record has {' and '.join(others)} too{more}: to hear another, choose it "
            f'with channel="{loudest}".'
        ]


def _of_one_contact(bursts: list[Squeak]) -> list[Squeak]:
    """The bursts, those that sound alone made likely to be friction's only where the whole record is like a contact."""
    claimed = [burst for burst in bursts if burst.friction == "likely" and burst.kind in ("squeak", "squeal")]
    alone = [burst for burst in claimed if math.isnan(burst.speed)]
    why = _unlike_a_contact(bursts, alone) if alone else ""
    if not why:
        return bursts
    evidence = f"of sound alone: {why}"
    alike: dict[str, Any] = {"kind": "tonal", "friction": "not told", "evidence": evidence}
    return [replace(burst, **alike) if burst in alone else burst for burst in bursts]


def _unlike_a_contact(bursts: list[Squeak], claimed: list[Squeak]) -> str:
    """Why the tones of a record may be those of an instrument, a drive or a signal; empty where they are a contact's.

    A contact squeaks at one pitch, each time for as long as it happens to; notes differ in pitch, signals come at even
    intervals, and what goes on may be a drive, a whistle or a kettle.
    """
    clear = [burst for burst in bursts if burst.kind != "noise" and burst.tonality > CLEAR]
    tones = [burst for burst in clear if burst in claimed or burst.duration * burst.frequency > LASTS]
    if not tones:
        return f"less than {100 * CLEAR:.0f} % of its power is in its tones"
    pitch = float(np.median([tone.frequency for tone in tones]))
    if any(abs(tone.frequency / pitch - 1) > ONE_PITCH for tone in tones):
        return "it has several pitches, as an instrument, a voice or a bird has"
    if max(tone.duration for tone in tones) > GOES_ON:
        return f"it goes on for more than {GOES_ON:g} s, as a drive or a whistle does"
    if 2 * len(claimed) <= len(tones):
        return "most of its tones lack what those of a rubbing contact have"
    # one that the record begins in began sooner, which is no interval
    gaps = np.diff([tone.start for tone in tones if tone.start > EVENLY])
    if len(gaps) > 1 and np.ptp(gaps) < EVENLY:
        return "its bursts come at even intervals, as those of a signal do"
    return ""
