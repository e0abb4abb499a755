"""Mistakes in how a record or its rig was stated, each with what would mend it."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from stickslip.arrays import Array
from stickslip.balance.balance import ALONE
from stickslip.consistent.checks import MILLISECONDS, Check, Slip
from stickslip.consistent.contradictions import Consistency
from stickslip.cycle.joint import regress_joint
from stickslip.cycle.loops import Loops
from stickslip.errors import RecordError, StickslipError
from stickslip.estimate import Estimate
from stickslip.files.expression import split_spec
from stickslip.files.select import split_name
from stickslip.record.channels import VOCABULARY, Channel
from stickslip.record.record import Record
from stickslip.rig.settings import WORDS, RigSettings
from stickslip.signals.derivatives import differentiate
from stickslip.signals.noise import quantisation_step
from stickslip.units import parse_unit

LATEST = 0.1  # of a record's length: a sensor that is said to be later, and tells of no cycle, is late by milliseconds
SHORTEST_DELAY = 0.05  # s: a true delay of more than a cycle is shorter than this, where the motion is fast
HALF_TURN = math.pi  # rad: what swings farther, and is called an angle in rad, is one in degrees
GOES_ON = 0.8  # of the motion at first that is left at last, where something drives it
BASES = rf"{dict(WORDS)['z']}|frame|rahmen|^y$"  # how a column of the base's motion is called
BALANCED = ("balance", "energy")  # checks that a wrong mass, spring or sensor fails
MOVES = "acceleration"  # of the check that a wrong unit of a, or of x, fails
FAR = 2.0  # times by which two sides that should be one differ, from which no force is given
NEAR = 0.1  # by which a ratio of frequencies may miss the one that a slip makes
# Of a joint's angle.
DEGREE = math.pi / 180  # rad
TURNS = {"deg": 360.0, "rad": 2 * math.pi}  # a turn in each unit that is mistaken for the other
OTHER = {"deg": "rad", "rad": "deg"}
BITS = range(8, 25)  # of an encoder, whose counts are this power of two's part of a turn
ALIKE = 1e-4  # by which a step may miss a count's: counts of 360 degrees and of 2 pi rad are 10 % apart at the nearest
WITHIN = 0.04  # by which a factor may miss that of degrees and rad, chosen: gears of 1:55 and of 1:60 do by more
TOGETHER = 0.95  # correlation of two channels that tell one motion
QUARTER = 90.0  # of what is read as rad: within less a quarter turn in degrees bends gravity's torque too little
BETTER = 3.0  # times less left of the torque: of a log in degrees 0.93 as rad, 0.008 as degrees
Motion = tuple[Channel, Array]


def slipped(slips: Sequence[Slip]) -> str:
    """What one slip of the hand would explain, in words; nothing without one."""
    return f"something is stated wrongly: probably {' or '.join(slip.words for slip in slips)}" if slips else ""


def untrue(consistency: Consistency | None) -> str:
    """What of channels and constants can not all be true, in words; a clipped sensor says so itself."""
    failed = consistency.failed if consistency is not None else ()
    if any("range" in check.name for check in failed):
        return ""
    apart = [check.sentence for check in failed if any(word in check.name for word in BALANCED)]
    if apart:
        return f"the record and the rig's constants contradict each other: {apart[0]}"
    apart = [check.sentence for check in failed if MOVES in check.name and _far(check)]
    return f"the record contradicts itself: {apart[0]}" if apart else ""


def _far(check: Check) -> bool:
    """Whether two sides are so far apart that no force is worth a headline."""
    return bool(check.right) and not 1 / FAR < check.left / check.right < FAR


def hopeless(consistency: Consistency | None) -> str:
    """What of channels and constants can not all be true, where it is so far off that no force is worth a headline."""
    failed = consistency.failed if consistency is not None else ()
    return untrue(consistency) if any(_far(c) for c in failed if any(w in c.name for w in (*BALANCED, MOVES))) else ""


def mistakes(
    record: Record, rig: RigSettings, consistent: Consistency | None, loops: Loops | None, *, unseen: bool
) -> tuple[Slip, ...]:
    """What one slip of the hand would explain, the likeliest first; none where nothing speaks for one.

    Where the base is `unseen`, a column may be its motion.
    """
    first = _twice(record) or _late(record, rig, loops) or (_base(record) if unseen else None)
    return (first,) if first is not None else consistent.slips if consistent is not None else ()


def _twice(record: Record) -> Slip | None:
    """One column that stands for the mass and for its base."""
    if not {"x", "z"} <= set(record) or not np.array_equal(record["x"], record["z"]):
        return None
    return Slip(f"x and z are read from the same column, {_called(record.channels['z'])}, and not each from its own")


def base_unseen(record: Record) -> bool:
    """Whether the friction is that of a spring whose other end was not measured, while the motion goes on."""
    rig = record.rig
    if rig is None or rig.method == ALONE or "x" not in record or not {"z", "force", "load"}.isdisjoint(record):
        return False
    first, last = (float(np.std(part)) for part in np.array_split(record["x"], 2))
    return last > GOES_ON * first


def _base(record: Record) -> Slip | None:
    """The one column that is called as a base is and moves as often as the mass."""
    often = _strongest(record["x"])
    bases = [
        name
        for name, channel in record.channels.items()
        if (name == "y" or name not in VOCABULARY) and channel.unit in ("m", "1")
        if re.search(BASES, name.lower().strip("_")) and _strongest(record[name]) == often
    ]
    if len(bases) != 1:
        return None
    return Slip(f"{_called(record.channels[bases[0]])} is the motion of the base, z", {"z": (bases[0], 1.0)})


def _strongest(values: Array) -> int:
    """The strongest line of a channel, by its number; 0 where there is none."""
    spectrum = np.abs(np.fft.rfft(_about_line(values) * np.hanning(len(values))))
    return int(np.argmax(spectrum)) if np.all(np.isfinite(spectrum)) else 0


def _late(record: Record, rig: RigSettings, loops: Loops | None) -> Slip | None:
    """Milliseconds taken for seconds, of a delay that lasts longer than a cycle, or much of the record."""
    period = 1 / loops.frequency.value if loops is not None else LATEST * record.duration
    stated = {name: channel.delay for name, channel in record.channels.items()}
    stated |= {name: sensor.delay for name, sensor in rig.sensors.items() if "delay" in sensor.model_fields_set}
    far = {name: late for name, late in stated.items() if abs(late) > max(period, SHORTEST_DELAY)}
    if not far:
        return None
    late = next(iter(far.values()))
    cycles = f" ({abs(late) / period:.3g} cycles of the motion)" if loops is not None else ""
    mistake = f"the delay of {' and '.join(far)}, {late:.4g} s{cycles}, is in ms, not in s"
    return Slip(mistake, delays={name: MILLISECONDS * late for name, late in far.items()})


def missing(record: Record, rig: RigSettings) -> tuple[str, ...]:
    """What must be stated before a friction force can be found; nothing where one is read or found."""
    if not {"friction", "load", "force"}.isdisjoint(record) or "x" not in record:
        return ()
    return tuple(name for name in ("mass", "stiffness") if getattr(rig, name) is None)


def mistakes_of_decay(
    channel: str, swing: float, frequency: float, mass: float | None, stiffness: float | None
) -> tuple[Slip, ...]:
    """An angle in degrees, and what a frequency that mass and stiffness contradict would explain.

    Parameters
    ----------
    channel : str
        What was measured.
    swing : float
        Its amplitude in SI.
    frequency : float
        Of the oscillation [Hz].
    mass, stiffness : float or None
        As stated, in SI.

    Returns
    -------
    tuple of Slip
        The likeliest first.
    """
    if channel == "theta" and swing > HALF_TURN:
        mistake = f"theta, which swings {swing:.3g} rad to each side, is in degrees, not in rad"
        return (Slip(mistake, {channel: (channel, DEGREE)}),)
    return tuple(_of_frequency(frequency, mass, stiffness))


def _of_frequency(frequency: float, mass: float | None, stiffness: float | None) -> Iterator[Slip]:
    if not mass or not stiffness or not math.isfinite(frequency):
        return
    ratio = frequency * 2 * math.pi / math.sqrt(stiffness / mass)
    for slip, expected in (
        (Slip("the stiffness is in N/mm, not in N/m", constants={"stiffness": 1e3}), 1e3**0.5),
        (Slip("the mass is in g, not in kg", constants={"mass": 1e-3}), 1e3**0.5),
        (Slip("the time is in ms, not in s", clock=MILLISECONDS), MILLISECONDS),
    ):
        if abs(ratio / expected - 1) < NEAR:
            yield slip


def called(record: Record, name: str) -> str:
    """A channel by its column's name in the file; where it came from none by its own."""
    column = record.channels[name].column
    return name if column in ("", "array") else column


