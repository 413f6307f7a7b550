"""Output of a server, which must run even where nothing can be written.

Clients can neither forge nor multiply log lines: their texts can neither begin a line nor colour
one, and a flood of events makes few lines.
"""

from __future__ import annotations

import logging
import os
import sys
import time
from contextlib import suppress

FORMAT = "%(asctime)s %(levelname)s %(message)s"

CONTINUED = "    | "
"""Begins each further line of an entry, as in a traceback."""

BURST, RATE = 20.0, 0.5
"""Entries with the same text, apart from its values, in a burst and per second afterwards."""

MAX_TEXTS = 512
"""Maximum number of texts whose entries are counted."""


class RepetitionFilter(logging.Filter):
    """Drops entries of a flood. The next entry of that text states how many were dropped."""

    def __init__(self) -> None:
        super().__init__()
        self._left: dict[tuple[str, str], tuple[float, float, int]] = {}

    def filter(self, record: logging.LogRecord) -> bool:
        """Return whether ``record`` is printed, and set its ``dropped`` entries before it."""
        key = (record.name, str(record.msg))
        t = time.monotonic()
        left, before, dropped = self._left.pop(key, (BURST, t, 0))
        left = min(BURST, left + RATE * (t - before))
        printed = left >= 1.0
        record.dropped = dropped if printed else 0
        self._left[key] = (left - 1.0, t, 0) if printed else (left, t, dropped + 1)
        while len(self._left) > MAX_TEXTS:
            self._left.pop(next(iter(self._left)))
        return printed


def printable(text: str) -> str:
    """Return ``text`` with every character escaped that is not printable.

    These are line breaks of any kind, control and format characters, and lone surrogates.
    """
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


class LineFormatter(logging.Formatter):
    """Formats each entry as one line, whatever its message; tracebacks follow on marked lines."""

    def __init__(self) -> None:
        super().__init__(FORMAT)

    def formatMessage(self, record: logging.LogRecord) -> str:
        """Return the message as one line."""
        dropped = getattr(record, "dropped", 0)
        more = f" (and {dropped} more such lines before)" if dropped else ""
        record.message = printable(record.message) + more
        return super().formatMessage(record)

    def format(self, record: logging.LogRecord) -> str:
        """Return the entry with its further lines marked."""
        first, *rest = super().format(record).split("\n")
        return "\n".join([printable(first), *(CONTINUED + printable(line) for line in rest)])


def start_log() -> None:
    """Log errors, warnings and changes of the driver to standard error."""
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(LineFormatter())
    handler.addFilter(RepetitionFilter())
    logging.basicConfig(handlers=[handler])
    logging.getLogger("katana450").setLevel(logging.INFO)


def say(text: str) -> None:
    """Print ``text`` at once. If that fails, report it on standard error and print nothing more."""
    try:
        print(text, flush=True)
    except OSError as error:
        drop_output(error)


def drop_output(error: OSError) -> None:
    """Report that standard output cannot be written, and discard it from now on."""
    # The rest of the buffer is written at the end of the process, which would fail again.
    with suppress(OSError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, sys.stdout.fileno())
        os.close(nowhere)
    print(f"katana450: The output cannot be written: {error.strerror}.", file=sys.stderr)
