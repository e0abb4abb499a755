"""rig.toml: a rig's constants, channel map and habits, written down once for all its files."""

from __future__ import annotations

import fnmatch
import re
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError

from stickslip.errors import ModelError, RecordError
from stickslip.units import parse_value

REPAIRS = ("clock", "gaps", "missing", "spikes", "clipping", "drift")


def _in(unit: str) -> BeforeValidator:
    """A number in `unit`, or text with its own unit ("3.08 kg")."""

    def read(value: object) -> object:
        if isinstance(value, bool) or not isinstance(value, (int, float, str)):
            raise ValueError(f"a number in {unit}, or text like '2.5 {unit}', is needed")
        try:
            return parse_value(value, unit)
        except RecordError as error:
            raise ValueError(str(error).rstrip(".")) from error

    return BeforeValidator(read)


def _row_range(value: object) -> object:
    if not re.fullmatch(r"\s*(-?\d+)?\s*:\s*(-?\d+)?\s*", str(value)):
        raise ValueError("rows are written FIRST:LAST, either of which may be left out")
    return value


def _repair(value: object) -> object:
    word, colon, channel = str(value).partition(":")
    if word not in REPAIRS or bool(colon) != bool(channel):
        raise ValueError(f"a repair is one of {', '.join(REPAIRS)}, for one channel alone as in drift:x")
    return value


def _one_or_many(value: object) -> object:
    return value if isinstance(value, Mapping) else {"*": value}


