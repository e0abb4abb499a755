"""Record: channels on one clock, in SI, with the history of how they came to be."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from stickslip.arrays import Array
from stickslip.errors import TOO_SHORT, RecordError
from stickslip.printing import html_table
from stickslip.record import metadata
from stickslip.record.channels import VOCABULARY, Channel, checked_name, described
from stickslip.record.check import Fault, clock_cure, cure, find_faults
from stickslip.record.metadata import Log
from stickslip.units import parse_unit

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr


# of a channel, that a user may know better than the file
DETAILS = ("delay", "noise", "sensitivity", "quantity", "mount", "inertia", "discharge", "gain_sd")
RIG_UNITS = {"mass": "kg", "stiffness": "N/m", "damping": "N s/m"}
MEASURABLE = 1e60  # in SI, as its inverse: beyond, the fourth power of a reading is no number any more


@dataclass(frozen=True)
class Step:
    """One thing that was done to a record.

    Attributes
    ----------
    action : str
        The function.
    arguments : mapping
        What it was called with.
    outcome : str
        What came of it, in words.
    repair : str
        The name by which :func:`~stickslip.answers.mend` and ``--repair`` know it; empty of what is no repair.
    """

    action: str
    arguments: Mapping[str, Any] = field(default_factory=dict)
    outcome: str = ""
    repair: str = ""

    def __post_init__(self) -> None:
        named = isinstance(self.arguments, Mapping) and all(isinstance(key, str) for key in self.arguments)
        if not (named and all(isinstance(text, str) for text in (self.action, self.outcome, self.repair))):
            raise RecordError(
                f"a step {str(self.action)[:40]!r} with {str(self.arguments)[:40]!r}",
                "a step is a function's name, its arguments by name, and what came of it in words",
                "pass a text, a mapping and a text",
            )

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        mends = {"repair": self.repair} if self.repair else {}
        return {"action": self.action, "arguments": dict(self.arguments), "outcome": self.outcome, **mends}

    def __str__(self) -> str:
        arguments = ", ".join(f"{key}={value!r}" for key, value in self.arguments.items())
        return f"{self.action}({arguments})" + (f": {self.outcome}" if self.outcome else "")


@dataclass(frozen=True)
class StatedRig:
    """What the friction force of a record was found with.

    Attributes
    ----------
    method : str
        Of :func:`~stickslip.friction_force`.
    contact : {"ground", "base"}
        What the mass slides on.
    mass, stiffness : float or None
        Of the oscillator [kg, N/m]; None where the friction was found without.
    damping : float
        Viscous, of the suspension [N s/m].
    damper : {"ground", "base"}
        What the damper ends on.
    bandwidth : float or None
        Of the smoother [Hz].
    lost : tuple of str
        What a sensor could not tell, in words.
    sd : mapping of str to float
        Standard deviation of mass, stiffness and damping, in their units, where one was stated; the others are exact.
    """

    method: str
    contact: str = "ground"
    mass: float | None = None
    stiffness: float | None = None
    damping: float = 0.0
    damper: str = "ground"
    bandwidth: float | None = None
    lost: tuple[str, ...] = ()
    sd: Mapping[str, float] = field(default_factory=dict, hash=False)

    def __post_init__(self) -> None:
        for name, sd in self.sd.items():
            if name not in RIG_UNITS or not 0 <= sd < math.inf:
                raise RecordError(
                    f"sd = {sd!r} of {name}",
                    f"of {', '.join(RIG_UNITS)} the standard deviation is finite and not negative",
                    "correct it",
                )

    @property
    def constants(self) -> dict[str, Any]:
        """The arguments of the balance of forces that are known, by name."""
        names = ("mass", "stiffness", "damping", "damper", "contact")
        return {name: value for name in names if (value := getattr(self, name)) is not None}


@dataclass(frozen=True, eq=False, repr=False)
class Record:
    """Measured or simulated channels on one clock.

    Samples are float64 in SI units and read-only; every method returns a new Record.

    Attributes
    ----------
    samples : mapping of str to ndarray
        One array of n samples per channel.
    channels : mapping of str to Channel
        Unit, quantity, source, sensitivity and delay of each.
    fs : float
        Sampling rate [Hz]; where the clock is broken (`stamps` is kept), the median rate.
    start : float
        Time [s] of the first sample.
    history : tuple of Step
        What was read (with sha256) and done to it, in order.
    stamps : ndarray or None
        The time stamps [s] as read, kept only where they are not uniform; see :meth:`check` and ``repair_clock``.
    truth : mapping
        True values behind a simulated record, by name; empty for a measured one.
    rig : StatedRig or None
        What the friction force was found with; None where no balance of forces was drawn up.
    log : Log or None
        What was written down beside the measurement: surfaces, lubrication, air, load, remarks.

    Examples
    --------
    >>> record = Record.of({"x": [0.0, 1.0, 0.0, -1.0]}, fs=4.0, units={"x": "mm"})
    >>> float(record["x"][1]), record.fs, record.duration
    (0.001, 4.0, 1.0)
    """

    samples: Mapping[str, Array]
    channels: Mapping[str, Channel]
    fs: float
    start: float = 0.0
    history: tuple[Step, ...] = ()
    stamps: Array | None = None
    truth: Mapping[str, Any] = field(default_factory=dict)
    rig: StatedRig | None = None
    log: Log | None = None

    def __post_init__(self) -> None:
        if not self.samples:
            raise RecordError(
                "a record without channels", "at least one channel is needed", "name a column in channels="
            )
        if not (math.isfinite(self.fs) and self.fs > 0 and math.isfinite(self.start)):
            raise RecordError(
                f"fs = {self.fs} Hz, start = {self.start} s", "fs is positive and both are finite", "pass fs= in Hz"
            )
        frozen = {checked_name(name): _frozen(values) for name, values in self.samples.items()}
        lengths = {name: len(values) for name, values in frozen.items()}
        if len(set(lengths.values())) > 1 or (self.stamps is not None and len(self.stamps) not in lengths.values()):
            counts = ", ".join(f"{name} {length}" for name, length in lengths.items())
            raise RecordError(
                f"channels of unequal length ({counts})",
                "one record has one clock",
                "read them apart, or cut them to the same rows",
            )
        if min(lengths.values()) == 0:
            raise RecordError("a record without samples", "at least one sample is needed", "check rows= and the file")
        if not isinstance(self.truth, Mapping):
            raise RecordError(
                f"truth = {str(self.truth)[:40]!r}", "true values are given by their names", "pass a mapping"
            )
        object.__setattr__(self, "samples", MappingProxyType(frozen))
        object.__setattr__(self, "channels", MappingProxyType({name: self.channels[name] for name in frozen}))
        object.__setattr__(self, "history", tuple(self.history))
        object.__setattr__(self, "truth", MappingProxyType(dict(self.truth)))
        if self.stamps is not None:
            object.__setattr__(self, "stamps", _frozen(self.stamps))

    def __reduce__(self) -> tuple[Any, ...]:
        """For pickle and copy, which can not follow a mapping that is read-only: made again from its fields."""
        own = {field.name: getattr(self, field.name) for field in fields(self)}
        plain = [dict(value) if isinstance(value, MappingProxyType) else value for value in own.values()]
        return type(self), tuple(plain)

    @classmethod
    def of(
        cls,
        samples: Mapping[str, ArrayLike],
        *,
        fs: float,
        units: Mapping[str, str] | None = None,
        start: float = 0.0,
        truth: Mapping[str, Any] | None = None,
    ) -> Record:
        """A record from arrays in memory.

        Parameters
        ----------
        samples : mapping of str to array_like
            One sequence of n numbers per channel.
        fs : float
            Sampling rate [Hz].
        units : mapping of str to str, optional
            Unit of each channel as given ("mm"); SI of the vocabulary where left out.
        start : float
            Time [s] of the first sample.
        truth : mapping, optional
            True values, for a simulated record.
        """
        units, arrays, channels = dict(units or {}), {}, {}
        for name, values in samples.items():
            usual = VOCABULARY[name].units[0] if name in VOCABULARY else "1"
            one = name in VOCABULARY and len(VOCABULARY[name].units) == 1
            unit = parse_unit(units.get(name, usual), expect=usual if one else None)
            arrays[name] = np.asarray(values, dtype=float) * unit.scale + unit.zero
            channels[name] = Channel(name, unit.si, described(name, unit.si), source="array")
        stated = {name: channel.unit for name, channel in channels.items()}
        step = Step("Record.of", {"fs": fs, "units": stated}, f"{len(arrays)} arrays in memory")
        return cls(arrays, channels, float(fs), start, (step,), None, truth or {})

    # ---- reading

    def __getitem__(self, name: str) -> Array:
        self.require(name)
        return self.samples[name]

    def __contains__(self, name: object) -> bool:
        return name in self.samples

    def __iter__(self) -> Iterator[str]:
        return iter(self.samples)

    def __len__(self) -> int:
        return len(next(iter(self.samples.values())))

    @property
    def time(self) -> Array:
        """Time [s] of each sample: the stamps as read where the clock is broken, else uniform."""
        return self.stamps if self.stamps is not None else self.start + np.arange(len(self)) / self.fs

    @property
    def duration(self) -> float:
        """Number of samples over the rate [s]."""
        return len(self) / self.fs

    def require(self, *names: str, question: str = "this question", kind: str = "") -> None:
        """Refuse, in one sentence, if a channel is missing; the error is of a kind."""
        missing = [name for name in names if name not in self.samples]
        if missing:
            plural, verb = ("s", "are") if len(missing) > 1 else ("", "is")
            raise RecordError(
                f"channel{plural} {', '.join(missing)} {verb} missing (the record has {', '.join(self.samples)})",
                f"{question} needs {', '.join(names)}",
                f'name the column when reading: channels={{"{missing[0]}": "COLUMN [unit]"}}',
                kind=kind,
            )

    def require_clean(self, *names: str, question: str = "this question", samples: int = 1) -> None:
        """Refuse, in one sentence, a missing channel, a broken clock, a value not finite, too few samples."""
        self.require(*names, question=question)
        if len(self) < samples:
            raise RecordError(
                f"the record has {len(self)} samples",
                f"{question} needs at least {samples}",
                "give a longer record",
                kind=TOO_SHORT,
            )
        if self.stamps is not None:
            raise RecordError(
                "the time stamps are not uniform",
                f"{question} needs one sampling rate",
                f"see record.check() and {clock_cure(self.stamps)}",
            )
        for name in names:
            bad = np.flatnonzero(~np.isfinite(self.samples[name]))
            if len(bad):
                several = f"{len(bad)} values that are not numbers, the first"
                many = several if len(bad) > 1 else "a value that is no number"
                raise RecordError(
                    f"channel {name} has {many} at row {bad[0]}",
                    f"{question} needs numbers throughout",
                    f"see record.check(): {cure(self.samples[name])}",
                )
            _require_size(self.channels[name], self.samples[name], question)

    # ---- deriving

    def with_channel(
        self,
        name: str,
        values: ArrayLike,
        *,
        unit: str,
        source: str = "",
        noise: float | None = None,
        step: Step | None = None,
    ) -> Record:
        """This record with a channel added or replaced; `values` in `unit` (SI)."""
        channel = Channel(checked_name(name), unit, described(name, unit), source, noise=noise)
        samples = {**self.samples, name: np.asarray(values, dtype=float)}
        history = self.history if step is None else (*self.history, step)
        return replace(self, samples=samples, channels={**self.channels, name: channel}, history=history)

    def with_details(self, name: str, /, **details: Any) -> Record:
        """This record with details of a channel stated: ``delay``, ``noise``, ``mount`` ...; see :class:`Channel`."""
        self.require(name)
        if unknown := set(details) - set(DETAILS):
            raise RecordError(
                f"{', '.join(sorted(unknown))} of channel {name}", f"the details are {', '.join(DETAILS)}", "choose one"
            )
        channels = {**self.channels, name: replace(self.channels[name], **details)}
        step = Step("with_details", {"name": name, **details})
        return replace(self, channels=channels, history=(*self.history, step))

    def with_log(self, log: Log | Mapping[str, Any]) -> Record:
        """This record with what was written down beside it; entries stated before stay where they are not named.

        Examples
        --------
        >>> record = Record.of({"x": [0.0, 1.0]}, fs=2.0).with_log({"surface": "steel on steel", "humidity": "45 %"})
        >>> record.log.rows()
        [('Surfaces', 'steel on steel'), ('Relative humidity', '45 %')]
        """
        added = log.entries() if isinstance(log, Log) else dict(log)
        known = self.log.entries() if self.log is not None else {}
        return replace(self, log=Log.of({**known, **added}))

    def with_samples(
        self,
        samples: Mapping[str, Array],
        step: Step,
        *,
        fs: float | None = None,
        start: float | None = None,
        stamps: Array | None = None,
        filtered: bool = False,
    ) -> Record:
        """This record's channels with new samples (all of them, on a new clock if given), logged as `step`.

        Samples that were `filtered` have no longer the noise that was stated.
        """
        fs, start = self.fs if fs is None else fs, self.start if start is None else start
        channels = {n: replace(c, noise=None) for n, c in self.channels.items()} if filtered else self.channels
        return Record(samples, channels, fs, start, (*self.history, step), stamps, self.truth, self.rig, self.log)

    def rows(self, first: int = 0, last: int | None = None) -> Record:
        """Rows ``first`` up to, not including, ``last`` (negative from the end, as in a slice)."""
        part = slice(*slice(first, last).indices(len(self)))
        samples = {name: values[part] for name, values in self.samples.items()}
        start = float(self.time[part.start]) if part.start < len(self) else self.start
        kept = len(range(*part.indices(len(self))))
        step = Step("rows", {"first": first, "last": last}, f"{kept} of {len(self)} rows kept")
        return self.with_samples(samples, step, start=start, stamps=None if self.stamps is None else self.stamps[part])

    def between(self, first: float, last: float) -> Record:
        """The samples with ``first <= time < last`` [s]."""
        inside = np.flatnonzero((self.time >= first) & (self.time < last))
        if not len(inside):
            raise RecordError(
                f"no sample between {first} s and {last} s",
                f"the record runs from {self.time[0]:g} s to {self.time[-1]:g} s",
                "choose times inside it",
            )
        return self.rows(int(inside[0]), int(inside[-1]) + 1)

    # ---- looking

    def check(self) -> list[Fault]:
        """What is wrong with the record, in words, with row numbers; empty when nothing is.

        See :mod:`stickslip.record.check` for what is looked for.
        """
        return list(self._faults)

    @cached_property
    def _faults(self) -> tuple[Fault, ...]:
        """Looked for once: a record does not change, and every question asks."""
        return tuple(find_faults(self))

    def to_pandas(self) -> pd.DataFrame:
        """A DataFrame indexed by time [s]; units and history in ``.attrs``."""
        return metadata.to_pandas(self)

    def to_xarray(self) -> xr.Dataset:
        """An xarray Dataset over ``time`` [s] with units and history as attributes."""
        return metadata.to_xarray(self)

    def to_sep005(self) -> list[dict[str, Any]]:
        """The list of channel dictionaries of SDyPy's SEP 005."""
        return metadata.to_sep005(self)

    def equals(self, other: object) -> bool:
        """Whether another record holds exactly the same samples, channels, clock, history, truth, rig and log."""
        if not isinstance(other, Record) or list(self.samples) != list(other.samples):
            return False
        pairs = [(self.samples[name], other.samples[name]) for name in self.samples]
        if (self.stamps is None) != (other.stamps is None):
            return False
        if self.stamps is not None and other.stamps is not None:
            pairs.append((self.stamps, other.stamps))
        same = all(np.array_equal(mine, theirs, equal_nan=True) for mine, theirs in pairs)
        details = [
            (dict(r.channels), r.fs, r.start, [s.to_dict() for s in r.history], dict(r.truth), r.rig, r.log)
            for r in (self, other)
        ]
        return same and details[0] == details[1]

    def _repr_html_(self) -> str:
        rows = [
            (
                name,
                f"[{self.channels[name].unit}]",
                self.channels[name].quantity,
                f"{np.nanmin(values):.5g}",
                f"{np.nanmax(values):.5g}",
            )
            for name, values in self.samples.items()
            if np.isfinite(values).any()
        ]
        clock = f"{len(self)} samples, {self.fs:g} Hz, {self.time[0]:g} to {self.time[-1]:g} s"
        title = f"Record: {clock}{', broken clock' if self.stamps is not None else ''}"
        return html_table(title, ("channel", "unit", "quantity", "least", "greatest"), rows)

    def __repr__(self) -> str:
        names = ", ".join(f"{channel.name} [{channel.unit}]" for channel in self.channels.values())
        clock = "broken clock, about " if self.stamps is not None else ""
        return f"Record({names}; {len(self)} samples, {clock}{self.fs:g} Hz, from {self.start:g} s)"


