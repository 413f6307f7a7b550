"""The kinematics of one tool as a session drives it, whichever method computes them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol

from katana450.arm.control.state import Finding, State
from katana450.arm.control.tool_commands import StepTool, TurnCommand
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.branch import AnyBranch
from katana450.maths.kinematics.kinematics import Kinematics
from katana450.maths.kinematics.priority import Priority
from katana450.maths.kinematics.projection import Projection
from katana450.maths.kinematics.tool import ToolTarget
from katana450.maths.kinematics.tracker import Tracked
from katana450.maths.kinematics.velocity import JogFrame
from katana450.maths.motion.limiter import Limits


class ToolKinematics(Kinematics, Protocol):
    """Kinematics of one tool: inverse kinematics, drags, typed poses, branches and jogs.

    The functions that take a state read its goal (n,) [rad], branch and priority.

    Attributes:
        branches: every branch, in the order in which they are shown.
        priorities: the priorities that can be chosen, each with its name and a sentence for people.
        freedoms: number of numbers in a jog and in a step: 5 (x, y, z, pitch, roll), or 6 (x, y, z
            and a rotation about each axis of the frame).
        turn: the command that turns the tool.
    """

    @property
    def priorities(self) -> Mapping[Priority, tuple[str, str]]: ...  # noqa: D102
    @property
    def freedoms(self) -> int: ...  # noqa: D102
    @property
    def turn(self) -> type[TurnCommand]: ...  # noqa: D102

    def branch_of(self, q: FloatArray) -> AnyBranch:
        """Return the branch of the joint angles `q` (n,) [rad]."""

    def target_at(self, q: FloatArray) -> ToolTarget:
        """Return the target at which the tool is with the joints at `q` (n,) [rad]."""

    def turned(self, state: State, target: ToolTarget, command: TurnCommand) -> ToolTarget:
        """Return ``target`` with the orientation of ``command``, which is a `turn`."""

    def stepped(self, state: State, target: ToolTarget, step: StepTool) -> ToolTarget:
        """Return ``target`` moved by ``step``."""

    def target_on(self, state: State, target: ToolTarget, branch: AnyBranch) -> ToolTarget:
        """Return ``target``, given on the branch of ``state``, in the numbers of ``branch``."""

    def track(self, state: State, target: ToolTarget, since: ToolTarget) -> Tracked:
        """Return the goal moved on towards ``target``, as far as one tick allows.

        It stays on its branch and never leaps. ``since`` is the target up to which the path of the
        drag has been followed.
        """

    def project(self, state: State, T: FloatArray, branch: AnyBranch) -> Projection:
        """Return the posture on ``branch``, inside the limits, nearest to the pose `T` (4, 4)."""

    def leap(self, state: State, target: ToolTarget, branch: AnyBranch) -> Projection:
        """Return the posture on ``branch`` nearest to ``target``, at any distance."""

    def losses(self, state: State, best: Projection, *, yaw_was_given: bool) -> tuple[Finding, ...]:
        """Return the findings on what ``best`` loses of its target.

        ``yaw_was_given``: whether the target has a yaw that counts for five axes.
        """

    def tracking_losses(self, state: State, tracked: Tracked) -> tuple[Finding, ...]:
        """Return the findings on what following a drag loses, a gap first."""

    def jog_twist(self, q: FloatArray, rates: FloatArray, frame: JogFrame) -> FloatArray:
        """Return the twist (6,) of the tool in {S} [rad/s, m/s] for a jog at `q` (n,) [rad]."""

    def tool_speed(self, q: FloatArray, qd: FloatArray) -> float:
        """Return the speed of the tool point [m/s], or an upper bound, for rates `qd` (n,)."""

    def tool_speed_bound(self, qd: FloatArray) -> float:
        """Return the maximum of ``tool_speed`` over all postures."""

    def branch_limits(self, limits: Limits) -> Mapping[AnyBranch, Limits]:
        """Return ``limits`` for each branch whose elbow must keep its side; may be empty."""

    def ready(self, posture: Sequence[float], T_base_shoulder: FloatArray) -> FloatArray:
        """Return the joint angles (n,) [rad] in which the arm starts.

        ``posture`` (5,) [rad] is that of the canonical five-axis arm. ``T_base_shoulder`` (4, 4) is
        {S} in the base frame.
        """
