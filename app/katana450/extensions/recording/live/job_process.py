"""Process that runs ``katana450 record`` for a page, and ends with the server.

It prints the fraction that is done as lines of JSON, between those of the command.
"""

from __future__ import annotations

import json
import os
import sys
import threading
import time

from katana450.cli.main import main as run
from katana450.extensions.progress import report_to
from katana450.platform_support import lower_priority

PERIOD = 0.2
"""[s] Minimum time between two reports of the progress."""


class _Reports:
    """Prints the progress."""

    def __init__(self) -> None:
        self._due = 0.0

    def __call__(self, fraction: float) -> None:
        now = time.monotonic()
        if now >= self._due:
            self._due = now + PERIOD
            print(json.dumps({"fraction": round(fraction, 4)}), flush=True)


def _end_with_server() -> None:
    """End at once when the other end of the input is closed: the server has ended."""
    # Not by a file of Python, whose lock this thread would still hold at the end.
    while os.read(0, 1):
        pass
    os._exit(1)


def main() -> int:
    """Run the command of the arguments and return its exit status."""
    lower_priority()
    threading.Thread(target=_end_with_server, daemon=True).start()
    report_to(_Reports())
    return run(["record", *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
