"""Base class of the event log of a server. The extension ``event_log`` overrides it."""

from __future__ import annotations

from multiprocessing.connection import Connection


class ServerLog:
    """The event log, seen from the process that starts the others. This base class keeps none.

    No method waits for a disk, except ``close``.
    """

    @property
    def description(self) -> tuple[str, ...]:
        """Lines for the terminal on where the log is."""
        return ()

    def attach(self, pipe: Connection) -> None:
        """Write the records that another process sends by ``pipe``."""
        pipe.close()

    def restart(self, process: str, status: int | None) -> None:
        """Record that ``process`` ended with ``status``, and is started again."""

    def close(self, *, requested: bool) -> None:
        """Record the end of the server, and write what waits. ``requested``: by a signal."""
