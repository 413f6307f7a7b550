"""Objects on the page: dropped, chosen, clicked, moved, changed, removed, and undone."""

from __future__ import annotations

import base64
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from katana450.client import Client
from katana450.server.api import answers
from tests.browser.conftest import OpenPage
from tests.browser.page import ViserPage
from tests.browser.server import AppServer
from tests.browser.session import bar
from tests.exchange.compressed_gltf import DATA, SQUARE
from tests.exchange.shape_bytes import zipped

DROP = """async ([files, [clientX, clientY] = []]) => {
    const data = new DataTransfer();
    for (const [name, text] of files) {
        const bytes = Uint8Array.from(atob(text), (sign) => sign.charCodeAt(0));
        data.items.add(new File([bytes], name));
    }
    const where = document.querySelector("canvas") ?? document.body;
    for (const kind of ["dragenter", "dragover", "drop"])
        where.dispatchEvent(
            new DragEvent(kind, { dataTransfer: data, bubbles: true, clientX, clientY }));
}"""

GLOWING = """(name) => {
    let found = false;
    katanaScene.node(name).traverse(({ material }) => {
        found ||= material?.emissiveIntensity < 1 && material.emissive.getHex() > 0;
    });
    return found;
}"""
"""Script that returns whether some shape of a node is highlighted."""


def objects(reader: Client) -> dict[str, Any]:
    """Return the objects by their names."""
    return {prop.name: prop for prop in reader.query(answers.Objects).objects}


def place_of(reader: Client, name: str) -> Any:
    """Return the position (3,) [m] of an object."""
    return np.array(objects(reader)[name].T)[:3, 3]


def pixel_of(page: ViserPage, reader: Client, name: str) -> tuple[float, float]:
    """Return the pixel of the window in the middle of an object."""
    height = objects(reader)[name].size[-1]
    return page.project(np.add(place_of(reader, name), (0.0, 0.0, 0.5 * height)))


def drop(page: ViserPage, *pixel: tuple[float, float], **files: bytes) -> None:
    """Drop files on the scene, by their names with _ for the dot, at a pixel of the window."""
    content = [
        [".".join(name.rsplit("_", 1)), base64.b64encode(data).decode()]
        for name, data in files.items()
    ]
    box = page.page.locator("#scene").bounding_box()
    assert box is not None
    place = [[x - box["x"], y - box["y"]] for x, y in pixel]
    page.frame.evaluate(DROP, [content, *place])


def shown(page: ViserPage) -> str:
    """Return what the sheet says about the last file."""
    return page.page.inner_text("#read")


def cube(side: float, kind: str = "stl") -> bytes:
    content = trimesh.creation.box((side, side, side)).export(file_type=kind)
    return content.encode() if isinstance(content, str) else bytes(content)


def clear_refusals(page: ViserPage) -> None:
    """Drop what the browser reports about refused files; anything else is an error."""
    assert all("422" in error for error in page.errors)
    page.errors.clear()


def undo(page: ViserPage, reader: Client, before: set[str]) -> None:
    """Undo changes until the objects are those of before."""
    for _ in range(len(objects(reader).keys() ^ before)):
        page.page.keyboard.press("Control+z")
    page.wait_until(lambda: objects(reader).keys() == before, "the objects of before")


