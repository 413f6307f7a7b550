"""Process that makes or verifies a recording for a page, and ends with the server.

Its argument is a ``JobTask`` as JSON. It prints lines of JSON: the fraction that is done, and at
the end the result.
"""

from __future__ import annotations

import math
import os
import shutil
import sys
import threading
import time
from argparse import Namespace
from pathlib import Path
from typing import Any

import msgspec

from katana450.atomic import write_files, writer_of
from katana450.errors import InputError, KatanaError
from katana450.extensions.progress import report, report_to
from katana450.extensions.recording.files.record_command import export
from katana450.extensions.recording.files.recording_file import RecordingFile
from katana450.extensions.recording.files.simulation import session_for, verified
from katana450.extensions.recording.files.trimming import keep, trim
from katana450.extensions.recording.options import USED
from katana450.extensions.recording.run_again import script_of_part
from katana450.platform_support import lower_priority

FORMATS = {
    "csv": ".csv",
    "rosbag2": "",
    "mp4": ".mp4",
}
"""Formats of exports, and the ends of their names; a folder is packed."""

NAME = "katana450"
"""Name of the files, without their ends."""

PERIOD = 0.2
"""[s] Minimum time between two reports of the progress."""


class JobTask(msgspec.Struct, frozen=True, omit_defaults=True):
    """Work on a part of a recording.

    Attributes:
        make: recording, script (to run the motion again), verify, or one of FORMATS.
        source: the recording, or the folder of the last minutes.
        folder: folder for all that is made.
        urdf: the robot of the server, if it is another than the default.
        start, end: first and last moment of the part [s since the epoch]; None for those of the
            recording.
        last: time before the end of the last minutes [s]; None for all.
    """

    make: str
    source: str
    folder: str
    urdf: str | None = None
    start: float | None = None
    end: float | None = None
    last: float | None = None


class JobReport(msgspec.Struct, omit_defaults=True):
    """Line of a process.

    Attributes:
        fraction: fraction that is done, while it works.
        words: the result; None before it.
        error: the reason why there is no result; None without one.
        file: name of the file in the folder that was made; empty for none.
    """

    fraction: float | None = None
    words: str | None = None
    error: str | None = None
    file: str = ""


class _Reports:
    """Prints the progress."""

    def __init__(self) -> None:
        self._due = 0.0

    def __call__(self, fraction: float) -> None:
        now = time.monotonic()
        if now >= self._due:
            self._due = now + PERIOD
            _print(JobReport(fraction=round(fraction, 4)))


def _print(line: JobReport) -> None:
    print(msgspec.json.encode(line).decode(), flush=True)


def result_of(task: JobTask) -> JobReport:
    """Execute ``task`` and return its result. Raises KatanaError."""
    part = Path(task.folder) / f"{NAME}.mcap"
    _write_part(task, part)
    urdf = None if task.urdf is None else Path(task.urdf)
    words = ""
    match task.make:
        case "recording":
            out, words = part, f"{part.name}."
        case "script":
            out = part.with_name("again.yaml")
            with RecordingFile.open(part) as file:
                # All that was chosen, also of an episode that is trimmed.
                text = script_of_part(file, session_for(file, urdf), 0.0, math.inf)
            write_files({out: writer_of(text.encode())})
        case "verify":
            result = verified(part, urdf, lambda t, length: report(t / length if length else 1.0))
            if not result.ticks:
                raise InputError("The selection has no tick that can be simulated.")
            return JobReport(words=str(result))
        case format:
            out = part.with_name(f"{NAME}{FORMATS[format]}")
            options: dict[str, Any] = dict.fromkeys(USED)
            options |= {"files": [part], "format": format, "out": out, "urdf": urdf}
            words = f"{out.name}: {export(Namespace(**options, start=0.0, end=math.inf))}."
            if out.is_dir():
                out = Path(shutil.make_archive(str(out), "zip", out.parent, out.name))
    return JobReport(words=words, file=out.name)


def _write_part(task: JobTask, out: Path) -> None:
    """Write the part that ``task`` is about to ``out``. Raises InputError."""
    source = Path(task.source)
    start = -math.inf if task.start is None else task.start
    end = math.inf if task.end is None else task.end
    if source.is_file():
        with RecordingFile.open(source) as file:
            offset = file.utc_offset
        trim([source], out, start - offset, end - offset)
    else:
        keep(source, out, math.inf if task.last is None else task.last, (start, end))


def _end_with_server() -> None:
    """End at once when the other end of the input is closed: the server has ended."""
    # Not by a file of Python, whose lock this thread would still hold at the end.
    while os.read(0, 1):
        pass
    os._exit(1)


def main() -> int:
    """Execute the task of the argument and return the exit status."""
    lower_priority()
    threading.Thread(target=_end_with_server, daemon=True).start()
    report_to(_Reports())
    task = msgspec.json.decode(sys.argv[1], type=JobTask)
    try:
        result = result_of(task)
    except KatanaError as error:
        result = JobReport(error=str(error))
    except OSError as error:
        result = JobReport(error=f"{error.strerror or error}.")
    _print(result)
    return 0


if __name__ == "__main__":
    sys.exit(main())
