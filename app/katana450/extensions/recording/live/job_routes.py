"""Routes by which a page exports or verifies a recording, sees the progress, and cancels."""

from __future__ import annotations

import secrets
from collections import OrderedDict
from http import HTTPStatus
from typing import Any

import msgspec
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import FileResponse, Response
from starlette.routing import Route

from katana450.extensions.recording.live.jobs import JobStatus, RecordingJob
from katana450.extensions.recording.live.route import part_command, urdf_options
from katana450.extensions.recording.playback.store import RecordingStore
from katana450.server.api.fields import ROOT
from katana450.server.web.bodies import NOT_NOW, TOO_MANY
from katana450.server.web.http_api import RouteContext

FORMATS = {
    "csv": ".csv",
    "parquet": ".parquet",
    "rosbag2": "",
    "html": ".html",
    "mp4": ".mp4",
}
"""Formats of exports, and the ends of their names; a folder is sent as an archive."""

SIMULATED = ("html", "mp4")
"""Formats for which the robot is simulated."""

VERIFY = "verify"
"""Value of the parameter ``do`` for a verification, beside the formats."""

MAX_KEPT = 3
"""Number of jobs whose results are kept; the one that was begun first is removed."""

NAME = "katana450"
"""Name of the files, without their ends."""


class JobRoutes:
    """The HTTP routes of jobs. One works at a time, so that it does not slow the page down."""

    def __init__(self, context: RouteContext, store: RecordingStore) -> None:
        """Work on the recordings of ``store``."""
        self._context, self._store = context, store
        self._jobs: OrderedDict[str, RecordingJob] = OrderedDict()

    def routes(self) -> list[Route]:
        """Return all routes."""
        path = f"{ROOT}/recording/jobs"
        return [
            Route(path, self._begin, methods=["POST"]),
            Route(f"{path}/{{name}}", self._state),
            Route(f"{path}/{{name}}/file", self._file),
            Route(f"{path}/{{name}}/cancel", self._cancel, methods=["POST"]),
        ]

    async def _begin(self, request: Request) -> Response:
        """Begin a job, and return its name."""
        self._check(request)
        do = request.query_params.get("do", "")
        if do != VERIFY and do not in FORMATS:
            known = ", ".join((VERIFY, *FORMATS))
            raise HTTPException(HTTPStatus.BAD_REQUEST, f"`do` is one of {known}, not {do!r}.")
        part = part_command(self._store, request.query_params)
        if any(each.status is JobStatus.WORKING for each in self._jobs.values()):
            raise HTTPException(
                TOO_MANY, "Another recording is being exported or verified. Wait, or cancel it."
            )
        # Made at once, so that two requests do not both find none at work.
        folder = self._store.new_folder()
        kept, out = folder / "part.mcap", folder / f"{NAME}{FORMATS.get(do, '')}"
        robot = urdf_options(self._context)
        if do == VERIFY:
            work, made = ("verify", str(kept), "--json", *robot), None
        else:
            described = robot if do in SIMULATED else ()
            work = ("export", str(kept), "--format", do, "--out", str(out), *described)
            made = out
        job = RecordingJob(folder, [(*part, "--out", str(kept)), work], made)
        name = secrets.token_hex(8)
        self._jobs[name] = job
        job.start()
        while len(self._jobs) > MAX_KEPT:
            await self._jobs.popitem(last=False)[1].close()
        return _json({"job": name})

    async def _state(self, request: Request) -> Response:
        """Return status, progress and result of a job."""
        return _json(self._job(request).state())

    async def _file(self, request: Request) -> Response:
        """Return the file that a job has made."""
        job = self._job(request)
        if job.status is not JobStatus.DONE or job.made is None:
            raise HTTPException(NOT_NOW, "There is no file.")
        return FileResponse(job.made, filename=job.made.name)

    async def _cancel(self, request: Request) -> Response:
        """Cancel a job, and remove what it has made."""
        await self._job(request).close()
        return Response(status_code=HTTPStatus.NO_CONTENT)

    def _job(self, request: Request) -> RecordingJob:
        self._check(request)
        job = self._jobs.get(request.path_params["name"])
        if job is None:
            raise HTTPException(HTTPStatus.NOT_FOUND, "The server no longer has that result.")
        return job

    def _check(self, request: Request) -> None:
        if not self._context.identity(request).role.may_drive:
            raise HTTPException(HTTPStatus.FORBIDDEN, "Your role may watch, but not export.")


def _json(found: Any) -> Response:
    return Response(msgspec.json.encode(found), media_type="application/json")
