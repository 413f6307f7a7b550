"""Messages with the numbers of a state that people and other programs read.

Joints are exact. What follows from them is rounded, because digits that nobody needs make most of
a file.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from katana450.arm.control.environment import Environment
from katana450.arm.control.messages import finding_text
from katana450.arm.control.modes import JointTarget, PoseTarget
from katana450.arm.control.scene_objects import SceneObject
from katana450.arm.control.state import State
from katana450.arm.robot.robot import Robot
from katana450.extensions.recording.messages import (
    UPRIGHT,
    JointMessage,
    JointStatesMessage,
    ObjectPose,
    QuaternionMessage,
    StateRow,
    TargetMessage,
    TimeMessage,
    TransformMessage,
    TransformsMessage,
    VectorMessage,
    VesselWaterMessage,
    WaterMessage,
)
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.batch import forward_batch
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.tool import ToolTarget
from katana450.maths.water.flow import VesselWater, Water
from katana450.maths.water.slosh import Slosh
from katana450.maths.water.units import MILLILITRE
from katana450.maths.water.vectors import Vector

DIGITS, SHOWN_DIGITS, RATE_DIGITS = 6, 5, 4
"""Decimals [m, rad, 1] of poses, of what follows from other numbers or is only displayed, and of
rates [rad/s, m/s] and the lean of water."""

NANO = 1_000_000_000

Pose = tuple[Vector, tuple[float, float, float, float]]
"""Position (3,) [m] and unit quaternion x, y, z, w of a frame."""


def nanoseconds(t: float) -> int:
    """Return the log time of ``t`` [s]."""
    return round(t * NANO)


def _rounded(values: FloatArray, digits: int) -> list[float]:
    """Return a few numbers (n,) with ``digits`` decimals; numpy takes longer for them."""
    return [round(each, digits) + 0.0 for each in values.tolist()]


def _point(values: Iterable[float], digits: int) -> Vector:
    x, y, z = (round(float(value), digits) + 0.0 for value in values)
    return x, y, z


def pose_of(T: FloatArray, digits: int = DIGITS) -> Pose:
    """Return the pose ``T`` (4, 4), rounded to ``digits`` decimals."""
    w, x, y, z = so3.to_quaternion(T[:3, :3]).tolist()
    orientation = tuple(round(part, digits) + 0.0 for part in (x, y, z, w))
    return _point(T[:3, 3], digits), orientation


class StateMessages:
    """Makes the messages of the states of one robot, one after another."""

    def __init__(self, robot: Robot, environment: Environment | None) -> None:
        """Describe the states of ``robot``.

        ``environment`` gives the poses of objects in the hand. Without it they are left out.
        """
        self._robot, self._environment = robot, environment
        self._root = robot.links[0].name
        self._poses: dict[str, ObjectPose] = {}
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

    def state(self, state: State) -> StateRow:
        """Return the message of ``state`` on the topic of states."""
        setpoint, T = state.setpoint, self.tool_pose(state)
        same = state.q is setpoint or state.q.tobytes() == setpoint.tobytes()
        objects, removed = self._changed_objects(state)
        return StateRow(
            t=state.t,
            q=[] if same else state.q.tolist(),
            setpoint=setpoint.tolist(),
            qd=_rounded(state.motion.qd, RATE_DIGITS),
            # Its orientation follows from the joints, and displays get it by their topic.
            position=None if T is None else _point(T[:3, 3], SHOWN_DIGITS),
            target=_target(state),
            findings=[finding_text(finding) for finding in state.findings],
            gripper=state.gripper,
            gripper_setpoint=state.gripper_setpoint,
            mode=type(state.intent).__name__,
            status=state.status.value,
            speed=state.speed,
            tool="" if T is None else state.tool,
            objects=objects,
            removed=removed,
            water=None if state.poured is None else _water(state.poured.water),
        )

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

    def _changed_objects(self, state: State) -> tuple[list[ObjectPose], list[str]]:
        """Return the objects that have changed, and the names of those that are gone."""
        carried = any(item.carried for item in state.objects)
        if state.objects is self._objects and not carried:
            return [], []
        self._objects = state.objects
        before, self._poses = self._poses, {pose.name: pose for pose in self._object_poses(state)}
        changed = [pose for name, pose in self._poses.items() if before.get(name) != pose]
        return changed, sorted(before.keys() - self._poses.keys())

    def _object_poses(self, state: State) -> Iterator[ObjectPose]:
        for item in state.objects:
            known = self._poses.get(item.name)
            if not item.carried:
                yield ObjectPose(item.name, *pose_of(item.T))
            elif self._environment is not None:
                # It follows from the joints, and changes in every tick.
                T = self._environment.pose(item, state.x)
                yield ObjectPose(item.name, *pose_of(T, SHOWN_DIGITS), item.held)
            elif known is not None:
                yield known

    def describe_all(self) -> None:
        """Describe all objects with the next state, also those that have not changed."""
        self._poses, self._objects = {}, None

    def joint_states(self, state: State) -> JointStatesMessage:
        """Return the message of the joints by their names in the URDF."""
        values = self._robot.joint_values(state.q, state.gripper)
        joints = [
            JointMessage(name, round(value, SHOWN_DIGITS) + 0.0) for name, value in values.items()
        ]
        return JointStatesMessage(_time(state.t), joints)

    def transforms(self, state: State, names: Iterable[str]) -> TransformsMessage:
        """Return the message of the frames of the tool and of the objects ``names``."""
        T = self.tool_pose(state)
        poses = [] if T is None else [(state.tool, *pose_of(T))]
        for name in names:
            pose = self._poses[name]
            poses.append((f"object/{name}", pose.position, pose.orientation))
        return TransformsMessage(
            [
                TransformMessage(
                    _time(state.t),
                    self._root,
                    name,
                    VectorMessage(*(round(x, SHOWN_DIGITS) for x in position)),
                    QuaternionMessage(*(round(x, SHOWN_DIGITS) for x in orientation)),
                )
                for name, position, orientation in poses
            ]
        )


def _water(water: Water) -> WaterMessage:
    """Return the volumes, the surfaces in the vessels, and the water that left them in this tick.

    Parcels fly freely, so each is described once.
    """
    message = WaterMessage(
        water.cup.kept / MILLILITRE,
        water.basin / MILLILITRE,
        water.air / MILLILITRE,
        water.spilled / MILLILITRE,
        _lean(water.cup),
    )
    message.vessels = [
        VesselWaterMessage(vessel.name, vessel.kept / MILLILITRE, _lean(vessel))
        for vessel in water.others
    ]
    if water.parcels and water.parcels[-1].age == 0.0:
        new = water.parcels[-1]
        start, velocity = _point(new.start, DIGITS), _point(new.velocity, DIGITS)
        message.left = new.volume / MILLILITRE, start, velocity, round(new.span, DIGITS)
    return message


def _lean(water: VesselWater) -> Vector:
    """Return the lean of the surface in a vessel."""
    return UPRIGHT if water.slosh == Slosh() else _point(water.slosh.up, RATE_DIGITS)


def _target(state: State) -> TargetMessage:
    match state.target:
        case JointTarget(q=q):
            return TargetMessage(q=_rounded(q, DIGITS))
        case ToolTarget(position=position, pitch=pitch, roll=roll, is_pitched=True):
            # As in the command, which makes the file smaller.
            return TargetMessage(position=position.tolist(), pitch=pitch, roll=roll)
        case PoseTarget(T=T) | ToolTarget(T=T):
            return TargetMessage(T=[_rounded(row, DIGITS) for row in T])


def _time(t: float) -> TimeMessage:
    return TimeMessage(*divmod(nanoseconds(t), NANO))
