"""How the kernels are compiled: one source for the CPU and the GPU, kept on disk.

numba keeps a compiled function as long as its own file stands as it was, and does not see that a function it calls in
another file has changed. So a file's kernels are kept in a folder that is named after its content and that of every
file whose kernels, constants or tuples it imports: an edited kernel is compiled anew with those that call it alone.

A CUDA kernel calls the same functions: numba compiles them anew for the device.

Who asks for a kernel by `meanwhile.now` does not wait for the compiler: what is not on disk yet Python runs from the
same source, while another process compiles.
"""

from __future__ import annotations

import atexit
import hashlib
import os
import re
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache, cached_property, update_wrapper
from importlib import import_module
from importlib.machinery import SourceFileLoader
from importlib.util import module_from_spec, spec_from_loader
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any

import numpy as np

from stickslip.workers import processors

OPTIONS = {"error_model": "numpy", "_nrt": False}
FAST = {**OPTIONS, "fastmath": {"contract", "nsz", "arcp"}}
PACKAGE = Path(__file__).parent
HOLDS_KERNELS = "@compiled("
IMPORT = re.compile(r"^from (stickslip[\w.]*) import (\([^)]*\)|[^\n]+)", re.MULTILINE)
UNUSED = 30 * 86400.0  # s after which what nothing has loaded is removed
KEPT = 256  # generated modules on disk, the latest used: what a user comes back to, some 20 MB
IN_USE = 60.0  # s: one that was used so lately may be about to be read by another process
WAITS = "STICKSLIP_WAIT"  # environment variable: where it is set, who calls a kernel waits until it is compiled
# s that a process runs kernels by Python before it waits for who compiles; on one processor it takes that one's time
PATIENCE = 5.0 if processors() > 1 else 1.0
LONGEST = 10.0  # s of waiting for another process: on a busy machine it has less of a processor than who waits
MOST = 30_000  # steps of a loop: Python takes some hundredths of a second
ALIVE = 30.0  # s that who compiles may be silent; it says every second that it lives
LOCK = "compiling"  # file in the folder of kernels, which lives as long as who compiles
LOW = 5  # of its priority: it takes a quarter of a processor that another process needs, and so comes to its end
WINDOWS = {"creationflags": 0x4000 | 0x8}  # below normal, without a console
APART: dict[str, Any] = WINDOWS if sys.platform == "win32" else {"start_new_session": True}
AHEAD = "from stickslip.compiled import beside\nwith beside():\n from stickslip.solve.simulate import ahead\n ahead()"


class Kernel:
    """A function that numba compiles with these options when it is first called, kept in :func:`folder`.

    Until then numba is not imported: half a second, and most of an analysis calls no kernel. To compiled code that
    calls it, it is numba's own, whose attributes it has.

    Attributes
    ----------
    py_func : callable
        The function as it stands.
    """

    def __init__(self, function: Callable[..., Any], options: dict[str, Any]) -> None:
        update_wrapper(self, function)
        self.py_func, self._options = function, options

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        return self.dispatcher(*arguments, **named)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return getattr(self.dispatcher, name)

    def __reduce__(self) -> str:
        return self.py_func.__qualname__

    @cached_property
    def dispatcher(self) -> Any:
        """What numba makes of it."""
        return _numba().dispatcher(self.py_func, _folder_of(self.py_func), self._options)


class Intrinsic:
    """A function that compiled code alone calls, of a module that imports numba: not before that code is compiled."""

    def __init__(self, module: str, name: str) -> None:
        self.module, self.name = module, name

    @property
    def _numba_type_(self) -> Any:
        """What numba takes it for."""
        return _numba().type_of(getattr(import_module(self.module), self.name))


def compiled(**options: Any) -> Callable[[Callable[..., Any]], Any]:
    """A :class:`Kernel` with these options of numba's `njit`."""
    return lambda function: Kernel(function, options)


def pointer(signature: Any, **options: Any) -> Callable[[Callable[..., Any]], Any]:
    """As :func:`compiled`, at once and for one signature: a function that compiled code takes as an argument."""
    return lambda function: _numba().address(function, _folder_of(function), signature, options)


def dispatcher_of(kernel: Kernel) -> Any:
    """What numba makes of a kernel, and of all that this calls: a GPU's compiler knows numba's own class alone."""
    names = kernel.py_func.__globals__
    for name, called in list(names.items()):
        if isinstance(called, Kernel):
            names[name] = called.dispatcher
            dispatcher_of(called)
    return kernel.dispatcher


def _numba() -> Any:
    """numba, with what is made of it here."""
    from stickslip import compiler

    return compiler


_plain: dict[str, dict[str, Any]] = {}


def by_python(kernel: Any) -> Callable[..., Any]:
    """The source of a kernel and of all that it calls, for Python to run."""
    function = getattr(kernel, "py_func", kernel)
    if function.__module__ not in _plain:
        names = function.__globals__
        _plain[function.__module__] = plain = dict(names)
        plain.update({name: by_python(value) for name, value in names.items() if hasattr(value, "py_func")})
    return FunctionType(function.__code__, _plain[function.__module__], function.__name__, function.__defaults__)


