"""Named systems with known answers: for tests, documentation, the command line, and every other engine."""

from __future__ import annotations

import functools
import itertools
import math
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import resources
from typing import Any

import numpy as np

from stickslip import drives
from stickslip.drives.kinds import HarmonicForce, Ramp
from stickslip.errors import ModelError
from stickslip.laws.coulomb import Coulomb
from stickslip.laws.formula import Formula
from stickslip.laws.guessing import registered
from stickslip.oscillator import Contact, Oscillator, Structure
from stickslip.solve.assembly import table_of
from stickslip.solve.periodic import steady_state
from stickslip.solve.poincare import SteadyState
from stickslip.solve.self_excited import steady_sliding
from stickslip.solve.simulate import simulate
from stickslip.solve.tables import System
from stickslip.solve.trajectory import Trajectory

LAWS = registered()
DRIVES: dict[str, type[Any]] = {name: getattr(drives, name) for name in drives.__all__}


@dataclass(frozen=True)
class Scenario:
    """A system and what is known of its motion.

    Attributes
    ----------
    name : str
        Its name.
    about : str
        What it is and where it comes from.
    system : Oscillator or Structure
        What moves.
    start : mapping
        State at time 0, as ``simulate`` takes it.
    run : mapping
        ``duration=`` or ``cycles=`` of a run; empty where the steady state is asked.
    known : mapping
        Answers by name: numbers (SI), lists of numbers, or words.
    tolerance : float
        Relative agreement that the reference supports.
    """

    name: str
    about: str
    system: System
    start: Mapping[str, float]
    run: Mapping[str, float]
    known: Mapping[str, Any]
    tolerance: float


def names() -> tuple[str, ...]:
    """Which scenarios are there?

    Returns
    -------
    tuple of str

    Examples
    --------
    >>> "FD-4" in names()
    True
    """
    return tuple(name for name, entry in _table().items() if "system" in entry)


def get(name: str) -> Scenario:
    """One scenario.

    Parameters
    ----------
    name : str
        One of :func:`names`.

    Returns
    -------
    Scenario

    Raises
    ------
    ModelError
        No scenario has that name.

    Examples
    --------
    >>> get("FD-4").system.law
    Coulomb(kinetic=1.0, static=None)
    """
    if name not in names():
        raise ModelError(f"no scenario is called '{name}'", f"there are {', '.join(names())}", "choose one")
    entry = _table()[name]
    start, run, tolerance = entry.get("start", {}), entry.get("run", {}), entry.get("tolerance", 1e-10)
    return Scenario(name, entry["about"], _system(entry), start, run, entry["known"], tolerance)


def answers(scenario: Scenario, *, run: Trajectory | None = None) -> dict[str, Any]:
    """What does the engine say to the questions whose answers are known?

    Parameters
    ----------
    scenario : Scenario
        One of them.
    run : Trajectory, optional
        The scenario's own run, where it is at hand.

    Returns
    -------
    dict
        As `known`, from the engine.

    Examples
    --------
    >>> answers(get("FD-4"))["half_cycles"]
    2
    """

    def answer(question: str) -> Any:
        if question in OF_SLIDING:
            return OF_SLIDING[question](sliding())
        return OF_RUNS[question](motion()) if scenario.run else OF_ORBITS[question](orbit())

    @functools.cache
    def motion() -> Trajectory:
        return run or simulate(scenario.system, start=scenario.start, **scenario.run)  # type: ignore[arg-type]

    @functools.cache
    def orbit() -> SteadyState:
        return steady_state(scenario.system, start=scenario.start)

    @functools.cache
    def sliding() -> complex:
        return _fastest_growing(scenario.system)

    return {question: answer(question) for question in scenario.known}


