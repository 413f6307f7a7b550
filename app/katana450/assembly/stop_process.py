"""The process of STOP: a small server with its own socket, event loop, descriptors and limits.

It is a second path of STOP to the arm, beside the front end. The supervisor starts it again when it
ends or hangs; the arm does not stop for that.
"""

from __future__ import annotations

import socket
import time
from dataclasses import dataclass
from functools import partial

from katana450.arm.runtime.arm_listener import STOP, ArmAddress, Greeting, connect_when_ready
from katana450.assembly.supervised import READY, SupervisorPipe
from katana450.platform_support import raise_priority
from katana450.settings import Settings

TURN_INTERVAL = 0.2
"""[s] Interval at which the event loop proves that it runs, and checks whether it must end."""

HANG_TIMEOUT = 1.0
"""[s] Time without a turn of the event loop after which no heartbeat is sent."""


@dataclass(frozen=True)
class StopConfig:
    """Configuration of the process of STOP.

    Attributes:
        settings: settings of the server.
        listening: the socket for STOP.
        main_port: the port of the page.
        address: address of the arm's process.
    """

    settings: Settings
    listening: socket.socket
    main_port: int
    address: ArmAddress


def run_stop(config: StopConfig, supervisor: SupervisorPipe) -> None:
    """Run the server of STOP in this process, from start to end. Raises KatanaError."""
    raise_priority()
    # Imported here, because the supervisor imports this module before it starts the processes.
    import asyncio

    asyncio.run(_serve(config, supervisor))


async def _serve(config: StopConfig, supervisor: SupervisorPipe) -> None:
    import asyncio

    from katana450.arm.runtime.stop_pipe import StopPipe
    from katana450.assembly.authentication import access_file, address_of, tls_context
    from katana450.server.web.acceptor import Acceptor
    from katana450.server.web.authenticator import Authenticator
    from katana450.server.web.listen import raise_descriptor_limit
    from katana450.server.web.stop_connection import StopConnection
    from katana450.server.web.stop_server import StopServer

    settings, listening = config.settings, config.listening
    address = address_of(settings, listening)
    access = access_file(settings, listening)
    tls = tls_context(settings)
    raise_descriptor_limit()
    stop_pipe = StopPipe(
        lambda: connect_when_ready(config.address, Greeting(STOP), supervisor.ended)
    )
    acceptor = Acceptor(listening)
    authenticator = Authenticator(access, config.main_port, address)
    server = StopServer(stop_pipe, authenticator, address, config.main_port, acceptor)
    acceptor.start(partial(StopConnection, server), tls)
    turned = time.monotonic()
    supervisor.prove(lambda: stop_pipe.running and time.monotonic() - turned < HANG_TIMEOUT)
    supervisor.report(READY)
    while not supervisor.ended.is_set():
        turned = time.monotonic()
        await asyncio.sleep(TURN_INTERVAL)
    acceptor.close()
    await acceptor.wait_closed()
