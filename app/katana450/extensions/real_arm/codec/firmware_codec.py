"""The arm's side of the protocol: bytes to requests, replies to bytes. Emulators use it."""

from __future__ import annotations

from dataclasses import dataclass

from katana450.errors import InputError
from katana450.extensions.real_arm.codec.crc import crc16, with_crc
from katana450.extensions.real_arm.codec.error_codes import CRC_ERROR, INVALID_ARGUMENT
from katana450.extensions.real_arm.codec.host_codec import CRC_BYTES, START
from katana450.extensions.real_arm.codec.replies import ERROR_FLAG, ArmReply
from katana450.extensions.real_arm.codec.requests import ArmRequest, ErrorQuery, read_request

HEADER_BYTES = 3
ERROR_QUERY = ErrorQuery()


def reply_bytes(reply: ArmReply) -> bytes:
    """Return ``reply`` as it is sent, in one piece."""
    return with_crc(reply.payload)


def refusal_bytes() -> bytes:
    """Return the error flag, which answers a request that is refused."""
    return with_crc(ERROR_FLAG)


@dataclass(frozen=True)
class RequestReceived:
    """A complete request with the right checksum, and the address it was sent to.

    ``address`` is 0 for ``ErrorQuery``, which has none.
    """

    request: ArmRequest
    address: int


@dataclass(frozen=True)
class RequestInvalid:
    """A complete frame that is no request.

    Attributes:
        payload: Its bytes without header and checksum.
        code: Error number for it: the checksum is wrong, or the request is unknown.
    """

    payload: bytes
    code: int


FirmwareEvent = RequestReceived | RequestInvalid


class FirmwareCodec:
    """Finds requests in the bytes of one connection. Bytes that begin no request are dropped."""

    def __init__(self) -> None:
        self._buffer = bytearray()

    def receive(self, data: bytes) -> list[FirmwareEvent]:
        """Return the requests that ``data`` completes, in their order."""
        self._buffer += data
        events: list[FirmwareEvent] = []
        while (event := self._next()) is not None:
            events.append(event)
        return events

    def _next(self) -> FirmwareEvent | None:
        buffer = self._buffer
        query = ERROR_QUERY.HEAD
        while buffer:
            if buffer[0] == START:
                return self._frame()
            if buffer[: len(query)] == query:
                del buffer[: len(query)]
                return RequestReceived(ERROR_QUERY, 0)
            if len(buffer) < len(query) and query.startswith(buffer):
                return None
            del buffer[0]
        return None

    def _frame(self) -> FirmwareEvent | None:
        buffer = self._buffer
        if len(buffer) < HEADER_BYTES:
            return None
        address, size = buffer[1:HEADER_BYTES]
        end = HEADER_BYTES + size
        if len(buffer) < end + CRC_BYTES:
            return None
        payload = bytes(buffer[HEADER_BYTES:end])
        found = int.from_bytes(buffer[end : end + CRC_BYTES], "big")
        del buffer[: end + CRC_BYTES]
        if found != crc16(payload):
            return RequestInvalid(payload, CRC_ERROR)
        try:
            return RequestReceived(read_request(payload), address)
        except InputError:
            return RequestInvalid(payload, INVALID_ARGUMENT)
