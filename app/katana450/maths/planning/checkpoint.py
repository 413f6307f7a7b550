"""Cancellation of a long calculation: the loops of planning call ``checkpoint``, and the code that
started them decides in ``checked_by`` whether they continue.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar


def _continue() -> None:
    """Let the calculation continue."""


_check: ContextVar[Callable[[], None]] = ContextVar("check", default=_continue)


def checkpoint() -> None:
    """Raise what the check of the present context raises; without one do nothing."""
    _check.get()()


@contextmanager
def checked_by(check: Callable[[], None]) -> Iterator[None]:
    """Have every ``checkpoint`` within this context and thread call ``check``.

    ``check`` raises CancelledError to end the calculation. It is called thousands of times a
    second, so it has to be cheap.
    """
    token = _check.set(check)
    try:
        yield
    finally:
        _check.reset(token)
