"""What the thesis prints and describes, as the data files have it.

Its numbers, with the verdict on each; what the chapters start from; the captions; and the inventory: by what each thing
is had here, what is seen, and the test that decides it.
"""

from __future__ import annotations

import functools
import tomllib
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

HERE = Path(__file__).parent
SAME, PUT_IN, CORRECTED, AMBIGUOUS = "same", "put in", "corrected", "ambiguous"
CONTRADICTS, NOT_PRINTED, DIFFERS = "contradicts itself", "not printed", "ours differs"
CHANGED = "changed"  # of a number whose verdict our number does not bear out
MEANINGS = {
    SAME: "ours comes out of the printed parameters and rounds to the printed digits",
    PUT_IN: "the model or its twin starts from this number, and its records give it back: no test of it",
    CORRECTED: "another number should have been printed, and is ours",
    AMBIGUOUS: "follows under one reading of the text and not under others",
    CONTRADICTS: "the printed parameters that it should follow from give another number",
    NOT_PRINTED: "what it was taken from is not printed; ours, where there is one, is of a twin",
    DIFFERS: "measured on the rig, and the model gives another number",
}
Given = Mapping[str, Mapping[str, Any]]
Ours = Mapping[str, float | Sequence[float] | None]
WORKS, PART, MISSING = "works", "in part", "missing"
HEAD = "| section | what | command or function | what is seen | test | |\n|---|---|---|---|---|---|"


@dataclass(frozen=True)
class Number:
    """One printed number.

    Attributes
    ----------
    label : str
        Which of its row it is ("m = 3"); empty where the row holds no other.
    printed : str
        As printed, with its digits.
    expected : str
        The verdict that holds, one of `MEANINGS`.
    instead : str or None
        What should have been printed, with its digits: ours has to round to it.
    tolerance : float
        How far ours may be: half a unit of the last printed digit, unless the row says more.
    why : str
        Why it is not the same.
    """

    label: str
    printed: str
    expected: str
    instead: str | None
    tolerance: float
    why: str

    def verdict(self, ours: float | None) -> str:
        """The expected verdict if our number bears it out; "changed" if it does not."""
        near = _agrees(ours, self.printed, self.tolerance)
        if self.instead is not None:
            return self.expected if not near and _agrees(ours, self.instead, half_unit(self.instead)) else CHANGED
        if self.expected in (NOT_PRINTED, CONTRADICTS) and ours is None:
            return self.expected
        return self.expected if near else CHANGED


@dataclass(frozen=True)
class Row:
    """One row of a table of the thesis, or one number of its text.

    Attributes
    ----------
    quantity, unit : str
        What it is.
    ours : str
        Its name among the numbers of its chapter.
    numbers : tuple of Number
        Its entries.
    again : str
        The table that prints the same numbers before: they are counted there.
    """

    quantity: str
    unit: str
    ours: str
    numbers: tuple[Number, ...]
    again: str


@dataclass(frozen=True)
class Table:
    """One table of the thesis, or the numbers of one section.

    Attributes
    ----------
    chapter, name, about : str
        Where it stands and what it is.
    rounding : str
        What was rounded before it was taken further, where that decides a digit.
    rows : tuple of Row
        Its rows.
    """

    chapter: str
    name: str
    about: str
    rounding: str
    rows: tuple[Row, ...]


@functools.cache
def tables() -> tuple[Table, ...]:
    """Every printed number, table by table."""
    return tuple(_table(entry) for entry in read("numbers.toml")["table"])


def given() -> dict[str, dict[str, Any]]:
    """What the chapters start from."""
    return read("given.toml")


@functools.cache
def captions() -> Mapping[str, str]:
    """What each of the thesis's figures shows, in our words."""
    return read("captions.toml")


def judged(table: Table, ours: Ours) -> list[list[tuple[float | None, str]]]:
    """Our number and the verdict, for each entry of each row."""
    return [
        [(value, number.verdict(value)) for number, value in zip(row.numbers, _values(row, ours), strict=True)]
        for row in table.rows
    ]


