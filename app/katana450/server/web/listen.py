"""The port that a person asked for, or a sentence that says why not."""

from __future__ import annotations

import errno
import socket
from ipaddress import ip_address

from katana450.errors import ConfigurationError
from katana450.platform_support import claim_port

BACKLOG = 128

LOOPBACK = "127.0.0.1"
"""This machine alone."""


def listen(host: str, port: int) -> socket.socket:
    """A socket that listens on ``host``:``port``; port 0 takes a free one.

    Raises ConfigurationError when the port is busy or cannot be had: which, and what to do.
    """
    try:
        family, _, _, _, address = socket.getaddrinfo(
            host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
    except (socket.gaierror, OverflowError) as error:
        raise ConfigurationError(
            f"{host!r} is not an address of this machine: {error}. Choose another with --host."
        ) from error
    listening = socket.socket(family, socket.SOCK_STREAM)
    try:
        claim_port(listening)
        listening.bind(address)
        listening.listen(BACKLOG)
    except OSError as error:
        listening.close()
        raise ConfigurationError(_refused(host, port, error)) from error
    return listening


def reaches_beyond(listening: socket.socket) -> bool:
    """Whether other machines can reach the socket."""
    return not ip_address(listening.getsockname()[0].partition("%")[0]).is_loopback


def _refused(host: str, port: int, error: OSError) -> str:
    if error.errno == errno.EADDRINUSE:
        return (
            f"Port {port} on {host} is in use by another program. "
            f"Stop it, or choose another port: --port {port + 1}"
        )
    if error.errno == errno.EACCES:
        return f"Port {port} may not be opened by this user. Choose one above 1023 with --port."
    return f"Cannot listen on {host}: {error.strerror}. Choose another with --host."
