"""A program with roslibpy: it sees, jogs, follows a trajectory, cancels and stops.

Run by ``test_roslibpy.py`` in a process of its own: ``python roslibpy_client.py URL``.
"""

from __future__ import annotations

import json
import sys
import threading
import time
from collections.abc import Callable
from typing import Any

import roslibpy

JOINTS = ["axis_1", "axis_2", "axis_3", "axis_4", "axis_5"]
READY = [0.0, -1.19, 1.48, 0.14, 0.0]
AWAY = [0.4, -1.1, 1.4, 0.2, 0.3]


def points(*rows: tuple[int, list[float]]) -> dict[str, Any]:
    """Return a goal through postures [rad] at times [s]."""
    listed = [{"positions": q, "time_from_start": {"sec": t, "nanosec": 0}} for t, q in rows]
    return {"trajectory": {"joint_names": JOINTS, "points": listed}}


class Arm:
    """The connection, and the newest message of each topic."""

    def __init__(self, url: str) -> None:
        self.ros = roslibpy.Ros(url)
        self.ros.run()
        self.newest: dict[str, Any] = {}
        self.feedback = 0
        self.follow = roslibpy.ActionClient(
            self.ros,
            "/arm_controller/follow_joint_trajectory",
            "control_msgs/action/FollowJointTrajectory",
        )

    def watch(self, topic: str, kind: str) -> None:
        def heard(message: dict[str, Any]) -> None:
            self.newest[topic] = message

        roslibpy.Topic(self.ros, topic, kind).subscribe(heard)
        wait(lambda: topic in self.newest)

    @property
    def q(self) -> list[float]:
        return list(self.newest["/joint_states"]["position"][:5])

    def send(self, goal: dict[str, Any]) -> tuple[str, list[Any], threading.Event]:
        results: list[Any] = []
        ended = threading.Event()

        def result(content: Any) -> None:
            results.append(content)
            ended.set()

        def progress(_found: Any) -> None:
            self.feedback += 1

        number = self.follow.send_goal(roslibpy.Goal(goal), result, progress, result)
        return number, results, ended

    def call(self, service: str) -> dict[str, Any]:
        answer = roslibpy.Service(self.ros, service, "std_srvs/srv/Trigger").call(
            roslibpy.ServiceRequest(), timeout=10
        )
        return dict(answer)


def wait(true: Callable[[], Any], seconds: float = 15.0) -> None:
    """Wait until ``true`` returns True. Raises TimeoutError."""
    end = time.monotonic() + seconds
    while not true():
        if time.monotonic() > end:
            raise TimeoutError
        time.sleep(0.01)


def main(url: str) -> None:
    """Drive the arm at ``url`` and print what was seen."""
    arm = Arm(url)
    arm.watch("/joint_states", "sensor_msgs/msg/JointState")
    arm.watch("/robot_description", "std_msgs/msg/String")
    report: dict[str, Any] = {
        "topics": arm.ros.get_topics(),
        "description": arm.newest["/robot_description"]["data"][:60],
    }
    _, results, ended = arm.send(points((1, READY), (3, AWAY)))
    assert ended.wait(20), "no result"
    report["followed"] = results[0]["status"].value, results[0]["values"]["error_code"], arm.q
    report["feedback"] = arm.feedback

    number, results, ended = arm.send(points((6, READY)))
    wait(lambda: abs(arm.q[0] - AWAY[0]) > 0.02)
    arm.follow.cancel_goal(number)
    assert ended.wait(20), "no result of the cancelled goal"
    report["cancelled"] = results[0]["status"].value, arm.q[0]

    before = arm.q
    topic = roslibpy.Topic(
        arm.ros, "/servo_node/delta_twist_cmds", "geometry_msgs/msg/TwistStamped"
    )
    for _ in range(30):
        header = {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": "base_link"}
        linear = {"x": 0.0, "y": 0.0, "z": 0.2}
        still = {"x": 0.0, "y": 0.0, "z": 0.0}
        twist = {"linear": linear, "angular": still}
        topic.publish(roslibpy.Message({"header": header, "twist": twist}))
        time.sleep(0.03)
    time.sleep(1.5)
    report["jogged"] = max(abs(a - b) for a, b in zip(arm.q, before, strict=True))

    _, results, ended = arm.send(points((6, READY)))
    rest = arm.q
    wait(lambda: abs(arm.q[0] - rest[0]) > 0.02)
    report["stop"] = arm.call("/stop")
    assert ended.wait(20), "no result of the stopped goal"
    report["stopped"] = results[0]["status"].value, results[0]["values"]["error_string"]
    print(json.dumps(report))
    arm.ros.close()
    arm.ros.terminate()


if __name__ == "__main__":
    main(sys.argv[1])
