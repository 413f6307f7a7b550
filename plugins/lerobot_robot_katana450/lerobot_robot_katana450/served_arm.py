"""An arm that a katana450 server drives, with its joints as features of LeRobot.

This module needs no LeRobot. Robot and teleoperator have it in common.
"""

import atexit
import math
from collections.abc import Mapping
from contextlib import ExitStack, suppress
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from katana450.caching import cached_property
from katana450.client import Client, RefusedError, connect
from katana450.client.files import LostError
from katana450.errors import InputError, KatanaError
from katana450.sdk import answers, requests

Vector = npt.NDArray[np.float64]

ROBOT_NAME, TELEOPERATOR_NAME = "LeRobot", "LeRobot's teleoperator"
"""Names of the connections, which people see on the page."""

ROLL = "wrist_roll"
"""Joint of an SO-100 or SO-101 that turns without end, so that its calibrated middle is zero."""

MAX_AGE = 0.3
"""[s] Age from which a state counts as unknown."""

UNMEASURED_MODES = ("disconnected", "lost")
"""Modes of a real arm that is not measured."""


class JointFeatures:
    """The joints of an arm, and its fingers if it has any, as numbers with names.

    Attributes:
        names: names of the N numbers.
    """

    def __init__(self, arm: answers.Arm, *, use_degrees: bool) -> None:
        """Take the names and units of our datasets, or those of LeRobot's SO-101.

        Args:
            arm: description of the arm, of n joints.
            use_degrees: whether joints have their own names, and are in degrees from the middle of
                their range, and fingers in percent of their range. Otherwise all are in rad or m.
        """
        joints = arm.joints if use_degrees else [f"theta{k + 1}" for k in range(len(arm.joints))]
        lower, upper = np.array(arm.lower), np.array(arm.upper)
        turns = np.array([use_degrees and not slides for slides in arm.slides])
        middle = np.where([name == ROLL for name in arm.joints], 0.0, 0.5 * (lower + upper))
        zero, scale = np.where(turns, middle, 0.0), np.where(turns, 180.0 / math.pi, 1.0)
        if arm.gripper is not None:
            closed, opened, _ = arm.gripper
            joints = [*joints, "gripper"]
            lower = np.append(lower, min(closed, opened))
            upper = np.append(upper, max(closed, opened))
            zero = np.append(zero, closed if use_degrees else 0.0)
            scale = np.append(scale, 100.0 / (opened - closed) if use_degrees else 1.0)
        self.names = tuple(f"{joint}.pos" for joint in joints)
        self._lower, self._upper, self._zero, self._scale = lower, upper, zero, scale

    def numbers(self, joints: Vector) -> dict[str, float]:
        """Return the numbers of ``joints`` (N,) [rad or m] by their names."""
        numbers = (joints - self._zero) * self._scale
        return dict(zip(self.names, numbers.tolist(), strict=True))

    def joints(self, numbers: Mapping[str, float]) -> Vector:
        """Return the joints (N,) [rad or m] of ``numbers``, within their limits.

        Raises InputError if one is missing.
        """
        if missing := [name for name in self.names if name not in numbers]:
            raise InputError(
                f"The action has no {', '.join(missing)}, but {', '.join(numbers) or 'nothing'}. "
                "Give robot and teleoperator the same use_degrees, and the same kind of arm."
            )
        values = np.array([float(numbers[name]) for name in self.names])
        joints: Vector = np.clip(values / self._scale + self._zero, self._lower, self._upper)
        return joints


@dataclass(kw_only=True)
class ServerOptions:
    """Options of robot and teleoperator.

    Attributes:
        url: address of the server.
        token: token of an access link, if the server requires one.
        use_degrees: see ``JointFeatures``.
    """

    url: str = "http://127.0.0.1:8080"
    token: str = ""
    use_degrees: bool = False


