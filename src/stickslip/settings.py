"""Files of settings: TOML read key by key, each mistake one sentence with its line and the keys that are known."""

from __future__ import annotations

import difflib
import json
import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar, get_args

from pydantic import BaseModel, BeforeValidator, ConfigDict, ValidationError

from stickslip.errors import ModelError, RecordError
from stickslip.printing import printable
from stickslip.units import parse_value

STRICT = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)
LARGEST = 1_000_000  # bytes of a file of settings; the longest of ours has twenty thousand
SHOWN = 80  # characters of a line or value in a message
Settings = TypeVar("Settings", bound=BaseModel)


def quantity(unit: str) -> BeforeValidator:
    """A number in `unit`, or text with its own unit ("3.08 kg")."""

    def read(value: object) -> object:
        if isinstance(value, bool) or not isinstance(value, (int, float, str)):
            raise ValueError(f"a number in {unit}, or text like '2.5 {unit}', is needed")
        try:
            return parse_value(value, unit)
        except RecordError as error:
            raise ValueError(printable(f"{error.value}; {error.rule}")) from error

    return BeforeValidator(read)


def read_toml(path: Path, *, what: str) -> tuple[dict[str, Any], list[str]]:
    """The values of a TOML file, and its lines, so that a message can name one; `what` it holds is for the message."""
    rule, name = f"{what} a TOML file", path.name or str(path)
    try:
        if path.exists() and not path.is_file():  # a pipe would be waited for
            raise ModelError(f"{name} is no file of its own", rule, "write the settings into a file")
        with path.open("rb") as file:
            data = file.read(LARGEST + 1)
        text = data.decode("utf-8-sig").replace("\r\n", "\n").replace("\r", "\n")
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is not UTF-8 text"
        raise ModelError(f"{name} can not be read ({reason})", rule, "check the path") from error
    if len(data) > LARGEST:
        raise ModelError(f"{name} is larger than {LARGEST / 1e6:g} MB", rule, "name a file of settings")
    return _parsed(text, source=name), text.splitlines()


def _parsed(text: str, *, source: str) -> dict[str, Any]:
    """The values of a text in TOML; ModelError names the line of `source` that is none."""
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise _not_toml(source, text, str(error)) from error
    except RecursionError as error:
        raise ModelError(
            f"{source} is nested too deeply", "settings are tables of a few levels", "write [TABLE] and KEY = VALUE"
        ) from error
    except ValueError as error:  # Python reads no whole number of more digits than a person would write
        raise ModelError(
            f"{source} holds a whole number of thousands of digits",
            "a number is written with at most a few hundred",
            "correct it",
        ) from error


def toml_value(value: Any) -> str:
    r"""A number, a text, a list or an inline table as TOML writes it.

    Examples
    --------
    >>> print(toml_value({"name": 'a sieve of 6"', "forces": (0.5, 1)}))
    { name = "a sieve of 6\"", forces = [0.5, 1] }
    """
    if isinstance(value, Mapping):
        return f"{{ {', '.join(f'{toml_key(key)} = {toml_value(inner)}' for key, inner in value.items())} }}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(toml_value, value))}]"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int | float):
        return repr(value)
    # a text of JSON is one of TOML, which takes no sign of deletion
    return json.dumps(str(value), ensure_ascii=False).replace("\x7f", "\\u007f")


def toml_key(key: str) -> str:
    """A key, in quotes where TOML wants them."""
    bare = key.replace("_", "").replace("-", "").isalnum() and key.isascii()
    return key if bare else toml_value(key)


def toml_lines(values: Mapping[str, Any], *, within: str = "", levels: int = 1) -> Iterator[str]:
    """The lines of a file: plain values first, then a table of each mapping; below so many levels they stand in a line.

    Examples
    --------
    >>> print(*toml_lines({"law": {"name": "Dahl"}, "about": "a sieve"}), sep="\\n")
    about = "a sieve"
    <BLANKLINE>
    [law]
    name = "Dahl"
    """
    tables = {key: value for key, value in values.items() if levels and _holds_tables(value)}
    for key, value in values.items():
        if key not in tables and value is not None and value != {}:
            yield f"{toml_key(key)} = {toml_value(value)}"
    for key, value in tables.items():
        name = f"{within}.{toml_key(key)}" if within else toml_key(key)
        for table in [value] if isinstance(value, Mapping) else value:
            if levels == 1 or not all(map(_holds_tables, table.values())):
                yield from ("", f"[{name}]" if table is value else f"[[{name}]]")
            yield from toml_lines(table, within=name, levels=levels - 1)


def _holds_tables(value: Any) -> bool:
    first = value[0] if isinstance(value, list) and value else value
    return isinstance(first, Mapping) and bool(first)


