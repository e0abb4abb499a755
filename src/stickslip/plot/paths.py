"""An SVG written short: long paths by steps of a tenth of a point, which is finer than a screen."""

from __future__ import annotations

import math
import re

LONG = 400  # letters: markers and ticks stay as they are
NEAR = 0.8  # tenths of a point: a place this near to a line is on it
MOST = 60  # places that one line may pass
_PATH = re.compile(r'(?<= d=")[^"]*')
_FAMILY = re.compile(r"font-family: ([^;\"]+); ")
_STEP = re.compile(r"([MLCQz])([^MLCQz]*)")
Place = tuple[int, int]


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
    """A path by steps on a grid of tenths.

    Examples
    --------
    >>> _short("M 10 10 L 11.04 10 L 12 10 L 12 12.52 C 13 13 14 13 15 12 z")
    'm10 10h2v2.5c1 .5 2 .5 3-.5z'
    """
    written: list[str] = []
    here: Place = (0, 0)
    passed: list[Place] = []  # since the last place written, on one straight line with it

    def write_line() -> None:
        nonlocal here
        if passed and passed[-1] != here:
            written.append(_line(passed[-1][0] - here[0], passed[-1][1] - here[1]))
            here = passed[-1]
        passed.clear()

    for letter, numbers in _STEP.findall(path):
        places = _places(numbers)
        if letter == "L":
            if len(passed) > MOST or not _straight(here, passed, places[0]):
                write_line()
            passed.append(places[0])
            continue
        write_line()
        written.append(letter.lower() + _joined([n for x, y in places for n in (x - here[0], y - here[1])]))
        here = places[-1] if places else here
    write_line()
    return "".join(written)


def _places(numbers: str) -> list[Place]:
    values = [round(10 * float(number)) for number in numbers.split()]
    return list(zip(values[::2], values[1::2], strict=True))


def _straight(start: Place, passed: list[Place], end: Place) -> bool:
    """Whether a line from start to end passes all places between within NEAR, and none lies beyond its ends."""
    across, down = end[0] - start[0], end[1] - start[1]
    length = math.hypot(across, down)
    for x, y in passed:
        along = (x - start[0]) * across + (y - start[1]) * down
        off = abs((x - start[0]) * down - (y - start[1]) * across)
        if not 0 <= along <= length**2 or off > NEAR * length:
            return False
    return True


def _line(across: int, down: int) -> str:
    if across and down:
        return "l" + _joined([across, down])
    return f"h{_tenths(across)}" if across else f"v{_tenths(down)}"


def _joined(numbers: list[int]) -> str:
    """Numbers with a blank between two only where they would run together."""
    joined = ""
    for number in map(_tenths, numbers):
        alone = not joined or number[0] == "-" or (number[0] == "." and "." in joined[joined.rfind(" ") + 1 :])
        joined += number if alone else f" {number}"
    return joined


def _tenths(number: int) -> str:
    """
    >>> _tenths(-3), _tenths(25), _tenths(40)
    ('-.3', '2.5', '4')
    """
    whole, tenth = divmod(abs(number), 10)
    return "-" * (number < 0) + (str(whole) if whole or not tenth else "") + (f".{tenth}" if tenth else "")
