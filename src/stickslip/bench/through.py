"""The whole experiment of the thesis on a simulated bench: commissioned, measured, analysed, and told in one report."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from stickslip.answers.decays import analyze_decay
from stickslip.answers.findings import Comparison, Findings
from stickslip.answers.fits import fit_records
from stickslip.answers.many import compare
from stickslip.answers.questions import analyze
from stickslip.answers.squeaks import analyze_squeaks, compare_squeaks
from stickslip.bench.recording import Wanted, acquire
from stickslip.bench.runs import Proposal, Run, next_runs, run_list
from stickslip.bench.sim import Sim
from stickslip.bench.simulated import SimulatedBench, thesis_oscillator
from stickslip.bench.steps import STEPS, Commissioned, commission
from stickslip.drives.kinds import HarmonicBase, Release
from stickslip.estimate import Estimate, Result
from stickslip.files.read import read_record
from stickslip.files.write import write_record
from stickslip.law.verdict import LawComparison
from stickslip.record.log import Log
from stickslip.record.record import Record
from stickslip.rig.rig import Rig
from stickslip.rig.settings import RigSettings, read_rig
from stickslip.rig.shaker import Shaker
from stickslip.solve.simulate import simulate
from stickslip.squeak.sound import HEAVY, squeak_record, squeak_rig

FS = 2000.0  # Hz of the tour's records: the thesis's 4 kHz tell no more of it
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
    (folder / "rig.toml").write_text(done.known.toml(), encoding="utf-8")
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
