"""Direct changes to the scene: a dropped file, a click, Delete and Ctrl-Z."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from katana450.client import Client
from katana450.server.api import answers
from tests.browser.camera import Camera
from tests.browser.conftest import OpenPage
from tests.browser.page import ViserPage
from tests.browser.server import AppServer
from tests.browser.session import MOVE, Truth, bar, clear_stop, prepare

DROP = """async ([name, bytes, [clientX, clientY] = []]) => {
    const data = new DataTransfer();
    data.items.add(new File([new Uint8Array(bytes)], name));
    const where = document.querySelector("canvas") ?? document.body;
    for (const kind of ["dragenter", "dragover", "drop"])
        where.dispatchEvent(
            new DragEvent(kind, {dataTransfer: data, bubbles: true, clientX, clientY}));
}"""


GLOWING = """(name) => {
    let found = false;
    katanaScene.node(name).traverse(({ material }) => {
        found ||= material?.emissiveIntensity < 1 && material.emissive.getHex() > 0;
    });
    return found;
}"""
"""Script that returns whether some shape of a node is highlighted."""

SEEN = """(name) => {
    const seen = (each) => each.visible && (!each.parent || seen(each.parent));
    const node = katanaScene.node(name);
    return Boolean(node) && seen(node);
}"""
"""Script that returns whether a node is shown."""


@pytest.fixture
def page(server: AppServer, open_page: OpenPage, truth: Truth) -> ViserPage:
    page = open_page(server.url, nodes=("/arm", MOVE))
    prepare(page, truth)
    return page


def names(reader: Client) -> set[str]:
    return {each.name for each in reader.query(answers.Objects).objects}


def pixel_of(page: ViserPage, reader: Client, name: str) -> tuple[float, float]:
    """Return the pixel of the window in the middle of an object."""
    found = next(each for each in reader.query(answers.Objects).objects if each.name == name)
    T: Any = np.array(found.T)
    return page.project(T[:3, 3] + (0.0, 0.0, 0.5 * found.size[-1]))


@pytest.mark.cases(1)
@pytest.mark.parametrize("document", ["scene", pytest.param("page", marks=pytest.mark.long)])
def test_dropped_file_is_put_on_the_table(page: ViserPage, reader: Client, document: str) -> None:
    before = names(reader)
    data = trimesh.creation.box((30.0, 30.0, 30.0)).export(file_type="stl")
    target = page.frame if document == "scene" else page.page.main_frame
    target.evaluate(DROP, [f"dropped {document}.stl", list(data)])
    page.wait_until(lambda: len(names(reader)) == len(before) + 1, "the object")
    page.wait_until(lambda: "triangles" in page.page.inner_text("#read"), "the answer")
    assert page.page.locator("#stage.dropping").count() == 0 or page.page.wait_for_selector(
        "#stage:not(.dropping)"
    )
    # What was dropped can be undone.
    page.page.keyboard.press("Control+z")
    page.wait_until(lambda: names(reader) == before, "the object to go")
    assert page.errors == []


@pytest.mark.long
def test_file_lands_on_the_table_where_it_was_dropped(
    page: ViserPage, reader: Client, artefacts: Path
) -> None:
    data = list(trimesh.creation.box((30.0, 30.0, 30.0)).export(file_type="stl"))
    box = page.page.locator("#scene").bounding_box()
    assert box is not None
    for name, place in (("left", (0.45, 0.15, 0.0)), ("right", (0.40, -0.12, 0.0))):
        x, y = page.project(place)
        page.frame.evaluate(DROP, [f"{name}.stl", data, [x - box["x"], y - box["y"]]])
        page.wait_until(lambda name=name: name in names(reader), "the object")  # type: ignore[misc]
        found = next(each for each in reader.query(answers.Objects).objects if each.name == name)
        T: Any = np.array(found.T)
        np.testing.assert_allclose(T[:2, 3], place[:2], rtol=0, atol=0.002)
    page.keep(artefacts / "dropped.png")
    # The same pixel of a picture beside the scene is no point of the table.
    page.page.click("#instruments-button")
    page.page.wait_for_selector("#instruments canvas", state="attached")
    x, y = page.project((0.45, 0.15, 0.0))
    box = page.page.locator("#scene").bounding_box()
    assert box is not None
    page.page.evaluate(DROP, ["beside.stl", data, [x - box["x"], y - box["y"]]])
    page.wait_until(lambda: "beside" in names(reader), "the object")
    found = next(each for each in reader.query(answers.Objects).objects if each.name == "beside")
    # Where an object is added that was chosen: straight ahead or aside, on a circle.
    assert np.hypot(*np.array(found.T)[:2, 3]) == pytest.approx(0.36, abs=1e-6)
    page.page.click("#instruments-button")
    for _ in range(3):
        page.page.keyboard.press("Control+z")
    page.wait_until(lambda: not {"left", "right", "beside"} & names(reader), "them to go")
    assert page.errors == []


def test_clicked_object_is_removed_by_delete_and_returns(
    page: ViserPage, reader: Client, artefacts: Path
) -> None:
    before = names(reader)
    # Without a selection the key removes nothing.
    page.page.keyboard.press("Delete")
    page.page.mouse.click(*pixel_of(page, reader, "cup"))
    page.page.wait_for_selector("#selection:not([hidden])")
    assert page.page.inner_text("#selection b") == "cup"
    page.keep(artefacts / "selection.png")
    assert names(reader) == before
    page.page.keyboard.press("Delete")
    page.wait_until(lambda: names(reader) == before - {"cup"}, "the cup to go")
    assert not page.page.locator("#selection").is_visible()
    page.page.keyboard.press("Control+z")
    page.wait_until(lambda: names(reader) == before, "the cup to return")
    # A click beside all objects, and a drag of the camera, select nothing.
    page.page.mouse.click(*pixel_of(page, reader, "basin"))
    page.page.wait_for_selector("#selection:not([hidden])")
    page.page.mouse.click(60, 200)
    page.page.wait_for_selector("#selection", state="hidden")
    assert page.errors == []


@pytest.mark.long
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_clicked_object_gets_arrows_that_move_it_in_this_window_alone(
    page: ViserPage,
    reader: Client,
    server: AppServer,
    open_page: OpenPage,
    scheme: Any,
    artefacts: Path,
) -> None:
    arrows = "/handles/cup"
    other = open_page(server.url, nodes=("/arm",))

    def shown(window: ViserPage) -> bool:
        return bool(window.frame.evaluate(SEEN, arrows))

    def place() -> Any:
        found = {each.name: each.T for each in reader.query(answers.Objects).objects}
        return np.array(found["cup"])[:3, 3]

    page.page.emulate_media(color_scheme=scheme)
    start = place()
    assert not shown(page)
    # Under the mouse it is highlighted, with the pointer of what can be clicked.
    cursor = "katanaScene.viewer().canvas.style.cursor"
    x, y = pixel_of(page, reader, "cup")
    page.page.mouse.move(x - 3.0, y)
    page.page.mouse.move(x, y)
    page.wait_until(lambda: page.frame.evaluate(GLOWING, "/cup"), "the highlight")
    assert page.frame.evaluate(cursor) == "pointer"
    page.page.mouse.move(60.0, 200.0)
    page.wait_until(lambda: not page.frame.evaluate(GLOWING, "/cup"), "no highlight")
    assert page.frame.evaluate(cursor) == ""
    page.page.mouse.click(*pixel_of(page, reader, "cup"))
    page.wait_until(lambda: shown(page), "the arrows")
    page.keep(artefacts / f"selection-arrows-{scheme}.png")
    page.drag_arrow(arrows, "y", -0.06)
    page.wait_until(lambda: place()[1] < start[1] - 0.05, "the cup to follow")
    assert page.page.inner_text("#selection b") == "cup"
    assert not shown(other)
    page.page.keyboard.press("Control+z")
    page.wait_until(lambda: np.allclose(place(), start, atol=1e-9), "the cup to return")
    page.page.get_by_role("button", name="Deselect").click()
    page.wait_until(lambda: not shown(page), "no arrows")
    # The box of the panel shows those of all objects, and keeps them when none is selected.
    page.open_tab("Scene")
    page.frame.get_by_text("Handles on objects", exact=True).click()
    other.wait_until(lambda: shown(other), "the arrows of all")
    page.page.mouse.click(*pixel_of(page, reader, "cup"))
    page.page.wait_for_selector("#selection:not([hidden])")
    page.page.get_by_role("button", name="Deselect").click()
    page.page.wait_for_timeout(300)
    assert shown(page)
    page.frame.get_by_text("Handles on objects", exact=True).click()
    page.wait_until(lambda: not shown(page), "no arrows")
    assert page.errors == []


@pytest.mark.long
def test_bar_of_an_object_at_the_edge_stays_below_stop(page: ViserPage, reader: Client) -> None:
    page.page.mouse.click(*pixel_of(page, reader, "cup"))
    page.page.wait_for_selector("#selection:not([hidden])")
    found = next(each for each in reader.query(answers.Objects).objects if each.name == "cup")
    x, y, z = np.array(found.T)[:3, 3]
    # The object is at the top left of the scene, and then beyond it.
    for beyond in (0.35, 0.6):
        page.look_from(Camera((x, y - 0.8, z + 0.3), (x + beyond, y, z - 0.3)))
        page.page.wait_for_timeout(400)
        on_top = page.page.evaluate(
            """() => {
                const stop = document.getElementById("stop");
                const { left, right, top, bottom } = stop.getBoundingClientRect();
                const found = new Set();
                for (let x = left + 5; x < right - 5; x += 10)
                    for (let y = top + 5; y < bottom - 5; y += 8)
                        found.add(document.elementFromPoint(x, y).id);
                return [...found];
            }"""
        )
        assert on_top == ["stop"]
    page.page.get_by_role("button", name="Remove").click(trial=True)
    page.page.get_by_role("button", name="Deselect").click()
    assert page.errors == []


def test_drag_is_undone_but_never_past_a_stop(page: ViserPage, truth: Truth) -> None:
    start = np.array(truth.status()["goal"])
    page.drag_arrow(MOVE, "y", 0.1)
    truth.wait(10.0, moving=False)
    moved = np.array(truth.status()["goal"])
    assert np.abs(moved - start).max() > 0.05
    page.page.click("#help-button")
    newest = page.page.locator("#undoable li").first
    page.wait_until(lambda: newest.text_content() == "arm (drag)", "the list")
    page.page.click("#help button.main")
    page.page.mouse.click(60, 200)
    # The focus is in viser's document.
    page.page.keyboard.press("Control+z")
    page.wait_until(lambda: np.allclose(truth.status()["q"], start, atol=1e-6), "the way back")
    page.drag_arrow(MOVE, "y", -0.1)
    truth.wait(10.0, moving=False)
    moved = np.array(truth.status()["q"])
    page.page.keyboard.press("Space")
    truth.wait(mood="stopped")
    page.page.keyboard.press("Control+z")
    page.wait_until(lambda: "stopped" in bar(page, "toast"), "the refusal")
    clear_stop(page, truth)
    page.page.keyboard.press("Control+z")
    page.wait_until(lambda: "nothing to undo" in bar(page, "toast"), "the refusal")
    assert np.allclose(truth.status()["q"], moved, atol=1e-6)


@pytest.mark.long
def test_undo_names_the_stops_that_its_page_knows(new_page: ViserPage, truth: Truth) -> None:
    """An undo that waits on its way while the arm is stopped and cleared is refused."""
    page, start = new_page, np.array(truth.status()["goal"])
    page.drag_arrow(MOVE, "y", 0.1)
    truth.wait(10.0, moving=False)
    moved = np.array(truth.status()["q"])
    # The page shows an old status, and holds the drag for undoable, as while its connection hangs.
    # The key is pressed at once, before the next status arrives.
    page.page.evaluate(
        """(old) => {
            window.dispatchEvent(new CustomEvent("status", {detail: old}));
            document.body.dispatchEvent(new KeyboardEvent(
                "keydown", {code: "KeyZ", key: "z", ctrlKey: true, bubbles: true}));
        }""",
        {"undo": ["arm (drag)"], "revocations": truth.status()["revocations"] - 1},
    )
    page.wait_until(lambda: "Do it again" in bar(page, "toast"), "the refusal")
    assert np.allclose(truth.status()["q"], moved, atol=1e-6)
    assert not np.allclose(moved, start, atol=1e-2)


@pytest.mark.long
def test_undo_is_on_the_letter_z_and_needs_a_connection(page: ViserPage) -> None:
    press = """([code, key]) => document.body.dispatchEvent(
        new KeyboardEvent("keydown", {code, key, ctrlKey: true, bubbles: true}))"""
    # On a German keyboard, Y and Z have changed places.
    page.page.evaluate(press, ["KeyZ", "y"])
    page.page.wait_for_timeout(300)
    assert "ndo" not in bar(page, "toast")
    page.page.evaluate(press, ["KeyY", "z"])
    page.wait_until(lambda: "ndo" in bar(page, "toast"), "the undo")


@pytest.mark.long
def test_undo_in_a_text_box_is_that_of_the_browser(page: ViserPage, truth: Truth) -> None:
    start = np.array(truth.status()["goal"])
    page.drag_arrow(MOVE, "y", 0.1)
    truth.wait(10.0, moving=False)
    box = page.number_box("1 base turn")
    box.click()
    box.press("Control+z")
    page.page.wait_for_timeout(300)
    assert not np.allclose(truth.status()["goal"], start, atol=1e-3)
    box.press("Escape")
    truth.wait(mood="stopped")
    clear_stop(page, truth)
