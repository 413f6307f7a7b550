"""Messages between viser's server and its page, as the browser recorded them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Message:
    """A decoded viser message: `time` in seconds since the epoch, as `time.time()` has it."""

    time: float
    type: str
    body: dict[str, Any]
