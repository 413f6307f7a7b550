"""The websocket of a browser or program, as the web server speaks it."""

from __future__ import annotations

import socket
from asyncio import BaseTransport, Transport
from http import HTTPStatus
from typing import Any, cast

from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
from websockets.frames import Frame
from websockets.http11 import Request

from katana450.server.service.heartbeats import ARRIVAL, PING, LastHeartbeat
from katana450.server.web.security import FOR_PROGRAMS

MAX_UNSENT_BYTES = 16_384
"""Bytes that may wait to be sent to a browser. Newer states do not replace waiting bytes."""

MAX_PROGRAM_MESSAGE_BYTES = 524_288
"""Maximum size of a message of a program. Each channel refuses less than that in words."""

READ_CHUNK_BYTES = 4_096
"""Bytes that are read at once from a browser. All clients wait while they are parsed."""

TLS_READ_CHUNK_BYTES = 65_536
"""Size of the receive buffer with TLS, which reads all that the system holds."""


class BrowserSocket(WebSocketsSansIOProtocol):
    """A websocket with small buffers for sent and received bytes."""

    def connection_made(self, transport: BaseTransport) -> None:
        """Bound the buffers of the new connection."""
        super().connection_made(transport)
        cast(Transport, transport).set_write_buffer_limits(high=MAX_UNSENT_BYTES)
        sock = transport.get_extra_info("socket")
        if sock is None:
            return
        if hasattr(transport, "max_size"):
            # A smaller receive buffer of the system is no alternative: it drops packets that do not
            # fit, with the acknowledgements in them, and both ends stall.
            cast(Any, transport).max_size = READ_CHUNK_BYTES
        else:
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, TLS_READ_CHUNK_BYTES)
        if hasattr(socket, "TCP_NOTSENT_LOWAT"):
            sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NOTSENT_LOWAT, MAX_UNSENT_BYTES)

    def handle_connect(self, event: Request) -> None:
        """Accept the websocket, and let the application see when messages arrive."""
        super().handle_connect(event)
        if self.response.status_code == HTTPStatus.SWITCHING_PROTOCOLS:
            # The socket knows when its newest message arrived.
            sock = self.transport.get_extra_info("socket")
            self.arrival = LastHeartbeat(line=sock)
            cast(dict[str, Any], self.scope).update({ARRIVAL: self.arrival, PING: self.ping})
            if self.scope["path"].startswith(FOR_PROGRAMS):
                self.conn.max_message_size = MAX_PROGRAM_MESSAGE_BYTES

    def ping(self) -> None:
        """Ask the client for an answer; nothing happens while the websocket opens or closes."""
        if self.handshake_complete and not (self.close_sent or self.transport.is_closing()):
            self.conn.send_ping(b"")
            self.transport.write(b"".join(self.conn.data_to_send()))

    def handle_pong(self, event: Frame) -> None:
        """Count the answer to ``ping`` as a heartbeat; those to other pings have content."""
        super().handle_pong(event)
        if not event.data:
            self.arrival.note()
