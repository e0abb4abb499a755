"""What a channel holds over time and frequency: the map, what stands out in it, and what the sticks tell."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from stickslip.answers.findings import Inquiry, record_name
from stickslip.arrays import Array
from stickslip.balance.motion import is_measured
from stickslip.contact.frequency_transition import Transition, transition_of
from stickslip.contact.microslip import MicroSlips, microslips_of
from stickslip.contact.ringing import UNTOLD, Mechanism, Ringing, checked_mass, find_ringing, mechanism_of
from stickslip.cycle.slips import SlipRinging, slip_ringing
from stickslip.errors import ABSENT, EstimateError, RecordError
from stickslip.estimate import Constant, Estimate, Result
from stickslip.record.record import Record
from stickslip.signals.ridges import Ridge, Spike, find_ridges, find_spikes
from stickslip.signals.wavelet import CENTRE, wavelet_map, wavelet_overview
from stickslip.units import parse_range

if TYPE_CHECKING:
    import xarray as xr


CHOSEN = ("a", "sound", "force", "load", "friction", "v", "x")  # the channel that is looked at, the first that is there
LONG = 400_000  # samples, from which on the largest moduli of each stretch of time are kept
LEAST = 256  # samples, below which there is a map alone
QUESTION = "time and frequency"


@dataclass(frozen=True, eq=False, repr=False)
class TimeFrequency(Result):
    """A channel over time and frequency.

    Attributes
    ----------
    name : str
        The record's name.
    record : Record
        The record; of one that came in parts, its begin.
    channel : str
        The channel that was looked at.
    wavelets : xarray.DataArray
        Its map: of a long record, the largest moduli of each stretch of time.
    ridges : tuple of Ridge
        The five strongest lines of the map.
    spikes : tuple of Spike
        Jumps and kinks.
    ringing : Ringing or None
        The sticks in pieces, of an acceleration.
    transition, microslips : Transition, MicroSlips or None
        What the sticks of an acceleration tell.
    mechanism : Mechanism or None
        The mechanism that they show.
    slip_ringing : SlipRinging or None
        How a measured friction rings after slips begin.
    notes : tuple of str
        What could not be asked, and why.
    """

    name: str
    record: Record
    channel: str
    wavelets: xr.DataArray
    ridges: tuple[Ridge, ...] = ()
    spikes: tuple[Spike, ...] = ()
    ringing: Ringing | None = None
    transition: Transition | None = None
    microslips: MicroSlips | None = None
    mechanism: Mechanism | None = None
    slip_ringing: SlipRinging | None = None
    notes: tuple[str, ...] = ()

    @property
    def estimates(self) -> tuple[Estimate, ...]:
        """Every number found in the sticks, and after the slips begin."""
        answers = (self.transition, self.microslips, self.slip_ringing)
        return tuple(estimate for answer in answers if answer is not None for estimate in answer.estimates)

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON: the answers, not the map."""
        ridges = [
            {
                "from": float(r.time[0]),
                "to": float(r.time[-1]),
                "frequency": float(np.median(r.frequency)),
                "lowest": float(r.frequency.min()),
                "highest": float(r.frequency.max()),
            }
            for r in self.ridges
        ]
        return {
            "name": self.name,
            "channel": self.channel,
            "mechanism": None if self.mechanism is None else self.mechanism.to_dict(),
            "estimates": [estimate.to_dict() for estimate in self.estimates],
            "slip_ringing": None if self.slip_ringing is None else self.slip_ringing.verdict,
            "agreement": None if self.transition is None else self.transition.agreement,
            "sticks": [] if self.transition is None else [_stick(stick) for stick in self.transition.sticks],
            "micro_slips": [] if self.microslips is None else [vars(event) for event in self.microslips.events],
            "ridges": ridges,
            "spikes": [vars(spike) for spike in self.spikes],
            "notes": list(self.notes),
            "history": [str(step) for step in self.record.history],
        }


