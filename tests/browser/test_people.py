"""The list of those who are connected, in the page of an admin."""

from __future__ import annotations

import re
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from playwright.sync_api import Page

from katana450.arm.control.lease import Role
from katana450.client import Client, connect
from katana450.client.files import LostError
from katana450.server.api import answers, requests
from tests.browser.camera import Drawing
from tests.browser.conftest import Windows
from tests.gateway.client import people_of
from tests.gateway.site import Site, open_site


@pytest.fixture
def site(tmp_path: Path) -> Iterator[Site]:
    with open_site(tmp_path) as site:
        yield site


@contextmanager
def visiting(windows: Windows, url: str) -> Iterator[Page]:
    """Open ``url`` in a browser of its own."""
    with windows.open(url, drawing=Drawing.NONE) as window:
        window.page.locator("#name", has_text=re.compile(".")).wait_for()
        yield window.page


def poll(program: Client) -> None:
    """Query the state for five seconds."""
    for _ in range(50):
        program.query(answers.State)
        time.sleep(0.1)


def waits(page: Page, name: str, words: str) -> None:
    page.locator("#people-list li", has_text=name).get_by_text(words).wait_for(timeout=10_000)


@pytest.mark.long
def test_admin_lists_and_disconnects(site: Site, windows: Windows) -> None:
    url, token = site.server.url, site.link("Vera", Role.VIEWER)
    boss = site.link("Ada", Role.ADMIN)
    with (
        visiting(windows, f"{url}/#{boss}") as page,
        connect(url, "Watch", token) as watch,
        connect(url, "Sorter of parts", site.link("Oda", Role.OPERATOR)) as sorter,
    ):
        sorter.ask(requests.Acquire())
        page.locator("#name", has_text="3 connected").wait_for()
        # With the keyboard alone.
        page.focus("#help-button")
        page.keyboard.press("Enter")
        page.get_by_role("button", name="Who is connected").focus()
        page.keyboard.press("Enter")
        waits(page, "Vera", "viewer · connected from 127.0.0.1")
        assert not page.locator("#help").is_visible()
        assert page.get_by_role("dialog", name="Who is connected").is_visible()
        waits(page, "Oda", "operator · drives · connected")
        assert page.locator("#people-list li b").all_inner_texts() == ["Ada (you)", "Vera", "Oda"]
        for size in ((1280, 800), (390, 844), (844, 390)):
            page.set_viewport_size({"width": size[0], "height": size[1]})
            stop = page.locator("#stop").bounding_box()
            box = page.locator("#people").bounding_box()
            assert stop is not None
            assert box is not None
            assert box["y"] >= stop["y"] + stop["height"]
            assert box["x"] >= 0.0
            assert box["x"] + box["width"] <= size[0]
        page.set_viewport_size({"width": 1280, "height": 800})
        # Nobody disconnects an admin by mistake.
        assert page.locator("#people-list li", has_text="Ada").locator("button").count() == 0
        page.select_option("#kick-for", "600")
        page.get_by_role("button", name="Disconnect Vera").focus()
        page.keyboard.press("Enter")
        waits(page, "Vera", "disconnected for 10 min")
        # The focus is still on the button of the same person.
        assert page.evaluate("document.activeElement.ariaLabel") == "Let in Vera"
        with pytest.raises(LostError):
            poll(watch)
        page.get_by_role("button", name="Let in Vera").click()
        page.locator("#people-list li", has_text="Vera").wait_for(state="detached")
        page.keyboard.press("Escape")
        assert not page.locator("#people").is_visible()
        assert page.evaluate("document.activeElement.id") == "help-button"
    with connect(url, "Watch", token) as watch:
        assert watch.query(answers.State).stopped == "Ada pressed STOP."


@pytest.mark.long
def test_disconnected_person_still_stops_the_arm_and_comes_back(
    site: Site, windows: Windows
) -> None:
    url = site.server.url
    boss, token = site.link("Ada", Role.ADMIN), site.link("Kai", Role.VIEWER)
    with (
        connect(url, "Guard", boss) as guard,
        visiting(windows, f"{url}/#{token}") as phone,
    ):
        phone.set_viewport_size({"width": 390, "height": 844})
        # Only admins have the button of the list.
        assert phone.locator("#people-help").is_hidden()
        (kai,) = (person for person in people_of(guard) if person.name == "Kai")
        for again in (False, True):
            guard.kick(kai.person, 600.0)
            phone.get_by_text("An admin has disconnected you. Come back in").wait_for()
            if again:
                # The page knows no state of the arm.
                phone.reload()
                phone.get_by_text("Your STOP still works").wait_for()
            phone.locator("#stop").click()
            phone.locator("#stop:not(.asked)").wait_for()
            assert guard.query(answers.State).stopped == "Kai pressed STOP."
            if not again:
                guard.kick(kai.person, 0.0)
                phone.locator("#gate").wait_for(state="hidden")


@pytest.mark.long
def test_link_is_revoked_by_the_second_click(site: Site, windows: Windows) -> None:
    url = site.server.url
    boss, token = site.link("Ada", Role.ADMIN), site.link("Rita", Role.VIEWER)
    with visiting(windows, f"{url}/#{boss}") as page, connect(url, "Watch", token):
        page.click("#help-button")
        page.click("#people-button")
        page.select_option("#kick-for", "revoke")
        page.get_by_role("button", name="Disconnect Rita").click()
        sure = page.get_by_role("button", name="Revoke the link of Rita for ever?")
        assert sure.inner_text() == "Revoke for ever?"
        # Another choice takes the question back.
        page.select_option("#kick-for", "60")
        page.get_by_role("button", name="Disconnect Rita").wait_for()
        page.select_option("#kick-for", "revoke")
        page.wait_for_timeout(200)
        assert any(grant.name == "Rita" for grant in site.file.grants.values())
        page.get_by_role("button", name="Disconnect Rita").click()
        sure.click()
        page.locator("#people-list li", has_text="Rita").wait_for(state="detached")
        assert all(grant.name != "Rita" for grant in site.file.grants.values())
