"""A progress bar on a terminal; no output on other streams, and reports to another program."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator
from time import monotonic
from typing import TextIO, TypeVar

T = TypeVar("T")

_WIDTH = 30
_PERIOD = 0.1  # s between two drawings


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
    """Yield ``items``, of which there are ``total``, and show the fraction that was yielded."""
    stream = stream or sys.stderr
    if not stream.isatty():
        for done, item in enumerate(items):
            report(done / max(total, 1))
            yield item
        return
    start = drawn = monotonic()
    done = 0
    try:
        print(_line(label, 0, total, 0.0), end="", file=stream, flush=True)
        for item in items:
            done += 1
            now = monotonic()
            if now - drawn >= _PERIOD or done == total:
                print(_line(label, done, total, now - start), end="", file=stream, flush=True)
                drawn = now
            yield item
    finally:
        print(file=stream, flush=True)


def _line(label: str, done: int, total: int, elapsed: float) -> str:
    fraction = done / total if total else 1.0
    filled = int(fraction * _WIDTH)
    left = f"{_clock(elapsed * (1.0 - fraction) / fraction)} left" if fraction else ""
    bar = "#" * filled + "." * (_WIDTH - filled)
    # Trailing blanks overwrite the rest of a longer line.
    return f"\r{label} [{bar}] {fraction:4.0%}  {left:<14}"


def _clock(seconds: float) -> str:
    minutes, seconds = divmod(round(seconds), 60)
    return f"{minutes} min {seconds:02d} s" if minutes else f"{seconds} s"
