"""Benchmarks and makers, which are no part of the package, loaded as modules: tests run their short forms."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

CHECKOUT = Path(__file__).resolve().parents[1]


def loaded(path: str) -> ModuleType:
    """The program at a path of the checkout, as "benchmarks/laws.py"."""
    spec = importlib.util.spec_from_file_location(path.removesuffix(".py").replace("/", "_"), CHECKOUT / path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # where its dataclasses look for themselves
    spec.loader.exec_module(module)
    return module
