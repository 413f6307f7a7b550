"""The conduit that carries the arm's cables from link to link, as curves between its fittings.

Each stretch hangs between two links with one joint between them. It is a cubic curve, straight
where it leaves a fitting, so its shape depends on the angle of that joint alone. In the scene it is
drawn as rings along its curves, instances of one mesh.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from katana450.arm.control.state.state import State
from katana450.arm.robot.link import Joint
from katana450.arm.robot.robot import Robot
from katana450.errors import InputError, RobotDescriptionError
from katana450.maths.geometry import se3
from katana450.maths.geometry.arrays import FloatArray, finite_array
from katana450.server.view.layer import LayerContext, ViewLayer
from katana450.server.view.scene import Colour
from katana450.server.viser_bridge.posing import arrange

CONDUITS = "conduits.json"
"""File beside the URDF that describes where the conduit is held."""

FULLNESS, WOUND_FULLNESS = 1.6, 0.5
"""[1] Length of the tangents at both ends of a curve, relative to that of the conduit at rest: of
one that hangs, and of one that lies around the axis of its joint. With these the arm's own bodies
stay clear, and a curve is longer or shorter than at rest by less than a quarter: the ribs give by
as much.
"""

MIN_WOUND = 0.85
"""[1] Length around an axis, relative to that at rest, below which the conduit bulges outwards."""

PARAMETERS = np.linspace(0.0, 1.0, 49)
"""Parameters of the points of a curve, which are nearer to each other than the ribs."""


@dataclass(frozen=True, eq=False)
class End:
    """The fixed end of a stretch: point (3,) [m] and unit tangent (3,) in the frame of a link."""

    link: str
    point: FloatArray
    tangent: FloatArray


@dataclass(frozen=True, eq=False)
class ConduitStretch:
    """One free run of conduit.

    Attributes:
        start, end: its ends; the tangents lead from the first to the second.
        radius, length: [m], the length at rest.
        joint: the joint between the two links.
        T_start_joint: (4, 4) from the first link's frame to the joint's at zero [m].
        T_joint_end: (4, 4) from the joint's frame to the second link's [m].
        winds: whether the conduit lies around the axis of that joint.
    """

    start: End
    end: End
    radius: float
    length: float
    joint: Joint
    T_start_joint: FloatArray
    T_joint_end: FloatArray
    winds: bool

    def course(self, angle: float, count: int) -> tuple[FloatArray, FloatArray]:
        """Return ``count`` points (n, 3) [m] evenly along the stretch, and unit tangents (n, 3).

        They are for the ``angle`` [rad] of its joint, in the frame of the first end's link.
        """
        T = self.T_start_joint @ self.joint.motion(angle) @ self.T_joint_end
        point, tangent = T[:3, :3] @ self.end.point + T[:3, 3], T[:3, :3] @ self.end.tangent
        curve = (
            self._wound(point, tangent, angle)
            if self.winds
            else _cubic(
                self.start.point, self.start.tangent, point, tangent, FULLNESS * self.length
            )
        )
        steps = np.diff(curve, axis=0)
        sizes = np.linalg.norm(steps, axis=1)
        along = np.concatenate(([0.0], np.cumsum(sizes)))
        places = along[-1] * (np.arange(count) + 0.5) / count
        # Interpolate between the middles of pieces; otherwise the ribs tilt where pieces meet.
        tangents = _interpolated(places, along[:-1] + 0.5 * sizes, steps)
        tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
        return _interpolated(places, along, curve), tangents

    def _wound(self, point: FloatArray, tangent: FloatArray, angle: float) -> FloatArray:
        """Return the curve around the joint's axis: a plain one in radius, arc and height.

        ``point``, ``tangent``: those of the second end at the ``angle`` of the joint.
        """
        frame = _frame_along(self.T_start_joint[:3, :3] @ self.joint.axis)
        origin = self.T_start_joint[:3, 3]

        def unrolled(point: FloatArray, tangent: FloatArray) -> tuple[FloatArray, FloatArray]:
            (x, y, z), (u, v, w) = (point - origin) @ frame, tangent @ frame
            r = math.hypot(x, y)
            place = np.array((r, math.atan2(y, x), z))
            return place, np.array(((x * u + y * v) / r, (x * v - y * u) / r, w))

        first, first_tangent = unrolled(self.start.point, self.start.tangent)
        last, last_tangent = unrolled(point, tangent)
        # The angle follows that of the joint for more than half a turn in both directions.
        last[1] = angle + first[1] + math.remainder(last[1] - angle - first[1], math.tau)
        mean = first[0]
        first[1], last[1] = mean * first[1], mean * last[1]
        size = WOUND_FULLNESS * self.length
        r, arc, z = _cubic(first, first_tangent, last, last_tangent, size).T
        # What is left of its length makes it bulge outwards.
        slack = max(MIN_WOUND * self.length - math.dist(first, last), 0.0)
        r = r + slack * (4.0 * PARAMETERS * (1.0 - PARAMETERS)) ** 2
        phi = arc / mean
        return np.asarray(origin + np.column_stack((r * np.cos(phi), r * np.sin(phi), z)) @ frame.T)


def _cubic(p: FloatArray, a: FloatArray, q: FloatArray, b: FloatArray, size: float) -> FloatArray:
    """Return points (k, 3) of the cubic from p to q whose tangents a and b have the ``size``."""
    t = PARAMETERS[:, None]
    return np.asarray(
        (1.0 - t) ** 2 * ((1.0 + 2.0 * t) * p + t * size * a)
        + t**2 * ((3.0 - 2.0 * t) * q - (1.0 - t) * size * b)
    )


def _interpolated(places: FloatArray, along: FloatArray, rows: FloatArray) -> FloatArray:
    """Return ``rows`` (k, 3), which are at ``along`` (k,), at ``places`` (n,)."""
    return np.column_stack([np.interp(places, along, column) for column in rows.T])


def _frame_along(axis: FloatArray) -> FloatArray:
    """Return a rotation matrix (3, 3) whose z axis is along ``axis``."""
    x = np.eye(3)[int(np.abs(axis).argmin())]
    y = np.cross(axis, x)
    y /= np.linalg.norm(y)
    return np.stack((np.cross(y, axis), y, axis), axis=1)


def stretches_of(robot: Robot) -> tuple[ConduitStretch, ...]:
    """Return the stretches in the file CONDUITS beside that of ``robot``; none without such a file.

    The file is JSON with lengths in m. Raises RobotDescriptionError if it is invalid or describes
    another arm.
    """
    path = None if robot.path is None else robot.path.parent / CONDUITS
    if path is None or not path.is_file():
        return ()
    try:
        described = json.loads(path.read_text(encoding="utf-8"))["conduits"]
        return tuple(_stretch(robot, element) for element in described)
    except (InputError, KeyError, TypeError, ValueError) as error:
        raise RobotDescriptionError(f"{path} does not describe conduits: {error!r}.") from error


def _stretch(robot: Robot, element: Any) -> ConduitStretch:
    start, end = (
        End(
            str(one["link"]),
            finite_array(one["point"], (3,), "The point of a conduit"),
            finite_array(one["tangent"], (3,), "The tangent of a conduit"),
        )
        for one in element["ends"]
    )
    radius, length = float(element["radius"]), float(element["length"])
    if not 0.0 < radius < length < math.inf:
        raise ValueError(f"the radius {radius} m is not between 0 and the length {length} m")
    arm, links = robot.require_arm(), {link.name: link for link in robot.links}
    path = robot.path_to(links[end.link])
    between = path[path.index(links[start.link]) + 1 :]
    (driven,) = (
        link for link in between if link.joint is not None and link.joint.name in arm.chain.names
    )
    joint, rest = driven.joint, robot.frames(arm.resting)
    assert joint is not None
    return ConduitStretch(
        start,
        end,
        radius,
        length,
        joint,
        T_start_joint=se3.inverse(rest[start.link]) @ rest[driven.name],
        T_joint_end=se3.inverse(rest[driven.name]) @ rest[end.link],
        winds=element["winds"] == joint.name,
    )


Floats = npt.NDArray[np.float32]

RUBBER: Colour = (4, 4, 5)
"""Linear colour, not sRGB as elsewhere: viser expects linear colours for instances."""

PITCH = 4.2e-3
"""Distance [m] between two ribs."""

PROFILE = ((-0.62, 0.84), (-0.3, 0.92), (0.0, 1.0), (0.3, 0.92), (0.62, 0.84))
"""Cross section of a ring as (along, out), fractions of pitch and radius.

