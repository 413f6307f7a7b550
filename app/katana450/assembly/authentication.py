"""Checks of TLS, access file and address, for each process that serves a port."""

from __future__ import annotations

import socket
import ssl

from katana450.errors import ConfigurationError
from katana450.server.web.access_links import AccessFile
from katana450.server.web.authenticator import LOOPBACK_NAMES, Address, public_origin
from katana450.server.web.listen import reaches_beyond
from katana450.settings import Settings


def tls_context(settings: Settings) -> ssl.SSLContext | None:
    """Return the TLS context of the server; None without https. Raises ConfigurationError."""
    if (settings.tls_cert is None) != (settings.tls_key is None):
        raise ConfigurationError("https needs both --tls-cert and --tls-key.")
    if settings.tls_cert is None or settings.tls_key is None:
        return None
    try:
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        context.load_cert_chain(settings.tls_cert, settings.tls_key)
    except OSError as error:
        raise ConfigurationError(
            f"{settings.tls_cert} and {settings.tls_key} are not a certificate and its key: "
            f"{error}."
        ) from error
    return context


def access_file(settings: Settings, listening: socket.socket) -> AccessFile | None:
    """Return the file of the access links; None if nobody has to sign in.

    Raises ConfigurationError if other machines can reach ``listening`` without an access link.
    """
    if settings.access is not None:
        return AccessFile.open(settings.access)
    if reaches_beyond(listening) and not settings.insecure:
        raise ConfigurationError(
            f"On {settings.host} other machines can reach the arm. Make a link for each person "
            "with `katana450 access give --file access.json --name NAME --role operator` and "
            "start with --access access.json. Or add --insecure; then everybody can drive the arm."
        )
    return None


def address_of(settings: Settings, listening: socket.socket) -> Address:
    """Return the names and addresses under which a server on ``listening`` accepts requests."""
    beyond = reaches_beyond(listening)
    names = LOOPBACK_NAMES | ({settings.host, socket.gethostname().lower()} if beyond else set())
    return Address(
        frozenset(names),
        any_address=beyond,
        secure=settings.tls_cert is not None,
        public=None if settings.public_url is None else public_origin(settings.public_url),
    )
