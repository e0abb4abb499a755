"""What every test may ask for: the public record sets, where this machine has them."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import pytest
from hypothesis import settings

import stickslip
from stickslip import datasets
from stickslip.errors import StickslipError

# Tests read local copies alone: with the variable set, the room never touches the network.
os.environ.setdefault("STICKSLIP_DATA", str(Path(__file__).resolve().parents[2] / "shared" / "data"))

# The program tries its answers on 40 twins unless told otherwise, which takes seconds: test_twin.py asks for them.
os.environ.setdefault("STICKSLIP_TWINS", "0")

# What is not compiled yet is waited for: no process is begun that compiles beside, but by test_meanwhile.py.
os.environ.setdefault("STICKSLIP_WAIT", "1")

# The same examples in every run: a change is what makes a test fail, not chance.
# pytest --hypothesis-profile=default looks further.
settings.register_profile("same", derandomize=True, deadline=None)
settings.load_profile("same")


@pytest.fixture(autouse=True)
def _figures_closed() -> Iterator[None]:
    """What a test draws with pyplot is not kept for the next: from twenty figures on matplotlib warns."""
    yield
    if "matplotlib.pyplot" in sys.modules:
        sys.modules["matplotlib.pyplot"].close("all")


@pytest.fixture(autouse=True)
def _figures_where_looked_at(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Folders of results without figures, which take four fifths of a command's time, but in tests marked `figures`."""
    if request.node.get_closest_marker("figures") is None:
        monkeypatch.setattr(stickslip, "publish", partial(stickslip.publish, figures=False))


@pytest.fixture(autouse=True)
def _loudness_where_heard(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """As where the extra `sound` is not installed, but in tests marked `loudness`: it takes seconds to load."""
    if request.node.get_closest_marker("loudness") is None:
        monkeypatch.setitem(sys.modules, "mosqito", None)


@pytest.fixture(scope="session")
def dataset() -> Callable[[str], Path]:
    """``dataset(name)``: the folder of a public record set, or a skip that says why it is absent."""

    def folder(name: str) -> Path:
        if name not in datasets.names():
            raise AssertionError(f"no record set is called '{name}'")
        try:
            return datasets.fetch(name).folder
        except StickslipError as absent:
            pytest.skip(f"record set {name}: {absent}")

    return folder
