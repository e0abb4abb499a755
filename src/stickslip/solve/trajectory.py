"""What a simulation is: pieces of closed-form motion, the events between them, and how it ended."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stickslip.arrays import Array, Index
from stickslip.compiled import meanwhile
from stickslip.errors import SolveError
from stickslip.printing import html_table
from stickslip.record.channels import Channel, described
from stickslip.record.record import Record, Step
from stickslip.solve.cells import DEGREE
from stickslip.solve.kernel import follow, sample
from stickslip.solve.tables import JointMode, System, Tables

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

UNITS = {
    "x": "m", "v": "m/s", "a": "m/s^2", "friction": "N", "z": "m", "force": "N",
    "way": "m", "slip": "m/s", "load": "N",
}  # fmt: skip
TURNING = {"x": "angle", "v": "angular velocity", "a": "angular acceleration"}
A_PERIOD = 200  # samples of a table, where no rate is asked for
FEW = 1024  # instants that Python looks at in one go: a tenth of a second
MOST = 1e10  # samples of a record; more fit no desk


class Event(NamedTuple):
    """One change of mode: when [s], what it is called, the mode it leads to, that mode's side, and which contact."""

    time: float
    kind: str
    mode: str
    side: int
    contact: int = 0


class Piece(NamedTuple):
    """One stretch in one mode: start [s], duration [s], mode, and the state at its start by name."""

    start: float
    duration: float
    mode: str
    state: dict[str, float]


