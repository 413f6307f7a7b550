"""Downloads, exports and verifications of recordings for the page.

Each works in processes of its own, which can be cancelled.
"""

from __future__ import annotations

import asyncio
import math
import os
import secrets
import shutil
import sys
from asyncio.subprocess import PIPE, Process
from collections import OrderedDict
from collections.abc import Mapping
from contextlib import suppress
from enum import Enum
from http import HTTPStatus
from pathlib import Path
from typing import Any

import msgspec
from msgspec import structs
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response
from starlette.routing import Route
from starlette.types import Receive, Scope, Send

from katana450.errors import InputError
from katana450.extensions.recording.live import job_process
from katana450.extensions.recording.live.job_process import FORMATS, JobReport, JobTask
from katana450.extensions.recording.playback.store import RING, RecordingStore
from katana450.server.api.fields import ROOT
from katana450.server.web.bodies import NOT_NOW, TOO_MANY
from katana450.server.web.http_api import RouteContext


class JobStatus(Enum):
    """Status of a job."""

    WORKING = "working"
    DONE = "done"
    FAILED = "failed"
    CANCELLED = "cancelled"


class RecordingJob:
    """A process that makes a file of a recording, or verifies it.

    Attributes:
        status: its status.
        fraction: fraction that is done; None if that is not known.
        words: the result, or the reason why there is none.
        made: the file that was made; None without one.
    """

    def __init__(self, task: JobTask) -> None:
        """Prepare ``task``, which writes to its folder only; ``close`` removes that."""
        self._work, self._folder = task, Path(task.folder)
        self.made: Path | None = None
        self.status = JobStatus.WORKING
        self.fraction: float | None = None
        self.words = ""
        self._task: asyncio.Task[None] | None = None

    def start(self) -> None:
        """Begin, in the running event loop."""
        self._task = asyncio.create_task(self._run())

    async def done_within(self, seconds: float) -> None:
        """Do the work. Raises InputError, and TimeoutError after ``seconds`` [s]."""
        task = self._task = asyncio.create_task(self._run())
        await asyncio.wait_for(task, seconds)
        if self.status is not JobStatus.DONE:
            raise InputError(self.words)

    async def close(self) -> None:
        """Cancel what is not done, and remove all that was made."""
        if self._task is not None and not self._task.done():
            self._task.cancel()
            await asyncio.wait([self._task])
        self.status, self.made = JobStatus.CANCELLED, None
        await asyncio.to_thread(shutil.rmtree, self._folder, ignore_errors=True)

    def state(self) -> dict[str, Any]:
        """Return status, fraction and words as JSON values."""
        return {"status": self.status.value, "fraction": self.fraction, "words": self.words}

    async def _run(self) -> None:
        try:
            result = await self._result()
        except asyncio.CancelledError:
            self.status, self.words = JobStatus.CANCELLED, "It was cancelled."
            raise
        except (OSError, msgspec.MsgspecError) as error:
            result = JobReport(error=f"The process failed: {error}.")
        if result.words is None:
            # The folder says nothing to the person.
            why = (result.error or "").replace(f"{self._folder}{os.sep}", "")
            self.status, self.words = JobStatus.FAILED, why
            return
        self.status, self.fraction, self.words = JobStatus.DONE, 1.0, result.words
        self.made = self._folder / result.file if result.file else None

    async def _result(self) -> JobReport:
        """Return the last line of the process."""
        temporary = dict.fromkeys(("TMPDIR", "TEMP", "TMP"), str(self._folder))
        process = await asyncio.create_subprocess_exec(
            *(sys.executable, "-P", "-m", job_process.__name__),
            msgspec.json.encode(self._work).decode(),
            stdin=PIPE,
            stdout=PIPE,
            # A process that is killed leaves its temporary files in the folder too.
            env={**os.environ, **temporary},
        )
        try:
            result = await self._followed(process)
            await process.wait()
        finally:
            if process.returncode is None:
                with suppress(ProcessLookupError):
                    process.kill()
                await process.wait()
        return result or JobReport(error=f"It ended with {process.returncode}.")

    async def _followed(self, process: Process) -> JobReport | None:
        """Take the progress of ``process``; return its result, None if it ended without one."""
        assert process.stdout is not None
        async for line in process.stdout:
            report = msgspec.json.decode(line, type=JobReport)
            if report.fraction is None:
                return report
            # A bar that moves back says nothing about the time that is left.
            self.fraction = max(report.fraction, self.fraction or 0.0)
        return None


TIMEOUT = 60.0
"""[s] Timeout for making a file of ten minutes."""

VERIFY = "verify"
"""Value of the parameter ``do`` for a verification, beside the formats."""

MAX_KEPT = 3
"""Number of jobs whose results are kept; the one that was begun first is removed."""


