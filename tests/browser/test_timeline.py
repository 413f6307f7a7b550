"""The timeline: what was recorded is shown in one window, and the arm does not move."""

from __future__ import annotations

import math
import re
import time
from pathlib import Path

import numpy as np
import pytest

import katana450
from katana450.client import connect
from katana450.extensions.recording.files.attempts import lasting_spans
from katana450.extensions.recording.files.recording_file import RecordingFile
from katana450.extensions.recording.files.spans import at_place
from katana450.extensions.recording.folders import recordings_in
from katana450.extensions.recording.playback.run import PlaybackRun
from katana450.maths.geometry.arrays import FloatArray
from katana450.server.api import requests
from tests.browser.conftest import OpenPage
from tests.browser.page import ViserPage
from tests.browser.server import AppServer
from tests.browser.session import Truth, prepare
from tests.browser.sight import overlap
from tests.browser.sizes import PHONE, SIZES, WIDE, in_sizes_and_schemes
from tests.browser.test_accessibility import findings

GHOST = "/playback/0/arm"
LINK = "/arm/base_link/arm_base_link/pan_link"
TURNS = (0.5, -0.4)
"""[rad] Angles of axis 1 to which the arm turns, one after the other."""

JOB = 60_000
"""[ms] Timeout of a short job on a busy machine."""

NOW = "Moment that is shown"

DROP = """([name, bytes]) => {
    const dataTransfer = new DataTransfer();
    dataTransfer.items.add(new File([new Uint8Array(bytes)], name));
    window.dispatchEvent(new DragEvent("drop", { dataTransfer, cancelable: true }));
}"""
"""Script that drops a file on the page."""

COUNT_GAPS = """(arms) => {
    window.gaps = 0;
    (function look() {
        gaps += !arms.some(harness.shows);
        requestAnimationFrame(look);
    })();
}"""
"""Script that counts the frames in which none of these nodes is visible."""

CUT = """(all) => all.filter((each) => {
    const pen = document.createElement("canvas").getContext("2d");
    const { font, paddingLeft } = getComputedStyle(each);
    pen.font = font;
    const text = pen.measureText(each.selectedOptions[0].text).width;
    return text + parseFloat(paddingLeft) + ARROW > each.clientWidth;
}).map((each) => each.selectedOptions[0].text)""".replace("ARROW", "14")
"""Script that returns the words of lists that are cut off before the arrow."""

EXEMPT = {("header", "portrait"), ("header", "landscape"), ("nav", "landscape")}
"""Parts that may overlap the timeline's box: the header's box includes the buttons of the page."""


@pytest.fixture(scope="module")
def folder(recorded: Path) -> Path:
    return recorded / "ring"


@pytest.fixture(scope="module")
def server(recording_server: AppServer, folder: Path) -> AppServer:
    """Return a server whose arm has turned twice, and was stopped by Ada in between."""
    with connect(recording_server.url, "Ada") as arm:
        for angle in TURNS:
            arm.joints((angle, -1.0, 1.4, 0.3, 0.0))
            if angle is TURNS[0]:
                arm.stop()
                arm.clear_stop()
        arm.ask(requests.ReleaseLease())
    run = PlaybackRun(lambda: recordings_in(folder))
    deadline = time.monotonic() + 60.0
    while abs(newest_turn(run) - TURNS[-1]) > 1e-6:
        assert time.monotonic() < deadline, "the motion is not recorded"
        time.sleep(0.1)
    return recording_server


def newest_turn(run: PlaybackRun) -> float:
    """Return the newest recorded angle of axis 1 [rad]; 0 before the first."""
    run.update()
    moment = run.at(math.inf) if run.spans else None
    return 0.0 if moment is None else moment.row.joints[0]


def opened(page: ViserPage) -> None:
    """Show the timeline of ``page`` with something on it."""
    page.page.click("#more-button")
    page.press_in_bar("Timeline")
    page.page.wait_for_function("() => Number(document.querySelector('#timeline .now')?.max) > 2")


