"""The first visit: the first picture, and a card with three things to try, dismissed for good."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from playwright.sync_api import Browser, expect

from tests.browser.bare_page import ORIGIN, bare_page
from tests.browser.camera import Drawing
from tests.browser.conftest import OpenPage
from tests.browser.page import FIRST_VISIT, ViserPage
from tests.browser.server import APP, AppServer
from tests.browser.session import MOVE, Truth, clear_stop
from tests.browser.sizes import PHONE, PORTRAIT
from tests.general_arms.links_of_arms import ur5e

BLIND = """
    const { getContext } = HTMLCanvasElement.prototype;
    HTMLCanvasElement.prototype.getContext = function (kind, ...options) {
        return /^webgl/.test(kind) ? null : getContext.call(this, kind, ...options);
    };
"""
"""Script of a browser without WebGL."""

SETTINGS = """
    window.settings = {seen: 0, shown: 0};
    (function note() {
        requestAnimationFrame(note);
        const inside = document.querySelector("iframe")?.contentDocument;
        const found = inside?.querySelector(".mantine-Stack-root:has(> .mantine-TextInput-root)");
        if (!found || found.parentElement.parentElement.offsetHeight === 0) return;
        settings.seen += 1;
        if (getComputedStyle(found).visibility !== "hidden") settings.shown += 1;
    })();
"""
"""Script of the page that counts the frames with viser's settings in an open panel of the scene."""


@pytest.fixture
def visit(server: AppServer, open_page: OpenPage) -> ViserPage:
    page = open_page(server.url, nodes=("/arm", MOVE), script=FIRST_VISIT)
    page.page.wait_for_selector("#welcome:not([hidden])")
    truth = Truth(server)
    if truth.status()["stopped"] is not None:
        # The previous window closed while the arm was moving.
        clear_stop(page, truth)
    return page


def press(page: ViserPage, label: str) -> None:
    page.page.locator("#welcome button", has_text=label).click()


def done(page: ViserPage, label: str) -> bool:
    step = page.page.locator("#welcome button", has_text=label)
    return "done" in step.inner_text()


@pytest.mark.long
def test_unasked_drag_counts_and_question_mark_opens_the_help(
    visit: ViserPage, server: AppServer
) -> None:
    # The tools of the scene come after the first picture.
    expect(visit.page.locator("#poster")).to_have_class(re.compile("done"))
    loaded = "performance.getEntriesByType('resource').some(({name}) => name.endsWith('stage.js'))"
    visit.wait_until(lambda: visit.page.evaluate(loaded), "the tools of the scene")
    visit.drag_arrow(MOVE, "y", 0.05)
    visit.wait_until(lambda: done(visit, "Drag the arrows"), "the step to be done")
    help_ = visit.page.locator("#help")
    visit.page.keyboard.press("?")
    assert help_.is_visible()
    visit.page.keyboard.press("?")
    assert not help_.is_visible()
    # The drag is undone and done again by keys.
    truth = Truth(server)
    truth.wait(moving=False)
    after = truth.status()["q"]
    visit.page.keyboard.press("Control+z")
    visit.wait_until(lambda: abs(truth.status()["q"][0] - after[0]) > 0.01, "the undoing")
    truth.wait(moving=False)
    visit.page.keyboard.press("Control+Shift+Z")
    visit.wait_until(lambda: abs(truth.status()["q"][0] - after[0]) < 1e-6, "the redoing")
    assert visit.errors == []


@pytest.mark.long
def test_page_that_cannot_draw_says_so(server: AppServer, open_page: OpenPage) -> None:
    page = open_page(server.url, drawing=Drawing.NONE, script=BLIND).page
    expect(page.locator("#poster")).to_contain_text("WebGL 2 is off or missing", timeout=20_000)
    expect(page.locator("#stop")).to_be_enabled()


