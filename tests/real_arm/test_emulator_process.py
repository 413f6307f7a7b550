"""A real emulator process answers one client after another, also while it calibrates."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.real_arm.emulated import emulator, exchanged, raw


@pytest.fixture(scope="module")
def port() -> Iterator[int]:
    with emulator("--calibrated", "--plant", "stiff", "--calibration-scale", "100") as port:
        yield port


def test_worked_exchange_is_answered_byte_for_byte(port: int) -> None:
    with raw(port) as client:
        assert exchanged(client, "01 18 03 4E 01 00 87 61") == (
            "6E 08 08 08 08 08 08 00 00 00 00 00 00 DD 32"
        )


def test_second_client_waits_for_the_end_of_the_first(port: int) -> None:
    with raw(port) as first, raw(port) as second:
        assert exchanged(first, "01 18 01 5A 3B 80") == "7A E3 81"
        second.sendall(bytes.fromhex("01 18 01 5A 3B 80"))
        second.settimeout(0.1)
        with pytest.raises(TimeoutError):
            second.recv(16)
        first.close()
        second.settimeout(5.0)
        assert second.recv(16).hex() == "7ae381"
