"""A fitted law in a folder, in every form that another program reads; its TOML a system that can be simulated."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from stickslip.balance.motion import forcing_frequency
from stickslip.drives.kinds import Drive, HarmonicBase, Ramp, Release
from stickslip.errors import ModelError
from stickslip.law.fit_curve import CurveFit
from stickslip.law.law import LawFit
from stickslip.law.which_law import LawComparison
from stickslip.laws.export import export_law, toml_table
from stickslip.laws.formula import quoted
from stickslip.record.record import Record

FILES = {
    "toml": "law.toml", "python": "friction.py", "c": "friction.c", "mujoco": "mujoco.xml", "modelica": "friction.mo",
    "simulink": "friction.m",
}  # fmt: skip
STEADY = 0.05  # of its spread that a base may stray from a straight line: a tone over its half period strays by 0.2
ALONE = "# a law alone: to simulate it, add [system] with its mass and stiffness, and [drive]"


def write_law(draft: Path, result: LawComparison | LawFit | CurveFit, records: Sequence[Record]) -> None:
    """The fitted law in every form that it has, into the folder law."""
    law = result.fit.law if isinstance(result, LawComparison) else result.law
    if law is None:
        return
    (draft / "law").mkdir()
    for form, file in FILES.items():
        try:
            text = export_law(law, format=form)
        except ModelError:  # this law has no such form
            continue
        if form == "toml":
            text = _whole(text, result, records[0]) if records else f"{ALONE}\n{text}"
        (draft / "law" / file).write_text(text.rstrip("\n") + "\n", encoding="utf-8")


def _whole(law: str, result: LawComparison | LawFit | CurveFit, record: Record) -> str:
    """The law's table within a system, moved as the first record was; alone where the mass is not known."""
    if isinstance(result, CurveFit):
        told: dict[str, Any] = {} if record.rig is None else record.rig.constants
        contact = str(told.get("contact", "ground"))
        given: Drive = HarmonicBase(0.0, frequency=1.0, contact=contact)
    else:
        rig = (result.fit if isinstance(result, LawComparison) else result).oscillator
        told = {name: getattr(rig, name) for name in ("mass", "stiffness", "damping", "damper")}
        given = rig.drive
    if told.get("mass") is None or told.get("stiffness") is None:
        return f"{ALONE}\n{law}"
    drive = _drive(record, given)
    start = {"x": float(record["x"][0])} if isinstance(drive, Release) and "x" in record else {}
    system: dict[str, Any] = {name: told[name] for name in ("mass", "stiffness", "damping", "damper") if name in told}
    tables = [law, _plain("system", system), toml_table("drive", drive)]
    return "\n".join(
        [*tables, *([_plain("start", start)] if start else []), _plain("run", {"duration": record.duration})]
    )


def _drive(record: Record, given: Drive) -> Drive:
    """The base's steady pull or strongest tone, or what the fit was told."""
    if "z" in record and np.ptp(record["z"]) > 0:
        z, time = record["z"], np.arange(len(record)) / record.fs
        speed, begin = np.polyfit(time, z, 1)
        if np.std(z - begin - speed * time) < STEADY * np.std(z) and getattr(given, "contact", "ground") == "ground":
            return Ramp(float(speed))
        frequency = forcing_frequency(z, record.fs).value
        turns = 2 * np.pi * frequency * time
        a, b, _ = np.linalg.lstsq(np.column_stack([np.cos(turns), np.sin(turns), np.ones(len(z))]), z, rcond=None)[0]
        contact = getattr(given, "contact", "ground")
        return HarmonicBase(float(np.hypot(a, b)), frequency=frequency, phase=float(np.arctan2(-b, a)), contact=contact)
    still = isinstance(given, HarmonicBase) and given.amplitude == 0
    known = all(isinstance(value, int | float | str) for value in vars(given).values())
    return given if known and not still else Release()


def _plain(name: str, values: Mapping[str, Any]) -> str:
    lines = [
        f"{key} = {quoted(value) if isinstance(value, str) else repr(float(value))}" for key, value in values.items()
    ]
    return "\n".join([f"[{name}]", *lines])
