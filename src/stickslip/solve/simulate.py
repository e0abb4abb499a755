"""Run a system through its events, and find when a quantity of a run crosses a level."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack, suppress
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from stickslip.arrays import Array
from stickslip.compiled import by_python, meanwhile
from stickslip.drives.kinds import HarmonicBase, Recorded
from stickslip.errors import ModelError, SolveError
from stickslip.laws.coulomb import Coulomb
from stickslip.laws.stribeck import TimeDelay
from stickslip.oscillator import Oscillator, PlanarOscillator
from stickslip.parameters import finite
from stickslip.solve import kernel
from stickslip.solve.assembly import table_of
from stickslip.solve.curved import degree, run_curved
from stickslip.solve.delayed import delayed_tape, run_delayed
from stickslip.solve.glide import Clock, Model, Pieces, blank_past, blank_pieces, until
from stickslip.solve.phasors import fast_tables
from stickslip.solve.planar import planar_tape, run_planar
from stickslip.solve.refusal import LISTED, Budget, chatter, heed, held_back, named, require_numbers, unproved
from stickslip.solve.roots import NOISE
from stickslip.solve.tables import Stops, System, Tables, is_curved
from stickslip.solve.tape import tape
from stickslip.solve.trajectory import Trajectory

if TYPE_CHECKING:
    from stickslip.solve.tape import Tape

CHUNK = 16384  # pieces between two looks at the clock and the keyboard
FEW, SHORT = 16, 2048  # pieces and cells of a chunk that Python runs: tenths of a second, and some
CELLS = 65536  # Taylor cells between two looks, of a state of up to `SMALL` entries; of larger ones less by the square
SMALL = 8
MOST_CELLS = 1e10  # of a run: some hours
SURE, MOST_PIECES = 1_000_000, 2e8  # after which it is foretold how many a run will keep; of the latter some 10 GB
PACE = 0.1  # s between two calls of progress
ORDER = 14  # of the polynomials: a cell turns by a radian or so, and its terms fall as 1 / 14!
ROUNDING = 1e-13  # of the largest value: a polynomial that stays farther from the level than this does not touch it
TRIED = 4.0  # periods of the first of the spans, each twice the one before, in which a run's end is looked for
_until = by_python(until)  # to call it compiled takes longer than the sum does


def simulate(
    system: System | PlanarOscillator,
    *,
    duration: float | None = None,
    cycles: float | None = None,
    start: Mapping[str, float | str] | None = None,
    budget: int = 100_000,
    rtol: float = 1e-12,
    progress: Callable[[float], object] | None = None,
    stop: Mapping[str, float] | None = None,
) -> Trajectory:
    """How does the system move?

    Every mode is linear, so the motion between events is a closed form, and the first exit of each mode is found with
    a certificate that none was jumped over. A law with curved modes is followed by Taylor series, and by implicit steps
    where it is stiff, to a tolerance.

    Parameters
    ----------
    system : Oscillator, Structure or PlanarOscillator
        What moves.
    duration : float, optional
        Time to simulate [s]. Give this or `cycles`.
    cycles : float, optional
        Time in periods of the drive; without a periodic drive, in natural periods.
    start : mapping, optional
        State at time 0: "x" [m], "v" [m/s] (of a structure, and in a plane, "x1", "v1" ...), memory of the law by name,
        "mode". Where left out: displacement 0, at rest on the counter-face.
    budget : int
        Most events in one period; more is taken for chatter.
    rtol : float
        For curved laws: error of a step relative to the largest value each entry of the state has had.
    progress : callable, optional
        Called some ten times a second with the share of the time that is simulated, 0 to 1.
    stop : mapping of str to float, optional
        Outputs and levels: the run ends, "stopped", where the first of them crosses its level (``{"x": 1e-3}``).

    Returns
    -------
    Trajectory
        With `progress`, where the user interrupts (Ctrl-C), what was simulated until then, with the status
        "interrupted"; without, Ctrl-C ends whoever asked, so that no part is taken for the whole.

    Raises
    ------
    ModelError
        The time, the start or the budget has no meaning, or the drive was not recorded as long.
    SolveError
        More events than the budget, transitions that chase each other, or motion beyond the largest number; the
        message names the state.

    Examples
    --------
    >>> from stickslip.laws.coulomb import Coulomb
    >>> from stickslip.oscillator import Oscillator, PlanarOscillator
    >>> slider = Oscillator(mass=1, stiffness=4, law=Coulomb(1.0))
    >>> run = simulate(slider, duration=10, start={"x": 1.25})
    >>> [(round(event.time, 6), event.kind) for event in run.events]
    [(1.570796, 'reversal'), (3.141593, 'stick')]
    >>> run.status, run.state(10)["x"]
    ('at rest', 0.25)
    """
    if not budget >= 1:
        raise ModelError(f"budget = {budget}", "a period has room for at least one event", "raise budget=")
    if stop:
        whole = duration if duration is not None else (cycles or 1.0) * _scale(system)

        def march(time: float) -> Trajectory:
            return simulate(system, duration=time, start=start, budget=budget, rtol=rtol, progress=progress)

        return stopped(march, stop, whole, _scale(system))
    if isinstance(system, PlanarOscillator) or is_curved(system):
        return _simulate_curved(system, (duration, cycles), start or {}, budget, rtol, progress)
    table = table_of(system)
    span = _end(system, table, duration, cycles)
    state, mode = opening(table, start or {})
    return run(system, table, state, mode, span=span, budget=budget, tell=progress and paced(progress))


def _scale(system: System | PlanarOscillator) -> float:
    """The period of the drive, without one the natural period, without either a second [s]."""
    period = system.drive.motion().period
    return period if math.isfinite(period) else 1 / system.frequency if system.frequency else 1.0


def _simulate_curved(
    system: System | PlanarOscillator,
    time_: tuple[float | None, float | None],
    start: Mapping[str, float | str],
    budget: int,
    rtol: float,
    progress: Callable[[float], object] | None,
) -> Trajectory:
    table: Any
    follow: Callable[..., Trajectory]
    if isinstance(system, PlanarOscillator):
        table, follow = planar_tape(system), run_planar
    elif isinstance(system, Oscillator) and isinstance(system.law, TimeDelay):
        table, follow = delayed_tape(system, degree(rtol)), run_delayed
    else:
        table, follow = tape(system), run_curved
    span = _end(system, table, *time_)
    state, mode = opening(table, start)
    course = span, stops_of(table, *span)
    return follow(table, state, mode, course=course, budget=budget, rtol=rtol, tell=progress and paced(progress))


def paced(progress: Callable[[float], object]) -> Callable[[float], None]:
    """The same call, passed on once in a while and at the end."""
    due = time.monotonic() + PACE

    def tell(share: float) -> None:
        nonlocal due
        if share >= 1.0 or time.monotonic() >= due:
            progress(min(share, 1.0))
            due = time.monotonic() + PACE

    return tell


def _end(
    system: System | PlanarOscillator, table: Tables, duration: float | None, cycles: float | None
) -> tuple[float, float]:
    """The time to simulate, as full periods of the drive and a rest [s]."""
    if (duration is None) == (cycles is None):
        raise ModelError(f"duration = {duration}, cycles = {cycles}", "one of the two is given", "give one of them")
    given = duration if cycles is None else cycles
    assert given is not None
    if not (math.isfinite(given) and given > 0):
        raise ModelError(
            f"{'duration' if cycles is None else 'cycles'} = {given}", "the time is finite and positive", "give more"
        )
    period = table.motion.period
    if math.isfinite(period):
        count = given if cycles is not None else given / period
        laps = math.floor(count)
        return float(laps), (count - laps) * period if cycles is not None else max(0.0, given - laps * period)
    if cycles is None:
        return 0.0, given
    if system.frequency == 0:
        raise ModelError(f"cycles = {cycles}", "a system without period has no cycles", "give duration= [s]")
    return 0.0, given / system.frequency


def opening(table: Tables | Tape, start: Mapping[str, float | str]) -> tuple[Array, int]:
    """The state at time 0 and its mode, before any exit that is due at once."""
    state = np.zeros(len(table.names))
    state[table.names.index("1")] = 1.0
    for name, value in table.motion.start.items():
        state[table.names.index(name)] = value
    given: dict[str, Any] = dict(start)
    mode_name = given.pop("mode", None)
    for name in given:
        if name not in table.names[: table.physical]:
            raise ModelError(
                f"start has '{name}'", f"it may have {', '.join(table.names[: table.physical])} and mode", "correct it"
            )
        unit = "m" if name[0] == "x" else "m/s" if name[0] == "v" else "SI"
        given[name] = finite(name, given[name], unit=unit, signed=True)
    for j, name in enumerate(table.names[: table.physical]):
        state[j] = given.get(name, table.opening[j] @ state)
    if mode_name is not None:
        mode = table.index(mode_name)
        _require_fit(table, state, mode)
        return state, mode
    if len(set(table.entry)) == 1:
        return state, table.entry[1]
    return state, table.entry[int(np.sign(table.outputs["slip"] @ state)) + 1]


def _require_fit(table: Tables | Tape, state: Array, mode: int) -> None:
    """Refuse the rigid contact of one mass that starts held while it slides, or slides against its mode."""
    part = table.modes[mode]
    row = np.atleast_2d(table.outputs["slip"])[0] if getattr(table, "degrees", 1) == 1 else np.zeros(len(state))
    slip = float(row @ state)
    slides = part.friction is None or (len(set(table.entry)) > 1 and part.side * slip < 0)
    if abs(slip) > NOISE * (np.abs(row) @ np.abs(state)) and slides:
        raise ModelError(
            f"start has a slip of {slip:g} m/s in the mode '{part.name}'",
            "a contact that holds does not slip, and one that slips does so to the mode's side",
            "correct v or mode, or leave mode out",
        )


def run(
    system: System,
    table: Tables,
    state: Array,
    mode: int,
    *,
    span: tuple[float, float],
    budget: int = 10_000,
    tell: Callable[[float], None] | None = None,
) -> Trajectory:
    """March from a state at time 0 to the end of the time (laps, offset), in chunks.

    With somebody to tell how far it is, an interrupted run is returned as far as it came; without, it is a part of
    a greater question, which then ends as well.
    """
    laps, offset = span
    period = table.motion.period
    total = offset + (laps * period if math.isfinite(period) else 0.0)
    scale = period if math.isfinite(period) else 1 / system.frequency if system.frequency else total
    status = "complete"
    march = _March(table, state, mode, total, Budget(table, scale=scale, most=budget), tell)
    heed()
    try:
        with march.holding:
            march.through(stops_of(table, laps, offset))
    except KeyboardInterrupt:
        if tell is None or not march.pieces.count:
            raise
        status = "interrupted"
    pieces = march.pieces.done()
    if status == "interrupted":
        # what the march wrote since is lost: the signal comes before Python learns of it
        begun = pieces.laps[-1] * period if math.isfinite(period) else 0.0
        total = float(pieces.offsets[-1] + pieces.durations[-1] + begun)
    elif tell:
        tell(1.0)
    if status == "complete" and _at_rest(table, march.state, march.mode):
        status = "at rest"
    return Trajectory(system, table, *pieces, total, status)


class _March:
    """A run under way: where it is, the pieces that it keeps, and what it may still spend."""

    def __init__(
        self, table: Tables, state: Array, mode: int, total: float, events: Budget, tell: Callable[[float], None] | None
    ) -> None:
        size = len(table.names)
        self.table, self.total, self.events, self.tell, self.holding = table, total, events, tell, ExitStack()
        self.model = Model(table.linear, fast_tables(table), table.motion.period)
        self.past, self.work = blank_past(), kernel.scratch(size)
        self.clock, self.state, self.mode, self.stop = Clock(0.0, 0.0, 0.0), state.copy(), mode, 0
        tonal = len(table.tones) == 1 and size == table.physical + 3
        self.pieces = _Log(table.physical if tonal else size, CHUNK)
        self.patience = max(1, CELLS // max(1, size // SMALL) ** 2)
        self.heed: Callable[[], None] | None = None

    def through(self, stops: Stops) -> None:
        """March to the last stop."""
        self.state[stops.places] = stops.values[0]
        begin = meanwhile.now(kernel.begin)
        came, self.mode = self.mode, begin(self.model.linear, self.mode, self.state, self.total, 1.0, self.work)
        _refuse(kernel.CHATTER if self.mode < 0 else kernel.DONE, self.table, self.state, came, self.clock)
        while self._chunk(stops) == kernel.FULL:
            pass

    def _chunk(self, stops: Stops) -> int:
        """March until the room is full, patience ends, or the last stop is reached."""
        march = kernel.march if len(stops.ends) == 1 else kernel.course
        before, room, written = self.clock, self.pieces.room(), None
        if (now := meanwhile.now(march)) is not march:
            written = self._by_python(now, stops, room)
        outcome, count = self._compiled(march, stops, room) if written is None else written
        passed = _until(before, self.clock, self.table.motion.period)
        self.pieces.keep(count, passed, self.total)
        _refuse(outcome, self.table, self.state, self.mode, self.clock)
        if outcome == kernel.FULL and count < len(room.laps) and written is None:  # by its patience: cell by cell
            name = self.table.modes[self.mode].name
            _require_cells(passed / self.patience, self.total - self.pieces.passed, name)
        last = self.pieces.columns.exits[self.pieces.count - count : self.pieces.count]
        self.events.spend(last, passed=passed, state=self.state)
        if self.tell:
            self.tell(self.pieces.passed / self.total)
        return int(outcome)

    def _compiled(self, march: Any, stops: Stops, room: Pieces) -> tuple[int, int]:
        """Outcome and number of pieces of a chunk, whose room they fill."""
        march = meanwhile.awaited(march)
        # numba makes the Clock that it hands back by calling Python, and dies of a Ctrl-C that comes just
        # then; the first call may compile for long, and is left to it
        if self.heed is None and getattr(march, "overloads", True):
            self.heed = self.holding.enter_context(held_back())
        written = self._marched(march, stops, room, self.patience)
        if self.heed is not None:
            self.heed()
        return written

    def _by_python(self, march: Any, stops: Stops, room: Pieces) -> tuple[int, int] | None:
        """As :meth:`_compiled`, a few pieces; None, and nothing done, where one is too long for Python, or where Python
        refuses what compiled code makes infinite."""
        begun = self.clock, self.mode, self.stop
        state, past = self.state.copy(), [part.copy() for part in self.past]
        with suppress(ArithmeticError, ValueError):
            outcome, count = self._marched(march, stops, room.part(0, FEW), SHORT)
            at_stop = np.any(np.all(stops.ends[max(0, self.stop - 1) : self.stop + 1] == self.clock[:2], axis=1))
            if outcome != kernel.FULL or room.exits[count - 1] >= 0 or at_stop:  # else cut by its patience
                return outcome, count
        self.clock, self.mode, self.stop = begun
        for part, was in zip((self.state, *self.past), (state, *past), strict=True):
            part[:] = was
        return None

    def _marched(self, march: Any, stops: Stops, room: Pieces, patience: int) -> tuple[int, int]:
        """As :func:`stickslip.solve.kernel.course`; where there is one stop, without what leads from one to the next,
        which takes seconds to compile."""
        begun, rest = (self.model, self.clock, self.state, self.mode), (self.past, room, self.work, patience)
        if len(stops.ends) > 1:
            outcome, count, self.mode, self.clock, self.stop = march(*begun, stops, self.stop, *rest)
        else:
            laps, time = stops.ends[0].tolist()
            outcome, count, self.mode, self.clock = march(*begun, Clock(laps, time, 0.0), *rest)
        return outcome, count


def ahead() -> None:
    """Have the kernels compiled that a run of a linear law calls, and what is asked of it."""
    for drive in (HarmonicBase(2.0, 0.1), Recorded([0.0, 1.0, 0.0], 1.0, on="force", order=1)):
        run = simulate(Oscillator(1.0, 1.0, Coulomb(0.5), drive), duration=2.0)
        run.sample([0.0], ("x",))
        run.end()


class _Log:
    """Room for the pieces of a run; grows by what the run so far foretells."""

    def __init__(self, size: int, room: int) -> None:
        self.count, self.passed, self.least = 0, 0.0, room
        self.columns = blank_pieces((256,), size)

    def room(self) -> Pieces:
        """The part that is free, at most one chunk."""
        return self.columns.part(self.count, self.count + self.least)

    def keep(self, count: int, passed: float, total: float) -> None:
        """Take the pieces just written, and make room for those to come."""
        self.count += count
        self.passed += passed
        if self.count >= SURE and self.count * total > MOST_PIECES * self.passed:
            raise SolveError(
                f"{self.count * total / self.passed:.1e} pieces of motion in {total:g} s, by the first {self.count:g}",
                f"a run keeps each, and at most {MOST_PIECES:g}, some 10 GB",
                "simulate a shorter time; a sweep or a steady state keeps none",
            )
        if self.count < len(self.columns.laps):
            return
        foretold = self.count * min(64.0, 1.05 * total / self.passed) if self.passed > 0 else 0.0
        room = max(int(foretold), self.count + self.least)
        grown = blank_pieces((room,), self.columns.states.shape[1])
        for name in Pieces._fields:
            getattr(grown, name)[: self.count] = getattr(self.columns, name)[: self.count]
        self.columns = grown

    def done(self) -> Pieces:
        """The pieces alone."""
        return self.columns.part(0, self.count)


def stops_of(table: Tables | Tape, laps: float, offset: float) -> Stops:
    """The instants to which the march goes in turn: the knots of the drive, and the end."""
    knots, end = table.motion.knots, table.motion.end
    if offset > end * (1 + 1e-12):
        raise ModelError(
            f"{offset:g} s of a drive recorded for {end:g} s",
            "a run ends where its drive is known last",
            f"simulate {end:g} s at most, or record longer",
        )
    if knots is None:
        return Stops(np.array([[laps, offset]], dtype=float), np.array([], dtype=np.int64), np.zeros((1, 0)))
    places = [table.names.index(name) for name in table.motion.knotted]
    begun = knots[knots[:, 0] < offset]
    ends = np.append(begun[1:, 0], offset)
    return Stops(np.column_stack([np.zeros(len(ends)), ends]), np.array(places, dtype=np.int64), begun[:, 1:].copy())


def _at_rest(table: Tables, state: Array, mode: int) -> bool:
    return bool(np.all(table.flow[mode] @ state == 0.0))


def _chasing(table: Tables, mode: int, state: Array) -> list[str]:
    """The modes that follow one another at a state, by the exits that are due at once."""
    names = []
    for _ in range(2 * LISTED):
        names.append(table.modes[mode].name)
        for e in range(table.first[mode], table.first[mode + 1]):
            ahead, noise = table.series[e] @ state, NOISE * (np.abs(table.series[e]) @ np.abs(state))
            apart = ahead[np.abs(ahead) > noise]
            if not table.crossing[e] and len(apart) and apart[0] > 0:
                mode, state = int(table.target[e]), table.reset[e] @ state
                break
    return names[-LISTED:]


def _require_cells(cell: float, ahead: float, mode: str) -> None:
    """Refuse a run that has more than `MOST_CELLS` ahead, by the time of one and the time that is left [s]."""
    if ahead > MOST_CELLS * cell:
        raise SolveError(
            f"{ahead / cell:.2g} cells of {cell:.1e} s ahead, the last in the mode '{mode}'",
            f"a run takes at most {MOST_CELLS:g}, some hours; a rate of the contact is far above the motion's own",
            "simulate a shorter time, or leave out the damping or the mass that makes the contact so fast",
        )


def _refuse(outcome: int, table: Tables, state: Array, mode: int, clock: Clock) -> None:
    if outcome in (kernel.DONE, kernel.FULL) and math.isfinite(state.sum()):
        return
    place = f"lap {clock.laps:g}, {clock.time:g} s, at {named(table.names[: table.physical], state)}"
    require_numbers(state, place)
    if outcome in (kernel.CHATTER, kernel.LOST):
        raise chatter(_chasing(table, mode, state), place)
    if outcome == kernel.UNPROVED:
        raise unproved(place)


# ---- when a run crosses a level


def crossings(run: Trajectory, channel: str, *, level: float = 0.0, side: int = 0, contact: int = 0) -> Array:
    """When does an output cross a level?

    Parameters
    ----------
    run : Trajectory
        Any run.
    channel : str
        A name that :meth:`Trajectory.sample` knows: "x", "v", "friction", "slip", the law's memory ...
    level : float
        In the output's unit.
    side : int
        +1: where it rises, -1: where it falls, 0: both.
    contact : int
        Which row, of an output that has several: of a structure's displacement or contact, counted from 0.

    Returns
    -------
    ndarray
        Instants [s], increasing.

    Raises
    ------
    ModelError
        The side is none of the three, or the output has no such row.
    SolveError
        The system has no such output.

    Examples
    --------
    >>> from stickslip import Oscillator, laws, simulate
    >>> decay = simulate(Oscillator(mass=1, stiffness=4, law=laws.Coulomb(1.0)), duration=10, start={"x": 1.25})
    >>> crossings(decay, "x").round(6).tolist()  # x = 0.25 + cos 2 t falls, then rises on -0.25 + 0.5 ...
    [0.911738, 2.617994]
    """
    if side not in (-1, 0, 1) or not np.isfinite(level):
        raise ModelError(
            f"side = {side}, level = {level}", "side is -1, 0 or +1, the level a finite number", "correct it"
        )
    begins, widths = run.cells
    points = np.cos(np.pi * (np.arange(ORDER + 1) + 0.5) / (ORDER + 1))[::-1]
    times = begins[:, None] + widths[:, None] * (points + 1) / 2
    values, _ = run.sample(np.maximum.accumulate(np.minimum(times.ravel(), run.duration)), (channel,))
    if not 0 <= contact < len(values):
        raise ModelError(f"contact = {contact}", f"'{channel}' has {len(values)} rows, from 0", "correct it")
    series = np.polynomial.chebyshev.chebfit(points, values[contact].reshape(-1, ORDER + 1).T - level, ORDER)
    instants = [*_within(series, begins, widths, side), *_jumped(series, begins, side)]
    return np.unique(np.array(instants, dtype=np.float64))


def _within(series: Array, begins: Array, widths: Array, side: int) -> list[float]:
    """Instants at which a cell's polynomial crosses zero."""
    instants = []
    largest = np.abs(series).sum(axis=0)
    near = np.abs(series[0]) <= np.abs(series[1:]).sum(axis=0) + ROUNDING * np.max(largest, initial=0.0)
    for j in np.flatnonzero(near & (largest > 0)):
        own = np.trim_zeros(series[:, j], "b")
        roots = np.polynomial.chebyshev.chebroots(own) if len(own) > 1 else np.empty(0)
        real = np.sort(roots.real[(np.abs(roots.imag) < 1e-9) & (np.abs(roots.real) <= 1.0)])
        edges = np.concatenate([[-1.0], (real[1:] + real[:-1]) / 2, [1.0]])
        signs = np.sign(np.polynomial.chebyshev.chebval(edges, own))
        for root, before, after in zip(real, signs, signs[1:], strict=False):
            if before * after < 0 and side * after >= 0:
                instants.append(float(begins[j] + widths[j] * (root + 1) / 2))
    return instants


