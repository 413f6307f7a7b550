"""Pipes between processes, which any error in a thread of one end closes."""

from __future__ import annotations

import logging
import os
import socket
import sys
from collections.abc import Callable
from contextlib import suppress
from multiprocessing.connection import Connection

PIPE_ERRORS = (EOFError, OSError)
"""Errors that a pipe raises when its other end is closed."""

log = logging.getLogger(__name__)


class GuardedPipe:
    """A block that any error in it ends; the pipe is then cut, so that the other end notices."""

    def __init__(
        self, pipe: Connection, title: str, on_error: Callable[[], None] = lambda: None
    ) -> None:
        """Guard ``pipe``.

        Args:
            pipe: the pipe that the block serves.
            title: its name for people, at the beginning of a sentence.
            on_error: called after an error, before it is logged.
        """
        self._pipe, self._title, self._on_error = pipe, title, on_error

    def __enter__(self) -> None:
        """Begin the block."""

    def __exit__(self, _kind: object, error: BaseException | None, _traceback: object) -> bool:
        """End the block; return whether an error has ended it."""
        if not isinstance(error, Exception):
            return False
        disconnect(self._pipe)
        self._on_error()
        if not isinstance(error, PIPE_ERRORS):
            log.error("%s met an error and is closed.", self._title, exc_info=error)
        return True


def disconnect(pipe: Connection) -> None:
    """Cut ``pipe`` for both processes. A thread that waits for a message wakes."""
    with suppress(OSError):
        if sys.platform == "win32":
            pipe.close()
        else:
            # To close the descriptor would neither wake a thread nor tell the other process.
            with socket.socket(fileno=os.dup(pipe.fileno())) as end:
                end.shutdown(socket.SHUT_RDWR)
