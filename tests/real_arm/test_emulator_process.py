"""A real emulator process answers one client after another, byte for byte."""

from __future__ import annotations

import socket

import pytest

from tests.real_arm.emulated import TIMEOUT, emulator_process

REQUEST, REPLY = bytes.fromhex("01 18 01 42 31 80"), bytes.fromhex("62 02 01 7E 61")


def test_second_client_waits_for_the_end_of_the_first() -> None:
    with emulator_process("--calibrated") as (process, port):
        first, second = (socket.create_connection(("127.0.0.1", port), TIMEOUT) for _ in range(2))
        with first, second:
            for client in (first, second):
                client.sendall(REQUEST)
            assert first.recv(16) == REPLY
            second.settimeout(0.1)
            with pytest.raises(TimeoutError):
                second.recv(16)
            first.close()
            second.settimeout(5.0)
            assert second.recv(16) == REPLY
        process.terminate()
        assert process.wait(TIMEOUT) == 0