class Meanwhile:
    """Kernels that are not on disk yet, run by Python while another process compiles them.

    Attributes
    ----------
    seconds : float
        That this process has run kernels by Python so far.
    """

    def __init__(self) -> None:
        self.seconds, self._ready = 0.0, set[Any]()
        self._tried = False  # to begin another process
        self._own: subprocess.Popen[bytes] | None = None

    def now(self, kernel: Any, steps: int = 1) -> Callable[..., Any]:
        """The kernel where it is on disk or nobody else compiles it; else its source, for Python to run, where that
        takes no more than `MOST` steps."""
        if kernel in self._ready or steps > MOST or not hasattr(kernel, "overloads"):
            return kernel  # type: ignore[no-any-return]
        if self.seconds > PATIENCE or kernel.overloads or _on_disk(kernel) or not self._compiling():
            return self.awaited(kernel)
        return self._timed(by_python(kernel))

    def awaited(self, kernel: Any) -> Callable[..., Any]:
        """The kernel, where another process compiles it once that is done: two would take as long."""
        if kernel not in self._ready and hasattr(kernel, "overloads"):
            last = time.monotonic() + LONGEST
            while not (kernel.overloads or _on_disk(kernel)) and self._compiling() and time.monotonic() < last:
                time.sleep(0.02)
            self._ready.add(kernel)
        return kernel  # type: ignore[no-any-return]

    def _timed(self, function: Callable[..., Any]) -> Callable[..., Any]:
        """The same, its time taken; a division by zero is what it is to compiled code."""

        def run(*arguments: Any) -> Any:
            began = time.perf_counter()
            try:
                with np.errstate(all="ignore"):
                    return function(*arguments)
            finally:
                self.seconds += time.perf_counter() - began

        return run

    def _compiling(self) -> bool:
        """Whether another process compiles; one is begun where none does, once."""
        root = None if WAITS in os.environ else _root()
        if root is None:
            return False
        if not self._tried:
            self._tried, self._own = True, _begun(root / LOCK)
            if self._own is not None:
                _numba().say("running uncompiled while another process compiles for this machine, once")
        return _held(root / LOCK) if self._own is None else self._own.poll() is None


def _on_disk(kernel: Any) -> bool:
    """Whether numba has kept the machine code of a kernel: each is called with arguments of one kind."""
    function, place = kernel.py_func, _folder_of(kernel.py_func)
    name = f"*/*.{function.__qualname__}-{function.__code__.co_firstlineno}.*.nbc"
    return place is not None and any(place.glob(name))


def _held(lock: Path) -> bool:
    """Whether another process says that it compiles."""
    try:
        return time.time() - lock.stat().st_mtime < ALIVE
    except FileNotFoundError:
        return False


def _begun(lock: Path) -> subprocess.Popen[bytes] | None:
    """A process that compiles ahead; None where one is at it, or none can be had."""
    if not Path(sys.executable or "").name.startswith("python"):  # a program that holds Python would begin once more
        return None
    search = [*filter(None, sys.path), str(PACKAGE.parent)]
    environment = {**os.environ, WAITS: "1", "PYTHONPATH": os.pathsep.join(map(os.path.abspath, search))}
    silent: dict[str, Any] = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.DEVNULL)
    try:
        if not _held(lock):
            lock.unlink(missing_ok=True)  # of one that was killed
        os.close(os.open(lock, os.O_CREAT | os.O_EXCL))
    except OSError:  # there already, or no place to write
        return None
    try:
        other = subprocess.Popen([sys.executable, "-c", AHEAD], cwd=lock.parent, env=environment, **silent, **APART)
    except OSError:
        lock.unlink(missing_ok=True)
        return None
    atexit.register(setattr, other, "returncode", 0)  # it may outlive this process, which is no cause for a warning
    return other


@contextmanager
def beside() -> Iterator[None]:
    """While it lasts others see that this process compiles, and gives way to them."""
    root, done = _root(), threading.Event()
    assert root is not None
    lock = root / LOCK

    def live() -> None:
        while not done.wait(1.0):
            with suppress(OSError):
                os.utime(lock)

    if hasattr(os, "nice"):
        os.nice(LOW)
    threading.Thread(target=live, daemon=True).start()
    try:
        yield
    finally:
        done.set()
        lock.unlink(missing_ok=True)


@contextmanager
def waiting() -> Iterator[None]:
    """Within it, and in processes begun there, who calls a kernel compiles it: long work gains nothing by Python."""
    before = os.environ.get(WAITS)
    os.environ[WAITS] = "1"
    try:
        yield
    finally:
        if before is None:
            del os.environ[WAITS]
        else:
            os.environ[WAITS] = before


meanwhile = Meanwhile()


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


def _folder_of(function: Any) -> Path | None:
    return folder(Path(function.__code__.co_filename))


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
    """What is compiled of these texts, and by what: numba would compile anew for itself of another release."""
    sources = (f"{file.relative_to(PACKAGE).as_posix()}\0{texts[file]}" for file in sorted(texts))
    by = _numba().numba.__version__, _text(Path(_numba().__file__))
    return hashlib.sha256("\0".join([*by, *sources]).encode()).hexdigest()[:16]


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
    chosen = [Path(kept)] if (kept := _numba().config.CACHE_DIR) else []
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
