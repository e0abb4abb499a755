"""The whole experiment of the thesis, and the simulated bench on which it is done and told in one report."""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from stickslip.answers.decays import analyze_decay
from stickslip.answers.findings import Comparison, Findings
from stickslip.answers.fits import fit_records
from stickslip.answers.many import compare
from stickslip.answers.questions import analyze
from stickslip.answers.squeaks import analyze_squeaks, compare_squeaks
from stickslip.arrays import Array
from stickslip.bench.recording import Wanted, acquire
from stickslip.bench.runs import Proposal, Run, next_runs, run_list
from stickslip.bench.sim import Sim
from stickslip.bench.steps import STEPS, BenchStep, Commissioned, commission
from stickslip.drives.kinds import HarmonicBase, Recorded, Release
from stickslip.errors import EstimateError, ModelError
from stickslip.estimate import Estimate, Result
from stickslip.files.read import read_record
from stickslip.files.write import write_record
from stickslip.law.verdict import LawComparison
from stickslip.laws.compliant import CompliantContact
from stickslip.laws.coulomb import Coulomb
from stickslip.oscillator import Oscillator
from stickslip.record.metadata import Log
from stickslip.record.record import Record
from stickslip.rig.rig import Rig, Shaker
from stickslip.rig.sensor import Sensor
from stickslip.rig.settings import CommissionSettings, RigSettings, read_rig
from stickslip.solve.simulate import simulate
from stickslip.squeak.sound import squeak_record
from stickslip.squeak.stability import HEAVY, squeak_rig

FS = 4000.0  # Hz of the tour's records, as the thesis's: 2 kHz tell a third of the sticks for motion
SETTLE, SECONDS = 3.0, 8.0  # s that a run is left to itself, and that are read behind them
OF_LAWS = 1.5  # s of each run to which laws are fitted
OF = (0, 2)  # runs to which laws are fitted: one that sticks, one that slides
LAWS = ("Coulomb", "static", "compliant")
SURFACES = ("dry", "wet")
# Frequency [Hz] and amplitude [m] of the base. The thesis fits another friction level to each run; with 1.1 N for all
# its 0.6 mm at 5.61 Hz would stick for a quarter of the time, 0.7 mm slides.
RUNS = (
    Run(name="2.5Hz", frequency=2.5, amplitude=0.65e-3, why="stick-slip, section 4.2"),
    Run(name="5.61Hz", frequency=5.61, amplitude=0.7e-3, why="sliding, section 3.5"),
    Run(name="8.7Hz", frequency=8.7, amplitude=1.1e-3, why="sliding, section 3.5"),
    Run(name="11.1Hz", frequency=11.1, amplitude=2.0e-3, why="sliding, section 3.5"),
)
NOTED = {
    "surface": "steel on steel, ground and rubbed with 400-grit silicon-carbide paper", "lubrication": "dry",
    "cleaning": "degreaser CSM-1", "run_in": 9000, "temperature": "23 °C", "humidity": "45 %",
    "operator": "simulated bench",
}  # fmt: skip

Tell = Callable[[str, float], None]
HAND = 0.3  # s in which a hand changes a level
TREMOR = 20e-6  # m by which the mass still swings after a weight was hung on
SEATED = 2e-6  # m, standard deviation of how a gauge block sits
TRUE_TO = 2e-4  # standard deviation of a weight, as a part of it
HELD = 5.0  # N, of the discharge test
SWEEP = (60.0, 1.5, 20.0, 0.2e-3)  # s, from and to Hz, m
PRESSED = 5.0  # times the friction, for the tap: the contact is pressed so that it does not slip
TAPPED = 1e-3  # s that the hammer touches


@dataclass(frozen=True, repr=False)
class Tour(Result):
    """The experiment, as a lab would hand it in.

    Attributes
    ----------
    commissioned : Commissioned
        The rig.
    runs : tuple of Run
        What was driven.
    comparison : Comparison
        The driven records side by side.
    decay : Findings
        The free decay over friction.
    squeaks : Comparison
        The squeak rig, dry and wet.
    laws : LawComparison
        Which law it is.
    proposals : tuple of Proposal
        What to measure next.
    truth : mapping of str to float
        True values behind it.
    folder : Path
        Where records, ``rig.toml`` and ``next.toml`` lie.
    """

    commissioned: Commissioned
    runs: tuple[Run, ...]
    comparison: Comparison
    decay: Findings
    squeaks: Comparison
    laws: LawComparison
    proposals: tuple[Proposal, ...]
    truth: Mapping[str, float]
    folder: Path

    @property
    def estimates(self) -> tuple[Estimate, ...]:
        """The rig's constants, and what the runs tell together."""
        constants = self.commissioned.known.constants
        return (*(constants.estimates if constants else ()), *self.comparison.estimates, *self.laws.estimates)