def checked(
    model: type[Settings], values: Mapping[str, Any], *, source: str, lines: Sequence[str] = (), table: str = ""
) -> Settings:
    """`values` as `model` has them; the first fault found is told in one sentence.

    Parameters
    ----------
    model : subclass of BaseModel
        The keys known.
    values : mapping
        Plain data.
    source : str
        Where it comes from, for the message.
    lines : sequence of str
        The text it was read from, so that the message can name the line.
    table : str
        The table of the file that holds the values, as "law" or "contacts.2.law"; "" for the top.

    Returns
    -------
    BaseModel

    Raises
    ------
    ModelError
        An unknown key, or a value that has no meaning.

    Examples
    --------
    >>> class Spring(BaseModel):
    ...     model_config = STRICT
    ...     stiffness: float
    >>> checked(Spring, {"stiffness": 3}, source="spring.toml").stiffness
    3.0
    """
    try:
        return model.model_validate(dict(values))
    except ValidationError as error:
        faults = error.errors(include_url=False, include_context=False)
        first = min(faults, key=lambda fault: fault["type"] != "extra_forbidden")  # a typo explains what is missing
        path = [str(part) for part in first["loc"] if not str(part).startswith("function-")]
        numbered = [str(part + 1) if isinstance(part, int) else part for part in first["loc"]]  # headings count from 1
        numbered = [part for part in numbered if not part.startswith("function-")]
        within = [*table.split("."), *numbered] if table else numbered
        where = f"{source}{line_of(within, lines)}"
        inner = path[:1]
        for part in path[1:]:  # a key of a table is named with it; an item of a list is not
            if not isinstance(_inside(values, inner), Mapping):
                break
            inner = [*inner, part]
        key = ".".join([table, *inner] if table else inner)
        if first["type"] == "extra_forbidden":
            known = _model_at(model, path).model_fields
            raise ModelError(
                f"{where} has the key '{key}'", f"the keys known are {', '.join(known)}", nearest(path[-1], known)
            ) from error
        kind = model.model_fields[path[0]].annotation if path[0] in model.model_fields else None
        if first["type"] == "missing" and len(inner) < len(path):
            raise ModelError(
                f"{where} sets {key} = {_shown(_inside(values, inner))}",
                f"{int(path[-1]) + 1} values are needed at least",
                f"correct {key}",
            ) from error
        if first["type"] == "missing":
            value = "{ name = ... }" if table else "{ ... }"
            step = f"add {path[0]} = {value if 'dict' in str(kind) else 'VALUE'}"
            raise ModelError(f"{where} has no {key}", f"{key} is needed", step) from error
        raise ModelError(
            f"{where} sets {key} = {_shown(first['input'])}", _mended(first["msg"]), f"correct {key}"
        ) from error


def _model_at(model: type[BaseModel], path: Sequence[str]) -> type[BaseModel]:
    """The model of the table in which the last key of `path` stands."""
    for key in path[:-1]:
        field = model.model_fields.get(key)
        kinds = (field.annotation, *get_args(field.annotation)) if field is not None else ()
        model = next((kind for kind in kinds if isinstance(kind, type) and issubclass(kind, BaseModel)), model)
    return model


def _inside(values: Mapping[str, Any], path: Sequence[str]) -> Any:
    """What stands under the keys of `path`; None where nothing does."""
    for key in path:
        values = values.get(key) if isinstance(values, Mapping) else None  # type: ignore[assignment]
    return values


def _shown(value: object) -> str:
    """A value as Python writes it, not more of it than a sentence bears."""
    text = repr(value)
    return text if len(text) <= SHOWN else f"{text[:SHOWN]}..."


def _mended(message: str) -> str:
    """What a model says of a value, in the words of a settings file."""
    sentence = message.removeprefix("Value error, ").replace("Input should", "it should")
    for said, meant in (("Tuple should", "it should"), ("String should", "it should"), (" after validation", "")):
        sentence = sentence.replace(said, meant)
    return sentence.replace("a valid dictionary", "a table").replace("a valid ", "a ")


def line_of(path: Sequence[str], lines: Sequence[str]) -> str:
    """ ", line N," of the innermost key of `path` that the text shows; a number after a key counts its headings."""
    row, first, last = None, 0, len(lines)
    for depth, key in enumerate(path):
        if key.isdigit():
            continue
        keys = [part for part in path[: depth + 1] if not part.isdigit()]
        dotted = r"\s*\.\s*".join(rf"""["']?{re.escape(part)}["']?""" for part in keys)
        alone = rf"""["']?{re.escape(key)}["']?"""
        pattern = re.compile(rf"^\s*(\[\[?\s*)?(?:{dotted}|{alone})\s*[\]=.]")
        places = [n for n in range(first, last) if pattern.match(lines[n])]
        if not places:
            continue
        number = int(path[depth + 1]) if path[depth + 1 : depth + 2] and path[depth + 1].isdigit() else 1
        headings = [n for n in places if re.match(rf"\s*\[\[?\s*(?:{dotted})\s*\]", lines[n])]
        row = headings[number - 1] if 0 < number <= len(headings) else places[0]
        heading = re.match(r"\s*\[\[?\s*([^\]]*?)\s*\]", lines[row])
        if heading:  # the keys of a table stand between its heading and the next one that is not a part of it
            part = re.compile(rf"\s*\[\[?\s*{re.escape(heading[1])}\s*\.")
            ends = (n for n in range(row + 1, last) if lines[n].lstrip().startswith("[") and not part.match(lines[n]))
            first, last = row + 1, next(ends, last)
    return "" if row is None else f", line {row + 1},"


def nearest(key: str, known: Iterable[str]) -> str:
    """What was perhaps meant by a key that is not known."""
    close = difflib.get_close_matches(key, list(known), n=1, cutoff=0.5)
    return f"perhaps {close[0]} is meant" if close else "remove it or correct its name"


def _not_toml(name: str, text: str, reason: str) -> ModelError:
    match = re.search(r"line (\d+)", reason)
    lines = text.splitlines()
    number = int(match[1]) if match else len(lines)
    line = lines[number - 1].strip()[:SHOWN] if 0 < number <= len(lines) else ""
    bare_point = re.search(r"(?:^|[=\[,\s])([-+]?)\.(\d+)", line)
    if bare_point:
        sign, digits = bare_point.groups()
        rule = f"TOML does not take a number like {sign}.{digits}"
        return ModelError(f"{name}, line {number}: '{line}'", rule, f"write {sign}0.{digits}")
    return ModelError(
        f"{name}, line {number}: '{line}'",
        f"this is not TOML ({re.sub(r' ?[(]at .*[)]', '', reason)})",
        "write KEY = VALUE, with text in quotes",
    )
