"""How the command line says what a sentence says to a Python user; and the command as it was typed, mended."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator, Sequence

from stickslip.errors import MISSTATED, TOO_SHORT, StickslipError

REPAIRS = {
    "repair_clock": "clock",
    "fill_gaps": "gaps",
    "fill_missing": "missing",
    "remove_spikes": "spikes",
    "restore_clipped": "clipping",
    "remove_drift": "drift",
}  # a function's name, and what --repair calls it
_SPOKEN = (
    (r"\b(the command line|the run) sets (\w+)", r"\1 sets --\2"),
    (r"\brecord\.check\(\)", "stickslip check"),
    (r"\brecord\.rows\(\)", "--rows"),
    (r"\brecord\.between\([^)]*\)", "--rows"),
    (r", or trust='samples'[^;.]*", ""),
    (r"\bask friction_loops\(record\)", "ask stickslip analyze"),
    (r", or ask (?:extreme|fit)_decay\(record\)[^;.]*", ""),
    (r', or choose form="plain"[^;.]*', ""),
    (r" \(see choose_motion\)", ""),
    (r"; use log_decrement or fit_decay instead", ""),
    (r'\brestoring="pendulum"', "--restoring pendulum"),
    (r"\brecord\.rows\((\d+), (\d+)\)", r"--rows \1:\2"),
    (r'\bchannel="(\w+)"', r"--channel \1"),
    (r'\bchannels=\{"(\w+)": "([^"]*)"\}', r'--channels "\1=\2"'),
    (r'\btime="([^"]*)"', r'--time "\1"'),
    (r'\bfriction_force\(record, \.\.\., method="(\w+)"\)', r"--method \1"),
    (
        r"\b(channels|channel|frequencies|normal|rows|units|fs|time|delimiter|decimal|method|damper|contact|mass|stiffness|lever|calibration)=(?=\W|$)",
        r"--\1",
    ),
)
# Of each kind of error the options without which the command may succeed.
CAUSES = {MISSTATED: ("--delimiter", "--decimal"), TOO_SHORT: ("--rows",)}


def spoken(words: object) -> str:
    """A sentence with the options of the command line for what it says of Python."""

    def repair(call: re.Match[str]) -> str:
        word = REPAIRS.get(call[1])
        return call[0] if word is None else f"--repair {word}" + (f":{call[2]}" if call[2] else "")

    text = re.sub(r"\bfill_gaps\(record\) and fill_missing\(record\)", "--repair gaps,missing", str(words))
    text = re.sub(r'\b(\w+)\(record(?:, "(\w+)")?\)', repair, text)
    for said, option in _SPOKEN:
        text = re.sub(said, option, text)
    return text


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
