"""The lab as a person meets it, in a real browser."""

from __future__ import annotations

import base64
import io
import json
import os
import re
import shutil
import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from axe_playwright_python.sync_playwright import Axe
from PIL import Image
from playwright.sync_api import Browser, Page, expect, sync_playwright

import stickslip as ss
from labs import Lab, running_lab

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
PICTURES = Path(__file__).parent / "pictures"
PATIENCE = 600_000.0  # ms: that an analysis on a busy machine ends, not how soon
KINETIC = 'input[type=range][aria-label="sliding friction, slider"]'
SHOWN = """(rows) => JSON.stringify(rows) === JSON.stringify(
  [...document.querySelectorAll("#rows tr")].map((row) => [...row.cells].map((cell) => cell.textContent)))"""
STATE = {
    "system": {"mass": 2.42, "stiffness": 2310.0, "damping": 0.12, "damper": "ground"},
    "law": {"name": "Coulomb", "kinetic": 1.1},
    "drive": {"name": "HarmonicBase", "amplitude": 0.00065, "frequency": 2.5},
    "run": {"cycles": 8},
}

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no chromium on this machine (apt-get install chromium)")


@pytest.fixture(scope="module")
def lab() -> Iterator[Lab]:
    with running_lab() as lab:
        yield lab


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with sync_playwright() as play:
        expect.set_options(timeout=PATIENCE)
        browser = play.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox", "--disable-gpu"])
        yield browser
        browser.close()


@pytest.fixture
def page(lab: Lab, browser: Browser) -> Iterator[Page]:
    """The page, opened by the address that the lab prints; no error and no request to elsewhere may come of its use."""
    context = browser.new_context(viewport={"width": 1200, "height": 900}, accept_downloads=True, color_scheme="light")
    context.set_default_timeout(PATIENCE)
    page = context.new_page()
    wrong: list[str] = []
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.on("console", lambda told: wrong.append(told.text) if told.type == "error" else None)
    page.on("request", lambda asked: None if is_ours(asked.url, lab) else wrong.append(asked.url))
    page.goto(lab.address)
    page.locator("#rows tr").first.wait_for(timeout=2 * PATIENCE)
    yield page
    context.close()
    assert wrong == []


def is_ours(address: str, lab: Lab) -> bool:
    return address.startswith((lab.base, f"ws://127.0.0.1:{lab.port}", "data:", "blob:"))


def link(page: Page, state: dict[str, Any]) -> str:
    text = base64.urlsafe_b64encode(json.dumps(state).encode()).decode().rstrip("=")
    return f"{page.url.partition('#')[0]}#{text}"


def state_of(page: Page) -> dict[str, Any]:
    text = page.evaluate("location.hash.slice(1)")
    data: dict[str, Any] = json.loads(base64.urlsafe_b64decode(text + "=" * (-len(text) % 4)))
    return data


def open_data(page: Page) -> None:
    page.get_by_role("tab", name="Data").click()
    page.get_by_role("button", name="Try the example record").wait_for()


def drop(page: Page, *paths: Path) -> None:
    """Let go of files over the page, as a person does."""
    files = [{"name": path.name, "bytes": base64.b64encode(path.read_bytes()).decode()} for path in paths]
    page.evaluate(
        """(files) => {
          const carried = new DataTransfer();
          for (const { name, bytes } of files)
            carried.items.add(new File([Uint8Array.from(atob(bytes), (sign) => sign.charCodeAt(0))], name));
          const place = document.querySelector(".data-welcome, .data-drop");
          for (const kind of ["dragenter", "dragover", "drop"])
            place.dispatchEvent(new DragEvent(kind, { dataTransfer: carried, bubbles: true, cancelable: true }));
        }""",
        files,
    )


