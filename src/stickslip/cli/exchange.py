"""stickslip check, convert, datasets"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

import stickslip as ss
from stickslip.cli.options import all_option, reading_options
from stickslip.cli.records import collected, groups_of, read, rig_of
from stickslip.cli.terminal import aligned, complain, say
from stickslip.cli.words import spoken


@click.command()
@click.argument("file")
@reading_options
def check(file: str, **options: Any) -> None:
    """Tell what is wrong with a record, with row numbers."""
    rig = rig_of(**options)
    refused: list[ss.StickslipError] = []
    for group in groups_of(file):
        with collected(refused, group):
            record = read(group, rig)
            say(f"{record!r}")
            for words in [str(fault) for fault in record.check()] or ["nothing wrong was found"]:
                say(f"- {spoken(words)}")
    for error in refused[:-1]:
        complain(spoken(error))
    if refused:
        raise refused[-1]


@click.command()
@click.argument("file")
@click.argument("out", type=click.Path(path_type=Path))
@click.option("--force", is_flag=True, help="Write over OUT if it is there.")
@reading_options
def convert(file: str, out: Path, force: bool, **options: Any) -> None:
    """Read FILE and write it as OUT: CSV, HDF5 or Parquet by its suffix, with units and history."""
    groups = groups_of(file)
    if len(groups) != 1:
        raise click.BadParameter(f"'{file}' fits {len(groups)} records; one is converted at a time", param_hint="FILE")
    if out.exists() and any(out.samefile(path) for path in groups[0]):
        raise click.BadParameter(f"'{out}' is the file to be read", param_hint="OUT")
    if out.exists() and not force:
        raise click.BadParameter(f"'{out}' is there already; --force writes over it", param_hint="OUT")
    say(ss.write_record(read(groups[0], rig_of(**options)), out, overwrite=force))


@click.command()
@click.argument("name", required=False)
@all_option
def datasets(name: str | None, everything: bool) -> None:
    """List the public record sets, or fetch the one named and tell its columns, units and rig."""
    if name is not None:
        say(ss.datasets.info(name), err=True)
        for path in ss.datasets.fetch(name).files:
            say(path)
        return
    sets = [ss.datasets.info(each) for each in ss.datasets.names()]
    if everything:
        say("\n\n".join(map(str, sets)))
        return
    rows = [(each.name, each.title, each.licence) for each in sets]
    say("\n".join(aligned(("name", "record set", "licence"), rows)))
    say("\nMore with --all, or of one: stickslip datasets NAME")