@pytest.mark.long
def test_files_are_dropped_on_the_table_and_undone(page: ViserPage, reader: Client) -> None:
    before = set(objects(reader))
    place = (0.45, 0.15, 0.0)
    drop(page, page.project(place), left_stl=cube(30.0))
    page.wait_until(lambda: "left" in objects(reader), "the object")
    np.testing.assert_allclose(place_of(reader, "left")[:2], place[:2], rtol=0, atol=0.002)
    page.wait_until(lambda: "triangles" in shown(page), "the answer")
    page.page.locator("#stage.dropping").wait_for(state="hidden")
    # Files that belong together are one object, in a .zip.
    document = SQUARE | {"nodes": [{"mesh": 0, "scale": [0.1, 0.1, 0.1]}]}
    files = {"square.gltf": json.dumps(document).encode(), "a b.bin": DATA}
    drop(page, square_gltf=files["square.gltf"], **{"a b_bin": DATA})
    page.wait_until(lambda: "put them into one" in shown(page), "the refusal")
    drop(page, square_zip=zipped(files))
    page.wait_until(lambda: "square" in objects(reader), "the object")
    assert "2 triangles, 100 × 0 × 100 mm" in shown(page)
    # Others are objects of their own.
    drop(page, one_stl=cube(20.0), two_ply=cube(20.0, "ply"))
    page.wait_until(lambda: {"one", "two"} <= objects(reader).keys(), "both objects")
    undo(page, reader, before)


def test_clicked_object_is_removed_by_delete_and_returns(
    page: ViserPage, reader: Client, artefacts: Path
) -> None:
    before = objects(reader).keys()
    # Without a selection the key removes nothing.
    page.page.keyboard.press("Delete")
    page.page.mouse.click(*pixel_of(page, reader, "cup"))
    page.page.wait_for_selector("#selection:not([hidden])")
    assert page.page.inner_text("#selection b") == "cup"
    page.keep(artefacts / "selection.png")
    assert objects(reader).keys() == before
    page.page.keyboard.press("Delete")
    page.wait_until(lambda: objects(reader).keys() == before - {"cup"}, "the cup to go")
    assert not page.page.locator("#selection").is_visible()
    page.page.keyboard.press("Control+z")
    page.wait_until(lambda: objects(reader).keys() == before, "the cup to return")
    # A click beside all objects, and a drag of the camera, select nothing.
    page.page.mouse.click(*pixel_of(page, reader, "basin"))
    page.page.wait_for_selector("#selection:not([hidden])")
    page.page.mouse.click(60, 200)
    page.page.wait_for_selector("#selection", state="hidden")


def test_chosen_file_is_refused_or_placed_changed_and_removed(
    page: ViserPage, reader: Client, tmp_path: Path, artefacts: Path
) -> None:
    before = set(objects(reader))
    ring, broken = tmp_path / "ring.stl", tmp_path / "broken.stl"
    ring.write_bytes(trimesh.creation.torus(40.0, 12.0, 48, 24).export(file_type="stl"))
    broken.write_bytes(b"solid nothing")
    page.press_in_bar("Objects")
    page.page.set_input_files("#object-file", broken)
    page.page.locator("#read.bad", has_text="broken.stl").wait_for()
    clear_refusals(page)
    page.page.set_input_files("#object-file", ring)
    page.wait_until(lambda: "2304 triangles, 104 × 104 × 24 mm" in shown(page), "the answer")
    assert "assumed to be mm" in shown(page)
    page.wait_until(lambda: "ring" in objects(reader), "the object")
    np.testing.assert_allclose(place_of(reader, "ring"), (0.36, 0.0, 0.0), atol=1e-6)

    # Its handle in the scene, by a click on it.
    handle = "/handles/ring"
    form = page.page.locator("#object")
    choice = form.get_by_label("Object")
    page.wait_until(lambda: choice.input_value() == "ring", "the new object to be chosen")
    choice.select_option("cup")
    page.page.mouse.click(*page.project(np.add(place_of(reader, "ring"), (0.0, 0.04, 0.024))))
    page.wait_ready((handle,))
    # The form shows what is selected in the scene.
    page.wait_until(lambda: choice.input_value() == "ring", "the selected object")
    page.drag_arrow(handle, "y", 0.12)
    page.wait_until(lambda: place_of(reader, "ring")[1] > 0.115, "the object to follow its handle")
    moved = place_of(reader, "ring")
    np.testing.assert_allclose(moved, (0.36, 0.12, 0.0), atol=0.01)
    # Another unit than the guessed one changes the size of the same object.
    page.page.select_option("#unit", "cm")
    page.wait_until(lambda: "1040 × 1040 × 240 mm" in shown(page), "the other unit")
    np.testing.assert_allclose(place_of(reader, "ring"), moved, atol=1e-9)
    form.get_by_label("Scale").fill("0.15")
    form.get_by_label("Scale").press("Enter")
    page.wait_until(lambda: objects(reader)["ring"].scale == 0.15, "the scale")
    page.page.select_option("#unit", "")
    clear_refusals(page)
    # One coordinate right after another. An object that stands in the arm is hidden by it.
    for axis in "xy":
        form.get_by_label(axis, exact=True).fill("0")
        form.get_by_label(axis, exact=True).press("Enter")
    page.wait_until(lambda: "ring overlaps the" in form.inner_text(), "the caution")
    page.keep(artefacts / "app-objects.png")
    form.get_by_role("button", name="Remove", exact=True).click()
    page.wait_until(lambda: objects(reader).keys() == before, "it to go")
    page.wait_until(lambda: choice.input_value() == "", "no object to be chosen in its place")
    assert shown(page) == ""
    assert not form.get_by_role("button", name="Remove", exact=True).is_visible()


