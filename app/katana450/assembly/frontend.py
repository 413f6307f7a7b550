"""Assembly of the front end: the view, and the arm as the gateway sees it."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Iterator
from functools import partial
from threading import Event

from katana450.arm.control import commands as cmd
from katana450.arm.control.scene_objects import Environment
from katana450.arm.robot.object_meshes import Meshes
from katana450.arm.robot.robot import Robot
from katana450.arm.runtime.arm_listener import FRONT, Greeting, connect, connect_when_ready
from katana450.arm.runtime.detour_planner import DetourPlanner
from katana450.arm.runtime.front_end import FrontEnd
from katana450.arm.runtime.planning_worker import PlanningWorker
from katana450.assembly.frontend_process import FrontendConfig
from katana450.assembly.gateway import Gateway
from katana450.assembly.robot_session import DescribedRobot, find_robot
from katana450.errors import ConfigurationError
from katana450.extension import extensions, serve_extensions
from katana450.server.service.arm_handle import ArmHandle
from katana450.server.service.nodes import Nodes
from katana450.server.service.runner import guarded
from katana450.server.view.gizmo import Gizmo
from katana450.server.view.layer import ViewLayer
from katana450.server.view.panel_folder import FolderContext, PanelFolder
from katana450.server.view.panel_tabs import PanelTabs
from katana450.server.view.view import View, ViewOptions
from katana450.server.view.view_updater import ViewUpdater


def build_frontend(
    gateway: Gateway, config: FrontendConfig, meshes: Meshes, ended: Event
) -> tuple[FrontEnd, ViewUpdater, DetourPlanner | None]:
    """Connect ``gateway`` to the arm; return the pipe to its process, the view, and the planner.

    The planner of detours is None for a robot without a tool. The pipe is served when this function
    returns, so no answer contains a state older than this call. The view is not started.

    Args:
        gateway: the server of the page.
        config: settings and options of the front end.
        meshes: the meshes of scene objects.
        ended: set when the server ends.

    Raises:
        ConfigurationError: an option needs an arm, but the robot has none.
        EOFError: the server ends, or the arm's process has closed the pipe.
    """
    settings, added = config.settings, layers(config.options)
    found = find_robot(settings, config.urdf, config.tool)
    robot, session, _ = found
    address = config.address
    front_end = FrontEnd(
        connect_when_ready(address, Greeting(FRONT), ended),
        session.check,
        lambda number: connect(address, Greeting(FRONT, number)),
    )
    nodes = _nodes(config.options, robot, session.environment)
    front_end.on_stop_change = partial(gateway.soon, gateway.hub.follow_stop)
    front_end.on_command_at_rest = partial(gateway.soon, gateway.watch_closely)
    folders = partial(_folders, gateway, config.options, robot, front_end)
    if robot.arm is None:
        for layer in added:
            if layer.what:
                raise ConfigurationError(f"{layer.what} {robot.why}")
        front_end.start()
        gateway.attach(ArmHandle(robot, session, front_end, None, nodes))
        joint_options = ViewOptions(meshes=meshes, folders=folders)
        return front_end, _joint_view(gateway, config, found, front_end, joint_options), None
    planning_worker = PlanningWorker(session, front_end.state_publisher, front_end)
    options = ViewOptions(added, meshes, folders, find_gizmo(robot.arm.kinematics.freedoms))
    view = _view(gateway, config, found, front_end, options)
    go = partial(gateway.hub.gate.submit, cmd.Go()) if settings.go_on_release else None
    detours = DetourPlanner(session, front_end.state_publisher, planning_worker, go)
    planning_worker.notify = gateway.announce
    planning_worker.redirected = guarded(gateway.hub.runner.redirected)
    front_end.start()
    gateway.attach(ArmHandle(robot, session, front_end, planning_worker, nodes))
    detours.start()
    return front_end, view, detours


def find_gizmo(freedoms: int) -> type[Gizmo] | None:
    """Return the class of the gizmo that an extension has for a tool of so many freedoms."""
    found = (each.gizmo(freedoms) for each in extensions() if each.gizmo is not None)
    return next(found, None)


def layers(options: Namespace | None) -> tuple[ViewLayer, ...]:
    """Return the layers that the extensions add to the scene of an arm."""
    if options is None:
        return ()
    found = [part.view_layer(options) for part in serve_extensions() if part.view_layer is not None]
    return tuple(layer for layer in found if layer is not None)


def _nodes(options: Namespace | None, robot: Robot, environment: Environment) -> Nodes:
    """Return the nodes of the first extension that provides any, else those of the links alone."""
    for part in () if options is None else serve_extensions():
        if part.nodes is not None:
            return part.nodes(robot, environment)
    return Nodes(robot)


def _view(
    gateway: Gateway,
    config: FrontendConfig,
    found: DescribedRobot,
    front_end: FrontEnd,
    view_options: ViewOptions,
) -> View:
    return View(
        gateway.viser,
        found.robot,
        front_end.state_publisher,
        gateway.gestures,
        lambda: front_end.last_ticket,
        found.session,
        config.settings.frame_rate,
        view_options,
    )


def _folders(
    gateway: Gateway, options: Namespace | None, robot: Robot, front_end: FrontEnd, tabs: PanelTabs
) -> Iterator[PanelFolder]:
    """Add the controls of the extensions to the panel. Raises KatanaError."""
    if options is None:
        return
    context = FolderContext(
        gateway.viser,
        robot,
        gateway.gestures,
        lambda: front_end.state_publisher.snapshot.state,
        gateway.hub,
        gateway.call,
        options,
        tabs,
    )
    for part in serve_extensions():
        folder = None if part.folder is None else part.folder(context)
        if folder is not None:
            yield folder


def _joint_view(
    gateway: Gateway,
    config: FrontendConfig,
    found: DescribedRobot,
    front_end: FrontEnd,
    view_options: ViewOptions,
) -> ViewUpdater:
    """Return the view of a robot without a tool; without an extension, one that shows nothing."""
    publisher, rate = front_end.state_publisher, config.settings.frame_rate
    for each in extensions():
        if each.joint_view is not None:
            gestures, last_ticket = gateway.gestures, lambda: front_end.last_ticket
            view, (robot, session, _) = each.joint_view(), found
            shown = gateway.viser, robot, publisher, gestures, last_ticket, session, rate
            return view(*shown, view_options)
    return ViewUpdater(gateway.viser, publisher, rate)
