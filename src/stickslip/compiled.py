"""How the kernels are compiled: one source for the CPU and the GPU, kept on disk.

numba keeps a compiled function as long as its own file stands as it was, and does not see that a function it calls in
another file has changed. So a file's kernels are kept in a folder that is named after its content and that of every
file whose kernels, constants or tuples it imports: an edited kernel is compiled anew with those that call it alone.

A CUDA kernel calls the same functions: numba compiles them anew for the device.
"""

from __future__ import annotations

import atexit
import gc
import hashlib
import logging
import os
import re
import shutil
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import cache
from importlib.machinery import SourceFileLoader
from importlib.util import module_from_spec, spec_from_loader
from pathlib import Path
from types import ModuleType
from typing import Any

from numba import cfunc, config, njit
from numba.core import event

OPTIONS = {"error_model": "numpy", "_nrt": False}
FAST = {**OPTIONS, "fastmath": {"contract", "nsz", "arcp"}}
BARE = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
PACKAGE = Path(__file__).parent
HOLDS_KERNELS = "@compiled("
IMPORT = re.compile(r"^from (stickslip[\w.]*) import (\([^)]*\)|[^\n]+)", re.MULTILINE)
UNUSED = 30 * 86400.0  # s after which what nothing has loaded is removed
KEPT = 256  # generated modules on disk, the latest used: what a user comes back to, some 20 MB
IN_USE = 60.0  # s: one that was used so lately may be about to be read by another process


class Compilation(event.Listener):  # type: ignore[misc]  # numba tells no types
    """Says when numba begins to compile, which it does not for what it finds on disk, and counts for how long.

    Attributes
    ----------
    seconds : float
        That this process has spent compiling so far.
    """

    def __init__(self) -> None:
        self.seconds, self._depth, self._began, self._collects = 0.0, 0, 0.0, False
        event.register("numba:compile", self)

    def on_start(self, event: Any) -> None:
        """A function, or one that it calls, is compiled."""
        if not self._depth:
            self._began = time.perf_counter()
            self._collects = gc.isenabled()
            gc.disable()  # numba's many small objects live until the end: to look for garbage takes a tenth of the time
            if not self.seconds:
                _say("compiling for this machine, once; what is compiled is kept")
        self._depth += 1

    def on_end(self, event: Any) -> None:
        """It is done."""
        self._depth -= 1
        if not self._depth:
            self.seconds += time.perf_counter() - self._began
            if self._collects:
                gc.enable()

    def timed(self, compiler: Callable[[], Any]) -> Any:
        """What a compiler makes that tells numba's listeners nothing; what it found on disk does not count."""
        began = time.perf_counter()
        made = compiler()
        self.seconds += 0.0 if made.cache_hits else time.perf_counter() - began
        return made


def _say(sentence: str) -> None:
    """To who sits before a prompt of Python; else to who listens to the log of the package."""
    if hasattr(sys, "ps1"):
        print(f"stickslip: {sentence}", file=sys.stderr)
    logging.getLogger(__package__).info(sentence)


compilation = Compilation()


def compiled(**options: Any) -> Callable[[Callable[..., Any]], Any]:
    """numba's `njit` with these options, kept in :func:`folder`.

    What compiled code calls is compiled apart, without the entrances for Python and C: they took a quarter of the time.
    """

    def compile_(function: Callable[..., Any]) -> Any:
        shown = _keeping(njit, options)(function)
        if not config.DISABLE_JIT:
            called = _keeping(njit, options | BARE)(function)
            shown.get_call_template, shown.get_overload = called.get_call_template, called.get_overload
        return shown

    return compile_


def pointer(signature: Any, **options: Any) -> Callable[[Callable[..., Any]], Any]:
    """As :func:`compiled`, at once and for one signature: a function that compiled code takes as an argument."""

    def compiler(**more: Any) -> Callable[[Callable[..., Any]], Any]:
        return lambda function: compilation.timed(lambda: cfunc(signature, **more)(function))

    return _keeping(compiler, options)


def _keeping(compiler: Callable[..., Any], options: dict[str, Any]) -> Callable[[Callable[..., Any]], Any]:
    def compile_(function: Callable[..., Any]) -> Any:
        kept, place = config.CACHE_DIR, folder(Path(function.__code__.co_filename))
        if place is None or config.DISABLE_JIT:
            return compiler(**options)(function)
        config.CACHE_DIR = str(place / "called" if BARE.keys() <= options.keys() else place)
        try:
            return compiler(cache=True, **options)(function)
        finally:
            config.CACHE_DIR = kept

    return compile_


