"""What a channel holds over time and frequency, told."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from stickslip.answers.frequencies import TimeFrequency
from stickslip.contact.mechanisms import UNTOLD
from stickslip.cycle.slips import SlipRinging
from stickslip.figures.wavelet import plates_of
from stickslip.story.story import Line, Story
from stickslip.story.words import doubts, interval_of, leading, number, sentence, value_of

WANDERS = 1.5  # times its lowest frequency: a ridge that goes farther may be chance


def of_map(found: TimeFrequency) -> Story:
    """A channel's map, and what its sticks tell."""
    record, faults = found.record, found.record.check()
    return Story.of_record(
        found.name, record, headline=[*leading(faults), *_headline(found)], cautions=doubts(found.estimates),
        lines=list(map(Line.of, found.estimates)), faults=[str(fault) for fault in faults], notes=found.notes,
        settings={
            "channel": found.channel, "wavelet frequency": f"{found.wavelets.attrs['wavelet_frequency']:g}",
            "normalisation": str(found.wavelets.attrs["normalisation"]), "sampling rate": f"{record.fs:g} Hz",
            "length": f"{len(record)} samples, {record.duration:g} s",
        },
        draw=lambda: plates_of(found), data=found.to_dict,
    )  # fmt: skip


def _headline(found: TimeFrequency) -> Iterator[str]:
    """What a channel holds over time and frequency, in a few sentences."""
    if found.mechanism is not None:
        sure = f" (probability {found.mechanism.probability:.2f})" if math.isfinite(found.mechanism.probability) else ""
        yield sentence(f"{found.mechanism.name}{sure}: {found.mechanism.reason.rstrip('.')}.")
    if found.transition is not None:
        ring = found.transition
        yield (
            f"In the sticks the contact rings at {value_of(ring.frequency)} (95 %: {interval_of(ring.frequency)}) "
            f"with a damping ratio of {value_of(ring.damping)}; {ring.agreement}."
        )
        if ring.stiffness is not None:
            yield f"That takes a contact of {value_of(ring.stiffness)} (95 %: {interval_of(ring.stiffness)})."
    if found.microslips is not None and found.microslips.kind != UNTOLD:
        slips = found.microslips
        yield f"{len(slips.events)} micro-slips are found in {len(slips.counts)} sticks: {slips.kind}."
    if found.slip_ringing is not None:
        yield from _of_slip_ringing(found.slip_ringing)
    if found.ridges:
        ridge = found.ridges[0]
        low, middle, high = (number(float(end(ridge.frequency)), 0.0, "Hz") for end in (np.min, np.median, np.max))
        span = middle if low == high else f"near {middle} ({low} to {high})"
        wanders = ridge.frequency.max() > WANDERS * ridge.frequency.min()
        beware = "; it wanders that far, as a sweep does, or chance in noise" if wanders else ""
        yield f"The strongest ridge of the map: {span}, from {ridge.time[0]:.4g} s to {ridge.time[-1]:.4g} s{beware}."
    if found.spikes:
        groups = found.spikes[-1].group + 1
        yield f"The signal jumps or kinks {len(found.spikes)} times, in {groups} group{'s' * (groups > 1)}."


def _of_slip_ringing(found: SlipRinging) -> Iterator[str]:
    sides = [
        f"{value_of(frequency)} {frequency.name.split()[-1]} with a damping ratio of {value_of(damping)}"
        for frequency, damping in ((found.forward, found.damping_forward), (found.back, found.damping_back))
        if frequency is not None and damping is not None
    ]
    yield f"After slip begins the friction rings at {' and '.join(sides)}{'' if found.difference else ' alone'}."
    if found.difference is not None:
        told = found.verdict if found.verdict.startswith("no") else f"it is {found.verdict}"
        low_high = interval_of(found.difference)
        yield f"Between the directions {told}: forward less back {value_of(found.difference)} (95 %: {low_high})."
