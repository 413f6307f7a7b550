"""Requests that move joints, the tool or the fingers."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, Literal

import numpy as np
from msgspec import Meta

from katana450.arm.control import commands as cmd
from katana450.arm.control.arm_commands import ArmAct
from katana450.maths.kinematics.velocity import JogFrame
from katana450.server.api.fields import (
    COMMAND,
    MAX_ANGULAR_RATE,
    MAX_ANGULAR_STEP,
    MAX_JOINTS,
    MAX_LINEAR_RATE,
    MAX_LINEAR_STEP,
    Frame,
    Matrix3,
    Matrix4,
    MotionRequest,
    Name,
    Rates,
    Request,
    RequestTraits,
    Vector3,
)


class Jog(Request, frozen=True, kw_only=True):
    """Move the tool at given rates for 0.2 s. Repeat the request to continue the motion.

    Attributes:
        rates: (5,) Velocity of the tool point (x, y, z) [m/s], then rates of pitch and roll
            [rad/s]. (6,) for arms outside the five-axis family: the rates of the rotations about x,
            y and z follow.
        frame: Frame along whose axes the tool point moves, `"base"` or `"tool"`; with six rates it
            also turns about them.
    """

    traits: ClassVar[RequestTraits] = RequestTraits(stream=True)

    rates: Rates
    frame: JogFrame = JogFrame.BASE

    def __post_init__(self) -> None:
        limits = (MAX_LINEAR_RATE,) * 3 + (MAX_ANGULAR_RATE,) * (len(self.rates) - 3)
        for rate, limit in zip(self.rates, limits, strict=True):
            if not math.isfinite(rate) or abs(rate) > limit:
                raise ValueError(f"the rate {rate} is not between {-limit:g} and {limit:g}")

    def command(self) -> cmd.Command:
        return cmd.Jog(np.array(self.rates), self.frame)


class StepTool(MotionRequest, frozen=True, kw_only=True):
    """Move the target of the tool by one step. Steps in a row add up.

    Attributes:
        by: (5,) Step of the tool point (x, y, z) [m], then of pitch and roll [rad]. (6,) for arms
            outside the five-axis family: a rotation vector [rad] follows.
        frame: Frame along whose axes the tool point moves, `"base"` or `"tool"`; with six numbers
            it also turns about them.
    """

    traits: ClassVar[RequestTraits] = COMMAND

    by: Rates
    frame: JogFrame = JogFrame.BASE

    def __post_init__(self) -> None:
        limits = (MAX_LINEAR_STEP,) * 3 + (MAX_ANGULAR_STEP,) * (len(self.by) - 3)
        for step, limit in zip(self.by, limits, strict=True):
            if not math.isfinite(step) or abs(step) > limit:
                raise ValueError(f"the step {step} is not between {-limit:g} and {limit:g}")

    def command(self) -> cmd.Command:
        return cmd.StepTool(np.array(self.by), self.frame)


class Joint(MotionRequest, frozen=True, kw_only=True):
    """Move one joint to a value.

    Attributes:
        axis: Number of the joint, counted from 1.
        value: Target [rad]; [m] for a joint that slides.
    """

    traits: ClassVar[RequestTraits] = COMMAND

    axis: Annotated[int, Meta(ge=1, le=MAX_JOINTS)]
    value: float

    def command(self) -> cmd.Command:
        return cmd.SetJoint(self.axis - 1, self.value)


class Joints(MotionRequest, frozen=True, kw_only=True):
    """Move all joints along a straight line in joint space; they arrive together.

    Attributes:
        q: (n,) Targets [rad]; [m] for joints that slide.
    """

    traits: ClassVar[RequestTraits] = COMMAND

    q: Annotated[list[float], Meta(min_length=1, max_length=MAX_JOINTS)]

    def command(self) -> cmd.Command:
        return cmd.SetJoints(np.array(self.q))


class Servo(Request, frozen=True, kw_only=True):
    """Follow one sample of a stream of joint angles.

    The motion keeps the limits of speed, acceleration and jerk. The arm comes to rest when no
    other sample arrives for 0.2 s.

    Attributes:
        q: (n,) Joint angles [rad]; [m] for joints that slide.
        qd: (n,) Rates of ``q``. Without them the rates are estimated from the stream, which is less
            exact.
        gripper: Target of the finger joint [rad], or [m] if it slides; it stays without.
    """

    traits: ClassVar[RequestTraits] = RequestTraits(stream=True)

    q: Annotated[list[float], Meta(min_length=1, max_length=MAX_JOINTS)]
    qd: Annotated[list[float], Meta(min_length=1, max_length=MAX_JOINTS)] | None = None
    gripper: float | None = None

    def command(self) -> cmd.Command:
        qd = None if self.qd is None else np.array(self.qd)
        return cmd.Servo(np.array(self.q), qd, gripper=self.gripper)


class Pose(MotionRequest, frozen=True, kw_only=True):
    """Move the tool to a pose, or as near to it as the arm can.

    The priority (``set_priority``) decides which part of the pose is kept.

    Attributes:
        T: (4, 4) Pose of the tool in ``frame``, translations in m.
        frame: Frame of ``T``: {S} at the shoulder, or the base frame on the table.
    """

    traits: ClassVar[RequestTraits] = COMMAND

    T: Matrix4
    frame: Frame = Frame.SHOULDER


class Position(MotionRequest, frozen=True, kw_only=True):
    """Move the tool point to a position; the orientation of the target is kept.

    Attributes:
        p: (3,) Position [m] in ``frame``.
        frame: Frame of ``p``: {S} at the shoulder, or the base frame on the table.
    """

    traits: ClassVar[RequestTraits] = COMMAND

    p: Vector3
    frame: Frame = Frame.SHOULDER


class Turn(MotionRequest, frozen=True, kw_only=True):
    """Turn the tool of a five-axis arm to a pitch and a roll; its target position is kept.

    Attributes:
        pitch: Angle of the tool below the horizontal [rad], positive downwards.
        roll: Angle about the tool's own axis [rad].
    """

    traits: ClassVar[RequestTraits] = COMMAND

    pitch: float
    roll: float

    def command(self) -> cmd.Command:
        return cmd.TurnTool(self.pitch, self.roll)


class Orient(MotionRequest, frozen=True, kw_only=True):
    """Turn the tool of an arm outside the five-axis family; its target position is kept.

    Attributes:
        R: (3, 3) Rotation of the tool in ``frame``.
        frame: Frame of ``R``: {S} at the shoulder, or the base frame on the table.
    """

    traits: ClassVar[RequestTraits] = COMMAND

    R: Matrix3
    frame: Frame = Frame.SHOULDER


class Gripper(MotionRequest, frozen=True, kw_only=True):
    """Move the fingers.

    Attributes:
        angle: Target of the finger joint [rad]; [m] for fingers that slide. The answer ``arm`` has
            its range.
    """

    traits: ClassVar[RequestTraits] = COMMAND

    angle: float

    def command(self) -> cmd.Command:
        return cmd.SetGripper(self.angle)


class Undo(MotionRequest, frozen=True):
    """Undo the last change of a goal, an object or a setting by this client.

    To undo a goal, the arm moves back to the earlier one. Refused while the arm is stopped, and
    without a change since the last stop or change of driver.
    """

    traits: ClassVar[RequestTraits] = COMMAND


class Redo(MotionRequest, frozen=True):
    """Repeat the change by this client that was undone last, if no other change followed."""

    traits: ClassVar[RequestTraits] = COMMAND


class EndDrag(MotionRequest, frozen=True):
    """End a drag: the nearest pose that the arm can reach becomes the target."""

    traits: ClassVar[RequestTraits] = COMMAND

    def command(self) -> cmd.Command:
        return cmd.EndDrag()


class Go(MotionRequest, frozen=True):
    """Move along the detour that the state offers, to the target that a drag did not reach.

    A drag ends at a gap where a joint would have to leap. If a clear path on the same branch leads
    to its target, the field ``detour`` of the state has its duration. Refused without an offer; any
    change withdraws it.
    """

    traits: ClassVar[RequestTraits] = COMMAND

    def command(self) -> cmd.Command:
        return cmd.Go()


class Home(MotionRequest, frozen=True):
    """Move to the ready posture."""

    traits: ClassVar[RequestTraits] = COMMAND

    def command(self) -> cmd.Command:
        return cmd.Home()


class GoToZero(MotionRequest, frozen=True):
    """Move to the zero posture, in which the arm is stretched along x."""

    traits: ClassVar[RequestTraits] = COMMAND

    def command(self) -> cmd.Command:
        return cmd.GoToZero()


class OperateArm(Request, frozen=True, kw_only=True):
    """Connect, calibrate or switch the motors of a real arm. It must be stopped and at rest.

    The state lists the acts that are possible; its ``arm.mode`` tells what becomes of an act.

    Attributes:
        act: connect; disconnect; calibrate: the arm moves to its mechanical stops; engage: the
            motors hold the arm, which was calibrated before; release: motors off, the arm falls;
            unblock: hold again after a collision or an error.
        confirmed: Whether a person has confirmed the hazard. Without it, an act that has one is
            refused with the text of the hazard.
    """

    traits: ClassVar[RequestTraits] = COMMAND

    act: ArmAct
    confirmed: bool = False

    def command(self) -> cmd.Command:
        return cmd.OperateArm(self.act, self.confirmed)


class Branch(MotionRequest, frozen=True, kw_only=True):
    """Move to the target pose on another branch: with another shoulder or elbow.

    Attributes:
        shoulder: Shoulder of the branch of a five-axis arm.
        elbow: Elbow of the branch of a five-axis arm.
        name: Name of the branch, in place of shoulder and elbow; the answer ``branches`` has it.
    """

    traits: ClassVar[RequestTraits] = COMMAND

    shoulder: Literal["front", "back"] | None = None
    elbow: Literal["up", "down"] | None = None
    name: Name | None = None

    def __post_init__(self) -> None:
        five = (self.shoulder is None) + (self.elbow is None)
        if five != (0 if self.name is None else 2):
            raise ValueError("a branch has a shoulder and an elbow, or a name")


class Hold(MotionRequest, frozen=True):
    """Come to rest and drop the target."""

    traits: ClassVar[RequestTraits] = COMMAND

    def command(self) -> cmd.Command:
        return cmd.Hold()
