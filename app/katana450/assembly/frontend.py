"""The front end from its first page on: gateway, view, event log, and the arm as they see it."""

from __future__ import annotations

import socket
from argparse import Namespace
from collections.abc import Iterator
from functools import partial
from pathlib import Path

from katana450.arm.control.lease import SERVER
from katana450.arm.robot.object_meshes import Meshes
from katana450.arm.robot.robot import Robot
from katana450.arm.runtime.pipes.arm_roles import FRONT
from katana450.arm.runtime.pipes.front_end import FrontEnd
from katana450.arm.runtime.pipes.private_listener import Greeting, connect, connect_when_ready
from katana450.arm.runtime.planning_worker import PlanningWorker
from katana450.assembly.event_log.disk_log import DiskLog
from katana450.assembly.gateway import Gateway
from katana450.assembly.robot_session import DescribedRobot, find_robot
from katana450.assembly.supervised import READY, SupervisorPipe
from katana450.assembly.web_server import WebServer
from katana450.extension import ServerFacts, load, results
from katana450.server.service.arm_handle import ArmHandle, Nodes
from katana450.server.service.command_gate import guarded
from katana450.server.view.layer import FolderContext, PanelFolder, ViewLayer
from katana450.server.view.view import View
from katana450.server.viser_bridge.viser_server import close_server

NODES = "katana450.extensions.export.vrml.vrml_nodes:VrmlNodes"
"""Class of the values that clients read and set by name."""

WAKE_INTERVAL = 0.25
"""[s] Interval at which a failure of the view is checked."""

HANG_SECONDS = 5.0
"""[s] Time after which an event loop that does not turn counts as hung."""


def serve(
    config: ServerFacts,
    web: WebServer,
    lines: socket.socket | None,
    log_folder: Path | None,
    supervisor: SupervisorPipe,
) -> None:
    """Serve people and programs until the server ends.

    Args:
        config: settings and options of the server.
        web: the server of the page, which is started.
        lines: the socket for programs that send JSON lines.
        log_folder: folder of the event log; None without a log.
        supervisor: the supervisor of this process.

    Raises:
        EOFError: the server ends before the arm is connected.
        KatanaError: the front end cannot be set up.
    """
    meshes = Meshes(config.folder)
    gateway = Gateway(config.settings, web, lines, meshes)
    gateway.hub.replace_robot = supervisor.replace_robot
    # Without a reader, notes would only take memory.
    web.recorder.enabled = log_folder is not None
    event_log: DiskLog | None = None

    def notify(why: str) -> None:
        web.recorder.note("restart", SERVER, why=why)
        gateway.soon(gateway.hub.announce, why)

    supervisor.notify = notify
    try:
        machine = find_robot(config.settings, config.urdf, config.tool)
        pipe = _connected(gateway, config, machine, supervisor)
        view = _view(gateway, config, machine, pipe, meshes)
        gateway.show()
        # Browsers draw the scene meanwhile.
        if log_folder is not None:
            event_log = DiskLog(web.recorder, log_folder, config.port)
        gateway.start(config.options)
        supervisor.prove(lambda: gateway.hub.held_up < HANG_SECONDS)
        _attach(gateway, machine, pipe)
        view.add_panel(partial(_folders, gateway, config.options, machine.robot, pipe))
        view.start()
        supervisor.report(READY)
        while not supervisor.ended.wait(WAKE_INTERVAL) and not pipe.cut.is_set():
            if view.failed.is_set():
                raise SystemExit(1)
        pipe.close()
        web.stop()
        view.stop()
    finally:
        web.stop()
        if event_log is not None:
            event_log.close()
        close_server(gateway.viser)


def _connected(
    gateway: Gateway, config: ServerFacts, machine: DescribedRobot, supervisor: SupervisorPipe
) -> FrontEnd:
    """Return the pipe to the arm's process. Raises EOFError if that, or the server, ends."""
    pipe = FrontEnd(
        connect_when_ready(config.address, Greeting(FRONT), supervisor.ended),
        machine.session.check,
        lambda number: connect(config.address, Greeting(FRONT, number)),
    )
    pipe.on_stop_change = partial(gateway.soon, gateway.hub.follow_stop)
    pipe.on_command_at_rest = partial(gateway.soon, gateway.watch_closely)
    return pipe


def _view(
    gateway: Gateway, config: ServerFacts, machine: DescribedRobot, pipe: FrontEnd, meshes: Meshes
) -> View:
    """Build the scene. Raises KatanaError."""
    layers: Iterator[ViewLayer] = results("view_layer", config.options)
    return View(
        gateway.viser,
        machine.robot,
        pipe.state_publisher,
        gateway.gestures,
        lambda: pipe.last_ticket,
        machine.session,
        tuple(layer for layer in layers if machine.robot.arm is not None or not layer.needs_arm),
        meshes,
    )


def _attach(gateway: Gateway, machine: DescribedRobot, pipe: FrontEnd) -> None:
    """Attach the arm to the gateway, which is started.

    The pipe is served before the arm is attached, so no answer contains a state older than this
    call.
    """
    robot, session, _ = machine
    nodes: Nodes = load(NODES)(robot, session.environment)
    planning_worker = None
    if robot.arm is not None:
        planning_worker = PlanningWorker(session, pipe.state_publisher, pipe)
        planning_worker.notify = partial(gateway.soon, gateway.hub.announce)
        planning_worker.redirected = guarded(gateway.hub.runner.redirected)
    pipe.start()
    gateway.attach(ArmHandle(robot, session, pipe, planning_worker, nodes))


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
