"""stickslip: dry friction in oscillators, from a rig's record to its friction law, and back.

The public names; each is imported when it is first used, so that ``import stickslip`` stays light.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    pass

_ROOMS = {
    "StickslipError": "errors", "RecordError": "errors", "FormatError": "errors",
    "EstimateError": "errors", "ModelError": "errors", "SolveError": "errors",
    "Estimate": "estimate",
    "Record": "record.record", "Channel": "record.channels", "Step": "record.record", "Fault": "record.check",
    "from_pandas": "record.exchange", "from_xarray": "record.exchange", "from_sep005": "record.exchange",
    "read_record": "files.read", "read_blocks": "files.read", "write_record": "files.write",
    "repair_clock": "signals.repair", "fill_gaps": "signals.repair", "fill_missing": "signals.repair",
    "restore_clipped": "signals.repair", "remove_drift": "signals.repair", "resample": "signals.repair",
    "synchronise": "signals.synchronise", "clock_offset": "signals.synchronise",
    "differentiate": "signals.differentiate", "smooth": "signals.differentiate",
    "friction_force": "identify.force", "friction_loops": "identify.loops", "find_sticks": "identify.sticks",
    "regress_friction": "identify.regression",
    "read_rig": "config", "rig_settings": "config", "RigSettings": "config",
    "analyze": "analysis", "compare": "analysis", "Findings": "analysis", "Comparison": "analysis",
    "Coulomb": "laws.coulomb", "CompliantContact": "laws.compliant", "LinearSlope": "laws.linear_slope",
    "Tabulated": "laws.tabulated", "StateVariable": "laws.state_variable", "InertialContact": "laws.inertial",
    "ElastoSlip": "laws.elastoslip", "PositionLoad": "laws.position_load", "InSeries": "laws.series",
    "Stribeck": "laws.stribeck", "FrictionCurve": "laws.stribeck", "Dahl": "laws.dahl", "LuGre": "laws.lugre",
    "RateState": "laws.rate_state", "SmoothStateVariable": "laws.smooth_state",
    "steady_sliding": "solve.sliding", "SteadySliding": "solve.sliding",
    "Release": "drives", "HarmonicBase": "drives", "HarmonicForce": "drives", "MultiTone": "drives",
    "Belt": "drives", "Ramp": "drives", "RecordedBase": "drives",
    "Oscillator": "oscillator", "Structure": "structure", "Contact": "structure",
    "simulate": "solve.simulate", "Trajectory": "solve.trajectory",
    "steady_state": "solve.periodic", "SteadyState": "solve.periodic", "lyapunov": "solve.lyapunov",
    "energy": "solve.energy", "attractors": "solve.periodic", "continue_orbit": "solve.continuation",
    "Branch": "solve.continuation",
    "scenarios": "scenarios",
    "figures": "plot.figures", "report": "reports.page", "publish": "reports.folder", "datasets": "datasets",
}  # fmt: skip

__all__ = [*_ROOMS, "__version__"]


def __getattr__(name: str) -> Any:
    if name not in _ROOMS:
        raise AttributeError(f"module 'stickslip' has no attribute '{name}'; it has {', '.join(_ROOMS)}")
    room = importlib.import_module(f"stickslip.{_ROOMS[name]}")
    return room if _ROOMS[name] == name and not hasattr(room, name) else getattr(room, name)


def __dir__() -> list[str]:
    return __all__
