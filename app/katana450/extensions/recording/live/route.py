"""The route by which a page downloads what the server has just recorded."""

from __future__ import annotations

import asyncio
import math
import sys
import tempfile
from asyncio.subprocess import PIPE
from collections.abc import Mapping
from http import HTTPStatus
from pathlib import Path

from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from katana450.errors import InputError
from katana450.extensions.recording.playback.store import RING, RecordingStore
from katana450.server.api.fields import ROOT
from katana450.server.web.http_api import RouteContext

TIMEOUT = 60.0
"""[s] Timeout for making a file of ten minutes."""


def recording_route(context: RouteContext, store: RecordingStore) -> Route:
    """Return the route that answers with a recording of the last minutes, or a part of one.

    ``store`` has the folder of the ring, and the files that people opened.
    """
    working = asyncio.Lock()

    async def recording(request: Request) -> Response:
        sender = context.identity(request)
        if not sender.role.may_drive:
            raise HTTPException(HTTPStatus.FORBIDDEN, "Your role may watch, but not record.")
        command = _command(store, request.query_params)
        if working.locked():
            raise HTTPException(
                HTTPStatus.TOO_MANY_REQUESTS, "Another recording is being made. Wait a moment."
            )
        async with working:
            content = await _made(command)
        headers = {"Content-Disposition": 'attachment; filename="katana450.mcap"'}
        return Response(content, media_type="application/octet-stream", headers=headers)

    return Route(f"{ROOT}/recording", recording)


def _command(store: RecordingStore, query: Mapping[str, str]) -> tuple[str, ...]:
    """Return the command that makes the requested recording. Raises HTTPException."""
    times = {name: _seconds(query, name) for name in ("last", "from", "to") if name in query}
    name = query.get("of", RING)
    try:
        run = store.run(name)
        if name != RING:
            file = store.file(name)
            # The command counts from the begin of the file.
            begin = run.spans[0].start
            part = {end: max(t - begin, 0.0) for end, t in times.items() if end != "last"}
            return ("trim", str(file), *_options(part))
    except InputError as error:
        raise HTTPException(HTTPStatus.NOT_FOUND, str(error)) from error
    utc = {"from": "since", "to": "until", "last": "last"}
    return ("keep", str(store.ring), *_options({utc[each]: t for each, t in times.items()}))


def _options(values: Mapping[str, float]) -> list[str]:
    return [text for name, value in values.items() for text in (f"--{name}", repr(value))]


def _seconds(query: Mapping[str, str], name: str) -> float:
    try:
        value = float(query[name])
    except ValueError:
        value = math.nan
    if not value > 0.0:
        raise HTTPException(HTTPStatus.BAD_REQUEST, f"`{name}` is a number of seconds above 0.")
    return value


async def _made(command: tuple[str, ...]) -> bytes:
    """Return the recording that ``katana450 record`` makes by ``command``.

    Another process makes it, so that the work delays nobody.
    """
    with tempfile.TemporaryDirectory(prefix="katana450-") as temporary:
        out = Path(temporary) / "kept.mcap"
        words = ("record", *command, "--out", str(out))
        process = await asyncio.create_subprocess_exec(
            sys.executable, "-P", "-m", "katana450", *words, stdout=PIPE, stderr=PIPE
        )
        try:
            async with asyncio.timeout(TIMEOUT):
                _, errors = await process.communicate()
        except TimeoutError as error:
            raise HTTPException(
                HTTPStatus.SERVICE_UNAVAILABLE, f"The recording took more than {TIMEOUT:g} s."
            ) from error
        finally:
            if process.returncode is None:
                process.kill()
                await process.wait()
        if process.returncode:
            why = errors.decode(errors="replace").strip().removeprefix("katana450: ")
            raise HTTPException(HTTPStatus.CONFLICT, why)
        return await asyncio.to_thread(out.read_bytes)
