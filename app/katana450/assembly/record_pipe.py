"""The pipe by which the arm's process sends the records of its ticks; it takes no commands."""

from __future__ import annotations

import threading
from multiprocessing.connection import Connection

from katana450.arm.runtime.arm_listener import RECORD, ArmAddress, Greeting, connect_when_ready


def connected_to_ticks(address: ArmAddress, ended: threading.Event) -> Connection:
    """Return a new pipe as soon as the arm's process listens at ``address``.

    Raises EOFError when ``ended`` is set first.
    """
    return connect_when_ready(address, Greeting(RECORD), ended)
