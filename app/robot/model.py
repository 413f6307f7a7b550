"""The robot as its URDF tells it. The numbers of the robot live in that file and nowhere else."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yourdfpy

from app.control.arm import Arm, Gripper
from app.errors import RobotDescriptionError
from app.geometry import screws, se3
from app.geometry.arrays import FloatArray, frozen
from app.kinematics.chain import Chain
from robot_description import URDF_PATH

SHOULDER_FRAME = "shoulder_frame"
"""The link that is the paper's frame {S}."""

TOOL_FRAMES = ("tcp", "grasp", "flange")
"""Links that targets can be set for; the first is the default."""


@dataclass(frozen=True, eq=False)
class Body:
    """One link, as the view needs it.

    Attributes:
        name, parent: of the link and the link it hangs on; the root has none.
        T_parent_body: (4, 4) where it sits at zero [m].
        joint: the movable joint it hangs on, or None when it is fixed.
        axis: (3,) unit direction of that joint in the body's own frame.
        meshes: GLB files in the body's own frame.
    """

    name: str
    parent: str | None
    T_parent_body: FloatArray
    joint: str | None
    axis: FloatArray
    meshes: tuple[Path, ...]


@dataclass(frozen=True, eq=False)
class RobotModel:
    """What the URDF says.

    Attributes:
        arm: chain in {S}, tools, gripper.
        T_base_shoulder: (4, 4) frame {S} in the root link, which stands on the table.
        bodies: every link, parents first.
        fingers: driven and following finger joints: angle = factor * driven + offset.
    """

    name: str
    arm: Arm
    T_base_shoulder: FloatArray
    bodies: tuple[Body, ...]
    fingers: Mapping[str, tuple[float, float]]

    def joint_angles(self, q: FloatArray, gripper: float) -> dict[str, float]:
        """Every movable joint's angle [rad] for arm joints (n,) and the driven finger joint."""
        angles = dict(zip(self.arm.chain.names, (float(angle) for angle in q), strict=True))
        for joint, (factor, offset) in self.fingers.items():
            angles[joint] = factor * gripper + offset
        return angles


def load(path: Path = URDF_PATH) -> RobotModel:
    """Read a URDF file.

    Raises:
        RobotDescriptionError: the file cannot be read, or lacks what an arm needs; says what.
    """
    if not path.is_file():
        raise RobotDescriptionError(f"There is no robot description at {path}.")
    try:
        urdf = yourdfpy.URDF.load(str(path), load_meshes=False, build_scene_graph=True)
        frames = {link: np.asarray(urdf.get_transform(link)) for link in urdf.link_map}
    except Exception as error:
        raise RobotDescriptionError(f"{path} is not a robot description: {error}") from error
    for needed in (SHOULDER_FRAME, *TOOL_FRAMES):
        if needed not in frames:
            raise RobotDescriptionError(f"{path.name} has no link {needed!r}.")

    driven = _driven_joints(urdf, TOOL_FRAMES[0])
    fingers = [j for j in urdf.joint_map.values() if j.type == "revolute" and j.name not in driven]
    T_shoulder_base = se3.inverse(frames[SHOULDER_FRAME])
    tools = {tool: frozen(T_shoulder_base @ frames[tool]) for tool in TOOL_FRAMES}
    joints = [urdf.joint_map[name] for name in driven]
    chain = Chain(
        M=tools[TOOL_FRAMES[0]],
        S=np.column_stack(
            [_screw(joint, T_shoulder_base @ frames[joint.child]) for joint in joints]
        ),
        lower=np.array([_limit(joint, "lower") for joint in joints]),
        upper=np.array([_limit(joint, "upper") for joint in joints]),
        speed=np.array([_limit(joint, "velocity") for joint in joints]),
        names=tuple(driven),
    )
    return RobotModel(
        name=urdf.robot.name,
        arm=Arm(chain, tools, TOOL_FRAMES[0], _gripper(path, fingers)),
        T_base_shoulder=frozen(frames[SHOULDER_FRAME]),
        bodies=tuple(_bodies(urdf, path, frames)),
        fingers=_follow(fingers),
    )


def _driven_joints(urdf: yourdfpy.URDF, tool: str) -> list[str]:
    """The movable joints from the root to ``tool``, in that order."""
    by_child = {joint.child: joint for joint in urdf.joint_map.values()}
    names: list[str] = []
    link = tool
    while link in by_child:
        joint = by_child[link]
        if joint.type == "revolute":
            names.append(joint.name)
        elif joint.type != "fixed":
            raise RobotDescriptionError(f"Joint {joint.name!r} is {joint.type}, not revolute.")
        link = joint.parent
    return names[::-1]


def _screw(joint: Any, T_shoulder_child: FloatArray) -> FloatArray:
    """The joint's screw axis (6,) in {S}; a URDF joint turns about an axis of its child's frame."""
    direction = T_shoulder_child[:3, :3] @ joint.axis
    return screws.revolute(direction, T_shoulder_child[:3, 3])


def _limit(joint: Any, which: str) -> float:
    value = None if joint.limit is None else getattr(joint.limit, which)
    if value is None:
        raise RobotDescriptionError(f"Joint {joint.name!r} has no {which} limit.")
    return float(value)


def _gripper(path: Path, fingers: list[Any]) -> Gripper:
    leaders = [joint for joint in fingers if joint.mimic is None]
    if len(leaders) != 1:
        raise RobotDescriptionError(
            f"{path.name} has {len(leaders)} driven finger joints; one is needed."
        )
    leader = leaders[0]
    return Gripper(*(_limit(leader, which) for which in ("lower", "upper", "velocity")))


def _follow(fingers: list[Any]) -> dict[str, tuple[float, float]]:
    return {
        joint.name: (1.0, 0.0)
        if joint.mimic is None
        else (float(joint.mimic.multiplier), float(joint.mimic.offset))
        for joint in fingers
    }


def _bodies(urdf: yourdfpy.URDF, path: Path, frames: Mapping[str, FloatArray]) -> list[Body]:
    by_child = {joint.child: joint for joint in urdf.joint_map.values()}
    bodies: list[Body] = []
    known: set[str] = set()

    def add(link: str) -> None:
        if link in known:
            return
        joint = by_child.get(link)
        if joint is None:
            T, name, axis = np.eye(4), None, np.array([0.0, 0.0, 1.0])
        else:
            add(joint.parent)
            T = se3.inverse(frames[joint.parent]) @ frames[link]
            name = joint.name if joint.type == "revolute" else None
            axis = np.asarray(joint.axis, dtype=float)
        known.add(link)
        meshes = tuple(
            (path.parent / visual.geometry.mesh.filename).resolve()
            for visual in urdf.link_map[link].visuals
            if visual.geometry.mesh is not None
        )
        bodies.append(
            Body(link, joint.parent if joint else None, frozen(T), name, frozen(axis), meshes)
        )

    for link in urdf.link_map:
        add(link)
    return bodies
