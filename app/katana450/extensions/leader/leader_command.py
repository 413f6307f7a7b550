"""``katana450 leader``: a leader arm at a serial port drives the arm of a server."""

from __future__ import annotations

import asyncio
import math
import queue
import sys
import threading
import time
from argparse import Namespace
from contextlib import suppress

from katana450.assembly.log_output import printable
from katana450.client.client import AsyncClient, aconnect
from katana450.client.files import LostError, RefusedError
from katana450.errors import KatanaError
from katana450.extensions.device_address import DeviceAddress
from katana450.extensions.leader.follower import (
    SILENCE,
    Action,
    Ease,
    EndEase,
    FingerTarget,
    Follower,
    LeadPhase,
    ReleaseControl,
    Sample,
    Say,
)
from katana450.extensions.leader.joint_map import JointMap, LeaderPosture
from katana450.extensions.motor_bus.bus import (
    PORT,
    BusLostError,
    MotorBus,
    MotorRequestError,
    check_calibration,
    open_port,
)
from katana450.extensions.motor_bus.calibration import Calibration, read_calibration
from katana450.extensions.motor_bus.feetech import FEETECH
from katana450.maths.geometry.arrays import FloatArray
from katana450.sdk import answers, requests
from katana450.sdk import program_requests as programs


class Keyboard:
    """The typed lines, read in a thread. Without a terminal there are none.

    Attributes:
        present: whether a person can type.
    """

    def __init__(self) -> None:
        """Start the thread if standard input is a terminal."""
        self.present = sys.stdin is not None and sys.stdin.isatty()
        self._lines: queue.Queue[str] = queue.Queue()
        if self.present:
            threading.Thread(target=self._read, name="keyboard", daemon=True).start()

    def line(self) -> str | None:
        """Return the next line that was typed; None if there is none."""
        try:
            return self._lines.get_nowait()
        except queue.Empty:
            return None

    def _read(self) -> None:
        for line in sys.stdin:
            self._lines.put(line.strip())


NAME = "Leader"
"""Name of this client, which others see as the driver."""

PERIOD = 0.01
"""[s] Time between two readings of the leader."""

STATE_RATE = 25.0
"""[Hz] Rate of the states that are requested."""

REST_TIMEOUT = 3.0
"""[s] Timeout for the rest of the arm at the end."""

HELP = "Enter begins and ends following, Ctrl-C ends the program."


def lead(options: Namespace) -> int:
    """Run ``katana450 leader`` and return the exit status. Raises KatanaError."""
    calibration = read_calibration(options.calibration)
    port = open_port(DeviceAddress.parse(options.port, PORT), "the leader")
    try:
        bus = MotorBus(port, FEETECH)

        async def drive() -> int:
            async with aconnect(options.url, NAME, options.token) as client:
                joints = JointMap(calibration, await client.query(answers.Arm))
                prepare(bus, calibration, joints.motors)
                return await LeaderRun(client, bus, joints, Keyboard()).run()

        return asyncio.run(drive())
    except KeyboardInterrupt:
        print("\nThe leader no longer drives the arm.")
        return 130
    finally:
        port.close()


def prepare(bus: MotorBus, calibration: Calibration, motors: tuple[int, ...]) -> None:
    """Switch the torque of ``motors`` off, so that a hand can move them.

    Raises MotorRequestError if one does not answer, and InputError if the calibration is not that
    of this leader. Nothing that the motors keep without power is written.
    """
    names = {motor.id: name for name, motor in calibration.items()}
    for motor in motors:
        check_calibration(bus, names[motor], calibration[names[motor]])
        bus.write(motor, FEETECH.torque_enable, 0)
        if errors := bus.make.error_names(bus.errors(motor)):
            print(printable(f"{names[motor]} reports: {', '.join(errors)}."))


