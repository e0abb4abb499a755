"""ROS bags, .bag of ROS 1 and .db3 of ROS 2: the numbers of every topic on the clock of the joints' states."""

from __future__ import annotations

import sqlite3
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any
from urllib.parse import quote

from stickslip.files.messages import Message, joined, streams_of
from stickslip.files.table import Options, Table, optional, reading

NAME = "ROS bag"
SUFFIXES = (".bag", ".db3")
FIRST, SECOND = b"#ROSBAG V2.0", b"SQLite format 3\0"  # as files of ROS 1 and of ROS 2 begin
DEFINED = "SELECT topic_type, encoded_message_definition FROM message_definitions WHERE encoding = 'ros2msg'"

Decode = Callable[[bytes], Any]


def recognise(path: Path, head: bytes) -> bool:
    """By the mark at the start; a database is ROS's by its suffix."""
    return head.startswith(FIRST) or (head.startswith(SECOND) and path.suffix.lower() == ".db3")


def read(path: Path, options: Options) -> Table:
    """The numbers of the topics; what other topics say is read as last heard."""
    left_out: dict[str, str] = {}
    with reading(path, NAME):
        with path.open("rb") as file:
            first = file.read(len(FIRST)) == FIRST
        streams = streams_of(path, (_first if first else _second)(path, left_out))
    return joined(path, streams, [f"{topic} ({reason}) is left out" for topic, reason in left_out.items()])


def decoder(kind: str, definition: str | None, *, first: bool = False) -> Decode | None:
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


def _first(path: Path, left_out: dict[str, str]) -> Iterator[Message]:
    """The messages of a bag of ROS 1."""
    with optional("rosbags.rosbag1", extra="logs").Reader(path) as bag:
        known = {one.id: decoder(one.msgtype, one.msgdef.data, first=True) for one in bag.connections}
        for connection, heard, data in bag.messages():
            if decode := known[connection.id]:
                yield connection.topic, heard, decode(data)
            else:
                left_out[connection.topic] = connection.msgtype


def _second(path: Path, left_out: dict[str, str]) -> Iterator[Message]:
    """The messages of a bag of ROS 2, opened so that nothing beside it is read or written."""
    address = f"file:{quote(str(path.absolute()))}?mode=ro&immutable=1"
    with closing(sqlite3.connect(address, uri=True)) as bag:
        tables = {name for (name,) in bag.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
        defined = dict(bag.execute(DEFINED)) if "message_definitions" in tables else {}
        topics = {number: (name, kind) for number, name, kind in bag.execute("SELECT id, name, type FROM topics")}
        known = {number: decoder(kind, defined.get(kind)) for number, (_, kind) in topics.items()}
        for number, heard, data in bag.execute("SELECT topic_id, timestamp, data FROM messages ORDER BY timestamp"):
            topic, kind = topics[number]
            if decode := known[number]:
                yield topic, heard, decode(data)
            else:
                left_out[topic] = kind
