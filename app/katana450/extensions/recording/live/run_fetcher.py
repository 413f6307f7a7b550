"""The recording of a run that has just ended on a server."""

from __future__ import annotations

import time
from pathlib import Path

from katana450.client import Client
from katana450.client.files import LostError, RefusedError
from katana450.extensions.recording.files.recording_file import RecordingFile
from katana450.server.api import answers

ON_DISK = 10.0
"""[s] Timeout for the end of the run in the recording of the server."""

FIRST_FILE = 3.0
"""[s] Timeout for the first file of a server, which comes about a second after its first motion."""

POLL_PERIOD = 0.5
"""[s] Time between two looks at it."""

SAME_TICK = 1e-3
"""[s] Largest difference of the times of one tick."""


def fetch_run(client: Client, began: float, path: Path) -> None:
    """Write the recording since the time ``began`` [s] of the server's clock to ``path``.

    It may begin earlier. Raises RefusedError if the server records nothing, and LostError if the
    present state does not appear in its recording.
    """
    due = time.monotonic() + ON_DISK
    ended = client.query(answers.State)
    first_due = time.monotonic() + FIRST_FILE
    while time.monotonic() < due:
        try:
            path.write_bytes(client.recording(ended.sent - began + ON_DISK))
        except RefusedError:
            if time.monotonic() > first_due:
                raise
        else:
            with RecordingFile.open(path) as file:
                # The server writes once a second.
                if file.end >= ended.t - SAME_TICK:
                    return
        time.sleep(POLL_PERIOD)
    raise LostError(f"the server has not written the end of the run within {ON_DISK:g} s.")