Neighbouring rings overlap, so that no gap opens in a bend.
"""

SIDES = 14
"""Corners of a ring."""

ANGLE_WORTH_SENDING = 2e-3
"""Smallest change [rad] that is sent. It moves a rib by less than a third of a millimetre."""


class ConduitLayer(ViewLayer):
    """The conduit as a layer of the scene. Each stretch is a child of the link it starts from."""

    def attach(self, context: LayerContext) -> None:
        """Add the rings. Raises RobotDescriptionError for an invalid description of the conduit."""
        self._robot = context.robot
        self._stretches = stretches_of(context.robot)
        self._angles = [0.0] * len(self._stretches)
        self._nodes = []
        for number, stretch in enumerate(self._stretches):
            rings = poses(stretch, 0.0)
            node = context.server.scene.add_batched_meshes_simple(
                f"{context.arm.path[stretch.start.link]}/conduit{number}",
                *ring(stretch.radius),
                rings[:, :4],
                rings[:, 4:],
                batched_colors=RUBBER,
                lod="off",
            )
            self._nodes.append(node)

    def follow(self, state: State) -> None:
        """Bend the conduit as the joints of ``state`` do. Only changed stretches are sent."""
        angles = self._robot.joint_values(state.q, state.gripper)
        for number, stretch in enumerate(self._stretches):
            angle = angles[stretch.joint.name]
            if abs(angle - self._angles[number]) > ANGLE_WORTH_SENDING:
                self._angles[number] = angle
                rings = poses(stretch, angle)
                arrange(self._nodes[number], rings[:, :4], rings[:, 4:])


def poses(stretch: ConduitStretch, angle: float) -> Floats:
    """Return the poses (n, 7) of the rings at the ``angle`` [rad]: wxyz and position [m].

    A ring looks the same however it is turned about the conduit.
    """
    points, tangents = stretch.course(angle, round(stretch.length / PITCH))
    # The shortest turn of the x axis to each tangent; to the opposite one half a turn about z.
    wxyz = np.zeros((len(tangents), 4))
    wxyz[:, 0], wxyz[:, 2:] = 1.0 + tangents[:, 0], tangents[:, :0:-1] * (-1.0, 1.0)
    wxyz[wxyz[:, 0] < BACKWARD] = (0.0, 0.0, 0.0, 1.0)
    wxyz /= np.linalg.norm(wxyz, axis=1, keepdims=True)
    return np.concatenate((wxyz, points), axis=1, dtype=np.float32)


BACKWARD = 1e-9
"""Bound of 1 + cos(angle) below which two unit vectors count as opposite."""


def ring(radius: float) -> tuple[FloatArray, npt.NDArray[Any]]:
    """Return vertices (n, 3) [m] and faces (m, 3) of a rib about the x axis."""
    turn = np.arange(SIDES) * (math.tau / SIDES)
    circle = np.stack((np.zeros(SIDES), np.cos(turn), np.sin(turn)), axis=1)
    rows = [np.array([along * PITCH, 0.0, 0.0]) + out * radius * circle for along, out in PROFILE]
    first = np.arange(SIDES)
    second = (first + 1) % SIDES
    faces = []
    for row in range(len(PROFILE) - 1):
        a, b = row * SIDES, (row + 1) * SIDES
        faces.append(np.stack((a + first, a + second, b + second), axis=1))
        faces.append(np.stack((a + first, b + second, b + first), axis=1))
    return np.concatenate(rows), np.concatenate(faces)
