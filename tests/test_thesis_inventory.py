"""The inventory names commands, functions and tests that there are, and every figure; it stands in the docs."""

from __future__ import annotations

import doctest
import functools
import re
from pathlib import Path

import click
import pytest

import stickslip as ss
from stickslip.cli.program import main
from stickslip_thesis import printed

ROOT = Path(__file__).parent.parent
PAGE = ROOT / "docs" / "thesis_inventory.md"


def by_item(item: printed.Item) -> str:
    return f"{item.section} {item.what}"


ITEMS = pytest.mark.parametrize("item", printed.items(), ids=by_item)


@ITEMS
def test_its_commands_and_functions_exist(item: printed.Item) -> None:
    for name in item.by:
        kind, *path = name.split(" ") if name.startswith("stickslip ") else name.split(".")
        assert kind in ("stickslip", "ss"), name
        if kind == "ss":
            functools.reduce(getattr, path, ss)
            continue
        command: click.Command = main
        for word in path:
            assert isinstance(command, click.Group), name
            command = command.commands[word]


@ITEMS
def test_its_test_exists(item: printed.Item) -> None:
    if item.test:
        file, _, name = item.test.partition("::")
        assert re.search(rf"^def {name}\(", (ROOT / "tests" / f"{file}.py").read_text("utf-8"), re.MULTILINE), item.test
    assert bool(item.test) == (item.state != printed.MISSING)
    assert bool(item.seen) == (item.state != printed.MISSING)


def test_every_figure_of_the_thesis_is_in_it() -> None:
    assert {figure for item in printed.items() for figure in item.figures} == set(printed.captions())


def test_the_page_has_the_table() -> None:
    assert PAGE.read_text("utf-8").endswith(printed.inventory(printed.items()) + "\n"), (
        f"below its first paragraph {PAGE} holds: print(printed.inventory(printed.items()))"
    )


def test_the_examples_run() -> None:
    assert not doctest.testmod(printed).failed
