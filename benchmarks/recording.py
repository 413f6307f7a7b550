"""Costs of recording: lateness of the control loop with and without it, and processor time.

    python -m benchmarks.recording --rounds 5
    python -m benchmarks.recording --rounds 5 --drags

Servers with and without recording take turns. On each the arm swings all the time, or a client
drags the tool about without a pause, 60 times a second. The processor time is that of the process
that records, and of the arm's process, divided by the wall time.
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks.start_and_idle import cpu_seconds
from katana450.client import connect
from katana450.client.client import Client
from katana450.client.files import RefusedError
from katana450.server.api import answers, requests
from tests.browser.server import RECORDING_APP, AppServer

ENDS = ((-0.8, -1.2, 1.5, 0.1, 0.0), (0.8, -1.2, 1.5, 0.1, 0.0))

WARM_UP = 8.0
"""[s] Time in which the process that records starts."""

DRAG_PERIOD = 1.0 / 60.0
"""[s] Time between two drags, as of a page."""

DRAG_STEP = 0.01
"""[m] Standard deviation of each coordinate between two drags."""

DRAG_ENDS = (0.05, -0.4, -0.26), (0.5, 0.4, 0.3)
"""[m] Box in which the target is dragged, in the frame {S}."""

POLL = 0.05
"""[s] Interval at which the client looks at the state."""

MIB = 2**20


class Costs(NamedTuple):
    """Lateness of the ticks [s], processor time as fractions of a core, memory and bytes."""

    p50: float
    p99: float
    arm: float
    recorder: float
    memory: int
    size: int


def measured(folder: Path | None, seconds: float, move: Callable[[Client, float], None]) -> Costs:
    """Return the costs while ``move`` moves an arm for ``seconds``.

    ``folder``: that of its recording.
    """
    # Otherwise alike: the planning of a server at rest would count as a cost of recording.
    kind = ("--no-record",) if folder is None else ("--record", str(folder))
    command = (*RECORDING_APP, "--no-idle-planning", *kind)
    with AppServer(command) as server, connect(server.url, "Driver") as arm:
        move(arm, WARM_UP)
        pids = [server.arm] if folder is None else [server.arm, server.child("katana450 rec")]
        before = [cpu_seconds([pid]) for pid in pids]
        move(arm, seconds)
        used = [(cpu_seconds([pid]) - t) / seconds for pid, t in zip(pids, before, strict=True)]
        timing = arm.query(answers.Loop)
        memory = 0
        if folder is not None:
            fields = Path(f"/proc/{pids[1]}/statm").read_text(encoding="ascii").split()
            memory = 4096 * int(fields[1])
    size = 0 if folder is None else sum(path.stat().st_size for path in folder.iterdir())
    recorder = used[1] if len(used) > 1 else 0.0
    return Costs(timing.late_p50, timing.late_p99, used[0], recorder, memory, size)


def swing(arm: Client, seconds: float) -> None:
    """Swing the arm from side to side for ``seconds``."""
    end, swings = time.monotonic() + seconds, 0
    while time.monotonic() < end:
        if not arm.query(answers.State).moving:
            with suppress(RefusedError):
                arm.ask(requests.Joints(q=list(ENDS[swings % 2])))
                swings += 1
        time.sleep(POLL)


def drag(arm: Client, seconds: float) -> None:
    """Drag the tool at random for ``seconds``."""
    rng, at = np.random.default_rng(1), np.array((0.3, 0.0, 0.05))
    due = time.monotonic()
    end = due + seconds
    while due < end:
        with suppress(RefusedError):
            arm.ask(requests.Position(p=at.tolist()))
        at = np.clip(at + DRAG_STEP * rng.normal(size=3), *DRAG_ENDS)
        due += DRAG_PERIOD
        time.sleep(max(due - time.monotonic(), 0.0))


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=5, help="servers of each kind (default: 5)")
    parser.add_argument("--seconds", type=float, default=20.0, help="of each (default: 20)")
    parser.add_argument("--drags", action="store_true", help="drag without a pause, do not swing")
    options = parser.parse_args()
    move = drag if options.drags else swing
    without, with_it = [], []
    for _ in range(options.rounds):
        without.append(measured(None, options.seconds, move))
        with tempfile.TemporaryDirectory() as folder:
            with_it.append(measured(Path(folder) / "ring", options.seconds, move))
        for name, each in (("without", without[-1]), ("with", with_it[-1])):
            print(f"{name:8} p50 {1e3 * each.p50:.3f} ms  p99 {1e3 * each.p99:.3f} ms", flush=True)
    for name in ("p50", "p99"):
        a, b = (statistics.median(getattr(each, name) for each in x) for x in (without, with_it))
        print(
            f"lateness, {name}: {1e3 * a:.3f} ms without, {1e3 * b:.3f} ms with, {b / a:.2f} times"
        )
    arm = [100.0 * statistics.median(each.arm for each in x) for x in (without, with_it)]
    print(f"the arm's process: {arm[0]:.1f} % of a core without, {arm[1]:.1f} % with")
    recorder = 100.0 * statistics.median(each.recorder for each in with_it)
    memory = statistics.median(each.memory for each in with_it) / MIB
    rate = statistics.median(each.size for each in with_it) / (options.seconds + WARM_UP)
    print(f"the process that records: {recorder:.1f} % of a core, {memory:.0f} MB")
    print(f"size: {3600 * rate / 1e6:.0f} MB an hour")


if __name__ == "__main__":
    main()
