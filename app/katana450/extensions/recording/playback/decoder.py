"""The subprocess that decodes a file which somebody has opened.

``OpenedRun`` starts it as ``python -m katana450.extensions.recording.playback.decoder FILE``. It
limits its memory before it reads the file, answers requests one after another, and ends with its
input. A request is a JSON line, ``[method, arguments]``. An answer is a pickle after its length:
whether it was successful, and the result or the reason.
"""

from __future__ import annotations

import json
import pickle
import struct
import sys
from pathlib import Path
from typing import Any, BinaryIO

from katana450.errors import InputError
from katana450.extensions.recording.playback.run import PlaybackRun
from katana450.platform_support import limit_resources

MAX_MEMORY_BYTES = 3_000_000_000
"""Maximum address space, a part of which libraries only reserve."""

MAX_SECONDS = 3600
"""[s] Maximum processor time of all requests for one file."""

LENGTH = struct.Struct("<Q")
"""Length of an answer [bytes]."""


class DecodedRun:
    """The methods that requests name."""

    def __init__(self, path: Path) -> None:
        self._run = PlaybackRun(lambda: [path])

    def update(self) -> tuple[Any, ...]:
        """Read the index, and return the spans and the metadata."""
        self._run.update()
        return self._run.spans, self._run.metadata

    def marks(self) -> Any:
        """See ``PlaybackRun.marks``."""
        return self._run.marks()

    def at(self, t: float) -> Any:
        """See ``PlaybackRun.at``."""
        return self._run.at(t)

    def rows_at(self, times: list[float]) -> Any:
        """See ``PlaybackRun.rows_at``."""
        return self._run.rows_at(times)


def answer(run: DecodedRun, request: bytes) -> bytes:
    """Return the answer to ``request``, with its length before it."""
    method, arguments = json.loads(request)
    try:
        found = True, getattr(run, method)(*arguments)
    except InputError as error:
        found = False, str(error)
    except MemoryError:
        found = False, "The file needs too much memory."
    content = pickle.dumps(found, pickle.HIGHEST_PROTOCOL)
    return LENGTH.pack(len(content)) + content


def serve(path: Path, requests: BinaryIO, answers: BinaryIO) -> None:
    """Answer ``requests`` about the file ``path`` until they end."""
    run = DecodedRun(path)
    for request in requests:
        answers.write(answer(run, request))
        answers.flush()


if __name__ == "__main__":
    limit_resources(MAX_MEMORY_BYTES, MAX_SECONDS)
    serve(Path(sys.argv[1]), sys.stdin.buffer, sys.stdout.buffer)
