"""The options of commands: those that several share, and how each kind of option is declared."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import click

import stickslip as ss
from stickslip.cli.terminal import Output

Decorator = Callable[[Callable[..., None]], Callable[..., None]]

PATH = click.Path(path_type=Path)
POSITIVE = click.FloatRange(min=0, min_open=True)
MANY = 20  # records from which each is a row of a table, and has no page of its own


def path(name: str, metavar: str, text: str, **more: Any) -> Decorator:
    """A file or a folder."""
    return click.option(name, type=PATH, metavar=metavar, help=text, **more)


def several(name: str, metavar: str, text: str, **more: Any) -> Decorator:
    """One that may be repeated; the command gets all of them, under the name `to` where one is given."""
    return click.option(*filter(None, (name, more.pop("to", ""))), multiple=True, metavar=metavar, help=text, **more)


def choice(name: str, choices: Sequence[str], text: str | None = None, *, to: str = "") -> Decorator:
    """One of these, the first unless another is chosen."""
    names, usual = filter(None, (name, to)), choices[0]
    return click.option(*names, type=click.Choice(choices), default=usual, show_default=True, help=text)


def count(name: str, usual: int, text: str, *, least: int = 1) -> Decorator:
    """A whole number, `usual` unless another is given."""
    return click.option(name, type=click.IntRange(min=least), default=usual, show_default=True, help=text)


def json(text: str = "Print the results as JSON and nothing else.") -> Decorator:
    """Whether a machine reads it."""
    return click.option("--json", "as_json", is_flag=True, help=text)


def all_of(*options: Decorator) -> Decorator:
    """Several options as one decorator, in the order in which the help lists them."""

    def decorate(command: Callable[..., None]) -> Callable[..., None]:
        for option in reversed(options):
            command = option(command)
        return command

    return decorate


# How a file is read.
reading = all_of(
    several(
        "--channels",
        '"NAME=COLUMN [UNIT]"',
        'What a column is: "x=qm [m]", "force=vir * 35.15 [N]", "a=acc [g] ± 1 %". Repeatable.',
    ),
    several("--units", '"COLUMN=UNIT"', 'Unit of a column whose header states none: "x=mm", "#1=ms". Repeatable.'),
    several(
        "--sensor",
        '"CHANNEL.NAME=VALUE"',
        'What is known of a sensor: "a.delay=3 ms", "a.mount=125 Hz, 0.1", "load.inertia=20 g". Repeatable.',
        to="sensors",
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
    path(
        "--config",
        "RIG.TOML",
        "The rig's constants and channel map; unless given rig.toml of this folder. Options go before it.",
    ),
)


def constants(mass: str = 'Oscillating mass in kg, or with its unit ("250 g", "2.42 ± 0.02 kg").') -> Decorator:
    """The options that state the oscillator; `mass` is the help of the first."""
    return all_of(
        click.option("--mass", metavar="VALUE", help=mass),
        click.option("--stiffness", metavar="VALUE", help="Spring in N/m, or with its unit."),
        click.option("--damping", metavar="VALUE", help="Viscous damping of the suspension in N s/m."),
        click.option("--damper", type=click.Choice(["ground", "base"]), help="What the damper ends on."),
        contact,
    )


contact = click.option("--contact", type=click.Choice(["ground", "base"]), help="What the mass slides on.")
normal = several(
    "--normal", 'LOAD or "PATTERN=LOAD"', "Normal load in N, for all files or for those whose name fits. Repeatable."
)
form = choice("--format", ["csv", "h5", "parquet"], "Format of the record.", to="form")


def usable(context: click.Context, option: click.Parameter, folder: Path | None) -> Path | None:
    """A folder for results, refused before the work where it may not be written; none may be asked for."""
    if folder is not None:
        ss.story.check_folder(folder)
    return folder


everything = click.option(
    "--all", "everything", is_flag=True, help="Print all quantities, cautions and notes, as the page has them."
)


def results(folder: str) -> Decorator:
    """The options that say where the results go, `folder` unless it is said, and how much of them is printed.

    The command gets them together, as its `output`.
    """
    chosen = path("--output", "DIR", f"Folder for the results; {folder} unless given.", callback=usable)
    as_json = json("Print the results as JSON and nothing else; a folder is written only with --output.")
    return all_of(chosen, as_json, everything, _gathered)


def _gathered(command: Callable[..., None]) -> Callable[..., None]:
    @functools.wraps(command)
    def gathering(*, output: Path | None, as_json: bool, everything: bool, **arguments: Any) -> None:
        command(output=Output(output, as_json, everything), **arguments)

    return gathering


changes = several(
    "--set",
    '"NAME=VALUE"',
    'Another value of a parameter: "kinetic=1.3", "amplitude=0.7 mm", "law.stiffness=2 N/um". Repeatable.',
    to="changes",
)


# Of hundreds of records.
many = all_of(
    click.option(
        "--workers",
        type=click.IntRange(min=1),
        metavar="N",
        help=f"Processes for more than {MANY} records, all processors unless given.",
    ),
    click.option(
        "--engine",
        metavar="NAME",
        default="processes",
        show_default=True,
        help="Where many records are worked on: processes, cluster (Dask, on this machine) or cluster://HOST:PORT.",
    ),
    path("--table", "FILE", "Write one row a record into FILE.csv, FILE.parquet or FILE.xlsx."),
)


# How long it runs, and what is changed of it.
case = all_of(
    click.option("--duration", metavar="TIME", help="Time to simulate in s, or with its unit."),
    click.option("--cycles", type=POSITIVE, help="The same in periods of the drive."),
    changes,
)
