"""The page and the folder: self-contained, escaped, and there as a whole or not at all."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterator
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

import stickslip as ss
from stickslip import whole
from stickslip.answers.findings import Findings
from stickslip.answers.many import compare
from stickslip.answers.questions import analyze
from stickslip.errors import EstimateError, ModelError, StickslipError
from stickslip.estimate import Doubt, Estimate, Status
from stickslip.story import folder as folder_module
from stickslip.story.folder import publish, report
from stickslip.story.story import doubts, interval_of, summary, value_of

VOID = {"meta", "link", "br", "hr", "img", "input"}


class Page(HTMLParser):
    """Tags, attributes and visible text of a page; every tag must be closed."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.attributes: list[tuple[str, str, str | None]] = []
        self.words: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.attributes += [(tag, name, value) for name, value in attrs]
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.attributes += [(tag, name, value) for name, value in attrs]

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.open and self.open[-1] not in ("style", "script"):
            self.words.append(data)

    @property
    def text(self) -> str:
        return " ".join(" ".join(self.words).split())


@pytest.fixture(scope="module")
def demo() -> Findings:
    record = ss.datasets.demo()
    return analyze(record, **{name: record.truth[name] for name in ("mass", "stiffness", "damping")})


def slid(friction: float, normal: float, name: str = "run.csv") -> Findings:
    time = np.arange(4000) / 500
    force = friction * np.sign(np.cos(2 * np.pi * time)) + np.random.default_rng(1).normal(0, 0.02, time.size)
    samples = {"x": 0.01 * np.sin(2 * np.pi * time), "friction": force, "normal": np.full(time.size, normal)}
    return replace(analyze(ss.Record.of(samples, fs=500.0)), name=name)


@pytest.fixture(scope="module")
def light(demo: Findings) -> Findings:
    """Findings of one figure of one line, quick to draw."""
    record = ss.Record.of({"x": demo.record["x"][:500]}, fs=demo.record.fs)
    return replace(demo.having(loops=None, sticks=None), record=record, settings={})


@pytest.fixture(scope="module")
def page(demo: Findings, tmp_path_factory: pytest.TempPathFactory) -> str:
    """The demonstration's page, drawn once."""
    return report(demo, tmp_path_factory.mktemp("page") / "report.html").read_text(encoding="utf-8")


def everything(folder: Path) -> set[str]:
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*")}


def test_the_page_asks_nothing_of_a_network(page: str) -> None:
    parsed = Page(page)
    assert parsed.open == []
    loading = {("img", "src"), ("script", "src"), ("link", "href"), ("iframe", "src"), ("object", "data")}
    assert not [attribute for attribute in parsed.attributes if attribute[:2] in loading]
    links = [str(value) for _, name, value in parsed.attributes if name.endswith("href")]
    assert not [link for link in links if not link.startswith("#")]
    assert not re.search(r"@import|url\((?!#)", page)
    assert len(page) < 2_000_000


def test_the_page_tells_a_person_first_and_everything_after(page: str, demo: Findings) -> None:
    text = Page(page).text
    places = [
        text.index(part)
        for part in (
            "The contact slides against 1.1",
            "True value",
            "What else does it show?",
            "Which numbers were found, and how?",
            "Friction against velocity",
            "Is anything wrong with the record?",
            "Which settings were used?",
            "What was done, in order?",
            "Made by stickslip",
        )
    ]
    assert places == sorted(places)
    assert "mass 2.42" in text
    assert all(step.action in text for step in demo.record.history)


def test_the_page_holds_the_checksum_of_what_was_read(tmp_path: Path) -> None:
    import hashlib

    record = slid(1.0, 2.0).record
    path = ss.write_record(ss.Record.of(dict(record.samples), fs=500.0), tmp_path / "slide.parquet")
    findings = analyze(ss.read_record(path, channels={name: name for name in record}))
    text = report(findings, tmp_path / "report.html").read_text(encoding="utf-8")
    assert hashlib.sha256(path.read_bytes()).hexdigest() in text
    assert findings.name == "slide.parquet"


