"""A map on disk that a kill does not harm: each block is written once and whole, and what is missing is told."""

from __future__ import annotations

import hashlib
import os
import shutil
import uuid
import warnings
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stickslip.errors import ModelError, SolveError
from stickslip.sweeps.measures import LOG
from stickslip.sweeps.plan import Plan, assemble, required

DONE = "done"
"""Name of the array that tells, block by block, what is finished."""


class Store(AbstractContextManager["Store"]):
    """A plan's answers in a Zarr group, one chunk a block, each with its checksum.

    The group is laid out whole before the first block; each chunk comes to its place in one move of a file, and a block
    is marked as done when its chunks stand. So a kill leaves a store that goes on, and ends with the same bytes.

    Raises
    ------
    ModelError
        The path holds something else, or the map of other settings.
    SolveError
        zarr is not installed, another process writes there, or the disk can not be written.
    """

    def __init__(self, path: str | Path, plan: Plan) -> None:
        self.path, self.plan = Path(path), plan
        self._zarr = required("zarr")
        self._new = not self.path.exists()
        with self._on_disk():
            if self._new:
                self._lay_out()
            self._lock = _locked(self.path)
        try:
            self._group = self._own()
            self._clean()
            self._done = self._group[DONE][...]
            self._doubt()
        except BaseException:
            os.close(self._lock)
            raise

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is not None and self._new and not self._done.any():
            shutil.rmtree(self.path, ignore_errors=True)  # a sweep that could not begin leaves nothing
            shutil.rmtree(self.events, ignore_errors=True)
        os.close(self._lock)

    @property
    def missing(self) -> list[int]:
        """Numbers of the blocks that are still to be run."""
        return [int(number) for number in np.flatnonzero(~self._done)]

    def keep(
        self, number: int, arrays: Mapping[str, NDArray[Any]], events: Mapping[str, NDArray[Any]] | None = None
    ) -> None:
        """Write a block, and then that it is done."""
        place = self.plan.slices(number)
        with self._on_disk():
            if events is not None:
                self._keep_events(number, events)
            for name, values in arrays.items():
                self._group[name][place] = values
            self._done[number] = True
            self._group[DONE][...] = self._done

    def dataset(self, status: str = "complete") -> Any:
        """All that is written; what is missing has the fill value."""
        return assemble(self.plan, {name: self._group[name][...] for name in self.plan.variables}, status=status)

    @property
    def events(self) -> Path:
        """The folder of the events, a Parquet file a block."""
        return self.path.with_name(f"{self.path.name}.events")

    def _lay_out(self) -> None:
        """The whole group without blocks, made beside its place and moved there."""
        zarr, plan = self._zarr, self.plan
        frame = assemble(plan, {})
        del frame.attrs["status"]  # the array of blocks says it, at any moment
        draft = self.path.with_name(f".{self.path.name}.{uuid.uuid4().hex}")
        self.path.parent.mkdir(parents=True, exist_ok=True)
        try:
            with warnings.catch_warnings():
                warnings.filterwarnings("ignore", message=".*Zarr V3 specification.*")  # axes of words
                frame.to_zarr(draft, zarr_format=3, consolidated=False)
            group = zarr.open_group(draft, mode="r+")
            for name, variable in plan.variables.items():
                array = self._array(group, name, plan.shape, plan.chunks, variable.dtype, variable.fill, plan.dims)
                array.attrs.update({"units": variable.unit, "long_name": variable.words, **variable.attributes})
            count = len(plan.blocks)
            self._array(group, DONE, (count,), (count,), bool, False, ("block",))[...] = False
            if LOG in plan.measures and self.events.exists():
                raise ModelError(
                    f"{self.events} is there, but its map {self.path} is not",
                    "events lie beside the map that they are of", "move that folder away, or name another path",
                )  # fmt: skip
            os.rename(draft, self.path)
        finally:
            shutil.rmtree(draft, ignore_errors=True)

    def _array(
        self, group: Any, name: str, shape: Any, chunks: Any, dtype: Any, fill: Any, dims: tuple[str, ...]
    ) -> Any:
        from zarr import codecs

        return group.create_array(
            name, shape=shape, chunks=chunks, dtype=dtype, fill_value=fill, dimension_names=dims,
            compressors=(codecs.ZstdCodec(), codecs.Crc32cCodec()), config={"write_empty_chunks": True},
        )  # fmt: skip

    def _own(self) -> Any:
        """The group, where it is the one of this plan."""
        try:
            group = self._zarr.open_group(self.path, mode="r+")
            found = group.attrs["checksum"]
        except (FileNotFoundError, FileExistsError, KeyError, NotADirectoryError) as error:
            raise ModelError(
                f"{self.path} is not a map of ours", "a store is a folder that sweep() has made", "name another path"
            ) from error
        if found != self.plan.checksum:
            raise ModelError(
                f"{self.path} holds the map of {_difference(dict(group.attrs), self.plan.attributes)}",
                "a store holds the map of one set of settings",
                "name another path, or ask with the settings of that map",
            )
        return group

    def _clean(self) -> None:
        """Remove what a kill has left half written."""
        for part in [*self.path.rglob("*.partial"), *self.events.glob("*.partial")]:
            part.unlink()

    def _doubt(self) -> None:
        """Ask again for the blocks whose bytes are not what was written."""
        for number in np.flatnonzero(self._done):
            place = self.plan.slices(int(number))
            if LOG in self.plan.measures and not self._stand(int(number)):
                self._done[number] = False
            try:
                for name in self.plan.variables:
                    self._group[name][place]
            except (ValueError, RuntimeError):  # a checksum or a frame that does not fit
                self._done[number] = False

    def _stand(self, number: int) -> bool:
        """Whether the events of a block are, to the byte, what was written."""
        whole = self._events_of(number)
        seal = self._seal_of(number)
        return whole.exists() and seal.exists() and seal.read_text() == _sha256(whole)

    def _seal_of(self, number: int) -> Path:
        """The checksum of a block's events: hidden, so that readers of the folder find tables alone."""
        return self.events / f".{number:08d}.sha256"

    def _events_of(self, number: int) -> Path:
        return self.events / f"{number:08d}.parquet"

    def _keep_events(self, number: int, events: Mapping[str, NDArray[Any]]) -> None:
        table = required("pyarrow").table(dict(events))
        self.events.mkdir(exist_ok=True)
        whole = self._events_of(number)
        part = whole.with_suffix(".partial")
        required("pyarrow.parquet").write_table(table, part)
        self._seal_of(number).write_text(_sha256(part))
        os.replace(part, whole)

    @contextmanager
    def _on_disk(self) -> Iterator[None]:
        """A disk that can not be written, told in one sentence."""
        try:
            yield
        except OSError as error:
            raise SolveError(
                f"{self.path} can not be written: {error.strerror or error}",
                "what was kept before stays whole",
                "make room or choose another path, and call again: it goes on where it stopped",
            ) from error


def _locked(path: Path) -> int:
    """The folder, opened and locked: the lock goes with the process, however that ends."""
    try:
        import fcntl
    except ImportError:  # Windows locks no folder, and opens none
        return os.open(os.devnull, os.O_RDONLY)
    handle = os.open(path, os.O_RDONLY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        os.close(handle)
        raise SolveError(
            f"{path} is being written by another process", "a map has one writer", "wait for it, or name another path"
        ) from error
    return handle


def _sha256(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _difference(there: Mapping[str, Any], here: Mapping[str, Any]) -> str:
    """Which settings of two maps differ, in words."""
    names = [name for name in sorted({*there, *here} - {"checksum"}) if there.get(name) != here.get(name)]
    told = [f"{name} = {there.get(name)} (asked: {here.get(name)})" for name in names]
    return "; ".join(told) if told else "other settings"
