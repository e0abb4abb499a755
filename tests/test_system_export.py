"""A system written down again is the same system, to the last digit."""

from __future__ import annotations

import dataclasses
import json
import runpy
from pathlib import Path

import pytest

import stickslip as ss

# one of every law and drive that the scenarios have; a run of any of the others says no more
SEEN: dict[str, str] = {ss.systems.scenario_case(name).parts: name for name in ss.scenarios.names()}


@pytest.mark.parametrize("name", SEEN.values())
def test_what_is_written_is_read_back(name: str, tmp_path: Path) -> None:
    case = ss.systems.scenario_case(name)
    text = ss.systems.export_system(case)
    file = tmp_path / "system.toml"
    file.write_text(text, encoding="utf-8")
    again = [
        ss.systems.read_system(file),
        ss.systems.read_system(json.loads(ss.systems.export_system(case, format="json"))),
    ]
    for other in again:
        assert (other.start, other.run, other.about) == (case.start, case.run, case.about)
        assert ss.systems.export_system(other) == text


@pytest.mark.parametrize("name", SEEN.values())
def test_the_program_makes_the_same_system(name: str, tmp_path: Path) -> None:
    case = ss.systems.scenario_case(name)
    made, mark, _ = ss.systems.export_system(case, format="python").partition("result = ")
    assert mark
    program = tmp_path / "system.py"
    program.write_text(made, encoding="utf-8")
    assert ss.systems.export_system(runpy.run_path(str(program))["case"]) == ss.systems.export_system(case)


def test_what_a_file_can_not_name_is_refused() -> None:
    case = ss.systems.scenario_case("FD-4")
    own = ss.laws.FrictionCurve(lambda v: 1 + 0.2 / (1 + v))
    with pytest.raises(ss.errors.ModelError, match="Python function"):
        ss.systems.export_system(dataclasses.replace(case, system=case.system.having(law=own)))
    with pytest.raises(ss.errors.ModelError, match="one of toml, json, python"):
        ss.systems.export_system(case, format="yaml")
