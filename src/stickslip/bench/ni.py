"""National Instruments' units; through nidaqmx and the vendor's driver."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, Field

from stickslip.arrays import Array
from stickslip.bench.device import (
    Block,
    Input,
    Listening,
    Mover,
    Output,
    Signal,
    Tone,
    Wires,
    inputs,
    output_of,
    vendors,
)
from stickslip.errors import ModelError, RecordError
from stickslip.files.expression import apply_sensitivity
from stickslip.settings import STRICT, checked, quantity
from stickslip.units import parse_unit

NAME, NEEDS = "ni", "nidaqmx"
VOLTS = 10.0  # range of an input where nothing is said
HELD = 10.0  # s of samples that the driver holds for who reads late
BLOCK = 0.02  # s of samples that are read at a time
TURNS = 200  # cycles of a tone that its buffer holds at the most: then a cycle need not be whole samples


@dataclass(frozen=True)
class Unit:
    """A unit for data acquisition.

    Attributes
    ----------
    device : str
        "Dev1", "cDAQ1Mod1".
    fs : float
        Sampling rate [Hz].
    inputs : tuple of Input
        Each at its terminal, "ai0"; read in volts.
    outputs : tuple of Output
        What it moves.
    movers : tuple of (str, float)
        Terminal of each output, and what a volt is worth there.
    name : str
        What it is called.
    """

    device: str
    fs: float
    inputs: tuple[Input, ...]
    outputs: tuple[Output, ...] = ()
    movers: tuple[tuple[str, float], ...] = ()
    name: str = NAME

    kind = NAME

    @property
    def model(self) -> str:
        """Product and serial number, where the unit can be asked."""
        try:
            unit = vendors("nidaqmx").system.Device(self.device)
            return f"{unit.product_type}, serial {unit.serial_num:X}"
        except Exception as error:  # noqa: BLE001  the driver raises its own, and an unit may not be there yet
            return f"{self.device} ({str(error).partition(chr(10))[0]})"

    def open(self) -> Task:
        """Begin to measure.

        Raises
        ------
        ModelError
            The unit is not there, or refuses what is asked.
        """
        return Task(self)


class Task(Listening):
    """A unit that measures."""

    def __init__(self, device: Unit) -> None:
        self.device, self.sent = device, 0
        self.ni = vendors("nidaqmx")
        kinds = vendors("nidaqmx.constants")
        self.moving: dict[str, Any] = {}
        try:
            self.task = self.ni.Task()
        except Exception as error:  # as in listed()
            raise _out_of_order(error) from error
        try:
            for one in device.inputs:
                volts = min(VOLTS, one.limit / one.scale)
                at = f"{device.device}/{one.terminal}"
                self.task.ai_channels.add_ai_voltage_chan(at, min_val=-volts, max_val=volts)
            buffered, mode = round(HELD * device.fs), kinds.AcquisitionType.CONTINUOUS
            self.task.timing.cfg_samp_clk_timing(device.fs, sample_mode=mode, samps_per_chan=buffered)
            self.reader = vendors("nidaqmx.stream_readers").AnalogMultiChannelReader(self.task.in_stream)
            self.task.start()
        except self.ni.errors.DaqError as error:
            self.task.close()
            raise ModelError(
                f"{device.device} refuses ({error})", "terminals, ranges and rate are what the unit has", "correct them"
            ) from error

    def __exit__(self, *raised: object) -> None:
        """Let go of the unit."""
        for task in (self.task, *self.moving.values()):
            task.close()

    def read(self, timeout: float = 1.0) -> Block | None:
        """The next samples; see :class:`Stream`. The driver ends a task whose samples were not read in time."""
        count = max(1, round(BLOCK * self.device.fs))
        there = int(self.task.in_stream.avail_samp_per_chan)
        volts = np.empty((len(self.device.inputs), max(count, there)))
        try:
            self.reader.read_many_sample(volts, number_of_samples_per_channel=volts.shape[1], timeout=timeout)
        except self.ni.errors.DaqReadError as error:
            if error.error_code == TIMEOUT:
                return Block(self.sent, time.monotonic(), volts[:, :0])
            raise RecordError(
                f"{self.device.name} has ended ({error})", "samples are read before its memory is full", "begin again"
            ) from error
        first, self.sent = self.sent, self.sent + volts.shape[1]
        return Block(first, time.monotonic(), volts)

    def drive(self, output: str, signal: Signal) -> None:
        """Write a tone again and again, or samples once; see :class:`Stream`."""
        device = self.device
        output_of(device, output).require(signal, fs=device.fs)
        terminal, worth = device.movers[[one.name for one in device.outputs].index(output)]
        if output in self.moving:
            self.moving.pop(output).close()
        kinds = vendors("nidaqmx.constants").AcquisitionType
        values = _cycles(signal, device.fs) if isinstance(signal, Tone) else signal
        volts = np.zeros(2) if values is None else np.asarray(values, dtype=np.float64) / worth
        task = self.moving[output] = self.ni.Task()
        task.ao_channels.add_ao_voltage_chan(f"{device.device}/{terminal}")
        mode = kinds.CONTINUOUS if isinstance(signal, Tone) else kinds.FINITE
        task.timing.cfg_samp_clk_timing(device.fs, sample_mode=mode, samps_per_chan=len(volts))
        task.write(volts, auto_start=True)


TIMEOUT = -200284  # of nidaqmx: some or all of the samples were not there in time


def _cycles(tone: Tone, fs: float) -> Array:
    """Samples of whole cycles that are played again and again: as many as come nearest to whole samples."""
    turns = np.arange(1, TURNS + 1)
    lengths = turns * fs / tone.frequency
    best = int(np.argmin(np.abs(np.round(lengths) / lengths - 1) + 1e-12 * turns))
    count = max(2, round(lengths[best]))
    phase = math.tau * turns[best] * np.arange(count) / count + tone.phase
    return np.asarray(tone.amplitude * np.cos(phase), dtype=np.float64)


class _Settings(BaseModel):
    """A table ``[devices.NAME]`` of kind "ni"."""

    model_config = STRICT

    device: str
    fs: Annotated[float, quantity("Hz"), Field(gt=0)]
    channels: Wires
    outputs: dict[str, Mover] = Field(default_factory=dict)


def listed() -> Sequence[str]:
    """The units that the vendor's driver knows."""
    ni = vendors("nidaqmx")
    try:
        return tuple(f"{one.name}: {one.product_type}" for one in ni.system.System.local().devices)
    except Exception as error:  # the driver raises errors of its own, one of them where it is not installed
        raise _out_of_order(error) from error


def _out_of_order(error: Exception) -> ModelError:
    words = str(error).partition("\n")[0]
    return ModelError(f"nidaqmx does not work ({words})", "it needs NI-DAQmx", "install the vendor's driver")


def build(name: str, settings: Mapping[str, Any], folder: Path) -> Unit:
    """A unit from a table: device, fs, channels (``load = "ai0 [V] @ 500 mV/lbf"``), outputs.

    Raises
    ------
    ModelError
        A setting without meaning.
    """
    given = checked(_Settings, settings, source=f"devices.{name}")
    outputs, movers = [], []
    for output, mover in given.outputs.items():
        worth = apply_sensitivity(mover.sensitivity, parse_unit("V"), output)
        outputs.append(Output(output, worth.si, **mover.stated))
        movers.append((mover.at, worth.scale))
    wired = inputs(given.channels, unit="V", limit=VOLTS)
    return Unit(given.device, given.fs, wired, tuple(outputs), tuple(movers), name)
