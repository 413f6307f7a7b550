"""The API over HTTP: readable values, STOP, and single requests of a program."""

from __future__ import annotations

import asyncio
import logging
import math
import re
from collections.abc import Awaitable, Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import BaseRoute, Route, WebSocketRoute
from starlette.websockets import WebSocket

from katana450.arm.control.actor import CommandChannel
from katana450.arm.control.lease import LEASE_TIMEOUT
from katana450.errors import InputError, LeaseError
from katana450.server.api import answers, requests, schema
from katana450.server.api.fields import MAX_PRESS_LENGTH, ROOT, Id
from katana450.server.service.budget import HTTP_REQUEST_COST, Budget, Budgets, BusyError
from katana450.server.service.dispatcher import Dispatcher, driver_key
from katana450.server.service.hub import Hub
from katana450.server.service.identity import Identity
from katana450.server.service.mutes import MutedError
from katana450.server.service.participants import SHARED_SESSION, Participant, actor_of
from katana450.server.service.people import Connection, ConnectionKind
from katana450.server.service.recorder import REFUSED, stranger
from katana450.server.web import program_socket
from katana450.server.web.admission import address_of, identity
from katana450.server.web.authenticator import TOKEN_REQUIRED, Authenticator
from katana450.server.web.bodies import NOT_NOW, NOT_UNDERSTOOD, TOO_MANY, as_json, body_of

log = logging.getLogger(__name__)

QUESTIONS = ("state", "arm", "event_log", "branches", "loop", "objects", "world", "links")
"""Subjects of ``query``; each has its own path."""

PROGRAM = re.compile(r"[A-Za-z0-9_-]{16,64}")
"""Form of the key of a program that sends requests by POST. The key identifies the program and is
secret; others see the name in ``NAME``."""

KEY, NAME = "x-program", "x-name"
"""Headers of the key and the name of a program."""

RETRY_STATUS = 503

MAX_PAUSE = 0.5
"""Maximum delay [s] of the refusal of a too frequent request."""


class RouteContext(NamedTuple):
    """Context of the routes of an extension.

    Attributes:
        hub: The hub with the arm and the lease.
        authenticator: Identifies clients by their cookies and links.
        identity: Returns the identity of a request's sender, or raises HTTPException.
    """

    hub: Hub
    authenticator: Authenticator
    identity: Callable[[Request], Identity]


RouteProvider = Callable[[RouteContext], list[BaseRoute]]
"""Function that returns the routes of an extension."""


class _Posting(NamedTuple):
    """A program that sends requests by POST; ``timer`` closes its window."""

    participant: Participant
    connection: Connection
    timer: asyncio.TimerHandle


