"""Every option of every command with a wrong value: one sentence that names it, and nothing is ignored."""

from __future__ import annotations

import contextlib
import io
import json
import math
import re
import traceback
from pathlib import Path

import click
import pytest

from limits import civil, limited, program
from stickslip.cli.program import main
from stickslip.printing import printable
from test_sweep_cli import GRID, SLIDER

RECORD = "t [s],x [m],friction [N]\n" + "".join(
    f"{n / 1000},{math.exp(-n / 150) * math.sin(n / 5)},{(-1) ** (n // 9)}\n" for n in range(300)
)
SMOOTH = SLIDER.replace('name = "Coulomb", kinetic = 1.1', 'name = "CompliantContact", kinetic = 1.1, stiffness = 2e5')
NUMBERS = ["", "-1", "nan", "inf", "-inf", "1e400", "1,5", "0x10", "none", "½", "5 lux", "9**9**9", "9" * 5000]
TEXTS = ["../", "folder", "nowhere", "a\x1b[31mb", "two\nlines", "\u202e\x07", "\udcff", "a=b=c", "=", "a" * 5000]
CALLS: dict[str, list[str]] = {
    "acquire": ["--device=sim", "--seconds=0.02", "--output=out.h5", "--json"],
    "analyze": ["x.csv"],
    "bench next": ["slider.toml", "smooth.toml", "--json"],
    "bench tour": ["--fast", "--json"],
    "bifurcation": ["slider.toml", "law.kinetic", "--from=0.2", "--to=0.8", "--steps=2", "--json"],
    "check": ["x.csv"],
    "commission": ["--device=sim", "--step=rest", "--json"],
    "convert": ["x.csv", "out.csv", "--force"],
    "decay": ["x.csv", "--json"],
    "demo": ["--json"],
    "devices": ["--json"],
    "dither": ["slider.toml", "--json"],
    "fit": ["x.csv", "--json", "--mass=1", "--stiffness=100"],
    "impact": ["x.csv", "--json"],
    "init": ["x.csv", "--yes", "--force"],
    "joint": ["x.csv", "--json", "--kp=100"],
    "lab": ["--no-browser"],
    "predict": ["slider.toml", "x.csv", "--no-plain", "--json"],
    "rig join": ["x.csv", "x.csv", "--json"],
    "rig measure": ["slider.toml", "--json"],
    "simulate": ["slider.toml", "--json"],
    "squeak": ["x.csv", "--json"],
    "stability": ["slider.toml", "--json"],
    "sweep": ["grid.toml", "--json"],
    "thesis": ["6"],
    "tribometer": ["x.csv", "--json"],
    "wavelet": ["x.csv", "--json"],
}
MEANT = {("stability", "--speed"): {"-1"}}  # a face may run either way
FOLDERS = ("--output", "--store", "--records")  # any name is right that the system takes
OF_FOLDERS = ["x.csv", "x.csv/within", "a" * 5000]
END = tuple[str, str, int, str]  # option, value, exit code, what was said


@pytest.fixture
def place(tmp_path: Path) -> Path:
    (tmp_path / "folder").mkdir()
    for name, text in {"x.csv": RECORD, "slider.toml": SLIDER, "smooth.toml": SMOOTH, "grid.toml": GRID}.items():
        (tmp_path / name).write_text(text)
    return tmp_path


def commands() -> dict[str, click.Command]:
    """Every command, those of a group as "rig join"."""
    found: dict[str, click.Command] = {}
    for name, command in main.commands.items():
        inner = command.commands if isinstance(command, click.Group) else {}
        found |= {f"{name} {of}": one for of, one in inner.items()} or {name: command}
    return found


def wrong_values(option: click.Parameter) -> list[str]:
    """Values of every kind, none of which the option can mean."""
    return OF_FOLDERS if option.opts[0] in FOLDERS else [*NUMBERS, *TEXTS]


