"""Base of all requests and replies: typed values that are written to bytes and read from them."""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any, ClassVar, Self

from katana450.errors import InputError


@dataclass(frozen=True)
class WireMessage:
    """A message: fixed bytes, then the fields of the class in the order of their definition.

    Attributes:
        HEAD: Bytes with which the payload begins: the letter of the command, and for some commands
            a second byte that chooses among several layouts.
        LAYOUT: Fields after it, as ``struct`` counts them, big endian. A field that is a tuple is
            the last one and holds all remaining numbers.
    """

    HEAD: ClassVar[bytes] = b""
    LAYOUT: ClassVar[struct.Struct] = struct.Struct(">")

    @classmethod
    def length(cls) -> int:
        """Return the number of bytes of the payload."""
        return len(cls.HEAD) + cls.LAYOUT.size

    @property
    def payload(self) -> bytes:
        """Bytes without header and checksum. Raises InputError for numbers that do not fit."""
        try:
            return self.HEAD + self.LAYOUT.pack(*self._numbers())
        except struct.error as error:
            raise InputError(f"{self} does not fit into its message: {error}.") from None

    @classmethod
    def read(cls, payload: bytes) -> Self:
        """Return the message in ``payload``. Raises InputError for another head or length."""
        if not payload.startswith(cls.HEAD) or len(payload) != cls.length():
            raise InputError(
                f"{payload[:8].hex(' ')} ({len(payload)} bytes) is no {cls.__name__}: that begins "
                f"with {cls.HEAD.hex(' ')} and has {cls.length()} bytes."
            )
        return cls._of(cls.LAYOUT.unpack_from(payload, len(cls.HEAD)))

    def _numbers(self) -> list[Any]:
        numbers: list[Any] = []
        for field in fields(self):
            value = getattr(self, field.name)
            numbers += value if isinstance(value, tuple) else (value,)
        return numbers

    @classmethod
    def _of(cls, numbers: tuple[Any, ...]) -> Self:
        create: Callable[..., Self] = cls
        count = len(fields(cls))
        if len(numbers) == count:
            return create(*numbers)
        return create(*numbers[: count - 1], numbers[count - 1 :])