def shown_turn(page: ViserPage, root: str = GHOST) -> float:
    """Return the angle of axis 1 [rad] of the arm that ``page`` draws below ``root``."""
    T = page.node_pose(f"{root}/base_link/arm_base_link/pan_link")
    zero = page.node_pose(f"{root}/base_link/arm_base_link")
    R: FloatArray = np.linalg.inv(zero[:3, :3]) @ T[:3, :3]
    return float(np.arctan2(R[1, 0], R[0, 0]))


def place(page: ViserPage, value: float, name: str = NOW) -> None:
    """Move the slider ``name`` of ``page`` to ``value`` [s], as a person's drag does."""
    page.page.get_by_label(name).evaluate(
        "(each, value) => { each.value = value; each.dispatchEvent(new Event('input')); }", value
    )


def check_kept(page: ViserPage, episodes: Path) -> None:
    """Check that the only file of ``episodes`` is whole, and that a rewind left a part of it."""
    page.page.get_by_text("Episode 1 is kept: see Episodes.").wait_for()
    (recording,) = map(katana450.open, episodes.glob("episode-*.mcap"))
    assert [episode.outcome.value for episode in recording.episodes] == ["failure"]
    assert recording.verify().identical
    with RecordingFile.open(recording.path) as file:
        first, second = lasting_spans(file, recording.start, recording.end)
    assert first.end < second.start


def check_tree(page: ViserPage, run: PlaybackRun) -> None:
    """Show, name, judge and compare the one of two attempts that was left."""
    page.press_in_bar("Attempts, and what they continued from")
    rows = page.page.locator("#timeline .tree .list button")
    page.wait_until(lambda: rows.count() == 2, "both attempts")
    rows.first.click()
    page.wait_until(lambda: page.shows(GHOST), "the recorded arm")
    page.page.get_by_label("Name of the attempt").fill("To the left")
    page.page.keyboard.press("Enter")
    page.page.get_by_label("Outcome of the attempt").select_option("failure")
    page.wait_until(lambda: rows.first.get_attribute("class") == "failure", "its outcome")
    page.page.get_by_label("Attempt to compare with").select_option("2")
    page.page.get_by_role("cell", name="Ends apart: tool").wait_for()
    page.wait_until(lambda: page.shows("/playback/1/arm"), "the second arm")
    run.update()
    first, second = run.attempts()
    assert (first.name, first.outcome, second.parent) == ("To the left", "failure", 1)


