"""Branches, priorities and the velocity ellipsoid on the page."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from katana450.arm.control.messages import PRIORITIES, axis_names, limit_text
from katana450.arm.robot.mounted_arm import MountedArm
from katana450.cli.main import main
from katana450.extensions.reachability.reachability_file import load_map
from katana450.extensions.reachability.view import Cut
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.velocity import limit_distances, singular_values
from katana450.settings import Settings
from tests.browser.conftest import OpenPage, Windows
from tests.browser.page import ViserPage
from tests.browser.server import APP, AppServer, ServerError
from tests.browser.session import AXES, bar
from tests.gateway.client import ask, enter

READY = np.array(Settings().ready)
MOVE = "/target/move"
ARMS = Path(__file__).resolve().parents[1] / "robot" / "arms"


@pytest.fixture(scope="module")
def page(server: AppServer, windows: Windows) -> Iterator[ViserPage]:
    """Return a window with the open folder of the branches."""
    with windows.open(server.url, nodes=("/arm", MOVE)) as page:
        page.frame.get_by_text("Branches", exact=True).click()
        yield page


@pytest.mark.long
def test_branches_are_shown_and_one_is_taken(
    page: ViserPage, arm: MountedArm, artefacts: Path
) -> None:
    chain = arm.chain

    def now(key: str) -> str:
        return page.text_of(f".k450 [data-now={key}]")

    # At rest the read-out shows the distances to singularity and limit.
    distances = limit_distances(chain, READY)
    axis = int(distances.argmin())
    assert now("limit") == limit_text(axis, axis_names(chain.names)[axis], distances[axis])
    assert now("singular") == f"{singular_values(chain, READY)[-1]:.3f}"

    page.open_tab("Scene")
    page.frame.get_by_text("Velocity ellipsoid", exact=True).click()
    page.wait_until(
        lambda: any(
            message.body["visible"]
            for message in page.messages("SetSceneNodeVisibilityMessage", node="/velocity")
        ),
        "the ellipsoid",
    )
    assert np.allclose(
        page.node_pose("/velocity")[:3, 3],
        (arm.T_base_shoulder @ forward(chain, READY))[:3, 3],
        atol=1e-5,
    )
    page.open_tab("Drive")
    # The view of the branches moved nothing.
    assert [page.slider_value(label) for label in AXES] == [
        round(math.degrees(angle), 6) for angle in READY
    ]
    assert "nothing" in page.text_of("[data-branch=front-up]")

    page.frame.get_by_role("button", name="front-down", exact=True).scroll_into_view_if_needed()
    page.keep(artefacts / "app-branches.png")
    page.click_button("front-down")
    page.wait_until(lambda: page.slider_value("3 elbow") < 0.0, "the other elbow", seconds=30.0)
    assert page.errors == []


def moves(server: AppServer) -> bool:
    """Return whether the arm moves or plans a motion."""
    state = json.loads(ask(f"{server.url}/api/v1/state", Cookie=enter(server.url))[2])
    return bool(state["moving"])


@pytest.mark.long
def test_click_on_a_ghost_takes_its_branch(
    page: ViserPage, server: AppServer, artefacts: Path
) -> None:
    page.click_button("Home")
    page.wait_until(lambda: page.slider_value("3 elbow") > 0.0, "the sliders at home")
    # Sent together with the sliders, so it now belongs to the new posture.
    page.wait_until(lambda: bar(page, "headline") == "On target", "the arm at home", seconds=20.0)
    page.choose("Ghosts", "front-down")
    elbow = "/branch/front-down/base_link/arm_base_link/pan_link/upper_arm_link/forearm_link"
    page.wait_ready((elbow,))
    page.keep(artefacts / "app-ghosts.png")
    before = page.slider_value("3 elbow")

    def clicked() -> bool:
        # An overloaded browser can lose a click, so click again.
        page.page.mouse.click(*page.project(page.node_pose(elbow)[:3, 3]))
        page.page.wait_for_timeout(3000)
        return moves(server) or page.slider_value("3 elbow") * before < 0.0

    page.wait_until(clicked, "the effect of the click", seconds=40.0)
    page.wait_until(
        lambda: page.slider_value("3 elbow") * before < 0.0, "the other elbow", seconds=30.0
    )
    page.wait_until(lambda: "Moving" not in bar(page, "headline"), "the arm to arrive")
    assert page.errors == []


@pytest.mark.long
def test_a_map_of_the_workspace_is_looked_into(
    open_page: OpenPage, tmp_path: Path, artefacts: Path
) -> None:
    path = tmp_path / "map.npz"
    assert main(["workspace", "--voxel", "40", "--pitches", "12", "--out", str(path)]) == 0
    stored = load_map(path)
    with AppServer((*APP, "--workspace", str(path))) as server:
        page = open_page(server.url, nodes=("/arm", MOVE))
        page.open_tab("Scene")

        def drawn(cut: Cut) -> int:
            page.choose("Reachability", cut.value)
            page.wait_ready(("/reachability",))
            page.keep(artefacts / f"app-reachability-{cut.name.lower()}.png")
            (message,) = page.messages("PointCloudMessage", node="/reachability", last=1)
            count: int = message.body["props"]["points"]["length"]
            return count // 3

        layers = np.floor(stored.points[:, 1] / stored.voxel)
        assert drawn(Cut.SLICE) == (layers == 0.0).sum()
        assert drawn(Cut.HALF) == (layers >= 0.0).sum()
        assert drawn(Cut.WHOLE) == len(stored.points)
        page.choose("Reachability", Cut.HIDDEN.value)
        page.wait_until(
            lambda: page.messages("RemoveSceneNodeMessage", node="/reachability", last=1),
            "the map to go",
        )
        assert page.errors == []


@pytest.mark.long
def test_the_map_of_another_arm_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "map.npz"
    options = ("--voxel", "150", "--pitches", "4", "--rolls", "4", "--out", str(path))
    assert main(["workspace", "--urdf", str(ARMS / "pincherx_150.urdf"), *options]) == 0
    with pytest.raises(ServerError, match=r"pincherx_150'; this arm is 'katana450'"):
        AppServer((*APP, "--workspace", str(path))).start()


@pytest.mark.long
def test_priority_applies_to_every_window(
    page: ViserPage, server: AppServer, open_page: OpenPage
) -> None:
    first, second = page, open_page(server.url, nodes=("/arm", MOVE))
    old, new = list(PRIORITIES.values())[:2]
    assert first.chosen("Priority") == old
    first.choose("Priority", new)
    second.wait_until(lambda: second.chosen("Priority") == new, "the reading in both windows")
    assert first.chosen("Priority") == new
