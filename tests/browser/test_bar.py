"""The bar of the page: its size and order, its names for assistive technology, and sign-in."""

from __future__ import annotations

import itertools
import re
import time
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser

from katana450.arm.control.lease import Role
from katana450.assembly import page_routes
from katana450.client import connect
from katana450.resources import STATIC
from katana450.server.api import requests
from katana450.server.viser_bridge.viser_page import SCRIPTS
from katana450.server.web import static_files
from katana450.server.web.access_links import AccessFile
from tests.browser.camera import Drawing
from tests.browser.conftest import OpenPage
from tests.browser.page import ViserPage
from tests.browser.server import APP, AppServer
from tests.browser.session import Truth, bar, clear_stop, take
from tests.browser.sight import overlap
from tests.browser.sizes import LANDSCAPE, PHONE, PORTRAIT, WIDE

SIZES = {"phone": (390, 844), "tablet": (820, 1180), "desk": (1440, 900)}

ROOM = {WIDE: 240, (1280, 800): 240, (820, 1180): 240, PORTRAIT: 180, LANDSCAPE: 180}
"""Sizes of the window, and the minimum width of the reason of a stop in the bar [px]."""

PARTS = """() => {
    const shown = (each) => each.checkVisibility() && each.getBoundingClientRect().width > 0;
    const found = (selector) => [...document.querySelectorAll(selector)].filter(shown);
    const parts = found("header button, header select, #speed, #mode, #who p");
    const cut = found("header button").filter((each) => each.scrollWidth > each.clientWidth + 1);
    return {
        height: document.querySelector("header").offsetHeight,
        boxes: Object.fromEntries(parts.map((each) => {
            const { x, y, width, height } = each.getBoundingClientRect();
            return [each.id || each.textContent, { x, y, width, height }];
        })),
        cut: cut.map((each) => each.textContent),
    };
}"""
"""Script that returns the height of the bar, the boxes of its parts, and texts that are cut."""


def test_stop_is_always_visible_and_the_largest_button(
    own_page: ViserPage, truth: Truth, artefacts: Path
) -> None:
    page, before = own_page, own_page.page.viewport_size
    assert before is not None

    def areas() -> dict[str, float]:
        """Return the areas of all buttons of the bar; -1 for one outside the window."""
        sizes: dict[str, float] = page.page.evaluate(
            """() => {
              const inside = ({left, top, right, bottom}) =>
                left >= 0 && top >= 0 && right <= innerWidth && bottom <= innerHeight;
              return Object.fromEntries(
                [...document.querySelectorAll("header button, header select")]
                  .map((each) => [each, each.getBoundingClientRect()])
                  .filter(([, box]) => box.width)
                  .map(([each, box]) => [each.id || each.textContent,
                    inside(box) ? box.width * box.height : -1]));
            }"""
        )
        return sizes

    places: dict[str, list[Any]] = {size: [] for size in SIZES}
    for state in ("driving", "stopped"):
        if state == "stopped":
            page.page.click("#stop")
            truth.wait(mood="stopped")
            page.page.wait_for_selector("#clear-stop:not([hidden])")
        for size, (width, height) in SIZES.items():
            page.page.set_viewport_size({"width": width, "height": height})
            area = areas()
            assert min(area.values()) > 0.0, (size, area)
            assert area["stop"] == max(area.values())
            assert page.page.evaluate("() => document.documentElement.scrollWidth <= innerWidth")
            page.keep(artefacts / f"bar-{size}-{state}.png")
            places[size].append(page.page.locator("#scene").bounding_box())
    for size, (driving, stopped) in places.items():
        assert driving == stopped, size
    clear_stop(page, truth)
    page.page.set_viewport_size(before)


def test_nothing_overlaps_at_twice_the_size(own_page: ViserPage, artefacts: Path) -> None:
    page, before = own_page.page, own_page.page.viewport_size
    assert before is not None
    parts = "header :is(button, select, input, p):visible"
    box = "({ x, y, width, height }) => ({ x, y, width, height })"
    for width, height in ((640, 400), (720, 450), (960, 540)):
        page.set_viewport_size({"width": width, "height": height})
        own_page.keep(artefacts / f"bar-zoomed-{width}.png")
        assert page.evaluate("() => document.documentElement.scrollWidth <= innerWidth")
        boxes = page.locator(parts).evaluate_all(
            f"(parts) => parts.map((part) => part.getBoundingClientRect()).map({box})"
        )
        assert len(boxes) > 8
        for one, other in itertools.combinations(boxes, 2):
            assert not overlap(one, **other), (width, one, other)
    page.set_viewport_size(before)


