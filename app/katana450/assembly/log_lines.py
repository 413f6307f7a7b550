"""Log lines that clients cannot forge: their texts can neither begin a line nor colour one."""

from __future__ import annotations

import logging
import sys

FORMAT = "%(asctime)s %(levelname)s %(message)s"

CONTINUED = "    | "
"""Begins each further line of an entry, as in a traceback."""


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
        record.message = printable(record.message)
        return super().formatMessage(record)

    def format(self, record: logging.LogRecord) -> str:
        """Return the entry with its further lines marked."""
        first, *rest = super().format(record).split("\n")
        return "\n".join([printable(first), *(CONTINUED + printable(line) for line in rest)])


def start_log() -> None:
    """Log errors, warnings and changes of the driver to standard error."""
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(LineFormatter())
    logging.basicConfig(handlers=[handler])
    logging.getLogger("katana450").setLevel(logging.INFO)
