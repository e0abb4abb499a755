"""What is written to disk is there whole or not at all, whatever fails or is killed meanwhile.

A file or folder is made in a hidden folder beside its place, put on the disk itself, and then takes its place in one
step. What a killed process left in such a hidden folder is put right by the next that writes there.
"""

from __future__ import annotations

import errno
import os
import re
import shutil
import socket
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

NEW, WHOLE, EARLIER = "new", "whole", "earlier"  # in a hidden folder: being made, finished, and what was there before
LOCKLESS = {errno.ENOLCK, errno.ENOTSUP, errno.ENOSYS}  # of a disk that knows no locks
UNSYNCED = {errno.EINVAL, errno.ENOTSUP, errno.ENOSYS}  # of a disk that takes no sync of a folder
Strangers = Callable[[Path], Iterable[str]]  # the files in a folder that are somebody else's, relative to it


@contextmanager
def whole_file(path: Path, *, replace: bool = True) -> Iterator[Path]:
    """A path to write to that becomes `path` at the end, and vanishes at an error.

    Raises
    ------
    FileExistsError
        The file is there, and may not be replaced.
    OSError
        The disk can not be written.
    """
    with workshop(path) as place:
        draft = place / NEW / path.name
        yield draft
        sync(draft)
        _put(draft, path, replace)
        sync(path.parent)


@contextmanager
def whole_folder(folder: Path, *, strangers: Strangers) -> Iterator[Path]:
    """A folder to fill that takes the place of `folder` at the end, and vanishes at an error.

    What `strangers` names of the folder that is replaced stands in the new one: under its own name, or, where
    that is taken, with "earlier-" before it.

    Raises
    ------
    OSError
        The disk can not be written.
    """
    folder = Path(os.path.realpath(folder))
    folder.parent.mkdir(parents=True, exist_ok=True)
    with workshop(folder, strangers) as place:
        yield place / NEW
        sync_all(place / NEW)
        os.rename(place / NEW, place / WHOLE)
        if folder.exists():
            _carry(folder, place / WHOLE, strangers)
        if not (folder.exists() and exchange(place / WHOLE, folder)):
            if folder.exists():
                os.rename(folder, place / EARLIER)
            os.rename(place / WHOLE, folder)
        sync(folder.parent)


@contextmanager
def workshop(path: Path, strangers: Strangers | None = None) -> Iterator[Path]:
    """A hidden folder beside `path` with the folder "new" in it, removed at the end; what a kill left is put right."""
    _recover(path, strangers)
    while True:
        place = Path(tempfile.mkdtemp(dir=path.parent, prefix=f".{path.name}-", suffix=".part"))
        lock = locked(place)
        if lock is not None and place.exists():  # nobody took it for what a kill left
            break
    with lock:
        try:
            (place / NEW).mkdir()
            yield place
        finally:
            _clear(place, path, strangers)


def locked(folder: Path) -> ExitStack | None:
    """A folder locked until the stack is closed, or this process ends; None where another holds it.

    Raises
    ------
    OSError
        The folder can not be opened.
    """
    try:
        import fcntl
    except ImportError:
        return _locked_beside(folder)
    with ExitStack() as stack:
        handle = os.open(folder, os.O_RDONLY)
        stack.callback(os.close, handle)
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return None
        except OSError as error:
            if error.errno not in LOCKLESS:
                raise
            return _claimed(folder)
        return stack.pop_all()


def lock_beside(folder: Path) -> Path:
    """The file that locks a folder where folders themselves can not be."""
    return folder.with_name(f"{folder.name}.lock")


def _claimed(folder: Path) -> ExitStack | None:
    """The lock of a disk that knows none: a file beside, made by one process alone, which it names."""
    path, own = lock_beside(folder), f"{os.getpid()} {socket.gethostname()}"
    for _ in range(2):  # once more where the process that made it is gone
        try:
            handle = os.open(path, os.O_CREAT | os.O_EXCL | os.O_WRONLY)
        except FileExistsError:
            if not _is_left(path):
                return None
            path.unlink(missing_ok=True)
            continue
        with os.fdopen(handle, "w") as file:
            file.write(own)
        stack = ExitStack()
        stack.callback(path.unlink, missing_ok=True)
        return stack
    return None


def _is_left(path: Path) -> bool:
    """Whether a process of this machine made a lock's file, and has ended; of other machines nothing is known."""
    try:
        process, host = path.read_text().split()
        if host != socket.gethostname():
            return False
        os.kill(int(process), 0)
    except ProcessLookupError:
        return True
    except (OSError, ValueError):  # it is somebody else's, or is just being written or removed
        return False
    return False