@pytest.fixture(scope="module")
def rubbing(tmp_path_factory: pytest.TempPathFactory) -> Path:
    time = np.arange(2000) / 500
    friction = 1.5 * np.sign(np.cos(2 * np.pi * time)) + np.random.default_rng(1).normal(0, 0.01, time.size)
    record = ss.Record.of({"x": np.sin(2 * np.pi * time) / (2 * np.pi), "friction": friction}, fs=500)
    return ss.write_record(record, tmp_path_factory.mktemp("records") / "rubbing.csv")


def test_a_slider_moves_the_motion_and_the_link_holds_it(page: Page, lab: Lab) -> None:
    show(page, lab)
    page.locator(KINETIC).focus()
    page.keyboard.press("ArrowRight")
    page.wait_for_function("(before) => location.hash !== before", arg=page.evaluate("location.hash"))
    moved = state_of(page)
    assert moved["law"]["kinetic"] != STATE["law"]["kinetic"]
    rows = printed(moved)
    page.wait_for_function(SHOWN, arg=rows)
    other = page.context.new_page()
    other.goto(page.url)
    other.wait_for_function(SHOWN, arg=rows)
    assert state_of(other) == moved
    other.close()


def moved(page: Page) -> None:
    page.locator(KINETIC).focus()
    page.keyboard.press("ArrowRight")


def signalled(lab: Lab, number: signal.Signals) -> None:
    for process in lab.workers():
        os.kill(process, number)


def test_a_run_that_takes_long_says_for_how_long_and_can_be_cancelled(page: Page, lab: Lab) -> None:
    show(page, lab)
    signalled(lab, signal.SIGSTOP)
    moved(page)
    expect(page.locator("#status")).to_contain_text("Computing")
    expect(page.locator("#elapsed")).to_contain_text(" s")
    page.get_by_role("button", name="Cancel").click()
    expect(page.locator("#status")).to_contain_text("Cancelled")
    expect(page.get_by_role("button", name="Cancel")).to_have_count(0)
    moved(page)
    page.wait_for_function("() => document.querySelector('#status').textContent === ''", timeout=PATIENCE)
    page.wait_for_function(SHOWN, arg=printed(state_of(page)), timeout=PATIENCE)
    signalled(lab, signal.SIGCONT)


def test_a_worker_that_is_killed_is_one_sentence_and_the_page_goes_on(page: Page, lab: Lab) -> None:
    show(page, lab)
    signalled(lab, signal.SIGSTOP)
    moved(page)
    expect(page.locator("#status")).to_contain_text("Computing")
    signalled(lab, signal.SIGKILL)
    expect(page.locator(".fault")).to_contain_text("ended without an answer")
    before = page.evaluate("location.hash")
    moved(page)
    page.wait_for_function("(before) => location.hash !== before", arg=before, timeout=PATIENCE)
    page.wait_for_function(SHOWN, arg=printed(state_of(page)), timeout=PATIENCE)
    expect(page.locator("#parts .fault")).to_have_count(0)


def test_a_slider_follows_a_value_in_another_unit(page: Page, lab: Lab) -> None:
    show(page, lab)
    slider, number = page.locator(KINETIC), page.locator("#law-kinetic")
    number.fill("0.25 lbf")
    number.press("Tab")
    place = 500 + 500 * np.log10(0.25 * 4.4482216152605 / 1.1)
    page.wait_for_function(
        "([knob, place]) => Math.abs(document.querySelector(knob).value - place) < 1",
        arg=[KINETIC, place],
        timeout=PATIENCE,
    )
    assert slider.get_attribute("aria-valuetext") == "1.11206 N"
    frequency = page.locator("#drive-frequency")
    frequency.fill("180 rpm")
    frequency.press("Tab")
    told = page.locator("#drive-frequency ~ input[type=range]")
    expect(told).to_have_attribute("aria-valuetext", "3 Hz", timeout=PATIENCE)


def test_a_link_opened_while_the_motion_before_comes_to_rest_is_shown(page: Page, lab: Lab) -> None:
    opened = link(page, STATE).partition("#")[2]
    page.evaluate(
        """(opened) => {
          const before = location.href;
          location.hash = opened;
          history.replaceState(null, "", before);  // as the motion at rest does, before the page hears of the link
        }""",
        opened,
    )
    page.wait_for_function(SHOWN, arg=printed(STATE))


