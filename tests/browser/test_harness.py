"""The flags of the browser of the tests."""

from __future__ import annotations

import re

from playwright.sync_api import Browser


def test_features_that_playwright_disables_stay_disabled(browser: Browser) -> None:
    session = browser.new_browser_cdp_session()
    command: str = session.send("SystemInfo.getInfo")["commandLine"]
    session.detach()
    lists = [set(words.split(",")) for words in re.findall(r"--disable-features=(\S+)", command)]
    # Chromium takes the last one.
    assert len(lists) >= 2
    assert set().union(*lists) == lists[-1]