class ServedArm:
    """The arm of a server. Each method raises LostError without one, or for a late state."""

    def __init__(self, options: ServerOptions, name: str) -> None:
        """Connect to nothing yet. ``name``: name that people see."""
        self._options = options
        self._address = (options.url, name, options.token)
        self._client: Client | None = None
        self._closing = ExitStack()
        self._revocations: int | None = None
        self._answered = False

    @property
    def is_open(self) -> bool:
        """True while there is a connection."""
        return self._client is not None

    @cached_property
    def description(self) -> answers.Arm:
        """Description of the arm, which the server knows."""
        with connect(*self._address) as client:
            return client.query(answers.Arm)

    @cached_property
    def features(self) -> JointFeatures:
        """The joints as features."""
        return JointFeatures(self.description, use_degrees=self._options.use_degrees)

    def open(self) -> None:
        """Connect to the server. Raises RefusedError if it does not admit us."""
        self._client = self._closing.enter_context(connect(*self._address))
        # LeRobot leaves a device open when it cannot connect to the other one.
        atexit.register(self.close)

    def drive(self) -> None:
        """Acquire the lease. Raises RefusedError with what to do if the arm cannot be driven."""
        client = self._connected()
        try:
            client.ask(requests.Acquire())
        except RefusedError as error:
            raise RefusedError(
                f"{error} Or record what another driver does: --robot.drive=false."
            ) from error
        state = client.query(answers.State)
        self._revocations, self._answered = state.revocations, False
        if state.stopped is not None:
            raise RefusedError(f"The arm is stopped: {state.stopped} Clear the stop on the page.")

    def state(self) -> answers.State:
        """Return the present state.

        Raises RefusedError if we drove the arm, and it was stopped or changed its driver since.
        """
        state = self._connected().query(answers.State)
        if state.age > MAX_AGE:
            raise LostError(f"The arm has not answered its server for {state.age:.1f} s.")
        if state.arm is not None and state.arm.mode in UNMEASURED_MODES:
            raise LostError(f"The arm is {state.arm.mode}. {state.arm.note}".strip())
        if self._revocations not in (None, state.revocations):
            raise RefusedError(f"{_reason(state)} LeRobot no longer drives it. Begin again.")
        return state

    def measured(self) -> dict[str, float]:
        """Return the joints as the arm reports them, by names."""
        state = self.state()
        return self._numbers(np.array(state.q), state.gripper)

    def setpoint(self, lead: float) -> dict[str, float]:
        """Return the setpoint ``lead`` [s] from now at its present rates, by names.

        Raises InputError if LeRobot drives this arm, which would follow itself.
        """
        state = self.state()
        if state.holder is not None and state.holder.startswith(ROBOT_NAME):
            raise InputError(
                "LeRobot drives the arm whose setpoints it asks for. "
                "Add --robot.drive=false, and drive the arm on the page."
            )
        finger = state.gripper if state.arm is None else state.arm.expected[-1]
        if self.description.gripper is not None:
            reach = lead * self.description.gripper[2]
            finger += min(max(state.gripper_goal - finger, -reach), reach)
        q = np.array(state.setpoint) + lead * np.array(state.qd)
        return self._numbers(np.clip(q, self.description.lower, self.description.upper), finger)

    def follow(self, action: Mapping[str, float]) -> dict[str, float]:
        """Let the arm follow the sample ``action``; return the part of it within the limits."""
        client, joints = self._connected(), self.features.joints(action)
        count = len(self.description.joints)
        sample = requests.Servo(
            q=joints[:count],
            gripper=float(joints[count]) if len(joints) > count else None,
            revocations=self._revocations,
        )
        if self._answered:
            # A late sample is left out, and states say whether the arm was stopped.
            client.send(sample)
        else:
            client.ask(sample)
            self._answered = True
        return self.features.numbers(joints)

    def close(self) -> None:
        """Release the lease, and close the connection. The arm comes to rest by itself."""
        if self._client is not None and self._revocations is not None:
            # Somebody may have taken it, or the server is lost.
            with suppress(KatanaError):
                self._client.ask(requests.ReleaseLease())
        self._client = self._revocations = None
        self._closing.close()
        atexit.unregister(self.close)

    def _connected(self) -> Client:
        if self._client is None:
            raise LostError("There is no connection to the server: call connect() first.")
        return self._client

    def _numbers(self, q: Vector, finger: float) -> dict[str, float]:
        fingers = [] if self.description.gripper is None else [finger]
        return self.features.numbers(np.append(q, fingers))


def _reason(state: answers.State) -> str:
    """Return why LeRobot no longer drives the arm."""
    if state.stopped is not None:
        return f"The arm was stopped: {state.stopped}"
    if state.holder is None or not state.holder.startswith(ROBOT_NAME):
        return f"{state.holder or 'Nobody'} drives the arm now."
    return f"The arm was paused. {state.why}".strip()


class ServedDevice:
    """A device of LeRobot that is the arm of a server, which calibrates and configures it."""

    _arm: ServedArm

    @property
    def is_connected(self) -> bool:
        """True while there is a connection to the server."""
        return self._arm.is_open

    @property
    def is_calibrated(self) -> bool:
        """Always true."""
        return True

    def calibrate(self) -> None:
        """Do nothing."""

    def configure(self) -> None:
        """Do nothing."""
