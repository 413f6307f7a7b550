"""The API over HTTP: queries, STOP, and single requests of a program."""

from __future__ import annotations

import asyncio
import math
import re
from argparse import Namespace
from collections.abc import Awaitable, Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import BaseRoute, Route, WebSocketRoute
from starlette.websockets import WebSocket

from katana450.arm.control.commands.act import Id
from katana450.arm.control.lease import LEASE_TIMEOUT, CommandChannel
from katana450.errors import InputError, LeaseError
from katana450.server.api import answers, requests
from katana450.server.api.fields import MAX_PRESS_LENGTH, ROOT
from katana450.server.service.budget import HTTP_REQUEST_COST, Budget, Budgets, BusyError
from katana450.server.service.dispatcher import Dispatcher, driver_key
from katana450.server.service.hub import Hub
from katana450.server.service.identity import Identity
from katana450.server.service.participants import SHARED_SESSION, Participant, actor_of
from katana450.server.service.pending_answer import ARRIVED, PendingAnswer
from katana450.server.service.recorder import REFUSED, stranger
from katana450.server.web import program_socket
from katana450.server.web.admission import address_of, client_of
from katana450.server.web.authenticator import TOKEN_REQUIRED, Authenticator
from katana450.server.web.bodies import NOT_NOW, NOT_UNDERSTOOD, TOO_MANY, as_json, body_of

QUERY_SUBJECTS = ("state", "arm", "branches", "loop", "objects", "world", "program_plan")
"""Subjects of the request ``query``. Each has a URL path of its own for GET."""

PROGRAM_KEY = re.compile(r"[A-Za-z0-9_-]{16,64}")
"""Pattern of the secret key that identifies a program which sends requests by POST."""

KEY, NAME = "x-program", "x-name"
"""HTTP headers with the secret key of a program, and with the name that others see."""

RETRY_STATUS = 503
"""HTTP status of the answer to a query while there is no arm."""

MAX_PAUSE = 0.5
"""Maximum time [s] by which the refusal of a too frequent request is delayed."""


class RouteContext(NamedTuple):
    """The objects of the server that the routes of an extension can use.

    Attributes:
        hub: The hub with the arm and the lease.
        authenticator: Identifies clients by their cookies and links.
        identity: Returns the identity of a request's sender, or raises HTTPException.
        budgets: The processor time of each identity.
        options: Options of ``katana450 serve``.
    """

    hub: Hub
    authenticator: Authenticator
    identity: Callable[[Request], Identity]
    budgets: Budgets
    options: Namespace

    def driver(self, request: Request, act: str) -> Identity:
        """Return the identity of a sender who may drive, and so may ``act``.

        ``act``: verb and object, as in "open files". Raises HTTPException.
        """
        sender = self.identity(request)
        if not sender.role.may_drive:
            raise HTTPException(403, f"Your role may watch, but not {act}.")
        return sender


RouteProvider = Callable[[RouteContext], list[BaseRoute]]
"""Function that returns the routes of an extension."""


class _HttpProgram(NamedTuple):
    """A program that sends requests by POST; ``timer`` lets it leave after its last request."""

    participant: Participant
    timer: asyncio.TimerHandle


