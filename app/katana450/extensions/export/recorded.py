"""A run as a single HTML file, which contains viser's client and all its data."""

from __future__ import annotations

import secrets
from collections.abc import Iterable

from katana450.arm.control.session import Session
from katana450.arm.control.state import State
from katana450.arm.robot.object_meshes import Meshes
from katana450.arm.robot.props import load_props
from katana450.arm.robot.robot import Robot
from katana450.server.view.controls import NoGestures
from katana450.server.view.scenery import Scenery
from katana450.server.view.traces import Traces
from katana450.server.viser_bridge.recording_page import titled
from katana450.server.viser_bridge.viser_server import close_server, open_server


def recorded(
    robot: Robot, session: Session, states: Iterable[State], interval: float, title: str
) -> str:
    """Return HTML that shows ``states``, ``interval`` [s] apart, with a slider for the time.

    A caption in it has the ``title`` and the duration.
    """
    # The key is secret, so no client connects: only the messages of the server are used.
    server = open_server(secrets.token_hex())
    try:
        scenery = Scenery(server, robot, session, load_props(), NoGestures(), Meshes())
        traces = Traces(server, robot.require_arm())
        recording = server.get_scene_serializer()
        number = 0
        for number, state in enumerate(states):
            if number:
                recording.insert_sleep(interval)
            scenery.show(state)
            traces.follow(state)
        caption = f"{title}, {number * interval:.1f} s" if number else title
        return titled(recording.as_html(), title, caption)
    finally:
        close_server(server)
