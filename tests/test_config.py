"""rig.toml: what is read, and how a mistake is told."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import stickslip as ss
from stickslip.answers.preparation import with_sensors
from stickslip.errors import ModelError
from stickslip.rig.settings import RigSettings, read_rig, rig_settings

WHOLE = """
mass = "3.0799 kg"
stiffness = "1.191 N/mm"   # a bare number would be N/m
damping = 0.669
damper = "base"
repair = ["clock", "drift:x"]
rows = "15:"
[channels]
x = "x [mm]"
[normal]
"*250g*" = "0.25 kg"
"*" = 5
"""


def written(folder: Path, text: str) -> Path:
    path = folder / "rig.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_whole_file_is_read_into_si(tmp_path: Path) -> None:
    rig = read_rig(written(tmp_path, WHOLE))
    assert (rig.mass, rig.stiffness, rig.damping, rig.damper, rig.contact) == (3.0799, 1191.0, 0.669, "base", "ground")
    assert rig.channels == {"x": "x [mm]"}
    assert rig.row_range() == (15, None)
    assert rig.normal_load("s_b_250g_x.mat").value == pytest.approx(0.25 * 9.80665)
    assert rig.normal_load("other.csv").value == 5.0


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("# rig\nmas = 3", ["line 2", "'mas'", "the keys known are mass,", "perhaps mass is meant"]),
        ("mass = .3", ["line 1", "write 0.3"]),
        ("x = 1\nnormal = [1, -.5]", ["line 2", "write -0.5"]),
        ("mass = 'three'", ["line 1", "'three' is not a finite number"]),
        ("mass = inf", ["line 1", "not a finite number"]),
        ("mass = nan", ["line 1", "not a finite number"]),
        ("mass = true", ["line 1", "a number in kg"]),
        ("mass = 0", ["greater than 0"]),
        ("mass = '3 N'", ["measured in N"]),
        ("stiffness = -3", ["line 1", "greater than or equal to 0"]),
        ("damper = 'wall'", ["line 1", "'ground' or 'base'"]),
        ("fs = 100\n[channels]\nx = 3", ["line 3", "channels.x", "string"]),
        ("[normal]\n'*a*' = '2 mm'", ["line 2", "measured in m"]),
        ("repair = ['clok']", ["line 1", "clock, gaps, missing"]),
        ("rows = 'a:'", ["line 1", "FIRST:LAST"]),
        ("mass 3", ["line 1", "not TOML", "KEY = VALUE"]),
        ("mass = ", ["line 1", "not TOML"]),
    ],
)
def test_a_mistake_is_one_sentence_that_names_the_line(tmp_path: Path, text: str, told: list[str]) -> None:
    with pytest.raises(ModelError) as caught:
        read_rig(written(tmp_path, text))
    sentence = str(caught.value)
    assert "\n" not in sentence
    assert "rig.toml" in sentence
    assert all(part in sentence for part in told), sentence
    assert caught.value.exit_code == 2


def test_a_file_that_is_absent_or_binary_is_told(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match="can not be read"):
        read_rig(tmp_path / "absent.toml")
    (tmp_path / "image.toml").write_bytes(b"\xff\xfe\x00mass")
    with pytest.raises(ModelError, match="not UTF-8"):
        read_rig(tmp_path / "image.toml")


def one_sentence(make: Callable[[], RigSettings]) -> str | None:
    """None for settings, the sentence for a refusal; anything else fails the test."""
    try:
        make()
    except ModelError as error:
        return str(error) if "\n" not in str(error) else "several lines"
    return None


@given(st.text(max_size=60))
def test_any_text_gives_settings_or_one_sentence(tmp_path_factory: pytest.TempPathFactory, text: str) -> None:
    path = tmp_path_factory.mktemp("any") / "rig.toml"
    path.write_text(text, encoding="utf-8", errors="replace")
    refused = one_sentence(lambda: read_rig(path))
    assert refused is None or "rig.toml" in refused


@given(st.dictionaries(st.sampled_from(list(RigSettings.model_fields)), st.integers() | st.text(max_size=5)))
def test_any_values_give_settings_or_one_sentence(values: dict[str, object]) -> None:
    refused = one_sentence(lambda: rig_settings(values))
    assert refused is None or "the settings" in refused


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('[sensors.a]\nmount = ["125 Hz"]', "line 2, sets sensors.a.mount = .* 2 values are needed"),
        ('[sensors.x]\ndelay = "1.26 mm"', "sets sensors.x.delay = '1.26 mm'; unit 'mm' is measured in m"),
        ("[sensors.a]\nmout = 3", "has the key 'sensors.a.mout'; the keys known are delay, .*perhaps mount is meant"),
        ('[sensors.a]\nmount = ["125 Hz", 0.1, 3]', "it should have at most 2 items"),
    ],
)
def test_a_mistake_in_a_sensor_is_named_by_its_key(text: str, words: str, tmp_path: Path) -> None:
    with pytest.raises(ModelError, match=words):
        read_rig(written(tmp_path, text))


@pytest.mark.parametrize("size", [4, 1_000_000], ids=["in parts", "whole"])
def test_what_is_stated_of_a_sensor_reaches_whatever_is_asked(tmp_path: Path, size: int) -> None:
    """Only `analyze` and `fit` took it in: a joint's late torque, stated, was left as it was, without a word."""
    path = ss.write_record(ss.Record.of({"x": range(10), "load": range(10)}, fs=2.0), tmp_path / "run.csv")
    rig = ss.rig.rig_settings({"sensors": {"load": {"delay": "15 ms"}}})
    readers = [ss.answers.read_parts([path], rig=rig, size=size), [ss.answers.read_mended([path], rig=rig)]]
    for record in itertools.chain(*readers):
        assert record.channels["load"].delay == 0.015
        assert sum(step.action == "with_details" for step in record.history) == 1
        assert with_sensors(record, rig) is record
