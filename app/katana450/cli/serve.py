"""``katana450 serve``: open the ports, and supervise the processes of the server."""

from __future__ import annotations

import secrets
import shutil
import signal
import tempfile
import threading
from argparse import Namespace
from pathlib import Path
from types import FrameType

from katana450.arm.runtime.arm_listener import ArmAddress
from katana450.assembly.arm_process import ArmConfig, run_arm
from katana450.assembly.frontend_process import OPEN, FrontendConfig, run_frontend
from katana450.assembly.log_lines import start_log
from katana450.assembly.supervised import READY
from katana450.assembly.supervisor import Supervisor, child_spec
from katana450.errors import ConfigurationError
from katana450.platform_support import pipe_address, stop_signals
from katana450.resources import URDF_PATH
from katana450.server.web.listen import LOOPBACK, listen
from katana450.settings import Settings

ARM, FRONT_END = "katana450 arm", "katana450 front"
"""Names of the processes."""

ARM_DEADLINE = 1.0
"""[s] Time without a tick of the control loop after which the arm's process is ended."""

FRONT_END_DEADLINE = 1.5
"""[s] Silence after which a front end is ended. A thread of its own sends the heartbeats, so load
does not cause silence."""


def serve_with(options: Namespace) -> int:
    """Run the app with the options of ``katana450 serve``; see ``serve``."""
    settings = Settings(
        host=options.host,
        port=options.port,
        silence=options.silence,
        strict_silence=options.strict_silence,
        access=options.access,
        insecure=options.insecure,
        tls_cert=options.tls_cert,
        tls_key=options.tls_key,
        public_url=options.public_url,
        lines=options.lines,
        bare=options.bare,
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
    """Run the app until SIGINT or SIGTERM; return the exit status.

    Args:
        settings: settings of the server.
        urdf: the file of the arm.
        tool: the link to which targets refer; see ``robot.loader.load``.
        options: options of the extensions; None if no extension takes part.
    """
    start_log()
    stopping = threading.Event()

    def stop(_signal: int, _frame: FrameType | None) -> None:
        stopping.set()

    for number in stop_signals():
        signal.signal(number, stop)
    # Held by this process, so that the port stays taken while the front end is started again.
    listening = listen(settings.host, settings.port)
    lines = None if settings.lines is None else listen(LOOPBACK, settings.lines)
    url = settings.public_url or _address(settings, listening.getsockname()[1])
    folder = _private_folder()
    address = ArmAddress(pipe_address(folder, "arm"), secrets.token_bytes(32))
    front = FrontendConfig(settings, urdf, tool, listening, lines, options, address, folder)
    arm = ArmConfig(settings, urdf, tool, options, address, folder)
    specs = (
        child_spec(FRONT_END, "The page's server", run_frontend, front, FRONT_END_DEADLINE),
        child_spec(ARM, "The arm's process", run_arm, arm, ARM_DEADLINE, keeps=True),
    )
    supervisor = Supervisor(specs, stopping)
    try:
        supervisor.start()
        supervisor.wait_for(ARM, READY)
        supervisor.wait_for(FRONT_END, OPEN)
        if not stopping.is_set():
            print(f"Open {url} in a browser.", flush=True)
        supervisor.wait_for(FRONT_END, READY)
        if not stopping.is_set():
            if lines is not None:
                print(f"Programs: JSON lines on {LOOPBACK}:{lines.getsockname()[1]}.", flush=True)
            print(f"katana450 is ready: {url} (Ctrl-C stops)", flush=True)
        supervisor.run()
    finally:
        supervisor.stop()
        listening.close()
        shutil.rmtree(folder, ignore_errors=True)
    return 0


def _private_folder() -> Path:
    """Return a new folder that only this user can open. Raises ConfigurationError."""
    try:
        return Path(tempfile.mkdtemp(prefix="katana450-"))
    except OSError as error:
        raise ConfigurationError(
            f"No private folder can be created: {error}. Set TMPDIR to a writable folder."
        ) from error


def _address(settings: Settings, port: int) -> str:
    scheme = "https" if settings.tls_cert is not None else "http"
    return f"{scheme}://{_shown(settings.host)}:{port}"


def _shown(host: str) -> str:
    """Return the address that a person on this machine can open."""
    if host in ("0.0.0.0", "::", ""):
        return "127.0.0.1"
    return f"[{host}]" if ":" in host else host
