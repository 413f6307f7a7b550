"""A server in a process of its own, which can be killed and started again."""

from __future__ import annotations

import os
import random
import re
import signal
import socket
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Self

from katana450.platform_support import without_interrupts

ROOT = Path(__file__).resolve().parents[2]
# A machine that draws without a graphics card delays its browsers, and their heartbeats come late.
# APP therefore has longer timeouts than ATTENTIVE_APP, which has the default ones.
# SIMULATION_APP pauses after silence; the others stop, as with a real arm.
# RECORDING_APP is the app as people start it. The others save the time of recording and planning.
RECORDING_APP = (sys.executable, "-m", "katana450", "serve", "--no-browser", "--port", "{port}")
SIMULATION_APP = (*RECORDING_APP, "--no-record")
ATTENTIVE_APP = (*SIMULATION_APP, "--strict-silence")
APP = (*ATTENTIVE_APP, "--silence", "2.0", "--owner-silence", "6.0")
BARE_APP = (sys.executable, str(ROOT / "benchmarks" / "bare_viser_app.py"), "--port", "{port}")

# Below the ports of outgoing connections, so that none of those takes the port of a killed server.
# Even, because the next port serves STOP. Many, so that two tests never choose the same at once.
PORTS = range(20000, 30000, 2)
READY = re.compile(r"is ready: (https?://\S+)")
STOP_PORT = re.compile(r"STOP also on port (\d+)")
KEPT_LINES = 400


class ServerError(RuntimeError):
    """Raised if the server does not start or stop; the message ends with its output."""


def free_port() -> int:
    """Return a free port of PORTS. Raises ServerError if all are in use."""
    # In another order each time, so that parallel runs rarely collide.
    for port in random.sample(PORTS, len(PORTS)):
        with socket.socket() as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                probe.bind(("127.0.0.1", port))
            except OSError:
                continue
            return port
    raise ServerError(f"no port from {PORTS[0]} to {PORTS[-1]} is free on 127.0.0.1")


