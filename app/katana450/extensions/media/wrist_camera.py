"""The camera on the hand: its place, and what it sees."""

from __future__ import annotations

import math

import numpy as np

from katana450.arm.control.session.session import Session
from katana450.arm.control.state.state import State
from katana450.arm.robot.robot import Robot
from katana450.errors import InputError
from katana450.extensions.hands.sides import PlacedBodies, sides_of
from katana450.extensions.media.picture import Camera
from katana450.maths.geometry import se3
from katana450.maths.geometry.arrays import FloatArray
from katana450.server.view.cameras import outward, triple

WRIST = "wrist"
"""Name of the view."""

FRAME = "camera_optical_frame"
"""End of the name of a link that is the frame of the camera, as in ROS: z ahead, x right, y down.
"""

FOV = math.radians(60.0)
"""[rad] Vertical field of view, as of small cameras with depth."""

GAP, MIN_BACK = 0.02, 0.08
"""[m] Distance of the camera from the hand, and its least distance behind the tool point."""


class WristCamera:
    """The camera on the hand of one arm."""

    def __init__(self, robot: Robot, session: Session) -> None:
        """Find its place: the frame of a link for it, or else a place beside the hand.

        Raises InputError for a robot without a hand.
        """
        self._robot, self._session = robot, session
        names = (link.name for link in robot.links if link.name.endswith(FRAME))
        self._link = next(names, None)
        self._T_palm_camera = np.eye(4) if self._link else beside_hand(robot, session)

    def of(self, state: State, size: tuple[int, int]) -> Camera:
        """Return the camera in ``state``, with pictures of ``size`` [px]."""
        if self._link is not None:
            T = self._robot.frames(self._robot.joint_values(state.q, state.gripper))[self._link]
        else:
            T = _palm(self._session, state.x) @ self._T_palm_camera
        p, forward, up = T[:3, 3], T[:3, 2], -T[:3, 1]
        return Camera(triple(p), triple(p + forward), FOV, size, triple(up))


def beside_hand(robot: Robot, session: Session) -> FloatArray:
    """Return the pose (4, 4) in the frame of the palm of a camera that looks at the tool point.

    It is behind the fingers and beside the plane in which they close, on the side that is up when
    the arm is ready, or away from its base if the hand points down then. Raises InputError.
    """
    hand, world = session.environment.hand, session.environment.bodies
    if robot.arm is None or hand is None or world is None:
        raise InputError(f"{robot.name} has no hand that could carry a camera. Take another view.")
    chain = robot.arm.chain
    R, point = hand.T_palm_tool[:3, :3], hand.T_palm_tool[:3, 3]
    forward = R @ outward(chain)
    try:
        across = sides_of(world, hand).y
    except InputError:
        across = R[:, int(np.abs(R.T @ forward).argmin())]
    up = np.cross(forward, across - (across @ forward) * forward)
    up /= np.linalg.norm(up)
    x = np.append(session.ready, hand.gripper.opened)
    T = _palm(session, x)
    out = (T @ (*point, 1.0))[:3] - robot.arm.T_base_shoulder[:3, 3]
    if (T[:3, :3] @ up) @ (0.5 * out[0], 0.5 * out[1], np.linalg.norm(out)) < 0.0:
        up = -up
    palm = [part for part in world.parts if part.mover == hand.palm]
    fingers = [part for part in world.parts if part.name in hand.fingers]
    bodies = PlacedBodies(world, [*palm, *fingers], hand.palm, hand.gripper.opened)
    height = max(bodies.reach(up) - float(up @ point), 0.0) + GAP
    face = PlacedBodies(world, palm, hand.palm, hand.gripper.opened) if palm else bodies
    back = max(float(forward @ point) - face.reach(forward) + GAP, MIN_BACK)
    offset = height * up - back * forward
    z = -offset / np.linalg.norm(offset)
    right = np.cross(z, up)
    right /= np.linalg.norm(right)
    return se3.from_rotation_translation(
        np.column_stack((right, np.cross(z, right), z)), point + offset
    )


def _palm(session: Session, x: FloatArray) -> FloatArray:
    """Return the pose (4, 4) of the palm in the base frame."""
    hand, world = session.environment.hand, session.environment.bodies
    assert hand is not None
    assert world is not None
    return np.asarray(world.linkage.poses(x)[hand.palm])