def time_frequency(
    source: Record | Iterable[Record],
    *,
    channel: str | None = None,
    frequencies: ArrayLike | str | None = None,
    wavelet_frequency: float = CENTRE,
    normalisation: str = "energy",
    mass: Constant | None = None,
    stiffness: Constant | None = None,
) -> TimeFrequency:
    """Ask a channel everything about time and frequency: the map, ridges, spikes, and what the sticks tell.

    Parameters
    ----------
    source : Record or iterable of Record
        At one rate; or the parts of a long one in order, as :func:`read_blocks` yields them, to be held one at a time.
    channel : str, optional
        Which channel; unless given the first of a, sound, force, load, friction, v, x, or any other that does not only
        rise or only fall, as times do. The sticks are asked of an acceleration, the ringing after slips begin of a
        measured friction beside a motion.
    frequencies : array_like or str, optional
        As in :func:`wavelet_map`; or a range in words, "500:8000" or "0.5 kHz:8 kHz".
    wavelet_frequency : float
        As in :func:`wavelet_map`.
    normalisation : {"energy", "amplitude"}
        As in :func:`wavelet_map`.
    mass, stiffness : float, str, tuple or Estimate, optional
        Oscillating mass [kg] and spring [N/m], for the contact's stiffness.

    Returns
    -------
    TimeFrequency
        Of more than 400,000 samples the map keeps the largest moduli of each stretch of time, and the first 400,000
        alone are asked about spikes and sticks.

    Raises
    ------
    RecordError
        As :func:`wavelet_map`; or no part at all, or a channel that does not move to and fro.
    EstimateError
        A mass that is not positive, a negative spring.

    Examples
    --------
    >>> import stickslip as ss
    >>> case = ss.scenarios.get("THESIS compliant 2.5Hz fk=1.1 Ky=192000 z.0174(k+Ky)")
    >>> record = ss.simulate(case.system, cycles=8).record(fs=4000).between(1.0, 3.2)
    >>> maps = time_frequency(record, mass=2.42, stiffness=2310)
    >>> maps.mechanism.name, maps.microslips.kind
    ('double stick-slip', 'double stick-slip')
    """
    checked_mass(mass, stiffness)
    parts = iter([source] if isinstance(source, Record) else source)
    first, second = next(parts, None), next(parts, None)
    if first is None:
        raise RecordError("no part at all", f"{QUESTION} needs one at least", "check the file")
    name = chosen_channel(first, channel)
    options: dict[str, Any] = {
        "frequencies": parse_range(frequencies, "Hz") if isinstance(frequencies, str) else frequencies,
        "wavelet_frequency": wavelet_frequency,
        "normalisation": normalisation,
    }
    if second is None and np.ptp(first[name]) == 0:
        raise RecordError(
            f"channel {name} is constant at {first[name][0]:g}",
            "only what changes has a frequency",
            "look at its cable, range and column, or name another channel=",
        )
    if second is None and len(first) <= LONG:
        begin, long = first, []
        wavelets = wavelet_map(first, name, **options)
        ridges = tuple(find_ridges(wavelets)[:5])
    else:
        begin = first.rows(0, min(LONG, len(first)))
        rest = itertools.chain(() if second is None else (second,), parts)
        wavelets, ridges = wavelet_overview(itertools.chain([first], rest), name, **options), ()
        long = [
            "The record is long: of the map the largest moduli of each stretch of time are kept, without ridges; "
            f"spikes and sticks are those of its first {begin.duration:.4g} s."
        ]
    answers, notes = _spikes_and_sticks(begin, name, mass, stiffness)
    record = first if second is None else begin
    return TimeFrequency(record_name(first), record, name, wavelets, ridges, **answers, notes=(*long, *notes))


def _spikes_and_sticks(
    record: Record, name: str, mass: Constant | None, stiffness: Constant | None
) -> tuple[dict[str, Any], list[str]]:
    """What is asked beside the map, and why some of it has no answer."""
    if len(record) < LEAST:
        return {}, [f"{len(record)} samples are mapped, and too few to ask about spikes and sticks: give {LEAST}."]
    answers: dict[str, Any] = {"spikes": find_spikes(record, name)}
    clocks = [channel for channel in record if name not in CHOSEN and _runs_on(record[channel])]
    notes = [f"Channel {clock} only rises or only falls, as times do: {name} is mapped." for clock in clocks[:1]]
    ask = functools.partial(Inquiry(notes).ask, aside=True)
    if name == "friction" and is_measured(record, name) and any(channel in record for channel in ("x", "v", "theta")):
        answers["slip_ringing"] = ask("Ringing after slips", lambda: slip_ringing(record))
        return answers, notes
    if record.channels[name].unit != "m/s^2":
        notes.append(f"Channel {name} is no acceleration: what the sticks tell was not asked.")
        return answers, notes
    try:
        ringing = find_ringing(record, name, question=QUESTION, mass=mass, stiffness=stiffness)
    except EstimateError as error:
        answers["mechanism"] = Mechanism(UNTOLD, float("nan"), reason=str(error))
        return answers, notes
    answers["ringing"] = ringing
    answers["mechanism"] = mechanism_of(ringing)
    answers["transition"] = ask("Transition", lambda: transition_of(ringing, mass, stiffness))
    if answers["transition"] is not None:  # where nothing rings, nothing cuts a ring off
        answers["microslips"] = ask("Micro-slips", lambda: microslips_of(ringing))
    return answers, notes


def chosen_channel(record: Record, channel: str | None) -> str:
    """The channel asked for, or the first that is usual, or else the first that is no clock."""
    if channel is not None:
        record.require(channel, question=QUESTION, kind=ABSENT)
        return channel
    usual = next((name for name in CHOSEN if name in record), None)
    if usual is not None:
        return usual
    swings = next((name for name in record if not _runs_on(record[name])), None)
    if swings is None:
        raise RecordError(
            f"channels {', '.join(record)} only rise or only fall",
            "a clock or a ramp is no vibration to be mapped",
            "name the channels of the file, or the one that is meant",
        )
    return swings


def _runs_on(values: Array) -> bool:
    """Whether values only rise or only fall, as a column of times does."""
    steps = np.diff(values)
    return bool(len(steps) > 1 and ((steps > 0).all() or (steps < 0).all()))


def _stick(stick: Any) -> dict[str, Any]:
    numbers = {key: value for key, value in vars(stick).items() if not isinstance(value, Estimate)}
    numbers["wavelet_frequency"] = stick.wavelet_frequency if np.isfinite(stick.wavelet_frequency) else None
    return {**numbers, **{key: value.to_dict() for key, value in vars(stick).items() if isinstance(value, Estimate)}}
