"""Listening sockets and the limit of open files, with clear errors. It imports little."""

from __future__ import annotations

import errno
import logging
import socket
from contextlib import suppress
from ipaddress import ip_address

from katana450.errors import ConfigurationError
from katana450.platform_support import claim_port, raise_open_file_limit

BACKLOG = 1024
"""Connections that wait to be accepted. The system drops one more, and the client tries again after
a second."""

MAX_PORT = 65535

LOOPBACK = "127.0.0.1"
"""Address that only programs of this machine can reach."""


DESCRIPTORS = 1024
"""Maximum number of files and sockets open at once: two or three for each allowed connection, and a
reserve for libraries, files and pipes."""

MIN_DESCRIPTORS = 128
"""Limit of open files below which the server does not start: a crowd of clients would lock out
everybody, and STOP from a new connection would fail."""

WANTED_DESCRIPTORS = 4096
"""Limit of open files that the server requests from the system."""

log = logging.getLogger(__name__)


def raise_descriptor_limit() -> None:
    """Raise the limit of open files to ``WANTED_DESCRIPTORS``, or as far as the system allows.

    Raises ConfigurationError if fewer than ``MIN_DESCRIPTORS`` can be open.
    """
    limit = raise_open_file_limit(WANTED_DESCRIPTORS)
    if limit is not None and limit < MIN_DESCRIPTORS:
        raise ConfigurationError(
            f"Only {limit} files can be open at once, too few to run. Raise the limit to "
            f"{DESCRIPTORS} (`ulimit -n {DESCRIPTORS}`)."
        )
    if limit is not None and limit < DESCRIPTORS:
        log.warning(
            "Only %d files can be open at once. Many clients can use them up, and STOP from a new "
            "connection then fails. Raise the limit to %d (`ulimit -n`).",
            limit,
            DESCRIPTORS,
        )


def listen(host: str, port: int, option: str = "--port") -> socket.socket:
    """Return a socket that listens on ``host``:``port``; port 0 takes a free one.

    ``option``: the option of the port, for the error.

    Raises ConfigurationError, with what to do, if the address or the port cannot be used.
    """
    try:
        family, _, _, _, address = socket.getaddrinfo(
            host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
    except (socket.gaierror, OverflowError) as error:
        raise ConfigurationError(
            f"{host!r} is not an address of this machine: {error}. Choose another with --host."
        ) from error
    # asyncio turns Nagle's algorithm off only for sockets that name their protocol. With it, a
    # small message waits for the acknowledgement of the one before, which takes up to 40 ms.
    listening = socket.socket(family, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    try:
        claim_port(listening)
        listening.bind(address)
        listening.listen(BACKLOG)
    except OSError as error:
        listening.close()
        raise ConfigurationError(_refused(host, port, error, option)) from error
    return listening


def listen_beside(main: socket.socket, host: str, port: int | None) -> socket.socket:
    """Return a socket for STOP that listens on ``host``:``port``.

    Without ``port`` it is the port after that of ``main``, or a free one if that is in use. Raises
    ConfigurationError, as ``listen`` does.
    """
    if port is not None:
        return listen(host, port, "--stop-port")
    stop_port: int = main.getsockname()[1] + 1
    try:
        return listen(host, stop_port if stop_port <= MAX_PORT else 0)
    except ConfigurationError:
        return listen(host, 0)


def reaches_beyond(listening: socket.socket) -> bool:
    """Return whether other machines can reach the socket."""
    return not ip_address(listening.getsockname()[0].partition("%")[0]).is_loopback


def _refused(host: str, port: int, error: OSError, option: str) -> str:
    if error.errno == errno.EADDRINUSE:
        another = f"{option} {port + 2}"
        with suppress(OSError), socket.create_connection((host, port), timeout=1.0) as server:
            server.sendall(b"GET / HTTP/1.0\r\nHost: localhost\r\n\r\n")
            if b"<title>Katana450" in server.makefile("rb").read(8192):
                return f"katana450 already runs on port {port}. Open its page, or add {another}"
        return f"Port {port} on {host} is in use. Choose another one: {another}"
    if error.errno == errno.EACCES:
        return f"Port {port} may not be opened by this user. Choose one above 1023 with {option}."
    return f"Cannot listen on {host}: {error.strerror}. Choose another with --host."