class RecordingRoutes:
    """The HTTP routes of recordings: of the last minutes, or of a file that somebody opened.

    One export works at a time, so that it does not slow the page down.
    """

    def __init__(self, context: RouteContext, store: RecordingStore) -> None:
        """Work on the recordings of ``store``, which has the ring and the opened files."""
        self._context, self._store = context, store
        self._working = asyncio.Lock()
        self._jobs: OrderedDict[str, RecordingJob] = OrderedDict()
        # The robot of the server, if it is another than the default.
        urdf = getattr(context.options, "urdf", None)
        self._urdf = None if urdf is None else str(urdf)

    def routes(self) -> list[Route]:
        """Return all routes."""
        path = f"{ROOT}/recording"
        return [
            Route(path, self._recording),
            Route(f"{path}/script", self._script),
            Route(f"{path}/jobs", self._begin, methods=["POST"]),
            Route(f"{path}/jobs/{{name}}", self._state),
            Route(f"{path}/jobs/{{name}}/file", self._file),
            Route(f"{path}/jobs/{{name}}/cancel", self._cancel, methods=["POST"]),
        ]

    async def _recording(self, request: Request) -> Response:
        """Return a recording of the part that is asked for."""
        # Sent in parts: up to 200 MB.
        return _Download(await self._made(request, "recording"))

    async def _script(self, request: Request) -> Response:
        """Return the script that runs the recorded motion again."""
        job = await self._made(request, "script")
        try:
            assert job.made is not None
            text = await asyncio.to_thread(job.made.read_bytes)
        finally:
            await job.close()
        return Response(text, media_type="application/yaml")

    async def _made(self, request: Request, make: str) -> RecordingJob:
        """Return the job that has made the file. Raises HTTPException."""
        self._context.driver(request, "record")
        task = job_task(self._store, request.query_params, make, self._urdf)
        if self._working.locked():
            raise HTTPException(TOO_MANY, "Another recording is being made. Wait a moment.")
        async with self._working:
            folder = await asyncio.to_thread(self._store.new_folder)
            job = RecordingJob(structs.replace(task, folder=str(folder)))
            try:
                await job.done_within(TIMEOUT)
            except BaseException as error:
                await job.close()
                if isinstance(error, InputError):
                    raise HTTPException(NOT_NOW, str(error)) from error
                if isinstance(error, TimeoutError):
                    why = f"The recording took more than {TIMEOUT:g} s."
                    raise HTTPException(HTTPStatus.SERVICE_UNAVAILABLE, why) from error
                raise
            return job

    async def _begin(self, request: Request) -> Response:
        """Begin a job, and return its name."""
        self._context.driver(request, "export")
        do = request.query_params.get("do", "")
        if do not in (kinds := (VERIFY, *FORMATS, "recording")):
            known = ", ".join(kinds)
            raise HTTPException(HTTPStatus.BAD_REQUEST, f"`do` is one of {known}, not {do!r}.")
        task = job_task(self._store, request.query_params, do, self._urdf)
        if any(earlier.status is JobStatus.WORKING for earlier in self._jobs.values()):
            raise HTTPException(
                TOO_MANY, "Another recording is being exported or verified. Wait, or cancel it."
            )
        # Made at once, so that two requests do not both find none at work.
        job = RecordingJob(structs.replace(task, folder=str(self._store.new_folder())))
        name = secrets.token_hex(8)
        self._jobs[name] = job
        job.start()
        while len(self._jobs) > MAX_KEPT:
            await self._jobs.popitem(last=False)[1].close()
        return JSONResponse({"job": name})

    async def _state(self, request: Request) -> Response:
        """Return status, progress and result of a job."""
        return JSONResponse(self._job(request).state())

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
        self._context.driver(request, "export")
        job = self._jobs.get(request.path_params["name"])
        if job is None:
            raise HTTPException(HTTPStatus.NOT_FOUND, "The server no longer has that result.")
        return job


class _Download(FileResponse):
    """The answer with a recording, whose folder is removed however the sending ends."""

    def __init__(self, job: RecordingJob) -> None:
        assert job.made is not None
        name, kind = job.made.name, "application/octet-stream"
        super().__init__(job.made, filename=name, media_type=kind)
        self._job = job

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        try:
            await super().__call__(scope, receive, send)
        finally:
            await self._job.close()


def job_task(
    store: RecordingStore, query: Mapping[str, str], make: str, urdf: str | None
) -> JobTask:
    """Return the work ``make`` on the part that ``query`` names, still without a folder.

    Raises HTTPException.
    """
    times = {name: _seconds(query, name) for name in ("last", "from", "to") if name in query}
    name = query.get("of", RING)
    try:
        store.run(name)
        source = store.ring if name == RING else store.file(name)
    except InputError as error:
        raise HTTPException(HTTPStatus.NOT_FOUND, str(error)) from error
    part = times.get("from"), times.get("to"), times.get("last")
    return JobTask(make, str(source), "", urdf, *part)


def _seconds(query: Mapping[str, str], name: str) -> float:
    try:
        value = float(query[name])
    except ValueError:
        value = math.nan
    if not value > 0.0:
        raise HTTPException(HTTPStatus.BAD_REQUEST, f"`{name}` is a number of seconds above 0.")
    return value
