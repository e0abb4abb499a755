"""UFF: universal files, data set 58 (function at nodal degree of freedom), ASCII and binary."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import FormatError, RecordError
from stickslip.files.table import Budget, Column, Options, Table, optional, reading, slices, unique
from stickslip.record.clock import roundest
from stickslip.units import parse_unit

NAME = "UFF58"
SUFFIXES = (".uff", ".unv", ".uf", ".58", ".bunv")

TIME, FREQUENCY, ACCELERATION = 17, 18, 12  # specific data types of records 8 and 9
OVER_TIME = (0, 1)  # function types: general, time response
FUNCTIONS = {
    2: "auto spectrum", 3: "cross spectrum", 4: "frequency response function", 5: "transmissibility", 6: "coherence",
    7: "auto correlation", 8: "cross correlation", 9: "power spectral density", 10: "energy spectral density",
    12: "spectrum", 24: "shock response spectrum", 27: "order function",
}  # fmt: skip
DIRECTIONS = {1: "+X", -1: "-X", 2: "+Y", -2: "-Y", 3: "+Z", -3: "-Z"}
ORDINATE = 10  # line of a data set, from its "-1", that describes the ordinate (record 9)


@dataclass(frozen=True)
class DataSet:
    """One data set between its "-1" lines."""

    number: int
    binary: bool
    header: list[bytes]


def recognise(path: Path, head: bytes) -> bool:
    """By a first line of "-1" in six columns, and the number of a data set."""
    return re.match(rb"\s*? {4}-1\s*\r?\n\s*\d{1,5}b?[\s\d]*\r?\n", head) is not None


def read(path: Path, options: Options) -> Table:
    """Each data set over time is a column; spectra are left out, or refused where nothing else is there.

    Names come from the response (entity, or node and direction); where these repeat, from the first line.
    """
    pyuff = optional("pyuff")
    sets = list(_data_sets(path, path.read_bytes()))
    Budget.of(path).require_columns(len(sets))  # each set is opened and parsed by itself
    with reading(path, NAME):
        file = pyuff.UFF(str(path))
        numbers = [int(number) for number in file.get_set_types()]
    if numbers != [data_set.number for data_set in sets]:
        raise FormatError(
            f"'{path.name}' holds data sets {[d.number for d in sets]}, of which {numbers} can be told apart",
            "each data set stands between two lines of -1",
            "export the file again, in ASCII",
        )
    kept: list[dict[str, Any]] = []
    left_out: list[str] = []
    notes: list[str] = []
    cut: list[str] = []
    for index, data_set in enumerate(sets):
        if data_set.number != 58:
            continue
        with reading(path, NAME):
            values = file.read_sets(index)
        reason = _not_over_time(values)
        if reason is not None:
            left_out.append(f"set {index + 1} '{values.get('id1', '')}' ({reason})")
            continue
        fewer = len(values["data"]) < values["num_pts"]
        (cut if fewer else notes).extend(_check_length(path, index, values))
        values["ordinate_axis_units_lab"] = _unit_label(values, data_set.header)
        kept.append(values)
    if left_out:
        notes.append(f"functions not over time, left out: {', '.join(left_out)}")
    if not kept:
        raise FormatError(
            f"'{path.name}' holds no function over time ({', '.join(left_out) or 'no data set 58'})",
            "a record is channels over time",
            "export the time histories",
        )
    columns: list[Column] = []
    arrays: dict[str, Array] = {}
    for name, values in zip(_names(kept), kept, strict=True):
        for column, samples in _columns(name, values):
            columns.append(column)
            arrays[column.name] = samples
    return Table(tuple(columns), slices(arrays), notes=tuple(notes), cut="; ".join(cut))


def _columns(name: str, values: dict[str, Any]) -> Iterator[tuple[Column, Array]]:
    samples = np.asarray(values["data"], dtype=np.float64)
    unit, over = _stated(values["ordinate_axis_units_lab"]), _stated(values["abscissa_axis_units_lab"]) or "s"
    if unit == "g" and values["ordinate_spec_data_type"] == ACCELERATION:
        unit = "g0"
    if values["abscissa_spacing"] == 0:
        yield Column(f"{name} time", over, len(samples)), np.asarray(values["x"], dtype=np.float64)
        yield Column(name, unit, len(samples)), samples
        return
    scale = _seconds(over)
    step, start = values["abscissa_inc"] * scale, values["abscissa_min"] * scale
    usable = math.isfinite(step) and step > 0 and math.isfinite(start)
    yield Column(name, unit, len(samples), _rate(step) if usable else None, start if usable else 0.0), samples


def _rate(step: float) -> float:
    """The roundest rate whose interval the format, which has six digits for it, writes as `step` [s]."""
    return roundest(step, 0.500001 * 10.0 ** (math.floor(math.log10(step)) - 5))


def _seconds(unit: str) -> float:
    try:
        return parse_unit(unit, expect="s").scale
    except RecordError:
        return 1.0  # a label, not a unit: the format's own unit of time is the second


def _not_over_time(values: dict[str, Any]) -> str | None:
    kind, abscissa = values["func_type"], values["abscissa_spec_data_type"]
    if np.iscomplexobj(values["data"]):
        return FUNCTIONS.get(kind, "complex")
    if abscissa == FREQUENCY or values["abscissa_axis_units_lab"].strip().lower() in ("hz", "1/s", "rpm"):
        return FUNCTIONS.get(kind, "over frequency")
    if abscissa == TIME or kind in OVER_TIME:
        return None
    return FUNCTIONS.get(kind, f"function type {kind}")


def _check_length(path: Path, index: int, values: dict[str, Any]) -> list[str]:
    promised, present = values["num_pts"], len(values["data"])
    if present == 0 or (values["binary"] and present < promised):
        raise FormatError(
            f"set {index + 1} of '{path.name}' holds {present} of {promised} values",
            "a data set is read whole or not at all",
            "export the file again",
        )
    if present > promised:
        values["data"], values["x"] = values["data"][:promised], values["x"][:promised]
    if present == promised:
        return []
    return [f"set {index + 1} promises {promised} values but its lines hold {present}; what is there was read"]


def _names(sets: list[dict[str, Any]]) -> list[str]:
    """The first way of naming that tells all sets apart."""
    ways = [[_response(values) or values["id1"] for values in sets], [values["id1"] for values in sets]]
    for names in ways:
        names = [_stated(name) or f"set {number}" for number, name in enumerate(names, 1)]
        if len(set(names)) == len(names):
            return names
    return unique([_stated(name) or f"set {number}" for number, name in enumerate(ways[0], 1)])


def _response(values: dict[str, Any]) -> str | None:
    entity = _stated(values["rsp_ent_name"])
    if entity:
        return entity
    if values["rsp_node"] > 0:
        return f"{values['rsp_node']}{DIRECTIONS.get(values['rsp_dir'], '')}"
    return _stated(values["ordinate_axis_lab"])


def _stated(text: str) -> str | None:
    """Nothing where the file says NONE."""
    text = text.strip()
    return text if text and text.upper() != "NONE" else None


def _unit_label(values: dict[str, Any], header: list[bytes]) -> str:
    """The ordinate's unit; pyuff knows UTF-8 alone, instruments write Latin-1."""
    label = str(values["ordinate_axis_units_lab"])
    return header[ORDINATE].decode("latin-1")[46:67].strip() if "�" in label else label


