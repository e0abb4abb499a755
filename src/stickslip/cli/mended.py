"""The command as it was typed, without what made it fail."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Sequence

from stickslip.errors import MISSTATED, TOO_SHORT, StickslipError

# Of each kind of error the options without which the command may succeed.
CAUSES = {MISSTATED: ("--delimiter", "--decimal"), TOO_SHORT: ("--rows",)}


def mended(arguments: Sequence[str], error: StickslipError) -> Iterator[str]:
    """Two lines with the command that mends an error, where leaving an option out may do it."""
    kept = list(_without(arguments, CAUSES.get(error.kind, ())))
    if len(kept) < len(arguments):
        yield "To mend it:"
        yield shlex.join(["stickslip", *kept])


def _without(arguments: Sequence[str], options: Sequence[str]) -> Iterator[str]:
    """The words but these options and their values."""
    words = iter(arguments)
    for word in words:
        if word in options:
            next(words, None)
        elif word.partition("=")[0] not in options:
            yield word
