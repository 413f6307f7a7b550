"""The process of STOP: a small server with its own socket, event loop, descriptors and limits.

It is a second path of STOP to the arm, beside the front end. The supervisor starts it again when it
ends or hangs; the arm does not stop for that.
"""

from __future__ import annotations

import asyncio
import socket
import time
from functools import partial

from katana450.arm.runtime.pipes.arm_roles import STOP
from katana450.arm.runtime.pipes.private_listener import Greeting, connect_when_ready
from katana450.arm.runtime.pipes.stop_pipe import StopPipe
from katana450.assembly.authentication import access_file, address_of, tls_context
from katana450.assembly.supervised import READY, SupervisorPipe
from katana450.extension import ServerFacts
from katana450.platform_support import raise_priority
from katana450.server.web.acceptor import Acceptor
from katana450.server.web.authenticator import Authenticator
from katana450.server.web.listen import raise_descriptor_limit
from katana450.server.web.stop_server import StopConnection, StopServer

TURN_INTERVAL = 0.2
"""[s] Interval at which the event loop proves that it runs, and checks whether it must end."""

HANG_TIMEOUT = 1.0
"""[s] Time without a turn of the event loop after which no heartbeat is sent."""


def run_stop(config: ServerFacts, listening: socket.socket, supervisor: SupervisorPipe) -> None:
    """Run the server of STOP on the socket ``listening``, from start to end. Raises KatanaError."""
    raise_priority()
    asyncio.run(_serve(config, listening, supervisor))


async def _serve(config: ServerFacts, listening: socket.socket, supervisor: SupervisorPipe) -> None:
    settings = config.settings
    address = address_of(settings, listening)
    access = access_file(settings, listening)
    tls = tls_context(settings)
    raise_descriptor_limit()
    stop_pipe = StopPipe(
        lambda: connect_when_ready(config.address, Greeting(STOP), supervisor.ended)
    )
    acceptor = Acceptor(listening)
    authenticator = Authenticator(access, config.port, address)
    server = StopServer(stop_pipe, authenticator, address, config.port, acceptor)
    acceptor.start(partial(StopConnection, server), tls)
    turned = time.monotonic()
    supervisor.prove(lambda: stop_pipe.running and time.monotonic() - turned < HANG_TIMEOUT)
    supervisor.report(READY)
    while not supervisor.ended.is_set():
        turned = time.monotonic()
        await asyncio.sleep(TURN_INTERVAL)
    acceptor.close()
    await acceptor.wait_closed()