def hidden_rig(seed: int = 1) -> Rig:
    """The air track's sensors with gains and zeros that nobody knows yet: drawn by `seed`."""
    chance, rig = np.random.default_rng([seed, 2026]), Rig()
    for channel, zero in (("x", 2e-5), ("z", 2e-5), ("a", 0.03), ("load", 0.01)):
        rig = rig.having(channel, gain=float(chance.normal(1, 0.015)), offset=float(chance.normal(0, zero)))
    return rig


def tour(folder: str | Path, *, seed: int = 1, fast: bool = False, progress: Tell | None = None) -> Tour:
    """The thesis's experiment from a bare rig to the law, on a simulated bench whose truth is known.

    Commissions the bench (chapter 2), records the base at 2.5, 5.61, 8.7 and 11.1 Hz (chapters 3 and 4) and a free
    decay over the contact (chapter 6) with :func:`~stickslip.bench.acquire` from a virtual rig that streams, reads them
    with the ``rig.toml`` that came of commissioning, analyses them, compares friction laws, adds the squeak rig dry and
    wet (chapter 7), and proposes what to measure next.

    Parameters
    ----------
    folder : path
        For the records, ``rig.toml`` and ``next.toml``; it is made.
    seed : int
        Draws the sensors' gains and zeros, and their noise.
    fast : bool
        Whether the virtual rig runs as fast as it is read; else it takes the time that a rig would.
    progress : callable, optional
        Called with words and the share that is done.

    Returns
    -------
    Tour

    Raises
    ------
    FormatError
        The folder can not be written.
    """
    folder, tell = Path(folder), progress or (lambda stage, share: None)
    records = folder / "records"
    records.mkdir(parents=True, exist_ok=True)
    bench = SimulatedBench(thesis_oscillator(), hidden_rig(seed), FS, seed)
    noted = RigSettings(log=Log.of(NOTED))
    tell("commissioning", 0.0)
    done = commission(
        bench.step,
        rig=noted,
        steps=STEPS,
        truth=bench.truth,
        progress=lambda stage, n: tell(f"commissioning: {stage}", 0.02 * n),
    )
    done.known.write(folder / "rig.toml")
    rig = read_rig(folder / "rig.toml")
    driven = []
    for number, run in enumerate(RUNS):
        tell(f"recording {run.name}", 0.25 + 0.05 * number)
        driven.append(_recorded(bench, run, records / f"{run.name}.h5", rig, fast=fast))
    tell("a free decay", 0.45)
    decay = _decayed(bench, records / "decay.h5", rig, fast=fast)
    tell("analysing", 0.5)
    comparison = compare([analyze(record, rig=rig) for record in driven])
    tell("which law is it?", 0.6)
    laws = _laws(driven, rig)
    tell("squeaks, dry and wet", 0.75)
    squeaks = compare_squeaks([_squeaks(surface, records, seed) for surface in SURFACES])
    tell("what to measure next", 0.9)
    proposals = _next(laws, rig)
    if proposals:
        (folder / "next.toml").write_text(run_list(proposals).toml(), encoding="utf-8")
    return Tour(done, RUNS, comparison, decay, squeaks, laws, proposals, bench.truth, folder)


def _recorded(bench: SimulatedBench, run: Run, path: Path, rig: RigSettings, *, fast: bool) -> Record:
    """One run from the virtual rig, read as any record is."""
    moved = replace(bench.system, drive=HarmonicBase(run.amplitude, frequency=run.frequency))
    _acquired(Sim(system=moved, rig=bench.rig, fs=bench.fs, fast=fast, seed=bench.seed), path, SETTLE + SECONDS, rig)
    record = read_record(path, channels=rig.channels)
    return rig.logged(record.between(SETTLE, SETTLE + SECONDS))


def _decayed(bench: SimulatedBench, path: Path, rig: RigSettings, *, fast: bool) -> Findings:
    """The mass let go, and stopped by its contact: chapter 6."""
    free = replace(bench.system, drive=Release())
    device = Sim(system=free, start={"x": 8e-3}, rig=bench.rig, fs=bench.fs, fast=fast, seed=bench.seed)
    _acquired(device, path, 4.0, rig)
    channels = {name: column for name, column in rig.channels.items() if name != "z"}  # the base is held
    record = rig.logged(read_record(path, channels=channels))
    return analyze_decay(record, channel="x", mass=rig.mass, stiffness=rig.stiffness)


