"""LabVIEW measurement files, by lvm-read; its pickle cache is never looked at."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from stickslip.errors import FormatError
from stickslip.files.table import Budget, Column, Options, Table, optional, reading, slices, unique
from stickslip.files.text import judged

NAME = "LabVIEW measurement"
SUFFIXES = (".lvm",)
LONGEST_HEADER = 22  # lines among which lvm_read looks for the separator


def recognise(path: Path, head: bytes) -> bool:
    """By the first words."""
    return head.lstrip(b"\xef\xbb\xbf").startswith(b"LabVIEW Measurement")


def read(path: Path, options: Options) -> Table:
    """The columns of a file with one segment."""
    lvm_read = optional("lvm_read")
    with reading(path, NAME):
        text = path.read_text(encoding="utf-8-sig", errors="replace")
        lines = text.splitlines(keepends=True)
        separator, decimal = _stated(lines, "Separator", "\t"), _stated(lines, "Decimal_Separator\t", ".")
        Budget.of(path).require(len(lines) * (1 + max(line.count(separator) for line in lines)))  # the widest fills all
        end = judged(lines[_heading(lines) :], separator, decimal)
        # not lvm_read.read: even with read_from_pickle=False it loads FILE.lvm.pkl where there is one
        return _table(path, lvm_read.read_str("".join(lines[:-1]) if end.torn else text), end.cut)


def _stated(lines: Sequence[str], key: str, usual: str) -> str:
    """The sign that follows a key of the header."""
    return next((line[len(key)] for line in lines[:LONGEST_HEADER] if line.startswith(key) and line[len(key) :]), usual)


def _heading(lines: Sequence[str]) -> int:
    """Number of the line behind the columns' titles."""
    return next((number for number, line in enumerate(lines, 1) if line.startswith("X_Value")), len(lines))


def _table(path: Path, contents: Mapping[Any, Any], cut: str) -> Table:
    if contents["Segments"] != 1:
        raise FormatError(
            f"'{path.name}' has {contents['Segments']} segments",
            "a record is one segment with one clock",
            "split the file at its empty lines",
        )
    segment = contents[0]
    data = np.atleast_2d(np.asarray(segment["data"], dtype=np.float64))
    titles = [str(title).strip() for title in segment["Channel names"]]
    kept = [index for index, title in enumerate(titles[: data.shape[1]]) if title != "Comment"]
    names = unique([titles[index] or f"c{index + 1}" for index in kept])
    with_time = titles[0] == "X_Value"
    units = segment.get("Y_Unit_Label", [])
    steps = [float(step) for step in segment.get("Delta_X", []) if step == step and step > 0]
    fs = 1.0 / steps[0] if steps and len(set(steps)) == 1 else None
    starts = [float(start) for start in segment.get("X0", []) if start == start]
    columns = []
    for name, index in zip(names, kept, strict=True):
        reading = index - 1 if with_time else index
        unit = "s" if with_time and index == 0 else (units[reading] if 0 <= reading < len(units) else "")
        columns.append(Column(name, str(unit).strip() or None, len(data), fs, starts[0] if starts else 0.0))
    promised = max((int(count) for count in segment.get("Samples", []) if count == count), default=0)
    if promised > len(data):
        fewer = f"the header states {promised} samples of each channel and {len(data)} are there"
        cut = f"{fewer}; {cut}" if cut else fewer
    arrays = {name: data[:, index] for name, index in zip(names, kept, strict=True)}
    return Table(tuple(columns), slices(arrays), cut=cut)
