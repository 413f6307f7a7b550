"""Readiness of pipes and sockets."""

from __future__ import annotations

import multiprocessing
import socket

import pytest

from katana450.arm.runtime.readiness import readable, writable


def test_pipe_is_readable_while_data_waits() -> None:
    ours, theirs = multiprocessing.Pipe()
    with ours, theirs:
        assert not readable(ours.fileno())
        theirs.send_bytes(b"one")
        assert readable(ours.fileno())
        ours.recv_bytes()
        assert not readable(ours.fileno())


def test_message_to_an_ended_process_is_sent_and_fails() -> None:
    """A sender must learn of the end; a message that is not sent would be lost."""
    ours, theirs = multiprocessing.Pipe()
    with ours:
        theirs.close()
        assert writable(ours.fileno())
        with pytest.raises(OSError, match="pipe"):
            ours.send_bytes(b"one")


@pytest.mark.parametrize("last", [b"", b"the last message"])
def test_end_of_the_other_process_is_no_message(last: bytes) -> None:
    ours, theirs = multiprocessing.Pipe()
    with ours:
        if last:
            theirs.send_bytes(last)
        theirs.close()
        assert ours.poll()
        assert not readable(ours.fileno())


def test_end_of_a_tcp_connection_is_no_message() -> None:
    with socket.create_server(("127.0.0.1", 0)) as listening:
        theirs = socket.create_connection(listening.getsockname())
        ours, _ = listening.accept()
        with ours:
            theirs.sendall(b"one")
            assert readable(ours.fileno())
            assert writable(ours.fileno())
            theirs.close()
            ours.recv(16)
            assert ours.recv(16) == b""
            assert not readable(ours.fileno())