def _locked_beside(folder: Path) -> ExitStack | None:
    """The lock where folders can not be opened: a file beside."""
    try:
        import msvcrt
    except ImportError:  # a system without locks
        return ExitStack()
    path = lock_beside(folder)
    with ExitStack() as stack:
        file = stack.enter_context(path.open("ab"))
        try:
            msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined]
        except OSError:
            return None
        lock = ExitStack()
        lock.callback(_remove_unless_open, path)
        lock.push(stack.pop_all())  # closed first
        return lock


def _remove_unless_open(path: Path) -> None:
    with suppress(PermissionError):  # Windows removes no file that another process has open: that one will
        path.unlink(missing_ok=True)


def sync(path: Path) -> None:
    """Have a file's contents, or a folder's names, on the disk itself."""
    folder = path.is_dir()
    if folder and not hasattr(os, "O_DIRECTORY"):  # Windows opens no folder; it keeps the order of renames itself
        return
    handle = os.open(path, os.O_RDONLY if folder else os.O_RDWR)  # Windows syncs only what may be written
    try:
        os.fsync(handle)
    except OSError as error:
        if not folder or error.errno not in UNSYNCED:
            raise
    finally:
        os.close(handle)


def sync_all(folder: Path) -> None:
    """Have a folder with all that is in it on the disk itself."""
    for path in folder.rglob("*"):
        if not path.is_symlink() and (path.is_file() or path.is_dir()):
            sync(path)
    sync(folder)


def _put(draft: Path, path: Path, replace: bool) -> None:
    if replace:
        os.replace(draft, path)
        return
    try:
        os.link(draft, path)  # a rename would replace what came meanwhile
    except FileExistsError:
        raise
    except OSError:  # a disk without links
        if path.exists():
            raise FileExistsError(errno.EEXIST, "it is there already", str(path)) from None
        os.rename(draft, path)


def exchange(one: Path, other: Path) -> bool:
    """Let two paths swap places in one step; whether this system and its disk can."""
    import ctypes

    at_here, swap = -100, 2  # AT_FDCWD; RENAME_EXCHANGE of Linux, RENAME_SWAP of macOS
    paths = os.fsencode(one), os.fsencode(other)
    try:
        system = ctypes.CDLL(None)
        if sys.platform == "darwin":
            return bool(system.renamex_np(*paths, swap) == 0)
        return bool(system.renameat2(at_here, paths[0], at_here, paths[1], swap) == 0)
    except (AttributeError, TypeError, OSError):  # no such call here
        return False


def _recover(path: Path, strangers: Strangers | None) -> None:
    """Put right what killed processes left beside `path`: nothing that was there, or came there, is lost."""
    left = re.compile(rf"\.{re.escape(path.name)}-[a-z0-9_]{{8}}\.part")
    for name in sorted(os.listdir(path.parent)):
        place = path.with_name(name)
        if not left.fullmatch(name) or place.is_symlink() or not place.is_dir():
            continue
        try:
            if not {*os.listdir(place)} <= {NEW, WHOLE, EARLIER}:  # not made here
                continue
            lock = locked(place)
        except (PermissionError, FileNotFoundError):  # another user's, or just cleared by another process
            continue
        if lock is None:
            continue
        with lock:
            _clear(place, path, strangers)


def _clear(place: Path, path: Path, strangers: Strangers | None) -> None:
    """Remove a hidden folder but for what belongs at `path`: earlier results where no new ones stand, strangers."""
    if (place / EARLIER).exists() and not path.exists():
        os.rename(place / EARLIER, path)
    for kept in (place / WHOLE, place / EARLIER):
        if strangers is not None and kept.exists():
            _carry(kept, path, strangers)
            (place / NEW).mkdir(exist_ok=True)
            os.rename(kept, place / NEW / kept.name)  # half removed, it would seem to be full of strangers
    shutil.rmtree(place, ignore_errors=True)


def _carry(source: Path, target: Path, strangers: Strangers) -> None:
    """Let the strangers' files of one folder stand in another too."""
    for name in strangers(source):
        here, there = source / name, target / name
        while os.path.lexists(there) and not _same(here, there):
            there = there.with_name(f"{EARLIER}-{there.name}")
        if os.path.lexists(there):
            continue
        there.parent.mkdir(parents=True, exist_ok=True)
        try:
            os.link(here, there, follow_symlinks=False)
        except (OSError, NotImplementedError):  # a disk or a system without links
            shutil.copy2(here, there, follow_symlinks=False)


def _same(one: Path, other: Path) -> bool:
    """Whether two paths are one file, or a file and the copy that was made of it."""
    first, second = one.lstat(), other.lstat()
    return os.path.samestat(first, second) or (
        (first.st_size, first.st_mtime_ns) == (second.st_size, second.st_mtime_ns)
    )
