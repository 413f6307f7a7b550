"""Control socket of a page: it receives requests such as STOP and jog, and sends the status.

States are sent only on request, a few at a time, so a slow connection has no backlog of them.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from starlette.websockets import WebSocket

from katana450.server.api import requests
from katana450.server.service import status
from katana450.server.service.budget import Budget, Budgets
from katana450.server.service.hub import Hub
from katana450.server.service.identity import PAGE
from katana450.server.service.participants import Participant
from katana450.server.web.admission import address_of
from katana450.server.web.authenticator import SIGN_IN_CLOSE_CODE, Authenticator
from katana450.server.web.channel import Channel, JsonChannel, WebSocketJsonChannel

REQUESTS = 160.0, 320.0
"""Maximum rate [1/s] and burst of requests: per second ten heartbeats, 25 jogs, 30 queries, and the
use of knobs and buttons."""

PUSH_EVERY = 0.1
"""Interval [s] of status updates; twice as long while nobody drives."""

BAD_REQUESTS = 0.0, 4.0
"""The same of invalid requests: the fifth closes the socket."""


class ControlSocket(Channel):
    """Control socket of one page; it sends changes of the status, less often if it is slow."""

    often, bad = REQUESTS, BAD_REQUESTS

    def __init__(self, hub: Hub, line: JsonChannel, budget: Budget) -> None:
        super().__init__(hub, line, budget)
        self._sent: dict[str, Any] = {}
        self._checked_at = float("-inf")

    def answer(self, participant: Participant, request: requests.Request) -> None:
        """Execute ``request``, send its answer, and confirm the receipt of a stop."""
        super().answer(participant, request)
        if isinstance(request, requests.Stop):
            self.notify({"is": "stopped"})
        if not isinstance(request, requests.Heartbeat | requests.Jog):
            self.wake()

    def unasked(self, *, urgent: bool) -> tuple[Any, float | None]:
        """Return the changes of the status, or None, and the time until the next call [s]."""
        t = self.hub.clock()
        pause = PUSH_EVERY if self.hub.lease.holder is not None else 2 * PUSH_EVERY
        if self.participant is None or (not urgent and t - self._checked_at < PUSH_EVERY / 2):
            return None, pause
        self._checked_at = t
        now = status.common(self.hub) | status.of(self.hub, self.participant)
        changes = {key: value for key, value in now.items() if self._sent.get(key, self) != value}
        self._sent = now
        return {"is": "status", **changes} if changes else None, pause


async def serve(
    hub: Hub, authenticator: Authenticator, budgets: Budgets, socket: WebSocket
) -> None:
    """Serve an accepted control socket until it closes or its client is no longer authorised."""
    identity = authenticator.identity(socket.cookies)
    page = socket.query_params.get("page", "")
    if identity is None or not PAGE.fullmatch(page):
        await socket.close(SIGN_IN_CLOSE_CODE, "Sign in at the start page first.")
        return
    line = WebSocketJsonChannel(socket)
    control = ControlSocket(hub, line, budgets.of(identity.session))
    identity = replace(identity, address=address_of(socket))
    participant = hub.join(identity, page, control.notify, line.arrival)
    control.greet(participant)
    try:
        await control.serve(
            authenticator, lambda: authenticator.identity(socket.cookies), participant, identity
        )
    finally:
        hub.leave(participant)