def generated(source: str) -> ModuleType:
    """The module of a text, kept beside what is compiled of it."""
    name = "generated_" + hashlib.sha256(source.encode()).hexdigest()[:16]
    place = _kept(f"{name}-{_digest(_closure(source))}") or _passing()
    file = place / f"{name}.txt"  # no module of the package
    if not file.exists() or file.read_text("utf-8") != source:
        part = file.with_suffix(f".{os.getpid()}-{threading.get_ident()}")
        part.write_text(source, "utf-8")
        part.replace(file)
    loader = SourceFileLoader(f"{__package__}.{name}", str(file))
    spec = spec_from_loader(loader.name, loader)
    assert spec is not None
    module = module_from_spec(spec)
    sys.modules[loader.name] = module
    loader.exec_module(module)
    return module


@cache
def _passing() -> Path:
    """A folder that lasts as long as the process."""
    place = tempfile.TemporaryDirectory()
    atexit.register(place.cleanup)
    return Path(place.name)


@cache
def folder(file: Path) -> Path | None:
    """Where the compiled kernels of a file are kept; None where nothing may be written."""
    if file.suffix == ".txt":  # generated: kept beside its text
        return file.parent
    if not file.is_relative_to(PACKAGE):
        return None
    name = ".".join(file.relative_to(PACKAGE).with_suffix("").parts)
    return _kept(f"{name}-{digest(file)}")


def digest(file: Path) -> str:
    """What a file and all whose kernels or constants it imports say, in 16 digits."""
    return _digest({file: _text(file), **_closure(_text(file))})


def _digest(texts: dict[Path, str]) -> str:
    sources = (f"{file.relative_to(PACKAGE).as_posix()}\0{texts[file]}" for file in sorted(texts))
    return hashlib.sha256("\0".join(sources).encode()).hexdigest()[:16]


def _closure(text: str) -> dict[Path, str]:
    """The files of the package that decide what is compiled of a text that imports them, and their texts."""
    reached: dict[Path, str] = {}
    waiting = list(_imported(text))
    while waiting:
        file = waiting.pop()
        if file not in reached:
            reached[file] = _text(file)
            if HOLDS_KERNELS in reached[file]:
                waiting += _imported(reached[file])
    return reached


def _imported(text: str) -> Iterator[Path]:
    """The files whose kernels, constants or tuples a text imports: Python's own functions are not compiled into it."""
    for module, listed in IMPORT.findall(text):
        base = PACKAGE.joinpath(*module.split(".")[1:])
        for name in re.findall(r"\w+", re.sub(r"#.*| as \w+", "", listed)):
            file = base.with_suffix(".py") if base.with_suffix(".py").exists() else base / f"{name}.py"
            if file.exists() and (name[0].isupper() or HOLDS_KERNELS in _text(file)):
                yield file


@cache
def _text(file: Path) -> str:
    return file.read_text("utf-8")


def _kept(name: str) -> Path | None:
    """The folder of this name at the first place that may be written, made with what is out of use there removed."""
    root = _root()
    if root is None:
        return None
    place = root / name
    if not place.exists():
        _prune(root)
    while True:
        place.mkdir(exist_ok=True)
        try:
            os.utime(place)
        except FileNotFoundError:  # pruned by another process between the two
            continue
        return place


def _prune(root: Path) -> None:
    """Remove what nothing has loaded for long: kernels of earlier sources, generated code beyond the latest used."""
    now, used = time.time(), {}
    for place in root.iterdir():
        with suppress(FileNotFoundError):  # removed by another process meanwhile
            used[place] = place.stat().st_mtime
    latest = sorted((place for place in used if place.name.startswith("generated_")), key=lambda place: -used[place])
    crowded = {place for place in latest[KEPT:] if used[place] < now - IN_USE}
    for place in used:
        if place in crowded or used[place] < now - UNUSED:
            shutil.rmtree(place, ignore_errors=True)


@cache
def _root() -> Path | None:
    chosen = [Path(config.CACHE_DIR)] if config.CACHE_DIR else []
    # Not the common temporary folder: what numba finds there it would run, whoever put it there.
    for parent in (*chosen, PACKAGE / "__pycache__", _own_cache()):
        root = parent / "kernels"
        try:
            root.mkdir(parents=True, exist_ok=True)
            tempfile.TemporaryFile(dir=root).close()
        except OSError:
            continue
        return root
    return None


def _own_cache() -> Path:
    """The user's folder for what can be made again."""
    home = Path(os.path.expanduser("~"))
    places = {"win32": home / "AppData" / "Local", "darwin": home / "Library" / "Caches"}
    chosen = os.environ.get("LOCALAPPDATA" if sys.platform == "win32" else "XDG_CACHE_HOME")
    return (Path(chosen) if chosen else places.get(sys.platform, home / ".cache")) / "stickslip"
