"""The conduit that carries the cables of an arm from link to link, in the scene and in pictures.

Each stretch hangs free between two fittings on links. It is a cubic between them, whose tangents
are as long as its length demands, drawn as rings along it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any

import msgspec
import numpy as np
import numpy.typing as npt

from katana450.arm.control.state.state import State
from katana450.arm.robot.robot import Robot
from katana450.errors import RobotDescriptionError
from katana450.maths.geometry import se3
from katana450.maths.geometry.arrays import FloatArray
from katana450.server.view.layer import LayerContext, ViewLayer
from katana450.server.view.scene import Colour
from katana450.server.viser_bridge.posing import arrange

CONDUITS = "conduits.json"
"""File beside the URDF that describes where the conduit is held."""

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

CHANGE_WORTH_SENDING = 2e-3
"""Smallest change [rad] that is sent. It moves a rib by less than a third of a millimetre."""

TANGENTS, BULGES = (
    np.linspace(0.3, 4.0, 14)[:, None, None],
    np.linspace(0.0, 1.0, 14)[:, None, None],
)
"""[1] Lengths of the tangents at the ends, and bulges of the middle, that are tried to find a curve
of the right length, as multiples of that length."""

WOUND_TANGENT = 0.5
"""[1] Length of the tangents at the ends of a stretch around an axis, a multiple of its length."""

POINTS = 49
"""Points of a curve. A piece between two is about as long as the distance of the ribs."""

STRETCH_FRACTION = 0.25
"""Fraction of its length by which a conduit around an axis is compressed by its ribs."""

Length = Annotated[float, msgspec.Meta(gt=0.0)]


class End(msgspec.Struct, frozen=True):
    """The fixed end of a stretch.

    Attributes:
        link: name of the link that holds it.
        point: in the frame of the link [m].
        tangent: unit vector in the frame of the link, from the first end to the second.
    """

    link: str
    point: tuple[float, float, float]
    tangent: tuple[float, float, float]


class ConduitStretch(msgspec.Struct, frozen=True):
    """One free run of conduit.

    Attributes:
        ends: its ends.
        radius, length: [m], the length at rest.
        winds: name of the joint around whose axis it lies, or None. Its ribs are then stretched
            and compressed.
    """

    ends: tuple[End, End]
    radius: Length
    length: Length
    winds: str | None = None

    @property
    def start(self) -> str:
        """Name of the link in whose frame the curve is."""
        return self.ends[0].link

    @property
    def count(self) -> int:
        """Number of rings."""
        return round(self.length / PITCH)

    def curve(
        self, robot: Robot, values: Mapping[str, float], frames: Mapping[str, FloatArray]
    ) -> FloatArray:
        """Return POINTS points (n, 3) [m] of the conduit, in the frame of the first end's link.

        Args:
            robot: the robot.
            values: value of each joint [rad or m].
            frames: pose (4, 4) of each link with these values [m].
        """
        T_start_base = se3.inverse(frames[self.start])
        (p, a), (q, b) = (
            (T[:3, :3] @ end.point + T[:3, 3], T[:3, :3] @ end.tangent)
            for end in self.ends
            for T in (T_start_base @ frames[end.link],)
        )
        if self.winds is None:
            chord, tangents = _cubic(p, a, q, b)
            return _of_length(self.length, chord + TANGENTS * self.length * tangents)
        link = next(
            link for link in robot.links if link.joint is not None and link.joint.name == self.winds
        )
        assert link.joint is not None
        T = T_start_base @ frames[link.name]
        return self._wound(p, a, q, b, T[:3, 3], T[:3, :3] @ link.joint.axis, values[self.winds])

    def _wound(
        self,
        p: FloatArray,
        a: FloatArray,
        q: FloatArray,
        b: FloatArray,
        origin: FloatArray,
        axis: FloatArray,
        angle: float,
    ) -> FloatArray:
        """Return a curve around ``axis`` through ``origin``: a cubic in radius, arc and height."""
        x = np.eye(3)[int(np.abs(axis).argmin())]
        y = np.cross(axis, x) / np.linalg.norm(np.cross(axis, x))
        frame = np.stack((np.cross(y, axis), y, axis), axis=1)
        mean = math.hypot(*((p - origin) @ frame)[:2])

        def unrolled(point: FloatArray, tangent: FloatArray) -> tuple[FloatArray, FloatArray]:
            (u, v, z), (du, dv, dz) = (point - origin) @ frame, tangent @ frame
            r = math.hypot(u, v)
            arc = mean * math.atan2(v, u)
            return np.array((r, arc, z)), np.array((u * du + v * dv, u * dv - v * du, r * dz)) / r

        (first, lead), (last, end_lead) = unrolled(p, a), unrolled(q, b)
        # The arc follows the angle of the joint for more than half a turn in both directions.
        turn = mean * math.tau
        excess = last[1] - mean * angle - first[1]
        last[1] -= turn * round(excess / turn)
        chord, tangents = _cubic(first, lead, last, end_lead)
        smooth = chord + WOUND_TANGENT * self.length * tangents
        curves = smooth + BULGES * self.length * BUMP * np.array((1.0, 0.0, 0.0))
        r, phi, z = curves[..., 0], curves[..., 1] / mean, curves[..., 2]
        rolled = origin + np.stack((r * np.cos(phi), r * np.sin(phi), z), -1) @ frame.T
        return _of_length((1.0 - STRETCH_FRACTION) * self.length, rolled)


T = np.linspace(0.0, 1.0, POINTS)[:, None]
"""[1] Fractions (n, 1) of the way from the first end to the last."""

BUMP = 16.0 * (T * (1.0 - T)) ** 2
"""[1] Share (n, 1) of each point in a bulge of the middle."""


def _cubic(
    p: FloatArray, a: FloatArray, q: FloatArray, b: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the points (n, 3) between p and q, and what unit tangents a and b add to them."""
    return p + (3.0 - 2.0 * T) * T**2 * (q - p), T * (1.0 - T) * ((1.0 - T) * a - T * b)


