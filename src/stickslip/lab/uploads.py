"""Files that a page sends, kept under names of ours in a folder of this run until they are not needed."""

from __future__ import annotations

import asyncio
import re
import secrets
import time
from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass
from pathlib import Path

from starlette.exceptions import HTTPException

LARGEST = 2 << 30  # bytes of one file
ALTOGETHER = 8 << 30  # bytes of all that are kept at a time
AT_ONCE = 1 << 20  # bytes written in one go, away from the event loop
UNUSED = 3600.0  # seconds after which a file that nobody asks about is removed
LONGEST_LABEL = 120


@dataclass(frozen=True)
class Upload:
    """A file that was sent: under which name it is kept, what its sender calls it, and how many bytes it has."""

    key: str
    label: str
    path: Path
    size: int


class Uploads:
    """The files of this run; no name that a page sends becomes a path."""

    def __init__(self, folder: Path, *, largest: int = LARGEST, altogether: int = ALTOGETHER) -> None:
        self.folder, self.largest, self.altogether = folder, largest, altogether
        self._kept: dict[str, Upload] = {}
        self._used: dict[str, float] = {}
        self._size = 0  # of what is kept, and of what is coming

    async def receive(self, chunks: AsyncIterator[bytes], *, label: str, stated: int = 0) -> Upload:
        """Write a body to disk as it comes; one that is too large ends there, and nothing of it stays."""
        key, path = self._place(label)
        self._require_room(stated, stated)
        size = 0
        try:
            with path.open("xb") as file:
                async for some in _in_pieces(chunks):
                    size += len(some)
                    self._size += len(some)
                    self._require_room(size)
                    await asyncio.to_thread(file.write, some)
            if not size:
                raise HTTPException(400, "The file is empty; a record has at least one row; choose another file.")
        except BaseException as error:
            self._size -= size
            path.unlink(missing_ok=True)
            if isinstance(error, OSError):
                raise HTTPException(
                    507, f"The file can not be kept ({error.strerror}); make room on the disk."
                ) from error
            raise
        return self._keep(Upload(key, _shown(label), path, size))

    async def write(self, writer: Callable[[Path], None], *, label: str) -> Upload:
        """Keep a file that the lab itself writes."""
        key, path = self._place(label)
        try:
            await asyncio.to_thread(writer, path)
            size = path.stat().st_size
            self._require_room(size, size)
        except BaseException:
            _remove(path)
            raise
        self._size += size
        return self._keep(Upload(key, label, path, size))

    def get(self, key: str) -> Upload:
        """The file of that key, which is then not unused."""
        if key not in self._kept:
            raise HTTPException(404, "This file is not here (any more); drop it again.")
        self._used[key] = time.monotonic()
        return self._kept[key]

    def remove(self, key: str) -> None:
        """Remove a file, at once and for good."""
        upload = self.get(key)
        del self._kept[key], self._used[key]
        self._size -= upload.size
        _remove(upload.path)

    def remove_unused(self, *, before: float) -> None:
        """Remove what nobody asked about since that time."""
        for key in [key for key, used in self._used.items() if used < before]:
            self.remove(key)

    def _place(self, label: str) -> tuple[str, Path]:
        # its own ending only helps the readers, who go by what is in it
        key, ending = secrets.token_hex(16), f".{label.rpartition('.')[2].strip().lower()}"
        ending = ending if re.fullmatch(r"\.[a-z0-9]{1,8}", ending) else ".dat"
        return key, self.folder / f"{key}{ending}"

    def _keep(self, upload: Upload) -> Upload:
        self._kept[upload.key] = upload
        self._used[upload.key] = time.monotonic()
        return upload

    def _require_room(self, size: int, more: int = 0) -> None:
        """Refuse a file of `size` bytes, `more` of which have not been counted yet."""
        if size > self.largest:
            sentence = (
                f"The file is larger than {_in_bytes(self.largest)}; the lab takes no more; use the command line."
            )
            raise HTTPException(413, sentence)
        if self._size + more > self.altogether:
            sentence = f"The files here would be larger than {_in_bytes(self.altogether)} together; remove some first."
            raise HTTPException(413, sentence)


def _remove(path: Path) -> None:
    """Remove a file, and what was written beside it."""
    for leftover in path.parent.glob(f"{path.name}*"):
        leftover.unlink(missing_ok=True)


async def _in_pieces(chunks: AsyncIterator[bytes]) -> AsyncIterator[bytes]:
    """The chunks in pieces worth a write."""
    piece = bytearray()
    while True:
        chunk = await anext(chunks, None)
        piece += chunk or b""
        if piece and (chunk is None or len(piece) >= AT_ONCE):
            yield bytes(piece)
            piece.clear()
        if chunk is None:
            return


def _shown(label: str) -> str:
    """A name as it may be shown: its last part, without signs that can not be seen."""
    name = "".join(sign for sign in label.replace("\\", "/").rpartition("/")[2] if sign.isprintable()).strip()
    return name[-LONGEST_LABEL:] or "file"


def _in_bytes(size: int) -> str:
    return f"{size / (1 << 20):g} MiB"
