"""Parts of the page that wait for its first picture, or for two seconds without one."""

from __future__ import annotations

import re
from contextlib import closing

from playwright.sync_api import Browser, expect

from tests.browser.conftest import OpenPage
from tests.browser.server import AppServer
from tests.browser.session import MOVE

COUNTED = """
    if (window === top) {
        window.contexts = 0;
        const { getContext } = HTMLCanvasElement.prototype;
        HTMLCanvasElement.prototype.getContext = function (...options) {
            window.contexts += /^webgl/.test(options[0]);
            return getContext.apply(this, options);
        };
    }
"""
"""Script that counts the contexts for drawing of the page itself."""

BLIND = """
    const { getContext } = HTMLCanvasElement.prototype;
    HTMLCanvasElement.prototype.getContext = function (kind, ...options) {
        return /^webgl/.test(kind) ? null : getContext.call(this, kind, ...options);
    };
"""
"""Script of a browser without WebGL."""


def test_page_that_is_drawn_makes_no_second_context_and_gets_its_tools(
    server: AppServer, open_page: OpenPage
) -> None:
    page = open_page(server.url, nodes=("/arm", MOVE), script=COUNTED)
    expect(page.page.locator("#poster")).to_have_class(re.compile("done"))
    page.wait_until(
        lambda: page.page.evaluate(
            "performance.getEntriesByType('resource').some(({name}) => name.endsWith('stage.js'))"
        ),
        "the tools of the scene",
    )
    page.page.wait_for_timeout(2200)
    assert page.page.evaluate("contexts") == 0
    assert page.errors == []


def test_page_that_cannot_draw_says_so(server: AppServer, browser: Browser) -> None:
    with closing(browser.new_context()) as context:
        context.add_init_script(BLIND)
        page = context.new_page()
        page.goto(server.url)
        expect(page.locator("#poster")).to_contain_text("WebGL 2 is off or missing", timeout=20_000)
        expect(page.locator("#stop")).to_be_enabled()
