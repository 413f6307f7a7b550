"""Routes about episodes."""

from __future__ import annotations

import asyncio
import os
from dataclasses import replace
from functools import partial
from http import HTTPStatus
from pathlib import Path
from typing import Any

import msgspec
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response
from starlette.routing import BaseRoute, Route

from katana450.arm.control.lease import Actor, CommandChannel
from katana450.errors import InputError
from katana450.extensions.recording.episodes.episode import EpisodeGiver
from katana450.extensions.recording.episodes.episode_folder import EpisodeFolder, KeptEpisode
from katana450.extensions.recording.live.recorder_link import (
    ENTRY,
    RecorderLink,
)
from katana450.server.api import answers
from katana450.server.api.episode_requests import (
    MAX_NUMBER,
    MAX_REQUEST_BYTES,
    StartEpisode,
    episode_request,
)
from katana450.server.api.fields import ROOT
from katana450.server.service.identity import PAGE
from katana450.server.service.limits import BoundedWork, CrowdedError
from katana450.server.service.participants import actor_of
from katana450.server.web.bodies import NOT_NOW, as_json, body_of
from katana450.server.web.http_api import RouteContext

MAX_WAITING = 3
"""Maximum number of requests that wait for the process that records.

Each has one of the few threads of the event loop, which others need too.
"""


READY_SECONDS = 15.0
"""[s] Maximum time for which the first episode waits for the process that records."""


class EpisodeRoutes:
    """The HTTP routes of episodes."""

    def __init__(self, context: RouteContext, folder: Path, link: RecorderLink) -> None:
        """Serve the episodes in ``folder`` to clients of ``context``; ``link`` records them."""
        self._context = context
        self._folder, self._link = folder, link
        self._read = EpisodeFolder(folder)
        crowded = "Too many requests at once. Wait a moment."
        self._work = BoundedWork(MAX_WAITING, MAX_WAITING, crowded)
        self._listing = asyncio.Lock()

    def routes(self) -> list[BaseRoute]:
        """Return all routes."""
        return [
            Route(f"{ROOT}/episodes", self._list),
            Route(f"{ROOT}/episodes", self._request, methods=["POST"]),
            Route(f"{ROOT}/episodes/{{number:int}}", self._file),
        ]

    async def _list(self, request: Request) -> Response:
        """Return all episodes, and the state of the one that runs."""
        may_drive = self._context.identity(request).role.may_drive
        async with self._listing:
            return JSONResponse(await asyncio.to_thread(self._listed, paths=may_drive))

    def _listed(self, *, paths: bool) -> dict[str, Any]:
        """Return the lists. ``paths``: whether to tell where the files are."""
        unreadable = self._read.unreadable()
        if not paths:
            unreadable = [reason.replace(f"{self._folder}{os.sep}", "") for reason in unreadable]
        return {
            "episodes": [described(file) for file in self._read.kept()],
            "discarded": [described(file) for file in self._read.discarded()],
            "unreadable": unreadable,
            "folder": str(self._folder) if paths else "",
            "state": self._context.hub.shown.get(ENTRY),
        }

    async def _file(self, request: Request) -> Response:
        """Return the file of an episode."""
        self._context.driver(request, "record")
        number = request.path_params["number"]
        path = self._read.path(number)
        if number > MAX_NUMBER or not path.exists():
            raise HTTPException(HTTPStatus.NOT_FOUND, "There is no such episode.")
        return FileResponse(path, filename=path.name, media_type="application/octet-stream")

    async def _request(self, request: Request) -> Response:
        """Execute the request in the body, and return the episode."""
        sender = self._context.driver(request, "record episodes")
        body = await body_of(request, MAX_REQUEST_BYTES)
        actor = actor_of(sender, CommandChannel.HTTP)
        page = request.query_params.get("page", "")
        visitor = self._context.authenticator.identity(request.cookies)
        if visitor is not None and PAGE.fullmatch(page):
            # The name that the person has chosen on the page.
            actor = replace(actor, person=self._context.hub.person_of(visitor, page))
        decoded = episode_request(body)
        # The first episode waits for the process that records.
        wait = READY_SECONDS if isinstance(decoded, StartEpisode) else 0.0
        try:
            ask = partial(self._link.ask, decoded, giver_of(actor), wait)
            done = await self._work.result(ask)
        except CrowdedError:
            raise
        except InputError as error:
            self._context.hub.recorder.refuse("episode", actor, error)
            return as_json(answers.Refused(why=str(error)), NOT_NOW)
        what = {"do": decoded.__struct_config__.tag, "number": done["number"]}
        self._context.hub.recorder.note("episode", actor, what)
        return JSONResponse(done)


def giver_of(actor: Actor) -> EpisodeGiver:
    """Return ``actor`` as the giver of an episode."""
    return EpisodeGiver(actor.name, actor.person.role.value)


def described(file: KeptEpisode) -> dict[str, Any]:
    """Return an episode for a list, with times in seconds after the start of its file."""
    episode = file.episode
    end = file.end if episode.end is None else episode.end
    return {
        **msgspec.to_builtins(episode),
        "start": round(episode.start - file.start, 3),
        "end": round(end - file.start, 3),
        "recorded": round(file.end - file.start, 3),
        "bytes": file.size,
        "file": file.path.name,
    }
