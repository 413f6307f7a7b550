"""Channels of programs: websockets, and JSON lines on a TCP port."""

from __future__ import annotations

import asyncio
import math
import secrets
import socket
from collections.abc import Callable
from contextlib import nullcontext, suppress
from dataclasses import replace
from typing import Any, NamedTuple

import msgspec
from starlette.websockets import WebSocket

from katana450.arm.control.lease import HEARTBEAT_INTERVAL, CommandChannel
from katana450.errors import InputError
from katana450.server.api import answers, requests
from katana450.server.service import serialize
from katana450.server.service.arm_handle import ArmHandle
from katana450.server.service.budget import Budget, Budgets, BusyError
from katana450.server.service.dispatcher import driver_key
from katana450.server.service.heartbeats import LastHeartbeat
from katana450.server.service.hub import Hub
from katana450.server.service.identity import Identity
from katana450.server.service.limits import ConnectionLimit
from katana450.server.service.participants import Participant, actor_of
from katana450.server.service.recorder import REFUSED, stranger
from katana450.server.web.acceptor import Acceptor
from katana450.server.web.admission import (
    LIMIT_CLOSE_CODE,
    address_of,
    authorization_of,
    client_of,
    reserved,
)
from katana450.server.web.authenticator import SIGN_IN_CLOSE_CODE, TOKEN_REQUIRED, Authenticator
from katana450.server.web.channel import (
    BAD_REQUEST_CLOSE_CODE,
    Channel,
    GoneError,
    JsonChannel,
    WebSocketJsonChannel,
)

REQUESTS = 400.0, 800.0
"""Maximum rate [1/s] and burst of requests: a stream may be faster than the ticks of the arm."""

BAD_REQUESTS = 1.0, 20.0
"""The same of invalid requests."""

COMPLAINT_INTERVAL = 5.0
"""Minimum interval [s] of the messages to a program that watches more than its budget allows."""

HELLO_SECONDS = 5.0
"""Timeout [s] for the first line of a TCP connection."""

MAX_UNSENT_BYTES = 4096
"""Maximum of bytes that wait to be sent: one or two states, so that a slow client gets new ones."""

LINES, LINES_EACH, RESERVED_LINES = 16, 8, 2
"""Maximum of TCP connections, of all together and of one identity, and number reserved for the
driver and for each admin."""

BUDGET_EXHAUSTED = "Your programs together send too many requests. Wait, and send fewer requests."


class ProgramClient(NamedTuple):
    """The other side of a connection."""

    identity: Callable[[], Identity | None]
    channel: CommandChannel
    address: str


class ProgramChannel(Channel):
    """Channel of one program, which sends states at the requested rate."""

    often, bad = REQUESTS, BAD_REQUESTS

    def __init__(self, hub: Hub, line: JsonChannel, budget: Budget) -> None:
        super().__init__(hub, line, budget)
        self._complained = -math.inf
        self._period: float | None = None
        self._due = 0.0
        self._watched: tuple[requests.FieldName, ...] = ()

    def answer(self, participant: Participant, request: requests.Request) -> None:
        """Execute ``request`` and send its answer; a ``watch`` sets the rate of states."""
        if isinstance(request, requests.Watch):
            if request.fields:
                arm = self.hub.present()
                arm.nodes.read(arm.state, request.fields)
            self._watched = request.fields
            self._period = 1.0 / request.hz if request.hz > 0.0 else None
            self._due = self.hub.clock()
        super().answer(participant, request)
        self.wake()

    def unasked(self, *, urgent: bool) -> tuple[Any, float | None]:
        """Return the state if one is due, or None, and the time until the next call [s]."""
        if self._period is None or self.hub.arm is None:
            return None, self._period
        t = self.hub.clock()
        if t < self._due and not urgent:
            return None, self._due - t
        if t >= self._due:
            self._due = max(self._due + self._period, t)
        driver = "" if self.participant is None else driver_key(self.hub, self.participant)
        try:
            with self.budget.charged(driver):
                return self._state(self.hub.arm), self._due - t
        except BusyError as error:
            self._due = max(self._due, t + error.retry)
            if t - self._complained < COMPLAINT_INTERVAL:
                return None, self._due - t
            self._complained = t
            why = f"States are sent less often than requested. {error}"
            return answers.Refused(why=why, retry=error.retry), self._due - t

    def _state(self, arm: ArmHandle) -> answers.State:
        """Return the state with the watched fields, except those of removed objects."""
        now = serialize.state(self.hub)
        values: list[answers.Value] = []
        for field in self._watched:
            with suppress(InputError):
                values += arm.nodes.read(arm.state, (field,))
        return msgspec.structs.replace(now, fields=tuple(values))

    def greet(self, participant: Participant) -> None:
        """Send the name, number and role of the program."""
        super().greet(participant)
        person = participant.person
        self.notify(
            answers.Welcome(
                name=person.name,
                number=participant.number,
                role=person.role.value,
                heartbeat=HEARTBEAT_INTERVAL,
                stop_port=self.hub.stop_path.port,
            )
        )


