"""The first minute: what the terminal prints, and the first screen of the page."""

from __future__ import annotations

import itertools
import json
import re
import shlex
import shutil
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from playwright.sync_api import Browser, Page, sync_playwright

import stickslip as ss
from motions import free_decay
from stickslip.cli.program import main
from stickslip.story.folder import report
from stickslip.story.scope import LEVELS, Panel, Scope
from stickslip.story.story import Caution, Line, Story

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
FS = 500.0
TIME = np.arange(4000) / FS
MAP = ("--channels", "x=pos [mm]", "--channels", "friction=fr [N]")
COMMANDS = {
    "demo": ("demo", "--twins", "0"),
    "analyze": ("analyze", "run.csv", *MAP, "--twins", "0"),
    "compare": ("analyze", "run.csv", "wet.csv", *MAP, "--twins", "0", "--normal", "run*=2", "--normal", "wet*=3"),
    "decay": ("decay", "release.csv"),
    "squeak": ("squeak", "sound.csv"),
    "fit": ("fit", "run.csv", *MAP, "--curve", "stribeck"),
    "simulate": ("simulate", "DH-3 b=0.5 r=0.8"),
    "scenarios": ("simulate", "--list"),
    "rig": ("rig", "FD-4", "--duration", "4", "--fs", "200"),
    "wavelet": ("wavelet", "run.csv", *MAP, "--channel", "friction"),
    "check": ("check", "run.csv", *MAP),
    "datasets": ("datasets",),
}


@pytest.fixture(autouse=True)
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "80")


def slid(friction: float, seed: int = 1) -> ss.Record:
    noise = np.random.default_rng(seed).normal(0, 0.02, TIME.size)
    force = friction * np.sign(np.cos(2 * np.pi * TIME)) + noise
    return ss.Record.of({"x": 0.01 * np.sin(2 * np.pi * TIME), "friction": force}, fs=FS)


def written() -> None:
    """The files that the commands read."""
    for name, friction in (("run", 1.5), ("wet", 2.2)):
        record = slid(friction)
        rows = np.column_stack([TIME, 1e3 * record["x"], record["friction"]])
        np.savetxt(f"{name}.csv", rows, delimiter=",", header="t [s],pos [mm],fr [N]", comments="", fmt="%.6f")
    values, fs, _ = free_decay()
    values = values + 1e-3 * np.random.default_rng(2).standard_normal(len(values))
    ss.write_record(ss.Record.of({"x": values}, fs=fs), "release.csv")
    tone = np.where((TIME > 2) & (TIME < 5), np.sin(2 * np.pi * 120 * TIME), 0.0)
    sound = tone + 0.01 * np.random.default_rng(3).standard_normal(TIME.size)
    ss.write_record(ss.Record.of({"sound": sound}, fs=FS), "sound.csv")


def sentences(text: str) -> list[str]:
    """What is long enough to be a sentence, with its line breaks taken out."""
    parts = re.split(r"(?<=[.;:])\s+|\n\n", re.sub(r"(?<=[^\n])\n\s*(?=[a-z(])", " ", text))
    return [" ".join(part.split()) for part in parts if len(part.split()) > 5]


@pytest.mark.parametrize("name", sorted(COMMANDS))
def test_a_command_tells_its_answer_in_forty_short_lines_and_no_sentence_twice(name: str) -> None:
    written()
    result = CliRunner().invoke(main, COMMANDS[name])
    assert result.exit_code == 0, result.output
    lines = result.stdout.splitlines()
    assert len(lines) <= 40
    if name not in ("check", "rig"):  # what these print is the record's own line
        assert max(map(len, lines)) <= 80
    repeated = [each for each, count in Counter(sentences(result.stdout)).items() if count > 1]
    assert not repeated
    assert not re.search(r"\b(mass|stiffness|damping|channels|units|time|fs|rows|normal)=[\"{ .,]", result.stdout)


def test_all_tells_what_the_short_table_leaves_out() -> None:
    short = CliRunner().invoke(main, COMMANDS["demo"]).stdout
    whole = CliRunner().invoke(main, [*COMMANDS["demo"], "--all"]).stdout
    for words in ("delay of a behind x", "gain of a over x", "Note: Friction force"):
        assert words not in short
        assert words in whole
    assert "More with --all: 12 quantities" in short


def line(name: str, status: str) -> Line:
    return Line.of(ss.Estimate.normal(name, 1.0, sd=0.1, unit="N", method="by hand", status=status))


def test_a_caution_stands_once_and_rows_bear_its_number() -> None:
    shared = "the base moves"
    lines = [line("one", shared), line("two", "ok"), line("three", f"{shared} fast")]
    general = Caution("no delay is stated")
    story = Story("record", ["It slides."], [Caution(shared, ["one"]), general], lines=lines)
    assert [story.marks(line) for line in lines] == ["1", "", "2"]
    assert [notice.reason for notice in story.notices] == [shared, f"{shared} fast", "no delay is stated"]
    assert [story.mark(notice) for notice in story.notices] == ["1", "2", ""]
    said = Story("record", [f"It slides, but {shared}."], lines=lines[:1])
    assert not said.notices, "the headline says it already"


