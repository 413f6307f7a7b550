"""Lateness of the control loop and time of STOP with the driver of a real arm, and without.

    python -m benchmarks.arm_driver --rounds 3

Servers take turns: with the simulated driver, and with the driver of the Katana450 whose arm is
emulated by another process. On both the arm swings all the time at the same speed. At the end the
emulator is paused while the arm moves, as an arm that hangs, and STOP is pressed.
"""

from __future__ import annotations

import argparse
import re
import signal
import statistics
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from typing import NamedTuple

from benchmarks.recording import ENDS, swing
from benchmarks.start_and_idle import cpu_seconds
from katana450.arm.control.arm_commands import ArmAct
from katana450.client import connect
from katana450.client.client import Client
from katana450.server.api import answers, requests
from tests.browser.server import APP, AppServer

SPEED = 0.5
"""Fraction of the full speed at which the arm swings."""

WARM_UP = 8.0
"""[s] Time before the measurement."""

TIMEOUT = 20.0
"""[s] Maximum time of an act at the arm."""


class Figures(NamedTuple):
    """Lateness of the ticks [s], processor time as a fraction of a core, and time of STOP [s]."""

    p50: float
    p99: float
    arm: float
    stop: float


@contextmanager
def emulator() -> Iterator[tuple[subprocess.Popen[str], int]]:
    """Run an emulated arm; give its process and its port."""
    command = [sys.executable, "-m", "katana450", "emulate", "--port", "0", "--calibrated"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        found = re.search(r"tcp://127\.0\.0\.1:(\d+)", process.stdout.readline())
        assert found is not None
        yield process, int(found[1])
    finally:
        process.send_signal(signal.SIGCONT)
        process.terminate()
        process.communicate(timeout=TIMEOUT)


def measured(seconds: float, *, real: bool) -> Figures:
    """Return the figures of one server, ``real`` with the driver of the Katana450."""
    with emulator() if real else nullcontext((None, 0)) as (process, port):
        options = ("--arm", f"tcp://127.0.0.1:{port}") if real else ()
        command = (*APP, "--no-idle-planning", *options)
        with AppServer(command) as server, connect(server.url, "Driver") as arm:
            if real:
                engage(arm)
            arm.ask(requests.Speed(value=SPEED))
            swing(arm, WARM_UP)
            before = cpu_seconds([server.arm])
            swing(arm, seconds)
            used = (cpu_seconds([server.arm]) - before) / seconds
            timing = arm.query(answers.Loop)
            arm.ask(requests.Joints(q=list(ENDS[0])))
            if process is not None:
                process.send_signal(signal.SIGSTOP)
            begun = time.perf_counter()
            arm.ask(requests.Stop())
            stop = time.perf_counter() - begun
    return Figures(timing.late_p50, timing.late_p99, used, stop)


def engage(arm: Client) -> None:
    """Bring the arm from no connection to holding, and clear the stop with which it begins."""
    for act, mode in ((ArmAct.CONNECT, "uncalibrated"), (ArmAct.ENGAGE, "holding")):
        arm.ask(requests.OperateArm(act=act, confirmed=True))
        end = time.monotonic() + TIMEOUT
        while (report := arm.query(answers.State).arm) is None or report.mode != mode:
            assert time.monotonic() < end, report
            time.sleep(0.05)
    # A stop may be cleared 1 s after it.
    time.sleep(1.2)
    arm.ask(requests.ClearStop())


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=3, help="servers of each kind (default: 3)")
    parser.add_argument("--seconds", type=float, default=20.0, help="of each (default: 20)")
    options = parser.parse_args()
    found: dict[str, list[Figures]] = {"simulated": [], "driver": []}
    for _ in range(options.rounds):
        for kind, rounds in found.items():
            rounds.append(measured(options.seconds, real=kind == "driver"))
            last = rounds[-1]
            print(
                f"{kind:9} p50 {1e3 * last.p50:.3f} ms  p99 {1e3 * last.p99:.3f} ms  "
                f"STOP {1e3 * last.stop:.1f} ms",
                flush=True,
            )
    for name, what in (("p50", "lateness, p50"), ("p99", "lateness, p99"), ("stop", "STOP")):
        a, b = (statistics.median(getattr(each, name) for each in x) for x in found.values())
        print(f"{what}: {1e3 * a:.3f} ms simulated, {1e3 * b:.3f} ms driver, {b / a:.2f} times")
    a, b = (100.0 * statistics.median(each.arm for each in x) for x in found.values())
    print(f"the arm's process: {a:.1f} % of a core simulated, {b:.1f} % with the driver")


if __name__ == "__main__":
    main()
