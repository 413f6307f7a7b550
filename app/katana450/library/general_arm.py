"""An arm outside the five-axis family."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np
import numpy.typing as npt

from katana450.arm.control.scene_objects import SceneObject
from katana450.assembly.robot_session import find_robot
from katana450.caching import cached_property
from katana450.errors import InputError, RobotDescriptionError
from katana450.extensions.general_arms.described_arm import DescribedArm, described_arm
from katana450.extensions.general_arms.nearest import BestPosture, nearest_posture
from katana450.extensions.importers.initial_scene import load_initial_scene
from katana450.extensions.reachability.survey_of import MapOptions, survey_of
from katana450.library.arm import Arm, Priority
from katana450.library.motion_plan import MotionPlan
from katana450.library.pose_frame import PoseFrame
from katana450.library.solutions import IKSolutions
from katana450.maths.geometry import se3
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.kinematics.branch import Branch
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.kinematics import FiveAxisKinematics
from katana450.maths.kinematics.pose_units import check_metres
from katana450.settings import Settings

if TYPE_CHECKING:
    from katana450.arm.robot.mounted_arm import MountedArm
    from katana450.extensions.reachability.map import ReachabilityMap

NEEDED: Final = (
    "it needs three or more turning axes, whose tool is named if the file has other joints than "
    "those of fingers"
)
"""End of the sentence that refuses a plan: the condition that the arm does not meet."""


@dataclass(frozen=True, eq=False, repr=False)
class GeneralArm(Arm):
    """An arm of any number of turning axes, made by `katana450.load`.

    Its functions are those of an `Arm`, with n axes in place of five, and with the branches that
    `method` names. Plans and maps of reachability need three or more axes, and no other joints than
    those of fingers. Without that, RobotDescriptionError is raised.

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
        """(n,) posture in which the robot starts [rad]; plans begin there by default."""
        if self.robot.arm is not None:
            return self.session.ready
        # The session has every joint of the file.
        posture = dict(zip(self.robot.joint_group.names, self.session.ready, strict=True))
        return frozen([posture[name] for name in self.chain.names])

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
        return IKSolutions(self.described.kinematics, self.pose_frame.to_shoulder(T), q_hint)

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
        pose = se3.validated(self.pose_frame.to_shoulder(T))
        check_metres(self.chain, pose[:3, 3].tolist())
        best = nearest_posture(
            self.described.kinematics,
            pose,
            q_hint=q_hint,
            within_limits=within_limits,
        )
        return replace(best, T=self.pose_frame.from_shoulder(best.T))

    def reachability(
        self,
        voxel: float | None = None,
        *,
        table: float = 0.0,
        pitches: int | None = None,
        rolls: int | None = None,
    ) -> ReachabilityMap:
        """Map where the tool can be, and which fraction of orientations it can have there.

        The orientations are spread evenly from six axes on: ``pitches`` directions, each with
        ``rolls`` turns. With four axes they are directions in the plane of the arm, and other arms
        choose none. What is None suits the arm: its map then takes seconds to minutes. ``at_home``
        of the map tells where the tool can have the orientation that it has in ``ready``. Other
        arguments and errors are those of `Arm.reachability`. An InputError also refuses a map that
        would take too long.
        """
        home, T = self._mounted.ready(Settings.ready), self.described.T_base_shoulder
        options = MapOptions(table, voxel, pitches, rolls)
        survey = survey_of(self.chain, T, home, options)
        return survey.map(survey.count(chunk) for chunk in survey.chunks())

    def circle(  # type: ignore[override]  # rpy in place of the pitch and roll of five axes
        self,
        centre: npt.ArrayLike,
        radius: float,
        *,
        normal: npt.ArrayLike = (1.0, 0.0, 0.0),
        rpy: Sequence[float | None] = (None, None, None),
        turns: float = 1.0,
        branch: str | None = None,
        start: npt.ArrayLike | None = None,
    ) -> MotionPlan:
        """Plan a circle of the tool point, from its highest point, as `Arm.circle`.

        ``rpy`` are roll, pitch and yaw [rad] of the tool in the frame of poses; what is None stays
        as it is. Fewer than six axes have no yaw of their own.
        """
        if len(rpy) != 3:
            raise InputError(f"`rpy` has {len(rpy)} values; give roll, pitch and yaw, or None.")
        roll, pitch, yaw = rpy
        angles = pitch, roll, yaw
        core = self._planner.circle(centre, radius, normal, start, angles, turns, branch)
        return MotionPlan(self, core)

    @property
    def _mounted(self) -> MountedArm:
        if self.robot.arm is None:
            raise self._refusal("a plan or a map")
        return self.robot.arm

    def _refusal(self, what: str) -> RobotDescriptionError:
        return RobotDescriptionError(
            f"For {self.name}, {what} is not possible: {NEEDED}. This arm has {self.n} axes "
            f"({self.method}). `fk`, `ik`, `nearest` and `jacobian` work; `katana450 serve` drives "
            "it."
        )


def general_arm(
    urdf: Path, tool: str | None, frame: str, scene: Path | None = None
) -> GeneralArm | None:
    """Return the arm of another kind in a URDF file; None for a five-axis arm of the family.

    ``scene``: see `load`. Raises RobotDescriptionError for a mechanism without an arm, InputError
    for an unknown frame, and for a scene that is invalid or of no use because nothing is planned.
    """
    described = described_arm(urdf, tool)
    if isinstance(described.kinematics, FiveAxisKinematics):
        return None
    try:
        robot, session, _ = find_robot(Settings(), urdf, tool)
    except RobotDescriptionError:
        # Its tool cannot be driven, so it has kinematics, but no plans.
        robot, session, _ = find_robot(Settings(), urdf, None)
    objects: tuple[SceneObject, ...] = ()
    if robot.arm is not None:
        objects = load_initial_scene(session, scene, ())[0].scene.objects
    elif scene is not None:
        raise InputError(
            f"A scene is for plans, and for {robot.name} there are none: {NEEDED}. Load this arm "
            "without it."
        )
    return GeneralArm(
        robot=robot,
        session=session,
        notes=(*described.notes, *robot.notes),
        pose_frame=PoseFrame.of(described.T_base_shoulder, frame),
        objects=objects,
        described=described,
    )
