"""Everything that is asked of a record of squeaks: bursts, spectra, coupling, friction over speed, how it sounds."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from stickslip.answers.findings import Comparison, Findings, Inquiry, record_name, require_several
from stickslip.answers.preparation import normal_load
from stickslip.cycle.loops import NO_SLOPE, friction_loops
from stickslip.estimate import Constant, Estimate, kinds
from stickslip.record.record import Record, require_record
from stickslip.rig.settings import RigSettings, rig_settings
from stickslip.squeak.bursts import Squeaks, find_squeaks
from stickslip.squeak.couplings import coupling
from stickslip.squeak.hearing import HEARD
from stickslip.squeak.sound import SoundQuality, impulsiveness, sound_quality
from stickslip.squeak.spectra import burst_spectra
from stickslip.units import parse_constant, parse_range

HEARD_AT_ONCE = 5.0  # s
VIBRATING = (*HEARD, "torsion_velocity", "load")


def analyze_squeaks(
    record: Record,
    *,
    name: str | None = None,
    channel: str | None = None,
    frequencies: tuple[float, float] | str | None = None,
    contact: str | None = None,
    normal: Constant | None = None,
    lever: float | str | None = None,
) -> Findings:
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
    normal : float, str, tuple or Estimate, optional
        Normal load [N], as "10 ± 0.2 N"; the mean of the channel "normal" where there is one.
    lever : float or str, optional
        Distance of the friction force from the axis of the torsion [m], as in :func:`coupling`.

    Returns
    -------
    Findings
        With ``squeaks``, the bursts, and ``beside``, those of every other channel that vibrates; ``spectra`` in bursts
        and outside; ``coupling``, which motions move together in squeaks; ``quality``, how loud, sharp and rough a
        calibrated sound is heard (of a long one, five seconds about its loudest burst), and ``impulses``, how much it
        is made of pulses; and ``loops``, friction over the forcing cycle.

    Raises
    ------
    RecordError, EstimateError
        As :func:`find_squeaks`: the bursts can not be looked for.

    Examples
    --------
    >>> import stickslip as ss
    >>> run = ss.simulate(ss.squeak.squeak_rig("wet", load=6.13), duration=0.8)
    >>> findings = analyze_squeaks(ss.squeak.squeak_record(run, snr=30, rng=1), normal=6.13)
    >>> pitch = findings.squeaks.frequency.value
    >>> findings.squeaks.kind, bool(475 < pitch < 500), findings.coefficient.includes(8 / 6.13)
    ('squeak', True, True)
    """
    require_record(record)
    band = parse_range(frequencies, "Hz") if isinstance(frequencies, str) else frequencies
    lever = None if lever is None else parse_constant("lever", lever, "m")
    faults = tuple(record.check())
    squeaks = find_squeaks(record, channel=channel, frequencies=band)
    inquiry = Inquiry(list(squeaks.notes))
    others = [channel for channel in VIBRATING if channel in record and channel != squeaks.channel]
    listen = partial(find_squeaks, record, frequencies=band)
    beside = [inquiry.ask(f"Bursts in {other}", partial(listen, channel=other)) for other in others]
    loops = None
    if "friction" in record and any(channel in record for channel in ("x", "v", "theta")):
        loops = inquiry.ask("Friction over the cycle", partial(friction_loops, record, contact=contact))
    else:
        inquiry.notes.append("No friction beside a motion is recorded: how it changes with speed can not be told.")
    if lever is not None and "torsion_velocity" not in record:
        inquiry.notes.append("The lever is not used: no torsion is recorded, in a channel torsion_velocity.")
    spectra = inquiry.ask("Spectra", partial(burst_spectra, record, squeaks=squeaks)) if squeaks.bursts else None
    joined = None
    if squeaks.squeaking:
        joined = inquiry.ask("Coupling", partial(coupling, record, squeaks=squeaks, lever=lever))
    results = {
        "squeaks": squeaks,
        "beside": tuple(squeaks_of for squeaks_of in beside if squeaks_of is not None),
        "loops": loops,
        "coupling": joined,
        "spectra": spectra,
        "quality": _quality(record, squeaks, inquiry),
        "impulses": inquiry.ask("Pulses", partial(impulsiveness, record, channel=squeaks.channel)),
    }
    chosen: dict[str, Any] = {"channel": squeaks.channel, "frequencies": list(squeaks.band)}
    chosen |= {"contact": contact} if contact else {}
    name = name or record_name(record)
    stated = None if normal is None else rig_settings({"normal": normal}, source="the call").normal_load(name)
    load = stated or normal_load(record, RigSettings(), name, inquiry.notes)
    return Findings(name, record, faults, load, tuple(inquiry.notes), chosen, results=results)


