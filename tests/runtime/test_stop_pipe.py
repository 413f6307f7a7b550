"""The two ends of the pipe of STOP: one in the process of STOP, one with a real control loop."""

from __future__ import annotations

import asyncio
import multiprocessing
import os
import queue
import socket
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from multiprocessing.connection import Client, Connection
from pathlib import Path
from queue import SimpleQueue
from typing import Any

import pytest

from katana450.arm.control.arm import ArmModel
from katana450.arm.control.lease import Actor, CommandChannel, Person, Role
from katana450.arm.control.session.session import Session
from katana450.arm.control.state.stop_cause import pressed
from katana450.arm.drivers.driver import SimulatedDriver
from katana450.arm.runtime.clock import MonotonicClock
from katana450.arm.runtime.loop import ControlLoop
from katana450.arm.runtime.mailbox import Mailbox
from katana450.arm.runtime.pipes import stop_end
from katana450.arm.runtime.pipes.private_listener import (
    Greeting,
    PrivateAddress,
    PrivateListener,
    connect,
    connect_when_ready,
)
from katana450.arm.runtime.pipes.stop_end import StopEnd
from katana450.arm.runtime.pipes.stop_messages import StopPress, StopStatus
from katana450.arm.runtime.pipes.stop_pipe import StopPipe
from katana450.arm.runtime.readiness import readable, writable
from katana450.platform_support import pipe_address

TIMEOUT = 5.0


def press(name: str) -> StopPress:
    person = Person("v", "Vera", Role.VIEWER)
    return StopPress(pressed("Vera", "v", name, 1.0), Actor(person, CommandChannel.HTTP))


def connected(stop_pipe: StopPipe) -> bool:
    return stop_pipe.status is not None


async def ended(stop_pipe: StopPipe) -> None:
    """Wait until the thread of ``stop_pipe`` has read the end of its connection."""
    async with asyncio.timeout(TIMEOUT):
        while stop_pipe.running:
            await asyncio.sleep(0.01)


def _next(pipes: Iterator[Connection]) -> Connection:
    for pipe in pipes:
        return pipe
    raise EOFError


@contextmanager
def arm_end(arm: ArmModel, session: Session) -> Iterator[Connection]:
    """Run an arm; yield the far end of its pipe, which is cut afterwards."""
    mailbox = Mailbox(session.check)
    driver = SimulatedDriver(arm, session.ready, 0.0)
    loop = ControlLoop(session, driver, mailbox, MonotonicClock(), 100.0)
    ours, theirs = multiprocessing.Pipe()
    end = StopEnd(ours, loop, mailbox)
    loop.start()
    end.start()
    yield theirs
    end.close()
    # Closing alone does not wake the thread that reads.
    with socket.socket(fileno=os.dup(ours.fileno())) as line:
        line.shutdown(socket.SHUT_RDWR)
    loop.stop()


async def test_press_is_executed_and_confirmed_and_survives_a_new_arm(
    arm: ArmModel, session: Session
) -> None:
    pipes: queue.Queue[Connection | None] = queue.Queue()

    def connect() -> Connection:
        pipe = pipes.get()
        if pipe is None:
            raise EOFError
        return pipe

    stop_pipe = StopPipe(connect)
    # Before the arm is there.
    stop_pipe.press(press("one"))
    assert await stop_pipe.executed("one", 0.1) is None
    with arm_end(arm, session) as first:
        pipes.put(first)
        assert await stop_pipe.executed("one", TIMEOUT) == press("one").cause
        # The cause stays that of the first press.
        stop_pipe.press(press("two"))
        assert await stop_pipe.executed("two", TIMEOUT) == press("one").cause
        assert stop_pipe.status is not None
        assert stop_pipe.status.presses == ("one", "two")
        assert stop_pipe.age < TIMEOUT
    # The event loop has not learned of the end yet.
    assert connected(stop_pipe)
    stop_pipe.press(press("meanwhile"))
    first.close()
    async with asyncio.timeout(TIMEOUT):
        while connected(stop_pipe):
            await asyncio.sleep(0.01)
    stop_pipe.press(press("three"))
    with arm_end(arm, session) as second:
        pipes.put(second)
        assert await stop_pipe.executed("three", TIMEOUT) == press("meanwhile").cause
        assert await stop_pipe.executed("meanwhile", TIMEOUT) is not None
    second.close()
    assert stop_pipe.running
    pipes.put(None)
    await ended(stop_pipe)


@pytest.mark.parametrize("name", ["one", "two"])
async def test_unknown_press_is_not_confirmed_by_an_earlier_stop(
    arm: ArmModel, session: Session, name: str
) -> None:
    with arm_end(arm, session) as pipe:
        pipes = iter((pipe,))
        stop_pipe = StopPipe(lambda: _next(pipes))
        stop_pipe.press(press("one"))
        cause = await stop_pipe.executed(name, TIMEOUT if name == "one" else 0.3)
        assert (cause is not None) == (name == "one")
    await ended(stop_pipe)
    pipe.close()


@pytest.mark.parametrize("failing", ["arm", "process of STOP"])
def test_error_in_a_thread_closes_the_pipe_of_stop(
    arm: ArmModel, session: Session, failing: str
) -> None:
    def status(stopped: Any, presses: tuple[str, ...]) -> StopStatus:
        if failing == "arm" and "zero" in presses:
            raise RuntimeError(failing)
        return StopStatus(stopped, presses)

    async def act() -> None:
        with arm_end(arm, session) as first, arm_end(arm, session) as second:
            pipes = iter((first, second))
            stop_pipe = StopPipe(lambda: _next(pipes))
            call = stop_pipe._call

            def stumble(act: Callable[..., None], *values: object) -> None:
                if "zero" in getattr(values[-1], "presses", ()):
                    raise RuntimeError(failing)
                call(act, *values)

            with pytest.MonkeyPatch.context() as patch:
                patch.setattr(stop_end, "StopStatus", status)
                patch.setattr(stop_pipe, "_call", stumble)
                async with asyncio.timeout(TIMEOUT):
                    while not connected(stop_pipe):
                        await asyncio.sleep(0.01)
                    stop_pipe.press(press("zero"))
                    while stop_pipe._pipe is not second:
                        await asyncio.sleep(0.01)
            stop_pipe.press(press("one"))
            assert await stop_pipe.executed("one", TIMEOUT) is not None
        await ended(stop_pipe)

    asyncio.run(act())


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