def test_a_record_of_a_million_samples_makes_a_light_page() -> None:
    count = 1_000_000
    wave = np.sin(np.arange(count) / 300)
    panels = [Panel(name, "m", {"measured": wave, "model": 0.9 * wave, "z": wave}) for name in ("x", "a", "load", "f")]
    scope = Scope(0.0, 2000.0, panels, "a model", panels[0], np.arange(0, 500, 0.4), 0.4, "ask {first}:{last}")
    told = scope.packed()
    assert len(json.dumps(told)) < 900_000  # the figures of such a record take 450 kB: the page stays under 1.5 MB
    assert told["panels"][0]["merit"] == pytest.approx(90.0)
    first, last = told["detail"]
    assert 15 * (last - first) <= 270_000  # lines


def test_the_fitted_decay_lies_on_the_record_that_it_was_fitted_to() -> None:
    """It is fitted to means over blocks of many samples, and drawn at the samples."""
    released = ss.Oscillator(mass=1.0, stiffness=10.0, damping=0.2, law=ss.laws.Coulomb(0.2))
    record = ss.simulate(released, duration=40.0, start={"x": 1.0}).record(fs=500.0)
    scope = ss.summary(ss.analyze_decay(record, stiffness=10.0)).scope
    assert scope is not None
    merits = [panel["merit"] for panel in scope.packed()["panels"] if "merit" in panel]
    assert merits[0] > 99.99
    left = scope.panels[1].lines["left"]
    assert np.nanmax(np.abs(left)) < 1e-4, "of a motion of 1 m"


def test_what_the_page_draws_is_the_record_to_its_last_digit() -> None:
    import base64

    values = np.array([-3.0, np.nan, 0.25, 7.0])
    told = Scope(0.0, 1.0, [Panel("x", "1", {"measured": values})]).packed()["panels"][0]["lines"]["measured"]
    levels = np.frombuffer(base64.b64decode(told["detail"]), "<u2").astype(float)
    levels[levels > LEVELS] = np.nan
    np.testing.assert_allclose(told["low"] + told["step"] * levels, values, atol=10.0 / LEVELS)


def rig_written(columns: str) -> None:
    """A rig's noisy x, z and a in a file with these columns."""
    slider = ss.Oscillator(
        mass=2.0, stiffness=3000.0, damping=1.0, law=ss.laws.Coulomb(1.2), drive=ss.drives.HarmonicBase(2e-3, 4.0)
    )
    run = ss.simulate(slider, duration=8.0).record(fs=2000)
    seen = run.rows(4000, 16000)
    rng = np.random.default_rng(4)
    noisy = [
        seen[name] + size * rng.standard_normal(len(seen)) for name, size in (("x", 2e-7), ("z", 2e-7), ("a", 1e-3))
    ]
    rows = np.column_stack([seen.time, *noisy])
    np.savetxt("rig.csv", rows, delimiter=",", header=columns, comments="", fmt="%.9g")


ASKED = ["analyze", "rig.csv", "--mass", "2", "--stiffness", "3000", "--damping", "1", "--twins", "0"]


def mending(options: list[str]) -> list[str]:
    """The command that stands under the answer."""
    result = CliRunner().invoke(main, [*ASKED, *options])
    lines = result.stdout.splitlines()
    assert lines[2].startswith("Probably "), result.output
    (command,) = (line for line in lines if line.startswith("stickslip analyze"))
    return shlex.split(command)


@pytest.mark.parametrize(
    ("wrong", "cure"),
    [("acc / 9.80665", "9.80665 * (acc / 9.80665) [m/s^2]"), ("-1 * acc", "-1 * (-1 * acc) [m/s^2]")],
)
def test_the_one_slip_that_explains_a_contradiction_leads_with_the_command_that_mends_it(wrong: str, cure: str) -> None:
    rig_written("t [s],plate [m],base [m],acc [m/s^2]")
    named = ["--channels", "x=plate [m]", "--channels", "z=base [m]", "--channels", f"a={wrong} [m/s^2]"]
    words = mending(named)
    assert f"a={cure}" in words
    mended = CliRunner().invoke(main, [*words[1:], "--twins", "0"])
    assert "The contact slides against 1.2" in mended.stdout, mended.output


def test_channels_that_a_file_names_are_mended_too_each_with_its_own_unit() -> None:
    rig_written("t [s],a [m/s^2],z [m],x [m]")  # x and a exchanged
    words = mending([])
    named = [word for before, word in itertools.pairwise(words) if before == "--channels"]
    assert sorted(named) == ["a=x [m/s^2]", "x=a [m]", "z=z [m]"]
    mended = CliRunner().invoke(main, [*words[1:], "--twins", "0"])
    assert "The contact slides against 1.2" in mended.stdout, mended.output


