"""The harness itself: what it records, projects and misses."""

from __future__ import annotations

import re
import time

import pytest
from playwright.sync_api import Browser
from playwright.sync_api import Error as PlaywrightError

from tests.browser.page import ViserPage
from tests.browser.session import MOVE

PITCH = "/target/move/pitch"
LINK = "/arm/base_link/arm_base_link/pan_link"


def test_messages_are_recorded_with_their_time(page: ViserPage) -> None:
    before = time.time()
    page.drag_arrow(MOVE, "y", 0.03)
    page.wait_until(lambda: page.messages("SetOrientationMessage", node=LINK, since=before), "it")
    [start] = page.sent("TransformControlsDragStartMessage", since=before)
    poses = page.messages("SetOrientationMessage", node=LINK, since=start.time)
    assert start.body["name"] == MOVE
    times = [before, start.time, *(pose.time for pose in poses), time.time()]
    assert times == sorted(times)
    with pytest.raises(LookupError, match="/nowhere"):
        page.last_pose("/nowhere")


def test_missing_parts_are_named(page: ViserPage) -> None:
    with pytest.raises(AssertionError, match="missing: /nowhere"):
        page.wait_ready(["/nowhere"], seconds=0.2)
    with pytest.raises(PlaywrightError, match=r"has no ring z; it has: ring y"):
        page.grip_ring(PITCH, "z")


def test_features_that_playwright_disables_stay_disabled(browser: Browser) -> None:
    session = browser.new_browser_cdp_session()
    command: str = session.send("SystemInfo.getInfo")["commandLine"]
    session.detach()
    lists = [set(each.split(",")) for each in re.findall(r"--disable-features=(\S+)", command)]
    # Chromium takes the last one.
    assert len(lists) >= 2
    assert set().union(*lists) == lists[-1]
