"""A follower with a server and a leader that a test moves."""

from __future__ import annotations

from typing import Any

import msgspec
import numpy as np

from katana450.extensions.leader.follower import Action, Follower, LeadPhase
from katana450.extensions.leader.joint_map import LeaderPosture
from katana450.server.api import answers

N = 5
PERIOD = 0.01
FINGERS = (0.0, 1.0)


def posture(angle: float, finger: float = 0.5) -> LeaderPosture:
    q = np.full(N, angle)
    return LeaderPosture(q, q, finger)


class Bench:
    """A follower with a server and a leader of which the test is in charge."""

    def __init__(self) -> None:
        self.follower = Follower(FINGERS, "Leader")
        self.t = 100.0
        self.angle, self.finger = 0.3, 0.5
        self.answers = True
        self.server_answers = True
        self.heard = self.t
        self.values: dict[str, Any] = {
            "setpoint": [0.0] * N,
            "stopped": None,
            "revocations": 4,
            "holder": "Leader",
            "program": None,
            "status": "ok",
            "gripper": 0.5,
            "moving": False,
            "why": "",
            "sent": 0.0,
        }

    def step(self, count: int = 1, *, is_asked: bool = False) -> list[Action]:
        """Advance by periods; return the actions of all."""
        actions: list[Action] = []
        for _ in range(count):
            self.t += PERIOD
            if self.server_answers:
                self.heard = self.t
                self.values["sent"] = self.t
            measured = posture(self.angle, self.finger) if self.answers else None
            state = msgspec.convert(self.values, ServerState)
            actions += self.follower.step(self.t, measured, state, self.heard, confirmed=is_asked)  # type: ignore[arg-type]
        return actions

    def arrive(self, angle: float) -> None:
        """Let the program move the arm to ``angle``."""
        self.follower.eased(self.t)
        self.values |= {"setpoint": [angle] * N, "program": program("done"), "revocations": 5}

    def follow(self) -> None:
        """Begin to follow."""
        self.step(5)
        self.step(is_asked=True)
        self.arrive(self.angle)
        self.step(3)
        assert self.follower.phase is LeadPhase.FOLLOWING


class ServerState(msgspec.Struct):
    """The part of a state that the follower reads."""

    setpoint: list[float]
    stopped: str | None
    revocations: int
    holder: str | None
    program: answers.Progress | None
    status: str
    gripper: float
    moving: bool
    why: str
    sent: float


def program(status: str, why: str = "") -> dict[str, str]:
    return {"name": "Leader", "by": "Leader", "status": status, "why": why}
