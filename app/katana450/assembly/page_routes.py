"""Routes that need no arm: our page and its files, the sign-in, and viser's page.

The modules that a document loads at first are sent in one file: each request takes the browser and
the server some milliseconds of the start.

Their imports are light, because a new server answers them before its libraries are imported.
"""

from __future__ import annotations

import base64
import hashlib
import logging
import posixpath
import re
import time
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import msgspec
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from katana450.arm.control.lease import CommandChannel
from katana450.disk_cache import kept
from katana450.server.service.identity import Identity
from katana450.server.service.limits import TokenBucket
from katana450.server.service.participants import actor_of
from katana450.server.service.recorder import ACCEPTED, REFUSED, Recorder, stranger
from katana450.server.service.stop_path import StopPath
from katana450.server.viser_bridge import viser_page
from katana450.server.viser_bridge.viser_page import SCRIPTS
from katana450.server.web import security
from katana450.server.web.admission import address_of
from katana450.server.web.authenticator import Authenticator
from katana450.server.web.bodies import body_of
from katana450.server.web.static_files import TYPES, File, contents

log = logging.getLogger(__name__)

MAX_BODY_BYTES = 1024
"""Maximum size of the body of a POST request [bytes]."""

BAD_LINKS_PER_SECOND, BAD_LINKS_BURST = 2.0, 20.0
"""Invalid links that are answered per second, and in a burst, for all clients together."""

STOP_PORT = "X-Stop-Port"
"""Header that names the port to which the page also sends STOP."""


INDEX, FIRST = "index.html", "language.js"
"""Our page, and its first module, which sets language and theme before anything is drawn."""

FIRST_ELEMENT = b'<script type="module" src="static/language.js"></script>'
"""Element of that module in the page, which contains it when it is sent."""

PAGE_ELEMENT = b'<script type="module" src="static/page.js"></script>'
"""Element of the module of our page, which loads the others."""

PAGE_SCRIPTS = "page-scripts.js"
"""Name of the file with all modules that our page loads at first."""

ENTRIES = {PAGE_SCRIPTS: "page.js", SCRIPTS: "frame.js"}
"""Modules of our page and of viser's, by the names of the files with all that they import."""

STATIC_IMPORT = re.compile(
    rb'^import (?:(?:\* as (\w+)|(\{[^}]*\})) from )?"([^"]+)";$', re.MULTILINE
)
DYNAMIC_IMPORT = re.compile(rb'\bimport\("(\.[^"]+)"\)')
EXPORT = re.compile(rb"^export (?=(?:const|class|(?:async )?function) (\w+))", re.MULTILINE)
UNKNOWN = re.compile(rb"^(?:export|import)\b(?! ?\().*$", re.MULTILINE)
"""Patterns of the forms of import and export that are put together, and of all others."""


class _Entry(msgspec.Struct, forbid_unknown_fields=True):
    token: str


def page_files() -> dict[str, File]:
    """Return every file of the page by its path, with the modules of each document in one file."""
    files = contents()
    first = b"<script>%s</script>" % put_together(FIRST, files)
    page = f'<script src="static/{PAGE_SCRIPTS}" defer></script>'.encode()
    files[INDEX] = files[INDEX].replace(FIRST_ELEMENT, first).replace(PAGE_ELEMENT, page)
    files |= {name: put_together(entry, files) for name, entry in ENTRIES.items()}

    def packed() -> dict[str, File]:
        return {name: File.of(text, TYPES[Path(name).suffix]) for name, text in files.items()}

    return kept(packed, dict[str, File], *files, *files.values())


