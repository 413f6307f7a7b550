"""Where to look from: named views for one browser at a time."""

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
"""[m] Where the camera rides on the tool, and how far ahead of the tool point it looks."""


class Cameras:
    """Turns cameras; a browser that rides on the tool does so until it is given another view."""

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
        """Take the cameras that ride on the tool along."""
        with self._lock:
            riding = list(self._riding.values())
        for client in riding:
            _turn(client, camera_pose(Preset.TOOL, self._arm, state))

    def _forget(self, client: viser.ClientHandle) -> None:
        with self._lock:
            self._riding.pop(client.client_id, None)


def camera_pose(preset: Preset, arm: MountedArm, state: State) -> CameraPose:
    """The view that ``preset`` is of an arm in ``state``."""
    if preset is not Preset.TOOL:
        return CAMERA_POSES[preset]
    chain = arm.chain_to(state.tool)
    T = arm.T_base_shoulder @ forward(chain, state.q)
    p, x, z = T[:3, 3], T[:3, 0], np.array([0.0, 0.0, 1.0])
    # Above in the arm's plane, however the tool is rolled.
    up = z - (z @ x) * x
    size = float(np.linalg.norm(up))
    up = up / size if size > MIN_UP_SINE else -T[:3, 2]
    return CameraPose(_triple(p - BEHIND * x + ABOVE * up), _triple(p + AHEAD * x))


MIN_UP_SINE = 0.05
"""The tool upright: up in its plane is no longer told by gravity."""


def _turn(client: viser.ClientHandle, look: CameraPose) -> None:
    with client.atomic():
        client.camera.up_direction = (0.0, 0.0, 1.0)
        client.camera.position = look.position
        client.camera.look_at = look.target


def _triple(p: FloatArray) -> tuple[float, float, float]:
    x, y, z = p.tolist()
    return x, y, z