async def serve_socket(
    hub: Hub,
    authenticator: Authenticator,
    budgets: Budgets,
    socket: WebSocket,
    make: Callable[[Hub, JsonChannel, Budget], Channel] = ProgramChannel,
    line: Callable[[WebSocket], JsonChannel] = WebSocketJsonChannel,
) -> None:
    """Serve a websocket of a program until it closes.

    ``make`` returns its channel, and ``line`` the texts on the accepted websocket.
    """
    name, token = socket.query_params.get("name", ""), authorization_of(socket)

    def current_identity() -> Identity | None:
        return authenticator.program(name, token, socket.cookies)

    sender = client_of(authenticator, socket)
    budget = budgets.of(address_of(socket) if sender is None else sender.session)
    await socket.accept()
    channel = line(socket)
    if budget.is_exhausted():
        if sender is not None:
            actor = actor_of(sender, CommandChannel.WEBSOCKET, address_of(socket))
            hub.recorder.refuse("connection", actor, InputError(BUDGET_EXHAUSTED))
        await channel.close(LIMIT_CLOSE_CODE, BUDGET_EXHAUSTED)
        return
    client = ProgramClient(current_identity, CommandChannel.WEBSOCKET, address_of(socket))
    await _serve(hub, authenticator, budget, channel, client, make)