def require_angle(record: Record, rate: Motion | None = None) -> None:
    """Refuse an angle whose numbers are surely in another unit than they were read in.

    That is shown by the steps of an encoder, by a position and its reference that differ by the factor of degrees and
    rad, by a position and its own velocity that do, and of an angle without a unit by how far it turns.

    Parameters
    ----------
    record : Record
        With ``theta`` [rad] and, where there is one, ``reference``.
    rate : (Channel, ndarray), optional
        Its velocity [rad/s].

    Raises
    ------
    RecordError
        The unit has to be stated: which one, and how.

    Examples
    --------
    >>> swung = Record.of({"theta": np.round(60 * np.sin(np.arange(500) / 50) / 0.087890625) * 0.087890625}, fs=100)
    >>> require_angle(swung)
    Traceback (most recent call last):
    stickslip.errors.RecordError: theta is read in rad, and its steps of 0.08789 are those of an encoder of 12 bit in \
deg; it is in deg; state it: --units "theta=deg".
    """
    told = {name: (record.channels[name], record[name]) for name in ("theta", "reference") if name in record}
    for name in told:
        if record.channels[name].assumed:
            _require_within_a_turn(record, name)
        _require_counts(record, name)
    if rate is not None:
        told["rate"] = rate
    for other in told.keys() - {"theta"} if "theta" in told else ():
        _require_one_motion(record, told["theta"], told[other])


