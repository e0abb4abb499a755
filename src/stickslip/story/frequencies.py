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


def of_map(findings: TimeFrequency) -> Story:
    """A channel's map, and what its sticks tell."""
    record, faults = findings.record, findings.record.check()
    return Story.of_record(
        findings.name, record, headline=[*leading(faults), *_headline(findings)], cautions=doubts(findings.estimates),
        lines=list(map(Line.of, findings.estimates)), faults=[str(fault) for fault in faults], notes=findings.notes,
        settings={
            "channel": findings.channel, "wavelet frequency": f"{findings.wavelets.attrs['wavelet_frequency']:g}",
            "normalisation": str(findings.wavelets.attrs["normalisation"]), "sampling rate": f"{record.fs:g} Hz",
            "length": f"{len(record)} samples, {record.duration:g} s",
        },
        draw=lambda: plates_of(findings), data=findings.to_dict,
    )  # fmt: skip


def _headline(findings: TimeFrequency) -> Iterator[str]:
    """What a channel holds over time and frequency, in a few sentences."""
    if findings.mechanism is not None:
        sure = (
            f" (probability {findings.mechanism.probability:.2f})"
            if math.isfinite(findings.mechanism.probability)
            else ""
        )
        yield sentence(f"{findings.mechanism.name}{sure}: {findings.mechanism.reason.rstrip('.')}.")
    if findings.transition is not None:
        ring = findings.transition
        yield (
            f"In the sticks the contact rings at {value_of(ring.frequency)} (95 %: {interval_of(ring.frequency)}) "
            f"with a damping ratio of {value_of(ring.damping)}; {ring.agreement}."
        )
        if ring.stiffness is not None:
            yield f"That takes a contact of {value_of(ring.stiffness)} (95 %: {interval_of(ring.stiffness)})."
    if findings.microslips is not None and findings.microslips.kind != UNTOLD:
        slips = findings.microslips
        yield f"{len(slips.events)} micro-slips are found in {len(slips.counts)} sticks: {slips.kind}."
    if findings.slip_ringing is not None:
        yield from _of_slip_ringing(findings.slip_ringing)
    if findings.ridges:
        ridge = findings.ridges[0]
        low, middle, high = (number(float(end(ridge.frequency)), 0.0, "Hz") for end in (np.min, np.median, np.max))
        span = middle if low == high else f"near {middle} ({low} to {high})"
        wanders = ridge.frequency.max() > WANDERS * ridge.frequency.min()
        beware = "; it wanders that far, as a sweep does, or chance in noise" if wanders else ""
        yield f"The strongest ridge of the map: {span}, from {ridge.time[0]:.4g} s to {ridge.time[-1]:.4g} s{beware}."
    if findings.spikes:
        groups = findings.spikes[-1].group + 1
        yield f"The signal jumps or kinks {len(findings.spikes)} times, in {groups} group{'s' * (groups > 1)}."


def _of_slip_ringing(ringing: SlipRinging) -> Iterator[str]:
    sides = [
        f"{value_of(frequency)} {frequency.name.split()[-1]} with a damping ratio of {value_of(damping)}"
        for frequency, damping in ((ringing.forward, ringing.damping_forward), (ringing.back, ringing.damping_back))
        if frequency is not None and damping is not None
    ]
    yield f"After slip begins the friction rings at {' and '.join(sides)}{'' if ringing.difference else ' alone'}."
    if ringing.difference is not None:
        told = ringing.verdict if ringing.verdict.startswith("no") else f"it is {ringing.verdict}"
        low_high = interval_of(ringing.difference)
        yield f"Between the directions {told}: forward less back {value_of(ringing.difference)} (95 %: {low_high})."
