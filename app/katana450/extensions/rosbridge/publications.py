"""The topics of the server: messages made from the state of the arm, and which of them are due."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from typing import NamedTuple

from katana450.arm.robot.robot import Robot
from katana450.errors import InputError
from katana450.extensions.rosbridge import protocol
from katana450.extensions.rosbridge.protocol import Fields, Header, OpId, Subscribe, Time, time_of
from katana450.maths.geometry import so3
from katana450.server.api import answers
from katana450.server.service import serialize
from katana450.server.service.arm_handle import ArmHandle
from katana450.server.service.hub import Hub

SILENT_AFTER = 0.3
"""[s] Age at which the state counts as unknown, and topics of the arm are no longer sent."""

PERIODS: Mapping[str, float] = {
    protocol.JOINT_STATES: 0.02,
    protocol.TF: 1.0 / 30.0,
    protocol.STATE: 0.1,
}
"""[s] Interval of each topic. A topic without one is sent once, to each new subscriber."""


OBJECTS = "objects/"
"""Begin of the name of the frame of an object of the scene."""


class Publications(NamedTuple):
    """The topics of one server. ``description``: the text of /robot_description."""

    hub: Hub
    description: str

    def message(self, topic: str) -> Fields | None:
        """Return the present message of ``topic``; None while there is none.

        Raises LeaseError until there is an arm.
        """
        arm = self.hub.present()
        match topic:
            case protocol.ROBOT_DESCRIPTION:
                return {"data": self.description}
            case protocol.STATE:
                return {"data": answers.encoded(serialize.state(self.hub))}
            case protocol.TF_STATIC:
                return transforms(arm, time_of(time.time()), moving=False)
        if arm.age > SILENT_AFTER:
            return None
        now = time.time()
        # An arm at rest has its state now.
        age = max(self.hub.clock() - arm.state.t, 0.0) if arm.state.moving else 0.0
        stamp = time_of(now - age)
        if topic == protocol.TF:
            return transforms(arm, stamp, moving=True)
        return joint_state(arm, stamp)


def joint_state(arm: ArmHandle, stamp: Time) -> Fields:
    """Return all movable joints: positions [rad or m], and the rates of the arm's setpoints.

    The rate of a joint beside the arm's axes is 0. There are no efforts.
    """
    now, robot = arm.state, arm.robot
    values = robot.joint_values(now.q, now.gripper)
    rates = dict(zip(axis_names(robot), now.motion.qd.tolist(), strict=True))
    return {
        "header": Header(stamp=stamp),
        "name": list(values),
        "position": list(values.values()),
        "velocity": [rates.get(name, 0.0) for name in values],
        "effort": [],
    }


def axis_names(robot: Robot) -> tuple[str, ...]:
    """Return the names of the joints of a joint vector, in its order."""
    return robot.driven if robot.arm is None else robot.arm.chain.names


def transforms(arm: ArmHandle, stamp: Time, *, moving: bool) -> Fields:
    """Return the poses of what moves, or else of the fixed links, in their parents.

    Links that joints move are in their parents, objects of the scene in the root. Translations are
    in m, rotations unit quaternions.
    """
    values, links = arm.robot.joint_values(arm.state.q, arm.state.gripper), arm.robot.links
    placed = [
        (link.parent, link.name, link.at_rest(values))
        for link in links
        if link.parent is not None and (link.joint is not None) is moving
    ]
    for scene_object in arm.state.objects if moving else ():
        T = arm.environment.pose(scene_object, arm.state.x)
        placed.append((links[0].name, f"{OBJECTS}{scene_object.name}", T))
    poses: list[Fields] = []
    for parent, child, T in placed:
        translation = dict(zip("xyz", T[:3, 3].tolist(), strict=True))
        rotation = dict(zip("wxyz", so3.to_quaternion(T[:3, :3]).tolist(), strict=True))
        poses.append(
            {
                "header": Header(stamp=stamp, frame_id=parent),
                "child_frame_id": child,
                "transform": {"translation": translation, "rotation": rotation},
            }
        )
    return {"transforms": poses}


MAX_SUBSCRIPTIONS = 16
"""Maximum number of subscriptions of one client to one topic."""

RETRY_SECONDS = 0.1
"""[s] Time after which a topic that had no message is tried again."""


class Subscriptions:
    """The subscriptions of one client. A topic is sent at the rate of the fastest one.

    Its name is repeated as the client gave it, with or without the first slash.
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        """Begin without subscriptions. ``clock`` is in seconds."""
        self._clock = clock
        self._intervals: dict[str, dict[OpId, float]] = {}
        self._due: dict[str, float] = {}

    def add(self, op: Subscribe) -> None:
        """Subscribe; a topic without an interval is sent again. Raises InputError."""
        name = protocol.resolved(op.topic)
        known = protocol.PUBLISHED.get(name)
        if known is None:
            reason = "is only for commands" if name in protocol.COMMANDED else "does not exist"
            raise InputError(
                f"The topic {op.topic} {reason}. The topics are {', '.join(protocol.PUBLISHED)}."
            )
        if op.type and not protocol.is_type(op.type, known):
            raise InputError(f"The messages of {op.topic} are {known}, not {op.type}.")
        if op.compression not in (None, "", "none"):
            raise InputError(f"There is no compression {op.compression[:40]!r}, only 'none'.")
        if op.fragment_size:
            raise InputError("Messages are not sent in fragments. Leave out fragment_size.")
        intervals = self._intervals.setdefault(op.topic, {})
        if op.id not in intervals and len(intervals) >= MAX_SUBSCRIPTIONS:
            raise InputError(f"A client can subscribe {MAX_SUBSCRIPTIONS} times to a topic.")
        intervals[op.id] = max(PERIODS.get(name, 0.0), 1e-3 * op.throttle_rate)
        self._due[op.topic] = self._clock()

    def remove(self, topic: str, op_id: OpId) -> None:
        """End the subscription ``op_id``, or all if it is None. Raises InputError without one."""
        intervals = self._intervals.get(topic)
        if intervals is None or (op_id is not None and op_id not in intervals):
            raise InputError(f"There is no subscription {op_id!r} of {topic}.")
        if op_id is not None:
            del intervals[op_id]
        if op_id is None or not intervals:
            del self._intervals[topic]
            self._due.pop(topic, None)

    def hurry(self) -> None:
        """Make the state due, as when a stop begins, is confirmed or is cleared."""
        for topic in self._due:
            if protocol.resolved(topic) == protocol.STATE:
                self._due[topic] = self._clock()

    def next_due(self) -> tuple[str | None, float | None]:
        """Return the topic that has been due longest, and the time until the next one [s]."""
        if not self._due:
            return None, None
        topic, due = min(self._due.items(), key=lambda entry: entry[1])
        left = due - self._clock()
        if left > 0.0:
            return None, left if math.isfinite(left) else None
        return topic, 0.0

    def sent(self, topic: str) -> None:
        """Note that a message of ``topic`` is being sent now."""
        if protocol.resolved(topic) not in PERIODS:
            del self._due[topic]
            return
        t, interval = self._clock(), min(self._intervals[topic].values())
        # Late messages are not sent twice to catch up.
        self._due[topic] = max(self._due[topic] + interval, t)

    def missed(self, topic: str) -> None:
        """Note that there is no message of ``topic`` yet."""
        self._due[topic] = self._clock() + RETRY_SECONDS

    def delay(self, seconds: float) -> None:
        """Make nothing due for ``seconds`` [s]."""
        earliest = self._clock() + seconds
        self._due = {topic: max(due, earliest) for topic, due in self._due.items()}
