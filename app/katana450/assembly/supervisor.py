"""The supervisor: starts the processes of the server, watches each, and starts it again.

It also keeps the arm's last state. It imports almost nothing, so that it is always there. A process
that ends is noticed at once. A process that hangs is noticed by the silence of its pipe, and is
ended.
"""

from __future__ import annotations

import logging
import multiprocessing.resource_tracker
import os
import pickle
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any

from katana450.arm.runtime.readiness import writable
from katana450.assembly.supervised import (
    END,
    HEARTBEAT_INTERVAL,
    KEPT,
    NOTICE,
    READY,
    REPORT,
    ROBOT,
    SCENE,
    run_supervised,
)
from katana450.errors import ConfigurationError, KatanaError
from katana450.platform_support import stop_signals_blocked
from katana450.portable_rounding import starting_portable_processes

BEATS_BEFORE_DEADLINE = 4

TURN = HEARTBEAT_INTERVAL
"""[s] Interval at which signals and silence are checked; the end of a process wakes earlier."""

START_SECONDS = 300.0
"""[s] Time in which a process must be ready. On a busy machine a start takes long."""

BUSY_NOTICE_INTERVAL = 20.0
"""[s] Interval at which a long start is reported."""

START_SILENCE = 30.0
"""[s] Maximum silence of a process that is not ready yet: imports delay its heartbeats."""

GOODBYE_SECONDS = 5.0
"""[s] Timeout for a process to end by itself."""

RESTART_DELAYS = (0.0, 0.0, 0.0, 1.0, 5.0, 15.0)
"""[s] Delay before a process is started again, by the number of its early ends in a row, from 0."""

STABLE_SECONDS = 5.0
"""[s] A process that was ready for a longer time did not end early."""

READ_SECONDS = 1.0
"""[s] Timeout for reading the last messages of a process that has ended."""

RETRY_SECONDS = 1.0
"""[s] Delay after the system refused to start a process."""

MAX_KEPT_STARTS = 2
"""Early ends in a row after which a new process gets no state of the one before: the state may be
what ends it."""

log = logging.getLogger(__name__)

Kept = dict[bytes, bytes]
"""The last known state of the arm, by the kinds KEPT and SCENE, which is not read here."""


@dataclass(frozen=True)
class ChildSpec:
    """A process that the server needs.

    Attributes:
        name: name of the process, of up to 15 letters.
        title: its name for people, at the beginning of a sentence.
        function: its function, called with its ``SupervisorPipe``.
        deadline: silence [s] after which the process is ended, once it is ready.
        keeps: whether the function takes first the state that an earlier process has sent; None at
            the first start.
        late: whether it is started after all others are ready.
    """

    name: str
    title: str
    function: Callable[..., None]
    deadline: float
    keeps: bool = False
    late: bool = False

    @property
    def heartbeat_interval(self) -> float:
        """Interval of the heartbeats [s]: several before the deadline."""
        return max(self.deadline / BEATS_BEFORE_DEADLINE, HEARTBEAT_INTERVAL)


class Child:
    """One process of a kind at a time, as the supervisor sees it."""

    def __init__(self, spec: ChildSpec) -> None:
        """Create the child; ``start`` starts its process."""
        self.spec = spec
        self.statuses: set[str] = set()
        self.error: KatanaError | None = None
        self.robot: Path | None = None
        """File of the robot with which all processes must start again; None for no other one."""
        self.kept: Kept = {}
        self.due: float | None = 0.0
        """Time of the next start [s]; None while a process runs."""
        self._early_ends = 0
        self._ready_at: float | None = None
        self._started = self._heard = 0.0
        self._first = True

    def start(self) -> None:
        """Start a process."""
        spawn = multiprocessing.get_context("spawn")
        # The ends are of another class on Windows, with the same methods.
        ends: Any = spawn.Pipe()
        self._pipe: Connection
        self._pipe, theirs = ends
        work = self.spec.function
        if self.spec.keeps:
            state = self.kept if self._early_ends <= MAX_KEPT_STARTS else {}
            work = partial(work, None if self._first else state)
        self.process = spawn.Process(
            target=run_supervised,
            args=(self.spec.name, work, theirs, self.spec.heartbeat_interval),
            name=self.spec.name,
            daemon=True,
        )
        with starting_portable_processes(), stop_signals_blocked():
            self.process.start()
        # Closed here, so that each side notices when the other is gone.
        theirs.close()
        self._first, self._ready_at, self.error = False, None, None
        self._started = self._heard = time.monotonic()
        self.statuses.clear()
        self._reader = threading.Thread(target=self._read, args=(self._pipe,), daemon=True)
        self._reader.start()
        self.due = None

    @property
    def running(self) -> bool:
        """True while the process runs."""
        return self.due is None and self.process.is_alive()

    def _read(self, pipe: Connection) -> None:
        """Read all messages of the process, in a thread: half a message must not block others."""
        with suppress(EOFError, OSError):
            while True:
                message = pipe.recv_bytes()
                self._heard = time.monotonic()
                kind, content = message[:1], message[1:]
                if kind in (KEPT, SCENE):
                    self.kept[kind] = content
                elif kind == ROBOT:
                    self.robot = Path(content.decode())
                elif kind == REPORT:
                    self._note(pickle.loads(content))

    def collect(self) -> None:
        """Wait for the last messages of a process that has ended."""
        self._reader.join(READ_SECONDS)

    def _note(self, report: str | KatanaError) -> None:
        if isinstance(report, KatanaError):
            self.error = report
            return
        self.statuses.add(report)
        if report == READY:
            self._ready_at = time.monotonic()

    def excuse(self, late: float) -> None:
        """Do not count the time ``late`` [s], in which the supervisor itself was held up."""
        # What arrived meanwhile is newer.
        now = time.monotonic()
        self._started = min(self._started + late, now)
        self._heard = min(self._heard + late, now)

    @property
    def hangs(self) -> str | None:
        """Why the process counts as hung, in words; None if it does not."""
        now = time.monotonic()
        ready = self._ready_at is not None
        if not ready and now - self._started > START_SECONDS:
            return f"was not ready after {START_SECONDS:g} s"
        silent = now - self._heard
        if silent > (self.spec.deadline if ready else START_SILENCE):
            return f"has not answered for {silent:.1f} s"
        return None

    def send(self, message: bytes) -> None:
        """Send ``message``, unless the process hangs so that its pipe is full."""
        with suppress(OSError):
            if writable(self._pipe.fileno()):
                self._pipe.send_bytes(message)

    def ended(self) -> float:
        """Note the end of the process; return the delay until the next start [s]."""
        self.process.join()
        self.collect()
        self._pipe.close()
        ready_at = self._ready_at
        stable = ready_at is not None and time.monotonic() - ready_at > STABLE_SECONDS
        self._early_ends = 0 if stable else self._early_ends + 1
        delay = RESTART_DELAYS[min(self._early_ends, len(RESTART_DELAYS) - 1)]
        self.due = time.monotonic() + delay
        return delay

    def end(self) -> None:
        """Wait until the process ends by itself; kill it after a timeout."""
        if self.due is not None:
            return
        self.process.join(GOODBYE_SECONDS if READY in self.statuses else 0.0)
        if self.process.is_alive():
            self.process.kill()
            self.process.join()


