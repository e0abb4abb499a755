"""Maps: one system over a grid of its parameters, every motion of it run and measured."""

from __future__ import annotations

import math
import os
import shutil
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from datetime import timedelta
from pathlib import Path
from threading import Timer
from typing import TYPE_CHECKING, Any

import numpy as np

from stickslip.errors import ModelError, SolveError
from stickslip.laws.stribeck import TimeDelay
from stickslip.maps.engines import read_engine
from stickslip.maps.grid import Grid, apart, read_grid
from stickslip.maps.measures import EVENTS, FAILED, NO_SYSTEM, REPEATS, Measure, Variable, read_measures, variables
from stickslip.maps.plan import BLOCK, Arrays, Keep, Plan, assemble, blank, chunked, required
from stickslip.maps.store import Store
from stickslip.oscillator import Oscillator, Structure
from stickslip.solve.poincare import BATCHES, recurring, tables
from stickslip.solve.refusal import Endless
from stickslip.solve.simulate import opening, simulate
from stickslip.solve.tables import System, laws_of

if TYPE_CHECKING:
    from rich.console import Console

PATIENCE = 2.0  # s of silence before anything is shown
WIDTH = 30  # characters of a notebook's bar


@contextmanager
def reported(keep: Keep, done: int, count: int) -> Iterator[Keep]:
    """`keep`, which also moves a bar of `count` blocks on, with the time left."""
    from rich.console import Console

    console = Console(stderr=True)
    if not (console.is_terminal or console.is_jupyter):
        yield keep
        return
    with _in_notebook(done, count) if console.is_jupyter else _on_terminal(console, done, count) as advance:

        def kept(number: int, arrays: Arrays, events: Arrays | None) -> None:
            keep(number, arrays, events)
            advance()

        yield kept


@contextmanager
def _on_terminal(console: Console, done: int, count: int) -> Iterator[Callable[[], object]]:
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("blocks"),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
    )
    bar = Progress(*columns, console=console, transient=True)
    task = bar.add_task("mapping", total=count, completed=done)
    patience = Timer(PATIENCE, bar.start)
    patience.daemon = True
    patience.start()
    try:
        yield lambda: bar.advance(task)
    finally:
        patience.cancel()
        bar.stop()


@contextmanager
def _in_notebook(done: int, count: int) -> Iterator[Callable[[], object]]:
    """One line of text under the cell that is written anew after each block, and cleared at the end."""
    from IPython.display import display

    begun, before, line = time.monotonic(), done, None

    def show(text: str) -> Any:
        data = {"text/plain": text}
        return display(data, raw=True, display_id=True) if line is None else line.update(data, raw=True)

    def advance() -> None:
        nonlocal done, line
        done, passed = done + 1, time.monotonic() - begun
        if passed >= PATIENCE:
            text = progress_line(done, count, passed=passed, left=passed * (count - done) / (done - before))
            line = show(text) or line

    try:
        yield advance
    finally:
        if line is not None:
            show("")


def progress_line(done: int, count: int, *, passed: float, left: float) -> str:
    """A bar of characters, the blocks done, and the time passed and left [s]."""
    full = WIDTH * done // count
    since, until = (str(timedelta(seconds=round(seconds))) for seconds in (passed, left))
    return f"mapping {'━' * full}{'─' * (WIDTH - full)} {done}/{count} blocks {since} left {until}"


