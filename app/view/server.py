"""The viser server, opened on the port that was asked for or not at all."""

from __future__ import annotations

import contextlib
import errno
import io
import socket

import viser

from app.errors import ConfigurationError
from app.view.brand import dress
from app.view.cameras import FOV, LOOKS, Preset
from app.view.guard import Guard


def open_server(host: str, port: int) -> viser.ViserServer:
    """A guarded viser server on ``host``:``port``, its scene still empty; port 0 takes a free one.

    Raises:
        ConfigurationError: the port is busy, or cannot be had; says which and what to do.
    """
    _check_free(host, port)
    # What viser prints of itself here would stand between a person and our own line.
    with contextlib.redirect_stdout(io.StringIO()):
        server = viser.ViserServer(host=host, port=port, label="Katana450", verbose=False)
    # viser takes the next port when another program was quicker; a person would look in vain.
    if port not in (0, server.get_port()):
        server.stop()
        raise ConfigurationError(_busy(host, port))
    Guard(server)
    _dress(server)
    return server


def _dress(server: viser.ViserServer) -> None:
    """What a page takes over when it connects, and so must stand before the first one does."""
    dress(server.gui, dark=False)
    server.gui.set_panel_label("Katana450")
    server.gui.main_panel.dock_right()
    server.scene.set_up_direction("+z")
    look = LOOKS[Preset.FREE]
    server.initial_camera.position = look.position
    server.initial_camera.look_at = look.target
    server.initial_camera.fov = FOV


def _check_free(host: str, port: int) -> None:
    try:
        family, _, _, _, address = socket.getaddrinfo(
            host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
    except (socket.gaierror, OverflowError) as error:
        raise ConfigurationError(
            f"{host!r} is not an address of this machine: {error}. Choose another with --host."
        ) from error
    with socket.socket(family, socket.SOCK_STREAM) as probe:
        # As the server itself will: a port that is only closing down is free.
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind(address)
        except OSError as error:
            raise ConfigurationError(_refused(host, port, error)) from error


def _refused(host: str, port: int, error: OSError) -> str:
    if error.errno == errno.EADDRINUSE:
        return _busy(host, port)
    if error.errno == errno.EACCES:
        return f"Port {port} may not be opened by this user. Choose one above 1023 with --port."
    return f"Cannot listen on {host}: {error.strerror}. Choose another with --host."


def _busy(host: str, port: int) -> str:
    return (
        f"Port {port} on {host} is in use by another program. "
        f"Stop it, or choose another port: --port {port + 1}"
    )
