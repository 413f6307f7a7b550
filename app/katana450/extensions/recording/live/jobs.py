"""Exports and verifications for the page, each in processes of its own that can be cancelled."""

from __future__ import annotations

import asyncio
import os
import shutil
import sys
from asyncio.subprocess import PIPE, Process
from collections.abc import Sequence
from contextlib import suppress
from enum import Enum
from pathlib import Path
from typing import Any

import msgspec

from katana450.extensions.recording.replay import Verification

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
