"""Cancellation of a long calculation.

The loops of planning call ``checkpoint``. The code that started them decides in ``checked_by``
whether they continue.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar


def _continue() -> None:
    """Let the calculation continue."""


_check: ContextVar[Callable[[], None]] = ContextVar("check", default=_continue)


def checkpoint() -> None:
    """Call the check of the present context, which may raise; do nothing without a check."""
    _check.get()()


@contextmanager
def checked_by(check: Callable[[], None]) -> Iterator[None]:
    """Make every ``checkpoint`` within this context and thread call ``check``.

    ``check`` raises CancelledError to end the calculation. It is called thousands of times a
    second, so it must be cheap.
    """
    token = _check.set(check)
    try:
        yield
    finally:
        _check.reset(token)
