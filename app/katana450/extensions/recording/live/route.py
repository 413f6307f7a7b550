"""The route by which a page downloads what the server has just recorded."""

from __future__ import annotations

import asyncio
import math
import sys
import tempfile
from asyncio.subprocess import PIPE
from http import HTTPStatus
from pathlib import Path

from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from katana450.server.api.fields import ROOT
from katana450.server.web.http_api import RouteContext

TIMEOUT = 60.0
"""[s] Timeout for making a file of ten minutes."""


def recording_route(context: RouteContext, folder: Path | None) -> Route:
    """Return the route that answers with a recording of the last minutes.

    folder: folder of the ring; None if the server records nothing.
    """
    working = asyncio.Lock()

    async def recording(request: Request) -> Response:
        sender = context.identity(request)
        if not sender.role.may_drive:
            raise HTTPException(HTTPStatus.FORBIDDEN, "Your role may watch, but not record.")
        last = _seconds(request.query_params.get("last", "inf"))
        if folder is None:
            raise HTTPException(
                HTTPStatus.NOT_FOUND,
                "This server records nothing. Start it without --no-record to change that.",
            )
        if working.locked():
            raise HTTPException(
                HTTPStatus.TOO_MANY_REQUESTS, "Another recording is being made. Wait a moment."
            )
        async with working:
            content = await _kept(folder, last)
        headers = {"Content-Disposition": 'attachment; filename="katana450.mcap"'}
        return Response(content, media_type="application/octet-stream", headers=headers)

    return Route(f"{ROOT}/recording", recording)


def _seconds(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not value > 0.0:
        raise HTTPException(HTTPStatus.BAD_REQUEST, "`last` is a number of seconds above 0.")
    return value


async def _kept(folder: Path, last: float) -> bytes:
    """Return the recording of the last seconds of the ring in ``folder``.

    Another process makes it, so that the work delays nobody.
    """
    with tempfile.TemporaryDirectory(prefix="katana450-") as temporary:
        out = Path(temporary) / "kept.mcap"
        command = ("record", "keep", str(folder), "--last", str(last), "--out", str(out))
        process = await asyncio.create_subprocess_exec(
            sys.executable, "-P", "-m", "katana450", *command, stdout=PIPE, stderr=PIPE
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
