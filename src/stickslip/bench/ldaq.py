"""Whatever LDAQ reads (Dewesoft, Digilent and more), through its acquisition classes."""

from __future__ import annotations

import importlib
import re
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel, Field

from stickslip.bench.device import Block, Input, Listening, Output, Wires, inputs, vendors
from stickslip.errors import ModelError
from stickslip.settings import STRICT, checked

NAME, NEEDS = "ldaq", "LDAQ"
PAUSE = 0.005  # s between two looks for samples


@dataclass(frozen=True)
class Source:
    """One of LDAQ's sources.

    Attributes
    ----------
    acquisition : object
        Of a class that derives from LDAQ's BaseAcquisition, set up.
    inputs : tuple of Input
        Each at the name of its channel there.
    name : str
        What it is called.
    """

    acquisition: Any
    inputs: tuple[Input, ...]
    name: str = NAME

    kind = NAME
    outputs: tuple[Output, ...] = ()

    @cached_property
    def fs(self) -> float:
        """Rate [Hz] that the source states."""
        return float(self.acquisition.sample_rate)

    @property
    def model(self) -> str:
        """Which class."""
        return f"{type(self.acquisition).__name__} of LDAQ"

    def open(self) -> Reading:
        """Begin to read."""
        return Reading(self)


class Reading(Listening):
    """A source that is read."""

    def __init__(self, device: Source) -> None:
        self.device, self.sent = device, 0
        device.acquisition.set_data_source()
        there = list(device.acquisition._channel_names_init)  # what LDAQ has every source set
        missing = [one.terminal for one in device.inputs if one.terminal not in there]
        if missing:
            device.acquisition.terminate_data_source()
            raise ModelError(f"a channel '{missing[0]}'", f"the source has {', '.join(there)}", "name one of them")
        self.columns = [there.index(one.terminal) for one in device.inputs]

    def __exit__(self, *raised: object) -> None:
        """Let go of the source."""
        self.device.acquisition.terminate_data_source()

    def read(self, timeout: float = 1.0) -> Block | None:
        """What has come; see :class:`Stream`. LDAQ tells of no lost sample."""
        until = time.monotonic() + timeout
        while True:
            data = np.asarray(self.device.acquisition.read_data(), dtype=np.float64)
            if data.size or time.monotonic() >= until:
                break
            time.sleep(PAUSE)
        rows = data.reshape(-1, data.shape[-1])[:, self.columns].T if data.size else np.empty((len(self.columns), 0))
        first, self.sent = self.sent, self.sent + rows.shape[1]
        return Block(first, time.monotonic(), rows)


class _Settings(BaseModel):
    """A table ``[devices.NAME]`` of kind "ldaq"."""

    model_config = STRICT

    acquisition: str
    arguments: dict[str, Any] = Field(default_factory=dict)
    channels: Wires


def listed() -> Sequence[str]:
    """What LDAQ itself has; it does not look for hardware."""
    vendors("LDAQ")
    return ("its sources: dewesoft, digilent, serial_communication and others",)


def build(name: str, settings: Mapping[str, Any], folder: Path) -> Source:
    """A source from a table: acquisition (``"dewesoft.DewesoftAcquisition"``), its arguments, channels.

    Raises
    ------
    ModelError
        No such source in LDAQ, or a setting without meaning.
    """
    given = checked(_Settings, settings, source=f"devices.{name}")
    base = vendors("LDAQ.acquisition_base").BaseAcquisition
    module, _, wanted = given.acquisition.rpartition(".")
    source: Any = None
    if re.fullmatch(r"[A-Za-z]\w*(\.[A-Za-z]\w*)*", given.acquisition) and module:
        try:
            source = getattr(importlib.import_module(f"LDAQ.{module}"), wanted, None)
        except ImportError as error:
            raise ModelError(
                f"LDAQ.{module} can not be imported ({error})", "it is a part of LDAQ", "install it"
            ) from error
    if not (isinstance(source, type) and issubclass(source, base)):
        raise ModelError(
            f"acquisition = {given.acquisition!r}",
            "it is one of LDAQ's sources",
            'write "dewesoft.DewesoftAcquisition"',
        )
    return Source(source(**given.arguments), inputs(given.channels, unit="V"), name)
