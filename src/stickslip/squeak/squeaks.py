"""What was heard of a record: its bursts, each with its kind and whether friction makes it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stickslip.errors import RecordError
from stickslip.estimate import Estimate, Plain, Result, plain
from stickslip.record.record import Record
from stickslip.statistics import mean_of_cycles

WORDS = {
    "squeak": "intermittent and tonal", "squeal": "sustained and tonal", "creak": "a train of stick-slip pulses",
    "scrape": "broad band", "tonal": "tonal, with no sign of friction", "noise": "broad band throughout",
}  # fmt: skip
OF_MEDIAN = math.sqrt(math.pi / 2)  # its standard deviation over that of the mean


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
        RMS [dB]: re 20 uPa of a calibrated sound, 1 um/s^2, 1 nm/s or 1 uN (ISO 1683); re 1 where the unit is none of
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
        What levels are relative to ("20 uPa").
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
        names = ("channel", "kind", "squeaking", "reference", "forcing", "threshold", "bursts", "notes")
        history = [str(step) for step in self.record.history]
        return {**plain({name: getattr(self, name) for name in names}), "history": history}

    def __repr__(self) -> str:
        rows = [
            f"{b.start:.3f} to {b.end:.3f} s: {b.kind}, {b.frequency:.4g} Hz, "
            + ("clipped, no level" if math.isnan(b.level) else f"{b.level:.1f} dB re {self.reference}")
            for b in self.bursts
        ]
        return "\n  ".join([f"Squeaks in {self.channel}: {self.kind}", *rows])