def half_unit(printed: str) -> float:
    """Half a unit of the last digit.

    Examples
    --------
    >>> half_unit("0.0197"), half_unit("2.5e-3")
    (5e-05, 5e-05)
    """
    mantissa, _, power = printed.lower().partition("e")
    return 0.5 * float(f"1e{int(power or 0) - len(mantissa.partition('.')[2])}")


def _agrees(ours: float | None, printed: str, tolerance: float) -> bool:
    return ours is not None and abs(ours - float(printed)) <= tolerance * (1 + 1e-9) + 1e-12 * abs(float(printed))


def _values(row: Row, ours: Ours) -> list[float | None]:
    computed = ours[row.ours]
    if computed is None:
        return [None] * len(row.numbers)
    return [None if np.isnan(value) else float(value) for value in np.atleast_1d(np.asarray(computed, dtype=float))]


def _table(entry: Mapping[str, Any]) -> Table:
    labels = entry.get("each", [""])
    rows = tuple(_row(row, labels) for row in entry["row"])
    return Table(str(entry["chapter"]), entry["name"], entry["about"], entry.get("rounding", ""), rows)


def _row(row: Mapping[str, Any], labels: Sequence[str]) -> Row:
    printed = row["printed"] if isinstance(row["printed"], list) else [row["printed"]]
    of_all = {key: row[key] for key in ("verdict", "instead", "why", "tolerance") if key in row}
    numbers = [
        _number(label, text, {**of_all, **row.get("except", {}).get(label, {})})
        for label, text in zip(labels, printed, strict=True)
    ]
    return Row(row["quantity"], row.get("unit", "1"), row["ours"], tuple(numbers), row.get("again", ""))


def _number(label: str, printed: str, entry: Mapping[str, Any]) -> Number:
    tolerance = float(entry.get("tolerance", half_unit(printed)))
    return Number(label, printed, entry.get("verdict", SAME), entry.get("instead"), tolerance, entry.get("why", ""))


def read(name: str) -> dict[str, Any]:
    """A data file that lies beside the chapters."""
    return tomllib.loads((HERE / name).read_text("utf-8"))


@dataclass(frozen=True)
class Item:
    """One thing that the thesis describes.

    Attributes
    ----------
    section : str
        Where; "7.2 (2)" is the second section of that number.
    what : str
        In our words.
    by : tuple of str
        Commands ("stickslip decay") and public functions ("ss.decrement").
    seen : str
        What they show.
    figures : tuple of str
        The thesis's figures that show it.
    test : str
        "test_decrement::test_...", empty where nothing decides it.
    left : str
        What is only in part, or missing.
    """

    section: str
    what: str
    by: tuple[str, ...]
    seen: str
    figures: tuple[str, ...]
    test: str = ""
    left: str = ""

    @property
    def state(self) -> str:
        """Works, in part, or missing.

        Examples
        --------
        >>> Item("2.2", "running in", (), "", (), "", "no law wears").state
        'missing'
        """
        return MISSING if not self.by else PART if self.left else WORKS


@functools.cache
def items() -> tuple[Item, ...]:
    """All of them, in the thesis's order."""
    return tuple(
        Item(**{**entry, "by": tuple(entry["by"]), "figures": tuple(entry.get("figures", ()))})
        for entry in read("inventory.toml")["item"]
    )


def inventory(rows: Sequence[Item]) -> str:
    """The items as a table in Markdown, and how many are in each state."""
    counts = Counter(item.state for item in rows)
    total = f"{len(rows)} items: {counts[WORKS]} work, {counts[PART]} in part, {counts[MISSING]} missing."
    return "\n".join([total, "", HEAD, *map(_inventoried, rows)])


def _inventoried(item: Item) -> str:
    by = ", ".join(f"`{name}`" for name in item.by) or "–"
    figures = f" ({', '.join(item.figures)})" if item.figures else ""
    test = f"`{item.test.partition('::')[2]}`" if item.test else "–"
    left = f": {item.left}" if item.left else ""
    return f"| {item.section} | {item.what}{figures} | {by} | {item.seen or '–'} | {test} | {item.state}{left} |"
