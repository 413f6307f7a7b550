"""Named camera views, chosen for each browser separately."""

from __future__ import annotations

import threading

import numpy as np
import viser

from katana450.arm.control.state import State
from katana450.arm.robot.mounted_arm import MountedArm
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.forward import forward
from katana450.server.viser_bridge.presets import CAMERA_POSES, CameraPose, Preset

BEHIND, ABOVE, AHEAD = 0.34, 0.16, 0.12
"""Offsets [m] of the tool camera.

The camera is BEHIND and ABOVE the tool point and looks at the point AHEAD of it.
"""


class Cameras:
    """The cameras of all browsers. A camera on the tool follows it until another view is chosen."""

    def __init__(self, server: viser.ViserServer, arm: MountedArm) -> None:
        self._arm = arm
        self._riding: dict[int, viser.ClientHandle] = {}
        self._lock = threading.Lock()
        server.on_client_disconnect(self._forget)

    def give(self, client: viser.ClientHandle, preset: Preset, state: State) -> None:
        """Show ``client`` the arm from ``preset``."""
        with self._lock:
            self._riding.pop(client.client_id, None)
            if preset is Preset.TOOL:
                self._riding[client.client_id] = client
        _turn(client, camera_pose(preset, self._arm, state))

    def follow(self, state: State) -> None:
        """Move the cameras that are on the tool to where the tool of ``state`` is."""
        with self._lock:
            riding = list(self._riding.values())
        for client in riding:
            _turn(client, camera_pose(Preset.TOOL, self._arm, state))

    def _forget(self, client: viser.ClientHandle) -> None:
        with self._lock:
            self._riding.pop(client.client_id, None)


def camera_pose(preset: Preset, arm: MountedArm, state: State) -> CameraPose:
    """Return the camera pose of ``preset``; the tool camera depends on ``state``."""
    if preset is not Preset.TOOL:
        return CAMERA_POSES[preset]
    chain = arm.chain_to(state.tool)
    T = arm.T_base_shoulder @ forward(chain, state.q)
    p, x, z = T[:3, 3], T[:3, 0], np.array([0.0, 0.0, 1.0])
    # "Above" lies in the arm's plane and does not depend on the roll of the tool.
    up = z - (z @ x) * x
    size = float(np.linalg.norm(up))
    up = up / size if size > MIN_UP_SINE else -T[:3, 2]
    return CameraPose(_triple(p - BEHIND * x + ABOVE * up), _triple(p + AHEAD * x))


MIN_UP_SINE = 0.05
"""Sine of the angle between tool axis and vertical below which the tool's own axis gives "up"."""


def _turn(client: viser.ClientHandle, look: CameraPose) -> None:
    with client.atomic():
        client.camera.up_direction = (0.0, 0.0, 1.0)
        client.camera.position = look.position
        client.camera.look_at = look.target


def _triple(p: FloatArray) -> tuple[float, float, float]:
    x, y, z = p.tolist()
    return x, y, z