@pytest.mark.long
def test_zone_is_added_in_the_sheet(page: ViserPage, reader: Client, artefacts: Path) -> None:
    page.press_in_bar("Objects")
    page.page.get_by_role("button", name="Add zone").click()
    page.wait_until(lambda: "zone 1" in objects(reader), "the zone")
    form = page.page.locator("#object")
    page.wait_until(lambda: form.get_by_label("Zone").input_value() == "keep_out", "its row")
    size = form.get_by_label("Size, mm")
    assert size.input_value() == "200 × 200 × 200"
    size.fill("20 400,5 x 500")
    size.press("Enter")
    page.wait_until(lambda: objects(reader)["zone 1"].size == [0.02, 0.4005, 0.5], "the size")
    form.get_by_label("Zone").select_option("The arm is slow")
    page.wait_until(lambda: objects(reader)["zone 1"].zone == "slow", "the rule")
    page.wait_until(lambda: size.input_value() == "20 × 400.5 × 500", "the size as it is shown")
    page.keep(artefacts / "zone.png")
    size.fill("200 200 200")
    size.press("Enter")
    page.wait_until(lambda: objects(reader)["zone 1"].size[0] == 0.2, "the former size")
    drawn = "() => Object.keys(__viserMutable.nodeRefFromName)"
    second = re.compile(r"/objects/[^/]+/shape")
    before = len(list(filter(second.match, page.frame.evaluate(drawn))))
    page.page.click("#add-plane")
    page.wait_until(
        lambda: len(list(filter(second.match, page.frame.evaluate(drawn)))) > before, "the plane"
    )
    # The nearer one of two is not taken for the one that is clicked.
    page.page.mouse.click(*page.project(np.array((0.3, 0.45, 0.5))))
    page.wait_until(lambda: page.page.inner_text("#selection b") == "plane 1", "the plane")
    page.wait_ready(("/handles/plane%201/turn",))
    page.wait_until(lambda: form.get_by_label("Object").input_value() == "plane 1", "its row")
    page.page.mouse.click(*page.project(np.array((0.36, 0.0, 0.05))))
    page.wait_ready(("/handles/zone%201/size",))
    with page.grip_arrow("/handles/zone%201/size", "x") as grip:
        page.page.keyboard.down("Control")
        grip.sweep(0.048, 6)
        label = page.page.locator("#handle-label")
        page.wait_until(lambda: label.inner_text().startswith("size x 250.0 mm"), "the size")
        page.keep(artefacts / "zone-size.png")
    page.page.keyboard.up("Control")
    page.wait_until(lambda: abs(objects(reader)["zone 1"].size[0] - 0.25) < 1e-6, "the size")
    page.page.keyboard.press("Control+z")
    page.wait_until(lambda: objects(reader)["zone 1"].size[0] == 0.2, "the former size")
    for name in ("plane 1", "zone 1"):
        form.get_by_label("Object").select_option(name)
        form.get_by_role("button", name="Remove", exact=True).click()
    page.wait_until(lambda: not {"plane 1", "zone 1"} & objects(reader).keys(), "both to go")
    page.press_in_bar("Objects")