class RigSettings(BaseModel):
    """What is known of a rig before any record is read; every entry may be left out.

    Attributes
    ----------
    mass, stiffness, damping : float or None
        Oscillating mass [kg], spring [N/m], viscous damping [N s/m] of the suspension (not of the contact).
    damper : {"ground", "base"}
        What the viscous damper ends on: the ground, or the moving base beside the spring.
    contact : {"ground", "base"}
        What the mass slides on.
    channels : dict of str to str
        Name in the record -> column, with arithmetic and unit ("vir * 35.1507 [N]").
    fs : float or None
        Sampling rate [Hz], for a file that states none.
    units : dict of str to str
        Unit of a column, where its header states none.
    normal : dict of str to float
        Normal load [N] by file name or pattern ("*250g*"); a single number holds for every file.
    repair : tuple of str
        Repairs made to every record after reading, in the order given: clock, gaps, missing, spikes, clipping,
        drift; see :func:`mend`.
    time : str or None
        The column that holds the time, where its header does not say so.
    delimiter, decimal : str or None
        Of text files, where they can not be told from the file.
    rows : str or None
        Rows to keep of each file, as "FIRST:LAST".

    Examples
    --------
    >>> rig = RigSettings(mass="250 g", stiffness=1191, normal={"*250g*": "2.45 N"})
    >>> rig.mass, rig.normal_load("s_b_250g_x.mat"), rig.normal_load("other.csv")
    (0.25, 2.45, None)
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    mass: Annotated[float, _in("kg"), Field(gt=0)] | None = None
    stiffness: Annotated[float, _in("N/m"), Field(ge=0)] | None = None
    damping: Annotated[float, _in("N s/m"), Field(ge=0)] | None = None
    damper: Literal["ground", "base"] = "ground"
    contact: Literal["ground", "base"] = "ground"
    channels: dict[str, str] = Field(default_factory=dict)
    fs: Annotated[float, _in("Hz"), Field(gt=0)] | None = None
    units: dict[str, str] = Field(default_factory=dict)
    normal: Annotated[dict[str, Annotated[float, _in("N"), Field(gt=0)]], BeforeValidator(_one_or_many)] = Field(
        default_factory=dict
    )
    repair: tuple[Annotated[str, BeforeValidator(_repair)], ...] = ()
    time: str | None = None
    delimiter: str | None = None
    decimal: Literal[".", ","] | None = None
    rows: Annotated[str, BeforeValidator(_row_range)] | None = None

    def normal_load(self, name: str) -> float | None:
        """The normal load [N] stated for a file of this name; the first pattern that fits decides."""
        fits = (load for pattern, load in self.normal.items() if fnmatch.fnmatch(name, pattern))
        return next(fits, None)

    def row_range(self) -> tuple[int, int | None] | None:
        """`rows` as the pair (first, last), last excluded."""
        if self.rows is None:
            return None
        first, last = self.rows.split(":")
        return int(first or 0), int(last) if last.strip() else None


def rig_settings(values: Mapping[str, Any], *, source: str = "the settings", lines: Iterable[str] = ()) -> RigSettings:
    """Check settings given as plain data; the first fault found is told in one sentence.

    Parameters
    ----------
    values : mapping
        Keys as in :class:`RigSettings`.
    source : str
        Where they come from, for the message.
    lines : iterable of str
        The text they were read from, so that the message can name the line.

    Returns
    -------
    RigSettings

    Raises
    ------
    ModelError
        An unknown key, or a value that has no meaning.

    Examples
    --------
    >>> rig_settings({"mass": "250 g"}).mass
    0.25
    """
    try:
        return RigSettings.model_validate(dict(values))
    except ValidationError as error:
        first = error.errors(include_url=False, include_context=False)[0]
        path = [str(part) for part in first["loc"] if not str(part).startswith("function-")]
        where = f"{source}{_line_of(path, list(lines))}"
        key = ".".join(path[:2]) if path[0] in ("channels", "units", "normal") else path[0]
        if first["type"] == "extra_forbidden":
            raise ModelError(
                f"{where} has the key '{key}'",
                f"the keys known are {', '.join(RigSettings.model_fields)}",
                _nearest(key, RigSettings.model_fields),
            ) from error
        raise ModelError(
            f"{where} sets {key} = {first['input']!r}",
            first["msg"].removeprefix("Value error, ").replace("Input should", "it should"),
            f"correct {key}",
        ) from error


def read_rig(path: str | Path) -> RigSettings:
    """Read a rig's constants and channel map from a TOML file.

    Parameters
    ----------
    path : path
        A file such as::

            mass = "3.08 kg"          # a bare number is SI
            stiffness = 1191
            damper = "base"
            [channels]
            x = "x [mm]"
            [normal]
            "*250g*" = "2.45 N"

    Returns
    -------
    RigSettings

    Raises
    ------
    ModelError
        The file can not be read, is not TOML, has a key that is not known or a value without meaning.

    Examples
    --------
    >>> import tempfile
    >>> path = Path(tempfile.mkdtemp()) / "rig.toml"
    >>> _ = path.write_text("mass = 3.0799\\nstiffness = '1.191 N/mm'")
    >>> read_rig(path).stiffness
    1191.0
    """
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8-sig")
        values = tomllib.loads(text)
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is not UTF-8 text"
        raise ModelError(
            f"{path.name} can not be read ({reason})", "a rig's settings are a TOML file", "check the path"
        ) from error
    except tomllib.TOMLDecodeError as error:
        raise _not_toml(path.name, text, str(error)) from error
    return rig_settings(values, source=path.name, lines=text.splitlines())


def _not_toml(name: str, text: str, reason: str) -> ModelError:
    found = re.search(r"line (\d+)", reason)
    lines = text.splitlines()
    number = int(found[1]) if found else len(lines)
    line = lines[number - 1].strip() if 0 < number <= len(lines) else ""
    bare_point = re.search(r"(?:^|[=\[,\s])([-+]?)\.(\d+)", line)
    if bare_point:
        sign, digits = bare_point.groups()
        return ModelError(
            f"{name}, line {number}: '{line}'",
            f"TOML does not take a number like {sign}.{digits}",
            f"write {sign}0.{digits}",
        )
    return ModelError(
        f"{name}, line {number}: '{line}'",
        f"this is not TOML ({re.sub(r' ?[(]at .*[)]', '', reason)})",
        "write KEY = VALUE, with text in quotes",
    )


def _line_of(path: list[str], lines: list[str]) -> str:
    """ ", line N" of the innermost key that the text shows."""
    for key in reversed(path):
        pattern = re.compile(rf"""^\s*(\[\s*)?["']?{re.escape(key)}["']?\s*[\]=.]""")
        for number, line in enumerate(lines, start=1):
            if pattern.match(line):
                return f", line {number},"
    return ""


def _nearest(key: str, known: Iterable[str]) -> str:
    import difflib

    close = difflib.get_close_matches(key, list(known), n=1, cutoff=0.5)
    return f"perhaps {close[0]} is meant" if close else "remove it or correct its name"
