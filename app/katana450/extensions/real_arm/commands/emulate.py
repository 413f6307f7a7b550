"""``katana450 emulate``: an emulated arm behind a TCP port."""

from __future__ import annotations

import signal
import threading
from argparse import Namespace

from katana450.arm.robot.loader import load
from katana450.assembly.log_output import say
from katana450.extensions.real_arm.emulator.arm import EmulatedArm
from katana450.extensions.real_arm.emulator.posture import loads_of_robot
from katana450.extensions.real_arm.emulator.server import EmulatorServer
from katana450.extensions.real_arm.plant.profile import profile_named
from katana450.platform_support import raise_priority, stop_signals

CHECK_INTERVAL = 1.0
"""[s] Interval at which the emulator is looked after."""


def emulate(options: Namespace) -> int:
    """Run ``katana450 emulate`` until Ctrl-C and return the exit status. Raises KatanaError."""
    ending = threading.Event()
    for number in stop_signals():
        signal.signal(number, lambda *_: ending.set())
    arm = EmulatedArm(
        profile_named(options.plant),
        loads_of_robot(load()),
        calibrated=options.calibrated,
        calibration_scale=options.calibration_scale,
        object_width=options.object,
    )
    raise_priority()
    emulator = EmulatorServer(arm, options.host, options.port)
    emulator.start()
    say(f"Emulated arm: tcp://{options.host}:{emulator.port} (Ctrl-C stops)")
    try:
        while not ending.wait(CHECK_INTERVAL) and emulator.is_running:
            pass
    finally:
        emulator.stop()
    return 0 if ending.is_set() else 1
