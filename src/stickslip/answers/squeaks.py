"""Everything that is asked of a record of squeaks: bursts, spectra, coupling, friction over speed, how it sounds."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from stickslip.answers.asked import Asked
from stickslip.answers.findings import plain, record_name
from stickslip.cycle.loops import NO_SLOPE, Loops, friction_loops
from stickslip.errors import EstimateError
from stickslip.estimate import Estimate, Result, kinds
from stickslip.record.record import Record
from stickslip.squeak.bursts import HEARD, Squeak, Squeaks, find_squeaks
from stickslip.squeak.couplings import Coupling, coupling
from stickslip.squeak.quality import Impulsiveness, SoundQuality, impulsiveness, sound_quality
from stickslip.squeak.spectra import BurstSpectra, burst_spectra
from stickslip.statistics import mean_of_cycles
from stickslip.units import parse_constant, parse_range, parse_value

if TYPE_CHECKING:
    from stickslip.record.check import Fault


HEARD_AT_ONCE = 5.0  # s
OF_MEDIAN = math.sqrt(math.pi / 2)  # its standard deviation over that of the mean
VIBRATING = (*HEARD, "torsion_velocity", "load")


@dataclass(frozen=True, eq=False, repr=False)
class SqueakFindings(Result):
    """What a record says about its squeaks.

    Attributes
    ----------
    name : str
        The record's name: its file, or what the caller called it.
    record : Record
        The record.
    faults : tuple of Fault
        What the check-up found in it.
    squeaks : Squeaks
        The bursts.
    beside : tuple of Squeaks
        The bursts of every other channel that vibrates.
    spectra : BurstSpectra or None
        In the bursts and outside of them.
    coupling : Coupling or None
        Which motions move together in squeaks.
    quality : SoundQuality or None
        How loud, sharp and rough a calibrated sound is heard; of a long one, five seconds about its loudest burst.
    impulses : Impulsiveness or None
        How much it is made of pulses.
    loops : Loops or None
        Friction over the forcing cycle: its level, and its slope against speed.
    normal : float or None
        Normal load [N] on the contact, where stated or measured.
    notes : tuple of str
        What could not be asked, and why.
    settings : mapping
        What was chosen and stated.
    """

    name: str
    record: Record
    faults: tuple[Fault, ...]
    squeaks: Squeaks
    beside: tuple[Squeaks, ...] = ()
    spectra: BurstSpectra | None = None
    coupling: Coupling | None = None
    quality: SoundQuality | None = None
    impulses: Impulsiveness | None = None
    loops: Loops | None = None
    normal: float | None = None
    notes: tuple[str, ...] = ()
    settings: Mapping[str, Any] = field(default_factory=dict)

    @property
    def loudest(self) -> Squeak | None:
        """The loudest of the squeaks and squeals, or of all bursts where there are none; if clipped, the longest."""
        bursts = self.squeaks.of("squeak", "squeal") or self.squeaks.bursts
        return max(bursts, key=lambda each: (np.nan_to_num(each.level, nan=-math.inf), each.duration), default=None)

    @property
    def frequency(self) -> Estimate | None:
        """Median frequency of the squeaks and squeals [Hz], its interval from the scatter between them."""
        heard = [burst.frequency for burst in self.squeaks.of("squeak", "squeal")]
        if not heard:
            return None
        found = mean_of_cycles("frequency of the squeaks", heard, unit="Hz", method="median of the bursts")
        return _of_bursts(found, float(np.median(heard)))

    @property
    def coefficient(self) -> Estimate | None:
        """Sliding friction over the normal load, where both are known."""
        return self._over_load("level", "1", "friction coefficient")

    @property
    def slope_of_coefficient(self) -> Estimate | None:
        """Change of the coefficient of friction with speed [s/m], where the load is known."""
        return self._over_load("slope", "s/m", "slope of the friction coefficient against speed")

    @property
    def estimates(self) -> tuple[Estimate, ...]:
        """Every number found."""
        joined = self.coupling
        found = [
            self.frequency,
            *(() if self.loops is None else (self.loops.level, self.loops.slope)),
            self.coefficient,
            self.slope_of_coefficient,
            *(() if joined is None else joined.estimates),
        ]
        return tuple(each for each in found if each is not None)

    def _over_load(self, name: str, unit: str, called: str) -> Estimate | None:
        if self.loops is None or self.normal is None or self.loops.level.unit != "N":
            return None
        found: Estimate = getattr(self.loops, name)
        return found.scaled(1 / self.normal, unit, called)

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON: settings, bursts, estimates, coupling, faults, notes and history."""
        told = {
            "name": self.name,
            "faults": [str(fault) for fault in self.faults],
            "settings": dict(self.settings),
            "normal_load": self.normal,
            "squeaks": {key: value for key, value in self.squeaks.to_dict().items() if key not in ("notes", "history")},
            "beside": {
                each.channel: {
                    "kind": each.kind,
                    "reference": each.reference,
                    "bursts": [burst.to_dict() for burst in each.bursts],
                }
                for each in self.beside
            },
            "coupling": None if self.coupling is None else self.coupling.to_dict(),
            "sound_quality": None if self.quality is None else self.quality.to_dict(),
            "impulses": None if self.impulses is None else self.impulses.to_dict(),
            "estimates": [each.to_dict() for each in self.estimates],
            "notes": list(self.notes),
            "history": [step.to_dict() for step in self.record.history],
        }
        return {key: plain(value) for key, value in told.items()}


