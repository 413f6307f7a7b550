"""Progress in percent on a terminal; no output on other streams, and reports to another program."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterable, Iterator
from time import monotonic
from typing import TextIO, TypeVar

T = TypeVar("T")

PERIOD = 0.1
"""[s] Time between two lines."""


_listeners: list[Callable[[float], None]] = []


def report_to(listener: Callable[[float], None]) -> None:
    """Call ``listener`` with each fraction (0 to 1) of the work of this process that is done."""
    _listeners.append(listener)


def report(fraction: float) -> None:
    """Report that ``fraction`` (0 to 1) of the present work is done, to all listeners."""
    for listener in _listeners:
        listener(fraction)


def progress(
    items: Iterable[T], total: int, label: str, stream: TextIO | None = None
) -> Iterator[T]:
    """Yield ``items``, of which about ``total`` are expected, and show the fraction of them."""
    stream = stream or sys.stderr
    if not stream.isatty():
        for done, item in enumerate(items):
            report(min(done / max(total, 1), 1.0))
            yield item
        return
    shown = -math.inf
    try:
        for done, item in enumerate(items, 1):
            if monotonic() - shown >= PERIOD or done == total:
                print(f"\r{label} {min(done / total, 1.0):4.0%}", end="", file=stream, flush=True)
                shown = monotonic()
            yield item
    finally:
        print(file=stream, flush=True)