WATCH_SHIFTS = """() => {
  window.shifts = [];
  new PerformanceObserver(list => {
    for (const shift of list.getEntries())
      for (const {node} of shift.sources)
        if (node) window.shifts.push({
          value: shift.value, at: shift.startTime, node: node.id || node.nodeName,
          css: String(node.className), in_bar: Boolean(node.parentElement?.closest('header'))});
  }).observe({type: 'layout-shift'});
}"""
"""Script that collects the parts of the page that change their places by themselves."""


@pytest.mark.long
@pytest.mark.parametrize("size", ROOM)
def test_bar_keeps_its_height_and_the_reason_its_room(
    server: AppServer, open_page: OpenPage, artefacts: Path, size: tuple[int, int]
) -> None:
    truth = Truth(server)
    options = PHONE if size in (PORTRAIT, LANDSCAPE) else {}
    page = open_page(server.url, drawing=Drawing.NONE, window=size, **options)
    heights = set()

    def look(state: str) -> None:
        """Note the height of the bar, and check that its parts neither overlap nor are cut."""
        page.page.wait_for_timeout(200)
        page.keep(artefacts / f"bar-{size[0]}-{state}.png")
        parts = page.page.evaluate(PARTS)
        heights.add(parts["height"])
        for one, other in itertools.combinations(parts["boxes"].items(), 2):
            assert not overlap(one[1], *other[1].values()), (state, one, other)
        for name, box in parts["boxes"].items():
            assert 0.0 <= box["x"] <= size[0] - box["width"] + 0.5, (state, name)
        assert not [word for word in parts["cut"] if "long name" not in word], state

    look("free")
    # The panel has its size by now.
    page.page.evaluate(WATCH_SHIFTS)
    take(page)
    look("driving")
    with (
        connect(server.url, "Ben") as ben,
        connect(server.url, "An arm driver with a long name") as other,
    ):
        look("others")
        ben.ask(requests.Ask())
        page.page.get_by_role("button", name="Give", exact=True).wait_for()
        look("asked")
        page.press_in_bar("STOP")
        truth.wait(mood="stopped")
        page.page.wait_for_selector("#clear-stop:not([hidden])")
        assert page.page.evaluate("document.getElementById('why').clientWidth") >= ROOM[size]
        look("stopped")
        # Requests are answered one after the other.
        other.ask(requests.Ask())
        page.wait_until(lambda: bar(page, "name") == "Ben asks for it, 1 more", "both")
        look("two")
        page.press_in_bar("Refuse")
        page.wait_until(lambda: "long name asks for it" in bar(page, "name"), "the other")
        look("long")
        page.press_in_bar("Refuse")
        clear_stop(page, truth)
    assert len(heights) == 1, heights
    # The scene and the panel stay where they are, whatever the bar says.
    shifts = page.page.evaluate("window.shifts")
    assert not [shift for shift in shifts if not shift["in_bar"]], shifts
    assert page.errors == []


def test_everything_can_be_reached_by_keys_and_is_named(page: ViserPage) -> None:
    page.page.focus("#stop")
    order = ["stop"]
    while order[-1] != "scene" and len(order) < 20:
        page.page.keyboard.press("Tab")
        order.append(page.page.evaluate("() => document.activeElement.id"))
    # The buttons of the lease, which have no id, lie in between.
    names = ("instruments", "objects", "teach", "jog", "help", "more")
    buttons = [f"{name}-button" for name in names]
    buttons.insert(4, "phone-bar")
    assert [name for name in order if name] == ["stop", "pause", *buttons, "scene"]
    page.page.click("#help-button")
    assert page.page.get_by_role("dialog", name="Help and keys").is_visible()
    assert page.page.locator("#headline").is_visible()
    page.page.click("#stop", trial=True)
    page.page.keyboard.press("Enter")
    assert not page.page.get_by_role("dialog").is_visible()
    for region in ("#mode", "#holder", "#toast"):
        assert page.page.get_attribute(region, "role") == "status"
    assert page.page.get_attribute("#banner", "role") == "alert"


def test_scripts_are_sent_without_comments_at_the_same_lines() -> None:
    written = (STATIC / "viser.js").read_text(encoding="utf-8")
    sent = static_files.contents()["viser.js"].decode()
    assert written.count("\n") == sent.count("\n")
    code = [line for line in sent.splitlines() if line]
    assert not [line for line in code if line.lstrip().startswith(("//", "/*", "*"))]
    rows = zip(written.splitlines(), sent.splitlines(), strict=True)
    assert all(line.startswith(rest) for line, rest in rows)
    for words in ("viser's socket is in a worker", "labels of the rows of buttons", "@type {Map"):
        assert words in written
        assert words not in sent