def test_past_is_shown_in_one_window_until_stop(
    server: AppServer, folder: Path, open_page: OpenPage, artefacts: Path
) -> None:
    page = open_page(server.url, nodes=("/arm",))
    truth = Truth(server)
    before = truth.status()["q"]
    opened(page)
    run = PlaybackRun(lambda: recordings_in(folder))
    run.update()
    slider = page.page.get_by_label(NOW)
    length = float(slider.get_attribute("max") or 0.0)
    assert length == pytest.approx(sum(span.length for span in run.spans), abs=1e-3)
    begin = run.at(run.spans[0].start)
    assert begin is not None

    page.frame.evaluate(COUNT_GAPS, [LINK, GHOST])
    place(page, 0.0)
    page.wait_until(lambda: page.shows(GHOST) and not page.shows(LINK), "the recorded arm alone")
    assert page.frame.evaluate("gaps") == 0
    page.wait_until(
        lambda: abs(shown_turn(page) - begin.row.joints[0]) < 1e-6, "the first recorded posture"
    )
    assert not page.shows("/target/move"), "the gizmo of the present can be dragged"
    page.page.get_by_text("arm is now elsewhere").wait_for()
    assert "Live" not in (slider.get_attribute("aria-valuetext") or "Live")
    page.keep(artefacts / "timeline.png")

    # The arrow keys step by 0.1 s, and Home and End are the ends.
    slider.focus()
    page.page.keyboard.press("Home")
    page.page.keyboard.press("Shift+ArrowRight")
    later = float(slider.input_value())
    assert later == pytest.approx(1.0, abs=0.01)
    # The arm may move at that moment, and the page asks for it to 10 ms.
    moments = [run.at(at_place(run.spans, later + apart)) for apart in (-0.02, 0.0, 0.02)]
    turns = [moment.row.joints[0] for moment in moments if moment is not None]
    page.wait_until(
        lambda: min(turns) - 1e-6 <= shown_turn(page) <= max(turns) + 1e-6, "the posture 1 s later"
    )
    titles = page.page.locator("#timeline .marks i").evaluate_all(
        "(all) => all.map((e) => e.title).join()"
    )
    assert {"Ada pressed STOP", "Ada drives"} <= set(re.findall("Ada [a-z]+(?: STOP)?", titles))

    # Nothing of this concerns the arm, until the run continues from there.
    assert truth.status()["q"] == before
    moving = next(
        place
        for place in np.arange(0.0, length, 0.02).tolist()
        if (moment := run.at(at_place(run.spans, place))) and 0.1 < moment.row.joints[0] < 0.4
    )
    place(page, moving)
    page.wait_until(lambda: 0.1 < shown_turn(page) < 0.4, "the first motion")
    page.page.get_by_text("Continue from here").click()
    page.wait_until(lambda: page.shows(LINK) and not page.shows(GHOST), "the present")
    page.wait_until(lambda: abs(truth.status()["q"][0] - TURNS[0]) < 1e-6, "the end of the motion")
    page.page.locator("#timeline .marks i[title*='Continues from']").wait_for(state="attached")
    page.page.locator("#timeline .marks b.left").wait_for(state="attached")
    # What was before and after it is an episode, without what it was set back over.
    page.page.get_by_label("Keep the selection as an episode").select_option("failure")
    check_kept(page, folder.parent / "episodes")
    check_tree(page, run)
    page.keep(artefacts / "timeline-attempts.png")
    place(page, 0.0)
    page.wait_until(lambda: page.shows(GHOST), "the recorded arm")
    # Esc stops the arm, and shows it.
    page.page.keyboard.press("Escape")
    page.wait_until(lambda: page.shows(LINK) and not page.shows(GHOST), "the present")
    assert truth.status()["stopped"] is not None
    assert slider.get_attribute("aria-valuetext") == "Live"
    assert page.errors == []


@pytest.mark.long
def test_line_grows_under_the_pointer_and_plays_only_while_it_says_so(
    server: AppServer, open_page: OpenPage, artefacts: Path
) -> None:
    page = open_page(server.url, nodes=("/arm",), window=WIDE)
    line, note = page.page.locator("#timeline"), page.page.locator("#past")
    line.wait_for()
    page.page.wait_for_function("() => Number(document.querySelector('#timeline .now')?.max) > 2")
    play = line.get_by_label("Play", exact=True)
    assert not play.is_visible()
    thin, scene = line.bounding_box(), page.page.locator("#scene").bounding_box()
    assert thin is not None
    assert (thin["width"], thin["height"]) == (WIDE[0], 13.0)
    page.page.mouse.move(0.5 * WIDE[0], WIDE[1] - 5.0)
    play.wait_for()
    # The scene keeps its size, and so its picture.
    assert page.page.locator("#scene").bounding_box() == scene
    shown = line.locator(".legend span:visible").all_inner_texts()
    assert {"Stop", "Stop cleared", "Driver"} <= set(shown)
    assert "Contact" not in shown
    page.keep(artefacts / "timeline-grown.png")
    page.page.mouse.move(0.5 * WIDE[0], 0.5 * WIDE[1])
    play.wait_for(state="hidden")
    line.get_by_label(NOW).focus()
    play.wait_for()
    page.page.keyboard.press("Home")
    page.wait_until(lambda: note.inner_text().startswith("Shown as it was at "), "the note")
    said = "([at]) => getComputedStyle(document.querySelector(at), '::before').content"
    assert page.page.evaluate(said, ["#headline span"]) == '"Now: "'
    assert page.frame.evaluate(said, ["[data-scrollarea-viewport]"]) == '"Now"'
    play.click()
    page.wait_until(lambda: note.inner_text().startswith("Playing back "), "playing")
    line.get_by_label("Pause", exact=True).click()
    page.wait_until(lambda: note.inner_text().startswith("Shown as it was at "), "the rest")
    # Folded away, it stays so.
    line.get_by_label("Fold the timeline away").click()
    line.wait_for(state="hidden")
    page.page.reload()
    page.page.locator("#episodes-button").wait_for()
    page.page.wait_for_timeout(300)
    assert not line.is_visible()
    page.page.evaluate("localStorage.clear()")
    assert page.errors == []


