"""What stands beside the code: the citation, the forms for issues, what is said to be supported."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest
import yaml

import smoke
import stickslip as ss

ROOT = Path(__file__).resolve().parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
FORMS = sorted(path for path in (ROOT / ".github" / "ISSUE_TEMPLATE").glob("*.yml") if path.stem != "config")


def test_the_citation_is_of_this_version_and_licence() -> None:
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text("utf-8"))
    assert {"cff-version", "message", "title", "authors"} <= cited.keys()  # what the format requires
    assert cited["version"] == ss.__version__
    assert " AND ".join(cited["license"]) == PROJECT["license"]
    assert cited["authors"] == PROJECT["authors"]


@pytest.mark.parametrize("path", FORMS, ids=lambda path: path.stem)
def test_a_form_has_what_a_form_needs(path: Path) -> None:
    form = yaml.safe_load(path.read_text("utf-8"))
    assert form["name"]
    assert form["description"]
    names = [field["id"] for field in form["body"]]
    assert len(set(names)) == len(names) > 0
    assert all(field["type"] in ("input", "textarea") and field["attributes"]["label"] for field in form["body"])
    assert any(field.get("validations", {}).get("required") for field in form["body"])


def test_a_python_is_stated_only_where_it_was_tried() -> None:
    stated = {found[1] for line in PROJECT["classifiers"] if (found := re.search(r":: (3\.\d+)$", line))}
    tried = re.findall(
        r"^\| ([\d., ]+) \|.*smoke test", (ROOT / "docs" / "support.md").read_text("utf-8"), re.MULTILINE
    )
    assert stated == {version for row in tried for version in row.split(", ")}
    assert PROJECT["requires-python"] == f">={smoke.OLDEST}"
