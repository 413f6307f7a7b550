"""``katana450 serve``: open the ports and the page, and supervise the processes of the server."""

from __future__ import annotations

import logging
import os
import shutil
import signal
import socket
import sys
import tempfile
import threading
import webbrowser
from argparse import Namespace
from dataclasses import dataclass, fields, replace
from functools import partial
from pathlib import Path
from types import FrameType

from katana450.arm.runtime.pipes.private_listener import PrivateAddress
from katana450.assembly.frontend_process import OPEN, Sockets, log_folder, run_frontend
from katana450.assembly.log_output import say, start_log
from katana450.assembly.supervised import READY
from katana450.assembly.supervisor import ChildSpec, Supervisor
from katana450.errors import ConfigurationError, KatanaError
from katana450.extension import ExtraProcess, ServerFacts, load, results
from katana450.platform_support import pipe_address, stop_signals
from katana450.server.web.listen import LOOPBACK, listen, listen_beside, raise_descriptor_limit
from katana450.settings import FIXED, Settings

log = logging.getLogger(__name__)

ARM, FRONT_END, STOP = "katana450 arm", "katana450 front", "katana450 stop"
"""Names of the processes."""

RUN_ARM = "katana450.assembly.arm_process:run_arm"
RUN_STOP = "katana450.assembly.stop_process:run_stop"
"""Functions of two of them, whose modules are imported there alone."""

ARM_DEADLINE = 1.0
"""[s] Time without a tick of the control loop after which the arm's process is ended."""

FRONT_END_DEADLINE = 0.9
"""[s] Silence after which a front end is ended, so that the page is back within 3 s. A thread of
its own sends the heartbeats, so load does not cause silence."""

STOP_DEADLINE = 2.0
"""[s] Silence after which the process of STOP is ended. It falls silent 1 s after the last turn of
its event loop, and at once when its thread that reads from the arm's process has ended."""


EXTRA_DEADLINE = 10.0
"""[s] Silence after which a process of an extension is ended."""


def serve(options: Namespace) -> int:
    """Run the app with the options of ``katana450 serve`` until SIGINT or SIGTERM.

    Returns the exit status.
    """
    values = vars(options)
    named = (field.name for field in fields(Settings) if field.name not in FIXED)
    settings = Settings(**{name: values[name] for name in named})
    # The options are sent to other processes, which do not need the command itself.
    options = Namespace(**{key: value for key, value in values.items() if key != "command"})
    start_log()
    raise_descriptor_limit()
    stopping = threading.Event()
    _set_on_signals(stopping)
    # Held by this process, so that the port stays taken while the front end is started again.
    listening = listen(settings.host, settings.port)
    lines = None if settings.lines is None else listen(LOOPBACK, settings.lines)
    stopping_socket = listen_beside(listening, settings.host, settings.stop_port)
    settings = replace(settings, stop_port=stopping_socket.getsockname()[1])
    server = _Server(settings, Sockets(listening, lines), stopping_socket, stopping)
    again, before = False, None
    try:
        while True:
            try:
                chosen = server.run(options, again=again)
            except KatanaError as error:
                if before is None:
                    raise
                # It was read without a fault before, so this is rare.
                log.error("%s cannot be driven: %s", options.urdf.name, error)
                options, before = before, None
                options.robot_problem = str(error)
                continue
            if chosen is None:
                return 0
            again, before = True, options
            # What belongs to the robot before is left out.
            others = dict.fromkeys(("tool", "scene", "xacro_arg", "robot_problem"))
            first = {"first_urdf": options.urdf, **vars(options)}
            options = Namespace(**{**first, **others, "urdf": chosen, "objects": []})
    finally:
        listening.close()
        stopping_socket.close()