def require_record(*things: object) -> None:
    """Refuse what is no Record, and say how one is made; a sequence is looked into."""
    for thing in things:
        if isinstance(thing, list | tuple):
            require_record(*thing)
        elif not isinstance(thing, Record):
            frame = type(thing).__module__.partition(".")[0]
            made = {
                "dict": 'stickslip.Record.of({"x": [...]}, fs=1000, units={"x": "mm"})',
                "str": "stickslip.read_record(path)", "PosixPath": "stickslip.read_record(path)",
                "DataFrame": f"stickslip.record.from_{frame}(frame)", "Dataset": f"stickslip.record.from_{frame}(data)",
            }  # fmt: skip
            raise RecordError(
                f"a {type(thing).__name__} where a Record belongs",
                "a question is asked of a Record, whose channels have units and one clock",
                f"make one: {made.get(type(thing).__name__, made['dict'])}",
            )


def _require_size(channel: Channel, values: Array, question: str) -> None:
    """Refuse readings whose powers no computer holds: a unit or a column is wrong."""
    largest = float(np.max(np.abs(values), initial=0.0))
    if largest > MEASURABLE or 0 < largest < 1 / MEASURABLE:
        raise RecordError(
            f"channel {channel.name} reads {largest:.3g} {channel.unit} at most",
            f"{question} needs readings between {1 / MEASURABLE:g} and {MEASURABLE:g} {channel.unit}",
            "correct the unit or the column",
        )


def _frozen(values: ArrayLike) -> Array:
    array = np.asarray(values, dtype=np.float64)
    if array.ndim != 1:
        raise RecordError(
            f"a channel of shape {array.shape}", "a channel is one row of numbers", "pass one-dimensional samples"
        )
    owner: Any = array
    while isinstance(owner, np.ndarray) and not owner.flags.writeable:
        owner = owner.base
    if owner is not None:  # somebody else can still change it
        array = array.copy()
    array.flags.writeable = False
    return array