def test_scenarios_are_named_in_words_beside_their_codes(page: Page) -> None:
    page.locator("#preset").focus()
    page.wait_for_selector("#presets option", state="attached", timeout=PATIENCE)
    names = page.eval_on_selector_all("#presets option", "(all) => all.map((each) => each.value)")
    assert "frequency ratio 0.6 (DH-1 b=0.6)" in names
    assert "wet (SQUEAK wet 6.13 N)" in names
    bare = [name for name in names if not re.search(r"^.{3,} \(.+\)$", name)]
    assert bare == []


def test_a_curve_is_asked_without_mass_and_spring_where_friction_is_measured(page: Page, rubbing: Path) -> None:
    open_data(page)
    drop(page, rubbing)
    page.locator("#data-ask-fit").check(timeout=PATIENCE)
    expect(page.locator("#data-option-mass")).to_have_attribute("required", "")
    page.locator(".data-form summary").click()
    page.locator("#data-option-curve").select_option("coulomb")
    expect(page.locator("#data-option-mass")).not_to_have_attribute("required", "")
    page.locator("#data-run").click()
    expect(page.locator("#data-results tbody tr").first).to_contain_text("sliding friction", timeout=PATIENCE)


def show(page: Page, lab: Lab) -> None:
    """Open the link of the state, and wait for what the library says of it."""
    page.goto(link(page, STATE))
    page.wait_for_function(SHOWN, arg=printed(STATE))


def told(page: Page) -> list[list[str]]:
    rows: list[list[str]] = page.eval_on_selector_all(
        "#rows tr", "(rows) => rows.map((row) => [...row.cells].map((cell) => cell.textContent))"
    )
    return rows


def printed(state: dict[str, Any]) -> list[list[str]]:
    """What the library prints of that state."""
    return [list(row) for row in ss.story.outcome(ss.systems.read_system(state)).rows]


def test_the_numbers_of_a_motion_are_the_librarys_to_the_last_digit(page: Page, lab: Lab) -> None:
    show(page, lab)
    assert told(page) == printed(STATE)


def test_a_dropped_record_is_answered_with_the_librarys_own_digits(page: Page, rubbing: Path, tmp_path: Path) -> None:
    open_data(page)
    drop(page, rubbing)
    page.locator("#data-run").wait_for(timeout=PATIENCE)
    page.locator("#data-run").click()
    page.locator("#data-results").wait_for(timeout=PATIENCE)
    rows = page.eval_on_selector_all(
        ".data-results tbody tr", "(rows) => rows.map((row) => [...row.cells].map((cell) => cell.textContent))"
    )
    words = ss.summary(ss.analyze(ss.read_record(rubbing)))
    marks = [words.marks(line) for line in words.lines]
    sure = [f"see {mark}" if mark else "ok" for mark in marks]
    assert rows == [[line.name, line.value, line.interval, how] for line, how in zip(words.lines, sure, strict=True)]
    assert page.locator(".data-headline").all_inner_texts() == list(words.headline)
    with page.expect_download() as coming:
        page.get_by_role("link", name="Report (HTML)").click()
    coming.value.save_as(tmp_path / "report.html")
    report = (tmp_path / "report.html").read_text("utf-8")
    assert all(line.value in report for line in words.lines)
    with page.expect_download() as coming:
        page.get_by_role("link", name="Numbers (JSON)").click()
    coming.value.save_as(tmp_path / "results.json")
    assert json.loads((tmp_path / "results.json").read_text("utf-8"))["name"] == "rubbing.csv"
    assert page.locator("img.data-figure").count() == min(6, len(words.plates))
    assert page.locator(".data-downloads a", has_text="Report in a tab").get_attribute("href").endswith("/report")