def sweep(
    system: System,
    grid: Grid,
    *,
    measures: Sequence[Measure] = ("stops", "amplitude"),
    cycles: int = 50,
    settle: int = 200,
    start: Mapping[str, float | str] | None = None,
    engine: str = "threads",
    store: str | Path | None = None,
) -> Any:
    """How does the motion change with the parameters of the system?

    Every motion is the exact one of :func:`simulate`; each is followed through `settle` periods that are not measured
    and `cycles` that are. The grid is cut into blocks, which the engine runs wherever it runs them, with one answer.

    Parameters
    ----------
    system : Oscillator or Structure
        What moves.
    grid : mapping or sequence of mapping
        Values by parameter, each a dimension of the map: ``{"frequency": [...], "kinetic": [...]}``. A parameter is
        named as :meth:`Oscillator.having` does ("kinetic", "law.stiffness"), with numbers, arrays or whole laws as
        values ("law"); "start.x" is of the start. Parameters that change together stand in a tuple:
        ``{("mass", "stiffness"): [(1, 4), (2, 8)]}``. A list of mappings is a list of points.
    measures : sequence of str or callable
        What is asked of each motion: "stops", "amplitude" [m], "stick_share", "micro_slips", "transition_speed"
        [m/s], "energy" [J], "period", "multipliers", "lyapunov" [1/s], "events" (their number, and with a store
        each of them in Parquet files beside it), or a function of a Trajectory.
    cycles : int
        Periods of the drive that are measured; without a periodic drive, natural periods (of the exponent under
        several tones, periods of the slowest).
    settle : int
        Periods before that.
    start : mapping, optional
        State at time 0, as :func:`simulate` takes it.
    engine : str
        Where the blocks are run: "threads" (the processors of this machine), "serial" (one of them), "cuda" (an NVIDIA
        GPU), "dask" (the cores of this machine), "dask://host:port" (the workers of the
        scheduler there).
    store : path, optional
        A Zarr group where each finished block is kept, so that a sweep that was ended, or killed, goes on there when
        it is called again; ``xarray.open_zarr`` reads it.

    Returns
    -------
    xarray.Dataset
        One variable for each answer over the dimensions of the grid, and ``status``; settings, version and checksum
        in its attributes. Where the user interrupts (Ctrl-C), what was done until then, with the status "interrupted".

    Raises
    ------
    ModelError
        The grid is empty, names a parameter that the system does not have, or has no point that is a system; a
        measure or an engine is unknown; the map fits neither memory nor disk; the store holds something else; no
        scheduler answers; there is no GPU.
    SolveError
        The store can not be written or another process writes there; the law changes its mode for ever while no
        time passes; a Lyapunov exponent is asked of what nothing drives.

    Examples
    --------
    >>> from stickslip import Oscillator
    >>> from stickslip.drives import HarmonicForce
    >>> from stickslip.laws import Coulomb
    >>> drive = HarmonicForce(1.0, frequency=0.8 / 6.283185307)
    >>> slider = Oscillator(mass=1, stiffness=1, law=Coulomb(0.5), drive=drive)
    >>> atlas = sweep(slider, {"kinetic": [0.5, 0.9]}, measures=["stops", "amplitude"], settle=40, cycles=10)
    >>> atlas.normal_stops.values, atlas.amplitude.values.round(6)
    (array([0., 2.]), array([2.332235, 0.068345]))
    """
    required("xarray")
    run, address = read_engine(engine)
    plan = planned(system, grid, measures=measures, cycles=cycles, settle=settle, start=start)
    begun = store is not None and Path(store).exists()
    if store is None:
        require_memory(plan.size, plan.variables)
    elif not begun:
        require_disk(plan.size, plan.variables, store)
    with nullcontext(Memory(plan)) if store is None else Store(store, plan) as kept:
        before, status = len(kept.missing), "complete"
        if store is not None and begun:
            require_disk(before * math.prod(plan.chunks), plan.variables, store)
        try:
            with reported(sensible(kept.keep, plan), len(plan.blocks) - before, len(plan.blocks)) as keep:
                run(plan, kept.missing, keep, address)
        except KeyboardInterrupt:
            if len(kept.missing) == before:
                raise
            done = len(plan.blocks) - len(kept.missing)
            status = f"interrupted: {done} of {len(plan.blocks)} blocks are there"
        return explained(kept.dataset(status), plan)


def explained(atlas: Any, plan: Plan) -> Any:
    """A map whose status has, as `refused`, why the first point that is no system is none."""
    refused = np.argwhere(atlas["status"].values == NO_SYSTEM)
    try:
        if len(refused):
            plan.at(tuple(refused[0]))
    except ModelError as error:
        atlas["status"].attrs["refused"] = f"{error.value}; {error.rule}"
    return atlas


def planned(
    system: System,
    grid: Grid,
    *,
    measures: Sequence[Measure],
    cycles: int,
    settle: int,
    start: Mapping[str, float | str] | None,
) -> Plan:
    """The plan of a sweep, with everything checked that can be before it is run."""
    for name, count, least in (("cycles", cycles, 1), ("settle", settle, 0)):
        if not (isinstance(count, int | np.integer) and count >= least):
            raise ModelError(
                f"{name} = {count}", f"{name} is a whole number of periods, at least {least}", "correct it"
            )
    asked_for = read_measures(measures)
    axes = apart(system, read_grid(system, grid), variables(asked_for))
    chunks = chunked([len(axis.values) for axis in axes])
    plan = Plan(system, axes, asked_for, int(cycles), int(settle), dict(start or {}), chunks)
    named = {measure for measure in plan.measures if isinstance(measure, str)}
    system, begun = first_of(plan)
    laws_of(system)  # a mass in a plane has none of the measures
    if begun and not (isinstance(system, Oscillator) and isinstance(system.law, TimeDelay)):
        opening(tables(system), begun)
    if "lyapunov" in named:
        recurring(system)
        if cycles < BATCHES:
            raise ModelError(f"cycles = {cycles}", f"a Lyapunov exponent needs {BATCHES} at least", "raise cycles=")
    if named & REPEATS and cycles < 2:
        raise ModelError(f"cycles = {cycles}", "an orbit repeats within 2 measured periods at least", "raise cycles=")
    if named & EVENTS and isinstance(system, Structure) and len(system.contacts) != 1:
        raise ModelError(
            f"{', '.join(sorted(named & EVENTS))} of {len(system.contacts)} contacts",
            "these measures are of systems with one contact",
            "measure with a function of the Trajectory",
        )
    return plan


