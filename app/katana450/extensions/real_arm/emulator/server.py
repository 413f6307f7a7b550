"""``katana450 emulate``: an emulated arm behind a TCP port or a terminal, in real time."""

from __future__ import annotations

import os
import select
import signal
import socket
import sys
import threading
import time
from abc import abstractmethod
from argparse import Namespace
from collections.abc import Iterable
from contextlib import suppress
from typing import Generic, TypeVar

from katana450.arm.robot.loader import load
from katana450.assembly.log_output import say
from katana450.atomic import write_files, writer_of
from katana450.extensions.motor_bus.bus import PORT as BUS_PORT
from katana450.extensions.real_arm.codec.codecs import FirmwareCodec
from katana450.extensions.real_arm.emulator.arm import EmulatedArm, loads_of_robot
from katana450.extensions.real_arm.emulator.firmware import Firmware
from katana450.extensions.real_arm.link import PORT
from katana450.extensions.real_arm.servo.arms import SERVO_ARMS
from katana450.extensions.real_arm.servo.emulated_servos import EmulatedServos, calibration_text
from katana450.platform_support import raise_priority, stop_signals
from katana450.sdk import listen

HOST = "127.0.0.1"

IDLE = 0.01
"""[s] Interval at which the arm moves while nothing is received."""

LONGEST_STEP = 5.0
"""[s] Time that is simulated at once at most, after this process was held up."""

LONGEST_SCALED_STEP = 0.03
"""[s] The same during a calibration, which may be many times as fast: a busy machine would catch up
with ever more steps. It then calibrates more slowly instead."""

RECEIVED_BYTES = 4096

SEND_TIMEOUT = 1.0
"""[s] Time after which a client that reads no replies is dropped."""


ArmT = TypeVar("ArmT", EmulatedArm, EmulatedServos)


class DeviceServer(Generic[ArmT]):
    """Serves one client at a time; the others wait for their turn, as far as the system lets them.

    A reply is sent by one write. The arm keeps moving when the connection is lost.

    Attributes:
        arm: the arm; see ``lock``.
        lock: to be held by other threads while they use the arm.
        port: port on which it listens.
        terminal: name of a pseudo-terminal that leads to the arm too; empty without one.
    """

    has_terminal = False

    def __init__(self, arm: ArmT, port: int = 0) -> None:
        """Open ``port``, 0 for any free one, for ``arm``. Raises ConfigurationError if taken."""
        self.arm: ArmT = arm
        self.lock = threading.Lock()
        self._listening = listen(HOST, port)
        self._listening.setblocking(False)
        self.port: int = self._listening.getsockname()[1]
        self._client: socket.socket | None = None
        self._ends: tuple[int, ...] = ()
        self.terminal = ""
        if sys.platform != "win32" and self.has_terminal:
            self._ends = os.openpty()
            self.terminal = os.ttyname(self._ends[1])
            # A program that reads nothing loses replies, and does not hold the arm up.
            os.set_blocking(self._ends[0], False)
        self._ending = threading.Event()
        self._now = time.monotonic()
        self._thread = threading.Thread(target=self.run, name="emulator", daemon=True)

    @abstractmethod
    def _replies(self, data: bytes) -> Iterable[bytes]:
        """Return the replies to the requests that ``data`` completes."""

    def start(self) -> None:
        """Serve in a thread of its own."""
        self._thread.start()

    @property
    def is_running(self) -> bool:
        """True while the arm is served in its thread."""
        return self._thread.is_alive()

    def stop(self) -> None:
        """End ``run``, wait for it, and close the port."""
        self._ending.set()
        if self.is_running:
            self._thread.join()

    def run(self) -> None:
        """Serve until ``stop``."""
        self._now = time.monotonic()
        try:
            while not self._ending.is_set():
                self._turn()
        finally:
            self._drop()
            self._listening.close()
            for end in self._ends:
                os.close(end)

    def _turn(self) -> None:
        client = self._client
        waited = self._listening if client is None else client
        waiting: list[socket.socket | int] = [waited, *self._ends[:1]]
        readable, _, _ = select.select(waiting, [], [], IDLE)
        with self.lock:
            self._advance()
            if self._ends and self._ends[0] in readable:
                with suppress(OSError):
                    for reply in self._replies(os.read(self._ends[0], RECEIVED_BYTES)):
                        os.write(self._ends[0], reply)
            if waited in readable and client is self._client:
                if client is None:
                    self._accept()
                else:
                    self._receive(client)

    def _advance(self) -> None:
        """Move the arm to the present time."""
        now = time.monotonic()
        longest = (
            LONGEST_SCALED_STEP if getattr(self.arm, "is_calibrating", False) else LONGEST_STEP
        )
        self.arm.step(min(now - self._now, longest))
        self._now = now

    def _accept(self) -> None:
        with suppress(OSError):
            client, _ = self._listening.accept()
            client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            client.settimeout(SEND_TIMEOUT)
            self._client = client

    def _receive(self, client: socket.socket) -> None:
        try:
            data = client.recv(RECEIVED_BYTES)
        except OSError:
            data = b""
        if not data:
            self._drop()
            return
        for reply in self._replies(data):
            if not self._send(client, reply):
                return

    def _send(self, client: socket.socket, reply: bytes) -> bool:
        """Send ``reply``; return False if the connection has ended."""
        try:
            client.sendall(reply)
        except OSError:
            self._drop()
            return False
        return True

    def _drop(self) -> None:
        if self._client is not None:
            self._client.close()
            self._client = None