def _quality(record: Record, squeaks: Squeaks, inquiry: Inquiry) -> SoundQuality | None:
    """Of a calibrated sound; of a long one, about its loudest burst: the method takes longer for longer ones."""
    if record.channels[squeaks.channel].unit != "Pa" or not squeaks.bursts:
        return None
    if record.duration > HEARD_AT_ONCE:
        loudest = max(squeaks.bursts, key=lambda burst: np.nan_to_num(burst.level, nan=-math.inf))
        end = record.start + record.duration
        begin = min(max(record.start, loudest.start - HEARD_AT_ONCE / 2), end - HEARD_AT_ONCE)
        record = record.between(begin, begin + HEARD_AT_ONCE)
        part = f"{begin:.4g} to {begin + HEARD_AT_ONCE:.4g} s"
        inquiry.notes.append(f"Loudness, sharpness and roughness are those of {part}.")
    return inquiry.ask("Loudness, sharpness and roughness", partial(sound_quality, record, channel=squeaks.channel))


def trend_of(slope: Estimate | None) -> str:
    """Whether friction "falls" or "rises" with speed; "flat or not told" where the slope's interval holds zero."""
    if slope is None or NO_SLOPE in kinds(slope.status) or slope.includes(0.0):
        return "flat or not told"
    return "falls" if slope.value < 0 else "rises"


# ---- conditions side by side


@dataclass(frozen=True)
class Condition:
    """One condition of a squeak test: what drove it, how it rubbed, and what was heard.

    Attributes
    ----------
    name : str
        What it is called.
    normal : Estimate or None
        Normal load [N].
    forcing : float
        Frequency of the forced motion [Hz]; NaN where none is recorded.
    stroke : float
        Half of what the displacement spans [m, or rad]; NaN where none is recorded.
    level : Estimate or None
        Sliding friction.
    slope : Estimate or None
        Change of the sliding friction with speed; below zero where it falls.
    coefficient, slope_of_coefficient : Estimate or None
        Both over the normal load, where it is known.
    answer : str
        Whether it "squeaks", "squeals", "creaks" or "does not squeak", or that this "can not be told", as
        :attr:`Squeaks.answer`.
    kind : str
        What most of the sounding time is, as :attr:`Squeaks.kind`.
    count : int
        Squeaks and squeals.
    rate : float
        How many there are in a second [1/s].
    pulses : float
        Stick-slip pulses in a second of its longest creak [1/s]; NaN where nothing creaks.
    frequency : Estimate or None
        Mean frequency of the squeaks and squeals [Hz].
    sound : float
        Level of the loudest of them [dB re `reference`]; NaN where there is none, or it is clipped.
    reference : str
        What levels are relative to.
    """

    name: str
    normal: Estimate | None
    forcing: float
    stroke: float
    level: Estimate | None
    slope: Estimate | None
    coefficient: Estimate | None
    slope_of_coefficient: Estimate | None
    answer: str
    kind: str
    count: int
    rate: float
    pulses: float
    frequency: Estimate | None
    sound: float
    reference: str

    @property
    def squeaks(self) -> bool:
        """Whether it squeaks or squeals."""
        return self.count > 0

    @property
    def trend(self) -> str:
        """Whether friction "falls" or "rises" with speed; "flat or not told" where the slope's interval holds zero."""
        return trend_of(self.slope)


