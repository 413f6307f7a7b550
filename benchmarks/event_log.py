"""Cost of the event log per command, beside the same command without a log.

    python -m benchmarks.event_log

First the command gate alone, with an arm that only counts: batches with and without a recorder
alternate in one process, at 500 commands a second, while the recorder's thread and the writer's
process work as they do in a server. Then two servers, with ``--log`` and with ``--no-log``: one
client asks each in turn, and times the answer. Last the writer alone.
"""

from __future__ import annotations

import multiprocessing
import statistics
import tempfile
import time
from collections.abc import Callable, Sequence
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, cast

import numpy as np

from katana450.arm.control import commands as cmd
from katana450.arm.control.actor import Actor, CommandChannel
from katana450.arm.control.lease import Person, Role
from katana450.client import Client, connect
from katana450.extensions.event_log.record_sender import RecordSender
from katana450.extensions.event_log.records import record
from katana450.extensions.event_log.writer import LogWriter
from katana450.server.api import requests
from katana450.server.service.command_gate import CommandGate
from tests.browser.server import APP, AppServer

BATCH, BATCHES = 25, 200
PAUSE = 0.05
"""[s] Time between two batches: 500 commands a second."""

ASKED = 400
WRITTEN = 5000


class CountingArm:
    """An arm that gives each command a ticket."""

    def __init__(self) -> None:
        self.ticket = 0

    def deliver(self, _command: cmd.Command, _actor: Actor) -> int:
        """Return the next ticket."""
        self.ticket += 1
        return self.ticket


def _write(pipe: Connection, folder: str) -> None:
    """Write the records of ``pipe`` in this process until it is closed."""
    writer = LogWriter(Path(folder))
    writer.attach(pipe)
    writer.close(record("end"), 60.0)


def gate_times(command: Callable[[int], cmd.Command], folder: Path) -> list[list[float]]:
    """Return the times of ``submit`` [s] without and with a recorder."""
    gate = CommandGate(time.monotonic)
    gate.arm = cast(Any, CountingArm())
    actor = Actor(Person("key", "Anna", Role.OPERATOR), CommandChannel.WEBSOCKET)
    spawn = multiprocessing.get_context("spawn")
    ends: Any = spawn.Pipe()
    process = spawn.Process(target=_write, args=(ends[0], str(folder)))
    process.start()
    ends[0].close()
    sender = RecordSender(gate.recorder, ends[1])
    times: list[list[float]] = [[], []]
    for batch in range(BATCHES):
        logged = batch % 2
        gate.recorder.enabled = bool(logged)
        for n in range(BATCH):
            each = command(n)
            began = time.perf_counter()
            gate.submit(each, actor)
            times[logged].append(time.perf_counter() - began)
        time.sleep(PAUSE)
    sender.close()
    ends[1].close()
    process.join()
    return times


def answer_times(folder: Path) -> list[list[float]]:
    """Return the times of answers [s] of a server without and with a log."""
    times: list[list[float]] = [[], []]
    with (
        AppServer((*APP, "--no-log")) as plain,
        connect(plain.url) as first,
        AppServer((*APP, "--log", str(folder))) as logging,
        connect(logging.url) as second,
    ):
        clients: Sequence[Client] = (first, second)
        for n in range(ASKED):
            for logged, client in enumerate(clients):
                request = requests.Servo(q=client_posture(n))
                began = time.perf_counter()
                client.ask(request)
                times[logged].append(time.perf_counter() - began)
                time.sleep(0.005)
    return times


def client_posture(n: int) -> list[float]:
    """Return a posture [rad] near the ready posture."""
    return [0.001 * (n % 10), *np.deg2rad((-68.0, 85.0, 8.0, 0.0)).tolist()]


def _row(name: str, times: list[list[float]]) -> None:
    without, logged = ([1e6 * t for t in sorted(each)] for each in times)
    medians = [statistics.median(each) for each in (without, logged)]
    tails = [each[int(0.99 * len(each))] for each in (without, logged)]
    print(
        f"{name:24} {medians[0]:9.1f} {medians[1]:9.1f} {medians[1] / medians[0]:7.2f}"
        f" {tails[0]:9.1f} {tails[1]:9.1f}"
    )


def main() -> None:
    """Print the table."""
    print(f"{'time in us':24} {'without':>9} {'with':>9} {'ratio':>7} {'p99':>9} {'p99 with':>9}")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        servo = gate_times(lambda n: cmd.Servo(np.full(5, 0.001 * n)), folder / "servo")
        _row("gate, stream", servo)
        _row("gate, single commands", gate_times(lambda _: cmd.Nudge(0, 0.01), folder / "nudge"))
        _row("answer of the server", answer_times(folder / "server"))
        began, processor = time.perf_counter(), time.process_time()
        writer = LogWriter(folder / "writer")
        for _ in range(WRITTEN):
            writer.put(record("command", {"command": "Nudge", "axis": 1, "by": 0.01}))
        writer.close(record("end"), 60.0)
        seconds = time.perf_counter() - began
        each = 1e6 * (time.process_time() - processor) / WRITTEN
        print(f"writer: {WRITTEN / seconds:.0f} records a second, {each:.0f} us of processor each")


if __name__ == "__main__":
    main()
