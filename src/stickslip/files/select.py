"""Which columns of which files become which channels, in which units, and which column is time."""

from __future__ import annotations

import itertools
import re
from collections import Counter
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

from stickslip.errors import RecordError, StickslipError
from stickslip.files.expression import Linear, Spec, apply_sensitivity, channel_unit, linear, split_spec, unknown
from stickslip.files.table import Block, Column, Table, supplied, unique
from stickslip.printing import printable
from stickslip.record.channels import UNSTATED, VOCABULARY, Channel, checked_name, described
from stickslip.record.metadata import checksum
from stickslip.units import LONGEST, Unit, parse_unit

_SLASH = re.compile(r"[\[(][^\[(\])]*[\])]|([/\\])")  # one in brackets belongs to a unit


def titled(table: Table) -> Table:
    """The table with the units that stand in its columns' titles taken out of them; what the file states counts."""
    if table.record:  # written by write_record: the names are names
        return table
    parts = [split_name(column.name) if column.unit else _titled(column.name) for column in table.columns]
    parts = [
        (name, unit) if column.unit is None or column.name.rstrip().endswith("]") else (column.name, None)
        for column, (name, unit) in zip(table.columns, parts, strict=True)
    ]
    names = unique([name for name, _ in parts])
    written = dict(zip(names, (column.name for column in table.columns), strict=True))
    columns, notes = [], list(table.notes)
    for name, (title, unit), column in zip(names, parts, table.columns, strict=True):
        columns.append(replace(column, name=name, unit=column.unit or unit))
        if name != title:
            notes.append(f"another column is called {title}: it is {name}")
        if unit and column.unit not in (None, unit):
            notes.append(f"{name} is titled in {unit}, stated in {column.unit}")
    if names == list(written.values()):
        return table

    def blocks(wanted: Sequence[str], size: int) -> Iterator[Block]:
        for block in table.blocks([written[name] for name in wanted], size):
            yield {name: block[written[name]] for name in wanted}

    return replace(table, columns=tuple(columns), blocks=blocks, notes=tuple(notes))


def _titled(text: str) -> tuple[str, str | None]:
    """As :func:`split_name`; ``"x_mm"`` too, where the word is a channel's and the unit one of it."""
    word = text.rpartition("_")[0]
    unit = unit_in_name(text, word) if word in VOCABULARY else None
    return (word, unit) if unit else split_name(text)


def split_name(text: str) -> tuple[str, str | None]:
    """Part ``"x [mm]"``, ``"x (mm)"``, ``"x, mm"``, ``"x / mm"`` or ``"x in mm"`` into name and unit."""
    text = text.strip()
    name, bracket, unit = text[:-1].rpartition("[") if text.endswith("]") else ("", "", "")
    if bracket and name.strip() and "]" not in unit:
        return name.strip(), unit.strip()
    # no two parts that fit the same signs: a title of any length is read in one pass
    match = re.fullmatch(r"(.*?)(?:\(([^()]*(?:\([^()]*\)[^()]*)?)\)|,([^,]+)|\s(?:/|in)\s(\S+))", text)
    if match and match[1].strip():
        unit = (match[2] or match[3] or match[4] or "").strip()
        if is_unit(unit):
            return match[1].strip(), unit
    return text, None


def is_unit(text: str) -> bool:
    """Whether a text is a unit that is known."""
    if not text or len(text) > 20:
        return False
    try:
        parse_unit(text)
    except StickslipError:
        return False
    return True


def unit_in_name(name: str, quantity: str) -> str | None:
    """The unit that a name ends in, where it is one of the quantity: of the channels, or "s" for time.

    Examples
    --------
    >>> unit_in_name("Weg_um", "x"), unit_in_name("Zeit_ms", "s"), unit_in_name("acc_g", "a"), unit_in_name("x_2", "x")
    ('um', 'ms', 'g', None)
    """
    _, stands, unit = last_part(name).rpartition("_")
    kinds = VOCABULARY[quantity].units if quantity in VOCABULARY else (quantity,)
    for kind in kinds if stands and unit and len(unit) <= 20 else ():
        with suppress(StickslipError):
            parse_unit(unit, expect=kind)
            return unit
    return None


def last_part(name: str) -> str:
    """The name without the path before it."""
    return path_parts(name)[-1]


def path_parts(name: str) -> list[str]:
    """A name's parts between slashes of either kind."""
    slashes = [match.start() for match in _SLASH.finditer(name) if match[1]]
    return [name[before + 1 : after] for before, after in itertools.pairwise([-1, *slashes, len(name)])]


