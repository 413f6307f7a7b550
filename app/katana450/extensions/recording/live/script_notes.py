"""Notes of scripts that run, from the page's server to the process that records.

A note is a file in a folder beside the ring. So it waits while either process is started again, and
a script that runs for long is attached to the next file of the ring too.
"""

from __future__ import annotations

import logging
import threading
import time
from pathlib import Path
from queue import SimpleQueue
from typing import NamedTuple

import msgspec

from katana450.atomic import write_files, writer_of
from katana450.errors import InputError

BEGUN, ENDED = ".begun", ".ended"
"""Suffixes of the two files of a note."""

MAX_NOTES = 100
"""Number of notes that wait for the process that records, each with a script of up to 64 KB."""

MAX_DRIFT = 60.0
"""[s] Change of the time of day during a run of the server; a larger one means an older run."""

log = logging.getLogger(__name__)


class NotedRun(NamedTuple):
    """A run of a script.

    Attributes:
        name: name of the script.
        text: its text, with those of all files that it names.
        began: time at which it began [s].
        ended: time at which it ended [s]; None while it runs.
    """

    name: str
    text: str
    began: float
    ended: float | None = None


class _Begun(msgspec.Struct):
    """Content of the first file; ``utc_offset`` tells notes of other starts of the machine."""

    name: str
    text: str
    began: float
    utc_offset: float


class _Ended(msgspec.Struct):
    """Content of the second file."""

    ended: float


def notes_folder(ring: Path, port: int) -> Path:
    """Return the folder of the notes for the ring in ``ring`` of the server on ``port``."""
    return ring.absolute() / f".scripts-{port}"


def _utc_offset() -> float:
    return time.time() - time.perf_counter()


class ScriptNoter:
    """Writes notes, in a thread of its own, because a disk may take its time."""

    def __init__(self, folder: Path) -> None:
        """Write to ``folder``, which need not exist. Scripts of an earlier process have ended."""
        self._folder = folder
        self._waiting: SimpleQueue[NotedRun] = SimpleQueue()
        self.waits = False
        """Whether a note is not on the disk yet."""
        threading.Thread(target=self._write, name="script notes", daemon=True).start()

    def note(self, name: str, text: str, began: float, ended: float | None) -> None:
        """Note that a script has begun, or ended. Returns at once."""
        self.waits = True
        self._waiting.put(NotedRun(name, text, began, ended))

    def _write(self) -> None:
        self._end_earlier()
        while True:
            run = self._waiting.get()
            try:
                self._write_one(run)
            except (InputError, OSError) as error:
                log.warning("The script %s is not attached to the recording: %s", run.name, error)
            self.waits = not self._waiting.empty()

    def _end_earlier(self) -> None:
        """End the notes of a process that was killed."""
        for path in self._folder.glob(f"*{BEGUN}"):
            ended = path.with_suffix(ENDED)
            if not ended.exists():
                try:
                    _put(ended, _Ended(time.perf_counter()))
                except InputError as error:
                    log.warning("%s", error)

    def _write_one(self, run: NotedRun) -> None:
        path = self._folder / f"{round(1e6 * run.began):020d}{BEGUN}"
        if run.ended is not None:
            if path.exists():
                _put(path.with_suffix(ENDED), _Ended(run.ended))
            return
        self._folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        if sum(1 for _ in self._folder.glob(f"*{BEGUN}")) >= MAX_NOTES:
            raise InputError("The process that records has not taken the scripts before it.")
        _put(path, _Begun(run.name, run.text, run.began, _utc_offset()))


def _put(path: Path, content: msgspec.Struct) -> None:
    write_files({path: writer_of(msgspec.json.encode(content))}, mode=0o600)


class ScriptReader:
    """Reads the notes, in the process that records. For use in one thread."""

    def __init__(self, folder: Path) -> None:
        """Read from ``folder``, which need not exist."""
        self._folder = folder
        self._known: dict[str, NotedRun] = {}
        self._done: list[str] = []

    def read(self) -> list[NotedRun]:
        """Return the runs that have not ended before the last call.

        The files of those that have ended are removed with the next call: they are recorded then.
        """
        for stem in self._done:
            for suffix in (BEGUN, ENDED):
                (self._folder / f"{stem}{suffix}").unlink(missing_ok=True)
            self._known.pop(stem, None)
        self._done = []
        found = sorted(path.stem for path in self._folder.glob(f"*{BEGUN}"))
        return [run for stem in found if (run := self._run(stem)) is not None]

    def _run(self, stem: str) -> NotedRun | None:
        """Return the run of the note ``stem``; None for a damaged note, and for an old one."""
        try:
            if stem not in self._known:
                begun = msgspec.json.decode(self._content(stem, BEGUN), type=_Begun)
                if abs(begun.utc_offset - _utc_offset()) > MAX_DRIFT:
                    raise ValueError("it is of an earlier run")
                self._known[stem] = NotedRun(begun.name, begun.text, begun.began)
            run = self._known[stem]
            if (self._folder / f"{stem}{ENDED}").exists():
                ended = msgspec.json.decode(self._content(stem, ENDED), type=_Ended).ended
                run = run._replace(ended=ended)
        except (OSError, ValueError) as error:
            log.warning("The note %s of a script is left out: %s.", stem, error)
            self._done.append(stem)
            return None
        if run.ended is not None:
            self._done.append(stem)
        return run

    def _content(self, stem: str, suffix: str) -> bytes:
        return (self._folder / f"{stem}{suffix}").read_bytes()
