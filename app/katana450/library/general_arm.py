"""An arm outside the five-axis family: its kinematics, without plans."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

import numpy as np
import numpy.typing as npt

from katana450.assembly.robot_session import find_robot
from katana450.errors import InputError, RobotDescriptionError
from katana450.extensions.general_arms.described_arm import DescribedArm, described_arm
from katana450.extensions.general_arms.nearest import BestPosture, nearest_posture
from katana450.library.arm import Arm, Priority
from katana450.library.pose_frame import PoseFrame, dimensions
from katana450.library.solutions import IKSolutions
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.branch import Branch
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.kinematics import FiveAxisKinematics
from katana450.settings import Settings

if TYPE_CHECKING:
    from katana450.arm.control.state import State
    from katana450.arm.robot.mounted_arm import MountedArm
    from katana450.extensions.reachability.map import ReachabilityMap
    from katana450.library.planner import Planner
    from katana450.library.viewer import Viewer

ROOM = 0.05
"""Distance of `ready` from each limit, as a fraction of the joint's range."""


@dataclass(frozen=True, eq=False, repr=False)
class GeneralArm(Arm):
    """An arm of any number of turning axes, made by `katana450.load`.

    `fk`, `ik`, `nearest` and `jacobian` are those of an `Arm`, with n axes in place of five, and
    with the branches that `method` names. Functions that need the five-axis family (plans, maps of
    reachability, scenes) raise RobotDescriptionError.

    Attributes:
        described: the arm in its file.
    """

    described: DescribedArm

    @cached_property
    def chain(self) -> Chain:
        """Home configuration M, screw axes S and limits, in the frame {S}."""
        return self.described.kinematics.chain

    @property
    def method(self) -> str:
        """The method by which poses are solved, in words: a closed form, or numerical and why."""
        return self.described.kinematics.method

    @property
    def tool(self) -> str:
        """Link to which poses refer."""
        return self.described.default_tool

    @property
    def ready(self) -> FloatArray:
        """(n,) the posture nearest to zero with some room to the limits [rad]."""
        room = ROOM * (self.upper - self.lower)
        return np.clip(np.zeros(self.n), self.lower + room, self.upper - room)

    @property
    def T_base_frame(self) -> FloatArray:
        """(4, 4) maps coordinates of the frame of poses into the base [m]."""
        return np.eye(4) if self.pose_frame.in_base else self.described.T_base_shoulder

    def ik(self, T: npt.ArrayLike, q_hint: npt.ArrayLike | None = None) -> IKSolutions:
        """Return a solution for each branch of the pose (4, 4), or of poses (N, 4, 4).

        Four axes have 4 branches, six and seven axes in closed form 8. Seven axes take the swivel
        of each branch with the most room to the limits, or nearest to the hint. A numerical
        solution is one posture inside the limits. Arguments and errors are those of `Arm.ik`.
        """
        kinematics, poses = self.described.kinematics, self.pose_frame.to_shoulder(T)
        if dimensions(T) == 3 and q_hint is None:
            return IKSolutions.of_many(kinematics, poses)
        return IKSolutions.of_one(kinematics, poses, q_hint)

    def nearest(  # type: ignore[override]  # Yaw, pitch and roll are those of five axes.
        self,
        T: npt.ArrayLike,
        *,
        priority: Priority = "pose",
        branch: Branch | str | None = None,
        q_hint: npt.ArrayLike | None = None,
        within_limits: bool = True,
    ) -> BestPosture:
        """Return the feasible pose nearest to ``T`` (4, 4), with the reason for its errors.

        The position counts first, then the orientation. Arguments and errors are those of
        `Arm.nearest`; ``priority`` and ``branch`` are those of five axes and refused.
        """
        if priority != "pose" or branch is not None:
            raise InputError(
                "Other priorities than 'pose', and one branch, are for five-axis arms. This arm "
                "takes T and q_hint; `ik` returns its branches."
            )
        best = nearest_posture(
            self.described.kinematics,
            self.pose_frame.to_shoulder(T),
            q_hint=q_hint,
            within_limits=within_limits,
        )
        return replace(best, T=self.pose_frame.from_shoulder(best.T))

    def reachability(
        self,
        voxel: float = 0.05,
        *,
        table: float = 0.0,
        pitches: int = 36,
        rolls: int = 24,
        samples: int = 0,
        seed: int = 0,
    ) -> ReachabilityMap:
        """Raise RobotDescriptionError: maps count pitches and rolls of five axes."""
        raise self._refusal("a map of reachability")

    def show(self, what: object = None, *, port: int = 8090, host: str = "127.0.0.1") -> Viewer:
        """Raise RobotDescriptionError: the scene shows five-axis arms."""
        raise self._refusal("the scene")

    def standing(self, q: npt.ArrayLike) -> State:
        """Raise RobotDescriptionError: states are those of five-axis arms."""
        raise self._refusal("a state")

    @cached_property
    def _planner(self) -> Planner:
        raise self._refusal("a plan")

    @property
    def _mounted(self) -> MountedArm:
        raise self._refusal("this")

    def _refusal(self, what: str) -> RobotDescriptionError:
        return RobotDescriptionError(
            f"For {self.name}, {what} is not possible: it needs a five-axis arm with a pan axis, "
            f"three parallel axes and a roll axis, and this arm has {self.n} axes ({self.method}). "
            "`fk`, `ik`, `nearest` and `jacobian` work; `katana450 serve` drives its joints."
        )


def general_arm(urdf: Path, tool: str | None, frame: str) -> GeneralArm | None:
    """Return the arm of another kind in a URDF file; None for a five-axis arm of the family.

    Raises RobotDescriptionError for a mechanism without an arm, InputError for an unknown frame.
    """
    described = described_arm(urdf, tool)
    if isinstance(described.kinematics, FiveAxisKinematics):
        return None
    robot, session, _ = find_robot(Settings(), urdf, None)
    return GeneralArm(
        robot=robot,
        session=session,
        notes=(*described.notes, *robot.notes),
        pose_frame=PoseFrame.of(described.T_base_shoulder, frame),
        objects=(),
        described=described,
    )


def refuse(what: str) -> NoReturn:
    """Raise InputError: an argument of `load` needs plans, which this arm does not have."""
    raise InputError(
        f"{what} is for plans, which need a five-axis arm of the family. Load this arm without it."
    )