def test_a_caution_that_many_rows_share_is_said_once_above_them(page: Page) -> None:
    open_data(page)
    page.get_by_role("button", name="Try the example record").click()
    page.locator("#data-run").click(timeout=PATIENCE)
    page.locator("#data-results").wait_for(timeout=2 * PATIENCE)
    shared = "how a is mounted is not stated"  # of the load cell, which the friction leaves aside, nothing is asked
    assert page.locator(".data-results td", has_text=shared).count() == 0
    assert page.locator(".data-caution", has_text=shared).count() == 1
    assert page.locator(".data-results td", has_text="see 1").count() > 5


def test_a_real_record_of_two_files_is_asked_for_what_they_do_not_tell(
    page: Page, dataset: Callable[[str], Path], tmp_path: Path
) -> None:
    folder = dataset("frame_base_excited")
    open_data(page)
    drop(page, folder / "s_b_450g_x.mat", folder / "s_b_450g_y.mat")
    page.get_by_label("These files are").select_option("together")
    page.get_by_label("What y is").wait_for(timeout=PATIENCE)
    expect(page.get_by_text("The file states no unit for x, y")).to_be_visible()
    page.get_by_label("What y is").select_option("z")
    for column in ("x", "y"):
        unit = page.get_by_label(f"Unit of {column}")
        unit.fill("mm")
        unit.press("Tab")
        expect(unit).to_have_value("mm", timeout=PATIENCE)  # as it was typed
    expect(page.locator(".data-record tbody tr").first).to_contain_text("mm", timeout=PATIENCE)
    expect(page.get_by_text("The record can not tell this")).to_be_visible(timeout=PATIENCE)
    page.get_by_label("Mass [kg]").fill("3.0799")
    page.get_by_label("Spring [N/m]").fill("1191 N/m")
    page.get_by_text("What else you know of the rig").click()
    page.get_by_label("Damping [N s/m]").fill("0.669")
    page.get_by_label("Damper ends on").select_option("base")
    page.locator("#data-run").click()
    page.locator("#data-results").wait_for(timeout=PATIENCE)
    record = ss.read_record(
        [folder / "s_b_450g_x.mat", folder / "s_b_450g_y.mat"], channels={"x": "x [mm]", "z": "y [mm]"}
    )
    words = ss.summary(ss.analyze(record, mass=3.0799, stiffness=1191, damping=0.669, damper="base"))
    shown = page.locator(".data-results tbody td:nth-child(2)").all_text_contents()
    assert shown == [line.value for line in words.lines]


def test_work_can_be_cancelled(page: Page) -> None:
    open_data(page)
    page.get_by_role("button", name="Try the example record").click()
    page.get_by_label("What rings, and when?").check(timeout=PATIENCE)
    page.locator("#data-run").click()
    page.get_by_role("button", name="Cancel").click()
    expect(page.get_by_role("alert")).to_contain_text("Cancelled")
    expect(page.get_by_role("progressbar")).to_have_count(0)
    expect(page.locator("#data-run")).to_be_enabled()


def test_a_bad_file_is_told_in_one_sentence_and_the_page_goes_on(page: Page, rubbing: Path, tmp_path: Path) -> None:
    bad = tmp_path / "broken.tdms"
    bad.write_bytes(b"TDSm" + b"\xff" * 300)
    open_data(page)
    drop(page, bad)
    expect(page.get_by_role("alert")).to_contain_text("broken.tdms", timeout=PATIENCE)
    page.get_by_role("button", name="Remove broken.tdms").click()
    drop(page, rubbing)
    page.locator("#data-run").wait_for(timeout=PATIENCE)


def test_all_of_it_is_reached_by_keyboard(page: Page) -> None:
    """Tab to Data, the example, a question, the answer's downloads: no mouse."""
    page.locator("#tab-play").focus()
    page.keyboard.press("ArrowRight")
    page.keyboard.press("ArrowRight")
    expect(page.get_by_role("tab", name="Data")).to_be_focused()
    tab_to(page, "#data-input")
    tab_to(page, "#data-example")
    page.keyboard.press("Enter")
    page.locator("#data-ask-analyze").wait_for(timeout=PATIENCE)
    tab_to(page, "#data-ask-analyze")
    page.keyboard.press("ArrowDown")
    assert page.locator("#data-ask-decay").is_checked()
    tab_to(page, "#data-run")
    page.keyboard.press("Enter")
    expect(page.get_by_role("alert")).to_contain_text("free decay", timeout=PATIENCE)