# ---- in a browser


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    if CHROMIUM is None:
        pytest.skip("no chromium on this machine (apt-get install chromium)")
    with sync_playwright() as play:
        browser = play.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox", "--disable-gpu"])
        yield browser
        browser.close()


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A page of a record from row 500 of a file."""
    folder = tmp_path_factory.mktemp("page")
    path = ss.write_record(slid(1.5), folder / "run one.csv")
    record = ss.read_record(path, channels={"x": "x [m]", "friction": "friction [N]"}, rows=(500, 3500))
    findings = ss.analyze(record)
    stated = {**findings.settings, "mass": 2.0, "damper": "base"}
    return report(replace(findings, settings=stated), folder / "report.html").as_uri()


def opened(browser: Browser, address: str, **options: Any) -> Page:
    page = browser.new_page(**{"viewport": {"width": 1280, "height": 800}, **options})
    page.wrong = []  # type: ignore[attr-defined]
    page.on("pageerror", lambda error: page.wrong.append(str(error)))  # type: ignore[attr-defined]
    page.on("request", lambda asked: page.wrong.append(asked.url) if asked.url != address else None)  # type: ignore[attr-defined]
    page.goto(address)
    page.locator("[data-part=chart]").wait_for()
    return page


def test_a_selected_span_gives_the_command_that_analyses_it(browser: Browser, address: str) -> None:
    page = opened(browser, address)
    page.get_by_role("button", name="All", exact=True).click()
    box = page.locator("[data-part=chart]").bounding_box()
    assert box is not None
    left, wide = box["x"] + 52, box["width"] - 56  # the axis of time: all 3000 samples
    page.mouse.move(left + wide / 4, box["y"] + 60)
    page.mouse.down()
    page.mouse.move(left + wide / 2, box["y"] + 60, steps=4)
    page.mouse.up()
    words = shlex.split(page.locator("[data-part=command]").inner_text())
    assert words[:2] == ["stickslip", "analyze"]
    assert words[2] == "run one.csv", "not where this machine keeps it"
    assert (words[words.index("--mass") + 1], words[words.index("--damper") + 1]) == ("2", "base")
    assert [words[place + 1] for place, word in enumerate(words) if word == "--channels"] == [
        "x=x [m]",
        "friction=friction [N]",
    ]
    first, last = map(int, words[words.index("--rows") + 1].split(":"))
    assert (first, last) == (pytest.approx(500 + 750, abs=6), pytest.approx(500 + 1500, abs=6))
    page.get_by_role("button", name="Zoom to it").click()
    assert not page.locator("[data-part=asked]").is_visible()
    assert page.wrong == []  # type: ignore[attr-defined]
    page.close()


def test_a_click_picks_a_cycle_and_the_pointer_reads_values(browser: Browser, address: str) -> None:
    page = opened(browser, address)
    shown = page.locator("[data-part=cycle]")
    before = shown.inner_text()
    assert re.fullmatch(r"cycle \d of \d", before)
    page.get_by_role("button", name="Next cycle").click()
    after = shown.inner_text()
    assert after != before
    page.mouse.wheel(0, 0)
    box = page.locator("[data-part=chart]").bounding_box()
    assert box is not None
    page.mouse.click(box["x"] + 60, box["y"] + 50)
    assert shown.inner_text() == "cycle 1 of 6"
    assert re.search(r" s: x .* mm; friction .* N", page.locator("[data-part=reading]").inner_text())
    assert page.wrong == []  # type: ignore[attr-defined]
    page.close()


@pytest.mark.parametrize("size", [(1280, 800), (390, 844)])
def test_the_first_screen_holds_answer_record_loop_and_table(
    browser: Browser, address: str, size: tuple[int, int]
) -> None:
    width, height = size
    page = opened(browser, address, viewport={"width": width, "height": height}, color_scheme="dark")
    for part in (".lead", "[data-part=chart]", "[data-part=loop]", ".brief tbody tr:nth-child(4)"):
        box = page.locator(part).first.bounding_box()
        assert box is not None, part
        assert box["y"] + box["height"] <= height, part
        assert box["x"] + box["width"] <= width, part
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert page.locator("details[open]").count() == 0
    assert page.locator("details").count() > 5
    drawn = "[...document.querySelectorAll('canvas')].every(c => c.getContext('2d')" + (
        ".getImageData(0, 0, c.width, c.height).data.some(v => v > 0))"
    )
    assert page.evaluate(drawn)
    page.close()


def test_without_scripts_the_figures_stand_in(browser: Browser, address: str) -> None:
    page = browser.new_page(java_script_enabled=False)
    page.goto(address)
    assert page.locator("noscript svg").count() == 1
    assert not page.locator("[data-part=chart]").is_visible()
    page.close()


def test_what_a_file_says_ends_no_script(tmp_path: Path) -> None:
    evil = "</script><script>alert(1)</script>"
    findings = ss.analyze(slid(1.5))
    record = findings.record
    step = ss.record.Step("read_record", {"files": [{"name": evil}], "channels": {"x": evil}})
    page = report(replace(findings, record=replace(record, history=(step,))), tmp_path / "report.html")
    text = page.read_text(encoding="utf-8")
    assert "<script>alert" not in text
    assert text.count("</script>") == 2
