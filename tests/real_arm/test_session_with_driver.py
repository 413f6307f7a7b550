"""The control loop with its session drives the emulated arm, from the connection to a stop."""

from __future__ import annotations

import random
import time
from collections.abc import Callable, Iterator

import numpy as np
import pytest

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.session.session import Session
from katana450.arm.control.state.arm_report import ArmAct, ArmMode
from katana450.arm.control.state.state import Reason, State
from katana450.arm.drivers.driver import Driver
from katana450.arm.runtime.clock import MonotonicClock
from katana450.arm.runtime.loop import ControlLoop
from katana450.arm.runtime.mailbox import Mailbox
from katana450.assembly.robot_session import describe_robot
from katana450.extensions.device_address import DeviceAddress
from katana450.extensions.programs.run.runner import Phase
from katana450.extensions.programs.run.simulation import plan_script, run_by_clock
from katana450.extensions.programs.script.script import parse
from katana450.extensions.programs.script.script_files import library_file, script_text
from katana450.extensions.real_arm.driver.katana_driver import KatanaDriver
from katana450.extensions.real_arm.emulator.arm import EmulatedArm, joints_at
from katana450.resources import URDF_PATH
from katana450.settings import Settings
from tests.real_arm.emulated import FaultyServer
from tests.real_arm.paper_arm import ENDS, JOINTS


class Operator:
    """A person at the loop: gives commands and looks at the state."""

    def __init__(self, session: Session, driver: Driver) -> None:
        self._mailbox = Mailbox(session.check)
        self.loop = ControlLoop(session, driver, self._mailbox, MonotonicClock(), 100.0)

    @property
    def state(self) -> State:
        return self.loop.state_publisher.snapshot.state

    def mode(self) -> ArmMode:
        report = self.state.report
        return ArmMode.DISCONNECTED if report is None else report.mode

    def give(self, command: cmd.Command) -> None:
        self._mailbox.put(command)

    def until(self, condition: Callable[[State], bool], seconds: float = 8.0) -> State:
        end = time.perf_counter() + seconds
        while time.perf_counter() < end:
            if condition(state := self.state):
                return state
            time.sleep(0.005)
        raise AssertionError(f"{self.mode()}, {self.state.findings}, {self.state.stopped}")

    def perform(self, act: ArmAct, mode: ArmMode) -> None:
        self.give(cmd.OperateArm(act, confirmed=True))
        self.until(lambda _: self.mode() is mode)

    def clear_stop(self) -> None:
        # A stop may be cleared 1 s after it.
        end = time.perf_counter() + 5.0
        while self.state.stopped is not None and time.perf_counter() < end:
            self.give(cmd.ClearStop())
            time.sleep(0.1)
        assert self.state.stopped is None


@pytest.fixture(params=["fast", pytest.param("slow", marks=pytest.mark.long)])
def operator(request: pytest.FixtureRequest) -> Iterator[Operator]:
    chance = random.Random(450)
    delay = (lambda: chance.uniform(0.03, 0.05)) if request.param == "slow" else (lambda: 0.0)
    arm = EmulatedArm(calibration_scale=60.0)
    server = FaultyServer(arm, delay)
    server.start()
    session = describe_robot(Settings(), URDF_PATH, None).session
    operator = Operator(
        session, KatanaDriver(DeviceAddress("127.0.0.1", server.port), ENDS, JOINTS)
    )
    operator.loop.start()
    yield operator
    operator.loop.stop()
    server.stop()


def test_person_connects_calibrates_moves_and_stops(operator: Operator) -> None:
    operator.until(lambda state: state.stopped is not None)
    operator.perform(ArmAct.CONNECT, ArmMode.UNCALIBRATED)
    assert "calibrate it" in operator.state.report.note  # type: ignore[union-attr]
    operator.perform(ArmAct.CALIBRATE, ArmMode.HOLDING)
    operator.clear_stop()
    # Slow enough that a machine that others keep busy sends the setpoints in time.
    operator.give(cmd.Speed(0.3))
    start = operator.state.q.copy()
    # The calibrated posture is at the ends of the axes.
    goal = start + np.array([0.3, 0.3, -0.3, 0.3, -0.3])
    operator.give(cmd.Joints(goal))
    operator.give(cmd.Gripper(0.0))
    operator.until(lambda state: state.moving)
    rest = operator.until(lambda state: not state.moving)
    assert rest.stopped is None
    assert np.abs(rest.q - goal).max() < 0.005
    assert abs(rest.gripper) < 0.02
    operator.give(cmd.Joints(start + 0.25 * (goal - start)))
    operator.until(lambda state: state.moving and np.abs(state.q - goal).max() > 0.1)
    operator.give(cmd.Stop())
    stopped = operator.until(lambda state: state.stopped is not None and not state.moving)
    assert Reason.MEASURED_STOP in [finding.reason for finding in stopped.findings]
    operator.clear_stop()
    time.sleep(0.3)
    assert np.abs(operator.state.q - stopped.q).max() < 0.003
    assert operator.state.stopped is None


def test_stop_ends_a_calibration(operator: Operator) -> None:
    operator.until(lambda state: state.stopped is not None)
    operator.perform(ArmAct.CONNECT, ArmMode.UNCALIBRATED)
    operator.perform(ArmAct.CALIBRATE, ArmMode.CALIBRATING)
    # The arm is stopped already, so only the press itself can end what it does.
    operator.give(cmd.Stop())
    ended = operator.until(lambda _: operator.mode() is ArmMode.UNCALIBRATED)
    assert ended.report is not None
    assert ended.report.note == "STOP ended the calibration. Calibrate the arm again."
    time.sleep(0.5)
    assert np.abs(operator.state.q - ended.q).max() < 0.02, "the arm holds"


@pytest.mark.parametrize(
    "text",
    [
        script_text(library_file("circle")),
        pytest.param(script_text(library_file("circle_with_gripper")), marks=pytest.mark.long),
        pytest.param(script_text(library_file("pour")), marks=pytest.mark.long),
    ],
    ids=["circle", "circle with gripper", "pour"],
)
def test_program_begins_in_the_posture_after_a_calibration(text: str) -> None:
    q, gripper = joints_at(EmulatedArm(calibrated=True).counts)

    def calibrated(session: Session) -> State:
        return session.begin(q, session.require_arm().gripper.clamp(gripper), 0.0)

    plan = plan_script(parse(text), URDF_PATH, begin=calibrated)
    arm = plan.session.require_arm()
    assert arm.kinematics.branch_of(q) != arm.kinematics.branch_of(plan.session.ready)
    simulation = run_by_clock(plan)
    assert simulation.run.phase is Phase.DONE
    states = simulation.states
    np.testing.assert_allclose(states[0].q, q)
    np.testing.assert_allclose(states[-1].q, plan.session.ready, atol=1e-9)
