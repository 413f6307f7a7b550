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
from collections.abc import Mapping, Sequence
from contextlib import suppress
from enum import Enum
from http import HTTPStatus
from pathlib import Path
from typing import Any

import msgspec
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import FileResponse, Response
from starlette.routing import Route
from starlette.types import Receive, Scope, Send

from katana450.errors import InputError
from katana450.extensions.recording.playback.store import RING, RecordingStore
from katana450.extensions.recording.ticks import Verification
from katana450.server.api.fields import ROOT
from katana450.server.web.bodies import NOT_NOW, TOO_MANY
from katana450.server.web.http_api import RouteContext

PROCESS = "katana450.extensions.recording.live.job_process"
"""Module that runs in the processes."""

MAX_ERRORS = 4000
"""Number of bytes of the errors of a process that are kept."""


class JobStatus(Enum):
    """Status of a job."""

    WORKING = "working"
    DONE = "done"
    FAILED = "failed"
    CANCELLED = "cancelled"


class JobError(Exception):
    """Raised with the reason if a process of a job fails."""


class RecordingJob:
    """Commands ``katana450 record`` that run one after another, for a file or a verification.

    Attributes:
        status: its status.
        fraction: fraction of the present command that is done; None if that is not known.
        words: the result, or the reason why there is none.
        made: the file that the last command makes; None if it makes none.
    """

    def __init__(self, folder: Path, commands: Sequence[Sequence[str]], made: Path | None) -> None:
        """Prepare ``commands``, which write to ``folder`` only; ``close`` removes it."""
        self._folder, self._commands = folder, commands
        self.made = made
        self.status = JobStatus.WORKING
        self.fraction: float | None = None
        self.words = ""
        self._task: asyncio.Task[None] | None = None

    def start(self) -> None:
        """Begin, in the running event loop."""
        self._task = asyncio.create_task(self._run())

    async def done_within(self, seconds: float) -> None:
        """Do the work. Raises JobError with the reason, and TimeoutError after ``seconds`` [s]."""
        task = self._task = asyncio.create_task(self._run())
        await asyncio.wait_for(task, seconds)
        if self.status is not JobStatus.DONE:
            raise JobError(self.words)

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
            for command in self._commands:
                self.fraction = None
                self.words = await self._result(command)
            if self.made is not None and self.made.is_dir():
                self.made = await asyncio.to_thread(_packed, self.made)
        except asyncio.CancelledError:
            self.status, self.words = JobStatus.CANCELLED, "It was cancelled."
            raise
        except JobError as error:
            self.status, self.words = JobStatus.FAILED, str(error)
        except OSError as error:
            self.status, self.words = JobStatus.FAILED, f"{error.strerror or error}."
        else:
            self.status, self.fraction = JobStatus.DONE, 1.0

    async def _result(self, command: Sequence[str]) -> str:
        """Return the last line of the output of ``command``. Raises JobError with the reason."""
        temporary = dict.fromkeys(("TMPDIR", "TEMP", "TMP"), str(self._folder))
        process = await asyncio.create_subprocess_exec(
            *(sys.executable, "-P", "-m", PROCESS, *command),
            stdin=PIPE,
            stdout=PIPE,
            stderr=PIPE,
            # A process that is killed leaves its temporary files in the folder too.
            env={**os.environ, **temporary},
        )
        try:
            last, errors = await asyncio.gather(self._followed(process), _errors(process))
            await process.wait()
        finally:
            if process.returncode is None:
                with suppress(ProcessLookupError):
                    process.kill()
                await process.wait()
        result = _verification(last)
        if result is not None:
            return result
        if process.returncode:
            why = errors.removeprefix("katana450: ") or f"It ended with {process.returncode}."
            raise JobError(self._named(why))
        return self._named(last)

    def _named(self, text: str) -> str:
        """Return ``text`` without the folder, which says nothing to the person."""
        return text.replace(f"{self._folder}{os.sep}", "")

    async def _followed(self, process: Process) -> str:
        """Take the progress of ``process``; return its last line that is another one."""
        assert process.stdout is not None
        last = ""
        async for line in process.stdout:
            text = line.decode(errors="replace").strip()
            try:
                found = msgspec.json.decode(text, type=Progress).fraction
                # A bar that moves back says nothing about the time that is left.
                self.fraction = max(found, self.fraction or 0.0)
            except msgspec.MsgspecError:
                last = text or last
        return last