class LineServer:
    """The TCP port for JSON lines, which only programs of this machine reach.

    A first line other than ``hello`` ends the connection. So a request that a page sends to this
    port has no effect.
    """

    def __init__(self, hub: Hub, authenticator: Authenticator, budgets: Budgets) -> None:
        self._hub = hub
        self._authenticator = authenticator
        self._budgets = budgets
        self._places = ConnectionLimit(LINES, LINES_EACH)
        self._acceptor: Acceptor | None = None
        self._writers: set[asyncio.StreamWriter] = set()

    async def run(self, listening: socket.socket | None) -> None:
        """Serve the clients of ``listening``, if it is a socket, until this task is cancelled."""
        if listening is None:
            return
        self._acceptor = Acceptor(listening, LINES)
        self._acceptor.start(self._protocol)
        try:
            await asyncio.Event().wait()
        finally:
            self._acceptor.close()
            await self._acceptor.wait_closed()
            for writer in self._writers:
                writer.close()

    def _protocol(self) -> asyncio.Protocol:
        reader = asyncio.StreamReader(limit=requests.MAX_REQUEST_BYTES)
        return asyncio.StreamReaderProtocol(reader, self.serve)

    async def serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Serve one connection until it closes."""
        writer.transport.set_write_buffer_limits(high=MAX_UNSENT_BYTES)
        line = _TcpLine(reader, writer)
        self._writers.add(writer)
        try:
            hello = await self._hello(line)
            if hello is not None:
                await self._serve_program(line, hello, writer.get_extra_info("peername"))
        except GoneError:
            return
        finally:
            self._writers.discard(writer)
            writer.close()
            with suppress(ConnectionError):
                await writer.wait_closed()

    async def _serve_program(
        self, line: _TcpLine, hello: requests.Hello, client: tuple[str, int]
    ) -> None:
        def current_identity() -> Identity | None:
            return self._authenticator.program(hello.name, f"Bearer {hello.token}")

        sender = current_identity()
        session, places = "", 0
        if sender is not None:
            session = sender.session
            places = reserved(self._hub, self._authenticator, sender, RESERVED_LINES)
        # Without links all programs of this machine share one budget, but not their places.
        budget = self._budgets.of(session if self._authenticator.requires_link else client[0])
        acceptor = self._acceptor
        exemption = nullcontext() if acceptor is None else acceptor.kept((client[0], client[1]))
        with self._places.taken(session, places) as free, exemption:
            if free:
                program = ProgramClient(current_identity, CommandChannel.TCP, client[0])
                await _serve(self._hub, self._authenticator, budget, line, program)
            else:
                why = f"At most {LINES} programs can connect, and {LINES_EACH} with one link."
                if sender is not None:
                    actor = actor_of(sender, CommandChannel.TCP, client[0])
                    self._hub.recorder.refuse("connection", actor, InputError(why))
                await line.close(0, why)

    async def _hello(self, line: _TcpLine) -> requests.Hello | None:
        try:
            async with asyncio.timeout(HELLO_SECONDS):
                request = self._hub.requests.decoded(await line.receive())
        except TimeoutError:
            await line.close(0, 'No request came. Begin with {"do": "hello", "name": "..."}.')
        except InputError as error:
            await line.close(0, f'{error} Begin with {{"do": "hello", "name": "..."}}.')
        else:
            if isinstance(request, requests.Hello):
                return request
            await line.close(0, 'Begin with {"do": "hello", "name": "..."}.')
        return None


async def _serve(
    hub: Hub,
    authenticator: Authenticator,
    budget: Budget,
    line: JsonChannel,
    client: ProgramClient,
    make: Callable[[Hub, JsonChannel, Budget], Channel] = ProgramChannel,
) -> None:
    sender = client.identity()
    if sender is None:
        refused = replace(stranger(client.address), channel=client.channel)
        hub.recorder.note("sign-in", refused, outcome=REFUSED, why=TOKEN_REQUIRED)
        await line.close(SIGN_IN_CLOSE_CODE, TOKEN_REQUIRED)
        return
    program = make(hub, line, budget)
    page = secrets.token_hex(16)
    sender = replace(sender, address=client.address)
    participant = hub.join(sender, page, program.notify, line.arrival, client.channel)
    program.greet(participant)
    try:
        await program.serve(authenticator, client.identity, participant)
    finally:
        hub.leave(participant, for_good=True)


class _TcpLine:
    """JSON lines on a TCP connection, each ended by a line feed."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._reader = reader
        self._writer = writer
        self.arrival = LastHeartbeat(line=writer.get_extra_info("socket"))

    async def receive(self) -> str | bytes:
        """Return the next line. Raises GoneError on a closed connection."""
        try:
            line = await self._reader.readline()
        except ConnectionError as error:
            raise GoneError from error
        except ValueError as error:
            # The reader raises ValueError for a line beyond its limit.
            await self.close(
                BAD_REQUEST_CLOSE_CODE, f"A request has at most {requests.MAX_REQUEST_BYTES} bytes."
            )
            raise GoneError from error
        if not line:
            raise GoneError
        return line

    async def send(self, text: str) -> None:
        """Send one line. Raises GoneError on a closed connection."""
        try:
            self._writer.write(text.encode() + b"\n")
            await self._writer.drain()
        except ConnectionError as error:
            raise GoneError from error

    async def close(self, _code: int, why: str) -> None:
        """Send a refusal with the reason ``why``, then close the connection."""
        with suppress(GoneError):
            await self.send(answers.encoded(answers.Refused(why=why)))
        self._writer.close()
