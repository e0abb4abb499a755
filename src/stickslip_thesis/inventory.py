"""What the thesis describes, item by item: by what it is had here, what is seen, and the test that decides it."""

from __future__ import annotations

import functools
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from stickslip_thesis.printed import read

WORKS, PART, MISSING = "works", "in part", "missing"
HEAD = "| section | what | command or function | what is seen | test | |\n|---|---|---|---|---|---|"


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
    test: str
    left: str

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
        Item(
            entry["section"],
            entry["what"],
            tuple(entry["by"]),
            entry["seen"],
            tuple(entry.get("figures", ())),
            entry.get("test", ""),
            entry.get("left", ""),
        )
        for entry in read("inventory.toml")["item"]
    )


def table(rows: Sequence[Item]) -> str:
    """The items as a table in Markdown, and how many are in each state."""
    counts = Counter(item.state for item in rows)
    total = f"{len(rows)} items: {counts[WORKS]} work, {counts[PART]} in part, {counts[MISSING]} missing."
    return "\n".join([total, "", HEAD, *map(_row, rows)])


def _row(item: Item) -> str:
    by = ", ".join(f"`{name}`" for name in item.by) or "–"
    figures = f" ({', '.join(item.figures)})" if item.figures else ""
    test = f"`{item.test.partition('::')[2]}`" if item.test else "–"
    left = f": {item.left}" if item.left else ""
    return f"| {item.section} | {item.what}{figures} | {by} | {item.seen or '–'} | {test} | {item.state}{left} |"


PAGE = """# What the thesis describes, and what is here of it

Every observation, experiment, model and method of the text, from section to section, with the figures of the thesis in
brackets: the command or function that has it, what is seen, the test that decides it, and what is only in part or
missing. It is written by `python -m stickslip_thesis.inventory` from `inventory.toml`; a test holds that each command,
function and test exists and that no figure is left out.
"""

if __name__ == "__main__":
    print(f"{PAGE}\n{table(items())}")
