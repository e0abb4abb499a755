"""Everything that is asked of a record of squeaks: bursts, spectra, coupling, friction over speed, how it sounds."""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from stickslip.answers.asked import Asked
from stickslip.answers.findings import Findings, record_name
from stickslip.cycle.loops import NO_SLOPE, friction_loops
from stickslip.errors import EstimateError
from stickslip.estimate import Estimate, kinds
from stickslip.record.record import Record, require_record
from stickslip.squeak.bursts import HEARD, Squeaks, find_squeaks
from stickslip.squeak.couplings import coupling
from stickslip.squeak.quality import SoundQuality, impulsiveness, sound_quality
from stickslip.squeak.spectra import burst_spectra
from stickslip.units import parse_constant, parse_range, parse_value

HEARD_AT_ONCE = 5.0  # s
OF_MEDIAN = math.sqrt(math.pi / 2)  # its standard deviation over that of the mean
VIBRATING = (*HEARD, "torsion_velocity", "load")


def analyze_squeaks(
    record: Record, *, name: str | None = None, channel: str | None = None,
    frequencies: tuple[float, float] | str | None = None, contact: str | None = None,
    normal: float | str | None = None, lever: float | str | None = None,
) -> Findings:  # fmt: skip
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
    >>> found = analyze_squeaks(ss.squeak.squeak_record(run, snr=30, rng=1), normal=6.13)
    >>> found.squeaks.kind, bool(475 < found.squeaks.frequency.value < 500), found.coefficient.includes(8 / 6.13)
    ('squeak', True, True)
    """
    require_record(record)
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
    results = {
        "squeaks": squeaks,
        "beside": tuple(each for each in beside if each is not None),
        "loops": loops,
        "coupling": joined,
        "spectra": spectra,
        "quality": _quality(record, squeaks, asked),
        "impulses": asked.ask("Pulses", partial(impulsiveness, record, channel=squeaks.channel)),
    }
    chosen = {
        "channel": squeaks.channel,
        "frequencies": list(squeaks.band),
        **({"contact": contact} if contact else {}),
    }
    load = _normal(record, normal)
    return Findings(name or record_name(record), record, faults, load, tuple(asked.notes), chosen, results=results)


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
