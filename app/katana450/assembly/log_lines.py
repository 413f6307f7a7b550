"""Log lines that nobody can forge: what came from outside can start no line and colour nothing."""

from __future__ import annotations

import logging
import sys

FORMAT = "%(asctime)s %(levelname)s %(message)s"

CONTINUED = "    | "
"""Begins every further line of an entry: those of a traceback."""


def printable(text: str) -> str:
    """``text`` with every character escaped that is not printable: line breaks of any kind,
    control and format characters, lone surrogates.
    """
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


class LineFormatter(logging.Formatter):
    """One line an entry, whatever its message holds; tracebacks follow on marked lines."""

    def __init__(self) -> None:
        super().__init__(FORMAT)

    def formatMessage(self, record: logging.LogRecord) -> str:
        record.message = printable(record.message)
        return super().formatMessage(record)

    def format(self, record: logging.LogRecord) -> str:
        first, *rest = super().format(record).split("\n")
        return "\n".join([printable(first), *(CONTINUED + printable(line) for line in rest)])


def start_log() -> None:
    """Write what goes wrong, and who drove, to standard error."""
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(LineFormatter())
    logging.basicConfig(handlers=[handler])
    logging.getLogger("katana450").setLevel(logging.INFO)