def test_the_page_is_small() -> None:
    sent = {name: len(file.packed) for name, file in page_routes.page_files().items()}
    # The scripts of each document are sent in one file. Those in folders are loaded on first use.
    ours = ("index.html", "page.css", page_routes.PAGE_SCRIPTS, "link.js", "icon.svg")
    assert sum(sent[name] for name in ours) < 30_400
    assert sum(sent[name] for name in (*ours, SCRIPTS)) < 39_950
    # Another language than English takes one catalogue, with the reasons of the server.
    assert all(size < 40_000 for name, size in sent.items() if name.startswith("language/"))
    # The modules in these scripts are also there alone, for people.
    together = re.compile(r"[^/]*|(page|viser|language)/.*")
    sent = {name: size for name, size in sent.items() if not together.fullmatch(name)}
    # The library for plots comes with the instruments.
    assert sum(sent.pop(name) for name in list(sent) if name.startswith("uplot/")) < 36_000
    # The timeline and programs are only for those who open them, the form of an object for those
    # who open Objects, episodes for servers that record, and the arm for those who have one.
    folders = dict.fromkeys(("timeline", "teach", "objects", "episodes", "arm"), 0)
    for name, size in sent.items():
        folder = name.partition("/")[0]
        if folder in folders:
            folders[folder] += size
    assert max(folders.values()) < 23_500
    assert sum(sent.values()) - sum(folders.values()) < 51_000
    assert sum(size for name, size in sent.items() if name.startswith("instruments/")) < 20_000


def test_modules_of_each_document_are_sent_in_one_script_after_those_they_import() -> None:
    sent = page_routes.page_files()
    page = sent["index.html"].content.decode()
    assert re.findall(r'<script[^>]* src="([^"]+)"', page) == [f"static/{page_routes.PAGE_SCRIPTS}"]
    scripts = sent[page_routes.PAGE_SCRIPTS].content.decode()
    assert scripts.index("function element(") < scripts.index("new Worker(")
    assert "interceptMessages" in sent[SCRIPTS].content.decode()
    assert len(re.findall(r"<script>.*?</script>", page, re.DOTALL)) == 1


def test_modules_are_put_together_once_each_and_files_that_load_later_keep_their_paths() -> None:
    imports = b'import { a as one } from "./in/a.js";\nimport * as b from "./b.js";\n'
    files = {
        "page.js": imports + b"say(one, b);\n",
        "b.js": b'import "./in/a.js";\nexport const later = () => import("./in/later.js");\n',
        "in/a.js": b'export function a() {}\nexport const load = () => import("../b.js");\n',
    }
    script = page_routes.put_together("page.js", files).decode()
    assert script.count("function a()") == 1
    assert script.index("function a()") < script.index("later") < script.index("say(one, b)")
    assert 'import("./in/later.js")' in script
    assert 'import("./b.js")' in script
    assert "const { a: one } = m0;" in script
    files["b.js"] = b"export default 1;\n"
    with pytest.raises(ValueError, match=r"b\.js cannot be put together: export default 1;"):
        page_routes.put_together("page.js", files)


@pytest.mark.long
def test_link_signs_in_leaves_no_trace_and_only_then_viser_connects(
    browser: Browser, tmp_path: Path
) -> None:
    file = AccessFile.create(tmp_path / "access.json")
    token = file.give("Anna", Role.OPERATOR, time.time() + 600.0)
    with AppServer((*APP, "--access", str(file.path))) as server:
        context = browser.new_context()
        page = context.new_page()
        opened: list[str] = []
        started: list[str] = []
        page.on("websocket", lambda socket: opened.append(socket.url))
        page.on("request", lambda request: started.append(request.url))
        page.goto(server.url)
        page.wait_for_selector("#gate:not([hidden])")
        frame = page.frames[1]
        frame.wait_for_function("() => window.katanaScene")
        page.wait_for_timeout(200)
        assert frame.evaluate("!window.__viserMutable")
        assert not opened
        page.goto("about:blank")
        page.goto(f"{server.url}/#{token}")
        page.locator("#name", has_text="Anna").wait_for()
        page.wait_for_selector("#poster.done", state="attached")
        assert sorted(url.partition("?")[0].rpartition("/")[2] for url in opened) == [
            "control",
            "viser",
        ]
        assert sum(url.endswith("/viser/") for url in started) == 2
        assert page.url == f"{server.url}/"
        assert not [url for url in started if token in url.partition("#")[0]]
        assert page.evaluate("() => document.cookie") == ""
        # The next visit does not need the access link.
        again = context.new_page()
        again.route("**/viser/**", lambda route: route.abort())
        again.goto(server.url)
        again.locator("#name", has_text="Anna").wait_for()
        context.close()