def _data_sets(path: Path, data: bytes) -> Iterator[DataSet]:
    """The data sets one after another; a set without its closing line is refused."""
    position, mark = 0, re.compile(rb"^ {4}-1[ \t]*\r?$", re.MULTILINE)
    while begin := mark.search(data, position):
        header: list[bytes] = []
        place = begin.start()
        for _ in range(13):
            end = data.find(b"\n", place)
            header.append(data[place : end if end >= 0 else len(data)])
            place = end + 1 if end >= 0 else len(data)
        kind = re.match(rb"\s*(\d+)(b?)", header[1])
        if kind is None:
            raise _damaged(path, begin.start(), "has no number")
        binary = bool(kind[2])
        after = place + _binary_bytes(header[1]) if binary else begin.end()
        close = _closing(data, after, place) if binary else mark.search(data, after)
        if close is None:
            raise _damaged(path, begin.start(), "has no closing line of -1: the file is cut off")
        yield DataSet(int(kind[1]), binary, header)
        position = close.end()


def _binary_bytes(line: bytes) -> int:
    """Field 6 of the line of a binary data set: the number of bytes that follow the header."""
    field = line[31:43].strip()
    return int(field) if field.isdigit() else 0


def _closing(data: bytes, expected: int, body: int) -> re.Match[bytes] | None:
    """The closing line where the stated length puts it; some writers state another length: then the next one."""
    mark = re.compile(rb"[\r\n]{0,2} {4}-1[ \t]*(?:\r?\n|\r?\Z)")
    return mark.match(data, expected) or mark.search(data, body)


def _damaged(path: Path, position: int, what: str) -> FormatError:
    return FormatError(
        f"the data set at byte {position} of '{path.name}' {what}",
        "a data set stands whole between two lines of -1",
        "copy or export the file again",
    )
