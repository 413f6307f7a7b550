"""The route by which a page downloads what the server has just recorded."""

from __future__ import annotations

import asyncio
import math
import shutil
import sys
from asyncio.subprocess import PIPE
from collections.abc import Mapping
from http import HTTPStatus
from pathlib import Path

from starlette.background import BackgroundTask
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import FileResponse, Response
from starlette.routing import Route
from starlette.types import Receive, Scope, Send

from katana450.errors import InputError
from katana450.extensions.recording.playback.store import RING, RecordingStore
from katana450.server.api.fields import ROOT
from katana450.server.web.http_api import RouteContext

TIMEOUT = 60.0
"""[s] Timeout for making a file of ten minutes."""


def recording_routes(context: RouteContext, store: RecordingStore) -> list[Route]:
    """Return the routes of a recording of the last minutes, or a part of one, and of its script.

    The script runs the recorded motion again; a recording of another robot than the server's has
    none. ``store`` has the folder of the ring, and the files that people opened.
    """
    working = asyncio.Lock()
    described = urdf_options(context)

    async def made(request: Request, *, script: bool) -> Response:
        if not context.identity(request).role.may_drive:
            raise HTTPException(HTTPStatus.FORBIDDEN, "Your role may watch, but not record.")
        command = part_command(store, request.query_params)
        if working.locked():
            raise HTTPException(
                HTTPStatus.TOO_MANY_REQUESTS, "Another recording is being made. Wait a moment."
            )
        async with working:
            temporary = await asyncio.to_thread(store.new_folder)
            remove = BackgroundTask(shutil.rmtree, temporary, ignore_errors=True)
            kept, again = temporary / "katana450.mcap", temporary / "again.yaml"
            try:
                await _record(*command, "--out", str(kept))
                if script:
                    # All that was chosen, also of an episode that is trimmed.
                    part = ("--from", "0", "--to", "inf")
                    await _record("again", str(kept), *part, *described, "--out", str(again))
                    text = await asyncio.to_thread(again.read_bytes)
                    await remove()
                    return Response(text, media_type="application/yaml")
            except BaseException:
                await remove()
                raise
            # Sent in parts: up to 200 MB.
            return _Download(kept, remove)

    async def recording(request: Request) -> Response:
        return await made(request, script=False)

    async def script(request: Request) -> Response:
        return await made(request, script=True)

    return [Route(f"{ROOT}/recording", recording), Route(f"{ROOT}/recording/script", script)]


class _Download(FileResponse):
    """The answer with a recording, whose folder is removed however the sending ends."""

    def __init__(self, path: Path, remove: BackgroundTask) -> None:
        super().__init__(path, filename=path.name, media_type="application/octet-stream")
        self._remove = remove

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        try:
            await super().__call__(scope, receive, send)
        finally:
            await self._remove()


def urdf_options(context: RouteContext) -> tuple[str, ...]:
    """Return the option that names the robot of the server, if it is another than the default."""
    urdf = getattr(context.options, "urdf", None)
    return () if urdf is None else ("--urdf", str(urdf))


def part_command(store: RecordingStore, query: Mapping[str, str]) -> tuple[str, ...]:
    """Return the command that makes the recording which ``query`` names, without its path.

    Raises HTTPException.
    """
    times = {name: _seconds(query, name) for name in ("last", "from", "to") if name in query}
    name = query.get("of", RING)
    try:
        run = store.run(name)
        if name != RING:
            file = store.file(name)
            # The command counts from the start of the file.
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


async def _record(*command: str) -> None:
    """Run ``katana450 record`` in another process, so that the work delays nobody.

    Raises HTTPException with its error, and after TIMEOUT.
    """
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-P", "-m", "katana450", "record", *command, stdout=PIPE, stderr=PIPE
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
