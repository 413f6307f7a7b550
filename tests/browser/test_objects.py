"""Objects from files: the page uploads a file, and the object is placed, moved and removed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh

from tests.browser.conftest import OpenPage
from tests.browser.page import ViserPage
from tests.browser.server import AppServer

MOVE = "/target/move"
SHAPE = "/objects/3/shape"
"""The third object, after cup and basin."""

HANDLE = "/handles/ring"


def sheet_text(page: ViserPage) -> str:
    return page.page.locator("#read").inner_text()


def place_of(page: ViserPage) -> np.ndarray:
    return np.asarray(page.node_pose("/objects/3")[:3, 3])


def test_an_object_is_brought_moved_changed_and_removed(
    open_page: OpenPage, tmp_path: Path, artefacts: Path
) -> None:
    ring = tmp_path / "ring.stl"
    ring.write_bytes(trimesh.creation.torus(40.0, 12.0, 48, 24).export(file_type="stl"))
    broken = tmp_path / "broken.stl"
    broken.write_bytes(b"solid nothing")
    with AppServer() as server:
        page = open_page(server.url, nodes=("/arm", MOVE))
        page.press_in_bar("Objects")
        page.page.set_input_files("#object-file", broken)
        page.wait_until(
            lambda: "broken.stl" in sheet_text(page) and "…" not in sheet_text(page), "a refusal"
        )
        assert page.page.locator("#read.bad").count() == 1

        page.page.set_input_files("#object-file", ring)
        page.wait_until(
            lambda: "2304 triangles, 104 × 104 × 24 mm" in sheet_text(page), "the answer"
        )
        assert "assumed to be mm" in sheet_text(page)
        page.wait_ready((SHAPE,))
        np.testing.assert_allclose(place_of(page), (0.36, 0.0, 0.0), atol=1e-6)

        page.open_tab("Scene")
        page.frame.get_by_text("Handles on objects", exact=True).click()
        page.wait_ready((HANDLE,))
        assert page.chosen("Object") == "ring"
        page.drag_arrow(HANDLE, "y", 0.12)
        page.wait_until(lambda: place_of(page)[1] > 0.115, "the object to follow its handle")
        moved = place_of(page)
        np.testing.assert_allclose(moved, (0.36, 0.12, 0.0), atol=0.01)

        # Another unit than the guessed one changes the size of the same object.
        page.page.select_option("#unit", "cm")
        page.wait_until(lambda: "1040 × 1040 × 240 mm" in sheet_text(page), "the other unit")
        page.wait_until(
            lambda: len(page.messages("MeshMessage", node=SHAPE)) == 2, "it in the scene"
        )
        np.testing.assert_allclose(place_of(page), moved, atol=1e-9)

        page.type_number("Scale", 0.15)
        page.wait_until(
            lambda: any(
                each.body["updates"].get("scale") == 0.15
                for each in page.messages("SceneNodeUpdateMessage", node=SHAPE)
            ),
            "the scale",
        )
        page.frame.get_by_role("button", name="Remove", exact=True).scroll_into_view_if_needed()
        page.screenshot(artefacts / "app-objects.png")
        page.click_button("Hand")
        page.wait_until(
            lambda: (
                page.messages("SetSceneNodeVisibilityMessage", node=HANDLE, last=1)[0].body[
                    "visible"
                ]
                is False
            ),
            "the handle to go with the hand",
        )
        page.click_button("Remove")
        page.wait_until(
            lambda: page.messages("RemoveSceneNodeMessage", node="/objects/3", last=1), "it to go"
        )
        page.wait_until(lambda: page.chosen("Object") == "cup", "another object to be chosen")
        refused = [each for each in page.errors if "422" not in each]
        assert refused == []
