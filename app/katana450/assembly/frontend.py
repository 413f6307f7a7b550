"""What the front shows and steers: a view and the arm as its gateway sees it, put together."""

from __future__ import annotations

from argparse import Namespace
from multiprocessing.connection import Connection

from katana450.arm.control.things import Environment
from katana450.arm.robot.mechanism import Mechanism
from katana450.arm.robot.object_meshes import Meshes
from katana450.arm.robot.urdf_mechanism import load_mechanism
from katana450.arm.runtime.link import FrontEnd
from katana450.arm.runtime.planning_worker import PlanningWorker
from katana450.assembly.frontend_process import FrontendConfig
from katana450.assembly.robot_session import Described, Jointed, recognised
from katana450.errors import ConfigurationError
from katana450.extension import serve_extensions
from katana450.extensions.programs.script_files import Scripts
from katana450.server.service.arm_handle import ArmHandle
from katana450.server.service.nodes import Body, Nodes, body_of, machine_of
from katana450.server.view.follower import Follower
from katana450.server.view.layer import ViewLayer
from katana450.server.view.machine_view import MachineView
from katana450.server.view.view import View, ViewOptions
from katana450.server.web.web_server import Gateway


def attached(
    gateway: Gateway, outfit: FrontendConfig, meshes: Meshes, pipe: Connection
) -> tuple[FrontEnd, Follower]:
    """The front's end of ``pipe``, and the view, neither running yet; ``gateway`` has the arm.

    ``meshes``: those that things are of. Raises ConfigurationError, EOFError.
    """
    settings, layers = outfit.settings, _layers(outfit.options)
    found = recognised(settings, outfit.urdf, outfit.tool)
    link = FrontEnd(pipe, found.session.check)
    if isinstance(found, Jointed):
        for layer in layers:
            if layer.what:
                raise ConfigurationError(f"{layer.what} {found.machine.joints.why}")
        return link, _machine(gateway, outfit, found, link)
    besides = ViewOptions(layers, (gateway.steering, Scripts(settings.programs)), meshes)
    return link, _arm(gateway, outfit, found, link, besides)


def _layers(options: Namespace | None) -> tuple[ViewLayer, ...]:
    """Return what the extensions show in the scene of an arm."""
    if options is None:
        return ()
    found = [part.view_layer(options) for part in serve_extensions() if part.view_layer is not None]
    return tuple(layer for layer in found if layer is not None)


def _nodes(
    options: Namespace | None, mechanism: Mechanism, body: Body, environment: Environment
) -> Nodes:
    """Return the nodes of the first extension that names any, else the links alone."""
    for part in () if options is None else serve_extensions():
        if part.nodes is not None:
            return part.nodes(mechanism, body, environment)
    return Nodes(mechanism, body)


def _arm(
    gateway: Gateway, outfit: FrontendConfig, found: Described, link: FrontEnd, besides: ViewOptions
) -> View:
    model, session, _ = found
    navigator = PlanningWorker(session, link.board, link)
    frame_rate = outfit.settings.frame_rate
    view = View(
        gateway.viser,
        model,
        link.board,
        gateway.gestures,
        lambda: link.last_ticket,
        session,
        frame_rate,
        besides,
    )
    navigator.tell = gateway.announce
    navigator.redirected = gateway.steering.redirected
    mechanism, _ = load_mechanism(outfit.urdf)
    body = body_of(model, mechanism)
    nodes = _nodes(outfit.options, mechanism, body, session.surroundings)
    gateway.attach(ArmHandle(model, session, link, navigator, nodes))
    return view


def _machine(
    gateway: Gateway, outfit: FrontendConfig, found: Jointed, link: FrontEnd
) -> MachineView:
    machine, session, _ = found
    view = MachineView(
        gateway.viser,
        machine,
        link.board,
        gateway.gestures,
        lambda: link.last_ticket,
        outfit.settings.frame_rate,
    )
    body = machine_of(machine)
    nodes = _nodes(outfit.options, machine.mechanism, body, session.surroundings)
    gateway.attach(ArmHandle(machine, session, link, None, nodes))
    return view
