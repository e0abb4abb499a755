"""What a command is to simulate: a named scenario, or a file."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

import stickslip as ss
from stickslip.cli.options import pair

if TYPE_CHECKING:
    from stickslip.systems import Case


def case_options(command: Callable[..., None]) -> Callable[..., None]:
    """The options that say how long it runs and what is changed of it."""
    options = [
        click.option("--duration", metavar="TIME", help="Time to simulate in s, or with its unit."),
        click.option("--cycles", type=click.FloatRange(min=0, min_open=True), help="The same in periods of the drive."),
        click.option(
            "--set",
            "changes",
            multiple=True,
            metavar='"NAME=VALUE"',
            help='Another value of a parameter: "kinetic=1.3", "amplitude=0.7 mm", "law.stiffness=2 N/um". Repeatable.',
        ),
    ]
    for option in reversed(options):
        command = option(command)
    return command


def wanted_case(
    name: str, *, duration: str | None, cycles: float | None, changes: Sequence[str], fs: str | None = None
) -> Case:
    """The scenario or the file of that name, with what the command line changes."""
    case = (
        ss.systems.read_system(name)
        if name.endswith(".toml") or Path(name).is_file()
        else ss.systems.scenario_case(name)
    )
    case = case.having(**dict(pair(change, "--set") for change in changes))
    return case.lasting(duration=duration, cycles=cycles, fs=fs)


def folder_name(case: Case, ending: str) -> Path:
    """A folder's name after the case."""
    name = "".join(sign if sign.isalnum() or sign in "-_." else "-" for sign in case.name)
    return Path(f"{name}-{ending}")
