"""The connection to an arm with Ethernet."""

from __future__ import annotations

import socket
from contextlib import suppress

from katana450.extensions.real_arm.link.transport import LinkLostError

PORT = 5566
"""TCP port of every arm."""

RECEIVED_BYTES = 4096

QUICK_ACK: int | None = getattr(socket, "TCP_QUICKACK", None)
"""Option of Linux that acknowledges at once: an acknowledgement held back for 40 ms may be the 40
ms of a reply that drivers of real arms report."""


class TcpTransport:
    """A TCP connection. Each request is one write, and small segments are not held back."""

    def __init__(self, host: str, port: int = PORT, timeout: float = 1.0) -> None:
        """Connect within ``timeout`` [s]. Raises LinkLostError."""
        try:
            self._socket = socket.create_connection((host, port), timeout)
        except (OSError, UnicodeError) as error:
            raise LinkLostError(
                f"There is no connection to an arm at {host}, port {port}: {_reason(error)}."
            ) from None
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def write(self, data: bytes, timeout: float) -> None:
        """Send ``data`` in one write. Raises LinkLostError, also if bytes wait to be read."""
        try:
            self._socket.setblocking(False)
            with suppress(BlockingIOError):
                unread = self._socket.recv(RECEIVED_BYTES)
                raise LinkLostError(
                    f"The arm sent bytes without a request ({unread[:8].hex(' ')})."
                    if unread
                    else "The arm closed the connection."
                )
            self._socket.settimeout(timeout)
            self._socket.sendall(data)
        except OSError as error:
            raise LinkLostError(f"The connection to the arm broke: {_reason(error)}.") from None

    def read(self, timeout: float) -> bytes:
        """Return what has arrived; nothing after ``timeout`` [s]. Raises LinkLostError."""
        try:
            self._socket.settimeout(timeout)
            if QUICK_ACK is not None:
                # The system clears this option by itself.
                self._socket.setsockopt(socket.IPPROTO_TCP, QUICK_ACK, 1)
            data = self._socket.recv(RECEIVED_BYTES)
        except TimeoutError:
            return b""
        except OSError as error:
            raise LinkLostError(f"The connection to the arm broke: {_reason(error)}.") from None
        if not data:
            raise LinkLostError("The arm closed the connection.")
        return data

    def close(self) -> None:
        """End the connection."""
        self._socket.close()


def _reason(error: Exception) -> str:
    return (getattr(error, "strerror", None) or str(error) or type(error).__name__).lower()