def tab_to(page: Page, place: str) -> None:
    """Press Tab until the focus is there."""
    for _ in range(60):
        if page.evaluate("(place) => document.activeElement === document.querySelector(place)", place):
            return
        page.keyboard.press("Tab")
    raise AssertionError(f"Tab never comes to {place}")


def test_a_newcomer_sees_a_motion_in_words_and_six_pictures(page: Page) -> None:
    expect(page.locator("#happened")).to_contain_text("sticks twice a cycle, 26 % of the time", timeout=PATIENCE)
    assert page.locator("#pictured button").count() == 6
    page.get_by_role("button", name="Slides through").click()
    expect(page.locator("#happened")).to_contain_text("slides without a stop", timeout=PATIENCE)
    page.get_by_role("button", name="Stick-slip").click()
    page.get_by_role("button", name="Less friction").click()
    page.wait_for_function("() => location.hash.length > 2", timeout=PATIENCE)
    expect(page.locator("#law-kinetic")).to_have_value("330 mN")
    expect(page.locator("#happened")).not_to_contain_text("26 %", timeout=PATIENCE)


def test_a_scenario_is_found_by_a_word(page: Page) -> None:
    page.locator("#preset").fill("friction ratio nowhere")
    page.locator("#preset").press("Enter")
    expect(page.locator("#status")).to_contain_text("No scenario is called")
    page.locator("#preset").fill("DH-1 b=0.6")
    page.locator("#preset").press("Enter")
    expect(page.locator("#about")).to_contain_text("Den Hartog 1931", timeout=PATIENCE)


def test_a_unit_stays_as_it_was_typed(page: Page, lab: Lab) -> None:
    show(page, lab)
    amplitude = page.locator("#drive-amplitude")
    amplitude.fill("0.7 mm")
    amplitude.press("Tab")
    expect(amplitude).to_have_value("0.7 mm")
    page.locator("#drive-amplitude ~ input[type=range]").focus()
    page.keyboard.press("ArrowRight")
    assert re.fullmatch(r"0\.70\d+ mm", amplitude.input_value())


def test_values_stand_under_the_pointer_on_all_traces(page: Page, lab: Lab) -> None:
    show(page, lab)
    box = page.locator(".trace .u-over").first.bounding_box()
    assert box
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    readings = page.locator(".trace .reading").all_inner_texts()
    assert len(readings) == 4
    assert all(re.search(r"-?[\d.]+.* at 1\.[56]\d* s", reading) for reading in readings), readings


def test_a_session_comes_back_from_its_file(page: Page, lab: Lab, tmp_path: Path) -> None:
    show(page, lab)
    page.get_by_role("button", name="Keep as A").click()
    moved(page)
    page.wait_for_function("(before) => location.hash !== before", arg=page.evaluate("location.hash"), timeout=PATIENCE)
    now = state_of(page)
    with page.expect_download() as coming:
        page.get_by_role("button", name="Save the session").click()
    coming.value.save_as(tmp_path / "session.json")
    held = json.loads((tmp_path / "session.json").read_text("utf-8"))
    assert held["play"]["law"] == now["law"]
    assert held["a"]["law"] == STATE["law"]
    page.get_by_role("button", name="Show A").click()
    page.wait_for_function(SHOWN, arg=printed(STATE), timeout=PATIENCE)
    page.locator("#file").set_input_files(tmp_path / "session.json")
    page.wait_for_function(SHOWN, arg=printed(now), timeout=PATIENCE)


