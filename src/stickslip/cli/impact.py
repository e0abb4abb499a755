"""stickslip impact"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

import stickslip as ss
from stickslip.cli.options import reading_options, result_options
from stickslip.cli.progress import progress
from stickslip.cli.records import default_folder, groups_of, read, rig_of
from stickslip.cli.show import show


@click.command()
@click.argument("file")
@click.option("--mass", metavar="VALUE", help="Moving mass in kg, which tells the contact's mode from the mounts'.")
@result_options("FILE-impact")
@reading_options
def impact(file: str, output: Path | None, as_json: bool, everything: bool, **options: Any) -> None:
    """Which resonances does a hammer tap excite, and which sensor's mount are they?

    FILE holds the accelerometer (a) or the load cell (load), better both, and one tap on the mass while the base is
    held. The mounts that are found can be stated afterwards: --sensor "a.mount=125 Hz, 0.1".

    \b
    stickslip impact tap.csv --mass 2.42
    """
    rig = rig_of(**options)
    groups = groups_of(file)
    if len(groups) != 1:
        raise click.BadParameter(f"'{file}' fits {len(groups)} records; a tap is one", param_hint="FILE")
    folder = output or (None if as_json else default_folder(groups, "impact"))
    with progress(1) as tell:
        tell(f"reading {file}", 0)
        record = read(groups[0], rig)
        test = ss.balance.impact_test(record, mass=rig.mass)
        written = ss.publish(test, folder=folder, record=record) if folder else None
    show(test, written, as_json=as_json, everything=everything, record=record)
