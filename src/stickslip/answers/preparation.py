"""A record made ready for the questions: read and mended, sensors, delays, and friction as its channels allow."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from stickslip.answers.findings import Inquiry
from stickslip.arrays import Array, stretches
from stickslip.balance.felt_and_computed import ForceComparison, compare_force
from stickslip.balance.force import friction_force, sensors_behind
from stickslip.balance.lag import HIDDEN, REPEATS, SensorDelay, sensor_delay
from stickslip.balance.mass import mass_and_stiffness
from stickslip.balance.motion import CREEP, LEAST, is_measured
from stickslip.errors import ABSENT
from stickslip.estimate import UNSTATED, Doubt, Estimate, kinds
from stickslip.files.read import read_blocks, read_record
from stickslip.files.select import file_entry
from stickslip.printing import printable
from stickslip.record.channels import Channel
from stickslip.record.flaws import constant
from stickslip.record.record import Record, Step
from stickslip.rig.settings import LOAD, RigSettings, rig_settings
from stickslip.signals.derivatives import differentiate
from stickslip.signals.interpolate import without_delays
from stickslip.signals.repair import fill_gaps, fill_missing, remove_drift, remove_spikes, repair_clock, restore_clipped

MOTION = ("x", "v", "theta")
USED = ("x", "z", "v", "a", "theta", "friction", "load", "force")  # channels that a question may take
SENSED = ("x", "v", "theta", "a", "load")  # what no rig holds still while its mass moves
CONSTANTS = ("mass", "stiffness", "damping", "damper")  # of the balance of forces
STRETCH = 1 << 14  # samples from the middle in which a delay is looked for, and the forces are compared
AT_ONCE = 1 << 18  # samples of which all sensors are put together unasked
FACE = "a face that moves"  # whose way stands for z: seen from there the spring's other end moves back
CARRIED = 0.25  # of the time at one speed, chosen: a harmonic motion is within 4 % of one for 0.13
WHOLE, FEWEST = 0.5, 3  # of all the way, and how often; a mass that sticks on the ground goes nowhere
FOUND = " (found in this record)"
SURE = 3.0  # standard deviations from which a delay is taken out
LONG = 1 << 26  # bytes on the disk of a record that is asked part by part
PART = 1 << 18  # rows of such a part


def is_long(files: Sequence[Path]) -> bool:
    """Whether a record may be too long to be held in memory with all that is made of it.

    Parameters
    ----------
    files : sequence of Path
        Those of the record.

    Returns
    -------
    bool

    Raises
    ------
    OSError
        A file is not there.

    Examples
    --------
    >>> is_long([])
    False
    """
    return sum(path.stat().st_size for path in files) > LONG


def read_mended(files: Sequence[Path], *, rig: RigSettings, names: Sequence[str] = ()) -> Record:
    """Read a record as its rig's settings say, mended, with what they state of its sensors.

    Parameters
    ----------
    files : sequence of Path
        Those of the record.
    rig : RigSettings
        How they are read, which rows, which repairs, the sensors and the log.
    names : sequence of str
        What the history calls the files; their own names where left out.

    Returns
    -------
    Record

    Raises
    ------
    FormatError, RecordError, ModelError
        As :func:`read_record` and :func:`mend`.

    Examples
    --------
    >>> import tempfile
    >>> from stickslip import write_record
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = write_record(Record.of({"x": range(10)}, fs=2.0), folder + "/run.csv")
    ...     read_mended([path], rig=rig_settings({"rows": "2:6"}))["x"].tolist()
    [2.0, 3.0, 4.0, 5.0]
    """
    record = read_record(files, rows=rig.row_range(), **rig.reading())
    return with_sensors(mend(_called(record, files, names), repairs=rig.repair), rig)


def read_parts(
    files: Sequence[Path], *, rig: RigSettings, names: Sequence[str] = (), size: int = PART
) -> Iterator[Record]:
    """Read a record in parts that fit into memory; whole where rows of it or repairs are asked for.

    Parameters
    ----------
    files, rig, names
        As :func:`read_mended` takes them.
    size : int
        Rows of a part.

    Yields
    ------
    Record

    Raises
    ------
    FormatError, RecordError, ModelError
        As :func:`read_blocks` and :func:`mend`.

    Examples
    --------
    >>> import tempfile
    >>> from stickslip import write_record
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = write_record(Record.of({"x": range(10)}, fs=2.0), folder + "/run.csv")
    ...     [len(part) for part in read_parts([path], rig=rig_settings({}), size=4)]
    [4, 4, 2]
    """
    if rig.rows or rig.repair:
        yield read_mended(files, rig=rig, names=names)
        return
    for part in read_blocks(files, size=size, **rig.reading()):
        yield with_sensors(_called(part, files, names), rig)


def _called(record: Record, files: Sequence[Path], names: Sequence[str]) -> Record:
    """The record with its files in the history, called as told; one that write_record kept comes back without."""
    own = [printable(path.name) for path in files]
    called = dict(zip(own, map(printable, names) if names else own, strict=True))
    known = {file["name"] for step in record.history for file in step.arguments.get("files", ())}
    if called.keys() <= known:
        return replace(record, history=tuple(_renamed(step, called) for step in record.history))
    sources = [{**file_entry(path), "name": called[printable(path.name)]} for path in files]
    step = Step("read_record", {"files": sources}, "a record as it was written")
    return replace(record, history=(*record.history, step))


def _renamed(step: Step, names: Mapping[str, str]) -> Step:
    """The step with other names of the files that it read."""
    files = [{**file, "name": names.get(file["name"], file["name"])} for file in step.arguments.get("files", ())]
    return replace(step, arguments={**step.arguments, "files": files}) if files else step


def mend(record: Record, *, repairs: Sequence[str]) -> Record:
    """The record after repairs, made in the order given and each logged in its history.

    Parameters
    ----------
    record : Record
        As read.
    repairs : sequence of str
        ``clock`` (:func:`repair_clock`), ``gaps`` (:func:`fill_gaps`), ``missing`` (:func:`fill_missing`), ``spikes``
        (:func:`remove_spikes`), ``clipping`` (:func:`restore_clipped`), ``drift`` (:func:`remove_drift`). The last
        four take a channel, as in ``drift:x``; without one they mend the channels in which the check-up finds
        that fault.

    Returns
    -------
    Record

    Raises
    ------
    RecordError
        A repair that can not be made.
    ModelError
        A repair that is not known.

    Examples
    --------
    >>> import numpy as np
    >>> wave = np.sin(0.2 * np.arange(400))
    >>> wave[100:103] = np.nan
    >>> mended = mend(Record.of({"x": wave}, fs=100.0), repairs=["missing"])
    >>> bool(np.isfinite(mended["x"]).all()), mended.history[-1].action
    (True, 'fill_missing')
    """
    for repair in rig_settings({"repair": list(repairs)}, source="the call").repair:
        word, _, channel = repair.partition(":")
        if word in _WHOLE:
            record = _WHOLE[word](record)
            continue
        kind, function = _PER_CHANNEL[word]
        record.require(*filter(None, [channel]), question=f"the repair {repair}", kind=ABSENT)
        channels = [fault.channel for fault in record.check() if fault.kind == kind and fault.channel is not None]
        for name in [channel] if channel else dict.fromkeys(channels):
            record = function(record, name)
    return record


_WHOLE: dict[str, Callable[[Record], Record]] = {"clock": repair_clock, "gaps": fill_gaps}
_PER_CHANNEL: dict[str, tuple[str, Callable[[Record, str], Record]]] = {
    "missing": ("missing", fill_missing),
    "spikes": ("spike", remove_spikes),
    "clipping": ("clipped", restore_clipped),
    "drift": ("drift", remove_drift),
}


@dataclass(frozen=True)
class Ready:
    """A record with its friction, and what was found on the way.

    Attributes
    ----------
    record : Record
        Delays taken out; with ``friction`` where there is a way to it.
    delay : SensorDelay or None
        Of the accelerometer behind the displacement, where it was looked for.
    comparison : ForceComparison or None
        The friction felt against the friction computed, where there are both.
    doubt : Doubt or None
        What is not known of the sensors that a contact's stiffness hangs on.
    """

    record: Record
    delay: SensorDelay | None
    comparison: ForceComparison | None
    doubt: Doubt | None = None


def ready(record: Record, rig: RigSettings, method: str, inquiry: Inquiry) -> Ready:
    """The record with its sensors stated, without its delays, with its friction."""
    for name in (name for name in rig.sensors if name not in record):
        inquiry.notes.append(f"A sensor {name} is described, but the record has no such channel.")
    record, stated = _without_dead(with_sensors(record, rig), inquiry), rig
    given = record
    record, delay = _aligned(record, inquiry)
    known = [name for name in USED if name in record]
    whole = (inquiry.ask("Stated delays", lambda: without_delays(record, *known)) if known else None) or record
    comparison = None
    if is_measured(whole, "friction"):
        _tell_unused(rig, inquiry)
    else:
        rig = _weighed(whole, rig, inquiry)
        if "x" in whole and _enough(whole, rig):
            if (seen := _seen_from_face(whole, rig, inquiry)) is not whole:  # there what is at rest moves as z does
                whole, rig = seen, rig.model_copy(update={"damper": "base"})
            if "load" in whole and ("a" in whole or not _base_seen(whole)):
                comparison = inquiry.ask(
                    "Force comparison", lambda: compare_force(middle(whole, STRETCH), **_constants(rig)), aside=True
                )
                whole = _with_mounts(whole, comparison, inquiry)
            if method == "auto" and _base_moves(whole, comparison, inquiry):
                whole, comparison = without(whole, "z"), None
            else:
                whole = _balanced(whole, rig, method, inquiry)
    if "friction" not in whole:
        whole = _by_load(whole, rig, inquiry)
    return Ready(whole, delay, comparison, _doubt(whole, given, stated, aligned=record is not given))


def with_sensors(record: Record, rig: RigSettings) -> Record:
    """The record with what the settings state of its sensors, and with their log; once, however often it is asked."""
    record = rig.logged(record)
    for name, sensor in rig.sensors.items():
        if name in record:
            described = record.with_details(name, **sensor.model_dump(exclude_unset=True))
            record = record if described.channels[name] == record.channels[name] else described
    return record


def middle(record: Record, samples: int) -> Record:
    """At most so many samples, from the middle of a record."""
    first = (len(record) - samples) // 2
    return record.rows(first, first + samples) if first > 0 else record


def _enough(record: Record, rig: RigSettings) -> bool:
    """Whether the balance can be drawn up: one of mass and spring is found from the other where more than x is read."""
    stated = sum(number is not None for number in (rig.mass, rig.stiffness))
    return stated == 2 or (stated == 1 and not {"a", "load"}.isdisjoint(record))


def _without_dead(record: Record, inquiry: Inquiry) -> Record:
    """The record without sensors that read one value throughout."""
    dead = [name for name in SENSED if name in record and constant(record[name])]
    inquiry.notes.extend(f"{unmoved(record, name)}: it is left out." for name in dead)
    return without(record, *dead)


def unmoved(record: Record, name: str) -> str:
    """That a channel does not change, in words."""
    return f"{name} does not change, it reads {record[name][0]:.4g} {record.channels[name].unit} throughout"


def without(record: Record, *names: str) -> Record:
    """The record without these channels, unless nothing else is in it."""
    kept = [name for name in record if name not in names]
    if not kept or len(kept) == len(record.samples):
        return record
    samples = {name: record[name] for name in kept}
    return replace(record, samples=samples, channels={name: record.channels[name] for name in kept})


def _weighed(record: Record, rig: RigSettings, inquiry: Inquiry) -> RigSettings:
    """The rig with its mass and its spring by what the load cell measures, where neither was stated."""
    if rig.mass is not None or rig.stiffness is not None or "friction" in record:
        return rig
    if not {"x", "load"} <= set(record) or not _base_seen(record):
        return rig
    ends = {"damper": rig.damper, "contact": rig.contact}
    constants = inquiry.ask(
        "Mass and stiffness",
        lambda: mass_and_stiffness(middle(record, STRETCH), damping=float(rig.damping or 0.0), **ends),
        aside=True,
    )
    if constants is None:
        return rig
    mass, stiffness = constants
    inquiry.notes.append(
        f"No mass and no stiffness were stated: {mass.value:.4g} kg and {stiffness.value:.4g} N/m are found from what "
        "the load cell measures."
    )
    return rig.model_copy(update={"mass": mass.value, "stiffness": stiffness.value})


def _base_seen(record: Record) -> bool:
    """Whether the record has a base that moves."""
    return "z" in record and not constant(record["z"])


def _base_moves(record: Record, comparison: ForceComparison | None, inquiry: Inquiry) -> bool:
    """Whether a base that is not measured can not have been at rest, by the load cell."""
    moves = not _base_seen(record) and comparison is not None and comparison.unlike
    if moves:
        inquiry.notes.append(
            f"{'z does not change' if 'z' in record else 'There is no channel z'}, and with the spring's other end at "
            "rest the motion leaves another force than the load cell measures: mass and spring are not used."
        )
    return moves


def _seen_from_face(record: Record, rig: RigSettings, inquiry: Inquiry) -> Record:
    """The record as seen from a face that moves, where x is carried on steadily and slips back, again and again."""
    if not {"z", "v", "load", "force"}.isdisjoint(record) or rig.contact == "base":
        return record
    cut = middle(record, STRETCH)
    sound = cut.stamps is None and np.isfinite(cut["x"]).all() and len(cut) > LEAST
    speed = _carried(cut["x"], record.fs) if sound and not constant(cut["x"]) else None
    if speed is None:
        return record
    went = speed * np.arange(len(record)) / record.fs
    words = f"x and z as seen from a face that moves at {1e3 * speed:.3g} mm/s, with which x sticks"
    inquiry.notes.append(f"There is no channel z: {words}; the spring's other end is taken to be at rest.")
    seen = record.with_channel("z", -went, unit="m", source=FACE)
    return seen.with_samples({**seen.samples, "x": record["x"] - went}, Step("analyze", {"face_speed": speed}, words))


def _carried(x: Array, fs: float) -> float | None:
    """The one speed at which a mass is carried along all its way, again and again, and to one side."""
    velocity = differentiate(x, fs).values
    low, high = np.quantile(velocity, [0.005, 0.995])
    if not high > low:
        return None
    near = CREEP * (high - low)
    counts, edges = np.histogram(velocity, np.arange(low, high + near, near))
    speed = float(edges[np.argmax(counts)] + near / 2)
    for _ in range(2):
        speed = float(np.median(velocity[np.abs(velocity - speed) < near]))
    ahead, back = (np.abs(velocity - side * speed) < near for side in (1, -1))
    begins, ends = stretches(ahead)
    whole = abs(speed) * (ends - begins) / fs > WHOLE * np.ptp(x)
    return speed if np.sum(whole) >= FEWEST and ahead.mean() > CARRIED and back.mean() < CARRIED / 2 else None


def _constants(rig: RigSettings) -> dict[str, Any]:
    return {"mass": rig.mass, "stiffness": rig.stiffness, "damping": rig.damping or 0.0, "damper": rig.damper}


def _aligned(record: Record, inquiry: Inquiry) -> tuple[Record, SensorDelay | None]:
    """The record with the delay of displacement against acceleration stated, where it was not."""
    if not {"x", "a"} <= set(record) or any(record.channels[name].delay for name in ("x", "z", "a") if name in record):
        return record, None
    lag = inquiry.ask("Sensor delay", lambda: sensor_delay(middle(record, STRETCH)), aside=True)
    if lag is None:
        return record, None
    if lag.gain.value < 0:
        inquiry.notes.append(
            "The accelerometer runs against the displacement: one of the two has the wrong sign. Turn it round, as in "
            'channels={"a": "-COLUMN [m/s^2]"}.'
        )
        return record, lag
    late = -lag.delay.value
    if lag.status != "ok" and not (REPEATS in kinds(lag.status) and kinds(lag.status) <= {REPEATS, HIDDEN}):
        inquiry.notes.append(f"The delay of x against a, {1e3 * late:.3g} ms, is not taken out: it is not sure.")
        return record, lag
    if abs(late) < SURE * lag.delay.sd:
        return record, lag
    for name in ("x", "z"):
        if name in record:
            record = record.with_details(name, delay=late)
    late_ones = "x, and z as a sensor of its kind, come" if "z" in record else "x comes"
    inquiry.notes.append(
        f"{late_ones} {1e3 * late:.3g} ms after a, by the phase of their lines: taken out. State what is known "
        "of the sensors' delays to have that taken instead."
    )
    return record, lag


def _with_mounts(record: Record, comparison: ForceComparison | None, inquiry: Inquiry) -> Record:
    """The record with the mounts stated that the comparison of forces shows, where they were not."""
    differ = comparison is not None and (comparison.opposite or comparison.unlike)
    for resonance in () if comparison is None or differ else comparison.resonances:
        name = "a" if "accelerometer" in resonance.name else "load"
        if "mount" in resonance.name and record.channels[name].mount is None:
            record = record.with_details(name, mount=(resonance.frequency.value, resonance.damping.value))
            inquiry.notes.append(
                f"The {resonance.name} is taken to ring at {resonance.frequency.value:.4g} Hz: {resonance.evidence}."
            )
    return record


def _doubt(record: Record, given: Record, rig: RigSettings, *, aligned: bool) -> Doubt | None:
    """What is not known of the rig and its sensors behind a friction force that was not measured."""
    if "friction" in record and record.channels["friction"].source not in ("friction_force", "load"):
        return None
    sensors = [
        name if record.channels[name].mount is None else f"{name} (its mount found in this record)"
        for name in sorted(sensors_behind(record))
        if given.channels[name].mount is None
    ]
    unknown = [f"how {' and '.join(sensors)} {'is' if len(sensors) == 1 else 'are'} mounted"] if sensors else []
    if aligned:
        unknown.append(f"the delay of x{FOUND}")
    if "z" in record and record.channels["z"].source == FACE:
        unknown.append(f"the speed of the face it slides on{FOUND}")
    absent = [name for name in ("mass", "stiffness") if getattr(rig, name) is None]
    unknown += [f"the {name}{FOUND}" for name in absent if getattr(record.rig, name, None) is not None]
    if not unknown:
        return None
    listed = " and ".join(filter(None, (", ".join(unknown[:-1]), unknown[-1])))
    omission = f"{listed} {'is' if len(unknown) == 1 else 'are'} not stated"
    return Doubt(
        f"{omission}: the value may be wrong by some per cent, which the interval leaves out", UNSTATED, lesser=True
    )


def _tell_unused(rig: RigSettings, inquiry: Inquiry) -> None:
    unused = [key for key in CONSTANTS if key in rig.model_fields_set and getattr(rig, key) is not None]
    if unused:
        verb = "is" if len(unused) == 1 else "are"
        inquiry.notes.append(f"The friction was measured: {' and '.join(unused)} as stated {verb} not used.")


def described(sensor: Channel) -> bool:
    """Whether anything is known of what it makes of a motion."""
    return sensor.mount is not None or sensor.discharge is not None or sensor.inertia != 0


def chosen_method(record: Record, rig: RigSettings) -> tuple[str, str]:
    """By which method the friction is found, and why.

    Sensors of which nothing is stated are left aside however quiet they are: of the demonstration they give the sliding
    friction to 0.06 %, but say to 0.004 %, and four of its nine intervals leave the truth out.
    """
    helps = [name for name in ("a", "load") if name in record]
    if len(record) > AT_ONCE:
        why = f"{len(record)} samples are many; the method fusion takes them all together if it is asked to"
        return "smoother", why
    known = [name for name in helps if described(record.channels[name])]
    if known and rig.contact == "ground":
        return "fusion", f"{' and '.join(helps)} beside x: all sensors together by a Kalman smoother"
    why = "there is neither an accelerometer nor a load cell"
    if helps:
        why = f"state the mount of {' and '.join(helps)} to have all sensors put together"
    if helps and rig.contact == "base":
        why = "the contact is on the moving base"
    return "smoother", f"{why}: the displacement differentiated by a smoother"


def _balanced(record: Record, rig: RigSettings, method: str, inquiry: Inquiry) -> Record:
    """The record with its friction by the balance of forces."""
    why = "as asked"
    if method == "auto":
        method, why = chosen_method(record, rig)
    balanced = inquiry.ask(
        "Friction force", lambda: friction_force(record, contact=rig.contact, method=method, **_constants(rig))
    )
    if balanced is None:
        return record
    lost = () if balanced.rig is None else balanced.rig.lost
    inquiry.notes.append(f"Friction force: {'; '.join([f'by the method {method}', why, *lost])}.")
    for name, unit in (("mass", "kg"), ("stiffness", "N/m")):
        if getattr(rig, name) is None:
            value = f"{getattr(balanced.rig, name):.4g} {unit}"
            inquiry.notes.append(f"No {name} was stated: {value} is found from how the mass slides.")
    if "z" not in record:
        inquiry.notes.append("There is no channel z: the spring's other end is taken to be at rest.")
    if rig.damping is None:
        inquiry.notes.append("No damping was stated: viscous damping of the suspension, if any, counts as friction.")
    return balanced


def _by_load(record: Record, rig: RigSettings, inquiry: Inquiry) -> Record:
    """The record with what its load cell reads as its friction, or with a note of what is lacking."""
    moves = any(name in record for name in MOTION)
    if "load" in record and "force" not in record and moves:
        if described(record.channels["load"]) and "x" in record:
            return _by_cell(record, inquiry)
        inquiry.notes.append(
            "The load cell's reading is taken as the friction force; inertia between both is part of it, and what "
            "its mount adds, of which nothing is stated."
        )
        step = Step("analyze", {"friction": "load"}, "the load cell's reading taken as the friction force")
        unit = record.channels["load"].unit
        taken = record.with_channel("friction", record["load"], unit=unit, source="load", step=step)
        gain = record.channels["load"].gain_sd
        return taken.with_details("friction", gain_sd=gain) if gain else taken
    if {"x", "a"} <= set(record) and rig.mass is None and rig.stiffness is None and "load" not in record:
        _tell_per_mass(record, rig, inquiry)
    lacking = [key for key in ("mass", "stiffness") if getattr(rig, key) is None]
    lacking = lacking if "x" in record else ["a displacement x", *lacking]
    if lacking and "force" not in record and (moves or "load" not in record):
        inquiry.notes.append(
            f"Friction force: without a measured friction or load it needs {' and '.join(lacking)}, not given."
        )
    return record


def _tell_per_mass(record: Record, rig: RigSettings, inquiry: Inquiry) -> None:
    """What can be said without mass, spring and load cell."""
    scaled = inquiry.ask(
        "Friction per mass", lambda: friction_force(record, contact=rig.contact, method="motion"), aside=True
    )
    if scaled is not None:
        level = float(np.median(np.abs(scaled["friction_per_mass"])))
        inquiry.notes.append(f"Friction per mass: {level:.4g} m/s^2 (median); {scaled.history[-1].outcome}.")


def _by_cell(record: Record, inquiry: Inquiry) -> Record:
    """The record with its friction by the load cell alone, less what is stated of it."""
    measured = inquiry.ask("Friction force", lambda: friction_force(record, method="load"))
    if measured is None:
        return record
    inquiry.notes.append(f"Friction force: {measured.history[-1].outcome}.")
    return measured


def normal_load(record: Record, rig: RigSettings, name: str, notes: list[str]) -> Estimate | None:
    """The normal load as measured, by its magnitude and as sure as its sensor's gain, or as stated for the file."""
    if "normal" in record:
        finite = record["normal"][np.isfinite(record["normal"])]
        mean = float(finite.mean()) if len(finite) else 0.0
        if mean < 0:
            notes.append(f"The normal load reads {mean:.4g} N: its magnitude is taken.")
        if mean:
            sd = record.channels["normal"].gain_sd * abs(mean)
            return Estimate.normal(LOAD, abs(mean), sd=sd, unit="N", method="measured")
        notes.append("The channel normal holds no load but " + ("zeros." if len(finite) else "no numbers."))
    if record.log is not None and isinstance(record.log.normal, float):
        return Estimate.stated(LOAD, record.log.normal, "N")
    loads = (rig.normal_load(part) for part in [*name.split(" + "), name])
    return next((load for load in loads if load is not None), None)
