"""Objects of several files and of any size: dropped or chosen together, and placed with a scale."""

from __future__ import annotations

import base64
import json
from pathlib import Path

import pytest
import trimesh

from katana450.client import Client
from katana450.extensions.export.vrml_text import HEADER
from katana450.server.api import answers
from tests.browser.conftest import OpenPage
from tests.browser.page import ViserPage
from tests.browser.server import AppServer
from tests.browser.session import MOVE, Truth, prepare
from tests.exchange.compressed_gltf import DATA, SQUARE

DROP = """async (files) => {
    const data = new DataTransfer();
    for (const [name, text] of files) {
        const bytes = Uint8Array.from(atob(text), (sign) => sign.charCodeAt(0));
        data.items.add(new File([bytes], name));
    }
    const where = document.querySelector("canvas") ?? document.body;
    for (const kind of ["dragenter", "dragover", "drop"])
        where.dispatchEvent(new DragEvent(kind, {dataTransfer: data, bubbles: true}));
}"""


@pytest.fixture
def page(server: AppServer, open_page: OpenPage, truth: Truth) -> ViserPage:
    page = open_page(server.url, nodes=("/arm", MOVE))
    prepare(page, truth)
    return page


def scales(reader: Client) -> dict[str, float]:
    """Return the scale of each object by its name."""
    return {each.name: each.scale for each in reader.query(answers.Objects).objects}


def drop(page: ViserPage, **files: bytes) -> None:
    """Drop files on the page, by their names with _ for the dot."""
    content = [
        [".".join(name.rsplit("_", 1)), base64.b64encode(data).decode()]
        for name, data in files.items()
    ]
    page.frame.evaluate(DROP, content)


def shown(page: ViserPage) -> str:
    return page.page.inner_text("#read")


def cube(side: float, kind: str = "stl") -> bytes:
    content = trimesh.creation.box((side, side, side)).export(file_type=kind)
    return content.encode() if isinstance(content, str) else bytes(content)


def test_files_that_are_dropped_together_are_one_object(page: ViserPage, reader: Client) -> None:
    document = SQUARE | {"nodes": [{"mesh": 0, "scale": [0.1, 0.1, 0.1]}]}
    drop(page, square_gltf=json.dumps(document).encode(), **{"a b_bin": DATA}, note_txt=b"x")
    page.wait_until(lambda: "square" in scales(reader), "the object")
    assert "2 triangles, 100 × 0 × 100 mm" in shown(page)
    part = f"{HEADER}\nShape {{ geometry Box {{ size 0.04 0.04 0.04 }} }}".encode()
    drop(page, robot_wrl=f'{HEADER}\nInline {{ url "p/part.wrl" }}'.encode(), part_wrl=part)
    page.wait_until(lambda: "robot" in scales(reader), "the other object")
    assert "12 triangles" in shown(page)


@pytest.mark.long
def test_a_missing_file_is_named(page: ViserPage) -> None:
    drop(page, square_gltf=json.dumps(SQUARE).encode())
    page.wait_until(lambda: "which is not there" in shown(page), "the refusal")
    assert page.page.locator("#read.bad").count() == 1
    assert "as their folder or as a .zip" in shown(page)


@pytest.mark.long
def test_each_of_several_objects_is_added(page: ViserPage, reader: Client) -> None:
    drop(page, first_stl=cube(20.0), second_stl=cube(30.0))
    page.wait_until(lambda: {"first", "second"} <= scales(reader).keys(), "both objects")


@pytest.mark.long
def test_one_of_several_files_is_chosen(page: ViserPage, reader: Client) -> None:
    drop(page, left_obj=cube(20.0, "obj"), right_obj=cube(30.0, "obj"))
    choice = page.page.locator("#which button", has_text="right.obj")
    choice.wait_for()
    assert "choose one of left.obj, right.obj" in shown(page)
    choice.click()
    page.wait_until(lambda: "right" in scales(reader), "the object")
    assert not page.page.locator("#which").is_visible()


@pytest.mark.long
def test_a_chosen_folder_is_one_object(page: ViserPage, reader: Client, tmp_path: Path) -> None:
    folder = tmp_path / "model"
    (folder / "parts").mkdir(parents=True)
    document = SQUARE | {"nodes": [{"mesh": 0, "scale": [0.1, 0.1, 0.1]}]}
    (folder / "panel.gltf").write_text(json.dumps(document))
    (folder / "parts" / "a b.bin").write_bytes(DATA)
    (folder / "picture.png").write_bytes(b"no shape")
    page.press_in_bar("Objects")
    page.page.set_input_files("#object-folder", folder)
    page.wait_until(lambda: "panel" in scales(reader), "the object")
    page.press_in_bar("Objects")


@pytest.mark.long
def test_a_large_object_is_placed_with_a_scale(
    page: ViserPage, reader: Client, artefacts: Path
) -> None:
    drop(page, house_glb=cube(5.0, "glb"))
    form = page.page.locator("#fit")
    form.wait_for()
    assert "5000 mm long, over 2000 mm: place it with the scale 0.2" in shown(page)
    assert page.page.input_value("#fit-scale") == "0.2"
    assert page.page.inner_text("#fit-size") == "1000 × 1000 × 1000 mm"
    assert "house" not in scales(reader)
    page.page.fill("#fit-scale", "0.9")
    assert page.page.inner_text("#fit-size") == "4500 × 4500 × 4500 mm"
    assert page.page.locator("#fit-place").is_disabled()
    page.page.fill("#fit-scale", "0.03")
    assert page.page.inner_text("#fit-size") == "150 × 150 × 150 mm"
    page.screenshot(artefacts / "app-scale.png")
    page.page.click("#fit-place")
    page.wait_until(lambda: scales(reader).get("house") == 0.03, "the object")
    assert not form.is_visible()
    # A unit that fits replaces the scale.
    page.page.select_option("#unit", "cm")
    page.wait_until(lambda: scales(reader).get("house") == 1.0, "the size of the other unit")
    page.page.select_option("#unit", "")
