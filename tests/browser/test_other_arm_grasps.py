"""The tab Programs with a Panda: a box is picked, kept in the hand by a STOP, and placed."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from katana450.client import connect
from katana450.server.api import answers, requests
from tests.browser.conftest import OpenPage
from tests.browser.server import APP, AppServer
from tests.browser.session import MOVE, Truth, clear_stop, take
from tests.browser.sizes import PHONE, PORTRAIT, WIDE
from tests.browser.test_other_arm_programs import at_rest, progress, wait
from tests.general_arms.gripping_arms import gripping_urdf

pytestmark = pytest.mark.long

SCRIPT = """name: Tidy up
frame: base
steps:
  - pick: box
  - place: {at: {x: 400, y: -200}}
  - home
"""


@pytest.fixture
def server(tmp_path: Path) -> Iterator[AppServer]:
    path = tmp_path / "panda.urdf"
    path.write_text(gripping_urdf("Panda"), encoding="utf-8")
    (tmp_path / "tidy up.yaml").write_text(SCRIPT, encoding="utf-8")
    with AppServer((*APP, "--urdf", str(path), "--programs", str(tmp_path))) as server:
        with connect(server.url) as arm:
            T: Any = np.eye(4)
            T[:2, 3] = 0.5, 0.1
            size = [0.04, 0.05, 0.06]
            box = requests.Place(
                name="box", shape=requests.Shape.BOX, size=size, T=T.tolist(), can_be_held=True
            )
            arm.ask(box)
        yield server


def place_of_box(server: AppServer) -> Any:
    with connect(server.url) as watcher:
        (box,) = (o for o in watcher.query(answers.Objects).objects if o.name == "box")
        return np.array(box.T)[:3, 3]


def test_box_is_picked_stopped_in_the_hand_and_placed(
    server: AppServer, open_page: OpenPage, artefacts: Path
) -> None:
    truth = Truth(server)
    page = open_page(server.url, nodes=("/arm", MOVE), window=WIDE)
    phone = open_page(server.url, nodes=("/arm", MOVE), window=PORTRAIT, own_camera=True, **PHONE)
    take(page)
    page.open_tab("Programs")
    page.choose("Script", "tidy up")
    page.click_button("Preview")
    wait(page, truth, "ready", 120.0)
    before = truth.status()["q"]
    page.drag_slider("Look at", 6.0)
    page.keep(artefacts / "grasp-preview.png")
    # A preview moves neither the arm nor the box.
    assert truth.status()["q"] == before
    np.testing.assert_allclose(place_of_box(server), (0.5, 0.1, 0.0), atol=1e-12)

    page.click_button("Run")
    page.wait_until(lambda: truth.status()["held"] == "box", "the box in the hand", seconds=60.0)
    page.wait_until(lambda: progress(truth)["step"] == 2, "the second step", seconds=60.0)
    phone.page.locator("#stop").tap()
    page.page.locator("#headline", has_text="Stopped").wait_for()
    stopped = at_rest(page, truth)
    assert truth.status()["held"] == "box"
    phone.keep(artefacts / "grasp-stopped.png")
    clear_stop(page, truth)
    page.page.wait_for_timeout(600)
    assert truth.status()["q"] == stopped
    assert truth.status()["held"] == "box"

    page.page.get_by_role("button", name="Continue ").click()
    wait(page, truth, "done", 120.0)
    at_rest(page, truth)
    page.keep(artefacts / "grasp-placed.png")
    assert truth.status()["held"] is None
    np.testing.assert_allclose(place_of_box(server), (0.4, -0.2, 0.0), atol=1e-9)
    assert page.errors == []
    assert phone.errors == []
