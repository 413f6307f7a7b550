"""Messages between viser's server and its page, as the browser recorded them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Message:
    """A decoded viser message; `time` is in seconds since the epoch, as in `time.time()`."""

    time: float
    type: str
    body: dict[str, Any]