@dataclass(frozen=True, eq=False, repr=False)
class Trajectory:
    """A simulated motion, exact at every instant.

    Attributes
    ----------
    system : Oscillator or Structure
        What moved.
    table : Tables
        Its flat mode tables.
    laps, offsets : ndarray (n,)
        Start of each piece: full periods of the drive, and time [s] within the period. Kept apart, so that long runs
        lose no digits.
    modes : ndarray (n,)
        Number of each piece's mode.
    durations : ndarray (n,)
        Length of each piece [s].
    kept : ndarray (n, K)
        State at the start of each piece; of a single tone's signals nothing is kept, the clock has them.
    exits : ndarray (n,)
        Number of the exit that ended each piece; -1 where the time was over.
    duration : float
        Simulated time [s].
    status : str
        "complete", "at rest" (nothing more will happen), or "interrupted".
    """

    system: System
    table: Tables
    laps: NDArray[np.int32]
    offsets: Array
    modes: NDArray[np.int16]
    durations: Array
    kept: Array
    exits: NDArray[np.int16]
    duration: float
    status: str

    @cached_property
    def starts(self) -> Array:
        """Start of each piece [s]."""
        period = self.table.motion.period
        return self.offsets + (self.laps * period if np.isfinite(period) else 0.0)

    @cached_property
    def states(self) -> Array:
        """Whole state at the start of each piece (n, N)."""
        table = self.table
        if self.kept.shape[1] == len(table.names):
            return self.kept
        angle = table.tones[0, 2] * self.offsets + table.tones[0, 3]
        return np.column_stack([self.kept, np.ones(len(self.kept)), np.cos(angle), np.sin(angle)])

    @property
    def corners(self) -> Array:
        """State at the start of each stretch that is one closed form or one polynomial (n, N)."""
        return self.states

    def end(self) -> tuple[Array, int]:
        """State and mode at the end of whole laps of the drive, the event that falls on it included.

        Returns
        -------
        state : ndarray (N,)
        mode : int
        """
        table, mode, leaving = self.table, int(self.modes[-1]), int(self.exits[-1])
        first, last = self.states[0].copy(), self.states[-1].copy()
        meanwhile.now(follow)(table.linear, mode, last, float(self.durations[-1]), np.empty((3, len(last))))
        if leaving >= 0:
            last, mode = table.reset[leaving] @ last, int(table.target[leaving])
        first[: table.physical] = last[: table.physical]  # the drive's signals are again what they were
        return first, mode

    @property
    def pieces(self) -> tuple[Piece, ...]:
        """The stretches between events."""
        names, modes = self.table.names, self.table.modes
        return tuple(
            Piece(float(t), float(d), modes[m].name, dict(zip(names, map(float, s), strict=True)))
            for t, d, m, s in zip(self.starts, self.durations, self.modes, self.states, strict=True)
        )

    @property
    def events(self) -> tuple[Event, ...]:
        """The changes of mode, in order of time.

        Kinds: the kind of the mode that begins ("stick", "slip", "microstick", "flight"), or "reversal" where a slip
        goes straight over into a slip to the other side.
        """
        return tuple(self.each_event())

    def each_event(self) -> Iterator[Event]:
        """The events one by one, of a run too long for a tuple of them.

        Yields
        ------
        Event
        """
        ends, codes = self._changes
        texts = {code: self._words(code) for code in np.unique(codes).tolist()}
        for j, code in zip(ends.tolist(), codes.tolist(), strict=True):
            for word in texts[code]:
                yield Event(float(self.starts[j]), *word)

    def event_counts(self) -> Counter[str]:
        """How many events there are of each kind.

        Returns
        -------
        Counter
        """
        counts: Counter[str] = Counter()
        for code, count in zip(*np.unique(self._changes[1], return_counts=True), strict=True):
            for kind, *_ in self._words(int(code)):
                counts[kind] += int(count)
        return counts

    def kinds(self, contact: int = 0) -> list[str]:
        """What each mode of the table is at one contact: "slip", "stick", "microstick" or "flight".

        Parameters
        ----------
        contact : int
            Number of the contact, from 0.

        Returns
        -------
        list of str
        """
        return [
            mode.parts[contact].kind if isinstance(mode, JointMode) and mode.parts else mode.kind
            for mode in self.table.modes
        ]

    def shares(self, contact: int = 0) -> dict[str, float]:
        """Which shares of the time does a contact stick and slip?

        Parameters
        ----------
        contact : int
            Number of the contact, from 0.

        Returns
        -------
        dict of str to float
            By kind; they add up to 1.

        Examples
        --------
        >>> from stickslip import Oscillator, drives, laws, simulate
        >>> drive = drives.HarmonicBase(6.5e-4, frequency=2.5)
        >>> run = simulate(Oscillator(2.42, 2310, laws.Coulomb(1.1), drive), cycles=20)
        >>> {kind: round(share, 2) for kind, share in run.shares().items()}
        {'slip': 0.74, 'stick': 0.26}
        """
        spent = np.bincount(self.modes, weights=self.durations, minlength=len(self.table.modes)) / self.duration
        shares: dict[str, float] = {}
        for kind, share in zip(self.kinds(contact), spent.tolist(), strict=True):
            shares[kind] = shares.get(kind, 0.0) + share
        return shares

    @cached_property
    def _changes(self) -> tuple[Index, Index]:
        """Pieces that begin with an event, and a number for what happens there.

        By which exit, from which mode, into which; by none (-1) where the drive jumps and the mass goes on in another.
        """
        leaving, count = self.exits[:-1].astype(np.int64), len(self.table.modes)
        before, entered = self.modes[:-1].astype(np.int64), self.modes[1:].astype(np.int64)
        left = np.where(leaving < 0, before, np.searchsorted(self.table.first, leaving, side="right") - 1)
        changed = (leaving >= 0) | (left != entered)
        if self.table.settling:
            changed &= ~np.isin(leaving, list(self.table.settling))
        begun = np.flatnonzero(changed)
        return begun + 1, ((leaving[begun] + 1) * count + left[begun]) * count + entered[begun]

    def _words(self, code: int) -> list[tuple[str, str, int, int]]:
        """Kind, mode, side and contact of the events that an exit from a mode into another stands for."""
        count = len(self.table.modes)
        leaving, left, entered = code // count**2 - 1, code // count % count, code % count
        number = leaving - int(self.table.first[left]) if leaving >= 0 else -1
        before, after = self.table.modes[left], self.table.modes[entered]
        return [
            ("reversal" if old.side * new.side < 0 else new.kind, new.name, new.side, contact)
            for contact, old, new in after.changes(before, number)
        ]

    @property
    def event_pieces(self) -> Index:
        """Numbers of the pieces that begin with an event."""
        return self._changes[0]

    def state(self, time: float) -> dict[str, float]:
        """The exact state at one instant: x [m], v [m/s], the law's memory, a [m/s^2], friction [N], and the mode.

        Parameters
        ----------
        time : float
            Instant [s] within the simulated time; at an event, the state after it.

        Returns
        -------
        dict of str to float
            By name; "mode" is the number of the piece's mode in ``table.modes``.

        Raises
        ------
        SolveError
            The instant lies outside the simulated time.
        """
        names = self.table.names[: self.table.physical]
        values, piece = self.sample([time], ("state", "a", "friction"))
        names = (*names, *self.labels("a"), *self.labels("friction"))
        named = dict(zip(names, map(float, values[:, 0]), strict=True))
        return {**named, "mode": int(self.modes[piece[0]])}

    def restart(self, time: float | None = None) -> dict[str, float | str]:
        """The state at an instant as a start: with ``drive=Later(drive, time)`` another run goes on from there.

        Numbers and the name of the mode, all that has to be kept of a run for it to go on, in another process as well.

        Parameters
        ----------
        time : float, optional
            Instant [s]; the end where left out.

        Returns
        -------
        dict
            What ``simulate(..., start=)`` takes.

        Raises
        ------
        SolveError
            The instant lies outside the simulated time, or the law's past is no state (a time lag).
        """
        at = self.duration if time is None else time
        if hasattr(getattr(self.system, "law", None), "lag"):
            raise SolveError("a law with a time lag", "its past is no state", "simulate the whole time at once")
        values, piece = self.sample([at], ("state",))
        names, mode = self.table.names[: self.table.physical], self.table.modes[int(self.modes[piece[0]])]
        start: dict[str, float | str] = dict(zip(names, map(float, values[:, 0]), strict=True))
        if mode.friction is None:  # what is held has the counter-face's velocity to the last digit
            start.pop("v", None)
        return {**start, "mode": mode.name}

    def instants(self, times: ArrayLike) -> Array:
        """Instants as an array, if the motion is known at the first and at the last."""
        times = np.ascontiguousarray(times, dtype=np.float64)
        if len(times) and not (times[0] >= 0 and times[-1] <= self.duration * (1 + 1e-12)):
            raise SolveError(
                f"instants from {times[0]:g} to {times[-1]:g} s",
                f"the motion is known from 0 to {self.duration:g} s",
                "simulate longer, or ask within it",
            )
        return times

    def sample(self, times: ArrayLike, outputs: tuple[str, ...]) -> tuple[Array, Index]:
        """Exact values at increasing instants.

        Parameters
        ----------
        times : array_like
            T instants [s], increasing, within the simulated time.
        outputs : tuple of str
            Of "x", "v", "a", "friction", "z", "slip" (velocity relative to the counter-face), "force", the names of
            the law's memory, and "state" (all physical entries of the state). Of a structure "x", "v" and "a" are
            those of every degree of freedom, "friction", "slip" and "load" those of every contact.

        Returns
        -------
        values : ndarray (R, T)
        piece : ndarray (T,)
            Number of the piece each instant falls in.

        Raises
        ------
        SolveError
            Instants out of order or outside the simulated time, or an output that the system does not have.
        """
        times = self.instants(times)
        if np.any(np.diff(times) < 0):
            raise SolveError("instants that run back", "they are looked up in the order of time", "sort them")
        rows = np.concatenate([self.rows(name) for name in outputs], axis=1)
        work, c = np.empty((4, self.states.shape[1])), np.empty((rows.shape[1], DEGREE + 1))
        out, piece, done = np.empty((rows.shape[1], len(times))), np.empty(len(times), dtype=np.int64), 0
        motion = (self.table.linear, self.starts, self.modes, self.states)
        while done < len(times):
            now = meanwhile.now(sample)
            part = slice(done, len(times) if now is sample else done + FEW)
            values = out[:, part] if part == slice(0, len(times)) else np.empty_like(out[:, part], order="C")
            now(*motion, times[part], rows, piece[part], values, work, c)
            if values.base is not out:
                out[:, part] = values
            done = part.stop
        return out, piece

    @property
    def cells(self) -> tuple[Array, Array]:
        """Start and length [s] of the stretches in turn on which the motion is one short polynomial."""
        cells = np.minimum(self.table.cell[self.modes], self.durations)
        counts = np.maximum(1, np.ceil(self.durations / cells - 1e-9)).astype(np.int64)
        widths = np.repeat(self.durations / counts, counts)
        index = np.arange(len(widths)) - np.repeat(np.cumsum(counts) - counts, counts)
        return np.repeat(self.starts, counts) + index * widths, widths

    def section(self, *, phase: float = 0.0) -> Array:
        """The Poincare section: the physical state once in each period of the drive.

        Parameters
        ----------
        phase : float
            Where in the period to look [rad].

        Returns
        -------
        ndarray (n, K)
            x [m], v [m/s] and the law's memory, a row for each period.

        Raises
        ------
        SolveError
            The drive has no period.
        """
        period = self.table.motion.period
        if not np.isfinite(period):
            raise SolveError("the drive has no period", "a section looks once in each", "use a periodic drive")
        offset = phase % (2 * np.pi) / (2 * np.pi) * period
        count = int(np.floor((self.duration - offset) / period * (1 + 1e-12))) + 1
        times = np.minimum(offset + np.arange(max(count, 0)) * period, self.duration)
        return self.sample(times, ("state",))[0].T

    def rows(self, name: str) -> Array:
        """An output as linear forms of the state, by mode: (M, R, N)."""
        table = self.table
        count, size = len(table.modes), len(table.names)
        degrees = table.degrees
        spans = {"x": range(degrees), "v": range(degrees, 2 * degrees), "state": range(table.physical)}
        if name == "a":
            return table.flow[:, degrees : 2 * degrees]
        if name == "friction":
            return table.friction
        if name in table.outputs:
            forms = np.atleast_2d(table.outputs[name])
            return np.broadcast_to(forms, (count, *forms.shape[-2:]))
        if name not in spans and name not in table.names:
            known = (*spans, "a", "friction", *table.outputs, *table.names[2 * degrees : table.physical])
            raise SolveError(f"no output is called '{name}'", f"there are {', '.join(known)}", "name one of them")
        places = list(spans[name]) if name in spans else [table.names.index(name)]
        return np.broadcast_to(np.eye(size)[places], (count, len(places), size))

    def labels(self, name: str) -> tuple[str, ...]:
        """What the rows of an output are called: the name alone where there is one, else name1, name2 ..."""
        count = self.rows(name).shape[1]
        return (name,) if count == 1 else tuple(f"{name}{j + 1}" for j in range(count))

    def units(self, name: str) -> tuple[str, ...]:
        """Units of the rows of an output: of a structure's angles "rad", "rad/s" and "rad/s^2"."""
        angles = getattr(self.system, "rotations", ()) if name in TURNING else ()
        unit = UNITS[name]
        return tuple(unit.replace("m", "rad", 1) if j in angles else unit for j in range(1, 1 + len(self.labels(name))))

    def record(self, *, fs: float) -> Record:
        """The motion sampled at a rate, as a Record.

        Parameters
        ----------
        fs : float
            Sampling rate [Hz].

        Returns
        -------
        Record
            Channels x, v, a, friction, and z where the base moves, force where a force acts; x1, x2 ... of a
            structure, in rad where it is an angle.

        Raises
        ------
        SolveError
            The rate is not positive, or asks for more samples than can be held.
        """
        if not (fs > 0 and self.duration * fs < MOST):
            raise SolveError(
                f"fs = {fs} Hz over {self.duration:g} s",
                f"the rate is positive, and a record has up to {MOST:g} samples",
                "give fs= in Hz, or simulate a shorter time",
            )
        count = int(np.floor(self.duration * fs * (1 + 1e-12))) + 1
        times = np.minimum(np.arange(count) / fs, self.duration)
        names = ["x", "v", "a", "friction"]
        names += ["z"] * bool(self.table.motion.base) + ["force"] * bool(self.table.motion.force)
        values, _ = self.sample(times, tuple(names))
        labels = [
            (label, unit, TURNING[name] if unit.startswith("rad") else described(name, unit))
            for name in names
            for label, unit in zip(self.labels(name), self.units(name), strict=True)
        ]
        channels = {label: Channel(label, unit, title, source="simulate") for label, unit, title in labels}
        step = Step("simulate", {"system": repr(self.system), "fs": fs}, f"{len(self.modes)} pieces, {self.status}")
        samples: Mapping[str, Array] = dict(zip(channels, values, strict=True))
        return Record(samples, channels, float(fs), 0.0, (step,), None, {"system": repr(self.system)})

    def to_pandas(self, *, fs: float | None = None) -> pd.DataFrame:
        """The motion as a DataFrame over time [s], sampled at `fs`; 200 times a period where left out."""
        return self.record(fs=fs or self._enough).to_pandas()

    def to_xarray(self, *, fs: float | None = None) -> xr.Dataset:
        """The same as an xarray Dataset."""
        return self.record(fs=fs or self._enough).to_xarray()

    @property
    def _enough(self) -> float:
        """Samples a second that show a period's shape."""
        period = self.table.motion.period
        frequency = 1 / period if np.isfinite(period) else self.system.frequency
        return A_PERIOD * (frequency or 1 / self.duration)

    def _repr_html_(self) -> str:
        counts = {"events": len(self.events), **self.event_counts()}
        counted = ((kind, str(n)) for kind, n in counts.items())
        rows = [("simulated", f"{self.duration:g} s"), ("ended", self.status), *counted]
        return html_table(f"Trajectory of {type(self.system).__name__}", ("", ""), rows)

    def __repr__(self) -> str:
        return f"Trajectory({self.duration:g} s, {len(self.modes)} pieces, {self.status})"
