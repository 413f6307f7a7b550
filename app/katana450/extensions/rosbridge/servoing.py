"""Twists and rates of joints as MoveIt Servo takes them, and the motion of a stream of them.

An arm of the five-axis family turns its tool about two axes only: that of pitch, which is
horizontal and across the arm, and that of roll, which is the tool's own. How it turns about a third
follows from the path of the tool point. So a twist without rotation keeps pitch and roll, and a
rotation about another axis is refused. Other arms take any rotation.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from enum import Enum

import numpy as np

from katana450.arm.control.commands.joint_commands import JOG_TIME
from katana450.errors import InputError, KatanaError
from katana450.extensions.rosbridge.protocol import Header, JointJog, Twist, TwistStamped, Vector3
from katana450.extensions.rosbridge.publications import axis_names
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.tool import pitched_frame
from katana450.server.api import answers, requests
from katana450.server.service.arm_handle import ArmHandle
from katana450.server.service.hub import Hub

COMMAND_TIMEOUT = 0.1
"""[s] Time for which a command is valid, as ``incoming_command_timeout`` of MoveIt Servo."""

STREAM_GAP = 0.5
"""[s] Pause between two commands from which on the second one begins another motion."""

IMPOSSIBLE = 0.01
"""Fraction of an angular velocity about an axis that the arm does not have: rounding, and the
motion of the arm while the command is on its way."""


LINEAR_SCALE, ROTATIONAL_SCALE, JOINT_SCALE = 0.4, 0.8, 0.5
"""Speeds that the value 1 of a command stands for, as MoveIt Servo comes: of the tool point [m/s],
of pitch and roll [rad/s], of a joint [rad/s or m/s]."""


def check_fresh(header: Header, now: float) -> None:
    """Raise InputError if ``header`` is older than COMMAND_TIMEOUT at ``now`` [s since the epoch].

    A stamp of zero stands for the time of receipt.
    """
    stamp = header.stamp.seconds
    if stamp and now - stamp > COMMAND_TIMEOUT:
        raise InputError(
            f"The stamp of this command is {now - stamp:.2f} s old; the maximum is "
            f"{COMMAND_TIMEOUT:g} s. If the clocks differ, leave its stamp zero."
        )


def tool_rates(
    twist: Twist,
    R_shoulder_frame: FloatArray,
    R_shoulder_pitched: FloatArray | None,
) -> FloatArray:
    """Return the rates of a jog along {S}.

    They are (5,): (x, y, z) [m/s], pitch and roll [rad/s]. For an arm outside the five-axis family
    they are (6,): (x, y, z) [m/s] and the angular velocity [rad/s].

    Args:
        twist: velocity of the tool point, and angular velocity of the tool, each from -1 to 1.
        R_shoulder_frame: (3, 3) orientation in {S} of the frame of ``twist``.
        R_shoulder_pitched: (3, 3) the axes of ``pitched_frame`` in {S}; None for an arm outside the
            five-axis family.

    Raises:
        InputError: a number is out of range, or the arm has no axis for the rotation.
    """
    linear = _scaled(twist.linear, LINEAR_SCALE, "linear")
    angular = _scaled(twist.angular, ROTATIONAL_SCALE, "angular")
    v, omega = R_shoulder_frame @ linear, R_shoulder_frame @ angular
    if R_shoulder_pitched is None:
        return np.concatenate((v, omega))
    roll_axis, pitch_axis, other = R_shoulder_pitched.T
    size, impossible = float(np.linalg.norm(omega)), float(other @ omega)
    if abs(impossible) > IMPOSSIBLE * size:
        # Without a minus sign in front of a zero.
        x, y, z = (np.round(R_shoulder_frame.T @ other, 3) + 0.0).tolist()
        raise InputError(
            f"The five axes of the arm cannot make {abs(impossible):.3g} rad/s of this rotation, "
            f"about ({x:.3f}, {y:.3f}, {z:.3f}) in the frame of the command. It can turn the tool "
            "about the tool's own axis (roll) and about the horizontal axis across the arm "
            "(pitch). Set this part of `angular` to 0."
        )
    return np.array([*v, pitch_axis @ omega, roll_axis @ omega])


def joint_rates(jog: JointJog, joints: Sequence[str]) -> FloatArray:
    """Return the rates (n,) [rad/s or m/s] of ``joints``; those that ``jog`` does not name are 0.

    Raises InputError for unknown or repeated joints, and for numbers that are out of range.
    """
    if any(jog.displacements):
        raise InputError("`displacements` are not supported. Send `velocities`.")
    if len(jog.velocities) != len(jog.joint_names):
        raise InputError(
            f"There are {len(jog.joint_names)} names of joints and {len(jog.velocities)} "
            "velocities. Send one velocity for each joint."
        )
    unknown = [name for name in jog.joint_names if name not in joints]
    if unknown:
        raise InputError(f"There is no joint {unknown[0]!r}. The joints are {', '.join(joints)}.")
    if len(set(jog.joint_names)) != len(jog.joint_names):
        raise InputError("A joint is named twice.")
    velocities = dict(zip(jog.joint_names, jog.velocities, strict=True))
    for name, fraction in velocities.items():
        _check_fraction(fraction, f"The velocity of {name}")
    return np.array([JOINT_SCALE * velocities.get(name, 0.0) for name in joints])


def rotation_of(frame: str, arm: ArmHandle) -> FloatArray:
    """Return the orientation (3, 3) in {S} of the link ``frame``, by default of the root.

    Raises InputError for an unknown frame.
    """
    robot, state = arm.robot, arm.state
    frames = robot.frames(robot.joint_values(state.q, state.gripper))
    T = frames.get(frame or robot.links[0].name)
    if T is None:
        raise InputError(f"There is no frame {frame!r}. The frames are {', '.join(frames)}.")
    return T[:3, :3] if robot.arm is None else robot.arm.T_base_shoulder[:3, :3].T @ T[:3, :3]


def _scaled(vector: Vector3, scale: float, part: str) -> FloatArray:
    fractions = vector.x, vector.y, vector.z
    for axis, fraction in zip("xyz", fractions, strict=True):
        _check_fraction(fraction, f"`{part}.{axis}`")
    return scale * np.array(fractions)


def _check_fraction(fraction: float, what: str) -> None:
    if not abs(fraction) <= 1.0:
        raise InputError(f"{what} is {fraction:g}; it must be from -1 to 1 without unit.")


class ServoMotion(Enum):
    """The part that the stream moves."""

    NOTHING = "nothing"
    TOOL = "tool"
    JOINTS = "joints"


class ServoStream:
    """Follows the newest command for COMMAND_TIMEOUT, then brings the arm to rest.

    A stream that continues over a stop or a change of driver stays refused until it has paused for
    STREAM_GAP: the person who steers may not have seen the stop.
    """

    def __init__(self, hub: Hub, ask: Callable[[requests.Request], answers.Answer]) -> None:
        """Create a stream that has not begun. ``ask`` executes a request of the client."""
        self._hub = hub
        self._ask = ask
        self._motion = ServoMotion.NOTHING
        self._last = -math.inf
        self._revocations = 0
        self._rates = np.zeros(0)
        self._q = np.zeros(0)
        self._t = 0.0

    @property
    def moves(self) -> bool:
        """True while a command is being followed."""
        return self._motion is not ServoMotion.NOTHING

    def twist(self, message: TwistStamped) -> None:
        """Move the tool. Raises KatanaError if that is refused."""
        check_fresh(message.header, time.time())
        arm = self._hub.present()
        state, mounted = arm.state, arm.arm
        R = rotation_of(message.header.frame_id, arm)
        pitched = None
        if mounted.kinematics_to(state.tool).freedoms == 5:
            pitched = pitched_frame(mounted.chain_to(state.tool), state.q)
        self._drive(ServoMotion.TOOL, tool_rates(message.twist, R, pitched))

    def jog(self, message: JointJog) -> None:
        """Move joints. Raises KatanaError if that is refused."""
        check_fresh(message.header, time.time())
        names = axis_names(self._hub.present().robot)
        self._drive(ServoMotion.JOINTS, joint_rates(message, names))

    def _drive(self, motion: ServoMotion, rates: FloatArray) -> None:
        """Move the tool at ``rates`` as `requests.Jog`, or the joints [rad/s or m/s].

        Raises KatanaError if that is refused.
        """
        t = self._hub.clock()
        if t - self._last > STREAM_GAP:
            self._revocations = self._hub.gate.revocations
        self._last = t
        if not rates.any():
            self._end(motion)
            return
        if self._motion is not motion:
            self._end(self._motion)
            self._motion = motion
            self._q, self._t = self._hub.present().state.setpoint.copy(), t
        self._rates = rates
        if motion is ServoMotion.TOOL:
            self._send(requests.Jog(rates=rates, revocations=self._revocations))
        else:
            self._follow()

    def tick(self) -> None:
        """Continue, or end the motion if the newest command is too old.

        Raises KatanaError if the motion is refused, which ends it.
        """
        if not self.moves:
            return
        if self._hub.clock() - self._last > COMMAND_TIMEOUT:
            self._end(self._motion)
        elif self._motion is ServoMotion.JOINTS:
            self._follow()

    def _follow(self) -> None:
        """Send the angles at which the joints should be now."""
        state, t = self._hub.present().state, self._hub.clock()
        # The angles that are sent may lead those of the arm by the time that a jog lasts.
        lead = JOG_TIME * np.abs(self._rates)
        q = self._q + self._rates * (t - self._t)
        # The lead stays bounded if the arm is slower or cannot continue.
        self._q, self._t = np.clip(q, state.setpoint - lead, state.setpoint + lead), t
        request = requests.Servo(q=self._q, qd=self._rates, revocations=self._revocations)
        self._send(request)

    def _send(self, request: requests.Request) -> None:
        try:
            self._ask(request)
        except KatanaError:
            self._motion = ServoMotion.NOTHING
            raise

    def _end(self, motion: ServoMotion) -> None:
        """Bring the arm to rest if ``motion`` is what moves it now."""
        if motion is not self._motion or motion is ServoMotion.NOTHING:
            return
        self._motion = ServoMotion.NOTHING
        if motion is ServoMotion.TOOL:
            # Keeps the tool on its line; a hold brakes each joint by itself.
            rest = requests.Jog(np.zeros(len(self._rates)), revocations=self._revocations)
            self._ask(rest)
        else:
            self._ask(requests.Hold(revocations=self._revocations))