@dataclass(frozen=True)
class _Server:
    """The parts of the server that stay while it changes its robot.

    Attributes:
        settings: settings of the server.
        sockets: the sockets of the page and of programs, held by this process, so that the ports
            stay taken.
        stopping_socket: the socket for STOP.
        stopping: set when the server must end.
    """

    settings: Settings
    sockets: Sockets
    stopping_socket: socket.socket
    stopping: threading.Event

    def run(self, options: Namespace, *, again: bool) -> Path | None:
        """Run all processes with the robot that ``options`` name.

        Returns the file of another robot that a person chose meanwhile; None if the server must
        end. ``again``: whether it drove another robot before.
        """
        settings, stopping = self.settings, self.stopping
        port = self.sockets.pages.getsockname()[1]
        url = settings.public_url or local_url(settings, port)
        folder = _private_folder()
        address = PrivateAddress(pipe_address(folder, "arm"), os.urandom(32))
        facts = ServerFacts(settings, options.urdf, options.tool, port, address, options, folder)
        front_end = partial(run_frontend, facts, self.sockets)
        stop = partial(_run, RUN_STOP, facts, self.stopping_socket)
        extra: list[ExtraProcess] = [*results("process", options, facts)]
        specs = (
            ChildSpec(STOP, "The process of STOP", stop, STOP_DEADLINE),
            ChildSpec(FRONT_END, "The page's server", front_end, FRONT_END_DEADLINE),
            ChildSpec(
                ARM, "The arm's process", partial(_run, RUN_ARM, facts), ARM_DEADLINE, keeps=True
            ),
            *(
                ChildSpec(
                    process.name,
                    process.title,
                    partial(process.run, process.config),
                    EXTRA_DEADLINE,
                    late=True,
                )
                for process in extra
            ),
        )
        supervisor = Supervisor(specs, stopping)
        try:
            supervisor.start()
            supervisor.wait_for(ARM, READY)
            supervisor.wait_for(FRONT_END, OPEN)
            if not (stopping.is_set() or again):
                say(f"Open {url} in a browser.")
                # With access links each person has an address of their own.
                if not options.no_browser and settings.access is None:
                    show_page(url, port, settings.stop_port or 0)
            supervisor.wait_for(STOP, READY)
            supervisor.wait_for(FRONT_END, READY)
            if again and not stopping.is_set():
                say(f"katana450 is ready with {options.urdf.name}: {url}")
            elif not stopping.is_set():
                lines = self.sockets.lines
                if lines is not None:
                    say(f"Programs: JSON lines on {LOOPBACK}:{lines.getsockname()[1]}.")
                if (log_in := log_folder(options, port)) is not None:
                    say(f"Event log: {log_in}")
                for added in extra:
                    say(added.description)
                say(
                    f"katana450 is ready: {url} (STOP also on port {settings.stop_port}; Ctrl-C "
                    "stops)"
                )
            supervisor.run()
            return supervisor.robot
        finally:
            supervisor.stop()
            shutil.rmtree(folder, ignore_errors=True)


def _run(target: str, *arguments: object) -> None:
    """Run the function that ``target`` names, in the process that was started for it."""
    load(target)(*arguments)


def _set_on_signals(stopping: threading.Event) -> None:
    """Set ``stopping`` when a signal asks this process to end."""

    def stop(_signal: int, _frame: FrameType | None) -> None:
        stopping.set()

    for number in stop_signals():
        signal.signal(number, stop)


def _private_folder() -> Path:
    """Return a new folder that only this user can open. Raises ConfigurationError."""
    try:
        return Path(tempfile.mkdtemp(prefix="katana450-"))
    except OSError as error:
        raise ConfigurationError(
            f"No private folder can be created: {error}. Set TMPDIR to a writable folder."
        ) from error


def local_url(settings: Settings, port: int) -> str:
    """Return the address at which this machine opens the server with ``settings`` on ``port``."""
    scheme = "https" if settings.tls_cert is not None else "http"
    return f"{scheme}://{_shown(settings.host)}:{port}"


def _shown(host: str) -> str:
    """Return the address that a person on this machine can open."""
    if host in ("0.0.0.0", "::", ""):
        return "127.0.0.1"
    return f"[{host}]" if ":" in host else host


SCREENS = {"DISPLAY", "WAYLAND_DISPLAY", "WSL_DISTRO_NAME"}
"""Variables of which a Linux that can show a browser has one."""


def show_page(url: str, *ports: int) -> None:
    """Open ``url`` in a thread, or say how to open it from elsewhere through a tunnel of ``ports``.

    A server that no person started, and one in a container, opens nothing unless BROWSER is set.
    """
    remote = "SSH_CONNECTION" in os.environ
    if not os.environ.get("BROWSER"):
        in_container = "container" in os.environ or Path("/.dockerenv").exists()
        if in_container or not sys.stdout.isatty():
            return
        remote |= sys.platform == "linux" and not SCREENS & os.environ.keys()
    if not remote:
        threading.Thread(target=_open, args=(url,), daemon=True).start()
    elif sys.stdout.isatty():
        tunnel = " ".join(f"-L {port}:127.0.0.1:{port}" for port in ports)
        say(f"No display here: run `ssh {tunnel} HOST` where there is one, and open {url} there.")


def _open(url: str) -> None:
    if not webbrowser.open(url):
        say(f"No browser could be started. Open {url} in one yourself.")
