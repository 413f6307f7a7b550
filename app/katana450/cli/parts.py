"""What the front shows and steers: a view and the arm as its gateway sees it, put together."""

from __future__ import annotations

from multiprocessing.connection import Connection

from katana450.cli.assembly import Described, Jointed, recognised
from katana450.cli.front import Outfit
from katana450.errors import ConfigurationError
from katana450.exchange.meshes import Meshes
from katana450.exchange.reachability_file import load_map
from katana450.exchange.scripts import Scripts
from katana450.exchange.urdf_mechanism import load_mechanism
from katana450.gateway.gateway import Gateway
from katana450.gateway.motion import Motion
from katana450.gateway.nodes import Nodes, body_of, machine_of
from katana450.runtime.link import FrontEnd
from katana450.runtime.navigator import Navigator
from katana450.settings import Settings
from katana450.view.follower import Follower
from katana450.view.machine_view import MachineView
from katana450.view.view import Besides, View


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