def analyze_squeaks(
    record: Record, *, name: str | None = None, channel: str | None = None,
    frequencies: tuple[float, float] | str | None = None, contact: str | None = None,
    normal: float | str | None = None, lever: float | str | None = None,
) -> SqueakFindings:  # fmt: skip
    """Does it squeak, how does it sound, what moves together then, and how does friction change with speed?

    The check-up, the bursts (:func:`find_squeaks`) in the sound and in every channel that vibrates, their spectra
    (:func:`burst_spectra`), the coupling (:func:`coupling`) and the friction over the forcing cycle
    (:func:`friction_loops`). A question that can not be answered becomes a note.

    Parameters
    ----------
    record : Record
        With a sound, or a vibration; best with friction and the motion too.
    name : str, optional
        What the record is called, as "wet, 6.13 N"; its file where left out.
    channel : str, optional
        Where to listen, as in :func:`find_squeaks`.
    frequencies : tuple of float or str, optional
        Lowest and highest that are listened to [Hz], as in :func:`find_squeaks`; or in words, "500:8000".
    contact : {"ground", "base"}, optional
        What the mass slides on, as in :func:`friction_loops`.
    normal : float or str, optional
        Normal load [N]; the mean of the channel "normal" where there is one.
    lever : float or str, optional
        Distance of the friction force from the axis of the torsion [m], as in :func:`coupling`.

    Returns
    -------
    SqueakFindings

    Raises
    ------
    RecordError, EstimateError
        As :func:`find_squeaks`: the bursts can not be looked for.

    Examples
    --------
    >>> import stickslip as ss
    >>> run = ss.simulate(ss.squeak.squeak_rig("wet", load=6.13), duration=0.8)
    >>> found = analyze_squeaks(ss.squeak.squeak_record(run, snr=30, rng=1), normal=6.13)
    >>> found.squeaks.kind, bool(475 < found.frequency.value < 500), found.coefficient.includes(8 / 6.13)
    ('squeak', True, True)
    """
    band = parse_range(frequencies, "Hz") if isinstance(frequencies, str) else frequencies
    lever = None if lever is None else parse_constant("lever", lever, "m")
    faults = tuple(record.check())
    squeaks = find_squeaks(record, channel=channel, frequencies=band)
    asked = Asked(list(squeaks.notes))
    others = [each for each in VIBRATING if each in record and each != squeaks.channel]
    listen = partial(find_squeaks, record, frequencies=band)
    beside = [asked.ask(f"Bursts in {each}", partial(listen, channel=each)) for each in others]
    loops = None
    if "friction" in record and any(each in record for each in ("x", "v", "theta")):
        loops = asked.ask("Friction over the cycle", partial(friction_loops, record, contact=contact))
    else:
        asked.notes.append("No friction beside a motion is recorded: how it changes with speed can not be told.")
    if lever is not None and "torsion_velocity" not in record:
        asked.notes.append("The lever is not used: no torsion is recorded, in a channel torsion_velocity.")
    spectra = asked.ask("Spectra", partial(burst_spectra, record, squeaks=squeaks)) if squeaks.bursts else None
    joined = None
    if squeaks.squeaking:
        joined = asked.ask("Coupling", partial(coupling, record, squeaks=squeaks, lever=lever))
    return SqueakFindings(
        name=name or record_name(record),
        record=record,
        faults=faults,
        squeaks=squeaks,
        beside=tuple(each for each in beside if each is not None),
        spectra=spectra,
        coupling=joined,
        quality=_quality(record, squeaks, asked),
        impulses=asked.ask("Pulses", partial(impulsiveness, record, channel=squeaks.channel)),
        loops=loops,
        normal=_normal(record, normal),
        notes=tuple(asked.notes),
        settings={
            "channel": squeaks.channel,
            "frequencies": list(squeaks.band),
            **({"contact": contact} if contact else {}),
        },
    )


