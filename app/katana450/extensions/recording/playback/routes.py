"""Play back over HTTP, for the page: the timeline, a moment in one window, and opened files."""

from __future__ import annotations

import asyncio
import math
from http import HTTPStatus
from pathlib import Path
from typing import Any

from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import BaseRoute, Route

from katana450.arm.control.lease import CommandChannel
from katana450.errors import InputError
from katana450.extensions.recording.playback.drawing import CONTEXTS, PlaybackWindows
from katana450.extensions.recording.playback.rows import RecordedMoment
from katana450.extensions.recording.playback.store import (
    MAX_FILE_BYTES,
    RING,
    AnyRun,
    RecordingStore,
    opened,
)
from katana450.server.api.fields import ROOT
from katana450.server.service.hub import Hub
from katana450.server.service.identity import PAGE
from katana450.server.service.participants import actor_of, key_of
from katana450.server.viser_bridge.gestures import Gestures
from katana450.server.web.admission import client_of
from katana450.server.web.bodies import NOT_NOW, TOO_LONG, TOO_MANY, TOO_SLOW, as_json
from katana450.server.web.http_api import RouteContext

UPLOAD_TIMEOUT = 120.0
"""[s] Timeout of receiving a file."""

STALL_TIMEOUT = 10.0
"""[s] Timeout of the next bytes of a file, so that a lost connection does not keep others out."""

WRITTEN_BYTES = 1_000_000
"""Bytes of a file that are received before they are written."""

OTHER = (
    "It is a recording of another robot, or of another version of its description. It is drawn as "
    "the arm of this server, so links and tool may be elsewhere than they were."
)

NO_SCENE = "The scene is not ready yet, or shows no robot. Wait a moment."


class PlaybackRoutes:
    """The HTTP routes of play back."""

    def __init__(self, context: RouteContext, store: RecordingStore) -> None:
        """Serve the recordings of ``store``."""
        self._context, self._store = context, store
        self._receiving = asyncio.Lock()
        self._windows: PlaybackWindows | None = None

    def routes(self) -> list[BaseRoute]:
        """Return all routes."""
        path = f"{ROOT}/playback"
        return [
            Route(path, self._open, methods=["POST"]),
            Route(f"{path}/show", self._show, methods=["POST"]),
            Route(f"{path}/hide", self._hide, methods=["POST"]),
            Route(f"{path}/{{name}}/difference", self._difference),
            Route(f"{path}/{{name}}", self._timeline),
            Route(f"{path}/{{name}}/pictures/{{camera}}", self._picture),
        ]

    async def _timeline(self, request: Request) -> Response:
        """Return spans, marks and attempts of a recording."""
        run = self._run(request, request.path_params["name"])

        def read() -> Response:
            run.update()
            return as_json({"spans": run.spans, "marks": run.marks(), "attempts": run.attempts()})

        return await self._store.work.result(read)

    async def _difference(self, request: Request) -> Response:
        """Return what differs between the attempts at two moments of a recording."""
        query, name = request.query_params, request.path_params["name"]
        self._run(request, name)
        moments = _number(query.get("t")), _number(query.get("t2"))
        session = self._context.hub.present().session
        return as_json(await self._store.difference(name, moments, session))

    async def _show(self, request: Request) -> Response:
        """Show a moment of one recording, or of two, in the window that asks."""
        query = request.query_params
        first = self._run(request, query.get("of", RING))
        runs = [(first, _number(query.get("t")))]
        if "second" in query:
            runs.append((self._run(request, query["second"]), _number(query.get("t2"))))
        windows, key = self._window(request)

        def show() -> Response:
            if any(not run.spans for run, _ in runs):
                for run, _ in runs:
                    run.update()
            shown = tuple(run.at(t) for run, t in runs)
            if shown[0] is None:
                raise InputError("Nothing is recorded yet: the arm has not moved.")
            windows.show(key, shown)
            moments = [_moment_content(moment) for moment in shown]
            return as_json({"moments": moments, "moving": windows.moving})

        return await self._store.work.result(show)

    async def _picture(self, request: Request) -> Response:
        """Return the picture of a camera at a moment of a recording; no content without one."""
        options = self._context.options
        if options is not None and options.cameras_for == "drivers":
            self._context.driver(request, "see the cameras of this server")
        run = self._run(request, request.path_params["name"])
        camera, t = request.path_params["camera"], _number(request.query_params.get("t"))

        def picture() -> Response:
            jpeg = run.picture(camera, t)
            if jpeg is None:
                return Response(status_code=HTTPStatus.NO_CONTENT)
            return Response(jpeg, media_type="image/jpeg")

        return await self._store.work.result(picture)

    async def _hide(self, request: Request) -> Response:
        self._context.identity(request)
        windows, key = self._window(request)

        def hide() -> Response:
            windows.hide(key)
            return Response(status_code=HTTPStatus.NO_CONTENT)

        return await asyncio.to_thread(hide)

    async def _open(self, request: Request) -> Response:
        """Receive a file, and return the name of its recording."""
        sender = self._context.driver(request, "open files")
        if self._receiving.locked():
            raise HTTPException(TOO_MANY, "Another file is being opened. Wait a moment.")
        actor = actor_of(sender, CommandChannel.HTTP)
        self._context.hub.recorder.note("upload", actor, {"path": request.url.path})
        path = self._store.new_path()
        async with self._receiving:
            try:
                async with asyncio.timeout(STALL_TIMEOUT) as timeout:
                    await _received(request, path, timeout)
                run = await self._store.work.result(lambda: opened(path))
            except TimeoutError as error:
                await asyncio.to_thread(path.unlink, missing_ok=True)
                raise HTTPException(
                    TOO_SLOW,
                    f"The file took more than {UPLOAD_TIMEOUT:g} s, or nothing of it came for "
                    f"{STALL_TIMEOUT:g} s.",
                ) from error
            except OSError as error:
                path.unlink(missing_ok=True)
                why = f"The server cannot keep the file: {error.strerror or error}."
                raise HTTPException(NOT_NOW, why) from error
            except BaseException:
                path.unlink(missing_ok=True)
                raise
            other = await asyncio.to_thread(self._store.is_of_another_robot, run)
            name, start = self._store.add(path, run), run.spans[0].start
            return as_json({"name": name, "start": start, "note": OTHER if other else ""})

    def _run(self, request: Request, name: str) -> AnyRun:
        """Return the recording ``name`` for the sender of ``request``. Raises HTTPException."""
        if name == RING:
            self._context.identity(request)
        else:
            self._context.driver(request, "open files")
        try:
            return self._store.run(name)
        except InputError as error:
            raise HTTPException(HTTPStatus.NOT_FOUND, str(error)) from error

    def _window(self, request: Request) -> tuple[PlaybackWindows, str]:
        """Return all windows, and the key of the one that asks. Raises HTTPException."""
        windows, page = self._known_windows(), request.query_params.get("page", "")
        client = client_of(self._context.authenticator, request)
        if client is None or not PAGE.fullmatch(page):
            raise HTTPException(NOT_NOW, NO_SCENE)
        return windows, key_of(client, page)

    def _known_windows(self) -> PlaybackWindows:
        """Return all windows. Raises HTTPException before the scene is there."""
        self._windows = self._windows or windows_of(self._context.hub)
        if self._windows is None:
            raise HTTPException(NOT_NOW, NO_SCENE)
        return self._windows


