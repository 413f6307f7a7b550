"""What the front shows and steers: a view and the arm as its gateway sees it, put together."""

from __future__ import annotations

from multiprocessing.connection import Connection

from katana450.arm.control.joint_session import JointSession
from katana450.arm.runtime.link import FrontEnd
from katana450.arm.runtime.planning_worker import PlanningWorker
from katana450.assembly.frontend_process import FrontendConfig
from katana450.assembly.robot_session import recognised
from katana450.errors import ConfigurationError
from katana450.extensions.export.reachability_file import load_map
from katana450.extensions.importers.meshes import Meshes
from katana450.extensions.programs.script_files import Scripts
from katana450.server.service.arm_handle import Motion
from katana450.server.service.vrml_nodes import Nodes
from katana450.server.view.follower import Follower
from katana450.server.view.machine_view import MachineView
from katana450.server.view.view import View, ViewOptions
from katana450.server.web.web_server import Gateway


def attached(
    gateway: Gateway, outfit: FrontendConfig, meshes: Meshes, pipe: Connection
) -> tuple[FrontEnd, Follower]:
    """The front's end of ``pipe``, and the view, neither running yet; ``gateway`` has the arm.

    ``meshes``: those that things are of. Raises ConfigurationError, EOFError.
    """
    settings, workspace = outfit.settings, outfit.workspace
    found = recognised(settings, outfit.urdf, outfit.tool)
    robot, session, _ = found
    link = FrontEnd(pipe, session.check)
    nodes = Nodes(robot, session.surroundings)
    if isinstance(session, JointSession):
        if workspace is not None:
            raise ConfigurationError(f"{workspace} maps where a tool can be. {robot.why}")
        rate = settings.frame_rate
        machine_view = MachineView(gateway.viser, robot, link.board, link, rate)
        gateway.attach(Motion(robot, session, link, None, nodes, machine_view.let_go))
        return link, machine_view
    stored = None if workspace is None else load_map(workspace)
    besides = ViewOptions(stored, (gateway.steering, Scripts(settings.programs)), meshes)
    navigator = PlanningWorker(session, link.board, link)
    view = View(gateway.viser, robot, link.board, navigator, session, settings.frame_rate, besides)
    navigator.tell = gateway.announce
    navigator.redirected = gateway.steering.redirected
    gateway.attach(Motion(robot, session, link, navigator, nodes, view.let_go))
    return link, view
