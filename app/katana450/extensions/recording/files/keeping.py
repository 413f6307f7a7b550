"""Keeping what has just happened: the newest files of a ring become one recording."""

from __future__ import annotations

import math
import shutil
import tempfile
from pathlib import Path

from katana450.errors import InputError
from katana450.extensions.recording.files.recording_file import RecordingFile
from katana450.extensions.recording.files.recovery import is_whole, recover
from katana450.extensions.recording.files.trimming import Trimmed, trim
from katana450.extensions.recording.folders import recordings_in

ALL = -math.inf, math.inf


def keep(
    folder: Path, out: Path, last: float = math.inf, part: tuple[float, float] = ALL
) -> Trimmed:
    """Write the last seconds of the ring in ``folder`` to ``out``; return what was written.

    The server may still write: of its present file, the part that is on the disk is taken. Only
    files of the newest run of the server are joined.

    Args:
        folder: folder of the ring.
        out: the new file.
        last: time before the end of the recording [s].
        part: its first and last moment [s since the epoch].

    Raises:
        InputError: the folder has no recording, or ``out`` cannot be written.
    """
    with tempfile.TemporaryDirectory(prefix="katana450-") as temporary:
        copies: list[Path] = []
        run: str | None = None
        for path in reversed(recordings_in(folder)):
            copy = whole_copy(path, Path(temporary) / path.name)
            if copy is None:
                continue
            with RecordingFile.open(copy) as file:
                this, empty = file.metadata.get("utc_offset_ns"), not any(file.counts().values())
            if run not in (None, this):
                break
            run = this
            if not empty:
                copies.append(copy)
        if not copies:
            raise InputError(
                f"{folder} has no recording. A server names its folder at the start; nothing is "
                "recorded while the arm rests."
            )
        with RecordingFile.open(copies[0]) as newest:
            end, offset = newest.end, newest.utc_offset
        start, stop = (t - offset for t in part)
        return trim(copies, out, max(end - last, start), min(end, stop))


def whole_copy(path: Path, copy: Path) -> Path | None:
    """Return a whole copy of ``path`` at ``copy``; None if nothing of it can be read."""
    try:
        shutil.copyfile(path, copy)
        if not is_whole(copy):
            recover(copy, copy)
    except InputError:
        return None
    except OSError:
        # The server has removed it meanwhile.
        return None
    return copy
