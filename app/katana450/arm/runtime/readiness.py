"""Readiness of sockets and pipes, and the age of the newest data of a connection."""

from __future__ import annotations

import select
import socket
import struct
from typing import Protocol

LAST_DATA_RECEIVED, LAST_ACK_RECEIVED = 52, 56
"""Bytes before ``tcpi_last_data_recv`` and ``tcpi_last_ack_recv`` [ms] in Linux's ``struct
tcp_info``."""

ENDED = getattr(select, "POLLHUP", 0) | getattr(select, "POLLRDHUP", 0)
"""Events of a connection whose other end is closed, and which is readable without a message."""


class SocketChannel(Protocol):
    """A socket, or the object that asyncio provides for one."""

    def fileno(self) -> int:
        """Return the file descriptor; negative once closed."""
        ...

    def getsockopt(self, level: int, name: int, size: int, /) -> bytes:
        """Return a socket option as bytes."""
        ...


def readable(fd: int) -> bool:
    """Return whether data of a side that has not ended waits at ``fd``; False if unknown."""
    return _polled(fd, getattr(select, "POLLIN", 0), unknown=False, unless=ENDED)


def writable(fd: int) -> bool:
    """Return whether a short message can be written without waiting; True if unknown."""
    return _polled(fd, getattr(select, "POLLOUT", 0), unknown=True)


def data_age(channel: SocketChannel) -> float:
    """Return the time since the kernel received the newest data of a TCP connection [s].

    Returns 0 if the system does not report it: data that is being read then counts as new.
    """
    return _age(channel, LAST_DATA_RECEIVED)


def ack_age(channel: SocketChannel) -> float:
    """Return the time since the other host acknowledged anything, probes included [s].

    Returns 0 if the system does not report it.
    """
    return _age(channel, LAST_ACK_RECEIVED)


def _age(channel: SocketChannel, offset: int) -> float:
    option = getattr(socket, "TCP_INFO", None)
    if option is None or channel.fileno() < 0:
        return 0.0
    try:
        info = channel.getsockopt(socket.IPPROTO_TCP, option, offset + 4)
    except OSError:
        return 0.0
    if len(info) < offset + 4:
        return 0.0
    milliseconds: int = struct.unpack_from("=I", info, offset)[0]
    return 1e-3 * milliseconds


def _polled(fd: int, event: int, *, unknown: bool, unless: int = 0) -> bool:
    if fd < 0:
        return False
    if not hasattr(select, "poll"):
        return unknown
    poll = select.poll()
    poll.register(fd, event | unless)
    return any(flags & event and not flags & unless for _, flags in poll.poll(0))
