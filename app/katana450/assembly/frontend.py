"""Assembly of the front end: the view, and the arm as the gateway sees it."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Iterator
from functools import partial
from threading import Event

from katana450.arm.robot.object_meshes import Meshes
from katana450.arm.robot.robot import Robot
from katana450.arm.runtime.pipes.arm_roles import FRONT
from katana450.arm.runtime.pipes.front_end import FrontEnd
from katana450.arm.runtime.pipes.private_listener import Greeting, connect, connect_when_ready
from katana450.arm.runtime.planning_worker import PlanningWorker
from katana450.assembly.gateway import Gateway
from katana450.assembly.robot_session import find_robot
from katana450.extension import ServerFacts, load, results
from katana450.server.service.arm_handle import ArmHandle, Nodes
from katana450.server.service.command_gate import guarded
from katana450.server.view.layer import FolderContext, PanelFolder, ViewLayer
from katana450.server.view.view import View

NODES = "katana450.extensions.export.vrml.vrml_nodes:VrmlNodes"
"""Class of the values that clients read and set by name."""


class Frontend:
    """The view, and the arm as the gateway sees it. The scene is built first.

    Attributes:
        pipe: the pipe to the arm's process.
        view: the view.
    """

    def __init__(self, gateway: Gateway, config: ServerFacts, meshes: Meshes, ended: Event) -> None:
        """Connect to the arm, and build the scene.

        Args:
            gateway: the server of the page.
            config: settings and options of the server.
            meshes: the meshes of scene objects.
            ended: set when the server ends.

        Raises:
            EOFError: the server ends, or the arm's process has closed the pipe.
        """
        self._gateway, self._config = gateway, config
        settings, address = config.settings, config.address
        added: tuple[ViewLayer, ...] = tuple(results("view_layer", config.options))
        robot, session, _ = self._found = find_robot(settings, config.urdf, config.tool)
        self.pipe = FrontEnd(
            connect_when_ready(address, Greeting(FRONT), ended),
            session.check,
            lambda number: connect(address, Greeting(FRONT, number)),
        )
        self.pipe.on_stop_change = partial(gateway.soon, gateway.hub.follow_stop)
        self.pipe.on_command_at_rest = partial(gateway.soon, gateway.watch_closely)
        if robot.arm is None:
            added = tuple(layer for layer in added if not layer.needs_arm)
        self.view = View(
            gateway.viser,
            robot,
            self.pipe.state_publisher,
            gateway.gestures,
            lambda: self.pipe.last_ticket,
            session,
            added,
            meshes,
        )

    def start(self) -> None:
        """Attach the arm to the gateway, which is started, add the panel, and start the view.

        The pipe is served before the arm is attached, so no answer contains a state older than this
        call. Raises KatanaError.
        """
        gateway, hub, pipe = self._gateway, self._gateway.hub, self.pipe
        robot, session, _ = self._found
        nodes: Nodes = load(NODES)(robot, session.environment)
        planning_worker = None
        if robot.arm is not None:
            planning_worker = PlanningWorker(session, pipe.state_publisher, pipe)
            planning_worker.notify = gateway.announce
            planning_worker.redirected = guarded(hub.runner.redirected)
        pipe.start()
        gateway.attach(ArmHandle(robot, session, pipe, planning_worker, nodes))
        self.view.add_panel(partial(_folders, gateway, self._config.options, robot, pipe))
        self.view.start()

    def stop(self) -> None:
        """End the view."""
        self.view.stop()


def _folders(
    gateway: Gateway, options: Namespace, robot: Robot, front_end: FrontEnd
) -> Iterator[PanelFolder]:
    """Add the controls of the extensions to the panel. Raises KatanaError."""
    context = FolderContext(
        gateway.viser,
        robot,
        gateway.gestures,
        lambda: front_end.state_publisher.snapshot.state,
        gateway.hub,
        options,
    )
    yield from results("folder", context)
