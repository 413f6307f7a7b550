"""Routes whose modules are imported with the first request, so that the start takes no longer."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence

from starlette.routing import BaseRoute, Route, Router, WebSocketRoute
from starlette.types import Receive, Scope, Send


class LateRoutes:
    """An ASGI app for all requests whose paths begin with one of some names."""

    def __init__(self, names: Sequence[str], make: Callable[[], Sequence[BaseRoute]]) -> None:
        """Serve the routes that ``make`` returns; it is called once, in a thread.

        ``names``: the paths with which the requests begin.
        """
        self._names, self._make = names, make
        self._making = asyncio.Lock()
        self._router: Router | None = None

    def routes(self) -> list[BaseRoute]:
        """Return the routes of the app itself, for requests and websockets."""
        paths = [f"{name}{{rest:path}}" for name in self._names]
        return [kind(path, self) for path in paths for kind in (Route, WebSocketRoute)]

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request or a websocket."""
        async with self._making:
            if self._router is None:
                self._router = Router(await asyncio.to_thread(self._make))
        await self._router(scope, receive, send)