def _of_length(length: float, curves: FloatArray) -> FloatArray:
    """Return the curve (n, 3) of ``length`` [m] between those of ``curves`` (k, n, 3).

    It is the shortest or the longest of them if none is as long.
    """
    lengths = np.linalg.norm(np.diff(curves, axis=1), axis=2).sum(axis=1)
    first = int(lengths.argmin())
    place = float(np.interp(length, lengths[first:], np.arange(first, len(lengths))))
    low = min(int(place), len(curves) - 2)
    return np.asarray(curves[low] + (place - low) * (curves[low + 1] - curves[low]))


def rings_along(curve: FloatArray, count: int) -> FloatArray:
    """Return the poses (count, 7), wxyz and position [m], of rings evenly along a curve (n, 3)."""
    ends = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(curve, axis=0), axis=1)))
    places = np.interp((np.arange(count) + 0.5) * ends[-1] / count, ends, np.arange(len(curve)))
    low = places.astype(int)
    nodes = np.hstack((curve, np.gradient(curve, axis=0)))
    points, along = np.hsplit(nodes[low] + (places - low)[:, None] * np.diff(nodes, axis=0)[low], 2)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    # The shortest turn of the x axis onto each tangent (1, x) -> (1 + x @ t, x cross t).
    wxyz = np.stack((1.0 + along[:, 0], 0.0 * along[:, 0], -along[:, 2], along[:, 1]), axis=1)
    # Of all possible half turns onto -x, the one about z.
    wxyz[wxyz[:, 0] < BACKWARD] = (0.0, 0.0, 0.0, 1.0)
    return np.hstack((wxyz / np.linalg.norm(wxyz, axis=1, keepdims=True), points))


BACKWARD = 1e-9
"""Bound of 1 + cos(angle) below which a tangent counts as opposite to the x axis."""


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


class _Described(msgspec.Struct):
    """The file CONDUITS."""

    conduits: tuple[ConduitStretch, ...]


def stretches_of(robot: Robot) -> tuple[ConduitStretch, ...]:
    """Return the stretches in the file CONDUITS beside that of ``robot``; none without such a file.

    Raises RobotDescriptionError if the file is invalid or describes another arm.
    """
    if robot.path is None or not (path := robot.path.parent / CONDUITS).is_file():
        return ()
    links = {link.name for link in robot.links}
    try:
        stretches = msgspec.json.decode(path.read_bytes(), type=_Described).conduits
        for stretch in stretches:
            if stretch.radius >= stretch.length:
                raise ValueError(
                    f"the radius {stretch.radius} m is not below the length {stretch.length} m"
                )
            for end in stretch.ends:
                if end.link not in links:
                    raise ValueError(f"there is no link {end.link}")
            if stretch.winds is not None and stretch.winds not in robot.joints:
                raise ValueError(f"there is no joint {stretch.winds}")
    except ValueError as error:
        raise RobotDescriptionError(f"{path} does not describe conduits: {error}") from error
    return stretches


class ConduitLayer(ViewLayer):
    """The conduit as a layer of the scene, without controls.

    Each stretch is a child of the link it starts from. Only changed stretches are sent.
    """

    def attach(self, context: LayerContext) -> None:
        """Add the rings. Raises RobotDescriptionError."""
        self._robot = robot = context.robot
        self._stretches = stretches_of(robot)
        values = robot.every({})
        frames = robot.frames(values)
        self._poses = [self._pose(stretch, frames) for stretch in self._stretches]
        self._nodes = []
        for number, stretch in enumerate(self._stretches):
            rings = rings_along(stretch.curve(robot, values, frames), stretch.count)
            node = context.server.scene.add_batched_meshes_simple(
                f"{context.arm.path[stretch.start]}/conduit{number}",
                *ring(stretch.radius),
                rings[:, :4].astype(np.float32),
                rings[:, 4:].astype(np.float32),
                batched_colors=RUBBER,
                lod="off",
            )
            self._nodes.append(node)

    def follow(self, state: State) -> None:
        """Bend the conduit as the joints of ``state`` do."""
        values = self._robot.joint_values(state.q, state.gripper)
        frames = self._robot.frames(values)
        for number, stretch in enumerate(self._stretches):
            pose = self._pose(stretch, frames)
            if np.abs(pose - self._poses[number]).max() > CHANGE_WORTH_SENDING:
                self._poses[number] = pose
                rings = rings_along(stretch.curve(self._robot, values, frames), stretch.count)
                wire = rings.astype(np.float32)
                arrange(self._nodes[number], wire[:, :4], wire[:, 4:])

    @staticmethod
    def _pose(stretch: ConduitStretch, frames: Mapping[str, FloatArray]) -> FloatArray:
        """Return the pose (4, 4) [m] of the link of the last end in that of the first."""
        start, end = (frames[end.link] for end in stretch.ends)
        return se3.inverse(start) @ end
