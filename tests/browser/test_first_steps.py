"""The first visit: a card with three things to try, dismissed for good, back by the help."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import trimesh

from tests.browser.conftest import OpenPage
from tests.browser.page import FIRST_VISIT, ViserPage
from tests.browser.server import APP, AppServer
from tests.browser.session import MOVE, Truth, clear_stop, prepare, take
from tests.browser.sizes import LANDSCAPE, PHONE, PORTRAIT, WIDE, in_sizes_and_schemes
from tests.gateway.slow_link import SlowLink
from tests.general_arms.links_of_arms import ur5e

WORKER = """
    if (window === top) window.Worker = class extends Worker {
        constructor(...options) { super(...options); window.worker = this; }
    };
"""
"""Script that keeps the worker through which the page speaks to the server."""

NIGHT = "rgb(20, 24, 29)"

WATCHED = """
    window.posters = [];
    (function note() {
        requestAnimationFrame(note);
        const poster = window === top && document.getElementById("poster");
        if (!poster) return;
        const { opacity, visibility, backgroundColor } = getComputedStyle(poster);
        const state = visibility === "hidden" ? "gone" : opacity < 1 ? "going" : "shown";
        const now = `${state} ${poster.innerText.trim()} ${backgroundColor}`;
        if (posters.at(-1) !== now) posters.push(now);
    })();
