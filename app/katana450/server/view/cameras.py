"""Named camera views, chosen for each browser separately."""

from __future__ import annotations

import itertools
import math
import threading
from collections.abc import Callable
from typing import Any

import numpy as np
import viser

from katana450.arm.control.state.state import State
from katana450.arm.robot.initial_camera import VIEW_DIRECTION, InitialCamera, camera, fitted
from katana450.arm.robot.robot import Robot
from katana450.maths.geometry import screws, so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward
from katana450.server.viser_bridge.presets import CAMERA_POSES, CameraPose, Preset
from katana450.settings import Settings

BEHIND, ABOVE, AHEAD = 0.34, 0.16, 0.12
"""Offsets [m] of the tool camera, for a robot of the size of the Katana450.

The camera is BEHIND and ABOVE the tool point and looks at the point AHEAD of it.
"""


SIZE = 1.831
"""[m] Diagonal of the bounds of the Katana450, for which the named views are made."""

RING_WIDTH = 0.3
"""[1] Ratio of width to length from which on a circle is seen as one."""

TURNS_DEG, SLOPES = (0.0, 15.0, -15.0, 30.0, -30.0, 45.0, -45.0), (1.0, 0.6, 1.8)
"""Turns about the vertical and slopes of the first camera, the preferred ones first.

The slopes are multiples of that of ``VIEW_DIRECTION``.
"""

SIMILAR = 0.1
"""[1] Difference in size below which a robot has the views of the Katana450 as they are."""


class Cameras:
    """The cameras of all browsers. A camera on the tool follows it until another view is chosen."""

    def __init__(self, server: viser.ViserServer, robot: Robot) -> None:
        self._robot = robot
        self._riding: dict[int, viser.ClientHandle] = {}
        self._lock = threading.Lock()
        server.on_client_disconnect(self._forget)

    def add_buttons(self, gui: viser.GuiApi, current: Callable[[], State]) -> None:
        """Add the buttons of the views. A click changes only its own browser.

        The view cube of the page presses them, so the panel does not show them. ``current`` returns
        the newest state.
        """
        names = tuple(preset.value for preset in Preset)
        views = gui.add_button_group("View", names, visible=False)

        @views.on_click
        def _(event: viser.GuiEvent[Any]) -> None:
            if event.client is not None:
                self.give(event.client, Preset(views.value), current())

    def give(self, client: viser.ClientHandle, preset: Preset, state: State) -> None:
        """Show ``client`` the arm from ``preset``."""
        with self._lock:
            self._riding.pop(client.client_id, None)
            if preset is Preset.TOOL:
                self._riding[client.client_id] = client
        _turn(client, camera_pose(preset, self._robot, state))

    def follow(self, state: State) -> None:
        """Move the cameras that are on the tool to where the tool of ``state`` is."""
        with self._lock:
            riding = list(self._riding.values())
        for client in riding:
            _turn(client, camera_pose(Preset.TOOL, self._robot, state))

    def _forget(self, client: viser.ClientHandle) -> None:
        with self._lock:
            self._riding.pop(client.client_id, None)


def camera_pose(preset: Preset, robot: Robot, state: State) -> CameraPose:
    """Return the camera pose of ``preset`` for ``robot``.

    The tool camera depends on ``state``. A robot without an arm has none: it is shown as by FREE.
    """
    if preset is not Preset.TOOL or robot.arm is None:
        return fixed_pose(Preset.FREE if preset is Preset.TOOL else preset, robot)
    arm = robot.arm
    chain = arm.chain_to(state.tool)
    T = arm.T_base_shoulder @ forward(chain, state.q)
    out = outward(chain)
    p, x, z = T[:3, 3], T[:3, :3] @ out, np.array([0.0, 0.0, 1.0])
    # "Above" lies in the arm's plane and does not depend on the roll of the tool.
    up = z - (z @ x) * x
    size = float(np.linalg.norm(up))
    up = up / size if size > MIN_UP_SINE else -T[:3, 2 if abs(out[2]) < ALONG else 1]
    scale = scale_of(robot)
    behind, above, distance = scale * BEHIND, scale * ABOVE, scale * AHEAD
    return CameraPose(triple(p - behind * x + above * up), triple(p + distance * x))


def outward(chain: Chain) -> FloatArray:
    """Return the unit vector (3,) in the frame of the tool in which the tool points.

    It is that of the last axis, away from the axis before it; x if that is not along the tool.
    """
    before, last = chain.S[:3, -2], chain.S[:3, -1]
    out = chain.M[:3, 3] - screws.point_on(chain.S[:, -2])
    out -= (out @ before) * before
    along = float(last @ out)
    if abs(along) < ALONG * float(np.linalg.norm(out)):
        return np.array((1.0, 0.0, 0.0))
    return np.asarray(chain.M[:3, :3].T @ (math.copysign(1.0, along) * last))


def fixed_pose(preset: Preset, robot: Robot) -> CameraPose:
    """Return the pose of ``preset``, which is not TOOL, with all of a robot of another size."""
    look = CAMERA_POSES[preset]
    if scale_of(robot) == 1.0:
        return look
    corners = np.array(list(itertools.product(*np.transpose(robot.bounds).tolist())))
    whole = fitted(corners, np.subtract(look.target, look.position))
    return CameraPose(triple(whole.eye), triple(whole.target))


def initial_camera(robot: Robot) -> InitialCamera | None:
    """Return the first camera of a page; None for that of the Katana450 and arms like it.

    It is the first of several that sees no ring of the tool, in the posture in which the arm
    starts, as a line; otherwise the one that sees them best.
    """
    arm = robot.arm
    if arm is None:
        return camera(robot)
    if arm.kinematics.is_pitched and scale_of(robot) == 1.0:
        return None
    T = arm.T_base_shoulder @ forward(arm.chain, arm.ready(Settings.ready))
    axes = T[:3, :2] if arm.kinematics.is_pitched else T[:3, :3]

    def width(look: InitialCamera) -> float:
        """Return the ratio of width to length of the narrowest ring in the picture."""
        ray = T[:3, 3] - look.eye
        return min(float(np.abs(ray @ axes).min() / np.linalg.norm(ray)), RING_WIDTH)

    turns = [so3.rotation_z(math.radians(angle)) for angle in TURNS_DEG]
    x, y, z = VIEW_DIRECTION
    directions = [turn @ (x, y, slope * z) for slope in SLOPES for turn in turns]
    return max((camera(robot, direction) for direction in directions), key=width)


def scale_of(robot: Robot) -> float:
    """Return the size of ``robot`` as a multiple of that of the Katana450; 1 for a similar one."""
    low, high = robot.bounds
    scale = float(np.linalg.norm(high - low)) / SIZE
    return scale if abs(scale - 1.0) > SIMILAR else 1.0


ALONG = 0.5
"""Cosine of the angle of an axis to a direction from which on it is along it."""

MIN_UP_SINE = 0.05
"""Sine of the angle between tool axis and vertical below which the tool's own axis gives "up"."""


def _turn(client: viser.ClientHandle, look: CameraPose) -> None:
    with client.atomic():
        client.camera.up_direction = (0.0, 0.0, 1.0)
        client.camera.position = look.position
        client.camera.look_at = look.target


def triple(p: FloatArray) -> tuple[float, float, float]:
    """Return the three numbers of ``p`` (3,)."""
    x, y, z = p.tolist()
    return x, y, z
