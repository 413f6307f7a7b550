"""The interface between steps of a script and a tool: targets, curves, paths and words.

A step is written once, in terms of this interface. `FiveAxisPlanning` gives it the closed form of
the five-axis family, `PosePlanning` the kinematics of every other arm.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from katana450.arm.control.state import State
from katana450.arm.control.tool_kinematics import ToolKinematics
from katana450.extensions.programs.curve import Curve
from katana450.extensions.programs.pose_curve import PoseCurve
from katana450.extensions.programs.script_frame import ScriptFrame
from katana450.extensions.programs.step_target import Angles
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.branch import AnyBranch
from katana450.maths.kinematics.tool import DragTarget
from katana450.maths.planning.path import Path

AnyCurve = Curve | PoseCurve
"""A curve of the tool, of an arm of the five-axis family or of another one."""


class ToolPlanning(Protocol):
    """The planning of one tool. Joint angles ``q`` are (n,) [rad], points (3,) [m] in {S}."""

    @property
    def kinematics(self) -> ToolKinematics:
        """The kinematics of the tool."""

    def target(self, position: FloatArray, R: FloatArray) -> DragTarget:
        """Return the target of the tool point at ``position`` (3,) [m].

        `R` (3, 3) is the rotation of the tool; of fewer than six axes that with axis 1 at zero.
        """

    def at(self, q: FloatArray) -> DragTarget:
        """Return the target at which the tool is with the joints at `q`."""

    def oriented(self, now: DragTarget, angles: Angles, R: FloatArray) -> DragTarget:
        """Return ``now`` with those of ``angles`` that are given; the others stay.

        ``R`` (3, 3) is the rotation of {S} in the frame of the angles. Raises InputError for angles
        that the tool cannot choose.
        """

    def line(self, start: DragTarget, end: DragTarget) -> AnyCurve:
        """Return the straight line on which the tool turns evenly from ``start`` to ``end``."""

    def lines(self, vias: Sequence[DragTarget], blend: FloatArray) -> AnyCurve:
        """Return straight lines with rounded corners; ``blend`` is that of `Polyline`."""

    def arc(
        self,
        centre: FloatArray,
        axis: FloatArray,
        angle: float,
        climb: float,
        start: DragTarget,
        end: DragTarget,
    ) -> AnyCurve:
        """Return the turn of the tool point from ``start`` about ``axis`` through ``centre``.

        ``angle`` [rad], ``climb`` along the axis [m]. The tool turns evenly to the orientation of
        ``end``.
        """

    def roomiest(self, arc: AnyCurve, branch: AnyBranch) -> AnyCurve:
        """Return ``arc`` with the pitch that keeps the joints farthest from their limits.

        Raises InputError for an arm whose orientations are no pitches.
        """

    def screw(self, q: FloatArray, twist: FloatArray) -> AnyCurve:
        """Return the motion of the tool from `q` along ``twist`` (6,) in {S}, as far as it can."""

    def path(self, state: State, q: FloatArray, curve: AnyCurve, branch: AnyBranch) -> Path:
        """Return the joint path along ``curve`` on ``branch``, which begins as near `q` as it can.

        Raises PathError for a curve that the arm cannot follow.
        """

    def branches(self, q: FloatArray) -> Sequence[AnyBranch]:
        """Return all branches, that of `q` first."""

    def branch(self, branch: AnyBranch) -> AnyBranch:
        """Return a branch that a script names. Raises InputError if the arm does not have it."""

    def joints(
        self, state: State, q: FloatArray, target: DragTarget, branch: AnyBranch | None
    ) -> FloatArray | None:
        """Return the joint angles (n,) [rad] for ``target`` near `q`; None if it is out of reach.

        ``branch``: the only one that may be used; None for all, that of `q` first.
        """

    def unreached(
        self,
        state: State,
        q: FloatArray,
        target: DragTarget,
        branch: AnyBranch | None,
        frame: ScriptFrame,
    ) -> str:
        """Return why the tool cannot be at ``target``, by how much, and what it can reach."""

    def farthest(
        self, state: State, q: FloatArray, curve: AnyCurve, branch: AnyBranch, frame: ScriptFrame
    ) -> str:
        """Return a sentence on the place of ``curve`` that is farthest out of reach, or ""."""