class Api:
    """The HTTP routes of the API."""

    def __init__(
        self,
        hub: Hub,
        authenticator: Authenticator,
        budgets: Budgets,
        provided: Sequence[RouteProvider] = (),
    ) -> None:
        """Serve ``hub``. ``provided``: functions that return the routes of extensions."""
        self._hub = hub
        self._budgets = budgets
        self._authenticator = authenticator
        self._dispatcher = Dispatcher(hub)
        context = RouteContext(hub, authenticator, self._identity)
        self._provided = [route for provider in provided for route in provider(context)]
        self._posting: dict[str, _Posting] = {}

    def routes(self) -> list[BaseRoute]:
        """Return all routes of the API and of the extensions."""

        async def openapi(_request: Request) -> Response:
            described = schema.openapi_json(self._hub.runner.request_types)
            return Response(described, media_type="application/json")

        async def socket(socket: WebSocket) -> None:
            await program_socket.serve_socket(self._hub, self._authenticator, self._budgets, socket)

        return [
            *(Route(f"{ROOT}/{at}", self._read(at)) for at in QUESTIONS),
            Route(f"{ROOT}/stop", self._stop, methods=["POST"]),
            Route(f"{ROOT}/do", self._do, methods=["POST"]),
            *self._provided,
            Route(f"{ROOT}/openapi.json", openapi),
            WebSocketRoute(f"{ROOT}/socket", socket),
        ]

    def _read(self, at: str) -> Callable[[Request], Awaitable[Response]]:
        async def read(request: Request) -> Response:
            identity, driver = self._identity(request), ""
            if self._key(request, identity) in self._posting:
                # A read counts as a heartbeat only of a program that has sent requests.
                participant = self._participant(request, identity)
                driver = driver_key(self._hub, participant)
                self._hub.heartbeat(participant)
            try:
                with self._budget(request).charged(driver, fixed=HTTP_REQUEST_COST):
                    if identity.session not in self._hub.drivers:
                        self._hub.people.mutes.count_request(identity.session)
                    return as_json(self._dispatcher.query(at))
            except (BusyError, MutedError) as error:
                self._refused(request)
                self._note_flood(identity, error)
                return await _too_much(error)
            except LeaseError as error:
                raise HTTPException(RETRY_STATUS, str(error)) from error
            except InputError as error:
                return as_json(answers.Refused(why=str(error)), NOT_NOW)

        return read

    async def _stop(self, request: Request) -> Response:
        found = self._identity(request, stopping=True)
        press = request.query_params.get("press", "")[:MAX_PRESS_LENGTH]
        self._hub.stop(actor_of(found, CommandChannel.HTTP), press or None)
        return Response(status_code=204)

    async def _do(self, request: Request) -> Response:
        identity = self._identity(request)
        if not PROGRAM.fullmatch(request.headers.get(KEY, "")):
            why = (
                "The header X-Program is missing or invalid. Choose a key of 16 to 64 letters and "
                "digits, and keep it secret. X-Name is the name that others see."
            )
            return as_json(answers.Refused(why=why), NOT_UNDERSTOOD)
        body = await body_of(request, requests.MAX_REQUEST_BYTES)
        # An admin may have kept the sender out while the body arrived.
        identity = self._identity(request)
        try:
            decoded = self._hub.requests.decoded(body)
            if isinstance(decoded, requests.Hello | requests.Watch):
                raise InputError("Send this request on the websocket or the TCP port.")
            participant = self._participant(request, identity)
            answer = self._dispatcher.handle(participant, decoded, self._budget(request))
            if self._dispatcher.is_pending(answer):
                answer = await self._dispatcher.concluded(answer)
            return as_json(answer, NOT_NOW if isinstance(answer, answers.Refused) else 200)
        except (BusyError, MutedError) as error:
            self._refused(request)
            self._note_flood(identity, error)
            return await _too_much(error, requests.id_of(body))
        except InputError as error:
            self._refused(request)
            actor = actor_of(identity, CommandChannel.HTTP)
            self._hub.recorder.refuse("invalid", actor, error)
            refused = answers.Refused(why=str(error), id=requests.id_of(body))
            return as_json(refused, NOT_UNDERSTOOD)
        except LeaseError as error:
            self._refused(request)
            return as_json(answers.Refused(why=str(error), id=requests.id_of(body)), NOT_NOW)

    def _refused(self, request: Request) -> None:
        """Count a refused request of the sender."""
        self._hub.people.refused(identity(self._authenticator, request) or address_of(request))

    def _note_flood(self, identity: Identity, error: BusyError | MutedError) -> None:
        self._hub.recorder.refuse("any", actor_of(identity, CommandChannel.HTTP), error)

    def _budget(self, request: Request) -> Budget:
        return self._budgets.of(identity(self._authenticator, request) or address_of(request))

    def _identity(self, request: Request, *, stopping: bool = False) -> Identity:
        headers = request.headers
        found = self._authenticator.program(
            headers.get(NAME, ""),
            headers.get("authorization", ""),
            request.cookies,
            stopping=stopping,
        )
        if found is None:
            why = self._authenticator.refusal(request.cookies, headers.get("authorization", ""))
            self._hub.recorder.note(
                "sign-in",
                stranger(address_of(request)),
                outcome=REFUSED,
                why=why or "No valid token.",
            )
            raise HTTPException(401, TOKEN_REQUIRED) if why is None else HTTPException(403, why)
        if not self._authenticator.requires_link and not stopping:
            # All these programs have one identity, without which nobody could keep one out.
            why = self._authenticator.kept_out(SHARED_SESSION)
            if why is not None and KEY in headers:
                raise HTTPException(403, why)
        return replace(found, address=address_of(request))

    def _participant(self, request: Request, identity: Identity) -> Participant:
        """Return the window of the program; it closes after ``LEASE_TIMEOUT`` without a request."""
        key = self._key(request, identity)
        known = self._posting.pop(key, None)
        if known is None:
            session, _, page = key.partition("/")
            identity = replace(identity, session=session)
            participant = self._hub.join(
                identity, page, lambda _notice: None, channel=CommandChannel.HTTP
            )
            assert participant.person.key == key
            kind, address = ConnectionKind.POSTS, address_of(request)
            connection = Connection(identity, kind, address, key=key)
            self._hub.people.add(connection)
        else:
            participant, connection, timer = known
            timer.cancel()
        timer = asyncio.get_running_loop().call_later(LEASE_TIMEOUT, self._forget, key)
        self._posting[key] = _Posting(participant, connection, timer)
        return participant

    def _key(self, request: Request, identity: Identity) -> str:
        """Return the key that the requests of one program have in common."""
        session = identity.session if self._authenticator.requires_link else SHARED_SESSION
        return f"{session}/{request.headers.get(KEY, '')}"

    def _forget(self, key: str) -> None:
        participant, connection, _ = self._posting.pop(key)
        self._hub.people.remove(connection)
        self._hub.leave(participant, for_good=True)


async def _too_much(error: BusyError | MutedError, id: Id = None) -> Response:
    # The delay slows down immediate repetitions. STOP has a route of its own.
    await asyncio.sleep(min(error.retry, MAX_PAUSE))
    answer = as_json(answers.Refused(why=str(error), id=id, retry=error.retry), TOO_MANY)
    answer.headers["Retry-After"] = str(math.ceil(error.retry))
    return answer
