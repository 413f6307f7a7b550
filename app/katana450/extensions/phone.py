"""The address at which a phone reaches this server, with its QR code, and the route to it."""

from __future__ import annotations

import asyncio
import functools
import socket
from ipaddress import ip_address
from urllib.parse import urlsplit

import msgspec
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from katana450.server.api.fields import ROOT
from katana450.server.service.limits import TokenBucket
from katana450.server.web.authenticator import LOOPBACK_NAMES, Address
from katana450.server.web.bodies import TOO_MANY, as_json
from katana450.server.web.http_api import RouteContext

CODES_PER_SECOND, CODES_BURST = 2.0, 10.0
"""QR codes that are drawn per second, and in a burst, for all pages together."""

LOOPBACK_ONLY = (
    "This server listens on this machine only, so a phone cannot reach it. End it, and start it "
    "with this command and its other options. It prints an access link: open that on the phone."
)
OPENING = (
    "katana450 access give --file access.json --name Phone --role operator --url http://{0}:{1} "
    "&& katana450 serve --host 0.0.0.0 --port {1} --access access.json"
)
"""The command that opens a server to the network, with the address and port of its page."""

NO_ADDRESS = "This machine has no address in a network, so a phone cannot reach it."
"""Reasons for which there is no address for a phone."""

LINK_REQUIRED = (
    "The code holds only this address. The phone also needs an access link: a person's own, from "
    "the person in charge of this arm."
)

NO_LINK = "Everybody who opens this address can drive the arm."

NOT_SECURE = "Without https, others in the network can read what the phone sends."

ELSEWHERE = ("192.0.2.1", 9)
"""An address outside every network (RFC 5737), to which nothing is sent."""


def phone_routes(context: RouteContext) -> list[Route]:
    """Return the one route, which answers with the address of this server for a phone."""
    hub, authenticator = context.hub, context.authenticator
    codes = TokenBucket(CODES_PER_SECOND, CODES_BURST, hub.clock())

    async def phone(request: Request) -> Response:
        context.identity(request)
        if not codes.take(hub.clock()):
            raise HTTPException(TOO_MANY, "Too many requests. Wait a moment.")
        address = await asyncio.to_thread(
            phone_address,
            authenticator.address,
            request.headers["host"],
            hub.stop_path.main_port,
            requires_link=authenticator.requires_link,
        )
        return as_json(address)

    return [Route(f"{ROOT}/phone", phone)]


class PhoneAddress(msgspec.Struct, frozen=True):
    """The answer to a page that shows the address of this server for a phone.

    Attributes:
        url: The address; None if there is none.
        code: The QR code of ``url`` as a data URL of an SVG file; None without ``url``.
        note: What a phone needs besides, or why it cannot reach this server.
        command: What makes a server that listens on this machine only reachable; None for others.
    """

    url: str | None
    code: str | None
    note: str
    command: str | None = None


def phone_address(address: Address, host: str, port: int, *, requires_link: bool) -> PhoneAddress:
    """Return the address for a phone, for a page that was opened at ``host``.

    Args:
        address: Names and addresses of this server.
        host: Value of the header Host, of this server.
        port: Port of the page.
        requires_link: Whether people need an access link.
    """
    scheme = "https" if address.secure else "http"
    own = own_address()
    if address.public is not None:
        url = address.public
    elif address.any_address and not _is_loopback(urlsplit(f"//{host}").hostname or ""):
        url = f"{scheme}://{host}"
    elif own is None:
        return PhoneAddress(None, None, NO_ADDRESS)
    elif not address.any_address:
        return PhoneAddress(None, None, LOOPBACK_ONLY, OPENING.format(own, port))
    else:
        url = f"{scheme}://{own}:{port}"
    notes = [LINK_REQUIRED if requires_link else NO_LINK]
    if not address.cookies_are_secure:
        notes.append(NOT_SECURE)
    return PhoneAddress(url, qr_code(url), " ".join(notes))


@functools.lru_cache(8)
def qr_code(text: str) -> str:
    """Return the QR code of ``text`` as a data URL of an SVG file, dark on white.

    It takes 20 ms, so call it in another thread than that of the server.
    """
    # Loaded with the first code.
    import segno

    return str(segno.make_qr(text, error="m").svg_data_uri(scale=4, dark="#000", light="#fff"))


def own_address() -> str | None:
    """Return the IPv4 address of this machine in its network; None without a network."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            # The system chooses the address; a datagram socket sends nothing.
            probe.connect(ELSEWHERE)
            own: str = probe.getsockname()[0]
        except OSError:
            return None
    return None if _is_loopback(own) else own


def _is_loopback(name: str) -> bool:
    """Return whether only this machine knows itself as ``name``."""
    try:
        return ip_address(name).is_loopback
    except ValueError:
        return name in LOOPBACK_NAMES
