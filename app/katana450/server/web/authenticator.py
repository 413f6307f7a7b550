"""Authentication of clients: by access links, or without them on the same machine."""

from __future__ import annotations

import asyncio
import secrets
import time
from collections.abc import Callable, Coroutine, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from ipaddress import ip_address
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

from katana450.arm.control.lease import Role
from katana450.errors import ConfigurationError
from katana450.server.service.identity import Identity
from katana450.server.web.access_links import MAX_NAME_LENGTH, AccessFile, Grant

if TYPE_CHECKING:
    # Loading it takes long, and the process of STOP needs none.
    from starlette.responses import Response

SESSION_SIZE = 22
"""Length of a session's name in characters: 16 random bytes."""

CHECK_EVERY = 1.0
"""Interval [s] of the checks whether a client is still authorised."""

SIGN_IN_CLOSE_CODE = 4401
"""Close code for a client that must sign in (again) at the start page."""

EXPIRED = "Your link has expired or was revoked."
"""Reason for which a connection is closed."""

TOKEN_REQUIRED = "A token is required. `katana450 access give` makes one."

UNKNOWN_HOST = "The server is not known by this host name. `serve --public-url` sets it."

LOOPBACK_NAMES = frozenset({"localhost", "127.0.0.1", "::1"})


@dataclass(frozen=True)
class Address:
    """Names and addresses under which the server accepts requests.

    Attributes:
        names: Host names that are accepted.
        any_address: Whether every bare IP address is accepted; False on loopback alone.
        secure: Whether the server itself uses TLS.
        public: Origin of a reverse proxy in front, such as ``https://arm.example.org``.
        guests: Origins of pages of other sites that may open the websockets of programs and read
            files.
    """

    names: frozenset[str]
    any_address: bool
    secure: bool
    public: str | None = None
    guests: set[str] = field(default_factory=set, compare=False)

    @property
    def cookies_are_secure(self) -> bool:
        """True if clients use HTTPS, so that cookies can be marked as secure."""
        return self.secure or (self.public or "").startswith("https:")

    def is_ours(self, host: str) -> bool:
        """Return whether ``host``, of a Host header, names this server.

        Without this check another site could point its own name here and count as our origin.
        """
        if self.public is not None and host.lower() == urlsplit(self.public).netloc:
            return True
        try:
            name = (urlsplit(f"//{host}").hostname or "").lower()
        except ValueError:
            return False
        if name in self.names:
            return True
        try:
            ip_address(name)
        except ValueError:
            return False
        return self.any_address

    def is_our_page(self, origin: str, host: str) -> bool:
        """Return whether ``origin``, of an Origin header, is that of our own page at ``host``."""
        scheme = "https" if self.secure else "http"
        return origin in (f"{scheme}://{host}", self.public)


def framing_fault(headers: Mapping[str, str]) -> str | None:
    """Return what makes a request with ``headers``, named in lower case, invalid; None if nothing.

    A proxy in front could take another part of an ambiguous request for the next one.
    """
    if "content-length" in headers and "transfer-encoding" in headers:
        return "Send either Content-Length or Transfer-Encoding, not both."
    with suppress(ValueError):
        if urlsplit(f"//{headers.get('host', '')}").port != 0:
            return None
    return "The header Host is no host name with a port."


def public_origin(url: str) -> str:
    """Return the origin of ``url``. Raises ConfigurationError if it has none or has a path."""
    parts = urlsplit(url)
    if parts.scheme not in ("http", "https") or not parts.netloc or parts.path not in ("", "/"):
        raise ConfigurationError(
            f"A public address looks like https://arm.example.org, not {url!r}."
        )
    return f"{parts.scheme}://{parts.netloc.lower()}"


class Authenticator:
    """Identifies clients by their cookies and tokens."""

    def __init__(self, access: AccessFile | None, port: int, address: Address) -> None:
        """Check clients against ``access``; None makes every client an admin."""
        self._access = access
        self.address = address
        """Names and addresses of the server."""
        # Browsers send cookies to all ports of a host.
        self._cookie = f"katana450-{port}"

    @property
    def requires_link(self) -> bool:
        """True if the server requires an access link."""
        return self._access is not None

    def identity(self, cookies: Mapping[str, str]) -> Identity | None:
        """Return the identity of the sender of ``cookies``; None if it is not authorised."""
        value = cookies.get(self._cookie, "")
        if self._access is None:
            return Identity(value, None, Role.ADMIN) if len(value) == SESSION_SIZE else None
        known = self._access.check_session(value, time.time())
        return None if known is None else identity_of(*known)

    def program(
        self, name: str, authorization: str = "", cookies: Mapping[str, str] | None = None
    ) -> Identity | None:
        """Return the identity of the program that sends this Authorization header or ``cookies``.

        ``name``: the program's own name; it follows the name of the link where one is required.
        Return None if the program is not authorised.
        """
        name = name if name.isprintable() and 0 < len(name) <= MAX_NAME_LENGTH else "Program"
        if self._access is None:
            return Identity(secrets.token_urlsafe(16), name, Role.ADMIN)
        scheme, _, token = authorization.partition(" ")
        if scheme.lower() == "bearer":
            known = self._access.check(token.strip(), time.time())
            visitor = None if known is None else identity_of(*known)
        else:
            visitor = self.identity(cookies or {})
        return None if visitor is None else replace(visitor, name=f"{visitor.name}, {name}")

    async def run_while_authorised(
        self, identity: Callable[[], Identity | None], work: Coroutine[Any, Any, None]
    ) -> str | None:
        """Run ``work`` as long as ``identity`` returns one.

        Returns the reason for an end from outside; None if ``work`` ended by itself.
        """
        task = asyncio.create_task(work)
        try:
            while True:
                done, _ = await asyncio.wait([task], timeout=CHECK_EVERY)
                if done:
                    await task
                    return None
                if identity() is None:
                    return EXPIRED
        finally:
            task.cancel()
            with suppress(asyncio.CancelledError):
                await task

    def sign_in(self, token: str, response: Response) -> Identity | None:
        """Set the cookie of the bearer of ``token``; return None if the token is not accepted."""
        max_age = None
        if self._access is None:
            value = secrets.token_urlsafe(16)
            visitor: Identity | None = Identity(value, None, Role.ADMIN)
        else:
            known = self._access.check(token, time.time())
            if known is None:
                return None
            visitor = identity_of(*known)
            max_age = int(known[1].expires - time.time())
            value = self._access.session(known[0])
        response.set_cookie(
            self._cookie,
            value,
            max_age,
            secure=self.address.cookies_are_secure,
            httponly=True,
            samesite="strict",
        )
        return visitor


def identity_of(number: str, grant: Grant) -> Identity:
    """Return the identity of the link of ``number``."""
    return Identity(number, grant.name, grant.role, number)
