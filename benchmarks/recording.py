"""Costs of recording: lateness of the control loop with and without it, and processor time.

    python -m benchmarks.recording --rounds 5
    python -m benchmarks.recording --rounds 5 --drags

A server with recording and one without take turns in windows of ten seconds. In its window the
arm swings all the time, or a client drags the tool about without a pause, 60 times a second. The
processor time is that of the process that records, and of the arm's process, divided by the time
of the windows.
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
import time
from collections.abc import Callable
from contextlib import ExitStack, suppress
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

WINDOW = 10.0
"""[s] Length of a window: that of the ticks that a server reports on."""

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
    """Costs of a server while its arm moves.

    ``p50``, ``p99``: lateness of the ticks [s], mean of its windows. ``arm``, ``recorder``:
    processor time of the arm's process and of the process that records, of a core. ``memory``:
    of the process that records [bytes]. ``size``: of the recording [bytes per second of motion].
    """

    p50: float
    p99: float
    arm: float
    recorder: float
    memory: int
    size: float


class Measured:
    """One server of which the costs are measured in windows."""

    def __init__(self, server: AppServer, arm: Client, folder: Path | None) -> None:
        """Measure ``server``, driven by ``arm``. ``folder``: that of its recording."""
        self._arm, self._folder = arm, folder
        self._pids = [server.arm] if folder is None else [server.arm, server.child("katana450 rec")]
        self._loops: list[answers.Loop] = []
        self._used = np.zeros(len(self._pids))
        self._size = self._written()

    def _written(self) -> int:
        return sum(path.stat().st_size for path in self._folder.iterdir()) if self._folder else 0

    def window(self, move: Callable[[Client, float], None]) -> None:
        """Measure one window, in which ``move`` moves the arm."""
        before = np.array([cpu_seconds([pid]) for pid in self._pids])
        move(self._arm, WINDOW)
        self._used += np.array([cpu_seconds([pid]) for pid in self._pids]) - before
        self._loops.append(self._arm.query(answers.Loop))

    def costs(self) -> Costs:
        """Return the costs in all windows."""
        seconds = WINDOW * len(self._loops)
        used = (self._used / seconds).tolist()
        memory = 0
        if self._folder:
            fields = Path(f"/proc/{self._pids[1]}/statm").read_text(encoding="ascii").split()
            memory = 4096 * int(fields[1])
        return Costs(
            statistics.mean(loop.late_p50 for loop in self._loops),
            statistics.mean(loop.late_p99 for loop in self._loops),
            used[0],
            used[1] if self._folder else 0.0,
            memory,
            (self._written() - self._size) / seconds,
        )


def pair(windows: int, move: Callable[[Client, float], None]) -> tuple[Costs, Costs]:
    """Return the costs of a server without recording and of one with it.

    They take turns: while the arm of one moves, that of the other is at rest, so that both see
    the same machine.
    """
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory())) / "ring"
        kinds: list[tuple[tuple[str, ...], Path | None]] = [
            (("--no-record",), None),
            (("--record", str(folder)), folder),
        ]
        both = []
        for kind, recorded in kinds:
            server = stack.enter_context(AppServer((*RECORDING_APP, *kind)))
            arm = stack.enter_context(connect(server.url, "Driver"))
            move(arm, WARM_UP)
            both.append(Measured(server, arm, recorded))
        for i in range(windows):
            for each in both if i % 2 == 0 else reversed(both):
                each.window(move)
        return both[0].costs(), both[1].costs()


def interval(without: list[float], with_it: list[float]) -> tuple[float, float, float]:
    """Return the ratio of two lists of pairs: geometric mean, 95 % confidence interval."""
    ratios = np.log(with_it) - np.log(without)
    rng = np.random.default_rng(1)
    means = rng.choice(ratios, (10_000, len(ratios))).mean(axis=1)
    low, high = np.quantile(means, (0.025, 0.975)).tolist()
    return float(np.exp(ratios.mean())), float(np.exp(low)), float(np.exp(high))


def swing(arm: Client, seconds: float) -> None:
    """Swing the arm from side to side for ``seconds``."""
    end, swings = time.monotonic() + seconds, 0
    while time.monotonic() < end:
        if not arm.query(answers.State).moving:
            with suppress(RefusedError):
                arm.ask(requests.Joints(q=np.array(ENDS[swings % 2])))
                swings += 1
        time.sleep(POLL)


def drag(arm: Client, seconds: float) -> None:
    """Drag the tool at random for ``seconds``."""
    rng, at = np.random.default_rng(1), np.array((0.3, 0.0, 0.05))
    due = time.monotonic()
    end = due + seconds
    while due < end:
        with suppress(RefusedError):
            arm.ask(requests.Position(p=at))
        at = np.clip(at + DRAG_STEP * rng.normal(size=3), *DRAG_ENDS)
        due += DRAG_PERIOD
        time.sleep(max(due - time.monotonic(), 0.0))


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=5, help="pairs of servers (default: 5)")
    parser.add_argument("--windows", type=int, default=2, help="windows of each (default: 2)")
    parser.add_argument("--drags", action="store_true", help="drag without a pause, do not swing")
    options = parser.parse_args()
    without: list[Costs] = []
    with_it: list[Costs] = []
    for _ in range(options.rounds):
        for costs, each in zip(
            pair(options.windows, drag if options.drags else swing),
            (without, with_it),
            strict=True,
        ):
            each.append(costs)
        for name, costs in (("without", without[-1]), ("with", with_it[-1])):
            print(
                f"{name:8} p50 {1e3 * costs.p50:.3f} ms  p99 {1e3 * costs.p99:.3f} ms", flush=True
            )
    for name in ("p50", "p99"):
        a, b = ([getattr(each, name) for each in x] for x in (without, with_it))
        ratio, low, high = interval(a, b)
        print(
            f"lateness, {name}: {1e3 * statistics.median(a):.3f} ms without, "
            f"{1e3 * statistics.median(b):.3f} ms with; ratio in pairs {ratio:.2f}, "
            f"95 % between {low:.2f} and {high:.2f}"
        )
    arm = [100.0 * statistics.median(each.arm for each in x) for x in (without, with_it)]
    print(f"the arm's process: {arm[0]:.1f} % of a core without, {arm[1]:.1f} % with")
    recorder = 100.0 * statistics.median(each.recorder for each in with_it)
    memory = statistics.median(each.memory for each in with_it) / MIB
    print(f"the process that records: {recorder:.1f} % of a core, {memory:.0f} MB")
    size = statistics.median(each.size for each in with_it)
    print(f"size: {3600 * size / 1e6:.0f} MB an hour")


if __name__ == "__main__":
    main()
