"""JSON: rows, objects or arrays of numbers, with what is said of rate and units beside them; SEP 005."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from itertools import zip_longest
from pathlib import Path
from typing import Any

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import FormatError
from stickslip.files.table import Budget, Column, Options, Table, slices, unique

NAME = "JSON"
SUFFIXES = (".json",)


def recognise(path: Path, head: bytes) -> bool:
    """By suffix, or by the first sign of a JSON text."""
    text = head.lstrip(b"\xef\xbb\xbf \t\r\n")
    return text[:1] in (b"{", b"[") and (path.suffix.lower() in SUFFIXES or text[1:].lstrip()[:1] in (b'"', b"{", b"["))


def read(path: Path, options: Options) -> Table:
    """The columns of numbers in a JSON file."""
    try:
        contents = json.loads(path.read_text(encoding="utf-8-sig"))
    except (ValueError, RecursionError) as error:
        raise FormatError(
            f"'{path.name}' is damaged ({str(error)[:80]})", "JSON is needed", "check the file"
        ) from error
    if _is_sep005(contents):
        return _sep005(contents)
    about = contents if isinstance(contents, Mapping) else {}
    arrays = _columns(contents, about, Budget.of(path))
    if not arrays:
        raise FormatError(
            f"'{path.name}' holds no columns of numbers",
            "rows under a key 'data', arrays by name, or a list of objects are needed",
            "name the arrays in one object: {'t': [...], 'x': [...]}",
        )
    fs = _rate(about)
    stated = about.get("units")
    units = stated if isinstance(stated, Mapping) else {}
    columns = []
    for key, values in arrays.items():
        written = units.get(key) or about.get(f"{key}_unit") or about.get(f"{key} unit")
        columns.append(Column(key, str(written) if written else None, len(values), fs))
    notes = tuple(f"{key}: {value}" for key, value in about.items() if "unit" in key.lower() and isinstance(value, str))
    constants = {
        key: float(value) for key, value in about.items() if type(value) in (int, float) and abs(value) < 1e300
    }
    return Table(tuple(columns), slices(arrays), constants, notes, cut=_cut(about, arrays))


def _columns(contents: Any, about: Mapping[str, Any], budget: Budget) -> dict[str, Array]:
    """Arrays by name, whatever way round they stand."""
    if isinstance(contents, Mapping):
        arrays = _arrays({str(key): value for key, value in contents.items()})
        inner = contents.get("data")
        return arrays if arrays or inner is None or isinstance(inner, str) else _columns(inner, about, budget)
    if not isinstance(contents, Sequence) or isinstance(contents, str) or not contents:
        return {}
    if all(isinstance(row, Mapping) for row in contents):
        keys = dict.fromkeys(str(key) for row in contents for key in row)
        budget.require(len(keys) * len(contents))
        return _arrays({key: [row.get(key) for row in contents] for key in keys})
    if all(isinstance(row, list) for row in contents):
        budget.require(len(contents) * max(map(len, contents)))
        columns = list(zip_longest(*contents))
        titles = about.get("columns") or about.get("names") or about.get("channels")
        if not isinstance(titles, list) or len(titles) != len(columns):
            titles = [f"c{index + 1}" for index in range(len(columns))]
        names = unique([str(title) for title in titles])
        return _arrays({name: list(column) for name, column in zip(names, columns, strict=True)})
    return {}


def _arrays(columns: Mapping[str, Any]) -> dict[str, Array]:
    """Those columns that are numbers."""
    return {name: array for name, values in columns.items() if (array := _numbers(values)) is not None}


def _numbers(value: Any) -> Array | None:
    """A list of numbers and nulls as an array; None for anything else."""
    if not isinstance(value, list) or not value or all(item is None for item in value):
        return None
    if not all(item is None or type(item) in (int, float) for item in value):
        return None
    try:
        return np.array([np.nan if item is None else float(item) for item in value])
    except OverflowError:  # whole numbers of JSON know no largest
        return None


def _rate(about: Mapping[str, Any]) -> float | None:
    """The sampling rate [Hz] that the object states."""
    for key, value in about.items():
        word = re.sub(r"[^a-z]", "", key.lower())
        if type(value) not in (int, float) or not 0 < value < 1e15:
            continue
        if word in ("fs", "fshz") or word.startswith(("samplingfreq", "samplingrate", "samplefreq", "samplerate")):
            return float(value)
        if word in ("dt", "deltat", "samplinginterval", "timestep"):
            return 1.0 / float(value)
    return None


def _cut(about: Mapping[str, Any], arrays: Mapping[str, Array]) -> str:
    """What is missing where the object states more samples than it holds."""
    longest = max(map(len, arrays.values()))
    for key, value in about.items():
        word = re.sub(r"[^a-z]", "", key.lower())
        if word in ("samples", "nsamples", "numsamples", "rows", "nrows") and type(value) is int and value > longest:
            return f"{key} states {value} samples and {longest} are there"
    return ""


def _is_sep005(contents: Any) -> bool:
    channels = contents if isinstance(contents, list) else [contents]
    return bool(channels) and all(
        isinstance(channel, Mapping) and "data" in channel and "fs" in channel and "unit_str" in channel
        for channel in channels
    )


def _sep005(contents: Any) -> Table:
    """The channel dictionaries of SDyPy's SEP 005."""
    channels = contents if isinstance(contents, list) else [contents]
    names = unique([str(channel.get("name") or f"c{index}") for index, channel in enumerate(channels, 1)])
    columns, arrays = [], {}
    for name, channel in zip(names, channels, strict=True):
        values = _numbers(channel["data"])
        if values is None or type(channel["fs"]) not in (int, float) or not 0 < channel["fs"] < 1e15:
            raise FormatError(
                f"channel {name} holds no numbers or no rate",
                "SEP 005 gives data and a positive fs as numbers",
                "write the file again",
            )
        arrays[name] = values
        columns.append(Column(name, str(channel["unit_str"]) or None, len(values), float(channel["fs"])))
    return Table(tuple(columns), slices(arrays))
