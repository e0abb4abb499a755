"""Oscilloscopes whose text is no table: Tektronix TDS has settings beside the first rows, Rigol has no times."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np

from stickslip.errors import FormatError
from stickslip.files.table import Budget, Column, Options, Table, reading, slices

NAME = "oscilloscope"
SUFFIXES = (".csv",)
TEKTRONIX = re.compile(rb'\s*"?Record Length"?(?:,[^,\r\n]*){2},\s*[-+.\d][^,\r\n]*,\s*[-+.\d]')
RIGOL = re.compile(rb"\s*X,([^\r\n]*),Start,Increment,?\s*[\r\n]+\s*Sequence,([^\r\n]*)")


def recognise(path: Path, head: bytes) -> bool:
    """By how the first row begins."""
    return bool(TEKTRONIX.match(head) or RIGOL.match(head))


def read(path: Path, options: Options) -> Table:
    """The time and the readings of the channels; they are held whole, as the instrument held them."""
    budget = Budget.of(path)
    with reading(path, NAME), path.open("rb") as file:
        titles = RIGOL.match(file.read(1 << 12))
        rows = sum(1 for _ in file)
        budget.require_rows(rows, 1 + (titles[1].count(b",") + 1 if titles else 4))
        return _without_times(path, *titles.groups()) if titles else _beside_settings(path)


def _beside_settings(path: Path) -> Table:
    """Settings in the first two cells of the first rows, time and reading in the fourth and the fifth of all."""
    cells = _cells(path, header=None, usecols=[0, 1, 3, 4], dtype={0: str, 1: str, 3: np.float64, 4: np.float64})
    settings = dict(cells[[0, 1]].dropna().itertuples(index=False, name=None))
    name = settings.get("Source") or "CH1"
    columns = Column("Time", settings.get("Horizontal Units", "s")), Column(name, settings.get("Vertical Units"))
    wanted = int(float(settings["Record Length"]))
    cut = f"it has {len(cells)} of {wanted} rows" if len(cells) < wanted else ""
    return Table(columns, slices({"Time": cells[3].to_numpy(), name: cells[4].to_numpy()}), cut=cut)


def _without_times(path: Path, titled: bytes, stated: bytes) -> Table:
    """The number of each row and its readings; when the first was taken and how far they are apart stand above them."""
    names, cells = titled.decode().split(","), stated.decode().rstrip(",").split(",")
    start, step = map(float, cells[-2:])
    if not step > 0:
        raise FormatError(f"an increment of {step:g} s", "samples follow each other", "export the file again")
    wanted = list(range(1, 1 + len(names)))
    readings = _cells(path, header=None, skiprows=2, usecols=wanted, dtype=np.float64)
    columns = [
        Column(name, unit, rows=len(readings), fs=1 / step, start=start)
        for name, unit in zip(names, cells[: len(names)], strict=True)
    ]
    return Table(
        tuple(columns), slices({name: readings[key].to_numpy() for name, key in zip(names, wanted, strict=True)})
    )


def _cells(path: Path, **options: Any) -> Any:
    import pandas as pd

    return pd.read_csv(path, skipinitialspace=True, encoding="latin-1", skip_blank_lines=True, **options)
