"""Requests that move the joints, one by one or with the tool."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar

from msgspec import Meta

from katana450.maths.kinematics.velocity import JogFrame
from katana450.server.api.fields import (
    COMMAND,
    MAX_ANGULAR_RATE,
    MAX_JOINTS,
    MAX_LINEAR_RATE,
    Frame,
    Matrix4,
    Rates,
    Request,
    RequestTraits,
    Vector3,
)


class Jog(Request, frozen=True, kw_only=True):
    """Move for 0.2 s: (x, y, z) [m/s], pitch and roll [rad/s], along the axes of a frame.

    To be said again while the motion shall last.
    """

    traits: ClassVar[RequestTraits] = RequestTraits(stream=True)

    rates: Rates
    frame: JogFrame = JogFrame.BASE

    def __post_init__(self) -> None:
        limits = (MAX_LINEAR_RATE,) * 3 + (MAX_ANGULAR_RATE,) * 2
        for rate, limit in zip(self.rates, limits, strict=True):
            if not math.isfinite(rate) or abs(rate) > limit:
                raise ValueError(f"{rate} is no rate between {-limit:g} and {limit:g}")


class Joint(Request, frozen=True, kw_only=True):
    """Drive one joint; ``axis`` counts from 1. What slides is told in m."""

    traits: ClassVar[RequestTraits] = COMMAND

    axis: Annotated[int, Meta(ge=1, le=MAX_JOINTS)]
    value: float


class Joints(Request, frozen=True, kw_only=True):
    """Drive all joints to ``q``; they arrive together, on a straight line in joint space."""

    traits: ClassVar[RequestTraits] = COMMAND

    q: Annotated[list[float], Meta(min_length=1, max_length=MAX_JOINTS)]


class Servo(Request, frozen=True, kw_only=True):
    """One of a stream of joint angles, followed under the limits of speed, acceleration and jerk.

    ``qd`` says how fast they change; without it that is seen from the stream, less exactly. When no
    other comes for 0.2 s the arm comes to rest.
    """

    traits: ClassVar[RequestTraits] = RequestTraits(stream=True)

    q: Annotated[list[float], Meta(min_length=1, max_length=MAX_JOINTS)]
    qd: Annotated[list[float], Meta(min_length=1, max_length=MAX_JOINTS)] | None = None


class Pose(Request, frozen=True, kw_only=True):
    """Bring the tool to a pose, as near as five axes can; what gives way is the ``priority``'s."""

    traits: ClassVar[RequestTraits] = COMMAND

    T: Matrix4
    frame: Frame = Frame.SHOULDER


class Position(Request, frozen=True, kw_only=True):
    """Bring the tool point somewhere; pitch and roll stay as wished."""

    traits: ClassVar[RequestTraits] = COMMAND

    p: Vector3
    frame: Frame = Frame.SHOULDER


class Turn(Request, frozen=True, kw_only=True):
    """Give the tool a pitch (positive downwards) and a roll; its point stays as wished."""

    traits: ClassVar[RequestTraits] = COMMAND

    pitch: float
    roll: float


class Gripper(Request, frozen=True, kw_only=True):
    """Drive the finger joint; the arm's description says between which angles."""

    traits: ClassVar[RequestTraits] = COMMAND

    angle: float


class EndDrag(Request, frozen=True):
    """End a drag: the nearest pose that the arm can reach becomes the target."""

    traits: ClassVar[RequestTraits] = COMMAND


class Home(Request, frozen=True):
    """Drive to the ready posture."""

    traits: ClassVar[RequestTraits] = COMMAND


class GoToZero(Request, frozen=True):
    """Drive to the zero posture, the arm stretched along x."""

    traits: ClassVar[RequestTraits] = COMMAND
