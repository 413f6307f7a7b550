"""The timeline shows objects, water and every kind of mark, and its link opens what was shown."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from katana450.arm.control.pouring import CUP
from katana450.client import RefusedError, connect
from katana450.client.episodes import EpisodeClient
from katana450.client.files import Site
from katana450.extensions.recording.places import recordings_in
from katana450.extensions.recording.playback.rows import RecordedMoment
from katana450.extensions.recording.playback.run import PlaybackRun
from katana450.extensions.recording.playback.spans import place_of
from katana450.server.api import answers, requests
from tests.browser.conftest import OpenPage
from tests.browser.page import ViserPage
from tests.browser.server import RECORDING_APP, AppServer
from tests.browser.test_timeline import GHOST, opened, place, rest, shown_turn, visible
from tests.general_arms.links_of_arms import ur5e

pytestmark = pytest.mark.long

SCRIPT = """
frame: base
steps:
  - fill: 150
  - grasp: cup
  - line: {by: {z: 60}}
  - nudge: {axis: 1, by: 20}
"""
KINDS = {"stop", "clear_stop", "driver", "program", "step", "contact", "limit", "episode"}
WATER = "/playback/0/water"
TRACK_EDGE = 8.0
"""[px] Distance of the ends of the track from those of its slider."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("ring")


@pytest.fixture(scope="module")
def server(folder: Path) -> Iterator[AppServer]:
    """Return a server whose arm has been at a limit, at a contact, stopped, and lifted the cup."""
    options = ("--record", str(folder), "--episodes", str(folder.with_name("episodes")))
    with AppServer((*RECORDING_APP, "--silence", "2.0", *options)) as server:
        episodes = EpisodeClient(Site(server.url, name="Ada"))
        deadline = time.monotonic() + 60.0
        while not _started(episodes):
            assert time.monotonic() < deadline, "the process that records is not ready"
            time.sleep(0.3)
        with connect(server.url, "Ada") as arm:
            arm.ask(requests.Joints(q=np.array([9.0, -1.0, 1.4, 0.3, 0.0])))
            rest(arm)
            arm.stop()
            time.sleep(1.2)
            arm.clear_stop()
            arm.ask(requests.Home(wait=30))
            with suppress(RefusedError):
                arm.ask(requests.Position(p=np.array((0.3, 0.0, -0.4)), wait=30))
            arm.ask(requests.Home(wait=30))
            episodes.stop("success")
            assert arm.run(SCRIPT).program is not None
            end = arm.query(answers.State).t
            run = PlaybackRun(lambda: recordings_in(folder))
            while _end(run) < end:
                assert time.monotonic() < deadline + 120.0, "the end is not recorded"
                time.sleep(0.3)
        yield server


def _started(episodes: EpisodeClient) -> bool:
    with suppress(RefusedError):
        return episodes.start("look around") > 0
    return False


def _end(run: PlaybackRun) -> float:
    """Return the last moment of ``run`` [s] on the clock of the states."""
    run.update()
    moment = run.at(math.inf) if run.spans else None
    return -math.inf if moment is None else moment.row.t + 0.02


@pytest.fixture
def run(folder: Path, server: AppServer) -> PlaybackRun:
    del server
    found = PlaybackRun(lambda: recordings_in(folder))
    found.update()
    return found


def moments(run: PlaybackRun) -> Iterator[tuple[float, RecordedMoment]]:
    """Yield times and moments, ten a second."""
    for span in run.spans:
        for t in np.arange(span.start, span.end, 0.1).tolist():
            moment = run.at(t)
            if moment is not None:
                yield t, moment


def cup_of(moment: RecordedMoment) -> Any:
    return next(each.T for each in moment.objects if each.name == CUP)


def test_objects_and_water_are_those_of_the_moment(
    server: AppServer, run: PlaybackRun, open_page: OpenPage, artefacts: Path
) -> None:
    found = list(moments(run))
    # The first moment has no water yet, the last one a full cup in the hand.
    (first_t, first), (last_t, last) = found[0], found[-1]
    assert first.water is None or first.water.cup.volume == 0
    assert last.water is not None
    assert last.water.cup.volume > 0
    assert cup_of(last)[2, 3] - cup_of(first)[2, 3] > 0.05
    page = open_page(server.url, nodes=("/arm",))
    opened(page)
    for t, moment, wet in ((last_t, last, True), (first_t, first, False), (last_t, last, True)):
        place(page, place_of(run.spans, t))
        page.wait_until(lambda: visible(page, GHOST), "the recorded arm")
        wanted = cup_of(moment)[:3, 3]
        page.wait_until(
            lambda wanted=wanted: any(  # type: ignore[misc]
                np.abs(at - wanted).max() < 1e-3 for at in shown_objects(page)
            ),
            f"the cup at {wanted}",
        )
        page.wait_until(
            lambda wet=wet: visible(page, WATER) is wet,  # type: ignore[misc]
            "the water" if wet else "no water",
        )
        assert not visible(page, "/cup"), "the present cup is drawn too"
    page.keep(artefacts / "timeline-cup.png")
    assert page.errors == []


def shown_objects(page: ViserPage) -> list[Any]:
    """Return the places [m] of the recorded objects that ``page`` draws."""
    names = [f"/playback/0/objects/{number}" for number in range(4)]
    return [page.node_pose(name)[:3, 3] for name in names if visible(page, name)]


