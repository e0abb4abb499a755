"""A map on disk that neither a kill nor a damaged file harms: each block stands whole, as its seal says, or is run."""

from __future__ import annotations

import hashlib
import json
import os
import re
import warnings
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, suppress
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stickslip.errors import ModelError, SolveError
from stickslip.maps.measures import LOG
from stickslip.maps.plan import Plan, assemble, required
from stickslip.whole import NEW, lock_beside, locked, sync_all, workshop

DONE = "done"
"""Name of the array of the seals: of each block the checksum of its files, 0 where it is not finished."""
ROOT = "zarr.json"
PARTIAL = re.compile(r"(.+\.[0-9a-f]{32}|\d{8,})\.partial")  # what zarr, or this module, has not finished writing


class Store(AbstractContextManager["Store"]):
    """A plan's answers in a Zarr group, one chunk a block, each block with a seal over its files.

    The group is laid out whole before the first block; each chunk comes to its place in one move of a file, and a block
    is sealed when its chunks stand. So a kill leaves a store that goes on, and ends with the same bytes. What the plan
    alone decides (coordinates, metadata) is compared to the byte when a store is opened, and written again where it
    differs; a block whose files do not fit its seal is run again.

    Raises
    ------
    ModelError
        The path holds something else, or the map of other settings.
    SolveError
        zarr is not installed, another process writes there, or the disk can not be read or written.
    """

    def __init__(self, path: str | Path, plan: Plan) -> None:
        self.path, self.plan = Path(path), plan
        self._zarr = required("zarr")
        self._done, self._tried = np.zeros(len(plan.blocks), dtype=bool), False
        layout = self._layout()
        with self._on_disk():
            self._new = not self.path.exists() and self._lay_out(layout)
            lock = locked(self.path) if self.path.is_dir() else None
        if lock is None:
            raise self._written_by_another() if self.path.is_dir() else self._not_ours()
        with lock as ours:
            self._place = self.path.stat()
            if not self._new:
                self._require_own()
                with self._on_disk():
                    self._mend(layout)
            self._group = self._zarr.open_group(self.path, mode="r+")
            self._done[:] = [self._stands(number) for number in plan.blocks]
            self._lock = ours.pop_all()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with self._lock, self._on_disk():
            if error is not None and self._new and not self._tried and self._in_place():
                self._take_back()
            elif error is None:
                for folder in (self.path, self.events):
                    if folder.exists():
                        sync_all(folder)

    def _in_place(self) -> bool:
        """Whether the folder at the path is the one that is locked: it may have been removed, and begun anew."""
        try:
            return os.path.samestat(self.path.stat(), self._place)
        except OSError:
            return False

    @property
    def missing(self) -> list[int]:
        """Numbers of the blocks that are still to be run."""
        return [int(number) for number in np.flatnonzero(~self._done)]

    def keep(
        self, number: int, arrays: Mapping[str, NDArray[Any]], events: Mapping[str, NDArray[Any]] | None = None
    ) -> None:
        """Write a block, and then its seal."""
        place, self._tried = self.plan.slices(number), True
        if not self._in_place():
            raise SolveError(
                f"{self.path} was removed or replaced while it was written",
                "another process is writing there, or has moved it; its map is left alone",
                "wait for it, or name another path",
            )
        with self._on_disk():
            for path in (*self._files(number), self._seal_of(number)):
                _free(path)
            if events is not None:
                self._keep_events(number, events)
            for name, values in arrays.items():
                self._group[name][place] = values
            self._group[DONE][number] = self._seal(number)
        self._done[number] = True

    def dataset(self, status: str = "complete") -> Any:
        """All that is written; what is missing has the fill value."""
        return assemble(self.plan, {name: self._group[name][...] for name in self.plan.variables}, status=status)

    @property
    def events(self) -> Path:
        """The folder of the events, a Parquet file a block."""
        return self.path.with_name(f"{self.path.name}.events")

    def _layout(self) -> dict[str, bytes]:
        """Every file of the group before there is a block, by its place in it: the plan decides them all."""
        from zarr.storage import MemoryStore

        plan, files = self.plan, dict[str, Any]()
        frame = assemble(plan, {})
        del frame.attrs["status"]  # the seals say it, at any moment
        memory = MemoryStore(files)
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", message=".*Zarr V3 specification.*")  # axes of words
            frame.to_zarr(memory, zarr_format=3, consolidated=False)
        group = self._zarr.open_group(memory, mode="r+")
        for name, variable in plan.variables.items():
            array = self._array(group, name, plan.shape, plan.chunks, variable.dtype, variable.fill, plan.dims)
            array.attrs.update({"units": variable.unit, "long_name": variable.words, **variable.attributes})
        self._array(group, DONE, (len(plan.blocks),), (1,), np.uint64, 0, ("block",))
        return {name: contents.to_bytes() for name, contents in files.items()}

    def _lay_out(self, layout: Mapping[str, bytes]) -> bool:
        """Put the group without blocks in its place; whether nobody else did meanwhile."""
        if LOG in self.plan.measures and self.events.exists():
            raise ModelError(
                f"{self.events} is there, but its map {self.path} is not",
                "events lie beside the map that they are of",
                "move that folder away, or name another path",
            )
        self.path.parent.mkdir(parents=True, exist_ok=True)
        with workshop(self.path) as place:
            for name, contents in layout.items():
                _write(place / NEW / name, contents)
            sync_all(place / NEW)
            try:
                os.rename(place / NEW, self.path)
            except OSError:
                if not self.path.exists():
                    raise
                return False
        return True

    def _array(
        self, group: Any, name: str, shape: Any, chunks: Any, dtype: Any, fill: Any, dims: tuple[str, ...]
    ) -> Any:
        from zarr import codecs

        packed = () if name == DONE else (codecs.ZstdCodec(), codecs.Crc32cCodec())
        return group.create_array(
            name,
            shape=shape,
            chunks=chunks,
            dtype=dtype,
            fill_value=fill,
            dimension_names=dims,
            compressors=packed,
            config={"write_empty_chunks": True},
        )

    def _require_own(self) -> None:
        """Refuse the map of another plan: a block that stands under this one's seal shows that it is this one's."""
        try:
            there = json.loads((self.path / ROOT).read_bytes())["attributes"]
            own = there["checksum"] == self.plan.checksum
        except (OSError, ValueError, RecursionError, KeyError, TypeError):
            there, own = None, False
        if own or any(self._stands(number) for number in self.plan.blocks):
            return
        if there is None:
            raise self._not_ours()
        raise ModelError(
            f"{self.path} holds the map of {_difference(there, self.plan.attributes)}",
            "a store holds the map of one set of settings",
            "name another path, or ask with the settings of that map",
        )

    def _written_by_another(self) -> SolveError:
        left = lock_beside(self.path)
        return SolveError(
            f"another process is writing {self.path}",
            "a map has one writer",
            "wait for it, or name another path" + (f"; where it is gone, remove {left}" if left.exists() else ""),
        )

    def _not_ours(self) -> ModelError:
        return ModelError(
            f"{self.path} is not a map of ours, or its {ROOT} is damaged and no block is finished",
            "a store is a folder that sweep() has made",
            "name another path",
        )

    def _mend(self, layout: Mapping[str, bytes]) -> None:
        """Remove what a kill has left half written, and write again what is not as the plan has it."""
        for part in [*self.path.rglob("*.partial"), *self.events.glob("*.partial")]:
            if PARTIAL.fullmatch(part.name) and part.is_file():
                part.unlink()
        harmed = {name: contents for name, contents in layout.items() if _read(self.path / name) != contents}
        if harmed:
            with workshop(self.path) as place:
                for name, contents in harmed.items():
                    _write(place / NEW / name, contents)
                    _replace(place / NEW / name, self.path / name)

    def _take_back(self) -> None:
        """Remove what was laid out and no more: a sweep that could not begin leaves nothing."""
        for name in self._layout():
            (self.path / name).unlink(missing_ok=True)
        within = sorted((path for path in self.path.rglob("*") if path.is_dir()), reverse=True)
        for folder in (*within, self.path):
            with suppress(OSError):  # it is not empty, or not there
                folder.rmdir()

    def _files(self, number: int) -> list[Path]:
        """Where a block's files lie."""
        tile = [str(t) for t in np.unravel_index(number, self.plan.tiles)]
        files = [self.path.joinpath(name, "c", *tile) for name in self.plan.variables]
        return [*files, self._events_of(number)] if LOG in self.plan.measures else files

    def _seal(self, number: int) -> int:
        """A checksum of a block's files and of the plan that they are of, never 0."""
        sums = hashlib.sha256(self.plan.checksum.encode())
        for path in self._files(number):
            contents = _read(path)
            if contents is None:
                return 0
            sums.update(hashlib.sha256(contents).digest())
        return int.from_bytes(sums.digest()[:8], "little") | 1

    def _stands(self, number: int) -> bool:
        """Whether a block's files are, to the byte, what was sealed."""
        seal = self._seal(number)
        return seal != 0 and _read(self._seal_of(number)) == seal.to_bytes(8, "little")

    def _seal_of(self, number: int) -> Path:
        return self.path / DONE / "c" / str(number)

    def _events_of(self, number: int) -> Path:
        return self.events / f"{number:08d}.parquet"

    def _keep_events(self, number: int, events: Mapping[str, NDArray[Any]]) -> None:
        table = required("pyarrow").table(dict(events))
        self.events.mkdir(exist_ok=True)
        whole = self._events_of(number)
        part = whole.with_suffix(".partial")
        required("pyarrow.parquet").write_table(table, part)
        _replace(part, whole)

    @contextmanager
    def _on_disk(self) -> Iterator[None]:
        """A disk that can not be written, told in one sentence."""
        try:
            yield
        except OSError as error:
            raise SolveError(
                f"{error.filename2 or error.filename or self.path} can not be written: {error.strerror or error}",
                "what was kept before stays whole",
                "make room or choose another path, and call again: it goes on where it stopped",
            ) from error


def _read(path: Path) -> bytes | None:
    """A file's contents; None where there is no file that can be read."""
    try:
        return path.read_bytes()
    except OSError:
        return None


def _write(path: Path, contents: bytes) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(contents)


def _replace(draft: Path, path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    _free(path)
    os.replace(draft, path)


def _free(path: Path) -> None:
    """Remove an empty folder where a file belongs; one that holds something is somebody's."""
    if path.is_dir():
        path.rmdir()


def _difference(there: Mapping[str, Any], here: Mapping[str, Any]) -> str:
    """Which settings of two maps differ, in words."""
    names = [name for name in sorted({*there, *here} - {"checksum"}) if there.get(name) != here.get(name)]
    differences = [f"{name} = {there.get(name)} (asked: {here.get(name)})" for name in names]
    return "; ".join(differences) if differences else "other settings"
