"""The harness itself: what it misses, and the flags of its browser."""

from __future__ import annotations

import re

import pytest
from playwright.sync_api import Browser
from playwright.sync_api import Error as PlaywrightError

from tests.browser.page import ViserPage

PITCH = "/target/move/pitch"


def test_missing_parts_are_named(page: ViserPage) -> None:
    with pytest.raises(AssertionError, match="missing: /nowhere"):
        page.wait_ready(["/nowhere"], seconds=0.2)
    with pytest.raises(PlaywrightError, match=r"has no ring z; it has: ring y"):
        page.grip_ring(PITCH, "z")
    with pytest.raises(LookupError, match="/nowhere"):
        page.last_pose("/nowhere")


def test_features_that_playwright_disables_stay_disabled(browser: Browser) -> None:
    session = browser.new_browser_cdp_session()
    command: str = session.send("SystemInfo.getInfo")["commandLine"]
    session.detach()
    lists = [set(words.split(",")) for words in re.findall(r"--disable-features=(\S+)", command)]
    # Chromium takes the last one.
    assert len(lists) >= 2
    assert set().union(*lists) == lists[-1]
