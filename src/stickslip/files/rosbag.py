"""Bags, .bag of ROS 1, .db3 and MCAP of ROS 2: the numbers of every topic on the clock of the joints' states.

The columns of topics become one table: what was heard last at each sample of the one clock. MDF joins alike."""

from __future__ import annotations

import dataclasses
import json
import sqlite3
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import FormatError
from stickslip.files.table import LISTED, Budget, Column, Options, Table, optional, reading, slices, unique

NAMES = ("name", "joint_names")  # of a message whose lists have one number for each joint
LATE = 0.1  # of the clock: a topic that is silent for longer at its beginning would cost these rows

NAME = "ROS bag or MCAP"
SUFFIXES = (".bag", ".db3", ".mcap")
FIRST, SECOND, MCAP = b"#ROSBAG V2.0", b"SQLite format 3\0", b"\x89MCAP"  # as files of ROS 1, of ROS 2 and MCAP begin
DEFINED = "SELECT topic_type, encoded_message_definition FROM message_definitions WHERE encoding = 'ros2msg'"

Decode = Callable[[bytes], Any]
Heard = tuple[str, str, Decode | None, int, bytes]  # topic, type, what reads it, when it was heard [ns], its bytes


@dataclass(frozen=True)
class Stream:
    """Columns with one clock of their own.

    Attributes
    ----------
    topic : str
        What they are called together.
    heard : ndarray, shape (n,)
        When each row was heard [s], on the clock of all streams.
    columns : mapping of str to ndarray
        Of n numbers each.
    stamps : ndarray or None
        When each row was measured [s] as the sender says, where it does.
    named : bool
        Whether the columns are called by the joints' own names.
    units : mapping of str to str
        Where the file states them.
    """

    topic: str
    heard: Array
    columns: Mapping[str, Array]
    stamps: Array | None = None
    named: bool = False
    units: Mapping[str, str] = dataclasses.field(default_factory=dict)


def _streams(path: Path, messages: Iterable[Heard]) -> tuple[list[Stream], dict[str, str]]:
    """The streams of messages, one for each topic and each set of numbers that it sends; and the types not read."""
    budget, cells = Budget.of(path), 0
    rows: dict[tuple[str, tuple[str, ...]], list[tuple[int, int, list[float]]]] = {}
    named, left_out = set(), dict[str, str]()
    for topic, kind, decode, heard, data in messages:
        if decode is None:
            left_out[topic] = kind
            continue
        message = decode(data)
        numbers = dict(_numbers(message))
        key = topic, tuple(numbers)
        rows.setdefault(key, []).append((heard, _stamp(message), list(numbers.values())))
        if _names(message):
            named.add(key)
        budget.require(cells := cells + len(numbers) + 2)
    first = min((part[0][0] for part in rows.values()), default=0)
    streams = []
    for (topic, names), part in rows.items():
        values = np.array([row for _, _, row in part], dtype=np.float64).reshape(len(part), len(names))
        stamps = np.array([stamp for _, stamp, _ in part], dtype=np.int64)
        times = _seconds(np.array([heard for heard, _, _ in part], dtype=np.int64) - first)
        own = _seconds(stamps - stamps[0]) if np.all(stamps > 0) else None
        columns = dict(zip(names, values.T, strict=True))
        streams.append(Stream(topic.strip("/"), times, columns, own, (topic, names) in named))
    return streams, left_out


def joined(path: Path, streams: Sequence[Stream], notes: Sequence[str] = ()) -> Table:
    """The table of all streams on the clock of one: that of the joints' states, else the one heard most often.

    A controller holds what it was told last, so that columns of others are read as last heard.
    """
    streams = [one for one in streams if one.columns and len(one.heard) > 1 and np.all(np.diff(one.heard) >= 0)]
    if not streams:
        raise FormatError(
            f"'{path.name}' holds no topic with two rows of numbers" + "".join(f"; {note}" for note in notes),
            "a record needs numbers over time",
            "export what was measured as CSV",
        )
    clock = max(streams, key=lambda one: (one.named, len(one.columns) if one.named else 0, len(one.heard)))
    latest = clock.heard[int(LATE * len(clock.heard))]
    kept = [stream for stream in streams if stream.heard[0] <= latest]
    begin = int(np.searchsorted(clock.heard, max(stream.heard[0] for stream in kept)))
    stamps = clock.stamps if clock.stamps is not None and np.all(np.diff(clock.stamps) > 0) else clock.heard
    arrays, columns = {"time": stamps[begin:]}, [Column("time", "s", len(stamps) - begin)]
    history = [f"the clock is that of {clock.topic}", *notes]
    for stream, names in zip(kept, _titles(kept), strict=True):
        rows = np.searchsorted(stream.heard, clock.heard[begin:], side="right") - 1
        if stream is not clock:
            history.append(f"{stream.topic} is read as last heard")
        for name, (own, values) in zip(names, stream.columns.items(), strict=True):
            arrays[name] = values[begin:] if stream is clock else values[rows]
            columns.append(Column(name, stream.units.get(own), len(rows)))
    history += [f"{stream.topic} is heard too late, left out" for stream in streams if stream.heard[0] > latest]
    return Table(tuple(columns), slices(arrays), notes=tuple(history))


def _titles(streams: Sequence[Stream]) -> list[list[str]]:
    """Of each stream its columns' names: those of joints as they are, others, and what clashes, after the topic."""
    often = Counter(name for stream in streams if stream.named for name in stream.columns)
    columns = [(stream, name) for stream in streams for name in stream.columns]
    named = [name if one.named and often[name] == 1 else f"{one.topic}/{name}" for one, name in columns]
    titles = iter(unique(["time", *named])[1:])
    return [[next(titles) for _ in stream.columns] for stream in streams]


