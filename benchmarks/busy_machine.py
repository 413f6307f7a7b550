"""Pauses and stops of a simulated arm on a machine that other programs keep busy.

    python -m benchmarks.busy_machine --seconds 600

One program per core computes without a pause, at normal priority. Meanwhile a client swings the arm
and gives a new target as soon as the arm rests, as an operator does after a pause. The counts of
pauses and latched stops are printed, with their causes and the lateness of the control loop.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
from collections import Counter
from contextlib import ExitStack, suppress

import numpy as np

from katana450.client import connect
from katana450.client.files import RefusedError
from katana450.server.api import answers, requests
from tests.browser.server import SIMULATION_APP, AppServer

ENDS = [np.deg2rad((angle, -68.0, 85.0, 8.0, 0.0)).tolist() for angle in (-90.0, 90.0)]

POLL = 0.05
"""[s] Interval at which the client looks at the state."""


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=600.0, help="duration (default: 600)")
    parser.add_argument("--hogs", type=int, default=os.cpu_count(), help="default: one per core")
    options = parser.parse_args()
    causes: Counter[str] = Counter()
    stops: list[str] = []
    swings, paused = 0, False
    with ExitStack() as stack:
        server = stack.enter_context(AppServer(SIMULATION_APP))
        arm = stack.enter_context(connect(server.url, "Driver"))
        for _ in range(options.hogs):
            hog = subprocess.Popen([sys.executable, "-c", "while True: pass"])
            stack.callback(hog.kill)
        end = time.monotonic() + options.seconds
        while time.monotonic() < end:
            state = arm.query(answers.State)
            if state.stopped is not None:
                stops.append(state.stopped)
                # A server may refuse this for a moment.
                with suppress(RefusedError):
                    arm.ask(requests.ClearStop())
            elif not state.moving:
                with suppress(RefusedError):
                    arm.ask(requests.Joints(q=ENDS[swings % 2]))
                    swings += 1
            if state.status == "paused" and not paused:
                causes.update(found.reason for found in state.findings if found.reason != "waiting")
            paused = state.status == "paused"
            time.sleep(POLL)
        timing = arm.query(answers.Loop)
    print(f"{options.seconds:g} s with {options.hogs} busy programs: {swings} swings")
    print(f"pauses: {causes.total()}", *(f"{count} × {cause}" for cause, count in causes.items()))
    print(f"latched stops: {len(stops)}", *dict.fromkeys(stops))
    p99, maximum = 1e3 * timing.late_p99, 1e3 * timing.late_max
    print(f"lateness of the last ticks: p99 {p99:.1f} ms, maximum {maximum:.1f} ms")


if __name__ == "__main__":
    main()