def test_what_a_file_says_is_text_and_never_markup(demo: Findings, tmp_path: Path) -> None:
    evil = "<script>alert(1)</script>&\"'"
    estimate = Estimate.normal(evil, 1.0, sd=0.1, unit="N", method=evil, status=evil, checks=(evil,))
    step = ss.record.Step(evil, {evil: [{"name": evil}]}, evil)
    record = replace(demo.record, history=(step,))
    findings = replace(demo, name=evil, notes=(evil,), settings={**demo.settings, "damper": evil}, record=record)
    for results, of in ((findings, {}), ([estimate], {"record": record})):
        page = Page(report(results, tmp_path / "report.html", **of).read_text(encoding="utf-8"))
        assert "<script>alert" not in (tmp_path / "report.html").read_text(encoding="utf-8")
        assert evil in page.text


def test_plain_estimates_have_a_page_with_their_record(demo: Findings, tmp_path: Path) -> None:
    friction = Estimate.normal("sliding friction", 1.318, sd=0.004, unit="N", method="by hand")
    text = Page(report([friction], tmp_path / "report.html", record=demo.record).read_text(encoding="utf-8")).text
    assert "1.318 N" in text
    assert "1.310 to 1.326 N" in text
    assert "The check-up found nothing wrong" in text
    for nothing in ([], ["1.3 N"]):
        with pytest.raises(EstimateError, match="a report of"):
            report(nothing, tmp_path / "none.html")  # type: ignore[arg-type]
    assert everything(tmp_path) == {"report.html"}


def test_faults_and_doubts_are_told(tmp_path: Path) -> None:
    findings = slid(1.0, 2.0)
    wave = np.array(findings.record["x"])
    wave[100:103] = np.nan
    faults = tuple(ss.Record.of({"x": wave}, fs=500.0).check())
    doubtful = replace(findings, faults=faults)
    story = summary(doubtful)
    assert story.faults == [str(fault) for fault in faults]
    assert any("1 fault" in caution for caution in story.cautions)
    text = Page(report(doubtful, tmp_path / "r.html").read_text(encoding="utf-8")).text
    assert str(faults[0]) in text


def test_a_comparison_leads_to_each_record(tmp_path: Path) -> None:
    comparison = compare([slid(0.3 * n, n, f"load {n:g}.csv") for n in (1.0, 2.0, 4.0)])
    page = Page(report(comparison, tmp_path / "r.html").read_text(encoding="utf-8"))
    links = [str(value)[1:] for tag, name, value in page.attributes if (tag, name) == ("a", "href")]
    targets = {value for _, name, value in page.attributes if name == "id"}
    assert len(links) == 3
    assert set(links) <= targets
    assert "friction coefficient is 0.3" in page.text


@pytest.mark.parametrize(
    ("estimate", "value", "interval"),
    [
        (Estimate.normal("a", 0.012345, sd=0.0002, unit="m", method=""), "12.3 mm", "12.0 to 12.7 mm"),
        (Estimate.normal("stuck share of the time", 0.521, sd=0.02, unit="1", method=""), "52 %", "48 to 56 %"),
        (Estimate.normal("stuck share", 0.039489, sd=3e-6, unit="1", method=""), "3.95 %", "within its last digit"),
        (Estimate.normal("stuck share", 0.960511, sd=3e-6, unit="1", method=""), "96.05 %", "within its last digit"),
        (Estimate.normal("a", 2.5, sd=1e-9, unit="Hz", method=""), "2.5000 Hz", "within its last digit"),
        (Estimate.normal("a", 2.0, sd=0.0, unit="1", method=""), "2", "no scatter"),
        (Estimate.normal("a", 0.0125, sd=0.0, unit="m", method=""), "12.5 mm", "no scatter"),
        (Estimate.normal("a", float("nan"), sd=1.0, unit="N", method=""), "unknown", "unknown"),
        (Estimate("a", 0.29, (0.2, 0.4), 0.001, "1", ""), "0.29", "0.20 to 0.40"),
    ],
)
def test_numbers_carry_the_digits_that_they_are_sure_of(estimate: Estimate, value: str, interval: str) -> None:
    assert value_of(estimate) == value
    assert interval_of(estimate) == interval


