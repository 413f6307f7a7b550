"""Waiting for what other processes and threads do."""

from __future__ import annotations

import time
from collections.abc import Callable

from katana450.client import Client
from katana450.server.api import answers

PERIOD = 0.02
"""[s] Time between two looks. A client that asks without pause is taken for a flood."""


def until(true: Callable[[], object], seconds: float = 20.0) -> float:
    """Wait until ``true`` returns a true value; return the time that it took [s]."""
    start = time.monotonic()
    while not true():
        assert time.monotonic() - start < seconds
        time.sleep(PERIOD)
    return time.monotonic() - start


def state_when(
    client: Client, true: Callable[[answers.State], bool], seconds: float = 60.0
) -> answers.State:
    """Return the first state that ``client`` gets for which ``true`` returns True."""
    due = time.monotonic() + seconds
    while not true(state := client.query(answers.State)):
        assert time.monotonic() < due, state
        time.sleep(PERIOD)
    return state
