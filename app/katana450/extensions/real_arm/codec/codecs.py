"""Both ends of the protocol without a connection: requests and replies to bytes, and back."""

from __future__ import annotations

from dataclasses import dataclass

from katana450.errors import InputError, KatanaError
from katana450.extensions.real_arm.codec.replies import (
    CRC_ERROR,
    INVALID_ARGUMENT,
    ArmReply,
    FirmwareError,
    RefusedReply,
)
from katana450.extensions.real_arm.codec.requests import ArmRequest, ErrorQuery, read_request

POLYNOMIAL = 0xA001
"""x^16 + x^15 + x^2 + 1 with its bits reflected."""


def _entry(value: int) -> int:
    for _ in range(8):
        value = value >> 1 ^ (POLYNOMIAL if value & 1 else 0)
    return value


TABLE = tuple(map(_entry, range(256)))


def crc16(data: bytes) -> int:
    """Return the CRC-16/ARC of ``data``: initial value 0, reflected, no final exclusive or."""
    crc = 0
    for byte in data:
        crc = crc >> 8 ^ TABLE[(crc ^ byte) & 0xFF]
    return crc


def with_crc(payload: bytes) -> bytes:
    """Return ``payload`` followed by its checksum, high byte first."""
    return payload + crc16(payload).to_bytes(2, "big")


START = 0x01
"""First byte of a request in a frame."""

ADDRESS = 24
"""Address of the arm in every known configuration."""

CRC_BYTES = 2


def request_bytes(request: ArmRequest) -> bytes:
    """Return ``request`` as it is sent. Raises InputError for numbers that do not fit."""
    payload = request.payload
    if isinstance(request, ErrorQuery):
        return payload
    return bytes((START, ADDRESS, len(payload))) + with_crc(payload)


class OutOfStepError(KatanaError):
    """The bytes are no answer to the request, so later ones have no meaning: connect again."""


class HostCodec:
    """Pairs requests with replies on one connection, one at a time.

    After an OutOfStepError the connection cannot be used any more.
    """

    def __init__(self) -> None:
        self._buffer = bytearray()
        self._request: ArmRequest | None = None

    def send(self, request: ArmRequest) -> bytes:
        """Return the bytes of ``request``, whose reply is expected next.

        Raises InputError while another request waits, and for numbers that do not fit.
        """
        if self._request is not None:
            raise InputError(f"{self._request} has no answer yet: send one request at a time.")
        data = request_bytes(request)
        self._request = request
        return data

    def receive(self, data: bytes) -> ArmReply | None:
        """Return the reply that ``data`` completes, or None if more bytes are needed.

        Raises OutOfStepError if the bytes are no reply to the request, or more than one.
        """
        self._buffer += data
        if not self._buffer:
            return None
        reply = self._reply()
        if reply is not None:
            self._request = None
            if self._buffer:
                raise self._out_of_step("more bytes follow the reply")
        return reply

    def _reply(self) -> ArmReply | None:
        request = self._request
        if request is None:
            raise self._out_of_step("no request waits")
        if self._buffer[:1] == RefusedReply.HEAD:
            return self._complete(RefusedReply, RefusedReply.length())
        if self._buffer[0] != request.REPLY.HEAD[0]:
            raise self._out_of_step(f"a reply to {type(request).__name__} begins otherwise")
        if isinstance(request, ErrorQuery):
            return self._error()
        return self._complete(request.REPLY, request.REPLY.length())

    def _error(self) -> ArmReply | None:
        """Return the error as soon as a prefix of the bytes is one: its length is not fixed."""
        for length in range(FirmwareError.length() + 1, FirmwareError.LONGEST + 1):
            if len(self._buffer) < length + CRC_BYTES:
                return None
            ends = self._buffer[length - 1] == 0 or length >= FirmwareError.LONGEST - 1
            if ends and self._has_crc(length):
                return self._complete(FirmwareError, length)
        raise self._out_of_step("the checksum of an error is wrong")

    def _complete(self, kind: type[ArmReply], length: int) -> ArmReply | None:
        if len(self._buffer) < length + CRC_BYTES:
            return None
        if not self._has_crc(length):
            raise self._out_of_step(f"the checksum of {kind.__name__} is wrong")
        payload = bytes(self._buffer[:length])
        del self._buffer[: length + CRC_BYTES]
        return kind.read(payload)

    def _has_crc(self, length: int) -> bool:
        crc = int.from_bytes(self._buffer[length : length + CRC_BYTES], "big")
        return crc == crc16(bytes(self._buffer[:length]))

    def _out_of_step(self, problem: str) -> OutOfStepError:
        shown = bytes(self._buffer[:8]).hex(" ")
        return OutOfStepError(f"The arm sent bytes that are no answer ({shown} ...): {problem}.")


HEADER_BYTES = 3
ERROR_QUERY = ErrorQuery()


def reply_bytes(reply: ArmReply) -> bytes:
    """Return ``reply`` as it is sent, in one piece."""
    return with_crc(reply.payload)


@dataclass(frozen=True)
class RequestInvalid:
    """A complete frame that is no request.

    Attributes:
        payload: Its bytes without header and checksum.
        code: Error number for it: the checksum is wrong, or the request is unknown.
    """

    payload: bytes
    code: int


FirmwareEvent = ArmRequest | RequestInvalid


class FirmwareCodec:
    """Finds requests in the bytes of one connection. Bytes that begin no request are dropped.

    The address of a request is not checked: one arm is at a connection.
    """

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
                return ERROR_QUERY
            if len(buffer) < len(query) and query.startswith(buffer):
                return None
            del buffer[0]
        return None

    def _frame(self) -> FirmwareEvent | None:
        buffer = self._buffer
        if len(buffer) < HEADER_BYTES:
            return None
        end = HEADER_BYTES + buffer[HEADER_BYTES - 1]
        if len(buffer) < end + CRC_BYTES:
            return None
        payload = bytes(buffer[HEADER_BYTES:end])
        crc = int.from_bytes(buffer[end : end + CRC_BYTES], "big")
        del buffer[: end + CRC_BYTES]
        if crc != crc16(payload):
            return RequestInvalid(payload, CRC_ERROR)
        try:
            return read_request(payload)
        except InputError:
            return RequestInvalid(payload, INVALID_ARGUMENT)
