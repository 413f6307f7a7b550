"""Circle and pour with the emulated arm and slow replies, on a clock of their own."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import katana450.extensions.programs
from katana450.arm.control.state.arm_report import ArmAct, ArmMode
from katana450.arm.control.state.state import State
from katana450.extensions.programs.run.simulation import plan_script, simulated
from katana450.extensions.programs.script.script import parse
from katana450.extensions.real_arm.codec.replies import ArmReply, FirmwareError
from katana450.extensions.real_arm.codec.requests import ArmRequest
from katana450.extensions.real_arm.driver.machine import ArmMachine
from katana450.extensions.real_arm.driver.spline_motion import (
    SEGMENT_TIME,
    SplineSegment,
    SplineStream,
)
from katana450.extensions.real_arm.emulator.arm import EmulatedArm
from katana450.extensions.real_arm.emulator.firmware import Firmware, RequestError
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.forward import forward
from katana450.resources import URDF_PATH
from tests.real_arm.paper_arm import ENDS, MAP

LIBRARY = Path(katana450.extensions.programs.__file__).parent / "library"
PERIOD = 0.01


class EmulatorOnPaper:
    """The emulated arm, at ``joints`` (6,) [rad], with a driver and slow replies between both."""

    def __init__(self, joints: FloatArray, delay: float, jitter: float) -> None:
        self.arm = EmulatedArm(calibrated=True)
        for axis, count in zip(self.arm.axes, MAP.encoders(joints), strict=True):
            axis.plant.position = axis.plant.output = float(count)
            axis.freeze()
        self.machine = ArmMachine(ENDS, joints)
        self._firmware = Firmware(self.arm)
        self._delay, self._jitter = delay, jitter
        self._chance = np.random.default_rng(450)
        self._now = self._arm_t = -5.0
        self.machine.perform(ArmAct.CONNECT)
        self.machine.connected("tcp://paper")
        self.advance(-3.0)
        self.machine.perform(ArmAct.ENGAGE)
        self.advance(-1.0)
        self.machine.steer(MAP.joints(self.machine.arm.positions), -1.0, stopped=True)

    def advance(self, t: float) -> None:
        """Exchange requests until ``t`` [s]."""
        while self._now < t:
            request = self.machine.urgent(self._now) or self.machine.poll(self._now)
            if request is None:
                self._now += 0.005
                continue
            sent = self._now
            took = self._delay + self._jitter * self._chance.random()
            reply = self._reply(request, sent + 0.5 * took)
            self._now += took
            if isinstance(reply, FirmwareError):
                self.machine.refused(request, reply, self._now)
            else:
                self.machine.replied(request, reply, sent, self._now)

    def _reply(self, request: ArmRequest, t: float) -> ArmReply:
        self.arm.step(t - self._arm_t)
        self._arm_t = t
        try:
            return self._firmware.answer(request)
        except RequestError as error:
            return FirmwareError(request.payload[0], error.code, error.axis, error.text)


class Knots:
    """All knots of the motions, with their times [s]."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.found: list[tuple[float, FloatArray]] = []
        cut = SplineStream.cut

        def recorded(stream: SplineStream) -> SplineSegment | None:
            segment = cut(stream)
            if segment is not None:
                self.found.append((stream._end - SEGMENT_TIME, segment.end.position.astype(float)))
            return segment

        monkeypatch.setattr(SplineStream, "cut", recorded)


@pytest.mark.long
@pytest.mark.parametrize("name", ["circle_with_gripper", "pour"])
def test_program_runs_with_slow_replies(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    knots = Knots(monkeypatch)
    text = (LIBRARY / f"{name}.yaml").read_text(encoding="utf-8")
    plan = plan_script(parse(text), URDF_PATH, speed=0.5)
    session, chain = plan.session, plan.session.require_arm().chain
    emulator = EmulatorOnPaper(np.array([*plan.start.q, plan.start.gripper]), 0.035, 0.01)
    setpoints: dict[int, FloatArray] = {}
    errors, lags = [], []

    def drive(state: State) -> State:
        joints = np.array([*state.setpoint, state.gripper_setpoint])
        setpoints[round(state.t / PERIOD)] = MAP.encoders(joints)
        emulator.machine.steer(joints, state.t, stopped=state.stopped is not None)
        emulator.advance(state.t)
        answer = emulator.machine.answer()
        report = answer.report
        assert report is not None
        assert report.mode in (ArmMode.HOLDING, ArmMode.MOVING), report.note
        actual, due = forward(chain, answer.q), forward(chain, report.expected[:5])
        errors.append(float(np.linalg.norm(actual[:3, 3] - due[:3, 3])))
        lags.append(float(np.abs(answer.q - state.setpoint).max()))
        state = session.supervised(session.observe(state, answer.q, answer.gripper), report)
        assert state.stopped is None, state.stopped
        return state

    states = [state for state, _ in simulated(plan.program, session, plan.start, PERIOD, drive)]
    last = states[-1]
    for _ in range(200):
        last = drive(session.step(last, [], last.t + PERIOD))
    assert not last.moving
    assert np.abs(last.q - last.setpoint).max() < 0.002
    compared = [
        np.abs(position - setpoints[round(t / PERIOD)])[:5].max()
        for t, position in knots.found
        if round(t / PERIOD) in setpoints
    ]
    print(name, max(errors), max(compared), max(lags), len(compared), last.t)
    assert len(compared) > 100
    assert max(compared) <= 0.5 + 1e-9
    # With the arm where it should be, 0.33 s behind its setpoint.
    assert max(errors) < 0.002
    assert max(lags) > 0.01
