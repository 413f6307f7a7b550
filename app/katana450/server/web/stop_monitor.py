"""Regular requests to the port of STOP, which prove that it answers."""

from __future__ import annotations

import asyncio
import logging
import ssl

from katana450.server.service.stop_path import StopPath

log = logging.getLogger(__name__)

CHECK_EVERY = 0.25
"""[s] Interval of the requests."""

ANSWER_TIMEOUT = 0.5
"""[s] Timeout for an answer."""

MAX_FAILURES = 2
"""Failures in a row after which the path counts as missing."""

REQUEST = b"GET /health HTTP/1.1\r\nHost: localhost\r\n\r\n"

ANYWHERE = {"0.0.0.0": "127.0.0.1", "::": "::1"}
"""Address of this machine for a socket that listens on all of its addresses."""


async def watch_stop_path(path: StopPath, host: str, port: int, *, secure: bool) -> None:
    """Keep ``path.problem`` true for the server of STOP on ``host`` and ``port``, until cancelled.

    ``secure``: whether it uses TLS.
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
                answers = await _answers(ANYWHERE.get(host, host), port, tls)
        except (OSError, TimeoutError):
            answers = False
        failures = 0 if answers else failures + 1
        if path.problem and answers:
            path.problem = ""
            log.warning("STOP is served on port %d again.", port)
        elif failures == MAX_FAILURES:
            path.problem = (
                f"STOP is not served on port {port} now; it has only the path of the page itself."
            )
            log.error("%s", path.problem)
        await asyncio.sleep(CHECK_EVERY)


async def _answers(host: str, port: int, tls: ssl.SSLContext | None) -> bool:
    reader, writer = await asyncio.open_connection(host, port, ssl=tls)
    try:
        writer.write(REQUEST)
        return (await reader.read(9)).startswith(b"HTTP/1.1 ")
    finally:
        writer.transport.abort()
