"""What every answer says to the browser, and which requests are answered at all."""

from __future__ import annotations

from collections.abc import Iterable

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import PlainTextResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from katana450.server.web.authenticator import Address

SAFE_METHODS = ("GET", "HEAD")

EVERYWHERE = {
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Permissions-Policy": "gamepad=(self), hid=(self), camera=(), geolocation=(), microphone=(), "
    "payment=(), usb=(), serial=()",
}

FOR_PROGRAMS = "/api/"
"""Programs are no pages and have no origin to name. Whatever a browser sends there names one."""

TLS_ONLY = "max-age=31536000"


def page_policy() -> str:
    """Content security policy of our own page: nothing but its own files."""
    return content_policy(
        default=("'none'",),
        script=("'self'",),
        style=("'self'",),
        img=("'self'", "data:"),
        connect=("'self'",),
        frame=("'self'",),
        worker=("'self'",),
        ends=("base-uri 'none'", "form-action 'none'", "frame-ancestors 'none'"),
    )


def content_policy(*, ends: Iterable[str], **sources: Iterable[str]) -> str:
    """Return a content security policy: ``sources`` by their kind, then ``ends`` as they are."""
    parts = [f"{kind}-src {' '.join(each)}" for kind, each in sources.items()]
    return "; ".join((*parts, *ends))


class SecurityMiddleware:
    """Around the application: turns away what was not meant for it, and adds the headers."""

    def __init__(self, app: ASGIApp, address: Address) -> None:
        self._app = app
        self._address = address

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        objection = self._objection(scope)
        if objection is None:
            await self._app(scope, receive, self._dressed(send))
        elif scope["type"] == "websocket":
            # Before it was accepted: the answer is 403.
            await receive()
            await send({"type": "websocket.close", "code": 1008})
        else:
            refusal = PlainTextResponse(objection, status_code=403)
            await refusal(scope, receive, self._dressed(send))

    def _objection(self, scope: Scope) -> str | None:
        headers = Headers(scope=scope)
        host, origin = headers.get("host", ""), headers.get("origin")
        if not self._address.is_ours(host):
            return "This is not the server of that name."
        asks = scope["type"] == "http" and scope["method"] in SAFE_METHODS
        # Every browser names the page that opens a socket or sends something; what does not is
        # asked to.
        if origin is None:
            program = scope["path"].startswith(FOR_PROGRAMS)
            if asks or program:
                return None
            return "Say where this comes from: a header Origin is missing."
        if not self._address.is_our_page(origin, host):
            return "Another site's page may not ask this."
        return None

    def _dressed(self, send: Send) -> Send:
        async def dressed(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in EVERYWHERE.items():
                    headers.setdefault(name, value)
                if self._address.cookies_are_secure:
                    headers.setdefault("Strict-Transport-Security", TLS_ONLY)
            await send(message)

        return dressed
