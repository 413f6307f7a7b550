"""Security headers of every response, and the check of Host and Origin of every request."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress

from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import ClientDisconnect
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from katana450.server.web.authenticator import UNKNOWN_HOST, Address, framing_fault
from katana450.server.web.bodies import refusal

SAFE_METHODS = ("GET", "HEAD")

EVERYWHERE = {
    # Static files set another value.
    "Cache-Control": "no-store",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Permissions-Policy": "gamepad=(self), hid=(self), camera=(self), geolocation=(), "
    "microphone=(), payment=(), usb=(), serial=()",
}

FOR_PROGRAMS = ("/api/", "/rosbridge")
"""Prefixes of the paths that need no Origin header. Programs have none, but browsers send one."""

MAX_MESSAGE_BYTES = 16_384
"""Maximum size of a message of a browser; the longest one has a typed text of 200 characters."""

TLS_ONLY = "max-age=31536000"


def page_policy(inline: str, stop_origin: str | None = None) -> str:
    """Return the content security policy of our own page, which allows only its own files.

    ``inline``: source of the script in the page. ``stop_origin``: origin to which the page also
    sends STOP; None if there is none.
    """
    return content_policy(
        default=("'none'",),
        script=("'self'", inline),
        style=("'self'",),
        img=("'self'", "data:"),
        connect=("'self'",) if stop_origin is None else ("'self'", stop_origin),
        frame=("'self'",),
        worker=("'self'",),
        ends=("base-uri 'none'", "form-action 'none'", "frame-ancestors 'none'"),
    )


def content_policy(*, ends: Iterable[str], **sources: Iterable[str]) -> str:
    """Return a content security policy: ``sources`` by their kind, then ``ends`` as they are."""
    parts = [f"{kind}-src {' '.join(allowed)}" for kind, allowed in sources.items()]
    return "; ".join((*parts, *ends))


class SecurityMiddleware:
    """Middleware that refuses requests for other hosts or from other sites, and adds headers."""

    def __init__(self, app: ASGIApp, address: Address) -> None:
        self._app = app
        self._address = address

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on with security headers added, or refuse it."""
        headers = Headers(scope=scope)
        fault = framing_fault(headers)
        objection = fault or self._objection(scope, headers)
        if objection is None:
            # A client that hangs up in its body needs no answer.
            with suppress(ClientDisconnect):
                await self._app(scope, receive, self._with_headers(send))
        elif scope["type"] == "websocket":
            # The websocket is not accepted yet, so the response is 403.
            await receive()
            await send({"type": "websocket.close", "code": 1008})
        else:
            # What follows an ambiguous body is no request.
            close = {"Connection": "close"} if fault else None
            refused = refusal(scope["path"], objection, 400 if fault else 403, close)
            await refused(scope, receive, self._with_headers(send))

    def _objection(self, scope: Scope, headers: Headers) -> str | None:
        host, origin = headers.get("host", ""), headers.get("origin")
        if not self._address.is_ours(host):
            return UNKNOWN_HOST
        safe = scope["type"] == "http" and scope["method"] in SAFE_METHODS
        program = scope["path"].startswith(FOR_PROGRAMS)
        # Every browser sends Origin when a page opens a websocket or sends data.
        if origin is None:
            return None if safe or program else "The header Origin is missing."
        reads = safe or scope["type"] == "websocket"
        guest = program and reads and origin in self._address.guests
        if not (guest or self._address.is_our_page(origin, host)):
            return "Pages of other sites may not send this request."
        return None

    def _with_headers(self, send: Send) -> Send:
        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in EVERYWHERE.items():
                    headers.setdefault(name, value)
                if self._address.cookies_are_secure:
                    headers.setdefault("Strict-Transport-Security", TLS_ONLY)
            await send(message)

        return send_with_headers
