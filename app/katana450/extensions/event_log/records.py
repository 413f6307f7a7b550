"""Records of the event log: one JSON object per line."""

from __future__ import annotations

import json
import time
from datetime import UTC, datetime
from typing import Any

Record = dict[str, Any]
"""A record: ``time``, ``t`` and ``kind``, and those of ``who``, ``what``, ``grounds``, ``outcome``
and ``why`` that are known. ``LogFolder`` adds ``seq``."""

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


def encoded(seq: int, content: Record) -> bytes:
    """Return ``content`` as a line without line feed.

    The line is plain ASCII whatever the texts in it: ``json`` escapes line breaks, control
    characters, lone surrogates, and everything else beyond ASCII.
    """
    line = _dumped({"seq": seq, **content})
    if len(line) > MAX_LINE_BYTES:
        short: Record = {key: content[key] for key in ("time", "t", "kind") if key in content}
        line = _dumped({"seq": seq, **short, "what": {"omitted_bytes": len(line)}})
    return line


def decoded(line: bytes) -> Record | None:
    """Return the record in ``line``; None if it is not a record."""
    try:
        content = json.loads(line)
    except (ValueError, RecursionError):
        return None
    if not isinstance(content, dict):
        return None
    seq = content.get("seq")
    return content if isinstance(seq, int) and not isinstance(seq, bool) else None


def _dumped(content: Record) -> bytes:
    return json.dumps(content, separators=(",", ":")).encode("ascii")
