"""``katana450 emulate``: the emulated arm behind a TCP port, in real time."""

from __future__ import annotations

import select
import signal
import socket
import threading
import time
from argparse import Namespace
from contextlib import suppress

from katana450.arm.robot.loader import load
from katana450.assembly.log_output import say
from katana450.extensions.real_arm.codec.codecs import FirmwareCodec
from katana450.extensions.real_arm.emulator.arm import EmulatedArm, loads_of_robot
from katana450.extensions.real_arm.emulator.firmware import Firmware
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


class EmulatorServer:
    """Serves one client at a time; the others wait for their turn, as far as the system lets them.

    A reply is sent by one write. The arm keeps moving when the connection is lost.

    Attributes:
        arm: the arm; see ``lock``.
        lock: to be held by other threads while they use the arm.
        port: port on which it listens.
    """

    def __init__(self, arm: EmulatedArm, port: int = 0) -> None:
        """Open ``port``, 0 for any free one, for ``arm``. Raises ConfigurationError if taken."""
        self.arm = arm
        self.lock = threading.Lock()
        self._firmware = Firmware(arm)
        self._listening = listen(HOST, port)
        self._listening.setblocking(False)
        self.port: int = self._listening.getsockname()[1]
        self._client: socket.socket | None = None
        self._codec = FirmwareCodec()
        self._ending = threading.Event()
        self._now = time.monotonic()
        self._thread = threading.Thread(target=self.run, name="emulator", daemon=True)

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

    def _turn(self) -> None:
        client = self._client
        waited = self._listening if client is None else client
        readable, _, _ = select.select([waited], [], [], IDLE)
        with self.lock:
            self._advance()
            if readable and client is self._client:
                if client is None:
                    self._accept()
                else:
                    self._receive(client)

    def _advance(self) -> None:
        """Move the arm to the present time."""
        now = time.monotonic()
        longest = LONGEST_SCALED_STEP if self.arm.is_calibrating else LONGEST_STEP
        self.arm.step(min(now - self._now, longest))
        self._now = now

    def _accept(self) -> None:
        with suppress(OSError):
            client, _ = self._listening.accept()
            client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            client.settimeout(SEND_TIMEOUT)
            self._client, self._codec = client, FirmwareCodec()

    def _receive(self, client: socket.socket) -> None:
        try:
            data = client.recv(RECEIVED_BYTES)
        except OSError:
            data = b""
        if not data:
            self._drop()
            return
        for event in self._codec.receive(data):
            reply = self._firmware.handle(event)
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


CHECK_INTERVAL = 1.0
"""[s] Interval at which the emulator is looked after."""


def emulate(options: Namespace) -> int:
    """Run ``katana450 emulate`` until Ctrl-C and return the exit status. Raises KatanaError."""
    ending = threading.Event()
    for number in stop_signals():
        signal.signal(number, lambda *_: ending.set())
    arm = EmulatedArm(
        loads=loads_of_robot(load()),
        calibrated=options.calibrated,
        calibration_scale=options.calibration_scale,
        object_width=options.object,
    )
    raise_priority()
    emulator = EmulatorServer(arm, options.port)
    emulator.start()
    say(f"Emulated arm: tcp://{HOST}:{emulator.port} (Ctrl-C stops)")
    try:
        while not ending.wait(CHECK_INTERVAL) and emulator.is_running:
            pass
    finally:
        emulator.stop()
    return 0 if ending.is_set() else 1
