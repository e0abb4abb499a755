"""What goes to the page in one message: a few words as JSON, and arrays as they lie in memory."""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping
from typing import Any

import numpy as np

EDGE = 8  # bytes: where arrays of doubles may begin
KINDS = {"f": "<f8", "i": "<i4", "u": "u1"}


def frame(header: Mapping[str, Any], arrays: Mapping[str, Any] | None = None) -> bytes:
    """Length of the header, the header, and the arrays that it names, each on an edge of eight bytes."""
    kept = {name: np.ascontiguousarray(values) for name, values in (arrays or {}).items()}
    kept = {name: values.astype(KINDS[values.dtype.kind], copy=False) for name, values in kept.items()}
    table = [[name, KINDS[values.dtype.kind], values.size] for name, values in kept.items()]
    text = json.dumps({**header, "arrays": table}, ensure_ascii=False, allow_nan=False).encode()
    text += b" " * (-(len(text) + 4) % EDGE)
    bodies = (values.tobytes() for values in kept.values())
    return b"".join([struct.pack("<I", len(text)), text, *(body + bytes(-len(body) % EDGE) for body in bodies)])


def unframed(message: bytes) -> tuple[dict[str, Any], dict[str, Any]]:
    """The header and the arrays of a message, as the page reads them."""
    (length,) = struct.unpack_from("<I", message)
    header = json.loads(message[4 : 4 + length])
    arrays, place = {}, 4 + length
    for name, kind, size in header.pop("arrays"):
        arrays[name] = np.frombuffer(message, kind, size, place)
        place += arrays[name].nbytes + -arrays[name].nbytes % EDGE
    return header, arrays
