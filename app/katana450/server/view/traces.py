"""The way of the tool in the scene: what is to be followed, and what was, coloured by its error."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import viser

from katana450.arm.control.state import State
from katana450.arm.robot.mounted_arm import MountedArm
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.forward import forward
from katana450.maths.planning.jet import Jet
from katana450.maths.planning.path import point_derivatives
from katana450.maths.planning.plan import Plan, Segment
from katana450.maths.planning.tool_path import ToolPath

DESIRED = (90, 100, 115)
"""Of the path that is to be followed."""

GOOD_COLOUR, BAD_COLOUR = np.array((22.0, 163.0, 74.0)), np.array((220.0, 38.0, 38.0))
"""Of what was followed: without error, and with WORST or more."""

WORST_ERROR = 1e-3
"""[m]"""

PATH_SAMPLES = 240
"""Pieces that a path is drawn with."""

SEND_INTERVAL = 0.1
"""[s] Between two messages: what was followed is appended in batches."""

MAX_PIECES = 4000
"""Pieces of a trace; then the oldest half is forgotten."""

Colours = npt.NDArray[np.uint8]


class Traces:
    """Of the plan that is followed, until another one is. Nothing is sent of an arm at rest."""

    def __init__(self, server: viser.ViserServer, arm: MountedArm) -> None:
        self._T_base_shoulder = arm.T_base_shoulder
        two = np.zeros((1, 2, 3), dtype=np.float32)
        self._desired = server.scene.add_line_segments(
            "/path/desired", two, DESIRED, thickness=0.003, visible=False
        )
        self._traced = server.scene.add_line_segments(
            "/path/traced",
            two,
            np.zeros((1, 2, 3), dtype=np.uint8),
            thickness=0.006,
            visible=False,
        )
        self._plan: Plan | None = None
        self._points: list[FloatArray] = []
        self._errors: list[float] = []
        self._told_at = 0.0
        self._shown = 0

    def follow(self, state: State) -> None:
        """Show where the tool of ``state`` is on the plan it follows."""
        following = state.following
        if following is None:
            return
        if following.plan is not self._plan:
            self._begin(following.plan)
        path = following.segment.path
        if not isinstance(path, ToolPath):
            return
        point = forward(path.chain, state.q)[:3, 3]
        sigma = following.segment.scaling.pace(following.local).sigma
        desired = np.array([each.c0 for each in path.curve.at(Jet.variable(sigma))[:3]])
        seen = self._seen(point)
        if not self._points or float(np.abs(seen - self._points[-1]).max()) > 0.0:
            self._points.append(seen)
            self._errors.append(float(np.linalg.norm(point - desired)))
        if state.t - self._told_at >= SEND_INTERVAL or not state.moving:
            self._told_at = state.t
            self._show()

    def _begin(self, plan: Plan) -> None:
        """Draw what is to be followed; a trace stays until the tool is on a path again."""
        self._plan = plan
        ways = [self._way(each) for each in plan.segments if isinstance(each.path, ToolPath)]
        if not ways:
            return
        self._points, self._errors, self._shown = [], [], 0
        self._traced.visible = False
        self._desired.points = np.concatenate(ways).astype(np.float32)
        self._desired.visible = True

    def _way(self, segment: Segment) -> FloatArray:
        """(PLACES, 2, 3) in the base frame [m]."""
        points = point_derivatives(segment.path, np.linspace(0.0, 1.0, PATH_SAMPLES + 1))[0]
        seen = points @ self._T_base_shoulder[:3, :3].T + self._T_base_shoulder[:3, 3]
        return np.stack((seen[:-1], seen[1:]), axis=1)

    def _seen(self, point: FloatArray) -> FloatArray:
        """``point`` (3,) in {S} as it is in the base frame [m]."""
        T = self._T_base_shoulder
        return np.asarray(T[:3, :3] @ point + T[:3, 3])

    def _show(self) -> None:
        if len(self._points) < 2 or len(self._points) == self._shown:
            return
        if len(self._points) > MAX_PIECES:
            self._points = self._points[MAX_PIECES // 2 :]
            self._errors = self._errors[MAX_PIECES // 2 :]
        self._shown = len(self._points)
        points = np.array(self._points, dtype=np.float32)
        colours = coloured(np.array(self._errors))
        self._traced.points = np.stack((points[:-1], points[1:]), axis=1)
        self._traced.colors = np.stack((colours[:-1], colours[1:]), axis=1)
        self._traced.visible = True


def coloured(errors: FloatArray) -> Colours:
    """(N, 3) from green without error to red at WORST and beyond, for `errors` (N,) [m]."""
    fraction = np.clip(errors / WORST_ERROR, 0.0, 1.0)[:, None]
    return np.asarray(np.rint(GOOD_COLOUR + fraction * (BAD_COLOUR - GOOD_COLOUR)), dtype=np.uint8)