def require_torque(record: Record, gravity: bool | None, given: Mapping[str, Any]) -> None:
    """Refuse an angle whose torque shows that it is in another unit than it was read in.

    That is shown by gravity's torque, which repeats with a turn, and by an inertia or a gain of the controller that was
    stated and is told by the torque, too.

    Parameters
    ----------
    record : Record
        As of :func:`~stickslip.cycle.regress_joint`.
    gravity : bool, optional
        As there.
    given : mapping
        Its constants by name.

    Raises
    ------
    RecordError
        As of :func:`require_angle`.

    Examples
    --------
    >>> t = np.arange(4000) / 200
    >>> q = np.sin(2 * np.pi * 0.2 * t) + 0.4 * np.sin(2 * np.pi * 0.7 * t)
    >>> torque = 0.02 * np.gradient(np.gradient(q, t), t) + 0.06 * np.sign(np.gradient(q, t)) + 0.5 * np.sin(q)
    >>> log = Record.of({"theta": np.degrees(q), "force": torque}, fs=200, units={"force": "N m"})
    >>> require_torque(log, None, {})
    Traceback (most recent call last):
    stickslip.errors.RecordError: theta is read in rad, and gravity's torque repeats with 360 of it; it is in deg; \
state it: --units "theta=deg".
    """
    read = _read_in(record.channels["theta"]) if "theta" in record and "force" in record else ""
    if not read:
        return
    if read == "rad" and gravity is not False and "bodies" not in record and _is_pulled_in_degrees(record, given):
        raise _misread(record, record.channels["theta"], "gravity's torque repeats with 360 of it")
    for name, told in _told(record, gravity, given):
        stated = Estimate.stated(name, given[name], "kg m^2" if name == "inertia" else "N m/rad")
        times = _times(stated.value / told)
        if times == (1 if read == "rad" else -1):
            raise _misread(
                record,
                record.channels["theta"],
                f"of the torque {name} is {told:.3g} {stated.unit}, not {stated.value:.3g}",
            )


def _misread(record: Record, channel: Channel, why: str) -> RecordError:
    """That a channel is in the other unit: why, and what states it."""
    read, options = _read_in(channel), _stating(record, channel)
    return RecordError(
        f"{_called(channel)} is read in {read}, and {why}",
        f"it is in {OTHER[read]}",
        f'state it: {options[0]} "{options[1]}"',
        options=options,
    )


def _called(channel: Channel) -> str:
    """Its column, without the unit."""
    return channel.name if channel.column in ("", "array") else split_name(channel.column)[0]


def _stating(record: Record, channel: Channel) -> tuple[str, str]:
    """The option that states a channel's other unit, as it was named: by a channel map or by its column."""
    other = OTHER[_read_in(channel)] + channel.unit.removeprefix("rad")
    if any(channel.name in (step.arguments.get("channels") or ()) for step in record.history):
        return "--channels", f"{channel.name}={split_spec(channel.column).arithmetic} [{other}]"
    return "--units", f"{_called(channel)}={other}"


def _read_in(channel: Channel) -> str:
    """The unit, "rad" or "deg", that an angle or its velocity was read in; empty of any other."""
    if channel.unit not in ("rad", "rad/s"):
        return ""
    try:
        unit = split_spec(channel.source).unit
        scale = parse_unit(unit, channel.unit).scale if unit else 1.0
    except RecordError:  # no unit, but a sensitivity
        return ""
    return {1.0: "rad", round(DEGREE, 9): "deg"}.get(round(scale, 9), "")


def _require_within_a_turn(record: Record, name: str) -> None:
    """Refuse an angle without a unit that turns farther than one in rad hardly does."""
    column, step = called(record, name), quantisation_step(record[name])
    low, high = float(np.min(record[name])), float(np.max(record[name]))
    if high - low <= TURNS["rad"]:
        return
    kind, options = "degrees", ("--units", f"{column}=deg")
    remedy = f'{options[0]} "{options[1]}", or =rad where it is'
    if step == 1:
        kind, options = "counts of an encoder", ("--channels", f"{name}={column} / 4096 [turn]")
        remedy = f'{options[0]} "{options[1]}", by its counts in a turn'
    raise RecordError(
        f"{column} runs from {low:.4g} to {high:.4g}{f', in steps of {step:.4g}' if step else ''}, without a unit",
        f"an angle in rad hardly does: it is in {kind}",
        f"state its unit: {remedy}",
    )