def _acquired(device: Sim, path: Path, seconds: float, rig: RigSettings) -> None:
    path.unlink(missing_ok=True)
    acquire(device, output=path, wanted=Wanted(seconds=seconds, log=rig.log))


def _laws(driven: Sequence[Record], rig: RigSettings) -> LawComparison:
    """Which law, by a part of the sticking run and of one that slides."""
    parts = [record.between(SETTLE, SETTLE + OF_LAWS) for record in [driven[k] for k in OF]]
    comparison, _ = fit_records(parts, rig=rig, laws=LAWS)
    assert isinstance(comparison, LawComparison)
    return comparison


def _next(laws: LawComparison, rig: RigSettings) -> tuple[Proposal, ...]:
    """What would tell the two best laws apart that differ in family."""
    best = laws.candidates[0]
    other = next((candidate for candidate in laws.candidates[1:] if candidate.name != best.name), None)
    if other is None:
        return ()
    left = {candidate.name: replace(candidate.oscillator, drive=Release()) for candidate in (best, other)}
    known = [(run.frequency, run.amplitude) for run in RUNS]
    return next_runs(left, shaker=Shaker.of(rig.shaker), done=known)


def _squeaks(surface: str, records: Path, seed: int) -> Findings:
    """The squeak rig under its heavy load."""
    run = simulate(squeak_rig(surface, load=HEAVY), duration=1.2)
    record = squeak_record(run, snr=30, rng=seed).with_log({"surface": "rubber on steel", "lubrication": surface})
    write_record(record, records / f"squeak-{surface}.h5", overwrite=True)
    return analyze_squeaks(record, name=f"squeak rig, {surface}", normal=HEAVY)


# ---- the simulated bench


def thesis_oscillator() -> Oscillator:
    """The air track of chapters 2 to 4: 2.42 kg on 2310 N/m, damping ratio 0.0008, a contact of 192 kN/m."""
    contact = CompliantContact(1.1, stiffness=192000, damping=23.9)
    return Oscillator(mass=2.42, stiffness=2310, damping=2 * 0.0008 * math.sqrt(2310 * 2.42), law=contact)