TIME_WORDS = (
    "t", "time", "timestamp", "timestamps", "elapsed", "timeelapsed", "elapsedtime", "xvalue", "zeit", "times",
    "seconds", "timechannel", "testtime", "runtime", "tiempo", "tempo", "tijd", "czas", "время", "时间", "時間", "시간",
)  # fmt: skip


@dataclass(frozen=True)
class Source:
    """One file: its table, and what the history says of it."""

    path: Path
    format: str
    table: Table
    bytes: int

    @cached_property
    def entry(self) -> dict[str, str | int]:
        """Plain data for the history: asked last, of what could be read, since a large file's sum takes a while."""
        entry: dict[str, str | int] = {**file_entry(self.path), "bytes": self.bytes, "format": self.format}
        return entry | ({"cut": self.table.cut} if self.table.cut else {})


def file_entry(path: Path) -> dict[str, str]:
    """Name, sum and folder of a file, that as it was typed, unless it says where this machine keeps it."""
    folder = printable(str(path.parent))
    with supplied(path):
        place = {} if folder == "." or path.is_absolute() else {"folder": folder}
        return {"name": printable(path.name), **place, "sha256": checksum(path)}


Key = tuple[int, str]  # the file's number and the column's name


@dataclass(frozen=True)
class Wanted:
    """A channel to be made: ``scale * (offset + sum(scales * columns))``."""

    channel: Channel
    scale: float
    scales: Mapping[Key, float]
    offset: float


@dataclass(frozen=True)
class TimeColumn:
    """The time column of a file, the seconds in its unit, and columns of the same title that must agree with it.

    Where nobody stated its unit it is `assumed` to be in seconds.
    """

    key: Key
    scale: float
    twins: tuple[Key, ...] = ()
    assumed: bool = False