def _jumped(series: Array, begins: Array, side: int) -> list[float]:
    """Instants between two cells at which the output goes from one side of zero to the other at once."""
    signs = (-1.0) ** np.arange(len(series))
    ends, starts = series.sum(axis=0)[:-1], (signs @ series)[1:]
    floor = ROUNDING * np.max(np.abs(series).sum(axis=0), initial=0.0)
    over = (ends * starts < 0) & (np.minimum(np.abs(ends), np.abs(starts)) > floor) & (side * starts >= 0)
    return [float(instant) for instant in begins[1:][over]]


def stopped(march: Callable[[float], Trajectory], stop: Mapping[str, float], span: float, scale: float) -> Trajectory:
    """A run to where an output first crosses its level, or over the whole span [s]; `march` runs a time [s].

    The spans looked into grow, each twice the one before: what is marched in vain is as long as the run itself.
    """
    tried = min(span, TRIED * scale)
    while True:
        run = march(tried)
        instants = [crossings(run, name, level=level) for name, level in stop.items()]
        first = min((float(own[own > 0][0]) for own in instants if np.any(own > 0)), default=np.inf)
        if np.isfinite(first):
            return replace(march(first), status="stopped")
        if tried >= span or run.status != "complete":
            return run
        tried = min(span, 2 * tried)
