"""Hidden and painted links in viser's scene."""

from __future__ import annotations

from dataclasses import replace

import pytest
import viser

from katana450.arm.control.appearance import Appearance, AppearanceTrait
from katana450.arm.control.session import Session
from katana450.arm.control.state import State
from katana450.arm.robot.loader import load
from katana450.arm.robot.robot import Robot
from katana450.resources import URDF_PATH
from katana450.server.view.paint import PaintNodes
from katana450.server.view.scene import ArmNodes
from tests.viser_bridge.internals import nodes


class Shown:
    """A scene of arm and paint."""

    def __init__(self, server: viser.ViserServer, robot: Robot, session: Session) -> None:
        self.server = server
        self.arm = ArmNodes(server, robot)
        self.paint = PaintNodes(server, self.arm)
        self.state = session.begin(session.ready, 0.0, 0.0)
        self.show()

    def show(self, **changes: object) -> State:
        self.state = replace(self.state, **changes)  # type: ignore[arg-type]
        self.paint.follow(self.state)
        return self.state

    def painted(self) -> dict[str, tuple[int, int, int]]:
        return {
            name: node.color
            for name, node in nodes(self.server).items()
            if isinstance(node, viser.MeshHandle) and "paint" in name and node.visible
        }


@pytest.fixture
def shown(server: viser.ViserServer, robot: Robot, session: Session) -> Shown:
    return Shown(server, robot, session)


def test_link_is_painted_hidden_and_restored(shown: Shown) -> None:
    made = [shape.visible for shape in shown.arm.shapes["pan_link"]]
    assert made
    assert all(made)
    red = Appearance().having("pan_link", AppearanceTrait.COLOUR, (1.0, 0.0, 0.2))
    shown.show(appearance=red)
    painted = shown.painted()
    assert set(painted.values()) == {(255, 0, 51)}
    assert all("/pan_link/paint" in name for name in painted)
    assert not any(shape.visible for shape in shown.arm.shapes["pan_link"])
    glass = Appearance().having("pan_link", AppearanceTrait.TRANSPARENCY, 0.75)
    shown.show(appearance=glass)
    # Without a colour of its own, the paint has the link's main colour.
    robot = load(URDF_PATH)
    (link,) = (link for link in robot.links if link.name == "pan_link")
    assert set(shown.painted().values()) == {tuple(round(255.0 * part) for part in link.colour)}
    node = nodes(shown.server)["/".join((shown.arm.path["pan_link"], "paint0"))]
    assert isinstance(node, viser.MeshHandle)
    assert node.opacity == 0.25
    shown.show(appearance=Appearance().having("pan_link", AppearanceTrait.CHOICE, -1))
    assert shown.painted() == {}
    assert not any(shape.visible for shape in shown.arm.shapes["pan_link"])
    shown.show(appearance=Appearance())
    assert [shape.visible for shape in shown.arm.shapes["pan_link"]] == made
    assert shown.painted() == {}