class Supervisor:
    """Keeps all processes running."""

    def __init__(self, specs: Sequence[ChildSpec], stopping: threading.Event) -> None:
        """Create the supervisor. ``stopping``: ends ``wait_for`` and ``run`` once it is set."""
        self._children = {spec.name: Child(spec) for spec in specs}
        self._stopping = stopping
        self._turned = self._notice_at = time.monotonic()

    def start(self) -> None:
        """Start all processes, in the given order."""
        # One more Python would clean up after semaphores and shared memory; see decision 0111.
        nowhere = os.open(os.devnull, os.O_WRONLY)
        multiprocessing.resource_tracker.getfd = lambda: nowhere
        self._turned = time.monotonic()
        for child in self._children.values():
            if not child.spec.late:
                child.start()

    def wait_for(self, name: str, word: str) -> None:
        """Wait until the process ``name`` reports ``word``, at the start of the server.

        Raises the error that a process reports, and ConfigurationError if one ends or hangs.
        """
        while word not in self._children[name].statuses and not self._stopping.is_set():
            self._wait(TURN / 4)
            if self._turned - self._notice_at > BUSY_NOTICE_INTERVAL:
                self._notice_at = self._turned
                log.warning("This machine is busy: katana450 is still starting. Ctrl-C ends it.")
            for child in [
                candidate for candidate in self._children.values() if candidate.due is None
            ]:
                alive = child.running
                if not alive:
                    child.collect()
                if child.error is not None:
                    raise child.error
                why = child.hangs if alive else "ended; see the log above"
                if why is not None:
                    raise ConfigurationError(f"{child.spec.title} did not start: it {why}.")

    def run(self) -> None:
        """Watch all processes until ``stopping`` is set, or until one asks for another robot."""
        while not self._stopping.is_set() and self.robot is None:
            self._wait()
            for child in self._children.values():
                self._watch(child)

    @property
    def robot(self) -> Path | None:
        """File of the robot with which all processes must start again; None for no other one."""
        return next(filter(None, (child.robot for child in self._children.values())), None)

    def stop(self) -> None:
        """End all processes."""
        for child in self._children.values():
            if child.due is None:
                child.send(END)
        for child in self._children.values():
            child.end()

    def _wait(self, turn: float = TURN) -> None:
        """Wait for ``turn`` [s], or until a process ends."""
        wait(
            [child.process.sentinel for child in self._children.values() if child.due is None], turn
        )
        before, self._turned = self._turned, time.monotonic()
        late = self._turned - before - TURN
        for child in self._children.values() if late > TURN / 2 else ():
            if child.due is None:
                child.excuse(late)

    def _watch(self, child: Child) -> None:
        if child.due is not None:
            if time.monotonic() >= child.due:
                self._start(child)
            return
        alive = child.running
        if alive and (why := child.hangs) is not None:
            log.error("%s %s and is ended.", child.spec.title, why)
            child.process.kill()
            alive = False
        if not alive:
            delay = child.ended()
            code = child.process.exitcode
            error = "" if child.error is None else f" {child.error}"
            when = f" in {delay:g} s" if delay else ""
            text = f"{child.spec.title} ended with status {code} and is started again{when}."
            log.error("%s%s", text, error)
            self._announce(child, text)
            if not delay:
                self._start(child)

    @staticmethod
    def _start(child: Child) -> None:
        try:
            child.start()
        except OSError as error:
            log.error("%s could not be started: %s.", child.spec.title, error)
            child.due = time.monotonic() + RETRY_SECONDS

    def _announce(self, about: Child, text: str) -> None:
        for child in self._children.values():
            if child is not about and child.due is None:
                child.send(NOTICE + text.encode())
