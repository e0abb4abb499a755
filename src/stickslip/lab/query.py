"""What a page asks: of which records, read how, with which options."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import stickslip as ss

if TYPE_CHECKING:
    from stickslip import Record
    from stickslip.rig import RigSettings

LONG = 1 << 26  # bytes of files from which a record is asked part by part
PART = 1 << 18  # rows of such a part
AS_WRITTEN = "a record as it was written"


@dataclass(frozen=True)
class Query:
    """What was asked: of which records, read how, with which options.

    Attributes
    ----------
    records : sequence of sequence of Path
        The files of each record.
    names : mapping of str to str
        What the users call a file, by our name of it.
    reading, options : mapping
        How the files are read; what the question is told.
    say : callable
        Told in words, and as a share of one, how far it is.
    """

    records: Sequence[Sequence[Path]]
    names: Mapping[str, str]
    reading: Mapping[str, Any]
    options: Mapping[str, Any]
    say: Callable[[str, float], None]

    @classmethod
    def of(cls, ask: Mapping[str, Any], say: Callable[[str, float], None]) -> Query:
        records = [[Path(path) for path in record] for record in ask["records"]]
        return cls(records, ask["names"], ask["reading"], ask["options"], say)

    def rig(self, number: int = 0) -> RigSettings:
        """The settings, with the normal load of one of the records."""
        known = set(ss.rig.RigSettings.model_fields)
        given = {name: value for name, value in {**self.reading, **self.options}.items() if name in known}
        loads = given.pop("normal", None)
        load = loads[number] if isinstance(loads, list) and number < len(loads) else None
        return ss.rig.rig_settings({**given, **({"normal": load} if load else {})}, source="the page")

    def record(self, number: int = 0) -> Record:
        """One of the records, whole, mended as asked."""
        rig, files = self.rig(number), self.records[number]
        read = ss.read_record(files, rows=rig.row_range(), **rig.reading())
        return ss.answers.mend(self.named(read, files), repairs=rig.repair)

    def parts(self, number: int = 0) -> Iterator[Record]:
        """One of the records in parts that fit into memory; whole if it is short, or rows or repairs are asked for."""
        rig, files = self.rig(number), self.records[number]
        if rig.rows or rig.repair or not self.is_long(number):
            yield self.record(number)
            return
        for part in ss.read_blocks(files, size=PART, **rig.reading()):
            yield self.named(part, files)

    def is_long(self, number: int) -> bool:
        return sum(path.stat().st_size for path in self.records[number]) > LONG

    def name(self, number: int) -> str:
        return " + ".join(self.names[path.name] for path in self.records[number])

    def named(self, record: Record, files: Sequence[Path]) -> Record:
        """The record, its history telling the users' own names of the files."""
        ours = {path.name for path in files}
        steps = [_renamed(step, self.names) for step in record.history]
        if not any(file["name"] in ours for step in record.history for file in step.arguments.get("files", ())):
            files_sent = [
                {"name": self.names[path.name]} for path in files
            ]  # as write_record left it: it names no file
            steps.append(ss.record.Step("read_record", {"files": files_sent}, AS_WRITTEN))
        return dataclasses.replace(record, history=tuple(steps))


def _renamed(step: ss.record.Step, names: Mapping[str, str]) -> ss.record.Step:
    files = [
        {key: names.get(value, value) if key == "name" else value for key, value in file.items() if key != "folder"}
        for file in step.arguments.get("files", ())
    ]
    return dataclasses.replace(step, arguments={**step.arguments, "files": files}) if files else step


def on_the_page(sentence: str) -> str:
    """A sentence with the page's fields for the arguments that it names to a Python user."""
    text = re.sub(r'channels=\{"(\w+)": "([^"]*)"\}', r"\1 in the table of channels", sentence)
    text = re.sub(r'\b(channel|method|restoring|contact)="(\w+)"', r"\1: \2", text)
    return re.sub(r"\b([a-z_]+)=(?=\W|$)", r'the field "\1"', text)