class Progress(msgspec.Struct):
    """Line with the progress of a process."""

    fraction: float


class _Refused(msgspec.Struct):
    """Line of a verification that was not possible."""

    error: str


def _verification(line: str) -> str | None:
    """Return the result of a verification in ``line``; None for another line.

    Raises JobError with the reason if there was none.
    """
    with suppress(msgspec.MsgspecError):
        raise JobError(msgspec.json.decode(line, type=_Refused).error)
    try:
        found = msgspec.json.decode(line, type=Verification)
    except msgspec.MsgspecError:
        return None
    if not found.ticks:
        raise JobError("The selection has no tick that can be simulated.")
    return str(found)


async def _errors(process: Process) -> str:
    """Return the errors of ``process``, the newest if there are many."""
    assert process.stderr is not None
    kept = b""
    while part := await process.stderr.read(MAX_ERRORS):
        kept = (kept + part)[-MAX_ERRORS:]
    return kept.decode(errors="replace").strip()


def _packed(folder: Path) -> Path:
    """Return an archive of ``folder``, which it replaces."""
    path = shutil.make_archive(str(folder), "zip", folder.parent, folder.name)
    shutil.rmtree(folder)
    return Path(path)


TIMEOUT = 60.0
"""[s] Timeout for making a file of ten minutes."""

FORMATS = {
    "csv": ".csv",
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
        self._robot = () if urdf is None else ("--urdf", str(urdf))

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
        return _Download(await self._made(request, script=False))

    async def _script(self, request: Request) -> Response:
        """Return the script that runs the recorded motion again."""
        job = await self._made(request, script=True)
        try:
            assert job.made is not None
            text = await asyncio.to_thread(job.made.read_bytes)
        finally:
            await job.close()
        return Response(text, media_type="application/yaml")

    async def _made(self, request: Request, *, script: bool) -> RecordingJob:
        """Return the job that has made the file. Raises HTTPException."""
        self._check(request, "record")
        part = part_command(self._store, request.query_params)
        if self._working.locked():
            raise HTTPException(TOO_MANY, "Another recording is being made. Wait a moment.")
        async with self._working:
            folder = await asyncio.to_thread(self._store.new_folder)
            kept, again = folder / f"{NAME}.mcap", folder / "again.yaml"
            commands: list[tuple[str, ...]] = [(*part, "--out", str(kept))]
            if script:
                # All that was chosen, also of an episode that is trimmed.
                whole = ("again", str(kept), "--from", "0", "--to", "inf")
                commands.append((*whole, *self._robot, "--out", str(again)))
            job = RecordingJob(folder, commands, again if script else kept)
            try:
                await job.done_within(TIMEOUT)
            except BaseException as error:
                await job.close()
                if isinstance(error, JobError):
                    raise HTTPException(NOT_NOW, str(error)) from error
                if isinstance(error, TimeoutError):
                    why = f"The recording took more than {TIMEOUT:g} s."
                    raise HTTPException(HTTPStatus.SERVICE_UNAVAILABLE, why) from error
                raise
            return job

    async def _begin(self, request: Request) -> Response:
        """Begin a job, and return its name."""
        self._check(request, "export")
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
        if do == VERIFY:
            work, made = ("verify", str(kept), "--json", *self._robot), None
        else:
            described = self._robot if do in SIMULATED else ()
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
        self._check(request, "export")
        job = self._jobs.get(request.path_params["name"])
        if job is None:
            raise HTTPException(HTTPStatus.NOT_FOUND, "The server no longer has that result.")
        return job

    def _check(self, request: Request, act: str) -> None:
        if not self._context.identity(request).role.may_drive:
            raise HTTPException(HTTPStatus.FORBIDDEN, f"Your role may watch, but not {act}.")


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


def _json(found: Any) -> Response:
    return Response(msgspec.json.encode(found), media_type="application/json")
