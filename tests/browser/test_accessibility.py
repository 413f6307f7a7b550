"""The panel for everybody: names for screen readers, sizes of targets and text, and contrast."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Frame, Page

from tests.browser.conftest import OpenPage
from tests.browser.page import FIRST_VISIT, ViserPage
from tests.browser.server import AppServer
from tests.browser.session import MOVE, take
from tests.browser.sizes import PHONE, PORTRAIT, WIDE

AXE = Path(__file__).parents[1] / "javascript" / "node_modules" / "axe-core" / "axe.min.js"

CONTROLS = """() => {
    const shown = (each) => each.checkVisibility() && each.getBoundingClientRect().width > 0;
    const found = (selector) => [...document.querySelectorAll(selector)].filter(shown);
    const name = (each) => each.getAttribute("aria-label") || each.textContent.trim()
        || each.labels?.[0]?.textContent || "";
    const box = (each) => each.getBoundingClientRect();
    const panel = found("[role=slider]")[0].closest("[data-scrollarea-viewport]") ?? document.body;
    const inside = (selector) => found(selector).filter((each) => panel.contains(each));
    const boxes = "input:not([type=hidden], [type=checkbox])";
    return {
        names: found(`[role=slider], button:not([aria-hidden]), ${boxes}, [type=checkbox]`)
            .map((each) => [each.outerHTML.slice(0, 200), name(each)]),
        heights: inside(`button[data-variant=outline], button[data-block], ${boxes}`)
            .map((each) => [name(each), box(each).height]),
        thumbs: inside("[role=slider]").map((each) => [box(each).width, box(each).height]),
        text: inside(`label[for], button[data-variant=outline], ${boxes}, .k450`)
            .map((each) => [name(each).slice(0, 40), parseFloat(getComputedStyle(each).fontSize)]),
    };
}"""
"""Script that describes the visible controls of the panel."""

VIOLATIONS = """async () => {
    const { violations } = await axe.run(document, { iframes: false });
    return violations.filter(({ impact }) => ["critical", "serious"].includes(impact))
        .map(({ id, nodes }) => [id, nodes.map((each) => [each.html, each.failureSummary])]);
}"""
"""Script that returns the critical and serious findings of axe-core."""


def controls(page: ViserPage) -> dict[str, Any]:
    """Wait until the controls of the panel have names, and describe them."""

    def named() -> bool:
        return all(name for _, name in page.frame.evaluate(CONTROLS)["names"])

    page.wait_until(named, "names of all controls")
    report: dict[str, Any] = page.frame.evaluate(CONTROLS)
    return report


@pytest.mark.long
def test_every_control_of_the_panel_has_a_name_and_can_be_hit(page: ViserPage) -> None:
    report = controls(page)
    assert len(report["names"]) > 5
    small = [row for row in report["heights"] if row[1] < 31.9]
    assert report["heights"]
    assert not small
    assert len(report["thumbs"]) == 6
    assert all(min(size) >= 16.0 for size in report["thumbs"])
    assert not [row for row in report["text"] if row[1] < 13.0]
    for label in ("1 base turn", "Gripper"):
        assert page.frame.get_by_role("slider", name=label, exact=True).count() == 1
        assert page.frame.get_by_role("textbox", name=label, exact=True).count() == 1
    for label in ("x", "y", "z", "p"):
        assert page.frame.get_by_role("textbox", name=label, exact=True).count() >= 1


def findings(document: Page | Frame) -> Any:
    """Return the critical and serious findings of axe-core, which `make check-js` fetches."""
    if not AXE.exists():
        return []
    document.evaluate(AXE.read_text(encoding="utf-8"))
    return document.evaluate(VIOLATIONS)


@pytest.mark.long
@pytest.mark.parametrize("theme", ["light", "dark"])
@pytest.mark.parametrize("size", [WIDE, PORTRAIT])
def test_axe_finds_nothing_serious_in_panel_sheets_and_dialogs(
    server: AppServer,
    open_page: OpenPage,
    size: tuple[int, int],
    theme: str,
    artefacts: Path,
) -> None:
    options = PHONE if size == PORTRAIT else {}
    page = open_page(
        server.url,
        nodes=("/arm", MOVE),
        window=size,
        color_scheme=theme,
        script=FIRST_VISIT,
        **options,
    )
    page.page.wait_for_selector("#welcome:not([hidden])")
    take(page)
    assert findings(page.page) == [], "first steps"
    page.page.get_by_role("button", name="Close for good").click()
    if size == WIDE:
        controls(page)
        assert findings(page.frame) == [], "panel"
    for name, ready in (
        ("instruments", "#instruments:not([hidden]) canvas"),
        ("objects", "#objects:not([hidden])"),
        ("teach", "#teach:not([hidden])"),
        ("jog", "#gripper button"),
        ("help", "#help[open]"),
        ("more", "#more[open]"),
    ):
        page.page.click(f"#{name}-button")
        page.page.wait_for_selector(ready, state="attached")
        if name == "teach":
            page.page.get_by_role("button", name="Add pose").click()
            page.page.wait_for_selector("#teach li[data-id]")
        page.page.wait_for_timeout(200)
        page.keep(artefacts / f"axe-{name}-{size[0]}-{theme}.png")
        assert findings(page.page) == [], name
        if name == "teach":
            page.page.get_by_role("button", name="Text", exact=True).click()
            page.page.wait_for_selector("#teach-text")
            assert findings(page.page) == [], "text"
        if name == "more" and page.page.locator("#phone-bar").is_visible():
            page.page.click("#phone-bar")
            page.page.wait_for_selector("#phone[open]")
            page.keep(artefacts / f"axe-phone-{size[0]}-{theme}.png")
            assert findings(page.page) == [], "phone"
            page.page.click("#phone form button")
            page.page.click("#more-button")
        page.page.click(f"#{name}-button")
    assert page.errors == []