class EmulatorServer(DeviceServer[EmulatedArm]):
    """Serves an emulated Katana450."""

    def __init__(self, arm: EmulatedArm, port: int = 0) -> None:
        """Open ``port``, 0 for any free one, for ``arm``. Raises ConfigurationError if taken."""
        super().__init__(arm, port)
        self._firmware = Firmware(arm)
        self._codec = FirmwareCodec()

    def _accept(self) -> None:
        self._codec = FirmwareCodec()
        super()._accept()

    def _replies(self, data: bytes) -> Iterable[bytes]:
        return map(self._firmware.handle, self._codec.receive(data))


class ServoServer(DeviceServer[EmulatedServos]):
    """Serves the motors of an emulated arm, at a port and at a pseudo-terminal."""

    has_terminal = True

    def _replies(self, data: bytes) -> Iterable[bytes]:
        return self.arm.replies(data)


CHECK_INTERVAL = 1.0
"""[s] Interval at which the emulator is looked after."""


def emulate(options: Namespace) -> int:
    """Run ``katana450 emulate`` until Ctrl-C and return the exit status. Raises KatanaError."""
    ending = threading.Event()
    for number in stop_signals():
        signal.signal(number, lambda *_: ending.set())
    emulator: EmulatorServer | ServoServer
    if (servo_arm := SERVO_ARMS.get(options.emulated)) is not None:
        if options.calibration is not None:
            write_files({options.calibration: writer_of(calibration_text(servo_arm))})
        bus_port = BUS_PORT if options.port is None else options.port
        emulator = ServoServer(EmulatedServos(servo_arm), bus_port)
    else:
        arm = EmulatedArm(
            loads=loads_of_robot(load()),
            calibrated=options.calibrated,
            calibration_scale=options.calibration_scale,
        )
        emulator = EmulatorServer(arm, PORT if options.port is None else options.port)
    raise_priority()
    emulator.start()
    ways = " and ".join(filter(None, (f"tcp://{HOST}:{emulator.port}", emulator.terminal)))
    say(f"Emulated arm: {ways} (Ctrl-C stops)")
    try:
        while not ending.wait(CHECK_INTERVAL) and emulator.is_running:
            pass
    finally:
        emulator.stop()
    return 0 if ending.is_set() else 1
