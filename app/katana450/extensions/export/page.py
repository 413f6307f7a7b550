"""A page that plays states of an arm without a server."""

from __future__ import annotations

import secrets
from collections.abc import Callable, Iterable

import viser

from katana450.arm.control.session.session import Session
from katana450.arm.control.state.state import State
from katana450.arm.robot.object_meshes import Meshes
from katana450.arm.robot.props import load_props
from katana450.arm.robot.robot import Robot
from katana450.extensions.conduit import ConduitLayer
from katana450.extensions.programs.server.traces import TracesLayer
from katana450.extensions.water import WaterLayer
from katana450.server.view.cameras import fixed_pose
from katana450.server.view.controls import NoGestures
from katana450.server.view.scenery import Scenery
from katana450.server.viser_bridge.presets import Preset
from katana450.server.viser_bridge.recording_page import titled
from katana450.server.viser_bridge.viser_server import close_server, open_server

FPS = 25.0
"""States per second in the page; states between them are left out."""


def recorded(
    robot: Robot, session: Session, states: Iterable[State], interval: float, title: str
) -> str:
    """Return HTML that shows ``states``, ``interval`` [s] apart, with a slider for the time.

    A caption in it has the ``title`` and the duration.
    """
    # The key is secret, so no client connects: only the messages of the server are used.
    server = open_server(secrets.token_hex())
    try:
        show = _scene(server, robot, session)
        look, camera = fixed_pose(Preset.FREE, robot), server.initial_camera
        camera.position, camera.look_at = look.position, look.target
        recording = server.get_scene_serializer()
        number = 0
        for number, state in enumerate(states):
            if number:
                recording.insert_sleep(interval)
            show(state)
        caption = f"{title}, {number * interval:.1f} s" if number else title
        return titled(recording.as_html(), title, caption)
    finally:
        close_server(server)


def _scene(server: viser.ViserServer, robot: Robot, session: Session) -> Callable[[State], None]:
    """Build the scene of ``robot``; return what shows a state in it."""
    layers = () if robot.arm is None else (ConduitLayer(), WaterLayer(), TracesLayer())
    return Scenery(server, robot, session, load_props(), NoGestures(), Meshes(), layers).show
