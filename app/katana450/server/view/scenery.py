"""The visible parts of a state apart from controls: arm, table, objects, and layers."""

from __future__ import annotations

from collections.abc import Sequence

import viser

from katana450.arm.control.session.session import Session
from katana450.arm.control.state.state import State
from katana450.arm.robot.object_meshes import Meshes
from katana450.arm.robot.props import Props
from katana450.arm.robot.robot import Robot
from katana450.server.view.controls import GestureGate
from katana450.server.view.layer import LayerContext, ViewLayer
from katana450.server.view.scene import ArmNodes
from katana450.server.view.scene_objects import SceneObjectNodes
from katana450.server.viser_bridge.themes import set_up_room

SHADE = 0.35
"""Darkness (0 to 1) of shadows on the table."""


FLOOR_GAP = 5e-4
"""Depth [m] of the floor below the table of a robot without an arm, which is not drawn."""


def add_table(server: viser.ViserServer, props: Props) -> None:
    """Draw the table from its GLB file."""
    # If the table top cast shadows, it would shade its own face.
    server.scene.add_glb(
        "/table", props.table.mesh.read_bytes(), cast_shadow=False, receive_shadow=SHADE
    )


class Scenery:
    """The nodes of arm, table, objects and layers. Only changes are sent."""

    def __init__(
        self,
        server: viser.ViserServer,
        robot: Robot,
        session: Session,
        props: Props,
        gestures: GestureGate,
        meshes: Meshes,
        layers: Sequence[ViewLayer] = (),
    ) -> None:
        """Build the scene on ``server``.

        Args:
            server: viser's server.
            robot: The robot. The table is drawn beside an arm.
            session: The session, which has the environment of objects.
            props: Table, cup and basin.
            gestures: The path of gestures at the nodes of layers.
            meshes: The meshes of objects.
            layers: Layers of extensions.

        Raises:
            ConfigurationError: A layer cannot be shown.
        """
        self._robot = robot
        if robot.arm is None:
            set_up_room(server, session.environment.table_height - FLOOR_GAP)
        else:
            set_up_room(server)
            add_table(server, props)
        self._objects = SceneObjectNodes(server, props, session.environment, meshes)
        self.arm = ArmNodes(server, robot)
        self._layers = layers
        for layer in layers:
            layer.attach(LayerContext(server, robot, session, self.arm, gestures))

    def show(self, state: State) -> None:
        """Show ``state``."""
        self.arm.move(self._robot.joint_values(state.q, state.gripper))
        self._objects.follow(state)
        for layer in self._layers:
            layer.follow(state)