def _fields(message: Any) -> dict[str, Any]:
    if isinstance(message, Mapping):
        return dict(message)
    if dataclasses.is_dataclass(message) and not isinstance(message, type):
        return {field.name: getattr(message, field.name) for field in dataclasses.fields(message)}
    return {}


def _names(message: Any) -> list[str]:
    """What the joints of a message are called."""
    fields = _fields(message)
    names = next((fields[name] for name in NAMES if name in fields), None)
    return list(names) if isinstance(names, list) and all(isinstance(name, str) for name in names) else []


def _numbers(message: Any, path: str = "", names: Sequence[str] = ()) -> Iterator[tuple[str, float]]:
    """Every number in a message, under the names of the fields that lead to it; of lists by joint or by place."""
    names = _names(message) or names
    if isinstance(message, (bool, int, float, np.number)):
        yield path, float(message)
    elif isinstance(message, (list, tuple, np.ndarray)) and len(message) <= LISTED:
        for place, value in enumerate(message):
            yield from _numbers(value, f"{path}.{names[place] if len(names) == len(message) else place}", names)
    for name, value in _fields(message).items():
        if name != "header":
            yield from _numbers(value, f"{path}.{name}" if path else name, names)


def _stamp(message: Any) -> int:
    """When a message was measured [ns], by its header; 0 where it does not say."""
    stamp = _fields(_fields(_fields(message).get("header")).get("stamp"))
    seconds, more = (stamp.get("sec", stamp.get("secs")), stamp.get("nanosec", stamp.get("nsec", stamp.get("nsecs"))))
    return seconds * 10**9 + more if isinstance(seconds, int) and isinstance(more, int) else 0


def _seconds(nanoseconds: np.ndarray[Any, Any]) -> Array:
    return np.asarray(nanoseconds * 1e-9, dtype=np.float64)


def recognise(path: Path, head: bytes) -> bool:
    """By the mark at the start; a database is ROS's by its suffix."""
    return head.startswith((FIRST, MCAP)) or (head.startswith(SECOND) and path.suffix.lower() == ".db3")


def read(path: Path, options: Options) -> Table:
    """The numbers of the topics; what other topics say is read as last heard."""
    with reading(path, NAME):
        streams, left_out = _streams(path, _messages(path))
    return joined(path, streams, [f"{topic} ({reason}) is left out" for topic, reason in left_out.items()])


def _decoder(kind: str, definition: str | None, *, first: bool = False) -> Decode | None:
    """What turns the bytes of a message into its fields; None for a type that nobody defines.

    A definition that stands in the file is parsed by its grammar; without one the type is looked up in ROS 2's own.
    """
    types = optional("rosbags.typesys", extra="logs")
    if definition:
        store = types.get_typestore(types.Stores.EMPTY)
        store.register(types.get_types_from_msg(definition, kind))
    else:
        store = types.get_typestore(types.Stores.LATEST)
    kind = kind if "/msg/" in kind else kind.replace("/", "/msg/")
    if kind not in store.fielddefs:
        return None
    decode = store.deserialize_ros1 if first else store.deserialize_cdr
    return lambda data: decode(data, kind)


def _messages(path: Path) -> Iterator[Heard]:
    with path.open("rb") as file:
        head = file.read(len(FIRST))
    return (_first if head == FIRST else _mcap if head.startswith(MCAP) else _second)(path)


def _mcap(path: Path) -> Iterator[Heard]:
    """The messages of an MCAP, of either ROS or in JSON."""
    known: dict[int, Decode | None] = {}
    with path.open("rb") as file:
        for schema, channel, message in optional("mcap.reader", extra="logs").make_reader(file).iter_messages():
            if channel.id not in known:
                known[channel.id] = _by_schema(channel.message_encoding, schema)
            yield channel.topic, channel.message_encoding, known[channel.id], message.log_time, message.data


def _by_schema(encoding: str, schema: Any) -> Decode | None:
    if encoding == "json":
        return json.loads
    if schema is None or (encoding, schema.encoding) not in (("cdr", "ros2msg"), ("ros1", "ros1msg")):
        return None
    return _decoder(schema.name, schema.data.decode(), first=encoding == "ros1")


def _first(path: Path) -> Iterator[Heard]:
    """The messages of a bag of ROS 1."""
    with optional("rosbags.rosbag1", extra="logs").Reader(path) as bag:
        known = {one.id: _decoder(one.msgtype, one.msgdef.data, first=True) for one in bag.connections}
        for connection, heard, data in bag.messages():
            yield connection.topic, connection.msgtype, known[connection.id], heard, data


def _second(path: Path) -> Iterator[Heard]:
    """The messages of a bag of ROS 2, opened so that nothing beside it is read or written."""
    address = f"file:{quote(str(path.absolute()))}?mode=ro&immutable=1"
    with closing(sqlite3.connect(address, uri=True)) as bag:
        tables = {name for (name,) in bag.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
        defined = dict(bag.execute(DEFINED)) if "message_definitions" in tables else {}
        topics = {number: (name, kind) for number, name, kind in bag.execute("SELECT id, name, type FROM topics")}
        known = {number: _decoder(kind, defined.get(kind)) for number, (_, kind) in topics.items()}
        for number, heard, data in bag.execute("SELECT topic_id, timestamp, data FROM messages ORDER BY timestamp"):
            topic, kind = topics[number]
            yield topic, kind, known[number], heard, data
