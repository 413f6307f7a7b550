"""The timeline and the episodes of a robot that has only joints.

`tests/view/test_machine_view.py` has the fast representatives.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
import pytest

import katana450
from katana450.arm.robot.loader import load
from katana450.client import connect
from katana450.extensions.recording.places import recordings_in
from katana450.extensions.recording.playback.run import PlaybackRun
from katana450.maths.geometry.arrays import FloatArray
from katana450.server.api import answers
from tests.browser.conftest import OpenPage
from tests.browser.page import ViserPage
from tests.browser.server import RECORDING_APP, AppServer
from tests.browser.session import Truth, bar
from tests.browser.sizes import PHONE, SIZES, WIDE, in_sizes_and_schemes
from tests.browser.test_episodes import ready, toast
from tests.browser.test_timeline import CUT, opened, place, visible
from tests.exchange.conftest import GANTRY

pytestmark = pytest.mark.long

POSTURES = ((0.3, 0.8, -0.4), (-0.3, -0.5, 0.2))
"""[m, rad, rad] Rail, turn and grip, one after the other."""

ROOT = "/playback/0/arm"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("recorded")


@pytest.fixture(scope="module")
def server(folder: Path) -> Iterator[AppServer]:
    """Return a server of a gantry that has moved, and has recorded it."""
    folders = ("--record", str(folder / "ring"), "--episodes", str(folder / "episodes"))
    command = (*RECORDING_APP, "--silence", "2.0", "--urdf", str(GANTRY), *folders)
    with AppServer(command) as server:
        with connect(server.url, "Ada") as arm:
            for posture in POSTURES:
                arm.joints(posture)
        deadline = time.monotonic() + 60.0
        run = PlaybackRun(lambda: recordings_in(folder / "ring"))
        while not np.allclose(newest(run), POSTURES[-1], atol=1e-6):
            assert time.monotonic() < deadline, "the motion is not recorded"
            time.sleep(0.2)
        yield server


@pytest.fixture
def run(folder: Path) -> PlaybackRun:
    found = PlaybackRun(lambda: recordings_in(folder / "ring"))
    found.update()
    return found


def newest(run: PlaybackRun) -> list[float]:
    """Return the newest recorded joints [m, rad, rad]; zeros before the first."""
    run.update()
    moment = run.at(math.inf) if run.spans else None
    return [0.0] * 3 if moment is None else moment.row.joints


def nodes(server: AppServer) -> list[str]:
    """Return the path of the link that each joint moves, below the node of the robot."""
    with connect(server.url, "Reader") as reader:
        arm = reader.query(answers.Arm)
    return ["/" + "/".join(quote(name, safe="") for name in each.path) for each in arm.links]


def shown(page: ViserPage, path: str, root: str = ROOT) -> FloatArray:
    """Return the pose (4, 4) of the link ``path`` in its parent, as ``page`` draws it."""
    above = np.linalg.inv(page.node_pose(root + path.rpartition("/")[0]))
    return np.asarray(above @ page.node_pose(root + path))


def shown_joints(page: ViserPage, paths: list[str], zero: list[FloatArray]) -> FloatArray:
    """Return the joints [m, rad, rad] of the recorded gantry that ``page`` draws."""
    moved = [np.linalg.inv(T) @ shown(page, path) for path, T in zip(paths, zero, strict=True)]
    turns = [math.atan2(moved[1][1, 0], moved[1][0, 0]), math.atan2(moved[2][2, 1], moved[2][1, 1])]
    return np.array([moved[0][0, 3], *turns])


def zero_poses() -> list[FloatArray]:
    """Return the pose (4, 4) in its parent of the link of each joint, at zero."""
    robot = load(GANTRY)
    links = {link.joint.name: link for link in robot.links if link.joint is not None}
    return [links[name].T_parent_link for name in robot.driven]


def test_recorded_joints_are_shown_until_acting(
    server: AppServer, run: PlaybackRun, open_page: OpenPage, artefacts: Path
) -> None:
    page = open_page(server.url, nodes=("/arm",), window=WIDE)
    paths, zero, truth = nodes(server), zero_poses(), Truth(server)
    before = truth.status()["q"]
    opened(page)
    length = float(page.page.get_by_label("Moment that is shown").get_attribute("max") or 0.0)
    for fraction in (0.2, 0.6, 0.4):
        place(page, fraction * length)
        page.wait_until(lambda: visible(page, ROOT + paths[0]), "the recorded robot")
        words = page.page.locator("#timeline .clock").inner_text()
        assert words != "Live"
        moment = run.at(run.spans[0].start + fraction * length)
        assert moment is not None
        page.wait_until(
            lambda q=moment.row.joints: np.allclose(shown_joints(page, paths, zero), q, atol=2e-6),  # type: ignore[misc]
            f"the joints at {fraction:.0%}",
        )
    page.wait_until(lambda: not visible(page, "/arm" + paths[0]), "the present to be hidden")
    assert truth.status()["q"] == before
    page.keep(artefacts / "timeline-joints.png")
    # Scripts do not move it, so nothing can be run again.
    assert not page.page.get_by_text("Run again", exact=True).is_visible()
    page.page.keyboard.press("Escape")
    page.wait_until(lambda: visible(page, "/arm" + paths[0]), "the present")
    assert not visible(page, ROOT + paths[0])
    assert truth.status()["stopped"] is not None
    page.page.click("#clear-stop")
    truth.wait(stopped=None)
    assert page.errors == []


def test_recording_is_kept_compared_verified_and_exported(
    server: AppServer, folder: Path, open_page: OpenPage, tmp_path: Path
) -> None:
    page = open_page(server.url, nodes=("/arm",), window=WIDE)
    page.page.click("#more-button")
    with page.page.expect_download() as downloading:
        page.press_in_bar("Save the last 10 minutes")
    kept = tmp_path / "kept.mcap"
    downloading.value.save_as(kept)
    assert katana450.open(kept).verify(GANTRY).identical
    page.press_in_bar("Timeline")
    page.page.wait_for_function("() => Number(document.querySelector('#timeline .now')?.max) > 1")
    page.page.locator("#timeline input[type=file]").set_input_files(kept)
    page.wait_until(lambda: visible(page, ROOT), "the recorded robot")
    page.page.get_by_label("Second run").select_option(label="from here on")
    lines = page.page.locator("#timeline .plot span")
    lines.first.wait_for()
    assert [each.split(",")[0] for each in lines.all_inner_texts()] == [
        "largest joint difference",
        "largest slide difference",
    ]
    page.page.get_by_role("button", name="Verify the selection").click()
    work = page.page.locator("#timeline .work")
    work.get_by_text("identical to the bit over").wait_for(timeout=60_000)
    for words, start in (("CSV table", b"t,theta1,theta2,theta3\n"), ("HTML page", b"<!")):
        with page.page.expect_download(timeout=90_000) as downloading:
            page.page.get_by_label("Export the selection").select_option(label=words)
        downloading.value.save_as(tmp_path / "exported")
        assert (tmp_path / "exported").read_bytes().startswith(start)
        work.get_by_text("Exported katana450").wait_for()
    del folder
    assert page.errors == []


def test_episode_is_recorded_and_judged(
    server: AppServer, folder: Path, open_page: OpenPage, artefacts: Path
) -> None:
    page = open_page(server.url, nodes=("/arm",), window=WIDE)
    ready(page)
    page.page.click("#episodes-button")
    page.page.get_by_label("Task").fill("reach the end of the rail")
    page.page.get_by_role("button", name="Start an episode").click()
    toast(page, "Recording episode 1")
    with connect(server.url, "Ada") as arm:
        arm.joints((0.1, 0.0, 0.0))
    page.wait_until(lambda: "kB" in bar(page, "episodes-button"), "the size in the bar")
    page.page.get_by_role("button", name="Success").click()
    toast(page, "Episode 1: success")
    page.keep(artefacts / "timeline-joints-episode.png")
    (path,) = (folder / "episodes").glob("episode-*.mcap")
    recorded: Any = katana450.open(path)
    (episode,) = recorded.episodes
    assert episode.task == "reach the end of the rail"
    assert recorded.setpoint[-1] == pytest.approx((0.1, 0.0, 0.0), abs=1e-6)
    assert page.errors == []


@in_sizes_and_schemes(("wide", "portrait", "landscape"))
def test_timeline_of_joints_fits(
    server: AppServer, open_page: OpenPage, artefacts: Path, size: str, scheme: str
) -> None:
    options = {} if size == "wide" else PHONE
    page = open_page(
        server.url, nodes=("/arm",), window=SIZES[size], color_scheme=scheme, **options
    )
    opened(page)
    place(page, 1.0)
    page.wait_until(lambda: visible(page, ROOT), "the recorded robot")
    page.keep(artefacts / f"timeline-joints-{size}-{scheme}.png")
    box = page.page.locator("#timeline").bounding_box()
    assert box is not None
    # One line on a desk, three on a phone.
    assert box["height"] <= {"wide": 33.0, "portrait": 140.0, "landscape": 45.0}[size]
    assert page.page.locator("#timeline select").evaluate_all(CUT) == []
    assert page.errors == []
