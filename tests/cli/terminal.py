"""A command of the app at a pseudo-terminal."""

from __future__ import annotations

import os
import subprocess
import time
from pathlib import Path

import pytest

pty = pytest.importorskip("pty", reason="Windows has no pseudo-terminals")

ROOT = Path(__file__).resolve().parents[2]


class Terminal:
    """A command at a pseudo-terminal."""

    def __init__(self, *command: str) -> None:
        self._end, inner = pty.openpty()
        self.process = subprocess.Popen(command, stdin=inner, stdout=inner, stderr=inner, cwd=ROOT)
        os.close(inner)
        os.set_blocking(self._end, False)
        self.text = ""

    def read(self) -> str:
        """Return everything that was printed."""
        try:
            while data := os.read(self._end, 10_000):
                self.text += data.decode()
        except (BlockingIOError, OSError):
            pass
        return self.text

    def wait_for(self, text: str, seconds: float = 30.0) -> None:
        """Wait until ``text`` is printed after what was waited for before."""
        due = time.monotonic() + seconds
        while text not in self.read():
            assert time.monotonic() < due, self.text
            time.sleep(0.05)
        self.text = self.text.split(text, 1)[1]

    def type(self, text: str) -> None:
        os.write(self._end, text.encode())

    def close(self) -> None:
        self.process.kill()
        self.process.wait()
        os.close(self._end)
