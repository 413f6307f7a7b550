"""Records of the event log: one JSON object per line, each with the hash of the line before."""

from __future__ import annotations

import hashlib
import json
import time
from datetime import UTC, datetime
from typing import Any

Record = dict[str, Any]
"""A record: ``time``, ``t`` and ``kind``, and those of ``who``, ``what``, ``grounds``, ``outcome``
and ``why`` that are known. ``LogFolder`` adds ``seq`` and ``prev``."""

FIRST_HASH = "0" * 64
"""Value of ``prev`` in the first record of a log."""

MAX_LINE_BYTES = 4096
"""Maximum length of a line. The content of a longer record is replaced by its length."""


def utc(seconds: float) -> str:
    """Return ``seconds`` since the epoch as ISO time in UTC with milliseconds."""
    return datetime.fromtimestamp(seconds, UTC).isoformat(timespec="milliseconds")[:-6] + "Z"


def record(kind: str, what: Any = None, **more: Any) -> Record:
    """Return a record of the present time. ``more``: further fields."""
    made: Record = {"time": utc(time.time()), "t": round(time.perf_counter(), 3), "kind": kind}
    if what is not None:
        made["what"] = what
    return made | more


def encoded(seq: int, content: Record, previous: str) -> bytes:
    """Return ``content`` as a line without line feed.

    The line is plain ASCII whatever the texts in it: ``json`` escapes line breaks, control
    characters, lone surrogates, and everything else beyond ASCII.
    """
    line = _dumped({"seq": seq, **content, "prev": previous})
    if len(line) > MAX_LINE_BYTES:
        short: Record = {key: content[key] for key in ("time", "t", "kind") if key in content}
        line = _dumped(
            {"seq": seq, **short, "what": {"omitted_bytes": len(line)}, "prev": previous}
        )
    return line


def decoded(line: bytes) -> Record | None:
    """Return the record in ``line``; None if it is not a record."""
    try:
        found = json.loads(line)
    except (ValueError, RecursionError):
        return None
    if not isinstance(found, dict) or not isinstance(found.get("prev"), str):
        return None
    seq = found.get("seq")
    return found if isinstance(seq, int) and not isinstance(seq, bool) else None


def hash_of(line: bytes) -> str:
    """Return the SHA-256 of ``line``, which has no line feed, as hexadecimal digits."""
    return hashlib.sha256(line).hexdigest()


def _dumped(content: Record) -> bytes:
    return json.dumps(content, separators=(",", ":")).encode("ascii")
