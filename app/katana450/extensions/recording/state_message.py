"""Messages with the numbers of a state that people and other programs read.

Joints are exact. What follows from them is rounded, because digits that nobody needs make most of
a file.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np

from katana450.arm.control.messages import finding_text
from katana450.arm.control.modes import JointTarget, PoseTarget
from katana450.arm.control.scene_objects import Environment, SceneObject
from katana450.arm.control.state import State
from katana450.arm.robot.robot import Robot
from katana450.extensions.general_arms.tool_pose import ToolPose
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.batch import forward_batch
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.tool import ToolTarget
from katana450.maths.water.flow import VesselWater, Water
from katana450.maths.water.slosh import Slosh
from katana450.maths.water.units import MILLILITRE

DIGITS, SHOWN_DIGITS, RATE_DIGITS = 6, 5, 4
"""Decimals [m, rad, 1] of poses, of what follows from other numbers or is only displayed, and of
rates [rad/s, m/s] and the lean of water."""

NANO = 1_000_000_000

Pose = tuple[list[float], list[float]]
"""Position (3,) [m] and unit quaternion x, y, z, w of a frame."""


def nanoseconds(t: float) -> int:
    """Return the log time of ``t`` [s]."""
    return round(t * NANO)


def _rounded(values: FloatArray, digits: int) -> list[float]:
    """Return a few numbers (n,) with ``digits`` decimals; numpy takes longer for them."""
    return [round(each, digits) + 0.0 for each in values.tolist()]


def pose_of(T: FloatArray, digits: int = DIGITS) -> Pose:
    """Return the pose ``T`` (4, 4), rounded to ``digits`` decimals."""
    w, x, y, z = so3.to_quaternion(T[:3, :3]).tolist()
    turned = [round(each, digits) + 0.0 for each in (x, y, z, w)]
    return _rounded(T[:3, 3], digits), turned


class StateMessages:
    """Makes the messages of the states of one robot, one after another."""

    def __init__(self, robot: Robot, environment: Environment | None) -> None:
        """Describe the states of ``robot``.

        ``environment`` gives the poses of objects in the hand. Without it they are left out.
        """
        self._robot, self._environment = robot, environment
        self._root = robot.links[0].name
        self._poses: dict[str, tuple[Pose, bool]] = {}
        self._objects: tuple[SceneObject, ...] | None = None
        self._tools: dict[int, tuple[State, FloatArray]] = {}

    def prepare(self, states: Sequence[State]) -> None:
        """Find the poses of the tool in ``states`` together, which takes less time."""
        arm = self._robot.arm
        if arm is None or len({each.tool for each in states}) != 1:
            return
        q = np.array([each.q for each in states])
        poses = arm.T_base_shoulder @ forward_batch(arm.chain_to(states[0].tool), q)
        self._tools = {id(state): (state, T) for state, T in zip(states, poses, strict=True)}

    def state(self, state: State) -> dict[str, Any]:
        """Return the message of ``state`` on the topic of states."""
        setpoint = state.setpoint
        message: dict[str, Any] = {"t": state.t}
        if state.q is not setpoint and state.q.tobytes() != setpoint.tobytes():
            message["q"] = state.q.tolist()
        # Numbers that change stand together, so that what stays the same is packed better.
        message["setpoint"] = setpoint.tolist()
        message["qd"] = _rounded(state.motion.qd, RATE_DIGITS)
        T = self.tool_pose(state)
        if T is not None:
            # Its orientation follows from the joints, and displays get it by their topic.
            message["position"] = _rounded(T[:3, 3], SHOWN_DIGITS)
        message |= {
            "target": _target(state),
            "findings": [finding_text(each) for each in state.findings],
            "gripper": state.gripper,
            "gripper_setpoint": state.gripper_setpoint,
            "mode": type(state.intent).__name__,
            "status": state.status.value,
            "speed": state.speed,
        }
        if T is not None:
            message["tool"] = state.tool
        message.update(self._changed_objects(state))
        if state.poured is not None:
            water = state.poured.water
            volumes = {
                "cup": water.cup.kept,
                "basin": water.basin,
                "air": water.air,
                "spilled": water.spilled,
            }
            message["water"] = {name: each / MILLILITRE for name, each in volumes.items()}
            message["water"].update(_motion_of(water))
        return message

    def tool_pose(self, state: State) -> FloatArray | None:
        """Return the pose (4, 4) of the tool in the base frame; None without a tool."""
        arm = self._robot.arm
        if arm is None:
            return None
        known = self._tools.get(id(state))
        # The state is kept, so that no other can get its identity.
        if known is None or known[0] is not state:
            T = arm.T_base_shoulder @ forward(arm.chain_to(state.tool), state.q)
            known = state, T
            self._tools = {id(state): known}
        return known[1]

    def _changed_objects(self, state: State) -> dict[str, Any]:
        carried = any(each.carried for each in state.objects)
        if state.objects is self._objects and not carried:
            return {}
        self._objects = state.objects
        poses = dict(self._object_poses(state))
        changed = [
            {"name": name, "position": pose[0], "orientation": pose[1], "held": held}
            for name, (pose, held) in poses.items()
            if self._poses.get(name) != (pose, held)
        ]
        removed = sorted(self._poses.keys() - poses.keys())
        self._poses = poses
        found: dict[str, Any] = {"objects": changed} if changed else {}
        return found | ({"removed": removed} if removed else {})

    def _object_poses(self, state: State) -> Iterator[tuple[str, tuple[Pose, bool]]]:
        for each in state.objects:
            known = self._poses.get(each.name)
            if not each.carried:
                yield each.name, (pose_of(each.T), False)
            elif self._environment is not None:
                # It follows from the joints, and changes in every tick.
                T = self._environment.pose(each, state.x)
                yield each.name, (pose_of(T, SHOWN_DIGITS), each.held)
            elif known is not None:
                yield each.name, known

    def describe_all(self) -> None:
        """Describe all objects with the next state, also those that have not changed."""
        self._poses, self._objects = {}, None

    def joint_states(self, state: State) -> dict[str, Any]:
        """Return the message of the joints by their names in the URDF."""
        values = self._robot.joint_values(state.q, state.gripper)
        joints = [
            {"name": name, "position": round(value, SHOWN_DIGITS) + 0.0}
            for name, value in values.items()
        ]
        return {"timestamp": _time(state.t), "joints": joints}

    def transforms(self, state: State, names: Iterable[str] | None = None) -> dict[str, Any]:
        """Return the message of the frames of the tool and of the objects ``names``, or of all."""
        T = self.tool_pose(state)
        poses = [] if T is None else [(state.tool, pose_of(T))]
        chosen = self._poses if names is None else names
        poses += [(f"object/{name}", self._poses[name][0]) for name in chosen]
        return {"transforms": [self._transform(state.t, *each) for each in poses]}

    def _transform(self, t: float, name: str, pose: Pose) -> dict[str, Any]:
        position, orientation = ([round(each, SHOWN_DIGITS) for each in part] for part in pose)
        return {
            "timestamp": _time(t),
            "parent_frame_id": self._root,
            "child_frame_id": name,
            "translation": dict(zip("xyz", position, strict=True)),
            "rotation": dict(zip("xyzw", orientation, strict=True)),
        }


def _motion_of(water: Water) -> dict[str, Any]:
    """Return the surface in the vessels, and the water that left them in this tick, if any.

    Parcels fly freely, so each is described once.
    """
    found = _lean(water.cup)
    if water.others:
        found["vessels"] = [
            {"name": each.name, "volume": each.kept / MILLILITRE, **_lean(each)}
            for each in water.others
        ]
    if water.parcels and water.parcels[-1].age == 0.0:
        new = water.parcels[-1]
        places = [[round(x, DIGITS) + 0.0 for x in each] for each in (new.start, new.velocity)]
        found["left"] = [new.volume / MILLILITRE, *places, round(new.span, DIGITS)]
    return found


def _lean(water: VesselWater) -> dict[str, Any]:
    """Return the lean of the surface in a vessel, unless it is level."""
    if water.slosh == Slosh():
        return {}
    return {"lean": [round(each, RATE_DIGITS) + 0.0 for each in water.slosh.up]}


def _target(state: State) -> dict[str, Any]:
    match state.target:
        case JointTarget(q=q):
            return {"q": _rounded(q, DIGITS)}
        case PoseTarget(T=T):
            return {"T": [_rounded(row, DIGITS) for row in T]}
        case ToolTarget(position=position, pitch=pitch, roll=roll):
            # As in the command, which makes the file smaller.
            return {"position": position.tolist(), "pitch": pitch, "roll": roll}
        case ToolPose(T=T):
            return {"T": [_rounded(row, DIGITS) for row in T]}
        case target:
            return {"position": target.position.tolist()}


def _time(t: float) -> dict[str, int]:
    sec, nsec = divmod(nanoseconds(t), NANO)
    return {"sec": sec, "nsec": nsec}
