"""stickslip sweep"""

from __future__ import annotations

from pathlib import Path

import click

import stickslip as ss
from stickslip.cli.interrupted import INTERRUPTED
from stickslip.cli.options import all_option, usable
from stickslip.cli.show import print_json, show
from stickslip.cli.terminal import say


@click.command()
@click.argument("file", type=click.Path(path_type=Path))
@click.option("--engine", default="threads", show_default=True, metavar="NAME",
              help="Where it runs: serial, threads, dask, dask://HOST:PORT or cuda.")  # fmt: skip
@click.option("--store", type=click.Path(path_type=Path), metavar="MAP.ZARR",
              help="Where what is done is kept, and goes on after an end; FILE.zarr unless given.")  # fmt: skip
@click.option("--output", type=click.Path(path_type=Path), callback=usable, metavar="DIR",
              help="Folder for the report and its figures; none unless given.")  # fmt: skip
@click.option("--json", "as_json", is_flag=True, help="Print the results as JSON and nothing else.")
@all_option
def sweep(file: Path, engine: str, store: Path | None, output: Path | None, as_json: bool, everything: bool) -> None:
    """Map what a system does over a grid of its parameters.

    FILE names the system, the grid and what is asked of each motion; every finished block is kept in the store, and a
    sweep that was ended goes on there when it is called again.

    \b
    stickslip sweep grid.toml --engine threads --store map.zarr --output maps
    """
    asked = ss.maps.read_sweep(file)
    place = store if store is not None else file.with_suffix(".zarr")
    found = ss.sweep(
        asked.case.system,
        asked.grid,
        measures=asked.measures,
        cycles=asked.cycles,
        settle=asked.settle,
        start=asked.case.start,
        engine=engine,
        store=place,
    )
    story, whole = ss.summary(found), found.attrs["status"] == "complete"
    written = ss.publish(found, folder=output, system=asked.case.system) if output is not None else None
    if as_json:
        print_json({**story.data(), "store": str(place)})
        raise SystemExit(0 if whole else INTERRUPTED)
    show(found, written, as_json=False, everything=everything)
    say(f"Map: {place}")
    if not whole:
        say("Call again to go on.")
        raise SystemExit(INTERRUPTED)