def ask_wrongly(command: str, every: int) -> None:
    """Options of a command with every so-many-th of their wrong values, from another one on for each option.

    How each ends is printed as JSON.
    """
    ends: list[END] = []
    for place, option in enumerate(commands()[command].params):
        if isinstance(option, click.Argument) or getattr(option, "is_flag", False):
            continue
        meant = MEANT.get((command, option.opts[0]), set())
        for value in (value for value in wrong_values(option)[place % every :: every] if value not in meant):
            with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.redirect_stderr(io.StringIO()) as err:
                try:
                    main([*command.split(), *CALLS[command], f"{option.opts[0]}={value}"], prog_name="stickslip")
                except SystemExit as end:
                    code = end.code if isinstance(end.code, int) else 1
                except Exception:  # noqa: BLE001  (whatever gets out is what the test looks for)
                    code = 70
                    traceback.print_exc()
            ends.append((option.opts[0], value, code, err.getvalue() or out.getvalue()[:200]))
    print(json.dumps(ends))


@pytest.mark.parametrize("every", [3, pytest.param(1, marks=pytest.mark.soak)], ids=["some", "all"])
@pytest.mark.parametrize("command", CALLS)
def test_a_wrong_value_is_refused_in_a_sentence_that_names_it(place: Path, command: str, every: int) -> None:
    ends: list[END] = json.loads(civil(limited(ask_wrongly, command, every, folder=place)).out)
    assert ends
    assert not [(option, value[:40], code, said[:400]) for option, value, code, said in ends if not refused(code, said)]
    assert not [(option, value[:40], said[:400]) for option, value, _, said in ends if not names(said, option, value)]


def refused(code: int, said: str) -> bool:
    sentence = said.partition("To mend it:\n")[0]  # a command may follow
    return code in (1, 2) and sentence.startswith("stickslip: ") and sentence.count("\n") == 1


def names(said: str, option: str, value: str) -> bool:
    """Whether the option is named, or its value, or a part of one of several parts."""
    shown = [
        " ".join(printable(part[:40]).split()) for part in (*re.split("[=,/]", value, maxsplit=1), str(Path(value)))
    ]
    return option in said or option[2:].replace("-", "_") in said or any(part and part in said for part in shown)


def test_every_command_is_asked() -> None:
    assert CALLS.keys() | {"datasets"} == commands().keys(), "datasets has no option"


@pytest.mark.parametrize(
    "words",
    [
        ["check", "x.csv", "--time", ""],
        ["check", "x.csv", "--delimiter", ""],
        ["check", "x.csv", "--repair", ","],
        ["fit", "x.csv", "--mass=1", "--stiffness=100", "--laws", ""],
        ["decay", "x.csv", "--mass", ""],
        ["rig", "slider.toml", "--json", "--fs", "1e12"],
    ],
    ids=" ".join,
)
def test_nothing_is_ignored_and_nothing_is_too_much(place: Path, words: list[str]) -> None:
    ended = civil(program(*words, folder=place))
    assert ended.code == 2
    assert words[-2] in ended.err or words[-2][2:] in ended.err


def test_a_damaged_list_among_the_attributes_of_hdf5_is_not_read(place: Path) -> None:
    """A text's type is turned into a list's: HDF5 would read outside its memory."""
    h5py = pytest.importorskip("h5py")
    with h5py.File(place / "a.h5", "w") as file:
        file["x"] = [float(n) for n in range(90)]
        file["x"].attrs["units"] = "mm"
        file.attrs["fs"] = 100.0
    whole = (place / "a.h5").read_bytes()
    kind = whole.index(b"units\0\0\0\x19\x01") + 9
    assert program("check", "a.h5", folder=place).out.startswith("Record(x [m]; 90 samples, 100 Hz")
    for damage in (0x00, 0x09, 0x5B, 0xFF):
        (place / "a.h5").write_bytes(whole[:kind] + bytes([damage]) + whole[kind + 1 :])
        assert civil(program("check", "a.h5", folder=place)).code in (0, 1)
