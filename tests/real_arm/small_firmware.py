"""A small TCP server that speaks the protocol, with a script for each reply."""

from __future__ import annotations

import socket
import struct
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Self

from katana450.extensions.real_arm.codec.codecs import FirmwareCodec, RequestInvalid
from katana450.extensions.real_arm.codec.requests import ArmRequest

Piece = bytes | float | None
"""Bytes to send, seconds to wait, or None to cut the connection by a reset."""


class SmallFirmware:
    """Serves one connection at a time on a port of its own. ``requests``: all that arrived."""

    def __init__(self, answer: Callable[[ArmRequest], Sequence[Piece]], port: int = 0) -> None:
        self._answer = answer
        self._listener = socket.create_server(("127.0.0.1", port))
        self.port: int = self._listener.getsockname()[1]
        self.requests: list[ArmRequest] = []
        self.connections = 0
        self._thread = threading.Thread(target=self._serve, daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        # Wakes the thread that accepts.
        with suppress(OSError):
            self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()

    def _serve(self) -> None:
        while True:
            try:
                connection, _ = self._listener.accept()
            except OSError:
                return
            self.connections += 1
            with connection, suppress(OSError):
                connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                self._converse(connection)

    def _converse(self, connection: socket.socket) -> None:
        codec = FirmwareCodec()
        while data := connection.recv(4096):
            for request in codec.receive(data):
                assert not isinstance(request, RequestInvalid)
                self.requests.append(request)
                for piece in self._answer(request):
                    if piece is None:
                        connection.setsockopt(
                            socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0)
                        )
                        return
                    if isinstance(piece, float):
                        time.sleep(piece)
                    else:
                        connection.sendall(piece)
