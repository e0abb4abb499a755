"""MCAP: messages of ROS 1 and 2 and of JSON, on the clock of the joints' states."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from stickslip.files.rosbag import Decode, Message, decoder, joined, streams_of
from stickslip.files.table import Options, Table, optional, reading

NAME = "MCAP"
SUFFIXES = (".mcap",)


def recognise(path: Path, head: bytes) -> bool:
    """By the mark at the start."""
    return head.startswith(b"\x89MCAP")


def read(path: Path, options: Options) -> Table:
    """The numbers of the topics; what other topics say is read as last heard."""
    left_out: dict[str, str] = {}
    with reading(path, NAME):
        streams = streams_of(path, _messages(path, left_out))
    return joined(path, streams, [f"{topic} ({reason}) is left out" for topic, reason in left_out.items()])


def _messages(path: Path, left_out: dict[str, str]) -> Iterator[Message]:
    known: dict[int, Decode | None] = {}
    with path.open("rb") as file:
        for schema, channel, message in optional("mcap.reader", extra="logs").make_reader(file).iter_messages():
            if channel.id not in known:
                known[channel.id] = _decoder(channel.message_encoding, schema)
            if decode := known[channel.id]:
                yield channel.topic, message.log_time, decode(message.data)
            else:
                left_out[channel.topic] = channel.message_encoding


def _decoder(encoding: str, schema: Any) -> Decode | None:
    if encoding == "json":
        return json.loads
    if schema is None or (encoding, schema.encoding) not in (("cdr", "ros2msg"), ("ros1", "ros1msg")):
        return None
    return decoder(schema.name, schema.data.decode(), first=encoding == "ros1")