def grid(name: str) -> dict[str, Any]:
    """A table of known answers over two parameters.

    Parameters
    ----------
    name : str
        "HL-1" (stops per cycle over frequency ratio and friction) or "DH-2" (the non-stop boundary).

    Returns
    -------
    dict
        Lists of numbers by name.

    Raises
    ------
    ModelError
        No grid has that name.

    Examples
    --------
    >>> len(grid("HL-1")["ratios"]), len(grid("HL-1")["loads"])
    (18, 11)
    """
    grids = {key: entry for key, entry in _table().items() if "system" not in entry}
    if name not in grids:
        raise ModelError(f"no grid is called '{name}'", f"there are {', '.join(grids)}", "choose one")
    return dict(grids[name])


def forced(ratio: float, load: float, *, damping_ratio: float = 0.0, static_ratio: float = 1.0) -> Oscillator:
    """The oscillator of the classical literature: unit mass, stiffness and force.

    Parameters
    ----------
    ratio : float
        b, driving over natural frequency.
    load : float
        r, friction over the force's amplitude.
    damping_ratio : float
        Viscous damping ratio.
    static_ratio : float
        Static over kinetic friction.

    Returns
    -------
    Oscillator

    Examples
    --------
    >>> forced(0.8, 0.5).law.kinetic
    0.5
    """
    law = Coulomb(load, None if static_ratio == 1 else static_ratio * load)
    drive = HarmonicForce(1.0, ratio / (2 * math.pi))
    return Oscillator(mass=1, stiffness=1, law=law, drive=drive, damping=2 * damping_ratio)


def _system(entry: Mapping[str, Any]) -> System:
    """The oscillator or structure of plain data in SI."""
    drive = _named(DRIVES, entry.get("drive", {"name": "Release"}))
    if "contacts" not in entry:
        return Oscillator(**entry["system"], law=_named(LAWS, entry["law"]), drive=drive)
    contacts = [Contact(**{**contact, "law": _named(LAWS, contact["law"])}) for contact in entry["contacts"]]
    return Structure(**entry["system"], contacts=contacts, drive=drive)


def _named(register: Mapping[str, Callable[..., Any]], values: Mapping[str, Any]) -> Any:
    """The law or drive that plain data name, with what it holds."""
    given = dict(values)
    make = register[given.pop("name")]
    for part, known in (("law", LAWS), ("drive", DRIVES)):
        if isinstance(given.get(part), Mapping):
            given[part] = _named(known, given[part])
    if "curve" in given:
        given["curve"] = Formula(given["curve"])
    return make(**given)


@functools.cache
def _table() -> dict[str, Any]:
    text = resources.files("stickslip").joinpath("data/scenarios.toml").read_text("utf-8")
    return tomllib.loads(text)


def _lengths(motion: Trajectory, kinds: tuple[str, ...]) -> list[float]:
    """Durations of the pieces between two events, by kind of mode."""
    modes = motion.table.modes
    return [float(d) for d, m in zip(motion.durations[1:-1], motion.modes[1:-1], strict=True) if modes[m].kind in kinds]


def _around(orbit: SteadyState, kinds: tuple[str, ...]) -> list[float]:
    """Durations around the orbit: the piece that the start of the period cuts is put together."""
    motion, modes = orbit.orbit, orbit.orbit.table.modes
    if motion.modes[0] != motion.modes[-1] or len(motion.modes) == 1:
        return _lengths(motion, kinds) + [
            float(motion.durations[j]) for j in {0, len(motion.modes) - 1} if modes[motion.modes[j]].kind in kinds
        ]
    whole = [float(motion.durations[0] + motion.durations[-1])] if modes[motion.modes[0]].kind in kinds else []
    return _lengths(motion, kinds) + whole


def _fastest_growing(system: System) -> complex:
    """Of steady sliding on a belt, the eigenvalue with the largest real part [1/s]."""
    if isinstance(system, Oscillator):
        return complex(steady_sliding(system).eigenvalues[0])
    table = table_of(system)
    sides = ["forward" if np.sign(contact.carried) < 0 else "back" for contact in system.contacts]
    flow = table.flow[table.index(" + ".join(sides))][: table.physical, : table.physical]
    values = np.linalg.eigvals(flow)
    return complex(values[np.argmax(values.real)])


def _last_of(motion: Trajectory, kind: str) -> float:
    """Duration of the last whole stretch of a kind."""
    return _lengths(motion, (kind,))[-1]


