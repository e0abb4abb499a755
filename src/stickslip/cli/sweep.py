"""stickslip sweep"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import click

import stickslip as ss
from stickslip.cli.show import table
from stickslip.cli.simulate import INTERRUPTED


@click.command()
@click.argument("file", type=click.Path(path_type=Path))
@click.option("--engine", default="threads", show_default=True, metavar="NAME",
              help="Where it runs: serial, threads, dask, dask://HOST:PORT or cuda.")  # fmt: skip
@click.option("--store", type=click.Path(path_type=Path), metavar="MAP.ZARR",
              help="Where what is done is kept, and goes on after an end; FILE.zarr unless given.")  # fmt: skip
@click.option("--output", type=click.Path(path_type=Path), metavar="DIR", help="Folder for figures; none unless given.")
@click.option("--json", "as_json", is_flag=True, help="Print the results as JSON and nothing else.")
def sweep(file: Path, engine: str, store: Path | None, output: Path | None, as_json: bool) -> None:
    """Map what a system does over a grid of its parameters.

    FILE names the system, the grid and what is asked of each motion; every finished block is kept in the store, and a
    sweep that was ended goes on there when it is called again.

    \b
    stickslip sweep grid.toml --engine threads --store map.zarr --output maps
    """
    asked = ss.read_sweep(file)
    place = store if store is not None else file.with_suffix(".zarr")
    found = ss.sweep(asked.case.system, asked.grid, measures=asked.measures, cycles=asked.cycles, settle=asked.settle,
                     start=asked.case.start, engine=engine, store=place)  # fmt: skip
    written = _drawn(found, asked, output) if output is not None else []
    told, whole = _told(found), found.attrs["status"] == "complete"
    if as_json:
        click.echo(json.dumps({**found.attrs, "store": str(place), "variables": told}, indent=2, allow_nan=False))
        raise SystemExit(0 if whole else INTERRUPTED)
    from rich.console import Console

    console = Console(highlight=False, soft_wrap=False)
    console.print(f"\n[bold]{' x '.join(map(str, found.sizes.values()))} points, {found.attrs['status']}[/bold]")
    rows = [[name, *(f"{part[key]:.6g}" if part[key] is not None else "-" for key in ("least", "most")),
             str(part["known"]), part["unit"]] for name, part in told.items()]  # fmt: skip
    console.print(table(("measure", "least", "most", "points", "unit"), rows))
    click.echo(f"Map: {place}")
    for path in written:
        click.echo(f"Figure: {path}")
    if not whole:
        click.echo("Call again to go on.")
        raise SystemExit(INTERRUPTED)


def _told(found: Any) -> dict[str, dict[str, Any]]:
    """Least and most of each variable, and at how many points it is known."""
    told = {}
    for name, column in found.data_vars.items():
        values = abs(column) if column.dtype.kind == "c" else column
        known = int(values.notnull().sum())
        least, most = (float(values.min()), float(values.max())) if known else (None, None)
        told[str(name)] = {"least": least, "most": most, "known": known, "unit": column.attrs.get("units", "1")}
    return told


def _drawn(found: Any, asked: ss.SweepFile, folder: Path) -> list[Path]:
    """A figure of each measure of a map over one or two parameters."""
    if not 1 <= len(found.dims) <= 2:
        return []
    folder.mkdir(parents=True, exist_ok=True)
    counts = {"normal_stops", "abnormal_stops"} & set(found.data_vars)
    drawn = {str(name): str(name) for name in found.data_vars if name not in {"status", *counts}}
    written = []
    for name, variable in {**({"stops": None} if counts else {}), **drawn}.items():
        figure: Any = ss.plot_map(found, variable=variable, system=asked.case.system).figure
        written.append(folder / f"{name}.png")
        figure.savefig(written[-1], dpi=150, facecolor="white")
    return written