class AppServer:
    """A context manager around a server process.

    `command` contains ``{port}`` in place of the port. The process prints a line
    ``… is ready: URL`` when it can be used. `seconds` is the timeout of each start and each stop.
    The process starts in `folder`, with the variables `environment` instead of those of this one.
    """

    def __init__(
        self,
        command: Sequence[str] = APP,
        *,
        port: int | None = None,
        seconds: float = 60.0,
        scheme: str = "http",
        folder: Path = ROOT,
        environment: Mapping[str, str] | None = None,
    ) -> None:
        self.port = free_port() if port is None else port
        self.url = f"{scheme}://127.0.0.1:{self.port}"
        self._command = [part.replace("{port}", str(self.port)) for part in command]
        self._folder = folder
        self._environment = None if environment is None else dict(environment)
        self._seconds = seconds
        self._lines: deque[str] = deque(maxlen=KEPT_LINES)
        self._process: subprocess.Popen[str] | None = None
        self._reader: threading.Thread | None = None

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(self, *_error: object) -> None:
        self.stop()

    @property
    def output(self) -> str:
        """Last lines that the process printed, in both streams."""
        return "\n".join(self._lines)

    @property
    def running(self) -> bool:
        """True while the process runs."""
        return self._process is not None and self._process.poll() is None

    @property
    def status(self) -> int | None:
        """Exit status of the process that ended last, until `stop`; None while it runs."""
        return None if self._process is None else self._process.poll()

    @property
    def pid(self) -> int:
        """Id of the process. Raises ServerError if it does not run."""
        if self._process is None:
            raise ServerError(f"{self._name} does not run")
        return self._process.pid

    @property
    def front(self) -> int:
        """Id of the front-end process, as Linux lists it."""
        return self.child("katana450 front")

    @property
    def arm(self) -> int:
        """Id of the arm's process, as Linux lists it."""
        return self.child("katana450 arm")

    @property
    def stop_process(self) -> int:
        """Id of the process of STOP, as Linux lists it."""
        return self.child("katana450 stop")

    @property
    def stop_url(self) -> str:
        """Address of the port of STOP, which the process has printed."""
        port = next(filter(None, map(STOP_PORT.search, reversed(self._lines))))
        return f"{self.url.rpartition(':')[0]}:{port[1]}"

    def child(self, name: str) -> int:
        """Return the id of the child process ``name``. Raises ServerError if there is none."""
        pids = []
        # The lists of children in /proc may lack one while another process ends.
        for process in Path("/proc").glob("[0-9]*"):
            with suppress(OSError):
                stat = (process / "stat").read_text()
                comm, _, rest = stat.partition("(")[2].rpartition(") ")
                if comm == name and int(rest.split()[1]) == self.pid:
                    pids.append(int(process.name))
        if len(pids) != 1:
            raise ServerError(f"{self._name} has {len(pids)} processes {name!r}")
        return pids[0]

    @contextmanager
    def frozen(self, process: int) -> Iterator[None]:
        """Suspend ``process``, and the supervisor that would end it, inside the block."""
        processes = (self.pid, process)
        for pid in processes:
            os.kill(pid, signal.SIGSTOP)
        try:
            yield
        finally:
            for pid in reversed(processes):
                os.kill(pid, signal.SIGCONT)

    def start(self) -> None:
        """Start the process and return when it is ready.

        Raises ServerError if it ends first, exceeds the timeout or serves at another address.
        """
        if self.running:
            raise ServerError(f"{self._name} is already running")
        self._process = subprocess.Popen(
            self._command,
            cwd=self._folder,
            env=self._environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            encoding="utf-8",
            errors="replace",
            # A process group of its own, so that kill() also ends its children.
            **without_interrupts(),
        )
        # The output must be read: a full pipe blocks the writer.
        ready: SimpleQueue[str | None] = SimpleQueue()
        self._reader = threading.Thread(target=self._read, args=(self._process, ready), daemon=True)
        self._reader.start()
        try:
            url = ready.get(timeout=self._seconds)
        except Empty:
            reason = f"was not ready after {self._seconds:g} s"
        else:
            if url == self.url:
                return
            reason = (
                f"ended before it was ready, with status {self._process.wait()}"
                if url is None
                else f"is at {url} instead of {self.url}"
            )
        self.kill()
        raise ServerError(f"{self._name} {reason}. It printed:\n{self.output or '(nothing)'}")

    def stop(self) -> None:
        """End the process as Ctrl-C does. Raises ServerError if it has to be killed."""
        if self._process is not None and self.running:
            if sys.platform == "win32":
                self._process.send_signal(signal.CTRL_BREAK_EVENT)
            else:
                os.killpg(self._process.pid, signal.SIGINT)
            try:
                self._process.wait(self._seconds)
            except subprocess.TimeoutExpired as error:
                self.kill()
                raise ServerError(
                    f"{self._name} did not end in {self._seconds:g} s after Ctrl-C. "
                    f"It printed:\n{self.output}"
                ) from error
        self._collect()

    def close(self) -> None:
        """End the process as `stop` does, for `contextlib.closing`."""
        self.stop()

    def kill(self) -> None:
        """End the process and its children immediately (SIGKILL)."""
        if self._process is not None and self.running:
            self._process.kill()
        self._collect()

    def restart(self) -> None:
        """Start again on the same port; kill the process first if it still runs."""
        self.kill()
        self.start()

    @property
    def _name(self) -> str:
        return f"`{' '.join(self._command)}`"

    def _read(self, process: subprocess.Popen[str], ready: SimpleQueue[str | None]) -> None:
        """Store the output of the process; put its address when known, and None at its end."""
        assert process.stdout is not None
        with process.stdout as stream:
            for line in stream:
                self._lines.append(line.rstrip())
                if match := READY.search(line):
                    ready.put(match[1].rstrip("/"))
        ready.put(None)

    def _collect(self) -> None:
        if self._process is not None:
            self._process.wait()
            # On Windows the children end when the process has ended.
            if sys.platform != "win32":
                with suppress(ProcessLookupError):
                    os.killpg(self._process.pid, signal.SIGKILL)
        if self._reader is not None:
            self._reader.join()
        self._process = self._reader = None
