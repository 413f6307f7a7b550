"""Parts that are hidden or painted, as viser's scene has them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import viser

from app.control.looks import Looks, Trait
from app.control.session import Session
from app.control.state import State
from app.exchange.urdf_mechanism import load_mechanism
from app.geometry import se3, so3
from app.robot.collision import things_of
from app.robot.model import RobotModel
from app.robot.props import load_props
from app.view.paint import PaintNodes
from app.view.scene import ArmNodes
from app.view.things import ThingNodes
from robot_description import URDF_PATH


class Shown:
    """A scene of arm, things and paint."""

    def __init__(self, server: viser.ViserServer, model: RobotModel, session: Session) -> None:
        props = load_props()
        around = session.surroundings
        self.server = server
        self.arm = ArmNodes(server, model)
        self.things = ThingNodes(server, props, around, lambda _: None)
        self.paint = PaintNodes(server, self.arm, self.things, around)
        self.state = replace(session.begin(session.ready, 0.0, 0.0), things=things_of(props))
        self.show()

    def show(self, **changes: object) -> State:
        self.state = replace(self.state, **changes)  # type: ignore[arg-type]
        self.things.follow(self.state)
        self.paint.follow(self.state)
        return self.state

    def painted(self) -> dict[str, tuple[int, int, int]]:
        nodes = self.server.scene._handle_from_node_name
        return {
            name: node.color
            for name, node in nodes.items()
            if isinstance(node, viser.MeshHandle) and "paint" in name and node.visible
        }


@pytest.fixture
def shown(server: viser.ViserServer, model: RobotModel, session: Session) -> Shown:
    return Shown(server, model, session)


def test_a_link_is_painted_hidden_and_as_it_was(shown: Shown) -> None:
    made = [shape.visible for shape in shown.arm.shapes["pan_link"]]
    assert made
    assert all(made)
    red = Looks().having("pan_link", Trait.COLOUR, (1.0, 0.0, 0.2))
    shown.show(looks=red)
    painted = shown.painted()
    assert set(painted.values()) == {(255, 0, 51)}
    assert all("/pan_link/paint" in name for name in painted)
    assert not any(shape.visible for shape in shown.arm.shapes["pan_link"])
    glass = Looks().having("pan_link", Trait.TRANSPARENCY, 0.75)
    shown.show(looks=glass)
    # Of a paint that nobody mixed: the colour of most of what the link is made of.
    mechanism, _ = load_mechanism(URDF_PATH)
    (link,) = (link for link in mechanism.links if link.name == "pan_link")
    assert set(shown.painted().values()) == {tuple(round(255.0 * part) for part in link.colour)}
    node = shown.server.scene._handle_from_node_name[
        "/".join((shown.arm.path["pan_link"], "paint0"))
    ]
    assert isinstance(node, viser.MeshHandle)
    assert node.opacity == 0.25
    shown.show(looks=Looks().having("pan_link", Trait.CHOICE, -1))
    assert shown.painted() == {}
    assert not any(shape.visible for shape in shown.arm.shapes["pan_link"])
    shown.show(looks=Looks())
    assert [shape.visible for shape in shown.arm.shapes["pan_link"]] == made
    assert shown.painted() == {}


def test_a_painted_thing_goes_where_the_thing_goes(shown: Shown) -> None:
    shown.show(looks=Looks().having("cup", Trait.COLOUR, (0.0, 1.0, 0.0)))
    ((name, colour),) = shown.painted().items()
    assert colour == (0, 255, 0)
    assert not shown.things.node("cup").visible
    T = se3.from_rotation_translation(so3.rotation_z(0.7), (0.3, -0.2, 0.0))
    things = tuple(
        replace(each, T=T) if each.name == "cup" else each for each in shown.state.things
    )
    shown.show(things=things)
    carrier = shown.server.scene._handle_from_node_name[name.removesuffix("/shape")]
    np.testing.assert_allclose(carrier.position, T[:3, 3], rtol=0, atol=1e-12)
    np.testing.assert_allclose(so3.from_quaternion(carrier.wxyz), T[:3, :3], rtol=0, atol=1e-12)
    assert not shown.things.node("cup").visible
    left = tuple(each for each in things if each.name != "cup")
    shown.show(things=left, looks=Looks())
    assert shown.painted() == {}
    assert not shown.things.node("cup").visible
    shown.show(things=things)
    assert shown.things.node("cup").visible