def test_the_headline_names_the_direction_of_a_slope(demo: Findings) -> None:
    assert demo.loops is not None
    falling = Estimate.normal("slope", -3.0, sd=0.1, unit="N s/m", method="")
    sentences = " ".join(summary(demo.having(loops=replace(demo.loops, slope=falling))).headline)
    assert "falls with speed" in sentences
    doubted = replace(falling, status="the sliding speed hardly varies")
    assert "with speed" not in " ".join(summary(demo.having(loops=replace(demo.loops, slope=doubted))).headline)
    assert "2 stops in each cycle" in sentences


def test_the_share_that_sticks_is_told_as_its_interval(demo: Findings) -> None:
    """Its value is the upper end: creep below the threshold counts as sticking."""
    assert demo.sticks is not None
    share = Estimate("stuck share of the time", 0.332, (0.26, 0.334), 0.02, "1", "")
    told = " ".join(summary(demo.having(sticks=replace(demo.sticks, share=share))).headline)
    assert "it sticks 26 to 33 % of the time" in told


def test_what_the_intervals_leave_open_is_not_asserted(demo: Findings) -> None:
    """A zero of x had widened them to one side: 25 N forward and 10 N back "differed", of one friction."""
    assert demo.sticks is not None
    forward = Estimate("sliding friction forward", 25.0, (9.0, 26.0), 1.0, "N", "")
    back = Estimate("sliding friction back", 10.0, (9.5, 27.0), 1.0, "N", "")
    never = Estimate("stuck share of the time", 0.0, (0.0, 0.0), 0.0, "1", "")
    either = replace(demo.loops, forward=forward, back=back)
    told = " ".join(summary(demo.having(loops=either, sticks=replace(demo.sticks, share=never))).headline)
    assert "directions differ" not in told
    assert "it never sticks" in told


def test_directions_that_differ_are_told_of_a_regression_too() -> None:
    time = np.arange(8000) / 1000
    x = 0.1 * np.sin(np.pi * time) + 0.02 * np.sin(3.4 * np.pi * time)
    v, a = np.gradient(x, 1e-3), np.gradient(np.gradient(x, 1e-3), 1e-3)
    noise = np.random.default_rng(0).normal(0, 0.05, time.size)
    for back in (2.0, 3.0):
        force = 3.0 * a + np.where(v > 0, 5.0, 3.0 + back) * v + np.where(v > 0, 2.0, -back) + noise
        told = " ".join(summary(analyze(ss.Record.of({"x": x, "force": force}, fs=1000))).headline)
        differ = re.search(r"The two directions differ: ([\d.]+) N forward and ([\d.]+) N back", told)
        assert (differ is not None) == (back == 3.0), told
        if differ is not None:
            assert [float(force) for force in differ.groups()] == pytest.approx([2.0, 3.0], abs=0.01)
        assert ("The two directions differ in viscous friction: 5.0" in told) == (back == 3.0), told


def test_a_folder_holds_all_and_only_what_it_lists(demo: Findings, tmp_path: Path) -> None:
    place = publish(demo, folder=tmp_path / "deep" / "results")
    data = json.loads((place / "results.json").read_text(encoding="utf-8"))
    files = {path.relative_to(place).as_posix() for path in place.rglob("*") if path.is_file()}
    assert files == set(data["files"])
    assert {"report.html", "figures/friction-velocity.svg", "figures/friction-velocity.png"} <= files
    assert data["truth"]["sliding friction"] == 1.1
    assert everything(tmp_path / "deep") == {"results", *(f"results/{name}" for name in everything(place))}


def test_what_needs_no_figure_is_there_first(demo: Findings, tmp_path: Path) -> None:
    """The page draws record and loop itself; matplotlib took three quarters of the time to the first page."""
    publish(demo, folder=tmp_path, figures=False)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["report.html", "results.json"]
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert '<canvas class="chart"' in page
    assert "<svg" not in page
    publish(compare([demo, demo]), folder=tmp_path, figures=False)
    assert (tmp_path / "report.html").read_text(encoding="utf-8").count("<svg") == 1  # the records side by side