def _last_turns(motion: Trajectory) -> list[float]:
    """Instants in the last cycle at which the velocity turns."""
    return [event.time for event in motion.events if event.time > motion.duration - motion.table.motion.period]


def _mean(motion: Trajectory, *factors: str) -> float:
    """Mean of a product of outputs over the last cycle, by Gauss's rule from event to event."""
    period = motion.table.motion.period
    begin = motion.duration - period
    cuts = np.unique(np.concatenate([motion.starts, np.linspace(begin, motion.duration, 9)]).clip(begin))
    nodes, weights = np.polynomial.legendre.leggauss(40)
    total = 0.0
    for low, high in itertools.pairwise(cuts):
        values, _ = motion.sample(low + (high - low) * (nodes + 1) / 2, factors)
        total += float(weights @ np.prod(values, axis=0)) * (high - low) / 2
    return total / period


def _rises(motion: Trajectory, level: float) -> list[float]:
    """Instants at which the velocity rises through a level [m/s]."""
    times = np.linspace(0, motion.duration, 20_001)
    above = motion.sample(times, ("v",))[0][0] >= level
    ends = []
    for j in np.flatnonzero(~above[:-1] & above[1:]):
        low, high = times[j], times[j + 1]
        for _ in range(60):
            middle = (low + high) / 2
            low, high = (low, middle) if motion.state(middle)["v"] >= level else (middle, high)
        ends.append(float(high))
    return ends


def _pull(motion: Trajectory) -> float:
    """The rate at which a ramp pulls its spring [N/s]."""
    assert isinstance(motion.system, Oscillator)
    assert isinstance(motion.system.drive, Ramp)
    return motion.system.stiffness * motion.system.drive.speed


OF_ORBITS: dict[str, Callable[[SteadyState], Any]] = {
    "status": lambda orbit: orbit.status,
    "amplitude": lambda orbit: orbit.amplitude,
    "v_max": lambda orbit: orbit.largest("v"),
    "a_max": lambda orbit: orbit.largest("a"),
    "period": lambda orbit: orbit.period,
    "stops": lambda orbit: list(orbit.stops),
    "transition_speed": lambda orbit: orbit.transition_speed,
    "multiplier": lambda orbit: float(abs(orbit.multipliers[0])),
    "multiplier_product": lambda orbit: float(np.prod(orbit.multipliers).real),
    "slips": lambda orbit: _around(orbit, ("slip",)),
    "sticks": lambda orbit: _around(orbit, ("stick", "microstick")),
}
OF_RUNS: dict[str, Callable[[Trajectory], Any]] = {
    "half_cycles": lambda motion: len(motion.events),
    "rest": lambda motion: motion.state(motion.duration)["x"],
    "changes": lambda motion: len(motion.modes) - 1,
    "end": lambda motion: motion.sample([motion.duration], ("x",))[0][:, 0].tolist(),
    "stop_time": lambda motion: motion.events[-1].time,
    "extrema": lambda motion: [float(state[0]) for state in motion.states],
    "slip_time": lambda motion: _last_of(motion, "slip"),
    "stick_time": lambda motion: _last_of(motion, "stick"),
    "last_amplitude": lambda motion: max(abs(motion.state(time)["x"]) for time in _last_turns(motion)),
    "turns": lambda motion: len(_last_turns(motion)),
    "last_friction": lambda motion: motion.state(motion.duration)["friction"],
    "mean_friction": lambda motion: _mean(motion, "friction"),
    "loop_energy": lambda motion: _mean(motion, "friction", "slip") * motion.table.motion.period,
    "rises": lambda motion: _rises(motion, 0.05),
    "break_away": lambda motion: _pull(motion) * _rises(motion, 1e-3)[0],
    "stuck_positions": lambda motion: [p.state["x"] for p in motion.pieces if p.mode == "stuck"],
}
OF_SLIDING: dict[str, Callable[[complex], Any]] = {
    "growth": lambda value: value.real / abs(value),
    "flutter_frequency": lambda value: abs(value.imag) / (2 * math.pi),
}
