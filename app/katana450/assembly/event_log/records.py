"""Records of the event log: one JSON object per line, of bounded size and without secrets."""

from __future__ import annotations

import json
import time
from datetime import UTC, datetime
from typing import Any

Record = dict[str, Any]
"""A record: ``time``, ``t`` and ``kind``, and those of ``who``, ``what``, ``grounds``, ``outcome``
and ``why`` that are known."""

MAX_LINE_BYTES = 4096
"""Maximum length of a line. The content of a longer record is replaced by its length."""

MAX_TEXT = 200
"""Maximum length of a text in a record, in characters."""


def utc(seconds: float) -> str:
    """Return ``seconds`` since the epoch as ISO time in UTC with milliseconds."""
    return datetime.fromtimestamp(seconds, UTC).isoformat(timespec="milliseconds")[:-6] + "Z"


def record(kind: str, what: Any = None, **more: Any) -> Record:
    """Return a record of the present time. ``more``: further fields."""
    content: Record = {"time": utc(time.time()), "t": round(time.perf_counter(), 3), "kind": kind}
    if what is not None:
        content["what"] = what
    return content | more


def encoded(content: Record) -> bytes:
    """Return ``content`` as a line with its line feed.

    The line is plain ASCII whatever the texts in it: ``json`` escapes line breaks, control
    characters, lone surrogates, and everything else beyond ASCII.
    """
    line = json.dumps(content, separators=(",", ":"))
    if len(line) > MAX_LINE_BYTES:
        short: Record = {key: content[key] for key in ("time", "t", "kind") if key in content}
        line = json.dumps(short | {"what": {"omitted_bytes": len(line)}}, separators=(",", ":"))
    return line.encode("ascii") + b"\n"


def decoded(line: bytes) -> Record | None:
    """Return the record in ``line``; None if it is not a record."""
    try:
        content = json.loads(line)
    except (ValueError, RecursionError):
        return None
    return content if isinstance(content, dict) and "kind" in content else None


def text(value: object) -> str:
    """Return ``value`` as a text of at most ``MAX_TEXT`` characters."""
    words = str(value)
    return words if len(words) <= MAX_TEXT else f"{words[:MAX_TEXT]}... ({len(words)} characters)"