def test_an_earlier_result_is_replaced_and_a_stranger_left_alone(light: Findings, tmp_path: Path) -> None:
    place = publish(compare([replace(light, name="one"), light]), folder=tmp_path / "results")
    assert "figures/1-one-record.svg" in everything(place)
    publish(light, folder=place)
    assert "figures/record.svg" in everything(place)
    assert not [name for name in everything(place) if "one" in name]
    (place / "notes.txt").write_text("mine", encoding="utf-8")
    before = everything(tmp_path)
    with pytest.raises(ModelError, match=r"notes\.txt"):
        publish(light, folder=place)
    assert everything(tmp_path) == before
    (tmp_path / "file").write_text("", encoding="utf-8")
    with pytest.raises(ModelError, match="it is a file"):
        publish(light, folder=tmp_path / "file")
    with pytest.raises(StickslipError, match="lies in a file"):
        publish(light, folder=tmp_path / "file" / "below")


@pytest.mark.parametrize("trouble", [OSError(28, "No space left on device"), KeyboardInterrupt()])
def test_nothing_stays_of_a_folder_that_was_not_finished(
    light: Findings, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, trouble: BaseException
) -> None:
    def fails(*args: object) -> Iterator[None]:
        raise trouble

    publish(light, folder=tmp_path / "earlier")
    before = everything(tmp_path)
    monkeypatch.setattr(folder_module, "write_figures", fails)
    for name in ("new", "earlier"):
        with pytest.raises((StickslipError, KeyboardInterrupt)):
            publish(light, folder=tmp_path / name)
    assert everything(tmp_path) == before


@pytest.mark.parametrize("trouble", [OSError(5, "Input/output error"), KeyboardInterrupt()])
def test_earlier_results_come_back_when_the_new_ones_can_not_take_their_place(
    light: Findings, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, trouble: BaseException
) -> None:
    rename = os.rename

    def fails(path: Path, target: Path) -> None:
        if (path.name, target.name) == (whole.WHOLE, "results"):
            raise trouble
        rename(path, target)

    place = publish(light, folder=tmp_path / "results")
    before = {path: path.read_bytes() for path in place.rglob("*") if path.is_file()}
    monkeypatch.setattr(whole, "exchange", lambda one, other: False)
    monkeypatch.setattr(os, "rename", fails)
    with pytest.raises((StickslipError, KeyboardInterrupt)):
        publish(replace(light, name="later"), folder=place)
    assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == before


def test_the_digits_of_an_interval_do_not_exclude_the_value():
    from stickslip.story.story import interval_of

    wide = ss.Estimate("dry, whichever motion", 1.0003e-3, (0.0005e-3, 1.0012e-3), 2.5e-4, "m", "any")
    low, _, high, unit = interval_of(wide).split()
    assert float(low) <= 1.0003 <= float(high)
    assert unit == "mm"


def test_few_cycles_are_told_once_and_last() -> None:
    few = [
        Estimate.normal(name, 1.0, sd=0.1, unit="N", method="m", status=Status(Doubt.few(count, "cycle")))
        for name, count in (("one", 6), ("two", 6), ("three", 7))
    ]
    wrong = Estimate.normal("four", 1.0, sd=0.1, unit="N", method="m", status="z has the wrong sign")
    assert doubts([*few, wrong]) == [
        "Four: z has the wrong sign.",
        "One, two, three: only 6 to 7 cycles: the interval is crude.",
    ]
    alone = replace(few[0], status=Status(Doubt.few(5, "turn")))
    assert doubts([alone]) == ["One: only 5 turns: the interval is crude."]


def test_a_method_is_told_once() -> None:
    """The text on least squares stood eleven times on the page of a fit."""
    same = {"sd": 0.1, "unit": "N", "method": "least squares"}
    rows = [Estimate.normal(name, 1.0, checks=checks, **same) for name, checks in (("a", ("b",)), ("c", ("b", "d")))]
    story = summary(rows)
    assert [story.how(line) for line in story.lines] == [["least squares", "b"], ["as a", "d"]]


def test_rounding_is_no_number_of_nanounits() -> None:
    assert value_of(Estimate.normal("slope", 3e-17, sd=1e-16, unit="N s/m", method="m")) == "0 N s/m"
    assert value_of(Estimate.normal("compliance", -3e-7, sd=2e-7, unit="m/N", method="m")) == "-300 nm/N"