def _require_counts(record: Record, name: str) -> None:
    """Refuse an angle whose steps are an encoder's in the other unit."""
    read = _read_in(record.channels[name])
    if not read or not np.all(np.isfinite(record[name])):
        return
    step = quantisation_step(record[name]) * TURNS[read] / TURNS["rad"]
    bits = [bits for bits in BITS if abs(step * 2**bits / TURNS[OTHER[read]] - 1) < ALIKE]
    if bits:
        steps = f"its steps of {step:.4g} are those of an encoder of {bits[0]} bit in {OTHER[read]}"
        raise _misread(record, record.channels[name], steps)


def _require_one_motion(record: Record, position: Motion, other: Motion) -> None:
    """Refuse a position and its reference, or its velocity, that differ by the factor of degrees and rad."""
    channels, samples = (position[0], other[0]), (position[1], other[1])
    if not all(_read_in(channel) for channel in channels) or not np.all(np.isfinite(samples)):
        return
    is_rate = channels[1].unit == "rad/s"
    if is_rate:  # a zero of the velocity that is off is a line over time
        samples = _about_line(samples[0]), _about_line(np.cumsum(samples[1]) / record.fs)
    if 0 in [np.ptp(values) for values in samples] or np.corrcoef(*samples)[0, 1] < TOGETHER:
        return
    times = _times(float(np.std(samples[0]) / np.std(samples[1])))
    if not times:
        return
    larger, smaller = channels[::times]
    wrong = [channel for channel, read in ((larger, "rad"), (smaller, "deg")) if _read_in(channel) == read]
    wrong = [channel for channel in wrong if channel.assumed] or wrong
    if not wrong or (is_rate and channels[0] not in wrong):  # a velocity is in no balance
        return
    beside = "moves 57.3 times as far as {} tells" if wrong[0] is larger else "moves by a 57.3th of what {} tells"
    if len(wrong) == 1:
        raise _misread(record, wrong[0], beside.format(_called(smaller if wrong[0] is larger else larger)))
    raise RecordError(
        f"{_called(larger)} {beside.format(_called(smaller))}",
        "one of both is in another unit than is stated",
        "state it: " + ", or ".join(f'{option} "{value}"' for option, value in (_stating(record, w) for w in wrong)),
    )


def _about_line(values: Array) -> Array:
    """What is left of a channel about the line nearest to it."""
    place = np.linspace(-1, 1, len(values))
    return np.asarray(values - np.polyval(np.polyfit(place, values, 1), place))


def _times(ratio: float) -> int:
    """1 where a ratio is that of degrees over rad, -1 where it is the inverse, else 0."""
    return next((sign for sign in (1, -1) if abs(ratio**sign * DEGREE - 1) < WITHIN), 0)


def _is_pulled_in_degrees(record: Record, given: Mapping[str, Any]) -> bool:
    """Whether gravity's torque, over an angle that is read in rad, is a sine of it in degrees, and no line."""
    if np.ptp(record["theta"]) < QUARTER:
        return False
    scales = (1.0, DEGREE, DEGREE / 100)
    stated = {name: value for name, value in given.items() if name != "inertia"}
    as_read, in_degrees, line = (_left(_scaled(record, by), stated) for by in scales)
    return BETTER * in_degrees < min(as_read, line)


def _scaled(record: Record, by: float) -> Record:
    """A log whose angles are times a factor."""
    for name in ("theta", "reference"):
        if name in record:
            record = record.with_channel(name, by * record[name], unit="rad")
    return record


def _left(record: Record, given: Mapping[str, Any]) -> float:
    """What a regression leaves of the torque; infinite where there is none."""
    try:
        return regress_joint(record, **given).residual
    except StickslipError:
        return math.inf


def _told(record: Record, gravity: bool | None, given: Mapping[str, Any]) -> Iterator[tuple[str, float]]:
    """What the torque tells of constants that are stated."""
    if given.get("inertia") is not None:
        try:
            told = regress_joint(record, gravity=gravity, **{**given, "inertia": None}).inertia
        except StickslipError:
            return
        if told.known and told.value > 0:
            yield "inertia", told.value
    if given.get("kp") is not None and "reference" in record:
        error = record["reference"] - record["theta"]
        columns = np.column_stack([error, differentiate(error, record.fs).values])
        (gain, _), *_ = np.linalg.lstsq(columns, record["force"], rcond=None)
        if gain > 0 and np.corrcoef(columns[:, 0], record["force"])[0, 1] > TOGETHER:
            yield "kp", float(gain)