@pytest.mark.long
def test_clicked_object_gets_arrows_that_move_it_in_this_window_alone(
    page: ViserPage, reader: Client, server: AppServer, open_page: OpenPage, artefacts: Path
) -> None:
    arrows = "/handles/cup"
    other = open_page(server.url, nodes=("/arm",))

    start = place_of(reader, "cup")
    assert not page.shows(arrows)
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
    page.wait_until(lambda: page.shows(arrows), "the arrows")
    page.keep(artefacts / "selection-arrows.png")
    page.drag_arrow(arrows, "y", -0.06)
    page.wait_until(lambda: place_of(reader, "cup")[1] < start[1] - 0.05, "the cup to follow")
    assert page.page.inner_text("#selection b") == "cup"
    assert not other.shows(arrows)
    # The past has none, also after the next look at the object.
    page.frame.evaluate("katanaScene.hideNodes((name) => name.startsWith('/handles'))")
    page.page.wait_for_timeout(1500)
    assert not page.shows(arrows)
    page.frame.evaluate("katanaScene.hideNodes(null)")
    page.page.keyboard.press("Control+z")
    page.wait_until(
        lambda: np.allclose(place_of(reader, "cup"), start, atol=1e-9), "the cup to return"
    )
    page.page.get_by_role("button", name="Deselect").click()
    page.wait_until(lambda: not page.shows(arrows), "no arrows")


@pytest.mark.long
def test_one_of_several_files_is_chosen(page: ViserPage, reader: Client) -> None:
    sides = {"left.obj": 20.0, "right.obj": 30.0}
    drop(page, both_zip=zipped({name: cube(side, "obj") for name, side in sides.items()}))
    choice = page.page.locator("#which button", has_text="right.obj")
    choice.wait_for()
    assert "choose one of left.obj, right.obj" in shown(page)
    choice.click()
    page.wait_until(lambda: "right" in objects(reader), "the object")
    assert not page.page.locator("#which").is_visible()
    clear_refusals(page)


@pytest.mark.long
def test_a_large_object_is_placed_with_a_scale(
    page: ViserPage, reader: Client, artefacts: Path
) -> None:
    drop(page, house_glb=cube(5.0, "glb"))
    page.wait_until(lambda: "house" in objects(reader), "the object")
    page.wait_until(lambda: "placed at the scale 0.2" in shown(page), "the answer")
    assert "5000 mm long, over 2000 mm" in shown(page)
    form = page.page.locator("#object")
    page.wait_until(lambda: form.get_by_label("Scale").input_value() == "0.2", "its scale")
    assert form.get_by_label("Size, mm").input_value() == "1000 × 1000 × 1000"
    form.get_by_label("Scale").fill("0.9")
    form.get_by_label("Scale").press("Enter")
    page.wait_until(lambda: "must be from 0.001 to 2 m" in bar(page, "toast"), "the refusal")
    form.get_by_label("Scale").fill("0.03")
    form.get_by_label("Scale").press("Enter")
    page.wait_until(lambda: objects(reader)["house"].scale == 0.03, "the other scale")
    page.screenshot(artefacts / "app-scale.png")
    # A unit that fits replaces the scale.
    page.page.select_option("#unit", "cm")
    page.wait_until(
        lambda: "house" in objects(reader) and objects(reader)["house"].scale == 1.0,
        "the size of the other unit",
    )
    page.page.select_option("#unit", "")
    clear_refusals(page)
