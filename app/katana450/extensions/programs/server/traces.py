"""The trace of the tool along its planned path in the scene, coloured by its error."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from katana450.arm.control.state.modes import Jogging, Positioning, Servoing, Tracking
from katana450.arm.control.state.state import State
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.forward import forward
from katana450.maths.planning.jet import Jet
from katana450.maths.planning.path import CurvePath
from katana450.maths.planning.plan import Plan
from katana450.server.view.layer import LayerContext, ViewLayer

DESIRED = (90, 100, 115)
"""Colour of the planned path in a report."""

GOOD_COLOUR, BAD_COLOUR = np.array((22.0, 163.0, 74.0)), np.array((220.0, 38.0, 38.0))
"""Colours of the trace without error, and with WORST_ERROR or more."""

WORST_ERROR = 1e-3
"""Distance [m] from the planned path at which the trace has BAD_COLOUR."""

PATH_SAMPLES = 240
"""Number of pieces in which a report draws a path."""

SEND_INTERVAL = 0.1
"""Time [s] between two messages: the trace is extended in batches."""

MAX_PIECES = 4000
"""Maximum number of pieces of a trace; the oldest half is then dropped."""

DRIVEN = (Positioning, Tracking, Jogging, Servoing)
"""Modes of an arm that is moved to a target or by a jog or stream, and not along a plan."""

Colours = npt.NDArray[np.uint8]


class TracesLayer(ViewLayer):
    """The trace of the last plan with a tool path, until the arm is driven otherwise.

    The preview draws the path itself. Nothing is sent of an arm at rest.
    """

    def attach(self, context: LayerContext) -> None:
        """Add the hidden node."""
        self._T_base_shoulder = context.robot.require_arm().T_base_shoulder
        points, colours = (np.zeros((1, 2, 3), dtype=kind) for kind in (np.float32, np.uint8))
        self._traced = context.server.scene.add_line_segments(
            "/path/traced", points, colours, thickness=0.006, visible=False
        )
        self._plan: Plan | None = None
        self._points: list[FloatArray] = []
        self._errors: list[float] = []
        self._sent_at = 0.0
        self._shown = 0

    def follow(self, state: State) -> None:
        """Extend the trace by the tool point of ``state``."""
        following = state.following
        if following is None:
            if self._plan is not None and isinstance(state.mode, DRIVEN):
                self._plan = None
                self._traced.visible = False
            return
        if following.plan is not self._plan:
            self._begin(following.plan)
        path = following.segment.path
        if not isinstance(path, CurvePath):
            return
        point = forward(path.chain, state.q)[:3, 3]
        sigma = following.segment.scaling.pace(following.local).sigma
        desired = np.array([coordinate.c0 for coordinate in path.curve.at(Jet.variable(sigma))[:3]])
        T = self._T_base_shoulder
        in_base = np.asarray(T[:3, :3] @ point + T[:3, 3])
        if not self._points or float(np.abs(in_base - self._points[-1]).max()) > 0.0:
            self._points.append(in_base)
            self._errors.append(float(np.linalg.norm(point - desired)))
        if state.t - self._sent_at >= SEND_INTERVAL or not state.moving:
            self._sent_at = state.t
            self._show()

    def _begin(self, plan: Plan) -> None:
        """Begin the trace of ``plan``. A plan without a path of the tool keeps the last trace."""
        self._plan = plan
        if any(isinstance(segment.path, CurvePath) for segment in plan.segments):
            self._points, self._errors, self._shown = [], [], 0
            self._traced.visible = False

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
    """Return colours (N, 3) for ``errors`` (N,) [m]: green at zero, red from WORST_ERROR on."""
    fraction = np.clip(errors / WORST_ERROR, 0.0, 1.0)[:, None]
    return np.asarray(np.rint(GOOD_COLOUR + fraction * (BAD_COLOUR - GOOD_COLOUR)), dtype=np.uint8)
