"""The state of the episodes, from the process that records to all pages."""

from __future__ import annotations

import json
import threading
import time
import weakref
from pathlib import Path
from typing import Any

from katana450.errors import InputError
from katana450.server.service.hub import Hub

START_DELAY = 2.0
"""[s] Time in which the process that records is not yet ready."""

RECONNECT_SECONDS = 0.5
"""[s] Time between two attempts to reach the process that records."""

ENTRY = "episodes"
"""Name of the state of episodes in the status of all pages."""


def follow_episodes(hub: Hub, folder: Path, port: int) -> threading.Thread:
    """Show the state of the episodes to all pages of ``hub``, in a thread of its own."""
    # The thread waits when this process ends, and must not keep the hub then.
    shown = weakref.ref(hub)

    def show(state: Any) -> None:
        found = shown()
        if found is not None:
            found.shown = {**found.shown, ENTRY: state}

    def follow() -> None:
        time.sleep(START_DELAY)
        # Not at the start, which it would make longer.
        from katana450.extensions.recording.episodes.link import connect_to_episodes

        while True:
            try:
                connection = connect_to_episodes(folder, port)
            except InputError:
                show(None)
                time.sleep(RECONNECT_SECONDS)
                continue
            try:
                connection.send_bytes(json.dumps({"watch": True}).encode())
                while True:
                    show(json.loads(connection.recv_bytes()))
            except (OSError, EOFError, ValueError):
                connection.close()
                # A process that ends each connection must not keep this thread busy.
                time.sleep(RECONNECT_SECONDS)

    thread = threading.Thread(target=follow, name="episodes", daemon=True)
    thread.start()
    return thread
