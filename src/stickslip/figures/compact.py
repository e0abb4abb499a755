"""An SVG written short: places on a grid, in long paths from one to the next."""

from __future__ import annotations

import functools
import re

import numpy as np

from stickslip.arrays import Index

LONG = 400  # letters: markers and ticks stay as they are
PLACES = {"M": 1, "L": 1, "Q": 2, "C": 3, "z": 0}  # that follow a letter
_PATH = re.compile(r'(?<= d=")[^"]*')
_FAMILY = re.compile(r"font-family: ([^;\"]+); ")
_LETTER = re.compile("[MLCQz]")


def compact(svg: str) -> str:
    """The same picture: places to a hundredth of a point, in long paths to a tenth and from one to the next."""
    svg = _PATH.sub(lambda path: _short(path[0]) if len(path[0]) > LONG else _rounded(path[0]), svg)
    svg = re.sub(r' (x|y)="(-?\d+\.\d\d)\d+"', r' \1="\2"', svg)
    svg = re.sub(r' transform="rotate\(-?0 [^"]*"', "", svg)
    return _family_once(re.sub(r">\s+<", "><", svg))


def _family_once(svg: str) -> str:
    """The letters' family as a property of the whole picture where it is the same for all."""
    families = set(_FAMILY.findall(svg))
    if len(families) != 1:
        return svg
    family = families.pop().replace('"', "&quot;")
    return _FAMILY.sub("", svg).replace("<svg ", f'<svg font-family="{family}" ', 1)


def _rounded(path: str) -> str:
    return re.sub(r"(\.\d\d)\d+", r"\1", path)


def _short(path: str) -> str:
    """A path by steps on a grid of tenths; what goes on along one axis is one step.

    Examples
    --------
    >>> _short("M 10 10 L 11.04 10 L 12 10 L 12 12.52 C 13 13 14 13 15 12 z M 10 11 L 10 12")
    'm10 10h2v2.5c1 .5 2 .5 3-.5zm0 1v1'
    """
    letters = _LETTER.findall(path)
    counts = np.array([PLACES[letter] for letter in letters])
    places = np.rint(10 * np.fromstring(_LETTER.sub(" ", path), sep=" ")).astype(np.int64).reshape(-1, 2)
    stops = np.cumsum(counts)
    last = _ends(letters, stops)
    before = np.vstack([np.zeros((1, 2), np.int64), places[last[:-1]]])
    relative = places - np.repeat(before, counts, axis=0)
    steps = places[last] - before
    along = (np.array(letters) == "L") & (steps == 0).any(axis=1)
    same = along[1:] & along[:-1] & (np.sign(steps[1:]) == np.sign(steps[:-1])).all(axis=1)
    firsts = np.concatenate([[0], np.flatnonzero(~same) + 1])
    written = []
    for first, (across, down) in zip(firsts.tolist(), np.add.reduceat(steps, firsts).tolist(), strict=True):
        if letters[first] == "L":
            written.append(_line(across, down))
        else:
            own = relative[stops[first] - counts[first] : stops[first]]
            written.append(letters[first].lower() + _joined(own.ravel().tolist()))
    return "".join(written)


def _ends(letters: list[str], stops: Index) -> Index:
    """The row of the place where each step ends: of one that closes a path the place where that began."""
    ends = stops - 1
    begun = np.maximum.accumulate(np.where(np.array(letters) == "M", ends, 0))
    return np.where(np.array(letters) == "z", begun, ends)


@functools.lru_cache(1 << 16)
def _line(across: int, down: int) -> str:
    if across and down:
        return "l" + _joined([across, down])
    return f"h{_tenths(across)}" if across else f"v{_tenths(down)}" if down else ""


def _joined(numbers: list[int]) -> str:
    """Numbers with a blank between two only where they would run together.

    Examples
    --------
    >>> _joined([4, -4, 6, -10, 6, -16])
    '.4-.4.6-1 .6-1.6'
    """
    joined, before = "", ""
    for number in map(_tenths, numbers):
        alone = not before or number[0] == "-" or (number[0] == "." and "." in before)
        joined, before = joined + (number if alone else f" {number}"), number
    return joined


def _tenths(number: int) -> str:
    """
    >>> _tenths(-3), _tenths(25), _tenths(40)
    ('-.3', '2.5', '4')
    """
    whole, tenth = divmod(abs(number), 10)
    return "-" * (number < 0) + (str(whole) if whole or not tenth else "") + (f".{tenth}" if tenth else "")
