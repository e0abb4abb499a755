"""Kernels before they are compiled: Python runs their source at once, while another process compiles them.

Compiling takes numba some 0.2 s a kernel, once on a machine: a short run is answered sooner by Python, which is some
300 times slower. When the compiler is done first, what Python has is dropped and the compiled kernel answers.

The other process outlives this one: what it compiles is there for the next.
"""

from __future__ import annotations

import atexit
import json
import math
import os
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable
from contextlib import nullcontext, suppress
from functools import cache, cached_property, wraps
from importlib import import_module
from types import FunctionType
from typing import Any

import numpy as np
from numba import types

from stickslip.compiled import Uncompiled, common, compilation, generated, is_compiled
from stickslip.whole import locked
from stickslip.workers import processors

PATIENCE = 3.0  # s in all that a process runs sources: who asks on and on, as a fit, is served by compiling at once
FEW = 20_000  # samples of a motion that Python has in about a second
GLANCE = 0.02  # s between two looks whether the compiler is done
MOST_WAIT = 120.0  # s for another process that compiles: a lock that a dead machine left is not waited for
SERVE = "from stickslip.interpreted import serve; serve()"

_limit: list[Any] = []  # of the source that runs: what is set when the compiler is done, and the time to give up
_spent = [0.0]  # s of the processor that sources took in this process
_codes: dict[int, Code] = {}


def at_once(kernel: Any, *arguments: Any, small: bool = True, codes: Iterable[int] = ()) -> Any:
    """kernel(*arguments): compiled where that is on disk or the work is not `small`, else by its source.

    `codes` are the addresses of generated code among the arguments, see :class:`Code`.
    """
    known = [_codes[address] for address in codes]
    small = small and _spent[0] < PATIENCE
    compiled = bool(getattr(kernel, "overloads", True)) or (small and _loaded(kernel, arguments))
    lacking = [code for code in known if not code.settled()]
    if compiled and not lacking:
        return kernel(*arguments)
    orders = [] if compiled else [_Order(kernel.__module__, kernel.__name__, *map(_told, _types(kernel, arguments)))]
    orders += [_Order("", code.text) for code in lacking]
    if small:
        before, began = _copied(arguments), time.thread_time()
        _limit[:] = orders[0].given(), time.monotonic() + PATIENCE if processors() == 1 else math.inf
        for order in orders[1:]:
            _limit[0] = order.given()
        try:
            with np.errstate(all="ignore"):
                return by_source(kernel)(*arguments)
        except (Uncompiled, ArithmeticError, ValueError):  # it took long, or Python refuses what a processor calls inf
            _restored(arguments, before)
        finally:
            _spent[0] += time.thread_time() - began
    for order in orders:
        order.wait()
    for code in lacking:
        code.settled(wait=True)
    return kernel(*arguments)


class Code:
    """Generated code: a text with a function `series`, which kernels call by an `address`.

    Where the address points, the compiled function's own will stand; until then Python knows the function by it.
    """

    def __init__(self, text: str) -> None:
        self.text, self._slot = text, np.zeros(1, np.int64)
        self.address = int(self._slot.ctypes.data)
        _codes[self.address] = self
        self.settled()

    def settled(self, *, wait: bool = False) -> bool:
        """Whether the compiled function stands at its address; with `wait` it is compiled for that."""
        if not self._slot[0] and (wait or is_compiled(self.text)):
            self._slot[0] = generated(self.text).series.address
        return bool(self._slot[0])

    @cached_property
    def function(self) -> Callable[..., Any]:
        """As Python runs it."""
        with compilation.refused():
            return by_source(generated(self.text).series)


def coded_by_source(address: int) -> Callable[..., Any]:
    """The function at the address of a :class:`Code`, as Python runs it."""
    return _codes[address].function


@cache
def by_source(kernel: Any) -> Callable[..., Any]:
    """A kernel as Python runs it, with all the kernels that it calls.

    What a kernel calls that is none, and can not run in Python, says in `by_source` what to call instead.
    """
    function = getattr(kernel, "py_func", kernel)
    names = dict(function.__globals__)
    for name in function.__code__.co_names:
        called: Any = names.get(name)
        if hasattr(called, "py_func"):
            names[name] = _limited(by_source(called))
        elif hasattr(called, "by_source"):
            names[name] = called.by_source
    return FunctionType(function.__code__, names, function.__name__, function.__defaults__, function.__closure__)


def _limited(function: Callable[..., Any]) -> Callable[..., Any]:
    @wraps(function)
    def limited(*arguments: Any) -> Any:
        done, until = _limit
        if done.is_set() or time.monotonic() > until:
            raise Uncompiled
        return function(*arguments)

    return limited


def _loaded(kernel: Any, arguments: tuple[Any, ...]) -> bool:
    """Whether a kernel was found on disk for such arguments."""
    try:
        with compilation.refused():
            kernel.compile(_types(kernel, arguments))
    except Uncompiled:
        return False
    return True


def _types(kernel: Any, arguments: tuple[Any, ...]) -> tuple[Any, ...]:
    return tuple(map(kernel.typeof_pyval, arguments))