@pytest.mark.long
def test_other_windows_stay_live_and_acting_returns_to_live(
    server: AppServer, open_page: OpenPage
) -> None:
    page, other = (open_page(server.url, nodes=("/arm", "/target/move")) for _ in range(2))
    prepare(page, Truth(server))
    opened(page)
    since = time.time()
    place(page, 1.0)
    page.wait_until(lambda: page.shows(GHOST), "the recorded arm")
    page.page.get_by_label("Play", exact=True).click()
    page.wait_until(lambda: slider_place(page) > 2.0, "the run to continue")
    page.page.get_by_label("Pause", exact=True).last.click()
    stays = slider_place(page)
    page.page.wait_for_timeout(200)
    assert slider_place(page) == stays
    assert other.shows(LINK)
    assert not other.messages("FrameMessage", node=GHOST, since=since)
    # A control of the panel moves the arm, so the window shows it.
    page.type_number("1 base turn", 10.0)
    page.wait_until(lambda: page.shows(LINK) and not page.shows(GHOST), "the present")
    Truth(server).wait(moving=False)
    assert Truth(server).status()["q"][0] == pytest.approx(np.radians(10.0), abs=1e-3)


@pytest.mark.long
def test_selection_is_saved_opened_and_compared(
    server: AppServer, folder: Path, open_page: OpenPage, tmp_path: Path, artefacts: Path
) -> None:
    page = open_page(server.url, nodes=("/arm",), window=WIDE)
    opened(page)
    # The last motion; the arm rests at first.
    length = float(page.page.get_by_label(NOW).get_attribute("max") or 0.0)
    ends = {"Start of the selection": length - 1.9, "End of the selection": length - 0.4}
    for name, value in ends.items():
        place(page, value, name)
    with page.page.expect_download() as downloading:
        page.press_in_bar("Save selection")
    path = tmp_path / "part.mcap"
    downloading.value.save_as(path)
    saved = katana450.open(path)
    ring, part = PlaybackRun(lambda: recordings_in(folder)), PlaybackRun(lambda: [path])
    ring.update()
    part.update()
    begin, end = (at_place(ring.spans, place) for place in ends.values())
    assert part.spans[0].start == pytest.approx(begin, abs=0.05)
    assert begin < part.spans[-1].end < end + 0.05
    assert saved.verify().identical

    # The file is opened, and its first state is shown.
    page.page.locator("#timeline input[type=file]").set_input_files(path)
    page.wait_until(lambda: page.shows(GHOST), "the recorded arm")
    first = part.at(part.spans[0].start)
    assert first is not None
    page.wait_until(lambda: abs(shown_turn(page) - first.row.joints[0]) < 1e-3, "its first posture")
    lists = page.page.get_by_label("Recording", exact=True)
    assert lists.locator("option:checked").inner_text() == "part.mcap"

    # A part of the file is saved too.
    page.page.get_by_label("End of the selection").evaluate(
        "(each) => { each.value = 0.5 * each.max; each.dispatchEvent(new Event('input')); }"
    )
    with page.page.expect_download() as downloading:
        page.press_in_bar("Save selection")
    downloading.value.save_as(tmp_path / "half.mcap")
    half = katana450.open(tmp_path / "half.mcap")
    assert half.verify().identical
    assert (half.q[0] == saved.q[0]).all()
    assert 0 < len(half.t) < len(saved.t)

    # Beside the last minutes, on one clock.
    lists.select_option("ring")
    page.page.get_by_label("Second run").select_option(label="part.mcap")
    page.wait_until(lambda: page.shows("/playback/1/arm"), "the second arm")
    place(page, 1.0)
    second = part.at(at_place(part.spans, 1.0))
    assert second is not None
    page.wait_until(
        lambda: abs(shown_turn(page, "/playback/1/arm") - second.row.joints[0]) < 1e-3,
        "the second run at the same time",
    )
    page.keep(artefacts / "timeline-two-runs.png")

    # A file that is dropped on the page is opened.
    page.page.get_by_role("button", name="Back to live").click()
    page.page.evaluate(DROP, [path.name, list(path.read_bytes())])
    page.page.locator("#toast", has_text="part.mcap is open").wait_for()
    page.wait_until(lambda: page.shows(GHOST), "the recorded arm")

    # What is not a recording is refused with the reason.
    broken = tmp_path / "broken.mcap"
    broken.write_bytes(b"nothing")
    page.page.locator("#timeline input[type=file]").set_input_files(broken)
    page.page.locator("#toast", has_text="not a recording").wait_for()


