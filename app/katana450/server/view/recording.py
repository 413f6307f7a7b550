"""A run as a page of its own: viser's client and all it has to show, in one file."""

from __future__ import annotations

import html
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
from katana450.server.viser_bridge.viser_server import close_server, open_server

TITLE = "<title>Viser</title>"
"""Of viser's page."""

CLEAR = "<style>canvas { opacity: 1 !important }</style>"
"""viser draws faintly until the light of the room is loaded. Where drawing takes as long as that it
loses count and leaves the picture faint for good; and in a recording it loads again each time."""

KEEP_LIGHT = """<script>{
  const append = document.head.appendChild;
  document.head.appendChild = function (node) {
    if (node.type === 'module') {
      delete document.head.appendChild;
      const reset = /[\\w$]+\\.useEnvironment\\.set\\([\\w$]+\\(\\)\\)/;
      node.textContent = node.textContent.replace(reset, 'void 0');
    }
    return append.call(this, node);
  };
}</script>"""
"""Leaves the light of the room alone when somebody seeks backwards, and when the run begins anew.

viser's player puts back its own environment map before it plays the messages from the start. Ours
is then decoded again, and the scene is nearly black until that is done. The program of viser's
page is unpacked in the browser, so it is changed there, on its way into the page.
"""


def recorded(
    robot: Robot, session: Session, states: Iterable[State], interval: float, title: str
) -> str:
    """HTML that shows ``states``, ``interval`` [s] apart, with a slider of the time."""
    # Nobody is let in: the server is there for what it would send.
    server = open_server(secrets.token_hex())
    try:
        scenery = Scenery(server, robot, session, load_props(), NoGestures(), Meshes())
        traces = Traces(server, robot.require_arm())
        recording = server.get_scene_serializer()
        for number, state in enumerate(states):
            if number:
                recording.insert_sleep(interval)
            scenery.show(state)
            traces.follow(state)
        head = f"<title>{html.escape(title)}</title>{CLEAR}{KEEP_LIGHT}"
        return recording.as_html().replace(TITLE, head, 1)
    finally:
        close_server(server)
