"""MCAP: messages of ROS 1 and 2 and of JSON, on the clock of the joints' states."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from stickslip.files.rosbag import Decode, Heard, decoder, table_of
from stickslip.files.table import Options, Table, optional

NAME = "MCAP"
SUFFIXES = (".mcap",)


def recognise(path: Path, head: bytes) -> bool:
    """By the mark at the start."""
    return head.startswith(b"\x89MCAP")


def read(path: Path, options: Options) -> Table:
    """The numbers of the topics; what other topics say is read as last heard."""
    return table_of(path, NAME, _messages(path))


def _messages(path: Path) -> Iterator[Heard]:
    known: dict[int, Decode | None] = {}
    with path.open("rb") as file:
        for schema, channel, message in optional("mcap.reader", extra="logs").make_reader(file).iter_messages():
            if channel.id not in known:
                known[channel.id] = _decoder(channel.message_encoding, schema)
            yield channel.topic, channel.message_encoding, known[channel.id], message.log_time, message.data


def _decoder(encoding: str, schema: Any) -> Decode | None:
    if encoding == "json":
        return json.loads
    if schema is None or (encoding, schema.encoding) not in (("cdr", "ros2msg"), ("ros1", "ros1msg")):
        return None
    return decoder(schema.name, schema.data.decode(), first=encoding == "ros1")
