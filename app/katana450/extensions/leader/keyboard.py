"""The lines that a person types at the terminal while a leader drives the arm."""

from __future__ import annotations

import queue
import sys
import threading


class Keyboard:
    """The typed lines, read in a thread. Without a terminal there are none.

    Attributes:
        present: whether a person can type.
    """

    def __init__(self) -> None:
        """Start the thread if standard input is a terminal."""
        self.present = sys.stdin is not None and sys.stdin.isatty()
        self._lines: queue.Queue[str] = queue.Queue()
        if self.present:
            threading.Thread(target=self._read, name="keyboard", daemon=True).start()

    def line(self) -> str | None:
        """Return the next line that was typed; None if there is none."""
        try:
            return self._lines.get_nowait()
        except queue.Empty:
            return None

    def _read(self) -> None:
        for line in sys.stdin:
            self._lines.put(line.strip())