class LeaderRun:
    """One run of the program, from its connections to its end."""

    def __init__(
        self, client: AsyncClient, bus: MotorBus, joints: JointMap, keyboard: Keyboard
    ) -> None:
        self._client = client
        self._bus = bus
        self._joints = joints
        self._keyboard = keyboard
        self._follower = Follower(joints.finger_range, client.welcome.name)
        self._state: tuple[answers.State, float] | None = None
        self._easing: asyncio.Task[None] | None = None

    async def run(self) -> int:
        """Drive the arm until the program ends; return the exit status. Raises KatanaError."""
        if self._keyboard.present:
            print(HELP, flush=True)
        watching = asyncio.create_task(self._watch())
        try:
            return await self._drive(watching)
        except (LostError, BusLostError) as error:
            raise type(error)(f"{error} The arm comes to rest by itself.") from error
        finally:
            await self._come_to_rest()
            watching.cancel()
            await asyncio.gather(watching, return_exceptions=True)

    async def _drive(self, watching: asyncio.Task[None]) -> int:
        """Follow until nobody can ask for it again. Raises KatanaError."""
        # The person who starts the program asks for the first motion.
        confirmed, due = True, time.monotonic()
        late = due + SILENCE  # By then the leader has to answer for the first time.
        while True:
            posture = await asyncio.to_thread(self._posture)
            for task in (watching, self._easing):
                if task is not None and task.done():
                    # Raises an error that has ended it.
                    task.result()
            if self._state is not None and (posture is not None or time.monotonic() > late):
                state, heard = self._state
                now = time.monotonic()
                for action in self._follower.step(now, posture, state, heard, confirmed=confirmed):
                    await self._perform(action)
                confirmed = False
                if self._follower.phase is LeadPhase.WAITING and not self._keyboard.present:
                    return 1
            confirmed = confirmed or self._keyboard.line() is not None
            due = max(due + PERIOD, time.monotonic())
            await asyncio.sleep(due - time.monotonic())

    def _posture(self) -> LeaderPosture | None:
        """Return the posture of the leader; None if it does not answer. Raises BusLostError."""
        try:
            return self._joints.posture(self._bus.read_all(self._joints.motors, FEETECH.position))
        except MotorRequestError:
            return None

    async def _watch(self) -> None:
        """Keep the newest state. Raises LostError."""
        async for state in self._client.states(STATE_RATE):
            self._state = state, time.monotonic()

    async def _perform(self, action: Action) -> None:
        match action:
            case Say(text=text):
                again = " Press Enter to begin again." if self._waits else ""
                print(printable(text + again), flush=True)
            case Ease(q=q, revocations=revocations):
                self._easing = asyncio.create_task(self._ease(q, revocations))
            case EndEase():
                await self._end_ease()
            case ReleaseControl():
                await self._release()
            case Sample(q=q, qd=qd, revocations=revocations, first=first):
                sample = requests.Servo(q=q, qd=qd, revocations=revocations)
                await (self._ask(sample) if first else self._client.send(sample))
            case FingerTarget(angle=angle, revocations=revocations):
                await self._client.send(requests.Gripper(angle=angle, revocations=revocations))

    @property
    def _waits(self) -> bool:
        return self._follower.phase is LeadPhase.WAITING and self._keyboard.present

    async def _ask(self, request: requests.Request) -> None:
        """Send ``request``; rest if it is refused."""
        try:
            await self._client.ask(request)
        except RefusedError as error:
            await self._perform(self._follower.refused(str(error)))

    async def _ease(self, q: FloatArray, revocations: int) -> None:
        """Run a program that moves the arm to ``q`` (n,) [rad] on a planned path."""
        try:
            text = ease_script(q)
            await self._client.ask(programs.Program(text=text, revocations=revocations))
            await self._client.ask(
                programs.Steer(order=programs.ProgramOrder.RUN, revocations=revocations)
            )
            self._follower.eased((await self._client.query(answers.State)).sent)
        except RefusedError as error:
            await self._perform(self._follower.refused(str(error)))

    async def _end_ease(self) -> None:
        """End the program, or do not begin it. Raises LostError."""
        if self._easing is not None:
            # First, so that it sends no order to run after the order to end.
            self._easing.cancel()
            await asyncio.gather(self._easing, return_exceptions=True)
            self._easing = None
        with suppress(RefusedError):
            await self._client.ask(programs.Steer(order=programs.ProgramOrder.END))

    async def _come_to_rest(self) -> None:
        """Wait until the arm is at rest, and release the lease; the connection may be lost."""
        with suppress(KatanaError):
            if self._follower.phase is LeadPhase.EASING:
                await self._end_ease()
            due = time.monotonic() + REST_TIMEOUT
            while (await self._client.query(answers.State)).moving and time.monotonic() < due:
                await asyncio.sleep(0.05)
            await self._release()

    async def _release(self) -> None:
        # Somebody may have taken it.
        with suppress(RefusedError):
            await self._client.ask(requests.ReleaseLease())


def ease_script(q: FloatArray) -> str:
    """Return the script that moves the arm to ``q`` (n,) [rad], around obstacles if necessary."""
    angles = ", ".join(f"{math.degrees(angle):.4f}" for angle in q)
    return f"name: Leader\nsteps:\n  - joints: [{angles}]\n"
