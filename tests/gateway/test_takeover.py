"""A person moves the arm that a policy drives, and gives it back."""

from __future__ import annotations

import numpy as np
import pytest

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.lease import Role
from katana450.arm.control.state.state import State
from katana450.client import Client, RefusedError
from katana450.errors import LeaseError
from katana450.extensions.programs.server.program_runner import ProgramRunner
from katana450.server.api import answers, requests
from katana450.server.api.program_requests import ProgramOrder
from katana450.server.service import status
from katana450.server.service.identity import Identity
from katana450.server.service.participants import Participant
from tests.conftest import LONG
from tests.gateway.virtual import VirtualServer

TAKEOVERS = 400 if LONG else 4
TINY = 1e-9
MOVES = (cmd.Joint(1, -0.4), cmd.Jog(np.array((0.05, 0.0, 0.05, 0.0, 0.0))), cmd.GoToZero())


class Drive:
    """A policy that streams joints, and the states of its arm, which keep the limits."""

    def __init__(self, server: VirtualServer, policy: Client) -> None:
        self.server, self.policy, self.t = server, policy, 0.0
        self.ready = server.hub.present().session.ready
        self.limits = server.hub.present().session.require_arm().limits
        self.last = server.hub.present().state
        assert isinstance(server.hub.runner, ProgramRunner)
        self.runner = server.hub.runner

    def join(self, page: str, role: Role = Role.ADMIN) -> Participant:
        return self.server.hub.join(Identity(page, None, role), page, lambda _notice: None)

    def wait(self, seconds: float, page: Participant, *, streams: bool = True) -> None:
        """Let ``seconds`` pass, in which the policy streams."""
        for _ in range(round(seconds / 0.02)):
            self.t += 0.02
            q = self.ready + 0.3 * np.sin(1.5 * self.t) * np.array((1.0, 0.3, 0.3, 0.3, 0.5))
            if streams:
                self.policy.send(requests.Servo(q=q, qd=np.zeros(5)))
            self.server.hub.heartbeat(page)
            self.server.sleep(0.01)
            self.look()
            self.server.sleep(0.01)
            self.look()

    def look(self) -> None:
        """Check that neither speed nor acceleration has a step since the last look."""
        before, self.last = self.last, self.server.hub.present().state
        dt = self.last.t - before.t
        change = np.abs(self.last.motion.qd - before.motion.qd)
        assert (change <= self.limits.acceleration * dt + TINY).all()
        assert (np.abs(self.last.setpoint - before.setpoint) <= self.limits.speed * dt + TINY).all()


@pytest.fixture
def drive(local: VirtualServer, program: Client) -> Drive:
    return Drive(local, program)


def orders(drive: Drive, page: Participant) -> list[str]:
    shown: list[str] = status.of(drive.server.hub, page)["orders"]
    return shown


def test_person_takes_over_from_a_policy_without_a_step(drive: Drive) -> None:
    hub, ada, rng = drive.server.hub, drive.join("ada"), np.random.default_rng(3)
    policy = hub.lease.holder
    for number in range(TAKEOVERS):
        drive.wait(0.3 + 0.02 * int(rng.integers(50)), ada)
        assert (hub.lease.holder, hub.stopped) == (policy, None)
        hub.move(ada, MOVES[number % len(MOVES)])
        # The policy still streams; its setpoints are refused.
        drive.wait(0.4, ada)
        assert hub.lease.holder == ada.person
        assert orders(drive, ada) == ["continue", "rewind"]
        with pytest.raises(RefusedError, match="holds the arm"):
            drive.policy.ask(requests.Home())
        drive.runner.steer(ada, ProgramOrder.CONTINUE)
        assert orders(drive, ada) == []
    assert drive.policy.query(answers.State).holder == "Test"


def test_takeover_is_rewound_stopped_and_refused_to_others(drive: Drive) -> None:
    hub, ada, eve = drive.server.hub, drive.join("ada"), drive.join("eve", Role.OPERATOR)
    viewer = drive.join("vera", Role.VIEWER)
    drive.policy.nudge(1, 0.1)
    # One motion is no stream, and a person is not taken from.
    with pytest.raises(LeaseError, match="Test holds the arm"):
        hub.move(ada, cmd.Joint(1, 0.2))
    drive.wait(0.5, ada)
    for other, why in ((eve, "Test holds the arm"), (viewer, "may only watch")):
        with pytest.raises(LeaseError, match=why):
            hub.move(other, cmd.Joint(1, 0.2))
    hub.gate.claim(hub.at_scene(ada.person.key, hub.gate.revocations), of_arm=True)
    assert hub.lease.holder != ada.person
    hub.move(ada, cmd.Joint(1, -0.4))
    before: State = hub.gate.takeover.state if hub.gate.takeover else drive.last
    drive.wait(1.0, ada, streams=False)
    assert status.of(hub, ada)["continues"] == ["Test", 0, 0]
    drive.runner.steer(ada, ProgramOrder.REWIND)
    drive.server.sleep(0.05)
    np.testing.assert_allclose(hub.present().state.setpoint, before.setpoint, atol=0.05)
    drive.policy.stop()
    assert orders(drive, ada) == []
    with pytest.raises(LeaseError, match="stopped"):
        drive.runner.steer(ada, ProgramOrder.CONTINUE)
    drive.server.sleep(1.5)
    hub.heartbeat(ada)
    hub.move(ada, cmd.ClearStop())
    drive.runner.steer(ada, ProgramOrder.CONTINUE)
    assert drive.policy.query(answers.State).holder == "Test"