class Columns:
    """The columns of all files under every name that they may be called by, with the units stated for them.

    `units` are by channel, or by any name of a column; what names one of the `channels` asked for means the channel.
    """

    def __init__(
        self, sources: Sequence[Source], units: Mapping[str, str] | None = None, channels: Iterable[str] = ()
    ) -> None:
        self.sources, self.units = sources, units or {}
        self.columns: dict[Key, Column] = {
            (number, column.name): column for number, source in enumerate(sources) for column in source.table.columns
        }
        # the columns of one struct are called by its fields: data.t is t
        stems = [_stem(source.table) for source in sources]
        self._fields = {key: key[1].removeprefix(stems[key[0]]) for key in self.columns}
        self.notes: list[str] = []
        self._by_name: dict[str, Key] = {}
        exact = [(name, (number, name)) for number, name in self.columns]
        self._admit(exact)
        for number, source in enumerate(sources):
            numbered = [(f"#{n}", (number, column.name)) for n, column in enumerate(source.table.columns, 1)]
            if len(sources) == 1:
                self._admit(numbered)
            else:
                qualified = [(f"{source.path.name}:{name}", key) for name, key in exact if key[0] == number]
                self._admit(qualified + [(f"{source.path.name}:{name}", key) for name, key in numbered])
        last = [(last_part(name), key) for key, name in self._fields.items()]
        self._admit(last)
        for title in ("{} [{}]", "{} ({})", "{}({})", "{}_{}"):  # as the file may have it
            self._admit([(title.format(name, self.columns[key].unit), key) for name, key in exact])
        self._admit([(_word_of(name), key) for name, key in last])  # as a check-up shows it
        self._stated = {key: unit for name, unit in self.units.items() for key in self._called(name, set(channels))}
        self.constants = {name: value for source in sources for name, value in source.table.constants.items()}

    def _admit(self, pairs: Iterable[tuple[str, Key]]) -> None:
        pairs = list(pairs)
        counts = Counter(name for name, _ in pairs)
        for name, key in pairs:
            if counts[name] == 1:
                self._by_name.setdefault(name, key)

    def _called(self, name: str, channels: Container[str]) -> list[Key]:
        """The columns titled like that, or the one that may be called so."""
        titled, one = [key for key in self.columns if key[1] == name], self.find(name)
        return titled or ([one] if one is not None and name not in channels else [])

    def unit_of(self, key: Key) -> str | None:
        """The unit that is stated for a column, or else in its file."""
        return self._stated.get(key, self.columns[key].unit)

    def find(self, name: str) -> Key | None:
        """The column called by that name, where there is exactly one."""
        return self._by_name.get(name)

    def combination(self, arithmetic: str) -> tuple[dict[Key, float], Linear]:
        """The arithmetic as numbers times columns."""
        first: dict[Key, str] = {}
        names = {name: first.setdefault(key, name) for name, key in self._by_name.items()}
        combined = linear(arithmetic, names, self.constants)
        scales: dict[Key, float] = {}
        for name, scale in combined.scales.items():
            key = self._by_name[name]
            scales[key] = scales.get(key, 0.0) + scale
        return scales, combined

    def asked(self, channels: Mapping[str, str]) -> list[Wanted]:
        """The channels of a channel map."""
        wanted = []
        for name, text in channels.items():
            spec = split_spec(str(text))
            scales, weights = self.combination(spec.arithmetic)
            plain = next(iter(scales)) if weights.plain() else None
            stated = spec.unit if spec.unit is not None else self.units.get(name)
            if stated is None and plain:
                stated = self.unit_of(plain) or unit_in_name(plain[1], name)
            channel, unit = self._channel(checked_name(name), spec, stated)
            wanted.append(Wanted(channel, unit.scale, scales, weights.offset + unit.zero / unit.scale))
        return wanted

    def every(self, times: Mapping[int, TimeColumn]) -> tuple[list[Wanted], list[str]]:
        """All columns that share one clock, named by the vocabulary where they match it; and notes on the others."""
        taken = {time.key for time in times.values()}
        keys = [key for key in self.columns if key not in taken and not self._is_time(key)]
        kept = self._on_one_clock(keys, times)
        others = dict.fromkeys(keys).keys() - dict.fromkeys(kept).keys()
        notes = [f"left out {self.columns[key].name} (another length or rate)" for key in keys if key in others]
        titles = [self._title(key) for key in kept]
        wanted = []
        for name, title, key in zip(unique(titles), titles, kept, strict=True):
            column = self.columns[key]
            if (word := self._word(key)) in VOCABULARY and word != title:
                notes.append(f"'{column.name}' is {name}: {self.unit_of(key)} is no unit of {word}")
            stated = self.units.get(name, self.unit_of(key))
            channel, unit = self._channel(name, Spec(column.name, column.name, None, ""), stated)
            wanted.append(Wanted(channel, unit.scale, {key: 1.0}, unit.zero / unit.scale))
        return wanted, notes

    def _on_one_clock(self, keys: Sequence[Key], times: Mapping[int, TimeColumn]) -> list[Key]:
        """Per file: the columns as long as its time column, or the largest group alike in length and rate."""
        kept: list[Key] = []
        for number in range(len(self.sources)):
            mine = [key for key in keys if key[0] == number]
            alike = Counter((self.columns[key].rows, self.columns[key].fs, self.columns[key].start) for key in mine)
            if number in times:
                rows = self.columns[times[number].key].rows
                kept += [key for key in mine if rows is None or self.columns[key].rows in (None, rows)]
            elif alike:
                chosen = max(alike, key=lambda one: (alike[one], one[0] or 0))
                kept += [k for k in mine if (self.columns[k].rows, self.columns[k].fs, self.columns[k].start) == chosen]
        return kept

    def _title(self, key: Key) -> str:
        """A channel name for a column: a word of the vocabulary where name and unit fit one."""
        last, unit, word = last_part(self._fields[key]), self.unit_of(key), self._word(key)
        if word in VOCABULARY:
            try:
                described(word, channel_unit(unit, word).si if unit else VOCABULARY[word].units[0])
                return word
            except RecordError:
                last = f"{last}_{unit}"
        name = _word_of(last)
        return f"{name}_" if name in VOCABULARY else name

    def _word(self, key: Key) -> str:
        """What a column is called; "Friction" without unit may be a coefficient."""
        last = last_part(self._fields[key])
        return last.lower() if len(last) > 1 and self.unit_of(key) else last

    def _channel(self, name: str, spec: Spec, stated: str | None) -> tuple[Channel, Unit]:
        """The channel's description, and its unit, which leads to SI."""
        source = spec.text.strip()
        if spec.sensitivity:
            if stated is None:
                raise RecordError(
                    f"channel {name} has a sensitivity and no unit",
                    "a sensitivity acts on a reading in a known unit",
                    f"write {spec.arithmetic} [V] @ {spec.sensitivity}",
                )
            unit = apply_sensitivity(spec.sensitivity, parse_unit(stated), name)
        elif stated is None:
            usual = VOCABULARY[name].units[-1 if name == "sound" else 0] if name in VOCABULARY else "1"
            unit = Unit(usual, 1.0, usual)
            source += f"{UNSTATED}taken as {usual})" if usual != "1" else ""
        else:
            unit = self._unit(name, stated)
            source += f" [{stated}]" if spec.unit is None else ""
        weighed = re.search(r"(?:^|[ /(])(m?g)\)?$", spec.sensitivity or stated or "")
        if weighed and unit.si == "kg":
            self.notes.append(f"{name}: {weighed[1]} read as a mass; call the channel a or acc if it is gravity")
        assumed = stated is None and unit.si != "1"
        quantity, sensitivity = described(name, unit.si), spec.sensitivity
        return Channel(name, unit.si, quantity, source, sensitivity, gain_sd=spec.gain_sd, assumed=assumed), unit

    def _unit(self, name: str, stated: str) -> Unit:
        try:
            return channel_unit(stated, name)
        except RecordError:
            own = " ".join(re.sub(r"[][,\"]", " ", printable(stated)).split())[:LONGEST]  # fit for a header: "q [own]"
            if not own or name in VOCABULARY or stated not in {column.unit for column in self.columns.values()}:
                raise
            return Unit(own, 1.0, own)  # a unit of the instrument's own ("counts"): the numbers stay as written

    def time(self, wanted: str | None) -> dict[int, TimeColumn]:
        """The time column of each file that has one: the one asked for, or one recognised by its name."""
        times = {}
        for number in range(len(self.sources)):
            if wanted is not None:
                key = self._asked_time(number, wanted)
            else:
                mine = [key for key in self.columns if key[0] == number]
                named = [key for key in mine if self._is_time(key)]
                named = named or [key for key in mine[:1] if is_unit_of_time(self.columns[key].unit)]
                best = min(named, key=self._time_rank, default=None)
                key = self._time_column(best, named) if best else None
            if key:
                times[number] = key
        if wanted is not None and not times:
            raise unknown("time column", wanted, [name for _, name in self.columns])
        return times

    def _is_time(self, key: Key) -> bool:
        return is_time(replace(self.columns[key], name=self._fields[key]))

    def _time_rank(self, key: Key) -> tuple[int, bool]:
        word = _word(replace(self.columns[key], name=self._fields[key]))
        rank = 0 if word in ("t", "time") else 1 if "elapsed" in word else 2
        return rank, self.columns[key].unit is None

    def _time_column(self, best: Key, named: Sequence[Key]) -> TimeColumn:
        twins = [key for key in named if re.fullmatch(re.escape(best[1]) + r"_\d+", key[1])]
        stated = self.unit_of(best) or unit_in_name(self._fields[best], "s")
        return TimeColumn(best, parse_unit(stated or "s", expect="s").scale, tuple(twins), stated is None)

    def _asked_time(self, number: int, wanted: str) -> TimeColumn | None:
        spec = split_spec(wanted)
        table = self.sources[number].table
        by_name = {f"#{n}": column for n, column in enumerate(table.columns, 1)}
        by_name |= {last_part(column.name): column for column in table.columns}
        by_name |= {column.name: column for column in table.columns}
        column = by_name.get(spec.arithmetic.strip("`"))
        if column is None:
            return None
        stated = spec.unit or self.unit_of((number, column.name)) or unit_in_name(column.name, "s")
        return TimeColumn((number, column.name), parse_unit(stated or "s", expect="s").scale, assumed=stated is None)

    def check_units(self, channels: Iterable[str]) -> None:
        """Refuse a unit for something that is neither a channel nor a column."""
        known = list(dict.fromkeys([*channels, *(name for _, name in self.columns)]))
        for name in self.units:
            if name not in known and self.find(name) is None:
                raise unknown("channel or column", name, known)


