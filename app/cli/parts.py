"""What the front shows and steers: a view and the arm as its gateway sees it, put together."""

from __future__ import annotations

from multiprocessing.connection import Connection

from app.cli.assembly import Described, Jointed, recognised
from app.cli.front import Outfit
from app.errors import ConfigurationError
from app.exchange.meshes import Meshes
from app.exchange.reachability_file import load_map
from app.exchange.scripts import Scripts
from app.exchange.urdf_mechanism import load_mechanism
from app.gateway.gateway import Gateway
from app.gateway.motion import Motion
from app.gateway.nodes import Nodes, body_of, machine_of
from app.runtime.link import FrontEnd
from app.runtime.navigator import Navigator
from app.settings import Settings
from app.view.follower import Follower
from app.view.machine_view import MachineView
from app.view.view import Besides, View


def attached(
    gateway: Gateway, outfit: Outfit, meshes: Meshes, pipe: Connection
) -> tuple[FrontEnd, Follower]:
    """The front's end of ``pipe``, and the view, neither running yet; ``gateway`` has the arm.

    ``meshes``: those that things are of. Raises ConfigurationError, EOFError.
    """
    settings, workspace = outfit.settings, outfit.workspace
    found = recognised(settings, outfit.urdf, outfit.tool)
    link = FrontEnd(pipe, found.session.check)
    if isinstance(found, Jointed):
        if workspace is not None:
            raise ConfigurationError(
                f"{workspace} maps where a tool can be. {found.machine.joints.why}"
            )
        return link, _machine(gateway, settings, found, link)
    stored = None if workspace is None else load_map(workspace)
    besides = Besides(stored, (gateway.steering, Scripts(settings.programs)), meshes)
    return link, _arm(gateway, outfit, found, link, besides)


def _arm(
    gateway: Gateway, outfit: Outfit, found: Described, link: FrontEnd, besides: Besides
) -> View:
    model, session, _ = found
    navigator = Navigator(session, link.board, link)
    frame_rate = outfit.settings.frame_rate
    view = View(gateway.viser, model, link.board, navigator, session, frame_rate, besides)
    navigator.tell = gateway.announce
    navigator.redirected = gateway.steering.redirected
    mechanism, _ = load_mechanism(outfit.urdf)
    nodes = Nodes(mechanism, body_of(model, mechanism), session.surroundings)
    gateway.attach(Motion(model, session, link, navigator, nodes, view.let_go))
    return view


def _machine(gateway: Gateway, settings: Settings, found: Jointed, link: FrontEnd) -> MachineView:
    machine, session, _ = found
    view = MachineView(gateway.viser, machine, link.board, link, settings.frame_rate)
    nodes = Nodes(machine.mechanism, machine_of(machine), session.surroundings)
    gateway.attach(Motion(machine, session, link, None, nodes, view.let_go))
    return view
