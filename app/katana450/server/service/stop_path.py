"""Second path of STOP, as the front end knows it: its port, and whether it answers."""

from __future__ import annotations

import asyncio
import logging
import ssl
from collections.abc import Callable
from dataclasses import dataclass
from urllib.parse import urlsplit

log = logging.getLogger(__name__)

CHECK_EVERY = 0.5
"""[s] Interval of the requests."""

ARM_SILENCE = 0.25
"""[s] Silence of the arm's process from which the server of STOP need not reach it either."""

ANSWER_TIMEOUT = 0.5
"""[s] Timeout for an answer."""

MAX_FAILURES = 2
"""Failures in a row after which the path counts as missing."""

WELL, WITHOUT_ARM = b"HTTP/1.1 200", b"HTTP/1.1 503"
"""Start of an answer of a healthy server, and of one that has no answer from the arm."""

REQUEST = b"GET /health HTTP/1.1\r\nHost: localhost\r\n\r\n"

ANYWHERE = {"0.0.0.0": "127.0.0.1", "::": "::1"}
"""Address of this machine for a socket that listens on all of its addresses."""


@dataclass
class StopPath:
    """The port that serves STOP alone.

    Attributes:
        port: Port to which clients also send STOP; None if they have only the address of a proxy,
            or if there is no such port.
        main_port: Port of the page.
        secure: Whether both ports use TLS.
        problem: Problem of the path in words; empty if it answers.
    """

    port: int | None = None
    main_port: int = 0
    secure: bool = False
    problem: str = ""

    def port_beside(self, host: str) -> int | None:
        """Return the port for a page at ``host``, of its Host header; None if it cannot use one.

        A page at another port than the main one has come through a forwarded port.
        """
        used = urlsplit(f"//{host}").port or (443 if self.secure else 80)
        return self.port if used == self.main_port else None

    def origin_beside(self, host: str) -> str | None:
        """Return the origin to which a page at ``host`` may also send STOP; None without one.

        A content security policy cannot name an IPv6 address.
        """
        name, port = urlsplit(f"//{host}").hostname, self.port_beside(host)
        if port is None or name is None or ":" in name:
            return None
        return f"{'https' if self.secure else 'http'}://{name}:{port}"


async def watch_stop_path(
    path: StopPath, host: str, port: int, arm_age: Callable[[], float], *, secure: bool
) -> None:
    """Keep ``path.problem`` true for the server of STOP on ``host`` and ``port``, until cancelled.

    Args:
        path: the path of STOP.
        host: address on which the server listens.
        port: its port.
        arm_age: returns the time since this process heard the arm's process [s]. While it is
            ARM_SILENCE or longer, the server of STOP need not reach the arm either.
        secure: whether the server uses TLS.
    """
    tls = None
    if secure:
        # Only whether it answers matters; its certificate names the public address.
        tls = ssl.create_default_context()
        tls.check_hostname, tls.verify_mode = False, ssl.CERT_NONE
    failures = 0
    while True:
        try:
            async with asyncio.timeout(ANSWER_TIMEOUT):
                answer = await _answer(ANYWHERE.get(host, host), port, tls)
        except (OSError, EOFError, TimeoutError):
            answer = b""
        serves = answer == WELL or (answer == WITHOUT_ARM and arm_age() >= ARM_SILENCE)
        failures = 0 if serves else failures + 1
        if path.problem and serves:
            path.problem = ""
            log.warning("STOP is served on port %d again.", port)
        elif failures == MAX_FAILURES:
            path.problem = (
                f"STOP is not served on port {port} now; it has only the path of the page itself."
            )
            log.error("%s", path.problem)
        await asyncio.sleep(CHECK_EVERY)


async def _answer(host: str, port: int, tls: ssl.SSLContext | None) -> bytes:
    """Return the start of the answer, up to its status."""
    reader, writer = await asyncio.open_connection(host, port, ssl=tls)
    try:
        writer.write(REQUEST)
        return await reader.readexactly(len(WELL))
    finally:
        writer.transport.abort()