def compare_squeaks(findings: Sequence[Findings]) -> Comparison:
    """In which conditions does it squeak, and is it the slope of friction against speed, or the load, that decides?

    Each record is a condition: wet or dry, light or heavy, as in the thesis's figures 7.3 and 7.6. Of each are told the
    excitation, the friction and its slope against speed with their intervals, and the squeaks. What the conditions say
    together holds for these records: which squeak; whether friction that falls with speed, found in a condition that is
    not heard to squeak, is too little for one; and whether one squeaks in which it rises.

    Parameters
    ----------
    findings : sequence of Findings
        What :func:`analyze_squeaks` returned of two records or more, each named by its condition.

    Returns
    -------
    Comparison
        Its results are ``conditions``, a :class:`~stickslip.answers.Condition` for each record, ``verdicts``, what they
        say together in sentences, and ``squeaking``, the names of those that squeak.

    Raises
    ------
    EstimateError
        Fewer than two records.

    Examples
    --------
    >>> import stickslip as ss
    >>> found = []
    >>> for load in (1.23, 6.13):
    ...     run = ss.simulate(ss.squeak.squeak_rig("wet", load), duration=0.8)
    ...     record = ss.squeak.squeak_record(run, snr=30, rng=1)
    ...     found.append(ss.analyze_squeaks(record, name=f"wet, {load} N", normal=load))
    >>> compared = compare_squeaks(found)
    >>> compared.squeaking, compared.conditions[0].trend
    (('wet, 6.13 N',), 'falls')
    """
    require_several(findings)
    conditions = tuple(_condition(finding) for finding in findings)
    squeaking = tuple(condition.name for condition in conditions if condition.squeaks)
    results = {"conditions": conditions, "verdicts": tuple(_verdicts(conditions)), "squeaking": squeaking}
    return Comparison(tuple(findings), results=results)


def _condition(findings: Findings) -> Condition:
    squeaks, loops, record = findings.squeaks, findings.loops, findings.record
    heard = squeaks.of("squeak", "squeal")
    levels = [burst.level for burst in heard if np.isfinite(burst.level)]
    path = next((channel for channel in ("x", "theta") if channel in record), None)
    return Condition(
        name=findings.name,
        normal=findings.normal,
        forcing=squeaks.forcing,
        stroke=float(np.nanmax(record[path]) - np.nanmin(record[path])) / 2 if path else float("nan"),
        level=None if loops is None else loops.level,
        slope=None if loops is None else loops.slope,
        coefficient=findings.coefficient,
        slope_of_coefficient=findings.slope_of_coefficient,
        answer=squeaks.answer,
        kind=squeaks.kind,
        count=len(heard),
        rate=len(heard) / record.duration,
        pulses=max(squeaks.of("creak"), key=lambda burst: burst.duration).rate if squeaks.of("creak") else float("nan"),
        frequency=squeaks.frequency,
        sound=max(levels, default=float("nan")),
        reference=squeaks.reference,
    )


def _verdicts(conditions: Sequence[Condition]) -> list[str]:
    """Which squeak, and what their slopes say of that."""
    loud = [condition for condition in conditions if condition.squeaks]
    quiet, untold = _answering(conditions, "does not squeak"), _answering(conditions, "can not be told")
    creaking = _answering(conditions, "creaks")
    if not loud and not untold:
        return ["No condition squeaks.", *(f"{sentence}." for sentence in _say(creaking, "creaks", "creak"))]
    heard = [
        *_say(_answering(conditions, "squeaks"), "squeaks", "squeak"),
        *_say(_answering(conditions, "squeals"), "squeals", "squeal"),
        *_say(creaking, "creaks", "creak"),
        *_say(quiet, "does not squeak", "do not squeak"),
    ]
    verdicts = [f"{'; '.join(heard)}."] if heard else []
    verdicts += [f"Whether {sentence} can not be told." for sentence in _say(untold, "squeaks", "squeak")]
    falling = [condition for condition in quiet if condition.trend == "falls"]
    if loud and falling:
        too = " too" if all(condition.trend == "falls" for condition in loud) else ""
        verdicts.append(
            f"Friction falls with speed in {_names(falling)}{too}, and nothing squeaks there: a falling friction "
            "alone is not enough."
        )
    rising = [condition for condition in loud if condition.trend == "rises"]
    return verdicts + [f"{names} though friction rises with speed." for names in _say(rising, "squeaks", "squeak")]


def _answering(conditions: Sequence[Condition], answer: str) -> list[Condition]:
    return [condition for condition in conditions if condition.answer == answer]


def _say(conditions: Sequence[Condition], one: str, several: str) -> list[str]:
    """The conditions with a verb; nothing where there are none."""
    return [f"{_names(conditions)} {several if len(conditions) > 1 else one}"] if conditions else []


def _names(conditions: Sequence[Condition]) -> str:
    names = [condition.name for condition in conditions]
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)
