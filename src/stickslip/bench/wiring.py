"""What is plugged in where: inputs written as the columns of a file are, ``"ai0 [V] @ 500 mV/lbf"``."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Annotated, Any

from pydantic import BaseModel, BeforeValidator, Field

from stickslip.bench.device import Input
from stickslip.errors import ModelError
from stickslip.files.expression import apply_sensitivity, channel_unit, split_spec
from stickslip.settings import STRICT, quantity
from stickslip.units import parse_unit, parse_value


def _wire(value: Any) -> Any:
    return {"at": value} if isinstance(value, str) else value


class Wire(BaseModel):
    """One input: a text, or a table with what else is known.

    Attributes
    ----------
    at : str
        Where, in which unit it is read, and the sensor's sensitivity: ``"ai0 [V] @ 500 mV/lbf"``.
    range : str or None
        Largest reading of either sign, in the unit in which it is read: ``"10 V"``.
    serial : str
        Serial number of the sensor.
    """

    model_config = STRICT

    at: Annotated[str, Field(min_length=1)]
    range: str | None = None
    serial: str = ""


class Mover(BaseModel):
    """One output: where, what a volt is worth there, and its limits."""

    model_config = STRICT

    at: Annotated[str, Field(min_length=1)]
    sensitivity: str = "1 m/V"
    stroke: Annotated[float, quantity("m"), Field(gt=0)] | None = None
    lowest: Annotated[float, quantity("Hz"), Field(ge=0)] | None = None
    highest: Annotated[float, quantity("Hz"), Field(gt=0)] | None = None
    acceleration: Annotated[float, quantity("m/s^2"), Field(gt=0)] | None = None


Wires = Annotated[dict[str, Annotated[Wire, BeforeValidator(_wire)]], Field(min_length=1)]


def inputs(wires: Mapping[str, Wire], *, unit: str, count: float = 1.0, limit: float = math.inf) -> tuple[Input, ...]:
    """The inputs of a table of wires.

    Parameters
    ----------
    wires : mapping of str to Wire
        By channel.
    unit : str
        In which they are read where nothing is said ("V").
    count : float
        What one number of a block is worth in that unit.
    limit : float
        Largest reading in it, where nothing is said.

    Returns
    -------
    tuple of Input

    Raises
    ------
    ModelError
        An unknown unit, or one that does not fit the channel.

    Examples
    --------
    >>> from stickslip.bench.wiring import Wire
    >>> one, = inputs({"load": Wire(at="ai0 [V] @ 500 mV/N", range="5 V")}, unit="V")
    >>> one.scale, one.limit, one.terminal
    (2.0, 10.0, 'ai0')
    """
    return tuple(_input(name, wire, unit, count, limit) for name, wire in wires.items())


def _input(name: str, wire: Wire, unit: str, count: float, limit: float) -> Input:
    spec = split_spec(wire.at)
    measured = parse_unit(spec.unit or unit) if spec.sensitivity else channel_unit(spec.unit or unit, name)
    final = apply_sensitivity(spec.sensitivity, measured, name) if spec.sensitivity else measured
    scale = final.scale * count
    if scale <= 0 or not math.isfinite(scale):
        raise ModelError(f"a sensitivity of {spec.sensitivity} of {name}", "it is positive and finite", "correct it")
    reading = parse_value(wire.range, measured.si) / measured.scale if wire.range else limit
    details = {"gain_sd": spec.gain_sd} if spec.gain_sd else {}
    return Input(name, final.si, reading * final.scale, scale, spec.sensitivity, wire.serial, spec.arithmetic, details)


def columns(wires: Sequence[Input]) -> list[int]:
    """The columns, from 0, of inputs whose places are numbers: "#2", "2"."""
    places = [one.terminal.removeprefix("#") for one in wires]
    if not all(place.isdigit() and int(place) > 0 for place in places):
        raise ModelError(
            f"inputs at {', '.join(one.terminal for one in wires)}",
            "they are numbers of columns, from 1",
            'write "#2 [mm]"',
        )
    return [int(place) - 1 for place in places]
