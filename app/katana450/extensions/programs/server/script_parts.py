"""Parts of scripts that are longer than one message."""

from __future__ import annotations

from katana450.errors import InputError
from katana450.extensions.programs.source import MAX_BYTES


class ScriptParts:
    """The parts of each sender's script so far."""

    def __init__(self) -> None:
        """Create it without parts."""
        self._parts: dict[str, str] = {}

    def add(self, key: str, text: str, *, more: bool) -> str | None:
        """Add ``text`` of the sender ``key``; return its whole script, or None if ``more`` follows.

        Raises InputError for too long a script, whose parts are then forgotten.
        """
        text = self._parts.pop(key, "") + text
        if len(text.encode()) > MAX_BYTES:
            raise InputError(f"A script has at most {MAX_BYTES // 1024} KB.")
        if not more:
            return text
        self._parts[key] = text
        return None

    def forget(self, key: str) -> None:
        """Forget the parts of the sender ``key``."""
        self._parts.pop(key, None)