@dataclass(frozen=True)
class SimulatedBench:
    """A rig on the bench, with weights, gauge blocks, a hammer and a shaker at hand.

    Attributes
    ----------
    system : Oscillator
        Mass, spring, damper and contact.
    rig : Rig
        Its sensors; gains and zeros are what calibration is to find.
    fs : float
        Sampling rate [Hz].
    seed : int
        Where chance comes from.
    hand : CommissionSettings
        Weights, gauge blocks and the mass that can be put on.

    Raises
    ------
    ModelError
        A system of several masses.

    Examples
    --------
    >>> bench = SimulatedBench()
    >>> sorted(bench.record("discharge"))
    ['a', 'load', 'x', 'z']
    """

    system: Oscillator = field(default_factory=thesis_oscillator)
    rig: Rig = field(default_factory=Rig)
    fs: float = 4000.0
    seed: int = 1
    hand: CommissionSettings = field(default_factory=CommissionSettings)

    def __post_init__(self) -> None:
        if not isinstance(self.system, Oscillator):
            raise ModelError(
                f"a {type(self.system).__name__} on the bench",
                "one mass is commissioned at a time",
                "give an Oscillator",
            )

    def record(self, step: str, channel: str = "") -> Record:
        """What a step of commissioning records; see :data:`stickslip.bench.STEPS`.

        Parameters
        ----------
        step : str
            Name of the step.
        channel : str
            The sensor that is calibrated, where the step is about one.

        Returns
        -------
        Record

        Raises
        ------
        ModelError
            No such step.
        """
        made: dict[str, Callable[[], Record]] = {
            "rest": lambda: self._read({}, 10.0),
            "gauge": lambda: self._levels(channel or "x", self._placed(self.hand.gauges, seated=SEATED, at=channel)),
            "turn": lambda: self._levels("a", self.hand.turns),
            "weigh": lambda: self._levels("friction", self._placed(self.hand.weights, part=TRUE_TO)),
            "spring": self._spring,
            "free": lambda: self._released(self._loose, 8e-3, 20.0),
            "added": lambda: self._released(self._loaded, 8e-3, 20.0),
            "tap": self._tap,
            "stick": self._onto_stick,
            "discharge": lambda: self._read({"friction": lambda t: HELD * _hand(t - 10.0)}, 60.0),
            "sweep": self._sweep,
        }
        if step not in made:
            raise ModelError(f"no step '{step}'", f"the simulated bench has {', '.join(made)}", "choose one of them")
        return made[step]()

    def step(self, step: BenchStep) -> Record:
        """The record of a step, as :func:`commission` asks for it."""
        return self.record(step.arrangement, step.name.partition("-")[2])

    @property
    def truth(self) -> dict[str, float]:
        """True values, by the names that the steps give their estimates; "STEP: NAME" where a step's own differs."""
        system, law = self.system, self.system.law
        w = math.sqrt(system.stiffness / system.mass)
        truth = {
            "mass": system.mass, "spring stiffness": system.stiffness, "damping of the suspension": system.damping,
            "viscous damping": system.damping, "natural frequency": w / math.tau,
            "damping ratio": system.damping / (2 * w * system.mass), "dry friction displacement": 0.0,
        }  # fmt: skip
        truth["damping ratio by decrement"] = truth["damping ratio"]
        loaded = w * math.sqrt(system.mass / self._loaded.mass)
        truth |= {"added: natural frequency": loaded / math.tau}
        truth |= {"added: damping ratio": system.damping / (2 * loaded * self._loaded.mass)}
        truth["added: damping ratio by decrement"] = truth["added: damping ratio"]
        if isinstance(law, CompliantContact):
            stiff, damping = system.stiffness + law.stiffness, system.damping + law.damping
            truth["coupled frequency"] = math.sqrt(stiff / system.mass) / math.tau
            truth["contact stiffness"] = law.stiffness
            truth["kinetic friction"] = law.kinetic
            truth["damping ratio of the coupled mode"] = damping / (2 * math.sqrt(stiff * system.mass))
            truth["frequency of the coupled contact"] = truth["coupled frequency"]
            truth["damping ratio of the coupled contact"] = truth["damping ratio of the coupled mode"]
        sensors = {sensor.channel: sensor for sensor in self.rig.sensors}
        for name, sensor in sensors.items():
            truth |= _truth_of(name, sensor)
        if {"x", "a"} <= sensors.keys():
            late = sensors["x"].lag - sensors["a"].lag
            truth |= {"lead of a over x": late, "phase by which a leads x": w * late}
            truth["added: phase by which a leads x"] = loaded * late
        if {"x", "z"} <= sensors.keys():
            truth["delay of the displacement behind the input"] = sensors["x"].lag - sensors["z"].lag
            truth["gain of the displacement over that of the base"] = 1.0  # once both are calibrated
        return truth

    @property
    def _contact(self) -> CompliantContact:
        """The contact, which has to give way for a tap and a stick to ring on it."""
        if not isinstance(self.system.law, CompliantContact):
            raise EstimateError(
                f"a contact by {type(self.system.law).__name__}",
                "the simulated bench taps, and lets stick, a contact that gives way",
                "give the system a CompliantContact",
            )
        return self.system.law

    @functools.cached_property
    def _loose(self) -> Oscillator:
        """The mass without its contact."""
        return replace(self.system, law=Coulomb(0.0), drive=Release())

    @functools.cached_property
    def _loaded(self) -> Oscillator:
        """With the added mass."""
        added = Estimate.stated("mass", self.hand.added, "kg")
        return replace(self._loose, mass=self.system.mass + added.value + added.sd * self._chance("added").normal())

    def _placed(
        self, levels: Sequence[float], *, seated: float = 0.0, part: float = 0.0, at: str = ""
    ) -> Sequence[float]:
        """Levels as they are really reached: blocks that do not sit, weights that are not what is written on them."""
        chance = self._chance(f"placed {at}{levels}")  # a weight is the same one each time; a block sits anew
        draw = chance.standard_normal
        return [level * (1 + part * draw()) + bool(level) * seated * draw() for level in levels]

    def _chance(self, name: str) -> np.random.Generator:
        return np.random.default_rng([self.seed, *name.encode()])

    def _read(self, signals: dict[str, Callable[[Array], Array]], duration: float) -> Record:
        rng = self._chance("/".join(signals) + f"{duration}")
        return self.rig.read(signals, duration=duration, fs=self.fs, rng=rng)

    def _levels(self, source: str, levels: Sequence[float], hold: float = 2.0) -> Record:
        return self._read({source: functools.partial(_levels, levels, hold)}, hold * len(levels))

    def _spring(self) -> Record:
        """The spring under weights, the mass still swinging a little after each."""
        system, hold = self.system, 2.0
        w = math.sqrt(system.stiffness / system.mass)
        places = [weight / system.stiffness for weight in self._placed(self.hand.weights, part=TRUE_TO)]

        def x(time: Array) -> Array:
            return _levels(places, hold, time) + TREMOR * np.cos(w * np.mod(time, hold)) * np.exp(-np.mod(time, hold))

        return self._read({"x": x}, hold * len(places))

    def _measured(self, run: Any, name: str) -> Record:
        return self.rig.measure(run, fs=self.fs, rng=self._chance(name))

    def _released(self, system: Oscillator, start: float, duration: float) -> Record:
        return self._measured(simulate(system, duration=duration, start={"x": start}), f"free {system.mass}")

    def _onto_stick(self) -> Record:
        """Let go so far out that it turns twice and sticks."""
        law = self._contact
        return self._measured(
            simulate(
                replace(self.system, drive=Release()),
                duration=2.0,
                start={"x": 4.6 * law.kinetic / self.system.stiffness},
            ),
            "stick",
        )

    def _tap(self) -> Record:
        """A hammer's half sine on the mass, the contact pressed so that it holds: half of what would make it slip."""
        law = self._contact
        pressed = replace(law, kinetic=PRESSED * law.kinetic)
        stiff = self.system.stiffness + law.stiffness
        speed = 0.5 * PRESSED * law.kinetic / math.sqrt(stiff * self.system.mass)
        rows = np.arange(2000)
        pulse = np.sin(np.pi * (rows / 4e3 - 0.1) / TAPPED) * ((rows >= 400) & (rows < 400 + 4e3 * TAPPED))
        force = self.system.mass * speed * math.pi / 2 / TAPPED * pulse
        tapped = replace(self.system, law=pressed, drive=Recorded(force, 4e3, on="force"))
        return self._measured(simulate(tapped, duration=0.49), "tap")

    def _sweep(self) -> Record:
        """The base swept from 1.5 to 20 Hz in a minute, 0.2 mm, the contact off."""
        fs = 400.0
        swept = replace(self._loose, drive=Recorded(sweep_of(fs), fs, on="base"))
        return self._measured(simulate(swept, duration=SWEEP[0] - 0.1), "sweep")


