"""numba, which takes half a second to import: not before a kernel is asked for, and what it then does faster here."""

from __future__ import annotations

import gc
import logging
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import llvmlite.binding
import llvmlite.ir
import numba
from numba import cfunc, config, njit, types
from numba.core import event
from numba.core.registry import cpu_target

# What compiles faster below goes into numba's own classes, which it may change with any release: for releases that are
# not known yet there are none, and all is compiled as numba does by itself.
KNOWN = (0, 61) <= tuple(map(int, numba.__version__.split(".")[:2])) <= (0, 68)
if KNOWN:
    from numba.core.codegen import JITCodeLibrary
    from numba.core.compiler import Compiler, Flags
else:
    JITCodeLibrary = Compiler = Flags = object

BARE = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}


def say(sentence: str) -> None:
    """To who sits before a prompt of Python; else to who listens to the log of the package."""
    if hasattr(sys, "ps1"):
        print(f"stickslip: {sentence}", file=sys.stderr)
    logging.getLogger(__package__).info(sentence)


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
                say("compiling for this machine, once; what is compiled is kept")
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


compilation = Compilation()


class _Flags(Flags):  # type: ignore[misc]  # numba tells no types
    """numba's own, compared by what was set: it compares all that may be, as often as it looks for a type."""

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Flags) and self._values == other._values

    def __hash__(self) -> int:
        return hash(frozenset(self._values))


class _Shown(Compiler):  # type: ignore[misc]
    """Compiles what Python calls, with all that it calls: for C it needs no entrance."""

    def __init__(self, typing: Any, target: Any, library: Any, args: Any, result: Any, flags: Any, names: Any) -> None:
        flags = _Flags(flags)
        flags.no_cfunc_wrapper = True
        super().__init__(typing, target, library, args, result, flags, names)


class _Called(_Shown):
    """Compiles what compiled code calls, as far as it is the same wherever it is called."""

    def __init__(self, typing: Any, target: Any, library: Any, *rest: Any) -> None:
        library = _Body(target.codegen(), "called")
        library.enable_object_caching()
        super().__init__(typing, target, library, *rest)


class _Body(JITCodeLibrary):  # type: ignore[misc]
    """Code that is linked into its callers and optimised there: by itself it would be so once more for each level of
    calls, and made machine code of that nothing runs. That holds its globals for numba's environments alone."""

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalized = True
        shared = self._get_module_for_linking()
        kept = [str(own) for own in shared.global_variables if own.name.startswith("_ZN08NumbaEnv")]
        blank = str(self._codegen._create_empty_module(self.name))
        self._final_module = llvmlite.binding.parse_assembly("\n".join([blank, *kept]))
        super()._finalize_final_module()


def dispatcher(function: Callable[..., Any], place: Path | None, options: dict[str, Any]) -> Any:
    """numba's `njit` with these options, kept at a place on disk, where there is one.

    What compiled code calls is compiled apart, without the entrances for Python and C and as :class:`_Body`: they took
    a quarter of the time, its optimisation and machine code a third of the rest. A number that stands in the call is an
    argument as any other: numba would compile the function anew for each.
    """
    quick = {"pipeline_class": _Shown} if KNOWN else {}
    shown = _keeping(njit, place, {**quick, **options})(function)
    if KNOWN and not config.DISABLE_JIT:
        called = _keeping(njit, place, {"pipeline_class": _Called, **options, **BARE})(function)
        shown.get_call_template = lambda given, named: called.get_call_template(map(types.unliteral, given), named)
        shown.get_overload = called.get_overload
    return shown


def address(function: Callable[..., Any], place: Path | None, signature: Any, options: dict[str, Any]) -> Any:
    """As :func:`dispatcher`, at once and for one signature: a function that compiled code takes as an argument."""

    def compiler(**more: Any) -> Callable[[Callable[..., Any]], Any]:
        return lambda function: compilation.timed(lambda: cfunc(signature, **more)(function))

    return _keeping(compiler, place, options)(function)


def type_of(function: Any) -> Any:
    """What numba takes a function of its own for."""
    return cpu_target.typing_context.resolve_value_type(function)


def _keeping(
    compiler: Callable[..., Any], place: Path | None, options: dict[str, Any]
) -> Callable[[Callable[..., Any]], Any]:
    def compile_(function: Callable[..., Any]) -> Any:
        if place is None or config.DISABLE_JIT:
            return compiler(**options)(function)
        kept = config.CACHE_DIR
        config.CACHE_DIR = str(place / "called" if BARE.keys() <= options.keys() else place)
        try:
            return compiler(cache=True, **options)(function)
        finally:
            config.CACHE_DIR = kept

    return compile_