"""
"""Script that records the states of the poster."""

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

SIZES = {"wide": WIDE, "portrait": PORTRAIT, "landscape": LANDSCAPE}

NO_STORAGE = """for (const each of ["localStorage", "sessionStorage"])
    Object.defineProperty(window, each, {get() {
        throw new DOMException("No storage in this window.", "SecurityError");
    }});"""


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
def test_first_drag_is_asked_for_and_noticed(visit: ViserPage, artefacts: Path) -> None:
    press(visit, "Drag the arrows")
    ring = visit.page.locator("#pulse").bounding_box()
    assert ring is not None
    x, y = visit.project(visit.node_pose(MOVE)[:3, 3])
    assert abs(ring["x"] + ring["width"] / 2 - x) < 3
    assert abs(ring["y"] + ring["height"] / 2 - y) < 3
    visit.keep(artefacts / "first-steps-drag.png")
    assert not done(visit, "Drag the arrows")
    visit.drag_arrow(MOVE, "y", 0.1)
    visit.wait_until(lambda: done(visit, "Drag the arrows"), "the step to be done")
    assert not visit.page.locator("#pulse").is_visible()
    # What was done stays done, and no other sheet is covered.
    visit.page.reload()
    visit.page.wait_for_selector("#welcome:not([hidden])")
    assert done(visit, "Drag the arrows")
    assert not done(visit, "Watch it pour")
    card = visit.page.locator("#welcome")
    for sheet in ("teach", "objects", "jog"):
        visit.page.click(f"#{sheet}-button")
        visit.page.wait_for_selector(f"#{sheet}:not([hidden])")
        assert not card.is_visible()
        visit.page.click(f"#{sheet}-button")
    assert card.is_visible()
    assert visit.errors == []


def test_unasked_drag_counts_and_question_mark_opens_the_help(
    visit: ViserPage, server: AppServer
) -> None:
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


@pytest.mark.long
def test_part_is_chosen_with_one_click(visit: ViserPage, tmp_path: Path) -> None:
    ring = tmp_path / "ring.stl"
    ring.write_bytes(trimesh.creation.torus(40.0, 12.0, 24, 12).export(file_type="stl"))
    with visit.page.expect_file_chooser() as chooser:
        press(visit, "Bring your own part")
    chooser.value.set_files(ring)
    visit.wait_until(lambda: "triangles" in visit.page.inner_text("#read"), "the answer")
    visit.page.click("#objects-button")
    visit.wait_until(lambda: done(visit, "Bring your own part"), "the step to be done")
    assert visit.errors == []


@pytest.mark.long
def test_pouring_is_planned_with_progress_and_runs(
    visit: ViserPage, server: AppServer, artefacts: Path
) -> None:
    truth = Truth(server)
    press(visit, "Watch it pour")
    says = visit.page.locator("#welcome [role=status]")
    # A plan that is kept from before needs no planning.
    visit.wait_until(lambda: re.search("%|Step", says.inner_text()) is not None, "progress")
    visit.wait_until(lambda: "Step" in says.inner_text(), "the run", seconds=120.0)
    visit.keep(artefacts / "first-steps-pour.png")
    visit.wait_until(lambda: done(visit, "Watch it pour"), "the end", seconds=120.0)
    assert truth.status()["water"]["basin_ml"] > 190.0


@pytest.mark.long
def test_pouring_that_is_stopped_and_continued_is_done(visit: ViserPage, server: AppServer) -> None:
    press(visit, "Watch it pour")
    says = visit.page.locator("#welcome [role=status]")
    visit.wait_until(lambda: "Step 3" in says.inner_text(), "the run", seconds=120.0)
    visit.page.keyboard.press("Space")
    says.filter(has_text="It did not pour. You pressed STOP.").wait_for()
    Truth(server).wait(moving=False)
    clear_stop(visit, Truth(server))
    visit.press_in_bar("Continue Pour")
    visit.wait_until(lambda: done(visit, "Watch it pour"), "the end", seconds=120.0)
    assert "Poured" in says.inner_text()
    assert visit.errors == []


@pytest.mark.long
def test_pouring_leaves_another_program_paused(server: AppServer, open_page: OpenPage) -> None:
    page = open_page(server.url, nodes=("/arm", MOVE), script=f"{FIRST_VISIT}{WORKER}")
    truth = Truth(server)
    prepare(page, truth)

    def ask(**request: object) -> None:
        page.page.evaluate("(say) => worker.postMessage({say})", request)

    def status() -> str | None:
        program = truth.status().get("program")
        return program and f"{program['name']} {program['status']}"

    ask(do="program", text="name: Mine\nsteps:\n  - joints: [40, -60, 100, 40, 0]\n  - home\n")
    page.wait_until(lambda: status() == "Mine ready", "the plan", seconds=30.0)
    ask(do="steer", order="run")
    truth.wait(moving=True)
    ask(do="steer", order="pause")
    truth.wait(moving=False, status="paused")
    press(page, "Watch it pour")
    says = page.page.locator("#welcome [role=status]")
    says.filter(has_text="It did not pour. A program is running. End it first.").wait_for()
    page.page.wait_for_timeout(500)
    assert truth.status()["status"] == "paused"
    assert not done(page, "Watch it pour")
    ask(do="steer", order="end")
    page.wait_until(lambda: status() == "Mine stopped", "the end")


@pytest.mark.long
def test_planning_is_shown_and_a_stop_ends_it(visit: ViserPage, server: AppServer) -> None:
    # A failed look is repeated.
    visit.page.route("**/api/v1/state", lambda route: route.abort(), times=1)
    press(visit, "Watch it pour")
    says = visit.page.locator("#welcome [role=status]")
    visit.wait_until(lambda: "Planning" in says.inner_text(), "the planning")
    visit.page.keyboard.press("Space")
    Truth(server).wait(mood="stopped")
    visit.wait_until(lambda: "did not pour" in says.inner_text(), "the end")
    assert not done(visit, "Watch it pour")
    visit.press_in_bar("Clear stop")
    Truth(server).wait(stopped=None)


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
    window.wait_for_timeout(500)
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
def test_window_without_storage_shows_the_card(server: AppServer, open_page: OpenPage) -> None:
    page = open_page(server.url, nodes=("/arm",), script=f"{FIRST_VISIT}{NO_STORAGE}")
    page.page.wait_for_selector("#welcome:not([hidden])")
    page.page.get_by_role("button", name="Close for good").click()
    assert not page.page.locator("#welcome").is_visible()
    page.page.keyboard.press("Space")
    Truth(server).wait(mood="stopped")
    page.page.wait_for_timeout(1100)
    take(page)
    clear_stop(page, Truth(server))
    assert page.errors == []


@pytest.mark.long
def test_poster_covers_the_scene_until_it_is_drawn(server: AppServer, open_page: OpenPage) -> None:
    with SlowLink(server.port, 2e6, delay=0.1) as line:
        page = open_page(
            f"http://127.0.0.1:{line.port}",
            nodes=("/arm", MOVE),
            script=WATCHED,
            color_scheme="dark",
        )
        page.wait_until(lambda: "gone" in page.page.evaluate("posters.at(-1)"), "the scene")
        states = page.page.evaluate("posters")
        assert f"shown Loading the arm and its scene {NIGHT}" in states
        assert all(each.endswith(NIGHT) for each in states)
        # It goes once and does not return.
        assert [each.startswith("gone") for each in states] == [False] * (len(states) - 1) + [True]


@pytest.mark.long
def test_settings_for_developers_never_flash(open_page: OpenPage) -> None:
    with AppServer() as server:
        page = open_page(server.url, nodes=("/arm", MOVE), script=SETTINGS)
        server.kill()
        page.wait_lost()
        server.restart()
        page.wait_until(lambda: page.connected, "the connection", seconds=30.0)
        page.wait_ready(("/arm", MOVE))
        page.page.wait_for_timeout(800)
        found = page.page.evaluate("settings")
        # The panel shows them for a moment by itself.
        assert found["seen"] > 0
        assert found["shown"] == 0


@pytest.mark.long
@pytest.mark.parametrize("size", ["portrait", "landscape"])
def test_poster_on_a_phone_does_not_hide_a_button_that_takes_a_tap(
    server: AppServer, open_page: OpenPage, size: str
) -> None:
    page = open_page(server.url, window=SIZES[size], own_camera=True, script=FIRST_VISIT)
    page.page.wait_for_selector("#welcome:not([hidden])")
    # The poster is shown as before the scene is drawn, and is found by a pixel.
    hit = page.page.evaluate(
        """() => {
            const poster = document.getElementById("poster");
            poster.style.cssText = "visibility: visible; pointer-events: auto; transition: none";
            const box = document.querySelector("#welcome li button").getBoundingClientRect();
            const found = document.elementFromPoint(box.left + 20, box.top + 20);
            return found.closest("#poster, #welcome").id;
        }"""
    )
    assert hit == "welcome"


@pytest.mark.long
@in_sizes_and_schemes(SIZES, ("portrait", "dark"))
def test_card_fits_every_size(
    server: AppServer, open_page: OpenPage, size: str, scheme: str, artefacts: Path
) -> None:
    touch = {} if size == "wide" else PHONE
    page = open_page(
        server.url,
        nodes=("/arm", MOVE),
        window=SIZES[size],
        own_camera=True,
        script=FIRST_VISIT,
        color_scheme=scheme,
        **touch,
    )
    page.page.wait_for_selector("#welcome:not([hidden])")
    page.page.wait_for_timeout(700)
    page.keep(artefacts / f"first-steps-{size}-{scheme}.png")
    card = page.page.locator("#welcome")
    assert card.evaluate("(each) => each.scrollHeight <= each.clientHeight + 1")
    assert page.page.evaluate("() => document.documentElement.scrollWidth <= innerWidth")
    if touch:
        for button in card.locator("button").all():
            box = button.bounding_box()
            assert box is not None
            assert min(box["width"], box["height"]) >= 43.5