def sweep_of(fs: float) -> Array:
    """The base's motion [m] in the step "sweep", at a rate [Hz]: it begins and ends at rest.

    Examples
    --------
    >>> round(1e6 * float(np.abs(sweep_of(200.0)).max()))
    200
    """
    duration, low, high, amplitude = SWEEP
    time = np.arange(round(duration * fs) + 1) / fs
    phase = 2 * np.pi * (low * time + (high - low) * time**2 / (2 * duration))
    return np.asarray(amplitude * np.sin(phase) * _hand(time) * _hand(duration - time))


def _hand(time: Array) -> Array:
    """From 0 at time 0 to 1, as a hand does it."""
    share = np.clip(time / HAND, 0.0, 1.0)
    return np.asarray(share**3 * (10 - 15 * share + 6 * share**2))


def _levels(levels: Sequence[float], hold: float, time: Array) -> Array:
    """One level after another, each held so long [s]."""
    total = np.full(np.shape(time), float(levels[0]))
    for number, (before, after) in enumerate(itertools.pairwise(levels), start=1):
        total += (after - before) * _hand(time - number * hold)
    return total


def _truth_of(name: str, sensor: Sensor) -> dict[str, float]:
    """What is true of one sensor."""
    noise = math.hypot(sensor.noise.white, sensor.noise.band)
    truth = {f"gain of {name}": sensor.gain, f"noise of {name}": noise, f"zero of {name}": sensor.digitiser.offset}
    truth[f"drift of {name}"] = 0.0
    mount = {"a": "accelerometer", "load": "load cell"}.get(name)
    if mount and sensor.mount:
        truth[f"frequency of the mount of the {mount}"] = sensor.mount.frequency
        truth[f"damping ratio of the mount of the {mount}"] = sensor.mount.damping
    if name == "load":
        truth["discharge time constant"] = sensor.discharge
        truth["mass before the load cell"] = sensor.mount.mass if sensor.mount else 0.0
    return truth