def put_together(entry: str, files: Mapping[str, bytes]) -> bytes:
    """Return the module ``entry`` and all that it imports as one script without imports.

    Each module is a function that returns its exports, after those that it imports. What is
    imported later, by ``import()``, stays a file. Raises ValueError for an import or export that
    is not understood.
    """
    numbers: dict[str, int] = {}
    parts: list[bytes] = []

    def add(path: str) -> int:
        """Add the module at ``path`` after its imports; return its number."""
        if path not in numbers:
            folder = posixpath.dirname(path)
            exports = [match[1] for match in EXPORT.finditer(files[path])]

            def imported(match: re.Match[bytes]) -> bytes:
                number = add(posixpath.normpath(posixpath.join(folder, match[3].decode())))
                names = match[1] or (match[2] or b"").replace(b" as ", b": ")
                return b"const %s = m%d;" % (names, number) if names else b""

            def later(match: re.Match[bytes]) -> bytes:
                target = posixpath.normpath(posixpath.join(folder, match[1].decode()))
                return b'import("./%s")' % target.encode()

            body = DYNAMIC_IMPORT.sub(
                later, STATIC_IMPORT.sub(imported, EXPORT.sub(b"", files[path]))
            )
            unknown = UNKNOWN.search(body)
            if unknown is not None:
                raise ValueError(f"{path} cannot be put together: {unknown[0].decode()}")
            number = numbers[path] = len(numbers)
            parts.append(
                b"const m%d = (() => {\n%s\nreturn { %s };\n})();\n"
                % (number, body, b", ".join(exports))
            )
        return numbers[path]

    add(entry)
    return b'(() => {\n"use strict";\n%s})();\n' % b"".join(parts)


def source(page: File) -> str:
    """Return the source that allows the script in ``page``, for its content security policy."""
    script = page.content.partition(b"<script>")[2].partition(b"</script>")[0]
    return f"'sha256-{base64.b64encode(hashlib.sha256(script).digest()).decode()}'"


def page_routes(
    authenticator: Authenticator, stop_path: StopPath, recorder: Recorder
) -> list[Route]:
    """Return the routes that need no arm."""
    static = page_files()
    index = static.pop(INDEX)
    inline = source(index)
    policy = security.page_policy(inline)
    bad_links = TokenBucket(BAD_LINKS_PER_SECOND, BAD_LINKS_BURST, time.monotonic())

    async def page(request: Request) -> Response:
        origin = stop_path.origin_beside(request.headers["host"])
        return index.answer(request, security.page_policy(inline, origin))

    async def file(request: Request) -> Response:
        sent_file = static.get(request.path_params["name"])
        if sent_file is None:
            raise HTTPException(404)
        # A web worker has the policy of its own file.
        return sent_file.answer(request, policy)

    async def enter(request: Request) -> Response:
        """Sign in, with the token of an access link if the server requires one."""
        try:
            entry = msgspec.json.decode(await body_of(request, MAX_BODY_BYTES), type=_Entry)
        except msgspec.MsgspecError as error:
            raise HTTPException(400, "A token is required.") from error
        response = Response(status_code=204)
        if stop_path.origin_beside(request.headers["host"]) is not None:
            response.headers[STOP_PORT] = str(stop_path.port)
        if not entry.token and authenticator.identity(request.cookies) is not None:
            return response
        visitor, peer = authenticator.sign_in(entry.token, response), address_of(request)
        if visitor is not None:
            actor = actor_of(replace(visitor, address=peer), CommandChannel.PAGE)
            recorder.note("sign-in", actor, outcome=ACCEPTED)
        else:
            why = "The link is invalid or has expired."
            recorder.note("sign-in", stranger(peer), outcome=REFUSED, why=why)
            # A valid link is accepted even while others guess.
            if entry.token and not bad_links.take(time.monotonic()):
                raise HTTPException(429, "Too many attempts. Wait a moment.")
            log.warning("A client used a link that is invalid or has expired.")
            raise HTTPException(401, "This link is invalid or has expired. Ask for another.")
        return response

    return [
        Route("/", page),
        Route("/static/{name:path}", file),
        Route("/enter", enter, methods=["POST"]),
        *_viser_routes(authenticator),
    ]


def _viser_routes(authenticator: Authenticator) -> list[Route]:
    viser, policy = viser_page.load(), viser_page.policy()

    async def page(request: Request) -> Response:
        scheme = "wss" if authenticator.address.cookies_are_secure else "ws"
        origin = f"{scheme}://{request.headers['host']}"
        why = viser_page.objection(request.query_params, origin)
        if why is not None:
            raise HTTPException(400, why)
        return viser.html.answer(request, policy)

    async def file(request: Request) -> Response:
        sent_file = viser.files.get(request.path_params["name"])
        if sent_file is None:
            raise HTTPException(404)
        return sent_file.answer(request)

    return [Route("/viser/", page), Route("/viser/{name}", file)]


def signed_in(authenticator: Authenticator, request: Request) -> Identity:
    """Return the identity of the sender of ``request``. Raises HTTPException without one."""
    identity = authenticator.identity(request.cookies)
    if identity is None:
        raise HTTPException(401, "Sign in at the start page first.")
    return replace(identity, address=address_of(request))