def windows_of(hub: Hub) -> PlaybackWindows | None:
    """Return the windows of the server of ``hub``; None before its scene is there."""
    view = CONTEXTS.get(hub)
    if view is None or not isinstance(view.gestures, Gestures):
        return None
    return PlaybackWindows(view.server, view.robot, view.gestures, lambda: hub.present().session)


async def _received(request: Request, path: Path, timeout: asyncio.Timeout) -> None:
    """Write the body of ``request`` to ``path``. Raises HTTPException for a file too large.

    ``timeout`` is put off with each part of the body.
    """
    size, part = 0, bytearray()
    now = asyncio.get_running_loop().time
    end = now() + UPLOAD_TIMEOUT
    file = await asyncio.to_thread(path.open, "wb")
    try:
        async for chunk in request.stream():
            timeout.reschedule(min(now() + STALL_TIMEOUT, end))
            size += len(chunk)
            if size > MAX_FILE_BYTES:
                raise HTTPException(TOO_LONG, f"The file is larger than {MAX_FILE_BYTES} bytes.")
            part += chunk
            if len(part) >= WRITTEN_BYTES:
                await asyncio.to_thread(file.write, bytes(part))
                part.clear()
        await asyncio.to_thread(file.write, bytes(part))
    finally:
        await asyncio.to_thread(file.close)


def _moment_content(moment: RecordedMoment | None) -> dict[str, Any] | None:
    """Return what the page and programs read of a moment."""
    if moment is None:
        return None
    row = moment.row
    return {
        "t": row.t,
        "q": row.joints,
        "gripper": row.gripper,
        "position": row.position,
        "status": row.status,
        "objects": {body.name: body.T[:3, 3].tolist() for body in moment.objects},
    }


def _number(text: str | None) -> float:
    try:
        value = float(text or "")
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise HTTPException(HTTPStatus.BAD_REQUEST, "`t` and `t2` are seconds since the epoch.")
    return value