@pytest.mark.long
def test_other_arm_is_offered_what_it_can_do(open_page: OpenPage, tmp_path: Path) -> None:
    path = tmp_path / "ur5e.urdf"
    path.write_text(ur5e(), encoding="utf-8")
    with AppServer((*APP, "--urdf", str(path))) as server:
        page = open_page(server.url, script=FIRST_VISIT)
        page.page.wait_for_selector("#welcome:not([hidden])")
        assert page.page.locator("#welcome", has_text="pour").count() == 0
        press(page, "Watch it move")
        page.wait_until(lambda: done(page, "Watch it move"), "the end", seconds=60.0)
        assert page.errors == []


def test_refused_first_step_says_what_to_do_only_until_it_is_done(browser: Browser) -> None:
    arm = {"default_tool": "tcp", "gripper": [0.0, 1.0], "tools": {"grasp": {}}}
    with bare_page(browser, arm=arm) as page:
        page.route("**/api/v1/scripts/Pour", lambda route: route.fulfill(body="steps: []"))
        page.evaluate(
            """async (path) => {
                const status = { scripts: true, orders: [], paused: true, stopped: null };
                const store = { status, follow: (act) => (window.follow = act) };
                const say = ({ id }) => setTimeout(() => window.card.hear(
                    { is: "refused", id, why: "paused: press Resume to continue" }));
                const kept = { getItem: () => null, setItem() {} };
                const { Welcome } = await import(path);
                window.card = await Welcome.on({ store, say, kept, toast() {} });
                window.shown = status;
            }""",
            f"{ORIGIN}/static/welcome/welcome.js",
        )
        says = page.locator("#welcome > p")
        expect(says).to_contain_text("in any order")
        page.locator("#welcome button", has_text="pour").click()
        expect(says).to_contain_text("press Resume")
        page.evaluate("follow(shown)")
        expect(says).to_contain_text("press Resume")
        page.evaluate("follow({ ...shown, paused: false })")
        expect(says).to_be_empty()


@pytest.mark.long
def test_card_is_dismissed_for_good_and_returns_by_the_help(visit: ViserPage) -> None:
    window = visit.page
    # The card has no focus of its own; its buttons can be reached and pressed by keys.
    assert window.evaluate("() => document.activeElement === document.body")
    window.get_by_role("button", name="Drag the arrows").focus()
    window.keyboard.press("Enter")
    assert window.locator("#pulse").is_visible()
    window.get_by_role("button", name="Close for good").focus()
    window.keyboard.press("Enter")
    assert not window.locator("#welcome").is_visible()
    assert not window.locator("#pulse").is_visible()
    window.reload()
    window.locator("#holder", has_text="drive").wait_for()
    window.wait_for_timeout(200)
    assert window.locator("#welcome").count() == 0
    # The first of two requests gets no answer.
    window.route("**/api/v1/arm", lambda route: route.abort(), times=1)
    with window.expect_event("requestfailed"):
        window.click("#help-button")
        window.get_by_role("button", name="First steps").click()
    window.click("#help-button")
    window.get_by_role("button", name="First steps").click()
    window.wait_for_selector("#welcome:not([hidden])")


@pytest.mark.long
def test_card_lies_over_no_sheet_of_a_phone(server: AppServer, open_page: OpenPage) -> None:
    page = open_page(server.url, window=PORTRAIT, script=FIRST_VISIT, **PHONE)
    card = page.page.locator("#welcome")
    card.wait_for()
    for opener in (page.frame.locator("#k450-sheet"), page.page.locator("#jog-button")):
        opener.tap()
        card.wait_for(state="hidden")
        opener.tap()
        if opener.get_attribute("aria-label") == "Controls, full height":
            opener.tap()
        card.wait_for()
    assert page.errors == []


@pytest.mark.long
def test_settings_for_developers_never_flash(open_page: OpenPage) -> None:
    with AppServer() as server:
        page = open_page(server.url, nodes=("/arm", MOVE), script=SETTINGS)
        server.kill()
        page.wait_lost()
        server.restart()
        page.wait_until(lambda: page.connected, "the connection", seconds=30.0)
        page.wait_ready(("/arm", MOVE))
        page.wait_drawn()
        settings = page.page.evaluate("settings")
        # The panel shows them for a moment by itself.
        assert settings["seen"] > 0
        assert settings["shown"] == 0
