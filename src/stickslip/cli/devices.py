"""stickslip devices"""

from __future__ import annotations

from pathlib import Path

import click

import stickslip as ss
import stickslip.bench as bench
from stickslip.cli.terminal import say, say_json, wrapped


@click.command()
@click.option(
    "--config", type=click.Path(path_type=Path), metavar="RIG.TOML", help="List the devices that it names too."
)
@click.option("--json", "as_json", is_flag=True, help="Print the list as JSON and nothing else.")
def devices(config: Path | None, as_json: bool) -> None:
    """List what can measure here: kinds of devices, what is plugged in, and which package is missing.

    \b
    stickslip devices
    stickslip devices --config rig.toml
    """
    found = bench.devices()
    named = ss.rig.read_rig(config).devices if config else {}
    mine = {name: bench.find_device(name, named, folder=config.parent if config else None) for name in named}
    if as_json:
        kinds = {each.kind: {"about": each.about, "there": [*each.there], "missing": each.missing} for each in found}
        said = {name: {"kind": one.kind, "model": one.model, "fs": one.fs} for name, one in mine.items()}
        say_json({"kinds": kinds, "named": said})
        return
    for name, one in mine.items():
        inputs = ", ".join(f"{each.name} [{each.unit}]" for each in one.inputs)
        outputs = "".join(f"; moves {each.name}" for each in one.outputs)
        say("\n".join(wrapped(f"{one.model}, {one.fs:g} Hz: {inputs}{outputs}", f"{name:<8} ")))
    for each in found:
        there = f"missing: {each.missing}" if each.missing else "; ".join(each.there) or "nothing found"
        say("\n".join([*wrapped(each.about, f"{each.kind:<8} "), *wrapped(there, 9 * " ")]))
