"""One run of the command: what it asks of a server that is slow to answer."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncGenerator
from typing import Any

import msgspec

from katana450.extensions.leader.joint_map import JointMap
from katana450.extensions.leader.leader_command import LeaderRun
from katana450.extensions.motor_bus.bus import MotorBus
from katana450.extensions.motor_bus.calibration import decoded_calibration
from katana450.extensions.motor_bus.feetech import FEETECH
from katana450.server.api import answers, requests
from katana450.server.api.program_requests import Program, ProgramOrder, Steer
from tests.leader.follower_bench import Bench, ServerState
from tests.leader.test_joint_map import WiredPort, arm, calibrated


class StalledServer:
    """A client whose server sends states, and never answers a program."""

    welcome = answers.Welcome(name="Leader", number=1, role="operator", heartbeat=0.1)

    def __init__(self) -> None:
        self.asked: list[requests.Request] = []
        self.state = msgspec.convert(Bench().values, ServerState)

    async def ask(self, request: requests.Request) -> answers.Answer:
        self.asked.append(request)
        if isinstance(request, Program):
            await asyncio.Event().wait()
        return answers.Done()

    async def query(self, kind: object) -> ServerState:
        assert kind is answers.State
        return self.state

    async def states(self, hz: float) -> AsyncGenerator[ServerState, None]:
        while True:
            yield self.state
            await asyncio.sleep(1.0 / hz)

    @property
    def programs(self) -> int:
        return sum(isinstance(request, Program) for request in self.asked)


class Fingers:
    """A keyboard on which the test presses Enter."""

    present = True

    def __init__(self) -> None:
        self.pressed = False

    def line(self) -> str | None:
        pressed, self.pressed = self.pressed, False
        return "" if pressed else None


def test_enter_before_the_server_has_taken_the_program_ends_and_begins_again() -> None:
    server, fingers = StalledServer(), Fingers()
    client: Any = server
    keyboard: Any = fingers
    joints = JointMap(decoded_calibration(calibrated()), arm())

    async def until(count: int) -> None:
        async with asyncio.timeout(5.0):
            while server.programs < count:
                await asyncio.sleep(0.01)

    async def run() -> None:
        task = asyncio.create_task(
            LeaderRun(client, MotorBus(WiredPort(), FEETECH), joints, keyboard).run()
        )
        await until(1)
        fingers.pressed = True
        await asyncio.sleep(0.2)
        assert not task.done()
        assert server.asked[-1] == Steer(order=ProgramOrder.END)
        fingers.pressed = True
        await until(2)
        # It has never been told to run.
        assert Steer(order=ProgramOrder.RUN, revocations=4) not in server.asked
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)

    asyncio.run(run())