def _told(kind: Any) -> list[Any]:
    """A type of numba as another process can be told of it: an array, a named tuple, a tuple, or a number."""
    if isinstance(kind, types.Array):
        return ["array", str(kind.dtype), kind.ndim, kind.layout, not kind.mutable]
    if isinstance(kind, types.BaseNamedTuple):
        return ["named", kind.instance_class.__module__, kind.instance_class.__name__, *map(_told, kind)]
    if isinstance(kind, types.BaseTuple):
        return ["tuple", *map(_told, kind)]
    return ["number", str(kind)]


def _type_of(told: list[Any]) -> Any:
    """The type that was :func:`_told`."""
    kind, *rest = told
    if kind == "array":
        dtype, dimensions, layout, fixed = rest
        return types.Array(_number(dtype), dimensions, layout, readonly=fixed)
    if kind == "named":
        own = getattr(import_module(rest[0]), rest[1])
        return types.BaseTuple.from_types(tuple(map(_type_of, rest[2:])), own)
    return types.BaseTuple.from_types(tuple(map(_type_of, rest))) if kind == "tuple" else _number(rest[0])


def _number(name: str) -> Any:
    return types.boolean if name == "bool" else getattr(types, name)


def _copied(value: Any) -> Any:
    if isinstance(value, tuple):
        return tuple(map(_copied, value))
    return value.copy() if isinstance(value, np.ndarray) else value


def _restored(value: Any, before: Any) -> None:
    """Write back into arrays what they held before."""
    if isinstance(value, tuple):
        for one, held in zip(value, before, strict=True):
            _restored(one, held)
    elif isinstance(value, np.ndarray) and value.flags.writeable:
        value[...] = before


class _Compiler:
    """Another process that compiles what it is told, in turn, and ends when that is done, also where this one has
    ended before. Lives as long as this process; so does what it was told."""

    def __init__(self) -> None:
        self.process: subprocess.Popen[bytes] | None = None
        self.waiting: deque[threading.Event] = deque()
        self.told: dict[bytes, threading.Event] = {}
        self.lock = threading.Lock()
        atexit.register(self.leave)

    def tell(self, job: bytes) -> threading.Event:
        """Have something compiled; the event is set when it is, or could not be."""
        with self.lock:
            if job in self.told:
                return self.told[job]
            done = self.told[job] = threading.Event()
            try:
                self.process = self.process or self.begun()
                assert self.process.stdin is not None
                self.process.stdin.write(job + b"\n")
                self.process.stdin.flush()
                self.waiting.append(done)
            except OSError:
                done.set()
            return done

    def begun(self) -> subprocess.Popen[bytes]:
        """A new process, to which a Ctrl-C of the terminal is not said."""
        if os.name == "posix":
            apart: dict[str, Any] = {"start_new_session": True}
        else:
            apart = {"creationflags": getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0)}
        paths = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
        pipe, none = subprocess.PIPE, subprocess.DEVNULL
        command = [sys.executable, "-c", SERVE]
        process = subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=none, env=paths, **apart)
        threading.Thread(target=self.listen, args=(process,), daemon=True).start()
        return process

    def listen(self, process: subprocess.Popen[bytes]) -> None:
        """Hear what is done; a process with nothing to do ends."""
        assert process.stdout is not None
        with process:
            for _ in process.stdout:
                with self.lock:
                    self.waiting.popleft().set()
                    if not self.waiting:
                        self.process = None
                        break
        with self.lock:
            if self.process is process:  # it has failed
                self.process = None
                while self.waiting:
                    self.waiting.popleft().set()

    def leave(self) -> None:
        """Let the process outlive this one: else Python would warn of it."""
        if self.process is not None:
            self.process.returncode = 0


@cache
def _compiler(process: int) -> _Compiler:
    """That of a process, by its number: one that is forked has its own."""
    return _Compiler()


class _Order:
    """Something to be compiled elsewhere, once it is given to the compiler. Lives for one call."""

    def __init__(self, *job: Any) -> None:
        self.job = json.dumps(job).encode()

    def given(self) -> threading.Event:
        """Have it compiled; the event is set when that is done."""
        if common() is None or getattr(sys, "frozen", False):  # nothing can be handed over, or no Python can be begun
            done = threading.Event()
            done.set()
            return done
        return _compiler(os.getpid()).tell(self.job)

    def wait(self) -> None:
        """Wait until it is done, if it was ever given."""
        done = _compiler(os.getpid()).told.get(self.job)
        while done is not None and not done.wait(GLANCE):  # a wait without an end would not hear a Ctrl-C everywhere
            pass


def serve() -> None:
    """Compile what is asked for by lines of the standard input, and answer each by a line."""
    root = common()
    if root is None:
        return
    until = time.monotonic() + MOST_WAIT
    while (lock := locked(root)) is None and time.monotonic() < until:  # another compiles, and likely the same
        time.sleep(GLANCE)
    with lock or nullcontext():
        for line in sys.stdin.buffer:
            module, name, *given = json.loads(line)
            if not module:
                generated(name)
            else:
                getattr(import_module(module), name).compile(tuple(map(_type_of, given)))
            with suppress(OSError):  # nobody listens any more: what was asked for is compiled all the same
                print(flush=True)
