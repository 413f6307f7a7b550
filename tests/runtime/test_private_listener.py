"""Private connections between processes: by role, with a key, never held up, and when ready."""

from __future__ import annotations

import multiprocessing
import socket
import sys
import threading
from collections.abc import Iterator
from multiprocessing.connection import Client, Connection
from pathlib import Path
from queue import SimpleQueue

import pytest

from katana450.arm.runtime.pipes.private_listener import (
    Greeting,
    PrivateAddress,
    PrivateListener,
    connect,
    connect_when_ready,
)
from katana450.arm.runtime.readiness import readable, writable
from katana450.platform_support import pipe_address


@pytest.fixture
def address(tmp_path: Path) -> PrivateAddress:
    return PrivateAddress(pipe_address(tmp_path, "arm"), b"a key")


@pytest.fixture
def greetings(address: PrivateAddress) -> Iterator[SimpleQueue[Greeting]]:
    received: SimpleQueue[Greeting] = SimpleQueue()
    connections: list[Connection] = []

    def attach(connection: Connection, greeting: Greeting) -> None:
        connections.append(connection)
        received.put(greeting)

    listener = PrivateListener(address, {"front": attach}, "the process")
    listener.start()
    yield received
    listener.close()


def test_connection_is_attached_by_its_role(
    address: PrivateAddress, greetings: SimpleQueue[Greeting]
) -> None:
    with connect(address, Greeting("front", 7)):
        assert greetings.get(timeout=5.0) == Greeting("front", 7)
    with connect(address, Greeting("unknown")) as unknown, pytest.raises(EOFError):
        unknown.recv()


def test_wrong_key_is_refused(address: PrivateAddress, greetings: SimpleQueue[Greeting]) -> None:
    with pytest.raises(OSError, match="refused the key"):
        connect(PrivateAddress(address.name, b"another"), Greeting("front"))
    assert greetings.empty()


def test_client_that_stalls_keeps_no_other_out(
    address: PrivateAddress, greetings: SimpleQueue[Greeting]
) -> None:
    with Client(address.name), connect(address, Greeting("front")):
        assert greetings.get(timeout=5.0).role == "front"


class RefusedThread(threading.Thread):
    """A thread that the system refuses to start."""

    def start(self) -> None:
        raise RuntimeError("can't start new thread")


def test_connection_for_which_no_thread_starts_keeps_no_later_one_out(
    address: PrivateAddress, greetings: SimpleQueue[Greeting], monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as patch:
        patch.setattr(
            "katana450.arm.runtime.pipes.private_listener.threading.Thread", RefusedThread
        )
        with Client(address.name) as refused:
            assert refused.poll(5.0)
            with pytest.raises((EOFError, OSError)):
                refused.recv()
    with connect(address, Greeting("front")):
        assert greetings.get(timeout=5.0).role == "front"


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no socket files")
def test_socket_file_of_a_killed_process_is_replaced(address: PrivateAddress) -> None:
    with socket.socket(socket.AF_UNIX) as left:
        left.bind(address.name)
    listener = PrivateListener(address, {}, "the process")
    listener.start()
    connect(address, Greeting("unknown")).close()
    listener.close()
    assert not Path(address.name).exists()


def test_waiting_for_the_arm_ends_with_the_server(address: PrivateAddress) -> None:
    ended = threading.Event()
    ended.set()
    with pytest.raises(EOFError):
        connect_when_ready(address, Greeting("front"), ended)


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
