"""What a channel holds over time and frequency: the map, what stands out in it, and what the sticks tell."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from stickslip.errors import EstimateError
from stickslip.estimate import Estimate, Result
from stickslip.findings import record_name
from stickslip.identify.mechanism import UNTOLD, Mechanism, mechanism_of
from stickslip.identify.microslip import MicroSlips, microslips_of
from stickslip.identify.ringing import Ringing, find_ringing
from stickslip.identify.transition import Transition, transition_of
from stickslip.record.record import Record
from stickslip.signals.ridges import Ridge, Spike, find_ridges, find_spikes
from stickslip.signals.wavelet import CENTRE, wavelet_map, wavelet_overview

if TYPE_CHECKING:
    import xarray as xr

Answer = TypeVar("Answer")

CHOSEN = ("a", "sound", "force", "load", "friction", "v", "x")  # the channel that is looked at, the first that is there
LONG = 400_000  # samples, from which on the largest moduli of each stretch of time are kept
QUESTION = "time and frequency"


@dataclass(frozen=True, eq=False, repr=False)
class TimeFrequency(Result):
    """A channel over time and frequency.

    Attributes
    ----------
    name : str
        The record's name.
    record : Record
        The record.
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
    notes: tuple[str, ...] = ()

    @property
    def estimates(self) -> tuple[Estimate, ...]:
        """Every number found in the sticks."""
        answers = (self.transition, self.microslips)
        return tuple(each for answer in answers if answer is not None for each in answer.estimates)

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON: the answers, not the map."""
        ridges = [
            {"from": float(r.time[0]), "to": float(r.time[-1]), "frequency": float(np.median(r.frequency)),
             "lowest": float(r.frequency.min()), "highest": float(r.frequency.max())}
            for r in self.ridges
        ]  # fmt: skip
        return {
            "name": self.name,
            "channel": self.channel,
            "mechanism": None if self.mechanism is None else self.mechanism.to_dict(),
            "estimates": [estimate.to_dict() for estimate in self.estimates],
            "agreement": None if self.transition is None else self.transition.agreement,
            "sticks": [] if self.transition is None else [_stick(stick) for stick in self.transition.sticks],
            "micro_slips": [] if self.microslips is None else [vars(event) for event in self.microslips.events],
            "ridges": ridges,
            "spikes": [vars(spike) for spike in self.spikes],
            "notes": list(self.notes),
            "history": [str(step) for step in self.record.history],
        }


def time_frequency(
    record: Record,
    *,
    channel: str | None = None,
    frequencies: ArrayLike | None = None,
    wavelet_frequency: float = CENTRE,
    normalisation: str = "energy",
    mass: float | str | None = None,
    stiffness: float | str | None = None,
) -> TimeFrequency:
    """Ask a channel everything about time and frequency: the map, ridges, spikes, and what the sticks tell.

    Parameters
    ----------
    record : Record
        At one rate.
    channel : str, optional
        Which channel; the first of a, sound, force, load, friction, v, x, or any other, when not given. The sticks are
        asked of an acceleration.
    frequencies : array_like, optional
        As in :func:`wavelet_map`.
    wavelet_frequency : float
        As in :func:`wavelet_map`.
    normalisation : {"energy", "amplitude"}
        As in :func:`wavelet_map`.
    mass, stiffness : float or str, optional
        Oscillating mass [kg] and spring [N/m], for the contact's stiffness.

    Returns
    -------
    TimeFrequency

    Raises
    ------
    RecordError
        As :func:`wavelet_map`.

    Examples
    --------
    >>> import stickslip as ss
    >>> case = ss.scenarios.get("THESIS compliant 2.5Hz fk=1.1 Ky=192000 z.0174(k+Ky)")
    >>> record = ss.simulate(case.system, cycles=8).record(fs=4000).between(1.0, 3.2)
    >>> found = time_frequency(record, mass=2.42, stiffness=2310)
    >>> found.mechanism.name, found.microslips.kind
    ('double stick-slip', 'double stick-slip')
    """
    name = chosen_channel(record, channel)
    options: dict[str, Any] = {
        "frequencies": frequencies, "wavelet_frequency": wavelet_frequency, "normalisation": normalisation,
    }  # fmt: skip
    if len(record) > LONG:
        wavelets = wavelet_overview(record, name, **options)
        notes = ["The record is long: of the map the largest moduli of each stretch of time are kept, without ridges."]
        return TimeFrequency(record_name(record), record, name, wavelets, notes=tuple(notes))
    wavelets = wavelet_map(record, name, **options)
    found: dict[str, Any] = {"ridges": find_ridges(wavelets)[:5], "spikes": find_spikes(record, name)}
    notes = []

    def asked(what: str, question: Callable[[], Answer]) -> Answer | None:
        try:
            return question()
        except EstimateError as error:
            notes.append(f"{what}: {error}")
            return None

    if record.channels[name].unit == "m/s^2":
        ringing = asked("Sticks", lambda: find_ringing(record, name, question=QUESTION))
        if ringing is None:
            found["mechanism"] = Mechanism(UNTOLD, float("nan"), reason=notes[-1].partition(": ")[2])
        else:
            found["ringing"] = ringing
            found["mechanism"] = mechanism_of(ringing)
            found["transition"] = asked(
                "Transition", lambda: transition_of(ringing, record, name, mass, stiffness)
            )  # fmt: skip
            found["microslips"] = asked("Micro-slips", lambda: microslips_of(ringing))
    else:
        notes.append(f"Channel {name} is no acceleration: what the sticks tell was not asked.")
    return TimeFrequency(record_name(record), record, name, wavelets, **found, notes=tuple(notes))


def chosen_channel(record: Record, channel: str | None) -> str:
    """The channel asked for, or the first that is usual."""
    if channel is not None:
        record.require(channel, question=QUESTION)
        return channel
    return next((name for name in CHOSEN if name in record), next(iter(record)))


def _stick(stick: Any) -> dict[str, Any]:
    told = {key: value for key, value in vars(stick).items() if not isinstance(value, Estimate)}
    told["wavelet_frequency"] = stick.wavelet_frequency if np.isfinite(stick.wavelet_frequency) else None
    return {**told, **{key: value.to_dict() for key, value in vars(stick).items() if isinstance(value, Estimate)}}
