"""Handover of the arm: pages of the former driver, the driver and the person who requests it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from katana450.client import connect
from tests.browser.conftest import OpenPage
from tests.browser.page import ViserPage
from tests.browser.server import APP, AppServer
from tests.browser.session import Truth, bar, take

SCRIPT = """\
name: Wave
speed: 0.2
steps:
  - joints: [100, -60, 85, 8, 0]
  - joints: [-100, -60, 85, 8, 0]
"""


@pytest.fixture
def server(tmp_path: Path) -> Iterator[AppServer]:
    (tmp_path / "Wave.yaml").write_text(SCRIPT)
    with AppServer((*APP, "--programs", str(tmp_path))) as server:
        yield server


def shown(page: ViserPage, *labels: str, within: str) -> None:
    buttons = page.page.locator(f"#{within} button")
    page.wait_until(lambda: buttons.all_inner_texts() == list(labels), f"{labels}", seconds=30.0)


def run(page: ViserPage) -> None:
    page.click_button("Run")
    page.wait_until(lambda: bar(page, "headline").startswith("Wave: "), "the program", seconds=60.0)


@pytest.mark.long
def test_choice_of_the_next_driver_by_keys_is_sent_by_enter(
    server: AppServer, open_page: OpenPage
) -> None:
    page, other = (open_page(server.url, nodes=("/arm",)) for _ in range(2))
    take(page)
    page.page.focus("#acts select")
    page.page.keyboard.press("ArrowDown")
    # Another person comes, and the controls are drawn anew.
    with connect(server.url, "Anna"):
        page.page.wait_for_selector("#acts option:has-text('Anna')", state="attached")
        assert page.page.evaluate("() => document.activeElement.tagName") == "SELECT"
        assert bar(page, "holder") == "You drive"
        page.page.keyboard.press("Enter")
        other.wait_until(lambda: bar(other, "holder") == "You drive", "the arm")
    assert page.errors == []


@pytest.mark.long
def test_program_is_ended_in_the_bar_and_its_owner_chooses_the_next_driver(
    server: AppServer, open_page: OpenPage, artefacts: Path
) -> None:
    truth = Truth(server)
    owner, other = (open_page(server.url, nodes=("/arm",)) for _ in range(2))
    me, they = (bar(each, "name").partition(",")[0] for each in (owner, other))
    owner.open_tab("Programs")
    owner.choose("Script", "Wave")
    run(owner)
    shown(owner, "End", within="orders")
    shown(owner, "Take over", within="acts")
    assert bar(owner, "holder") == "Your program drives"
    shown(other, within="orders")
    other.press_in_bar("Request")
    shown(owner, "Allow", "Refuse", within="acts")
    assert bar(owner, "name") == f"{they} asks for it"
    owner.keep(artefacts / "handover-request.png")
    owner.press_in_bar("Refuse")
    other.wait_until(lambda: bar(other, "toast") == f"{me} declined your request.", "the refusal")
    assert truth.status()["holder"] == "Wave"
    other.press_in_bar("Request")
    shown(owner, "Allow", "Refuse", within="acts")
    owner.press_in_bar("Allow")
    other.wait_until(lambda: bar(other, "holder") == "You drive", "the arm")
    assert truth.status()["program"]["status"] == "stopped"
    shown(owner, within="orders")
    owner.press_in_bar("Take over")
    why = f"{me} took over from you."
    other.wait_until(lambda: why in bar(other, "why"), why)
    other.keep(artefacts / "handover-taken.png")
    run(owner)
    owner.page.locator("#orders").get_by_role("button", name="End", exact=True).click()
    owner.wait_until(lambda: truth.status()["program"]["status"] == "stopped", "the end")
    assert truth.status()["program"]["why"] == f"{me} ended it."
    truth.wait(5.0, moving=False, stopped=None)
    assert owner.errors == []
    assert other.errors == []
