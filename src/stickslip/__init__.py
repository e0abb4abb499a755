"""stickslip: dry friction in oscillators, from a rig's record to its friction law, and back.

The public names; each is imported when it is first used, so that ``import stickslip`` stays light. They stand here
twice: for type-checkers and editors, and for that import.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from stickslip import datasets as datasets
    from stickslip.analysis.questions import analyze as analyze
    from stickslip.analysis.comparison import Comparison as Comparison, compare as compare
    from stickslip.config import RigSettings as RigSettings, read_rig as read_rig, rig_settings as rig_settings
    from stickslip.analysis.decay_comparison import DecayComparison as DecayComparison, compare_decays as compare_decays
    from stickslip.analysis.decays import DecayFindings as DecayFindings, analyze_decay as analyze_decay
    from stickslip.errors import (
        EstimateError as EstimateError,
        FormatError as FormatError,
        ModelError as ModelError,
        RecordError as RecordError,
        SolveError as SolveError,
        StickslipError as StickslipError,
    )
    from stickslip.estimate import Estimate as Estimate
    from stickslip.printing import printable as printable
    from stickslip.analysis.fits import fit_records as fit_records
    from stickslip.analysis.experiment import ExperimentPlan as ExperimentPlan, plan_experiment as plan_experiment
    from stickslip.files.read import read_blocks as read_blocks, read_record as read_record
    from stickslip.files.write import write_record as write_record
    from stickslip.analysis.findings import Findings as Findings
    from stickslip.decay.answer import DecayFit as DecayFit
    from stickslip.curves.fit_curve import CurveFit as CurveFit, fit_curve as fit_curve
    from stickslip.fit.law import LawFit as LawFit, fit_law as fit_law
    from stickslip.curves.load import LoadLine as LoadLine, friction_over_load as friction_over_load
    from stickslip.curves.memory import FrictionMemory as FrictionMemory, friction_memory as friction_memory
    from stickslip.decay.fit_decay import fit_decay as fit_decay
    from stickslip.fit.which_law import LawComparison as LawComparison, compare_laws as compare_laws
    from stickslip.decay.which_motion import DecayMotion as DecayMotion, choose_motion as choose_motion
    from stickslip.identify.decrement import Bounds as Bounds, Decrement as Decrement, decrement as decrement
    from stickslip.identify.envelope import (
        EnvelopeDecay as EnvelopeDecay,
        extreme_decay as extreme_decay,
        hilbert_decay as hilbert_decay,
        linear_decrement as linear_decrement,
        log_decrement as log_decrement,
    )
    from stickslip.identify.cause import Cause as Cause, lag_or_compliance as lag_or_compliance
    from stickslip.identify.compare_force import (
        ForceBand as ForceBand,
        ForceComparison as ForceComparison,
        compare_force as compare_force,
    )
    from stickslip.identify.checks import Check as Check
    from stickslip.identify.consistency import Consistency as Consistency, consistency as consistency
    from stickslip.identify.impact import ImpactTest as ImpactTest, impact_test as impact_test
    from stickslip.identify.mounts import Resonance as Resonance
    from stickslip.plot.experiment import plot_plan as plot_plan
    from stickslip.plot.consistency import plot_consistency as plot_consistency
    from stickslip.plot.contact import plot_transition_speed as plot_transition_speed
    from stickslip.plot.force import plot_force_comparison as plot_force_comparison
    from stickslip.identify.breakaway import Breakaway as Breakaway, breakaway as breakaway
    from stickslip.identify.contact import (
        contact_damping as contact_damping,
        contact_stiffness as contact_stiffness,
    )
    from stickslip.identify.force import friction_force as friction_force
    from stickslip.identify.loops import friction_loops as friction_loops
    from stickslip.identify.presliding import Presliding as Presliding, presliding as presliding
    from stickslip.identify.parts import (
        Stretch as Stretch,
        join_sticks as join_sticks,
        overlapping as overlapping,
    )
    from stickslip.identify.pull import Pull as Pull, pulled_slider as pulled_slider
    from stickslip.identify.regression import regress_friction as regress_friction
    from stickslip.identify.release import (
        Releases as Releases,
        RingDown as RingDown,
        find_releases as find_releases,
    )
    from stickslip.identify.sensor_delay import SensorDelay as SensorDelay, sensor_delay as sensor_delay
    from stickslip.identify.sticks import (
        StickEvent as StickEvent,
        Sticks as Sticks,
        find_sticks as find_sticks,
    )
    from stickslip.analysis.long_records import analyze_blocks as analyze_blocks
    from stickslip.analysis.mending import mend as mend
    from stickslip.plot.figures import figures as figures
    from stickslip.record.channels import Channel as Channel
    from stickslip.record.check import Fault as Fault
    from stickslip.record.exchange import (
        from_pandas as from_pandas,
        from_sep005 as from_sep005,
        from_xarray as from_xarray,
    )
    from stickslip.record.record import Record as Record, Step as Step
    from stickslip.regimes.attractor import Attractor as Attractor
    from stickslip.regimes.basins import Basins as Basins, basins as basins
    from stickslip.regimes.bifurcation import (
        Bifurcation as Bifurcation,
        Change as Change,
        bifurcation as bifurcation,
    )
    from stickslip.regimes.boundary import Boundary as Boundary, boundary as boundary
    from stickslip.regimes.dither import (
        Dither as Dither,
        dither as dither,
        dithered_friction as dithered_friction,
    )
    from stickslip.plot.bifurcation import (
        plot_basins as plot_basins,
        plot_bifurcation as plot_bifurcation,
        plot_boundary as plot_boundary,
        plot_dither as plot_dither,
    )
    from stickslip.reports.fit import (
        fit_numbers as fit_numbers,
        fit_summary as fit_summary,
        publish_fit as publish_fit,
    )
    from stickslip.reports.folder import publish as publish
    from stickslip.reports.page import report as report
    from stickslip.reports.rig import publish_rig as publish_rig
    from stickslip.reports.summary import summary as summary
    from stickslip.signals.delay import without_delays as without_delays
    from stickslip.signals.differentiate import differentiate as differentiate, smooth as smooth
    from stickslip.signals.repair import (
        fill_gaps as fill_gaps,
        fill_missing as fill_missing,
        remove_drift as remove_drift,
        remove_spikes as remove_spikes,
        repair_clock as repair_clock,
        resample as resample,
        restore_clipped as restore_clipped,
    )
    from stickslip.signals.stft import stft_map as stft_map
    from stickslip.signals.synchronise import (
        clock_offset as clock_offset,
        clock_rate as clock_rate,
        synchronise as synchronise,
    )
    from stickslip.signals.wavelet import (
        cone_of_influence as cone_of_influence,
        dyadic_map as dyadic_map,
        inverse_wavelet as inverse_wavelet,
        wavelet_blocks as wavelet_blocks,
        wavelet_map as wavelet_map,
        wavelet_overview as wavelet_overview,
    )
    from stickslip.signals.ridges import (
        LocalMaximum as LocalMaximum,
        Ridge as Ridge,
        Spike as Spike,
        find_ridges as find_ridges,
        find_spikes as find_spikes,
        local_maxima as local_maxima,
    )
    from stickslip.identify.mechanism import Mechanism as Mechanism, mechanism as mechanism
    from stickslip.identify.microslip import find_microslips as find_microslips
    from stickslip.identify.slip_ringing import SlipRinging as SlipRinging, slip_ringing as slip_ringing
    from stickslip.identify.transition import Transition as Transition, transition as transition
    from stickslip.identify.transition_speed import (
        TransitionSpeed as TransitionSpeed,
        coupled_frequency as coupled_frequency,
        transition_speed as transition_speed,
    )
    from stickslip.analysis.time_frequency import TimeFrequency as TimeFrequency, time_frequency as time_frequency
    from stickslip.plot.limit_cycle import plot_limit_cycles as plot_limit_cycles, plot_stability as plot_stability
    from stickslip.plot.wavelet import plot_wavelet as plot_wavelet
    from stickslip.drives import (
        Belt as Belt,
        Dithered as Dithered,
        HarmonicBase as HarmonicBase,
        HarmonicForce as HarmonicForce,
        MultiTone as MultiTone,
        Ramp as Ramp,
        RecordedBase as RecordedBase,
        Release as Release,
        SpeedProfile as SpeedProfile,
    )
    from stickslip.laws.compliant import CompliantContact as CompliantContact
    from stickslip.laws.coulomb import Coulomb as Coulomb
    from stickslip.laws.export import export_law as export_law
    from stickslip.laws.elastoslip import ElastoSlip as ElastoSlip
    from stickslip.laws.inertial import InertialContact as InertialContact
    from stickslip.laws.linear_slope import LinearSlope as LinearSlope
    from stickslip.laws.position_load import PositionLoad as PositionLoad
    from stickslip.laws.rough import RoughSurface as RoughSurface
    from stickslip.laws.series import InSeries as InSeries
    from stickslip.laws.state_variable import StateVariable as StateVariable
    from stickslip.laws.tabulated import Tabulated as Tabulated
    from stickslip.laws.time_delay import TimeDelay as TimeDelay
    from stickslip.oscillator import Oscillator as Oscillator
    from stickslip.plot.animation import animate as animate
    from stickslip.rig.rig import Rig as Rig
    from stickslip.rig.sensor import (
        Digitiser as Digitiser,
        Mount as Mount,
        Noise as Noise,
        Sensor as Sensor,
    )
    from stickslip.reports.maps import map_numbers as map_numbers, publish_map as publish_map
    from stickslip.reports.simulation import (
        Outcome as Outcome,
        outcome as outcome,
        publish_run as publish_run,
        require_output as require_output,
    )
    from stickslip import scenarios as scenarios
    from stickslip.solve.continuation import Branch as Branch, continue_orbit as continue_orbit
    from stickslip.solve.energy import EnergyFlow as EnergyFlow, energy as energy, energy_flow as energy_flow
    from stickslip.solve.lyapunov import lyapunov as lyapunov
    from stickslip.solve.orbit import SteadyState as SteadyState
    from stickslip.solve.periodic import attractors as attractors, steady_state as steady_state
    from stickslip.solve.simulate import simulate as simulate
    from stickslip.solve.trajectory import Trajectory as Trajectory
    from stickslip.squeak.bursts import Squeak as Squeak, Squeaks as Squeaks, find_squeaks as find_squeaks
    from stickslip.squeak.spectra import BurstSpectra as BurstSpectra, burst_spectra as burst_spectra
    from stickslip.squeak.quality import (
        Impulsiveness as Impulsiveness,
        SoundQuality as SoundQuality,
        impulsiveness as impulsiveness,
        sound_quality as sound_quality,
    )
    from stickslip.squeak.listening import Clip as Clip, burst_clips as burst_clips, write_sound as write_sound
    from stickslip.analysis.squeaks import SqueakFindings as SqueakFindings, analyze_squeaks as analyze_squeaks
    from stickslip.analysis.squeak_comparison import (
        Condition as Condition,
        SqueakComparison as SqueakComparison,
        compare_squeaks as compare_squeaks,
    )
    from stickslip.squeak.coupling import Coupling as Coupling, Pair as Pair, coupling as coupling
    from stickslip.squeak.sound import sound_pressure as sound_pressure, squeak_record as squeak_record
    from stickslip.squeak.stability import (
        SlidingMode as SlidingMode,
        Stability as Stability,
        stability as stability,
    )
    from stickslip.squeak.threshold import (
        Threshold as Threshold,
        critical_value as critical_value,
        stability_map as stability_map,
    )
    from stickslip.squeak.bifurcation import CycleBranches as CycleBranches, limit_cycles as limit_cycles
    from stickslip.squeak.limit_cycle import LimitCycle as LimitCycle, limit_cycle as limit_cycle
    from stickslip.squeak.virtual_rig import squeak_rig as squeak_rig
    from stickslip.sweeps.grid_file import SweepFile as SweepFile, read_sweep as read_sweep
    from stickslip.sweeps.design import design as design, sensitivity as sensitivity
    from stickslip.sweeps.refine import refine as refine
    from stickslip.sweeps.sweep import sweep as sweep
    from stickslip.plot.maps import plot_map as plot_map
    from stickslip.structure import Contact as Contact, Structure as Structure
    from stickslip.system_export import export_system as export_system
    from stickslip.system_file import Case as Case, read_system as read_system, scenario_case as scenario_case
    from stickslip.laws.dahl import Dahl as Dahl
    from stickslip.laws.lugre import LuGre as LuGre
    from stickslip.laws.rate_state import RateState as RateState
    from stickslip.laws.smooth_state import SmoothStateVariable as SmoothStateVariable
    from stickslip.laws.stribeck import FrictionCurve as FrictionCurve, Stribeck as Stribeck
    from stickslip.solve.sliding import SteadySliding as SteadySliding, steady_sliding as steady_sliding

_ROOMS = {
    "StickslipError": "errors", "RecordError": "errors", "FormatError": "errors",
    "EstimateError": "errors", "ModelError": "errors", "SolveError": "errors",
    "Estimate": "estimate", "printable": "printing",
    "Record": "record.record", "Channel": "record.channels", "Step": "record.record", "Fault": "record.check",
    "from_pandas": "record.exchange", "from_xarray": "record.exchange", "from_sep005": "record.exchange",
    "read_record": "files.read", "read_blocks": "files.read", "write_record": "files.write",
    "repair_clock": "signals.repair", "fill_gaps": "signals.repair", "fill_missing": "signals.repair",
    "restore_clipped": "signals.repair", "remove_drift": "signals.repair", "resample": "signals.repair",
    "remove_spikes": "signals.repair", "without_delays": "signals.delay",
    "synchronise": "signals.synchronise", "clock_offset": "signals.synchronise", "clock_rate": "signals.synchronise",
    "differentiate": "signals.differentiate", "smooth": "signals.differentiate",
    "wavelet_map": "signals.wavelet", "wavelet_blocks": "signals.wavelet", "wavelet_overview": "signals.wavelet",
    "dyadic_map": "signals.wavelet", "stft_map": "signals.stft", "cone_of_influence": "signals.wavelet",
    "find_ridges": "signals.ridges", "local_maxima": "signals.ridges", "find_spikes": "signals.ridges",
    "Ridge": "signals.ridges", "LocalMaximum": "signals.ridges", "Spike": "signals.ridges",
    "slip_ringing": "identify.slip_ringing", "SlipRinging": "identify.slip_ringing",
    "transition": "identify.transition", "Transition": "identify.transition",
    "find_microslips": "identify.microslip", "mechanism": "identify.mechanism", "Mechanism": "identify.mechanism",
    "time_frequency": "analysis.time_frequency", "TimeFrequency": "analysis.time_frequency",
    "inverse_wavelet": "signals.wavelet", "plot_wavelet": "plot.wavelet",
    "compare_force": "identify.compare_force", "ForceComparison": "identify.compare_force",
    "ForceBand": "identify.compare_force", "Resonance": "identify.mounts",
    "consistency": "identify.consistency", "Consistency": "identify.consistency", "Check": "identify.checks",
    "impact_test": "identify.impact", "ImpactTest": "identify.impact",
    "plot_consistency": "plot.consistency", "plot_force_comparison": "plot.force",
    "contact_stiffness": "identify.contact", "contact_damping": "identify.contact",
    "transition_speed": "identify.transition_speed", "TransitionSpeed": "identify.transition_speed",
    "coupled_frequency": "identify.transition_speed", "plot_transition_speed": "plot.contact",
    "breakaway": "identify.breakaway", "Breakaway": "identify.breakaway",
    "presliding": "identify.presliding", "Presliding": "identify.presliding",
    "pulled_slider": "identify.pull", "Pull": "identify.pull",
    "friction_force": "identify.force", "friction_loops": "identify.loops", "find_sticks": "identify.sticks",
    "lag_or_compliance": "identify.cause", "Cause": "identify.cause",
    "StickEvent": "identify.sticks", "Sticks": "identify.sticks", "Stretch": "identify.parts",
    "overlapping": "identify.parts", "join_sticks": "identify.parts",
    "regress_friction": "identify.regression",
    "sensor_delay": "identify.sensor_delay", "SensorDelay": "identify.sensor_delay",
    "decrement": "identify.decrement", "Decrement": "identify.decrement", "Bounds": "identify.decrement",
    "find_releases": "identify.release", "Releases": "identify.release", "RingDown": "identify.release",
    "fit_decay": "decay.fit_decay", "DecayFit": "decay.answer",
    "fit_curve": "curves.fit_curve", "CurveFit": "curves.fit_curve",
    "friction_over_load": "curves.load", "LoadLine": "curves.load",
    "friction_memory": "curves.memory", "FrictionMemory": "curves.memory",
    "fit_law": "fit.law", "LawFit": "fit.law",
    "fit_records": "analysis.fits",
    "publish_fit": "reports.fit", "fit_summary": "reports.fit", "fit_numbers": "reports.fit",
    "compare_laws": "fit.which_law", "LawComparison": "fit.which_law",
    "choose_motion": "decay.which_motion", "DecayMotion": "decay.which_motion",
    "log_decrement": "identify.envelope", "linear_decrement": "identify.envelope",
    "extreme_decay": "identify.envelope", "hilbert_decay": "identify.envelope", "EnvelopeDecay": "identify.envelope",
    "plan_experiment": "analysis.experiment", "ExperimentPlan": "analysis.experiment",
    "plot_plan": "plot.experiment", "publish_rig": "reports.rig",
    "analyze_decay": "analysis.decays", "DecayFindings": "analysis.decays",
    "compare_decays": "analysis.decay_comparison", "DecayComparison": "analysis.decay_comparison",
    "read_rig": "config", "rig_settings": "config", "RigSettings": "config",
    "analyze": "analysis.questions", "analyze_blocks": "analysis.long_records",
    "compare": "analysis.comparison", "Comparison": "analysis.comparison",
    "Findings": "analysis.findings", "mend": "analysis.mending",
    "Coulomb": "laws.coulomb", "CompliantContact": "laws.compliant", "LinearSlope": "laws.linear_slope",
    "Tabulated": "laws.tabulated", "StateVariable": "laws.state_variable", "InertialContact": "laws.inertial",
    "ElastoSlip": "laws.elastoslip", "PositionLoad": "laws.position_load", "RoughSurface": "laws.rough",
    "InSeries": "laws.series", "TimeDelay": "laws.time_delay",
    "Stribeck": "laws.stribeck", "FrictionCurve": "laws.stribeck", "Dahl": "laws.dahl", "LuGre": "laws.lugre",
    "RateState": "laws.rate_state", "SmoothStateVariable": "laws.smooth_state",
    "refine": "sweeps.refine", "design": "sweeps.design", "sensitivity": "sweeps.design",
    "sweep": "sweeps.sweep", "SweepFile": "sweeps.grid_file", "read_sweep": "sweeps.grid_file", "plot_map": "plot.maps",
    "publish_map": "reports.maps", "map_numbers": "reports.maps",
    "squeak_rig": "squeak.virtual_rig", "sound_pressure": "squeak.sound", "squeak_record": "squeak.sound",
    "find_squeaks": "squeak.bursts", "Squeaks": "squeak.bursts", "Squeak": "squeak.bursts",
    "sound_quality": "squeak.quality", "SoundQuality": "squeak.quality",
    "impulsiveness": "squeak.quality", "Impulsiveness": "squeak.quality",
    "burst_spectra": "squeak.spectra", "BurstSpectra": "squeak.spectra",
    "burst_clips": "squeak.listening", "Clip": "squeak.listening", "write_sound": "squeak.listening",
    "analyze_squeaks": "analysis.squeaks", "SqueakFindings": "analysis.squeaks",
    "compare_squeaks": "analysis.squeak_comparison", "SqueakComparison": "analysis.squeak_comparison",
    "Condition": "analysis.squeak_comparison",
    "coupling": "squeak.coupling", "Coupling": "squeak.coupling", "Pair": "squeak.coupling",
    "stability": "squeak.stability", "Stability": "squeak.stability", "SlidingMode": "squeak.stability",
    "critical_value": "squeak.threshold", "Threshold": "squeak.threshold", "stability_map": "squeak.threshold",
    "limit_cycle": "squeak.limit_cycle", "LimitCycle": "squeak.limit_cycle",
    "limit_cycles": "squeak.bifurcation", "CycleBranches": "squeak.bifurcation",
    "plot_limit_cycles": "plot.limit_cycle", "plot_stability": "plot.limit_cycle",
    "energy_flow": "solve.energy", "EnergyFlow": "solve.energy",
    "export_law": "laws.export",
    "steady_sliding": "solve.sliding", "SteadySliding": "solve.sliding",
    "Release": "drives", "HarmonicBase": "drives", "HarmonicForce": "drives", "MultiTone": "drives",
    "Belt": "drives", "Ramp": "drives", "RecordedBase": "drives", "Dithered": "drives",
    "SpeedProfile": "drives",
    "Oscillator": "oscillator", "Structure": "structure", "Contact": "structure",
    "simulate": "solve.simulate", "Trajectory": "solve.trajectory",
    "steady_state": "solve.periodic", "SteadyState": "solve.orbit", "lyapunov": "solve.lyapunov",
    "energy": "solve.energy", "attractors": "solve.periodic",
    "continue_orbit": "solve.continuation", "Branch": "solve.continuation",
    "bifurcation": "regimes.bifurcation", "Bifurcation": "regimes.bifurcation", "Change": "regimes.bifurcation",
    "basins": "regimes.basins", "Basins": "regimes.basins", "Attractor": "regimes.attractor",
    "boundary": "regimes.boundary", "Boundary": "regimes.boundary",
    "dither": "regimes.dither", "Dither": "regimes.dither", "dithered_friction": "regimes.dither",
    "plot_bifurcation": "plot.bifurcation", "plot_basins": "plot.bifurcation", "plot_boundary": "plot.bifurcation",
    "plot_dither": "plot.bifurcation",
    "Rig": "rig.rig", "Sensor": "rig.sensor", "Mount": "rig.sensor", "Noise": "rig.sensor", "Digitiser": "rig.sensor",
    "scenarios": "scenarios", "export_system": "system_export",
    "read_system": "system_file", "scenario_case": "system_file", "Case": "system_file",
    "outcome": "reports.simulation", "Outcome": "reports.simulation", "publish_run": "reports.simulation",
    "require_output": "reports.simulation",
    "animate": "plot.animation",
    "figures": "plot.figures", "report": "reports.page", "publish": "reports.folder",
    "summary": "reports.summary", "datasets": "datasets",
}  # fmt: skip

__all__ = [*_ROOMS, "__version__"]


def __getattr__(name: str) -> Any:
    if name not in _ROOMS:
        import difflib

        near = difflib.get_close_matches(name, _ROOMS, n=3, cutoff=0.5)
        told = f"the nearest are {', '.join(near)}" if near else "dir(stickslip) lists what it has"
        raise AttributeError(f"module 'stickslip' has no attribute '{name}'; {told}")
    room = importlib.import_module(f"stickslip.{_ROOMS[name]}")
    return room if _ROOMS[name] == name and not hasattr(room, name) else getattr(room, name)


def __dir__() -> list[str]:
    return __all__
