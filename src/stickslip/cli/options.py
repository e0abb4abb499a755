"""The options that several commands share, and how their words are read."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

import stickslip as ss

if TYPE_CHECKING:
    from stickslip.systems import Case


def number_of(text: str, si: str, option: str) -> float:
    """A number in SI, or with its unit; what is none is refused by the name of its option."""
    try:
        return float(ss.Estimate.stated(option.lstrip("-"), text, si))
    except ss.StickslipError as error:
        raise click.BadParameter(f"{error.value}; {error.rule}", param_hint=option) from error


def pair(text: str, option: str) -> tuple[str, str]:
    name, separator, value = text.partition("=")
    if not separator or not name.strip() or not value.strip():
        raise click.BadParameter(f"'{text}' is not NAME=VALUE", param_hint=option)
    return name.strip(), value.strip()


Decorator = Callable[[Callable[..., None]], Callable[..., None]]


def together(*options: Decorator) -> Decorator:
    """Several options as one decorator, in the order in which the help lists them."""

    def decorate(command: Callable[..., None]) -> Callable[..., None]:
        for option in reversed(options):
            command = option(command)
        return command

    return decorate


# How a file is read.
reading_options = together(
    click.option(
        "--channels",
        multiple=True,
        metavar='"NAME=COLUMN [UNIT]"',
        help='What a column is: "x=qm [m]", "force=vir * 35.15 [N]", "a=acc [g] ± 1 %". Repeatable.',
    ),
    click.option(
        "--units",
        multiple=True,
        metavar='"COLUMN=UNIT"',
        help='Unit of a column whose header states none: "x=mm", "#1=ms". Repeatable.',
    ),
    click.option(
        "--sensor",
        "sensors",
        multiple=True,
        metavar='"CHANNEL.NAME=VALUE"',
        help='What is known of a sensor: "a.delay=3 ms", "a.mount=125 Hz, 0.1", "load.inertia=20 g". Repeatable.',
    ),
    click.option("--fs", metavar="HZ", help="Sampling rate, for a file that states none."),
    click.option("--time", metavar="COLUMN", help="Column that holds the time, where its header does not say."),
    click.option("--delimiter", metavar="SIGN", help="Delimiter of a text file, where it can not be told."),
    click.option("--decimal", type=click.Choice([".", ","]), help="Decimal sign of a text file."),
    click.option("--rows", metavar="FIRST:LAST", help="Rows to keep of each file."),
    click.option(
        "--repair",
        metavar="LIST",
        help="Repairs after reading, in this order, with commas: clock, gaps, missing, spikes, clipping, drift; "
        "for one channel alone as in drift:x.",
    ),
    click.option(
        "--config",
        type=click.Path(path_type=Path),
        metavar="RIG.TOML",
        help="The rig's constants and channel map; unless given rig.toml of this folder. Options go before it.",
    ),
)


def constants_options(mass: str = 'Oscillating mass in kg, or with its unit ("250 g", "2.42 ± 0.02 kg").') -> Decorator:
    """The options that state the oscillator; `mass` is the help of the first."""
    return together(
        click.option("--mass", metavar="VALUE", help=mass),
        click.option("--stiffness", metavar="VALUE", help="Spring in N/m, or with its unit."),
        click.option("--damping", metavar="VALUE", help="Viscous damping of the suspension in N s/m."),
        click.option("--damper", type=click.Choice(["ground", "base"]), help="What the damper ends on."),
        contact_option,
    )


contact_option = click.option("--contact", type=click.Choice(["ground", "base"]), help="What the mass slides on.")
normal_option = click.option(
    "--normal",
    multiple=True,
    metavar='LOAD or "PATTERN=LOAD"',
    help="Normal load in N, for all files or for those whose name fits. Repeatable.",
)
form_option = click.option(
    "--format",
    "form",
    type=click.Choice(["csv", "h5", "parquet"]),
    default="csv",
    show_default=True,
    help="Format of the record.",
)


def usable(context: click.Context, option: click.Parameter, folder: Path | None) -> Path | None:
    """A folder for results, refused before the work where it may not be written; none may be asked for."""
    if folder is not None:
        ss.story.check_folder(folder)
    return folder


all_option = click.option(
    "--all", "everything", is_flag=True, help="Print all quantities, cautions and notes, as the page has them."
)


def result_options(folder: str) -> Decorator:
    """The options that say where the results go, `folder` unless it is said, and how much of them is printed."""
    output = click.option(
        "--output",
        type=click.Path(path_type=Path),
        callback=usable,
        metavar="DIR",
        help=f"Folder for the results; {folder} unless given.",
    )
    as_json = click.option(
        "--json",
        "as_json",
        is_flag=True,
        help="Print the results as JSON and nothing else; a folder is written only with --output.",
    )
    return together(output, as_json, all_option)


changes_option = click.option(
    "--set",
    "changes",
    multiple=True,
    metavar='"NAME=VALUE"',
    help='Another value of a parameter: "kinetic=1.3", "amplitude=0.7 mm", "law.stiffness=2 N/um". Repeatable.',
)


# How long it runs, and what is changed of it.
case_options = together(
    click.option("--duration", metavar="TIME", help="Time to simulate in s, or with its unit."),
    click.option("--cycles", type=click.FloatRange(min=0, min_open=True), help="The same in periods of the drive."),
    changes_option,
)


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
