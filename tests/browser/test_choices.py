"""Branches, readings and the velocity ellipsoid through the page."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from app.kinematics.forward import forward
from app.kinematics.velocity import limit_distances, singular_values
from app.robot.model import RobotModel
from app.settings import Settings
from app.view.texts import READINGS, room
from tests.browser.conftest import OpenPage
from tests.browser.server import AppServer

READY = np.array(Settings().ready)
MOVE = "/target/move"


def test_a_person_looks_at_the_branches_and_takes_one(
    open_page: OpenPage, model: RobotModel, artefacts: Path
) -> None:
    chain = model.arm.chain
    with AppServer() as server:
        page = open_page(server.url, nodes=("/arm", MOVE))

        def now(key: str) -> str:
            return page.text_of(f".k450 [data-now={key}]")

        # At rest: the read-out says how near the next singularity and limit are.
        distances = limit_distances(chain, READY)
        axis = int(distances.argmin())
        assert now("limit") == room(axis, distances[axis])
        assert now("singular") == f"{singular_values(chain, READY)[-1]:.3f}"

        for folder in ("Branches", "Show"):
            page.page.get_by_text(folder, exact=True).click()
        page.page.get_by_text("Velocity ellipsoid", exact=True).click()
        page.wait_until(
            lambda: any(
                message.body["visible"]
                for message in page.messages("SetSceneNodeVisibilityMessage", node="/velocity")
            ),
            "the ellipsoid",
        )
        assert np.allclose(
            page.node_pose("/velocity")[:3, 3],
            (model.T_base_shoulder @ forward(chain, READY))[:3, 3],
            atol=1e-5,
        )
        # Looking moved nothing.
        assert [page.slider_value(f"Axis {i}") for i in range(1, 6)] == [
            round(math.degrees(angle), 6) for angle in READY
        ]
        assert "nothing" in page.text_of("[data-branch=front-up]")

        page.page.get_by_role(
            "button", name="Take front-down", exact=True
        ).scroll_into_view_if_needed()
        page.screenshot(artefacts / "app-branches.png")
        page.click_button("Take front-down")
        page.wait_until(lambda: page.slider_value("Axis 3") < 0.0, "the other elbow")
        assert page.errors == []


def test_a_reading_is_chosen_for_everyone(open_page: OpenPage) -> None:
    with AppServer() as server:
        first, second = (open_page(server.url, nodes=("/arm", MOVE)) for _ in range(2))
        old, new = list(READINGS.values())[:2]
        assert first.chosen("Reading") == old
        first.choose("Reading", new)
        second.wait_until(lambda: second.chosen("Reading") == new, "the reading in both windows")
        assert first.chosen("Reading") == new