class Api:
    """The HTTP routes of the API."""

    def __init__(
        self,
        hub: Hub,
        authenticator: Authenticator,
        budgets: Budgets,
        options: Namespace,
        provided: Sequence[RouteProvider] = (),
    ) -> None:
        """Serve ``hub``. ``provided``: functions that return the routes of extensions."""
        self._hub = hub
        self._budgets = budgets
        self._authenticator = authenticator
        self._dispatcher = Dispatcher(hub)
        context = RouteContext(hub, authenticator, self._identity, budgets, options)
        self._provided = [route for provider in provided for route in provider(context)]
        self._programs: dict[str, _HttpProgram] = {}

    def routes(self) -> list[BaseRoute]:
        """Return all routes of the API and of the extensions."""

        async def socket(socket: WebSocket) -> None:
            await program_socket.serve_socket(self._hub, self._authenticator, self._budgets, socket)

        return [
            *(Route(f"{ROOT}/{subject}", self._query(subject)) for subject in QUERY_SUBJECTS),
            Route(f"{ROOT}/stop", self._stop, methods=["POST"]),
            Route(f"{ROOT}/do", self._do, methods=["POST"]),
            *self._provided,
            WebSocketRoute(f"{ROOT}/socket", socket),
        ]

    def _query(self, subject: str) -> Callable[[Request], Awaitable[Response]]:
        """Return the handler of GET requests for ``subject``."""

        async def query(request: Request) -> Response:
            identity, driver = self._identity(request), ""
            if self._key(request, identity) in self._programs:
                # A query counts as a heartbeat only if the program has sent a request by POST.
                participant = self._participant(request, identity)
                driver = driver_key(self._hub, participant)
                self._hub.heartbeat(participant)
            try:
                with self._budget(request).charged(driver, fixed=HTTP_REQUEST_COST):
                    return as_json(self._dispatcher.query(subject))
            except BusyError as error:
                self._note_flood(identity, error)
                return await _too_much(error)
            except LeaseError as error:
                raise HTTPException(RETRY_STATUS, str(error)) from error
            except InputError as error:
                return as_json(answers.Refused(why=str(error)), NOT_NOW)

        return query

    async def _stop(self, request: Request) -> Response:
        sender = self._identity(request)
        press = request.query_params.get("press", "")[:MAX_PRESS_LENGTH]
        self._hub.stop(actor_of(sender, CommandChannel.HTTP), press or None)
        return Response(status_code=204)

    async def _do(self, request: Request) -> Response:
        identity = self._identity(request)
        if not PROGRAM_KEY.fullmatch(request.headers.get(KEY, "")):
            why = (
                "The header X-Program is missing or invalid. Choose a key of 16 to 64 letters and "
                "digits, and keep it secret. X-Name is the name that others see."
            )
            return as_json(answers.Refused(why=why), NOT_UNDERSTOOD)
        body = await body_of(request, requests.MAX_REQUEST_BYTES)
        # The link of the sender may have ended while the body was received.
        identity = self._identity(request)
        try:
            decoded = self._hub.requests.decoded(body)
            if isinstance(decoded, requests.Hello | requests.Watch):
                raise InputError(
                    "This request needs an open connection. Send it on the WebSocket or the TCP "
                    "port."
                )
            participant = self._participant(request, identity)
            answer = self._dispatcher.handle(participant, decoded, self._budget(request))
            if isinstance(answer, PendingAnswer):
                if answer.waits:
                    answer = await self._watched(request, participant, answer)
                else:
                    answer = await answer.answer()
            end = answer.end if isinstance(answer, answers.Done) else None
            failed = isinstance(answer, answers.Refused) or (end and end.how not in ARRIVED)
            return as_json(answer, NOT_NOW if failed else 200)
        except BusyError as error:
            self._note_flood(identity, error)
            return await _too_much(error, requests.id_of(body))
        except InputError as error:
            actor = actor_of(identity, CommandChannel.HTTP)
            self._hub.recorder.refuse("invalid", actor, error)
            refused = answers.Refused(why=str(error), id=requests.id_of(body))
            return as_json(refused, NOT_UNDERSTOOD)
        except LeaseError as error:
            return as_json(answers.Refused(why=str(error), id=requests.id_of(body)), NOT_NOW)

    async def _watched(
        self,
        request: Request,
        participant: Participant,
        pending: PendingAnswer,
    ) -> answers.Answer:
        """Return the answer at the end of a motion.

        If the sender closes the connection before it, or its link ends, its program leaves as if
        a socket were closed, so a moving arm stops.
        """
        results: list[answers.Answer] = []

        async def work() -> None:
            answer = asyncio.create_task(pending.answer())
            # The body was received, so the next message is that the connection was closed.
            closed = asyncio.ensure_future(request.receive())
            try:
                await asyncio.wait((answer, closed), return_when=asyncio.FIRST_COMPLETED)
                if answer.done():
                    results.append(answer.result())
            finally:
                if not answer.done():
                    self._forget(participant.person.key)
                for task in (answer, closed):
                    task.cancel()
                await asyncio.gather(answer, closed, return_exceptions=True)

        def current() -> Identity | None:
            token = request.headers.get("authorization", "")
            return self._authenticator.program("", token, request.cookies)

        why = await self._authenticator.run_while_authorised(current, work())
        return results[0] if results else answers.Refused(why=why or "The connection was closed.")

    def _note_flood(self, identity: Identity, error: BusyError) -> None:
        self._hub.recorder.refuse("any", actor_of(identity, CommandChannel.HTTP), error)

    def _budget(self, request: Request) -> Budget:
        sender = client_of(self._authenticator, request)
        return self._budgets.of(address_of(request) if sender is None else sender.session)

    def _identity(self, request: Request) -> Identity:
        headers = request.headers
        sender = self._authenticator.program(
            headers.get(NAME, ""), headers.get("authorization", ""), request.cookies
        )
        if sender is None:
            peer = stranger(address_of(request))
            self._hub.recorder.note("sign-in", peer, outcome=REFUSED, why="No valid token.")
            raise HTTPException(401, TOKEN_REQUIRED)
        return replace(sender, address=address_of(request))

    def _participant(self, request: Request, identity: Identity) -> Participant:
        """Return the participant that sends ``request``, which joins if necessary.

        The participant leaves after ``LEASE_TIMEOUT`` without a request.
        """
        key = self._key(request, identity)
        known = self._programs.pop(key, None)
        if known is None:
            session, _, page = key.partition("/")
            identity = replace(identity, session=session)
            participant = self._hub.join(
                identity, page, lambda _notice: None, channel=CommandChannel.HTTP
            )
            assert participant.person.key == key
        else:
            participant, timer = known
            timer.cancel()
        self._remember(key, participant)
        return participant

    def _remember(self, key: str, participant: Participant) -> None:
        timer = asyncio.get_running_loop().call_later(LEASE_TIMEOUT, self._expire, key)
        self._programs[key] = _HttpProgram(participant, timer)

    def _expire(self, key: str) -> None:
        """Let the program of ``key`` leave, unless it waits for the end of a motion."""
        known = self._programs[key]
        if known.participant.heartbeat.open:
            self._remember(key, known.participant)
        else:
            self._forget(key)

    def _key(self, request: Request, identity: Identity) -> str:
        """Return the key that all requests of one program have in common."""
        session = identity.session if self._authenticator.requires_link else SHARED_SESSION
        return f"{session}/{request.headers.get(KEY, '')}"

    def _forget(self, key: str) -> None:
        if key not in self._programs:
            return
        participant, timer = self._programs.pop(key)
        timer.cancel()
        self._hub.leave(participant, for_good=True)


async def _too_much(error: BusyError, id: Id = None) -> Response:
    # The delay slows down a client that repeats the request at once. STOP is not delayed.
    await asyncio.sleep(min(error.retry, MAX_PAUSE))
    answer = as_json(answers.Refused(why=str(error), id=id, retry=error.retry), TOO_MANY)
    answer.headers["Retry-After"] = str(math.ceil(error.retry))
    return answer
