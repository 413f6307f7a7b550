"""``katana450 serve``: open the port, run the arm, and see to it that people can reach it."""

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

from katana450.assembly.frontend_process import OPEN, READY, Front, FrontendConfig
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
"""[s] How soon a signal is heeded, and a front that ended."""

RESTART_DELAYS = (0.0, 1.0, 5.0, 15.0)
"""[s] Until it is started again, the longer the more often it ended at once."""

STABLE_SECONDS = 30.0
"""[s] A front that ran for so long did not end at once."""

HANG_TIMEOUT = 10.0
"""[s] A front that says nothing for so long has hung."""

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
    )
    # Sent to another process, which has no use for the command itself.
    values = Namespace(**{key: value for key, value in vars(options).items() if key != "command"})
    return serve(settings, options.urdf, options.tool, values)


def serve(
    settings: Settings,
    urdf: Path = URDF_PATH,
    tool: str | None = None,
    options: Namespace | None = None,
) -> int:
    """Run the app until SIGINT or SIGTERM; returns the exit status, 1 if the control loop ended.

    ``urdf``, ``tool``: the arm, and the link its targets are set for; see ``robot.loader.load``.
    ``options``: those of the extensions; None where none takes part.
    """
    start_log()
    # Read before anything runs: the front shows what it is given here, each time it is started.
    robot, scene = _with_scene(settings, urdf, tool, options)
    stopping = threading.Event()

    def stop(_signal: int, _frame: FrameType | None) -> None:
        stopping.set()

    for number in stop_signals():
        signal.signal(number, stop)
    # Held here, so that nobody else takes it while the front is started again.
    listening = listen(settings.host, settings.port)
    lines = None if settings.lines is None else listen(LOOPBACK, settings.lines)
    url = settings.public_url or _address(settings, listening.getsockname()[1])

    meshes = () if scene is None else scene.meshes
    config = FrontendConfig(settings, urdf, tool, listening, lines, options, meshes)
    current, arm = Front(config), None
    try:
        # The libraries that read the robot take most of a second; so does the front meanwhile.
        from katana450.assembly.robot_session import RunningArm, find_robot

        found = find_robot(settings, urdf, tool) if robot is None else robot
        arm = RunningArm(settings, found, scene)
        for note in arm.notes:
            print(f"katana450: {note}", file=sys.stderr)
        current.wait_for(OPEN)
        print(f"Open {url} in a browser.", flush=True)
        arm.start()
        arm.attach(current.pipe)
        current.wait_for(READY)
        if lines is not None:
            print(f"Programs: JSON lines on {LOOPBACK}:{lines.getsockname()[1]}.", flush=True)
        print(f"katana450 is ready: {url} (Ctrl-C stops)", flush=True)
        ended, began = 0, time.monotonic()
        # A signal that another thread is given does not wake this one from its wait.
        while arm.running and not stopping.wait(WAKE_INTERVAL):
            if current.running:
                if time.monotonic() - began > STABLE_SECONDS and arm.unheard > HANG_TIMEOUT:
                    log.error("The page's server has not been heard of for %g s.", HANG_TIMEOUT)
                    current.kill()
                continue
            log.error(
                "The page's server ended with status %s; the arm holds. It is started again.",
                current.exit_code,
            )
            ended = 0 if time.monotonic() - began > STABLE_SECONDS else ended + 1
            stopping.wait(RESTART_DELAYS[min(ended, len(RESTART_DELAYS) - 1)])
            current.stop()
            current, began = Front(config), time.monotonic()
            arm.attach(current.pipe)
        if not stopping.is_set():
            log.critical("The control loop has ended, so the server ends too: start it again.")
    finally:
        # The arm first: a front whose arm hangs up ends in peace.
        if arm is not None:
            arm.stop()
        current.stop()
        if arm is not None:
            arm.join()
        listening.close()
    return 0 if stopping.is_set() else 1


def _with_scene(
    settings: Settings, urdf: Path, tool: str | None, options: Namespace | None
) -> tuple[DescribedRobot | None, InitialScene | None]:
    """Return the scene that an extension starts with, and the robot if it had to be read for it."""
    if options is None:
        return None, None
    read: list[DescribedRobot] = []

    def session() -> Session:
        from katana450.assembly.robot_session import describe_robot

        if not read:
            read.append(describe_robot(settings, urdf, tool))
        return read[0].session

    scene = None
    for part in serve_extensions():
        if scene is None and part.initial_scene is not None:
            scene = part.initial_scene(options, session)
    for note in () if scene is None else scene.notes:
        print(f"katana450: {note}", flush=True)
    return (read[0] if read else None), scene


def _address(settings: Settings, port: int) -> str:
    scheme = "https" if settings.tls_cert is not None else "http"
    return f"{scheme}://{_shown(settings.host)}:{port}"


def _shown(host: str) -> str:
    """The address a person on this machine can open."""
    if host in ("0.0.0.0", "::", ""):
        return "127.0.0.1"
    return f"[{host}]" if ":" in host else host
