"""An arm that is behind its setpoints by a known time and beside them by known angles."""

from __future__ import annotations

from collections import deque

import numpy as np

from katana450.arm.control.arm import ArmModel
from katana450.arm.control.state.arm_report import ArmMode, ArmReport
from katana450.arm.drivers.driver import DriverAnswer, SimulatedDriver
from katana450.maths.geometry.arrays import FloatArray, frozen


class LaggingDriver(SimulatedDriver):
    """An arm that reaches each setpoint ``ticks`` ticks later, with ``offset`` (5,) [rad]."""

    def __init__(
        self, arm: ArmModel, q: FloatArray, gripper: float, ticks: int, offset: FloatArray
    ) -> None:
        super().__init__(arm, q, gripper)
        self._waiting = deque([q] * (ticks + 1), maxlen=ticks + 1)
        self._offset = offset

    def start(self, t: float) -> DriverAnswer:
        return self._measured(super().start(t), t)

    def send(self, q: FloatArray, gripper: float, t: float, stopped: bool = False) -> DriverAnswer:
        return self._measured(super().send(q, gripper, t, stopped), t)

    def _measured(self, sent: DriverAnswer, t: float) -> DriverAnswer:
        self._waiting.append(sent.q)
        due = self._waiting[0]
        moves = any(not np.array_equal(q, due) for q in self._waiting)
        mode = ArmMode.MOVING if moves else ArmMode.HOLDING
        report = ArmReport(mode, t, frozen(np.append(due, sent.gripper)))
        return DriverAnswer(frozen(due + self._offset), sent.gripper, report)