class NoSystem(ModelError):
    """No point of a grid is a system."""


def first_of(plan: Plan) -> tuple[System, dict[str, float | str]]:
    """The first system of the grid, of points spread over all of it, and its start.

    Raises
    ------
    NoSystem
        There is none.
    """
    refused = None
    for number in np.unique(np.linspace(0, plan.size - 1, min(plan.size, BLOCK)).astype(np.int64)):
        try:
            return plan.at(np.unravel_index(number, plan.shape))
        except ModelError as error:
            refused = refused or error
    names = ", ".join(name for axis in plan.axes for name in axis.names)
    assert refused is not None
    raise NoSystem(f"no point of the grid is a system: {refused.value}", refused.rule, f"correct the grid of {names}")


def sensible(keep: Keep, plan: Plan) -> Keep:
    """`keep`, which refuses a law whose modes change for ever without time: the first motion that failed tells."""
    is_asked = False

    def kept(number: int, arrays: Arrays, events: Arrays | None) -> None:
        nonlocal is_asked
        failed = np.flatnonzero(arrays["status"] == FAILED)
        if len(failed) and not is_asked:
            is_asked = True
            require_end(plan, plan.points(number)[failed[0]])
        keep(number, arrays, events)

    return kept


def require_end(plan: Plan, steps: tuple[int, ...]) -> None:
    """Refuse a point where modes follow one another without end."""
    system, start = plan.at(steps)
    try:
        simulate(system, cycles=plan.settle + plan.cycles, start=start)
    except Endless as endless:
        value, rule, step = endless.args
        pairs = list(zip(plan.axes, steps, strict=True))
        place = ", ".join(f"{name} = {axis.values[j][k]}" for axis, j in pairs for k, name in enumerate(axis.names))
        raise SolveError(f"{value}, with {place}", rule, step) from endless
    except SolveError:
        return  # a motion that grows without bound or chatters in time has its place on a map


def require_memory(points: int, kept: Mapping[str, Variable]) -> None:
    """Refuse a map that this machine's memory does not hold."""
    _require(points, kept, "memory", _memory())


def require_disk(points: int, kept: Mapping[str, Variable], store: str | Path) -> None:
    """Refuse points that the disk of a store does not hold."""
    place = Path(store).absolute()
    while not place.exists():
        place = place.parent
    _require(points, kept, "disk", float(shutil.disk_usage(place).free))


def _require(points: int, kept: Mapping[str, Variable], where: str, room: float) -> None:
    need = points * sum(np.dtype(variable.dtype).itemsize for variable in kept.values())
    if need > room:
        raise ModelError(
            f"{points} points take {need / 1e9:.3g} GB, and the {where} has {room / 1e9:.3g} GB",
            "a map fits where it is kept",
            "ask for fewer points or measures",
        )


def _memory() -> float:
    """Memory of this machine [bytes]; infinite where it does not tell."""
    try:
        return float(os.sysconf("SC_PAGE_SIZE")) * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):
        return math.inf


class Memory:
    """What is done of a sweep, in memory."""

    def __init__(self, plan: Plan) -> None:
        self.plan, self.arrays, self.done = plan, blank(plan), set[int]()

    @property
    def missing(self) -> list[int]:
        """Blocks still to be run."""
        return [number for number in self.plan.blocks if number not in self.done]

    def keep(self, number: int, arrays: Arrays, events: Arrays | None = None) -> None:
        """Take a block."""
        for name, values in arrays.items():
            self.arrays[name][self.plan.slices(number)] = values
        self.done.add(number)

    def dataset(self, status: str = "complete") -> Any:
        """The labelled map as far as it is known."""
        return assemble(self.plan, self.arrays, status=status)
