"""How the kernels are compiled: one source for the CPU and the GPU, kept on disk.

numba keeps a compiled function as long as its own file stands as it was, and does not see that a function it calls in
another file has changed. So the folder is named after the content of every file that holds kernels.

A CUDA kernel calls the same functions: numba compiles them anew for the device.
"""

from __future__ import annotations

import atexit
import hashlib
import os
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from functools import cache
from importlib.machinery import SourceFileLoader
from importlib.util import module_from_spec, spec_from_loader
from pathlib import Path
from types import ModuleType
from typing import Any

from numba import cfunc, config, njit

OPTIONS = {"error_model": "numpy", "_nrt": False}
KEPT = 256  # generated modules on disk, the latest used: what a user comes back to, some 20 MB
IN_USE = 60.0  # s: one that was used so lately may be about to be read by another process
FAST = {**OPTIONS, "fastmath": {"contract", "nsz", "arcp"}}


def compiled(**options: Any) -> Callable[[Callable[..., Any]], Any]:
    """numba's `njit` with these options, kept in :func:`folder`."""
    return _keeping(njit, options)


def pointer(signature: Any, **options: Any) -> Callable[[Callable[..., Any]], Any]:
    """As :func:`compiled`, at once and for one signature: a function that compiled code takes as an argument."""
    return _keeping(lambda **more: cfunc(signature, **more), options)


def _keeping(compiler: Callable[..., Any], options: dict[str, Any]) -> Callable[[Callable[..., Any]], Any]:
    def compile_(function: Callable[..., Any]) -> Any:
        kept, place = config.CACHE_DIR, folder()
        if place is None or config.DISABLE_JIT:
            return compiler(**options)(function)
        config.CACHE_DIR = str(place)
        try:
            return compiler(cache=True, **options)(function)
        finally:
            config.CACHE_DIR = kept

    return compile_


def generated(source: str) -> ModuleType:
    """The module of a text, kept beside what is compiled of it."""
    name = "generated_" + hashlib.sha256(source.encode()).hexdigest()[:16]
    file = (folder() or _passing()) / f"{name}.txt"  # no module of the package
    if not file.exists() or file.read_text("utf-8") != source:
        part = file.with_suffix(f".{os.getpid()}-{threading.get_ident()}")
        part.write_text(source, "utf-8")
        part.replace(file)
        _prune(file.parent)
    os.utime(file, ns=(time.time_ns(), file.stat().st_mtime_ns))  # used now; numba goes by the time of its writing
    loader = SourceFileLoader(f"{__package__}.{name}", str(file))
    spec = spec_from_loader(loader.name, loader)
    assert spec is not None
    module = module_from_spec(spec)
    sys.modules[loader.name] = module
    loader.exec_module(module)
    return module


def _prune(place: Path) -> None:
    """Delete the generated modules that were not used for longest, with what was compiled of them."""
    used = sorted(((file.stat().st_atime, file) for file in place.glob("generated_*.txt")), reverse=True)
    for last, file in used[KEPT:]:
        if last < time.time() - IN_USE:
            for old in (file, *place.glob(f"{file.stem}.*")):
                old.unlink(missing_ok=True)


@cache
def _passing() -> Path:
    """A folder that lasts as long as the process."""
    place = tempfile.TemporaryDirectory()
    atexit.register(place.cleanup)
    return Path(place.name)


@cache
def folder() -> Path | None:
    """Where compiled kernels are kept: the first place that may be written, named after their sources."""
    name = "kernels-" + digest(Path(__file__).parent)
    chosen = [Path(config.CACHE_DIR)] if config.CACHE_DIR else []
    # Not the common temporary folder: what numba finds there it would run, whoever put it there.
    for parent in (*chosen, Path(__file__).parent / "__pycache__", _own_cache()):
        try:
            (parent / name).mkdir(parents=True, exist_ok=True)
            tempfile.TemporaryFile(dir=parent / name).close()
        except OSError:
            continue
        return parent / name
    return None


def digest(sources: Path) -> str:
    """What the files that hold kernels say, in 16 digits."""
    files = sorted(sources.rglob("*.py"))
    texts = [(file.relative_to(sources).as_posix().encode(), file.read_bytes()) for file in files]
    held = [name + text for name, text in texts if b"@compiled(" in text]
    return hashlib.sha256(b"\0".join(held)).hexdigest()[:16]


def _own_cache() -> Path:
    """The user's folder for what can be made again."""
    home = Path(os.path.expanduser("~"))
    places = {"win32": home / "AppData" / "Local", "darwin": home / "Library" / "Caches"}
    chosen = os.environ.get("LOCALAPPDATA" if sys.platform == "win32" else "XDG_CACHE_HOME")
    return (Path(chosen) if chosen else places.get(sys.platform, home / ".cache")) / "stickslip"