def test_marks_of_all_kinds_are_shown_and_clicked(
    server: AppServer, run: PlaybackRun, open_page: OpenPage
) -> None:
    page = open_page(server.url, nodes=("/arm",))
    opened(page)
    marks = page.page.locator("#timeline .marks i")
    page.wait_until(lambda: marks.count() >= len(run.marks()), "the marks")
    kinds = marks.evaluate_all("(all) => all.map((each) => each.className)")
    assert set(kinds) == KINDS
    contact = next(each for each in run.marks() if each.kind == "contact")
    moment = run.at(contact.t)
    assert moment is not None
    # Other marks can lie over it.
    page.page.locator("#timeline .marks .contact").first.dispatch_event("click")
    page.wait_until(lambda: visible(page, GHOST), "the recorded arm")
    page.wait_until(lambda: abs(shown_turn(page) - moment.row.joints[0]) < 1e-3, "the contact")
    events = page.page.get_by_label("Events")
    assert any("pressed STOP" in each for each in events.locator("option").all_inner_texts())


def test_copied_link_opens_the_same_moment(
    server: AppServer, run: PlaybackRun, open_page: OpenPage
) -> None:
    allowed = ["clipboard-read", "clipboard-write"]
    page = open_page(server.url, nodes=("/arm",), permissions=allowed)
    opened(page)
    place(page, 1.0)
    page.wait_until(lambda: visible(page, GHOST), "the recorded arm")
    turn = shown_turn(page)
    page.page.get_by_role("button", name="Copy link to this moment").click()
    page.page.locator("#toast", has_text="The link is copied").wait_for()
    link = page.page.evaluate("navigator.clipboard.readText()")
    assert link.startswith(f"{server.url}/?moment=ring@")
    other = open_page(f"{link}&x=", nodes=("/arm",))
    other.wait_until(lambda: visible(other, GHOST), "the recorded arm")
    other.wait_until(lambda: abs(shown_turn(other) - turn) < 5e-3, "the same posture")
    assert run.spans


def test_handles_of_the_selection_are_dragged_by_the_mouse(
    server: AppServer, open_page: OpenPage
) -> None:
    page = open_page(server.url, nodes=("/arm",))
    opened(page)
    for name, fraction in (
        ("Start of the selection", 0.25),
        ("End of the selection", 0.75),
        ("Moment that is shown", 0.5),
        ("Start of the selection", 0.4),
    ):
        slider = page.page.get_by_label(name, exact=True)
        box = slider.bounding_box()
        assert box is not None
        length = float(slider.get_attribute("max") or 0.0)
        width, left = box["width"] - 2.0 * TRACK_EDGE, box["x"] + TRACK_EDGE
        start = left + width * float(slider.input_value()) / length
        # The handles of the selection hang below the track.
        y = box["y"] + box["height"] - (6.0 if "selection" in name else 0.7 * box["height"])
        mouse = page.page.mouse
        mouse.move(start, y)
        mouse.down()
        mouse.move(left + fraction * width, y, steps=5)
        mouse.up()
        assert float(slider.input_value()) == pytest.approx(fraction * length, abs=0.02 * length)
    assert page.errors == []


def test_another_arm_is_played_back_and_runs_again(
    tmp_path: Path, open_page: OpenPage, artefacts: Path
) -> None:
    """A UR5e: six axes, no gripper."""
    urdf, folder = tmp_path / "ur5e.urdf", tmp_path / "ring"
    urdf.write_text(ur5e(), encoding="utf-8")
    command = (*RECORDING_APP, "--silence", "2.0", "--urdf", str(urdf), "--record", str(folder))
    with AppServer(command) as server:
        with connect(server.url, "Ada") as arm:
            arm.ask(requests.Home(wait=30))
            home = np.array(arm.query(answers.State).q)
            for by in (0.6, -0.3):
                arm.ask(requests.Joints(q=np.array([home[0] + by, *home[1:].tolist()]), wait=30))
            end = np.array(arm.query(answers.State).q)
        page = open_page(server.url, nodes=("/arm",))
        run = PlaybackRun(lambda: recordings_in(folder))

        def recorded() -> bool:
            run.update()
            moment = run.at(math.inf) if run.spans else None
            return moment is not None and np.allclose(moment.row.joints, end, atol=1e-9)

        page.wait_until(recorded, "the motion in the recording", seconds=40.0)
        opened(page)
        place(page, 1.0)
        link = f"{GHOST}/base_link/shoulder"
        page.wait_until(lambda: visible(page, link), "the recorded arm")
        moment = run.at(run.spans[0].start + 1.0)
        assert moment is not None

        def turn() -> float:
            R = np.linalg.inv(page.node_pose(f"{GHOST}/base_link")) @ page.node_pose(link)
            return float(np.arctan2(R[1, 0], R[0, 0]))

        page.wait_until(lambda: abs(turn() - moment.row.joints[0]) < 2e-2, "the recorded posture")
        page.keep(artefacts / "timeline-ur5e.png")
        page.page.get_by_role("button", name="Run again the selected motion").click()
        page.page.get_by_text("The motion has run again.").wait_for(timeout=90_000)
        with connect(server.url, "Look") as arm:
            np.testing.assert_allclose(arm.query(answers.State).q, end, atol=1e-4)
        assert page.errors == []