@in_sizes_and_schemes(("wide", "portrait", "landscape"))
def test_timeline_covers_nothing(
    server: AppServer, open_page: OpenPage, artefacts: Path, size: str, scheme: str
) -> None:
    options = {} if size == "wide" else PHONE
    page = open_page(
        server.url, nodes=("/arm",), window=SIZES[size], color_scheme=scheme, **options
    )
    opened(page)
    scene = page.page.locator("#scene").bounding_box()
    place(page, 1.0)
    page.wait_until(lambda: page.shows(GHOST), "the recorded arm")
    # The note about the past shifts nothing.
    assert page.page.locator("#scene").bounding_box() == scene
    page.keep(artefacts / f"timeline-{size}-{scheme}.png")
    timeline = page.page.locator("#timeline").bounding_box()
    assert timeline is not None
    for name in ("#stop", "header", "#scene", "nav"):
        # In landscape the buttons stand at the left, in the empty start of the timeline.
        box = page.page.locator(name).bounding_box()
        assert box is not None
        assert not overlap(timeline, **box) or (name, size) in EXEMPT, name
    assert timeline["y"] + timeline["height"] <= SIZES[size][1] + 0.5
    small = page.page.locator("#timeline :is(button, select):visible").evaluate_all(
        "(all) => all.map((each) => each.getBoundingClientRect().height)"
    )
    assert min(small) >= (32.0 if size == "wide" else 44.0) - 0.5
    cut = page.page.locator("#timeline select").evaluate_all(CUT)
    assert cut == []
    assert findings(page.page) == []
    assert page.errors == []


def slider_place(page: ViserPage) -> float:
    """Return the place [s] of the moment that ``page`` shows."""
    return float(page.page.get_by_label(NOW).input_value())


@pytest.mark.long
def test_selection_is_verified_exported_and_cancelled(
    server: AppServer, open_page: OpenPage, tmp_path: Path, artefacts: Path
) -> None:
    page = open_page(server.url, nodes=("/arm",), window=WIDE)
    opened(page)
    row = page.page.locator("#timeline .work")
    assert not row.is_visible()
    verify = page.page.get_by_role("button", name=re.compile("^Verify the selection"))
    verify.click()
    row.get_by_role("button", name="Cancel").wait_for()
    page.keep(artefacts / "timeline-verifying.png")
    row.get_by_text("identical to the bit over").wait_for(timeout=JOB)
    page.keep(artefacts / "timeline-verified.png")
    row.get_by_role("button", name="Close").click()
    assert not row.is_visible()

    exports = page.page.get_by_label("Export the selection")
    with page.page.expect_download(timeout=JOB) as downloading:
        exports.select_option(label="CSV table")
    downloading.value.save_as(tmp_path / "run.csv")
    lines = (tmp_path / "run.csv").read_text(encoding="utf-8").splitlines()
    assert lines[0].startswith("t,theta1")
    assert len(lines) > 100
    row.get_by_text(f"Exported katana450.csv: {len(lines) - 1} rows.").wait_for()
    assert exports.input_value() == ""

    exports.select_option(label="MP4 film")
    row.get_by_role("button", name="Cancel").click()
    assert not row.is_visible()
    # The server is free for the next one.
    verify.click()
    row.get_by_text("identical to the bit over").wait_for(timeout=JOB)
    assert page.errors == []
