"""``katana450 serve``: open the port, run the arm, and keep a front end running."""

from __future__ import annotations

import logging
import signal
import sys
import threading
import time
from argparse import Namespace
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING

from katana450.assembly.frontend_process import OPEN, READY, FrontendConfig, FrontendProcess
from katana450.assembly.log_lines import start_log
from katana450.extension import serve_extensions
from katana450.platform_support import stop_signals
from katana450.resources import URDF_PATH
from katana450.server.web.listen import LOOPBACK, listen
from katana450.settings import Settings

if TYPE_CHECKING:
    from katana450.arm.control.session import Session
    from katana450.arm.robot.initial_scene import InitialScene
    from katana450.assembly.robot_session import DescribedRobot

WAKE_INTERVAL = 0.2
"""[s] Interval at which signals and the end of a front end are checked."""

RESTART_DELAYS = (0.0, 1.0, 5.0, 15.0)
"""[s] Delay before a front end is started again: after a stable run, then after the first, second
and each further early end in a row."""

STABLE_SECONDS = 30.0
"""[s] A front end that ended after a longer time did not end early."""

HANG_TIMEOUT = 10.0
"""[s] A front end that sends nothing for so long has hung."""

log = logging.getLogger(__name__)


def serve_with(options: Namespace) -> int:
    """Run the app with the options of ``katana450 serve``; see ``serve``."""
    settings = Settings(
        host=options.host,
        port=options.port,
        silence=options.silence,
        access=options.access,
        insecure=options.insecure,
        tls_cert=options.tls_cert,
        tls_key=options.tls_key,
        public_url=options.public_url,
        lines=options.lines,
        bare=options.bare,
        go_on_release=options.go_on_release,
    )
    # The options are sent to another process, which does not need the command itself.
    values = Namespace(**{key: value for key, value in vars(options).items() if key != "command"})
    return serve(settings, options.urdf, options.tool, values)


def serve(
    settings: Settings,
    urdf: Path = URDF_PATH,
    tool: str | None = None,
    options: Namespace | None = None,
) -> int:
    """Run the app until SIGINT or SIGTERM; return the exit status, 1 if the control loop ended.

    Args:
        settings: settings of the server.
        urdf: the file of the arm.
        tool: the link to which targets refer; see ``robot.loader.load``.
        options: options of the extensions; None if no extension takes part.
    """
    start_log()
    # Read first: the front end gets this scene each time it is started.
    robot, scene = _with_scene(settings, urdf, tool, options)
    stopping = threading.Event()

    def stop(_signal: int, _frame: FrameType | None) -> None:
        stopping.set()

    for number in stop_signals():
        signal.signal(number, stop)
    # Held by this process, so that the port stays taken while the front end is started again.
    listening = listen(settings.host, settings.port)
    lines = None if settings.lines is None else listen(LOOPBACK, settings.lines)
    url = settings.public_url or _address(settings, listening.getsockname()[1])

    meshes = () if scene is None else scene.meshes
    config = FrontendConfig(settings, urdf, tool, listening, lines, options, meshes)
    front, arm = FrontendProcess(config), None
    try:
        # Importing the libraries that read the robot takes most of a second. The front end starts
        # meanwhile.
        from katana450.assembly.robot_session import RunningArm, find_robot

        found = find_robot(settings, urdf, tool) if robot is None else robot
        arm = RunningArm(settings, found, scene)
        for note in arm.notes:
            print(f"katana450: {note}", file=sys.stderr)
        front.wait_for(OPEN)
        print(f"Open {url} in a browser.", flush=True)
        arm.start()
        arm.attach(front.pipe)
        front.wait_for(READY)
        if lines is not None:
            print(f"Programs: JSON lines on {LOOPBACK}:{lines.getsockname()[1]}.", flush=True)
        print(f"katana450 is ready: {url} (Ctrl-C stops)", flush=True)
        early_ends, started = 0, time.monotonic()
        # A signal that another thread receives does not wake this one from its wait.
        while arm.running and not stopping.wait(WAKE_INTERVAL):
            if front.running:
                if time.monotonic() - started > STABLE_SECONDS and arm.silence > HANG_TIMEOUT:
                    log.error("The page's server has sent nothing for %g s.", HANG_TIMEOUT)
                    front.kill()
                continue
            log.error(
                "The page's server ended with status %s and is started again; the arm holds.",
                front.exit_code,
            )
            early_ends = 0 if time.monotonic() - started > STABLE_SECONDS else early_ends + 1
            stopping.wait(RESTART_DELAYS[min(early_ends, len(RESTART_DELAYS) - 1)])
            front.stop()
            front, started = FrontendProcess(config), time.monotonic()
            arm.attach(front.pipe)
        if not stopping.is_set():
            log.critical("The control loop has ended, so the server ends too. Start it again.")
    finally:
        # The arm first: a front end whose arm closes the link ends by itself.
        if arm is not None:
            arm.stop()
        front.stop()
        if arm is not None:
            arm.join()
        listening.close()
    return 0 if stopping.is_set() else 1


def _with_scene(
    settings: Settings, urdf: Path, tool: str | None, options: Namespace | None
) -> tuple[DescribedRobot | None, InitialScene | None]:
    """Return the scene that an extension starts with, and the robot if it was read for that."""
    if options is None:
        return None, None
    found_robots: list[DescribedRobot] = []

    def session() -> Session:
        from katana450.assembly.robot_session import describe_robot

        if not found_robots:
            found_robots.append(describe_robot(settings, urdf, tool))
        return found_robots[0].session

    scene = None
    for part in serve_extensions():
        if scene is None and part.initial_scene is not None:
            scene = part.initial_scene(options, session)
    for note in () if scene is None else scene.notes:
        print(f"katana450: {note}", flush=True)
    return (found_robots[0] if found_robots else None), scene


def _address(settings: Settings, port: int) -> str:
    scheme = "https" if settings.tls_cert is not None else "http"
    return f"{scheme}://{_shown(settings.host)}:{port}"


def _shown(host: str) -> str:
    """Return the address that a person on this machine can open."""
    if host in ("0.0.0.0", "::", ""):
        return "127.0.0.1"
    return f"[{host}]" if ":" in host else host
