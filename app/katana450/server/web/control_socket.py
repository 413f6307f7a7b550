"""The page's own socket: STOP, heartbeats, the lease, jogging and knobs up, the status down.

States come down only as they are asked for, a few at a time, so a slow line has no backlog of them.
"""

from __future__ import annotations

import re
from typing import Any

from starlette.websockets import WebSocket

from katana450.server.api import requests
from katana450.server.service import status
from katana450.server.service.budget import Budget, Budgets
from katana450.server.service.hub import Hub, Window
from katana450.server.web.authenticator import SIGN_IN_CLOSE_CODE, Authenticator
from katana450.server.web.channel import Channel, JsonChannel, WebSocketJsonChannel
from katana450.server.web.token_bucket import TokenBucket

PAGE = re.compile(r"[A-Za-z0-9_-]{16,64}")
"""The name a page gives itself; nobody else can guess it."""

RATE, BURST = 160.0, 320.0
"""Requests a second, and at once: ten heartbeats, 25 jogs, 30 looks, and hands on knobs and
buttons."""

PUSH_EVERY = 0.1
"""[s] Between two looks at whether there is news."""

MAX_BAD_REQUESTS = 4
"""Requests that are none; at one more the socket is closed."""


class ControlSocket(Channel):
    """One page's: it is told what is new of the status, on a slow line less often."""

    def __init__(self, hub: Hub, line: JsonChannel, budget: Budget) -> None:
        t = hub.clock()
        super().__init__(
            hub,
            line,
            budget,
            often=TokenBucket(RATE, BURST, t),
            bad=TokenBucket(0.0, MAX_BAD_REQUESTS, t),
        )
        self._told: dict[str, Any] = {}
        self._looked_at = float("-inf")
        self.window: Window | None = None

    def answer(self, window: Window, request: requests.Request) -> None:
        super().answer(window, request)
        if isinstance(request, requests.Stop):
            self.tell({"is": "stopped"})
        if not isinstance(request, requests.Heartbeat | requests.Jog):
            self.wake()

    def unasked(self) -> tuple[Any, float | None]:
        t = self.hub.clock()
        if self.window is None or t - self._looked_at < PUSH_EVERY / 2:
            return None, PUSH_EVERY
        self._looked_at = t
        now = status.common(self.hub) | status.of(self.hub, self.window)
        news = {key: value for key, value in now.items() if self._told.get(key, self) != value}
        if not news:
            return None, PUSH_EVERY
        self._told = now
        return {"is": "status", **news}, PUSH_EVERY


async def serve(
    hub: Hub, authenticator: Authenticator, budgets: Budgets, socket: WebSocket
) -> None:
    """Answer a request for a control socket."""
    identity = authenticator.identity(socket.cookies)
    page = socket.query_params.get("page", "")
    await socket.accept()
    if identity is None or not PAGE.fullmatch(page):
        await socket.close(SIGN_IN_CLOSE_CODE, "Come in by the front page.")
        return
    line = WebSocketJsonChannel(socket)
    control = ControlSocket(hub, line, budgets.of(identity.session))
    control.window = window = hub.join(identity, page, control.tell, line.arrival)
    try:
        if not await authenticator.while_welcome(
            lambda: authenticator.identity(socket.cookies), control.run(window)
        ):
            await line.close(SIGN_IN_CLOSE_CODE, "Your link is no good any more.")
    finally:
        hub.leave(window)