def test_constants_of_the_rig_stay_and_a_stretch_is_taken_by_dragging(page: Page, rubbing: Path) -> None:
    open_data(page)
    drop(page, rubbing)
    page.locator("#data-ask-fit").check(timeout=PATIENCE)
    page.get_by_label("Mass [kg]").fill("0.25")
    page.get_by_label("Mass [kg]").press("Tab")
    page.locator("#data-ask-decay").check()
    page.locator("#data-ask-fit").check()
    expect(page.get_by_label("Mass [kg]")).to_have_value("0.25")
    box = page.locator(".data-preview .u-over").first.bounding_box()
    assert box
    page.mouse.move(box["x"] + box["width"] * 0.25, box["y"] + 20)
    page.mouse.down()
    page.mouse.move(box["x"] + box["width"] * 0.75, box["y"] + 20, steps=5)
    page.mouse.up()
    expect(page.get_by_role("button", name="Take all rows again")).to_be_visible(timeout=PATIENCE)
    first, last = map(int, page.locator("#data-read-rows").input_value().split(":"))
    assert 350 < first < 650
    assert 1350 < last < 1650
    expect(page.locator(".data-record p").first).to_contain_text(f"{last - first:,} rows")
    expect(page.get_by_label("Mass [kg]")).to_have_value("0.25")


def test_a_rig_is_watched_live_and_no_other_tab_speaks_into_it(page: Page) -> None:
    page.locator(KINETIC).focus()
    page.keyboard.press("ArrowRight")  # what Play says of it must not stand on the next tab
    page.get_by_role("tab", name="Live").click()
    said = "(id) => document.getElementById(id).textContent"
    heard = page.evaluate_handle(
        """() => { const heard = [], status = document.getElementById("status");
          new MutationObserver(() => heard.push(status.textContent)).observe(status, { childList: true });
          return heard; }"""
    )
    page.get_by_role("button", name="Open").click()
    expect(page.locator("#live-rows tr")).to_have_count(3)
    level, _, share = page.locator("#live-rows tr").all_text_contents()
    assert re.match(r"sliding friction1\.[01]\d*\s?N", level), level
    assert re.match(r"stuck share of the time\d+ %", share), share
    assert page.evaluate(said, "live-unit") == "amplitude [m]"
    assert {words for words in heard.json_value() if words} == {"Opening sim …"}
    page.get_by_role("button", name="Close").click()
    expect(page.locator("#live-rows tr")).to_have_count(0)


def test_nothing_that_axe_knows_keeps_anybody_out_and_it_fits_a_phone(page: Page, rubbing: Path) -> None:
    open_data(page)
    drop(page, rubbing)
    page.locator("#data-run").wait_for(timeout=PATIENCE)
    for theme in ("light", "dark"):
        for tab in ("Play", "Map", "Data", "Live"):
            page.get_by_role("tab", name=tab).click()
            run = Axe().run(page)
            assert run.violations_count == 0, f"{tab}, {theme}: {run.generate_report()}"
        page.get_by_role("button", name="Dark or light").click()
    for width in (360, 768):
        page.set_viewport_size({"width": width, "height": 800})
        for tab in ("Play", "Map", "Data", "Live"):
            page.get_by_role("tab", name=tab).click()
            assert page.evaluate("document.documentElement.scrollWidth") <= width, f"{tab} at {width} pixels"


def test_the_first_sight_of_records_is_as_it_was(page: Page) -> None:
    """Against a kept picture: the same to a few grey levels, but for the edges of letters."""
    open_data(page)
    page.evaluate("document.activeElement.blur()")
    page.mouse.move(0, 0)
    sight = Image.open(io.BytesIO(page.locator("#data").screenshot(animations="disabled"))).convert("L")
    kept = Image.open(PICTURES / "lab-data.png").convert("L")
    assert abs(sight.width - kept.width) <= 2
    assert abs(sight.height - kept.height) <= 40  # the machine's own letters are higher or lower
    size = (60, 40)
    seen, known = (np.asarray(each.resize(size, Image.Resampling.BOX), dtype=float) for each in (sight, kept))
    assert np.mean(np.abs(seen - known)) < 1.5  # a third of it blank makes 2
