"""The checksum of the protocol: CRC-16/ARC."""

from __future__ import annotations

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
