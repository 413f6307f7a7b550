"""A process under supervision: its heartbeats, its reports, and the end of its supervisor."""

from __future__ import annotations

import atexit
import gc
import logging
import os
import pickle
import signal
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from multiprocessing.connection import Connection
from pathlib import Path

from katana450.arm.runtime.pipes.arm_roles import RECORD
from katana450.arm.runtime.pipes.private_listener import (
    Greeting,
    PrivateAddress,
    connect_when_ready,
)
from katana450.arm.runtime.readiness import writable
from katana450.assembly.log_output import start_log
from katana450.errors import KatanaError
from katana450.platform_support import name_process, stop_signals, unblock_stop_signals

HEARTBEAT, REPORT, KEPT, SCENE, ROBOT = b".", b"r", b"k", b"s", b"c"
"""First bytes of the messages to the supervisor: a heartbeat; a status word or an error; the last
known state of the arm, without and with its scene, which only the arm's process reads; and the file
of another robot, with which all processes must start again."""

END, NOTICE = b"e", b"n"
"""First bytes of the messages of the supervisor: the process must end; and a notice, which
follows."""

HEARTBEAT_INTERVAL = 0.2
"""[s] Shortest interval of the heartbeats."""

END_SECONDS = 4.0
"""[s] Time in which a process must end after its supervisor."""

READY = "ready"
"""Report of a process that does its work. Until then its supervisor waits longer for heartbeats."""

log = logging.getLogger(__name__)


class SupervisorPipe:
    """The pipe from a process to its supervisor, as the process sees it."""

    def __init__(self, pipe: Connection, interval: float = HEARTBEAT_INTERVAL) -> None:
        """Create the pipe's end; ``start`` runs it. ``interval``: that of the heartbeats [s]."""
        self._pipe = pipe
        self._interval = interval
        self._sending = threading.Lock()
        self._alive: Callable[[], bool] = lambda: True
        self.ended = threading.Event()
        """Set when the supervisor ends this process, or has ended itself."""
        self.notify: Callable[[str], None] = lambda _: None
        """Called, in a thread of its own, with each notice about another process."""

    def start(self) -> None:
        """Send heartbeats in a thread of its own."""
        threading.Thread(target=self._run, name="supervisor pipe", daemon=True).start()

    def prove(self, alive: Callable[[], bool]) -> None:
        """Send heartbeats only while ``alive`` returns True; it is called at each of them."""
        self._alive = alive

    def report(self, status: str | KatanaError) -> None:
        """Send a status word, or the error that ends this process.

        From READY on garbage is collected, but not among the objects of the start: looking through
        them would delay a tick, or STOP.
        """
        if status == READY:
            gc.freeze()
            gc.enable()
        self._send(REPORT + pickle.dumps(status))

    def replace_robot(self, urdf: Path) -> None:
        """Let the supervisor start all processes again, with the robot in the file ``urdf``."""
        self._send(ROBOT + str(urdf).encode())

    def keep(self, kind: bytes, content: bytes) -> bool:
        """Let the supervisor keep ``content`` for the next process, in place of the last ``kind``.

        Returns False, and sends nothing, while the supervisor does not read.

        kind: KEPT or SCENE.
        """
        if not writable(self._pipe.fileno()):
            return False
        self._send(kind + content)
        return True

    def _send(self, message: bytes) -> None:
        with suppress(OSError), self._sending:
            self._pipe.send_bytes(message)

    def _run(self) -> None:
        try:
            self._converse()
        except (EOFError, OSError):
            # The supervisor has ended.
            pass
        except Exception:
            log.exception("The pipe to the supervisor met an error; this process ends.")
        self.ended.set()
        # This thread keeps no object of a process that ends.
        del self._alive, self.notify
        time.sleep(END_SECONDS)
        # Nothing may outlive its supervisor, not even a process whose threads hang.
        os._exit(1)

    def _converse(self) -> None:
        """Send heartbeats until the supervisor ends this process."""
        while True:
            if self._pipe.poll(self._interval):
                message = self._pipe.recv_bytes()
                if message == END:
                    return
                self.notify(message[len(NOTICE) :].decode())
            # A supervisor that hangs reads nothing, and the pipe fills.
            elif self._alive() and writable(self._pipe.fileno()):
                self._send(HEARTBEAT)


def run_supervised(
    name: str, work: Callable[[SupervisorPipe], None], pipe: Connection, interval: float
) -> None:
    """Do ``work`` in this process, which the supervisor has just started.

    Args:
        name: name of the process.
        work: ends when ``SupervisorPipe.ended`` is set. A KatanaError is reported.
        pipe: the pipe to the supervisor.
        interval: that of the heartbeats [s].
    """
    # A start makes few objects that it does not keep. Looking for them takes a tenth of its time.
    gc.disable()
    # Ctrl-C reaches all processes of a terminal; the supervisor ends this one.
    for number in stop_signals():
        signal.signal(number, signal.SIG_IGN)
    unblock_stop_signals()
    name_process(name)
    start_log()
    supervisor = SupervisorPipe(pipe, interval)
    threading.excepthook = partial(_end_after, supervisor)
    supervisor.start()
    try:
        work(supervisor)
    except KatanaError as error:
        supervisor.report(error)
    except SystemExit:
        log.debug("The process ends early, for a reason that was logged.")
    except Exception:
        log.critical("This process met an error.", exc_info=True)
    else:
        # Coverage, children and temporary folders end so.
        atexit._run_exitfuncs()
        _exit_now(0)
    _exit_now(1)


def _exit_now(status: int) -> None:
    """End this process without the end of Python.

    That lists the objects of libraries that an error, or a thread amid its work, still holds.
    """
    for stream in (sys.stdout, sys.stderr):
        stream.flush()
    os._exit(status)


def _end_after(supervisor: SupervisorPipe, failure: threading.ExceptHookArgs) -> None:
    """End this process after an error that ended one of its threads, so that it is started again.

    Without that thread the process would only seem to work.
    """
    if failure.exc_type is SystemExit or failure.exc_value is None:
        return
    name = "" if failure.thread is None else f' "{failure.thread.name}"'
    log.critical("The thread%s met an error.", name, exc_info=failure.exc_value)
    if not supervisor.ended.is_set():
        os._exit(1)


def connected_to_ticks(address: PrivateAddress, ended: threading.Event) -> Connection:
    """Return a new pipe as soon as the arm's process listens at ``address``.

    Raises EOFError when ``ended`` is set first.
    """
    return connect_when_ready(address, Greeting(RECORD), ended)
