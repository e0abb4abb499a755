"""Small files that ask for much: each is tried in a process of its own and ends in an answer or in one sentence."""

from __future__ import annotations

import os
from pathlib import Path

import click
import pytest

import stickslip as ss
from limits import civil, program
from stickslip.cli.records import groups_of
from stickslip.settings import read_toml

# ---- settings


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("[" * 100_000, "not TOML"),
        ("mass = " + "[" * 100_000, "nested"),
        ("mass = " + "1" * 5000, "digits"),
        ("# " + "x" * 1_100_000, "1 MB"),
    ],
    ids=["tables in tables", "lists in lists", "a long number", "a long file"],
)
def test_settings_that_no_one_wrote_by_hand_are_one_sentence(tmp_path: Path, text: str, sentence: str) -> None:
    path = tmp_path / "rig.toml"
    path.write_text(text)
    with pytest.raises(ss.ModelError, match=sentence) as refused:
        read_toml(path, what="a rig's settings are")
    assert len(str(refused.value)) < 400


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no named pipes")
def test_settings_are_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "rig.toml")
    outcome = civil(program("check", "x.csv", "--config", "rig.toml", folder=tmp_path))
    assert outcome.code != 0
    for read in (ss.read_rig, ss.read_system, ss.read_sweep):
        with pytest.raises(ss.ModelError, match="no file of its own"):
            read(tmp_path / "rig.toml")


# ---- patterns


def test_the_second_pattern_is_looked_for_where_the_first_one_is(tmp_path: Path) -> None:
    folder = tmp_path / "runs"
    folder.mkdir()
    for name in ("a_x.csv", "a_y.csv", "b_x.csv", "b_y.csv"):
        (folder / name).touch()
    paired = [[folder / "a_x.csv", folder / "a_y.csv"], [folder / "b_x.csv", folder / "b_y.csv"]]
    assert groups_of(f"{folder}/*_x.csv+*_y.csv") == paired
    assert groups_of(f"{folder}/a_x.csv+a_y.csv") == paired[:1]
    assert groups_of(f"{folder}/*_x.csv+{folder}/*_y.csv") == paired
    with pytest.raises(click.BadParameter, match=r"no file is called, or fits, '\*_z.csv'"):
        groups_of(f"{folder}/*_x.csv+*_z.csv")
