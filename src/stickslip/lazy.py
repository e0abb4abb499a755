"""Public names, imported when they are first used: a package names them once, in the stub beside its ``__init__``."""

from __future__ import annotations

import ast
import difflib
import importlib
import importlib.util
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any


def attached(
    package: str, *own: str, rooms: Sequence[str] | None = None
) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """``__getattr__``, ``__dir__`` and ``__all__`` of a package, by the imports that its ``__init__.pyi`` lists.

    `own` are names that the package defines itself. Of its `rooms`, where these are given, ``__dir__`` names no
    others: what a person completes with the tabulator is then a list that can be read.
    """
    sources = named(Path(str(sys.modules[package].__file__)).with_suffix(".pyi"))

    def find(name: str) -> Any:
        if name not in sources:
            if not name.startswith("_") and importlib.util.find_spec(f"{package}.{name}"):
                return importlib.import_module(f"{package}.{name}")  # a room above this one, as the bench
            near = difflib.get_close_matches(name, sources, n=3, cutoff=0.5)
            hint = f"the nearest are {', '.join(near)}" if near else f"dir({package}) lists what it has"
            raise AttributeError(f"module '{package}' has no attribute '{name}'; {hint}")
        module = sources[name]
        return importlib.import_module(f"{module}.{name}") if module == "stickslip" else _member(module, name)

    listed = [*sources, *own]
    first = [n for n in listed if rooms is None or n in rooms or sources.get(n, "").partition(".")[2]]
    return find, lambda: first, listed


def _member(module: str, name: str) -> Any:
    return getattr(importlib.import_module(module), name)


def named(stub: Path) -> dict[str, str]:
    """Where each name of a stub comes from."""
    imports = [node for node in ast.parse(stub.read_text("utf-8")).body if isinstance(node, ast.ImportFrom)]
    return {alias.asname or alias.name: str(node.module) for node in imports for alias in node.names}