def _quality(record: Record, squeaks: Squeaks, asked: Asked) -> SoundQuality | None:
    """Of a calibrated sound; of a long one, about its loudest burst: the method takes as long as the sound."""
    if record.channels[squeaks.channel].unit != "Pa" or not squeaks.bursts:
        return None
    if record.duration > HEARD_AT_ONCE:
        loudest = max(squeaks.bursts, key=lambda each: np.nan_to_num(each.level, nan=-math.inf))
        end = record.start + record.duration
        begin = min(max(record.start, loudest.start - HEARD_AT_ONCE / 2), end - HEARD_AT_ONCE)
        record = record.between(begin, begin + HEARD_AT_ONCE)
        part = f"{begin:.4g} to {begin + HEARD_AT_ONCE:.4g} s"
        asked.notes.append(f"Loudness, sharpness and roughness are those of {part}.")
    return asked.ask("Loudness, sharpness and roughness", partial(sound_quality, record, channel=squeaks.channel))


def trend_of(slope: Estimate | None) -> str:
    """Whether friction "falls" or "rises" with speed; "flat or not told" where the slope's interval holds zero."""
    if slope is None or NO_SLOPE in kinds(slope.status) or slope.includes(0.0):
        return "flat or not told"
    return "falls" if slope.value < 0 else "rises"


def _normal(record: Record, stated: float | str | None) -> float | None:
    """The load stated, or the magnitude of the one measured."""
    if stated is not None:
        load = parse_value(stated, "N")
        if not (math.isfinite(load) and load > 0):
            raise EstimateError(f"normal = {stated}", "a normal load is positive", "give normal= in N")
        return load
    if "normal" not in record:
        return None
    measured = abs(float(np.nanmean(record["normal"]))) if np.isfinite(record["normal"]).any() else 0.0
    return measured or None


def _of_bursts(mean: Estimate, median: float) -> Estimate:
    """The median beside a mean: one burst that is told at a multiple of its pitch moves only the interval."""
    reach = OF_MEDIAN * (mean.interval[1] - mean.value)
    return replace(
        mean, value=median, interval=(median - reach, median + reach), sd=OF_MEDIAN * mean.sd,
        status=mean.status.replace("cycle", "burst"),
        checks=tuple(check.replace("cycle", "burst") for check in mean.checks),
    )  # fmt: skip
