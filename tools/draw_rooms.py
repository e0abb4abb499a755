"""Draw the rooms of the house on their floors: ``python tools/draw_rooms.py`` writes docs/images/rooms.svg.

Floors come from the import-linter's contract and imports from the syntax trees, so that the picture is the code's; only
where on its floor a room stands is chosen here. A thin line is an import that no chain of others implies.
"""

from __future__ import annotations

import itertools
import sys
from collections import defaultdict
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from measure import Source, floors

ROOT = Path(__file__).resolve().parents[1]
PICTURE = ROOT / "docs" / "images" / "rooms.svg"
WIDTH, HIGH, BOX = 860, 40, 26  # of the picture, a floor and a room
HELD = "parameters, statistics, estimates, units, errors: what everybody holds"
FIRST_HELD = "parameters"  # from this floor down all rooms are drawn as one
# Where on its floor a room stands, from left (records) to right (simulations).
ACROSS = {
    "cli": 0.38, "lab": 0.66, "story": 0.38, "figures": 0.54, "bench": 0.76, "answers": 0.38, "squeak": 0.57,
    "maps": 0.86, "datasets": 0.06, "systems": 0.72, "scenarios": 0.9, "twin": 0.48, "decay": 0.06, "law": 0.42,
    "rig": 0.68, "consistent": 0.08, "contact": 0.4, "cycle": 0.2, "balance": 0.17, "files": 0.05, "signals": 0.3,
    "solve": 0.8, "oscillator": 0.66, "structure": 0.9, "record": 0.17, "laws": 0.68, "drives": 0.9,
}  # fmt: skip
WAY = (
    ("files", "Record"),
    ("balance", "friction"),
    ("cycle", "Result"),
    ("answers", "Findings"),
    ("story", "Story: page, terminal, results.json, lab"),
)
STYLE = """
svg { color: #222; background: #fff } text { font: 13px sans-serif; fill: currentColor } .name { text-anchor: middle }
.floor { stroke: currentColor; opacity: .12 }
.room { fill: #eef3f8; stroke: #5b7a99 } .on { fill: #fdebd8; stroke: #c8640a }
.import { stroke: #5b7a99; opacity: .4; fill: none } .way { stroke: #c8640a; stroke-width: 3; fill: none }
.what { fill: #a34f00; font-size: 12px; font-style: italic }
@media (prefers-color-scheme: dark) {
svg { color: #ddd; background: #15191e } .room { fill: #22303d } .on { fill: #4a3016 } .what { fill: #f0a860 }
}
"""


def imports_of(placed: set[str]) -> dict[str, set[str]]:
    """The rooms that each room imports."""
    package = ROOT / "src" / "stickslip"
    doors = {package / "__init__.py", package / "__main__.py"}
    sources = [Source(path, package) for path in sorted(package.rglob("*.py")) if path not in doors]
    known = {source.module for source in sources}
    imports: dict[str, set[str]] = defaultdict(set)
    for source in sources:
        room = source.module.split(".")[1]
        imports[room] |= {module.split(".")[1] for module, _ in source.imports(known)} & placed - {room}
    return imports


def bare(imports: dict[str, set[str]]) -> list[tuple[str, str]]:
    """The imports that no chain of others implies."""

    def below(room: str) -> set[str]:
        return {far for near in imports.get(room, ()) for far in {near, *below(near)}}

    return sorted(
        (room, other)
        for room, others in imports.items()
        for other in others
        if not any(other in below(between) for between in others - {other})
    )


def drawn() -> str:
    """The picture as SVG."""
    levels = floors()[1:]  # without the door
    levels = [*levels[: levels.index([FIRST_HELD])], [HELD]]
    place = {
        room: (30 + ACROSS.get(room, 0.5) * (WIDTH - 60), 24 + HIGH * level)
        for level, rooms in enumerate(levels)
        for room in rooms
    }
    place[HELD] = (WIDTH / 2, 24 + HIGH * (len(levels) - 1))
    half = {room: 12 + 3.6 * len(room) for room in place} | {HELD: WIDTH / 2 - 20}
    on_the_way = {room for room, _ in WAY}
    parts = [
        f'<path class="floor" d="M10 {24 + HIGH * (level + 0.5):g}H{WIDTH - 10}"/>' for level in range(len(levels) - 1)
    ]
    parts += [
        f'<path class="import" d="{curve(place[high], place[low])}"/>'
        for high, low in bare(imports_of(set(place) - {HELD}))
    ]
    stations = [place[room] for room, _ in WAY]
    for (x, y), (to_x, to_y) in itertools.pairwise(stations):
        parts.append(f'<path class="way" d="M{x:.0f} {y - BOX / 2:.0f}L{to_x:.0f} {to_y + BOX / 2:.0f}"/>')
    for room, (x, y) in place.items():
        kind = "room on" if room in on_the_way else "room"
        box = f'x="{x - half[room]:.0f}" y="{y - BOX / 2:.0f}" width="{2 * half[room]:.0f}" height="{BOX}" rx="4"'
        parts.append(f'<rect class="{kind}" {box}/><text class="name" x="{x:.0f}" y="{y + 4:.0f}">{room}</text>')
    parts += [
        f'<text class="what" x="{place[room][0] + half[room] + 5:.0f}" y="{place[room][1] + 4:.0f}">{what}</text>'
        for room, what in WAY
    ]
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HIGH * len(levels) + 10}" role="img">'
    title = "<title>The rooms on their floors, and the way of a record through them</title>"
    return "\n".join([head, title, f"<style>{STYLE}</style>", *parts, "</svg>", ""])


def curve(high: tuple[float, float], low: tuple[float, float]) -> str:
    """From the floor of a room to the roof of one below."""
    (x, y), (to_x, to_y) = (high[0], high[1] + BOX / 2), (low[0], low[1] - BOX / 2)
    middle = (y + to_y) / 2
    return f"M{x:.0f} {y:.0f}C{x:.0f} {middle:.0f} {to_x:.0f} {middle:.0f} {to_x:.0f} {to_y:.0f}"


if __name__ == "__main__":
    PICTURE.write_text(drawn(), encoding="utf-8")