def _word_of(title: str) -> str:
    """A title as one word that can name a channel."""
    name = re.sub(r"[^A-Za-z0-9_]+", "_", title).strip("_")
    return name if name and not name[0].isdigit() else f"c_{name}".rstrip("_")


def is_time(column: Column) -> bool:
    """Whether a column is time by its name, and its unit does not contradict."""
    if _word(column) not in TIME_WORDS:
        return False
    return column.unit is None or is_unit_of_time(column.unit)


def is_unit_of_time(unit: str | None) -> bool:
    """Whether a unit is stated, and one of time."""
    try:
        return unit is not None and parse_unit(unit).si == "s"
    except RecordError:
        return False


def _stem(table: Table) -> str:
    """The name of the one struct that holds all columns, with its dot; empty where there is none."""
    stems = {
        match[1] if (match := re.match(r"([A-Za-z]\w*\.)[A-Za-z]", column.name)) else "" for column in table.columns
    }
    return stems.pop() if len(stems) == 1 and len(table.columns) > 1 else ""


def _word(column: Column) -> str:
    last = last_part(column.name)
    if column.unit is None and (unit := unit_in_name(last, "s")):
        last = last.removesuffix(f"_{unit}")
    last = last.lower()
    return re.sub(r"[\W\d_]", "", last)
