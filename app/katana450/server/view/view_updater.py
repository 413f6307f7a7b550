"""What every view does: follow the control loop in a thread of its own."""

from __future__ import annotations

import logging
import threading
import time
from abc import ABC, abstractmethod

import viser

from katana450.arm.runtime.state_publisher import Snapshot, StatePublisher

READOUT_INTERVAL = 0.1
"""[s] People cannot read numbers that change faster, nor need sliders that do."""

log = logging.getLogger(__name__)


class ViewUpdater(ABC):
    """Shows each new snapshot, at most so many a second."""

    def __init__(
        self, server: viser.ViserServer, state_publisher: StatePublisher, frame_rate: float
    ) -> None:
        """``frame_rate``: most updates a second [Hz]."""
        self._server = server
        self._state_publisher = state_publisher
        self._interval = 1.0 / frame_rate
        self._stopping = threading.Event()
        self.failed = threading.Event()
        """Set when it shows nothing any more."""
        self._thread = threading.Thread(target=self._run, name="view", daemon=True)

    def start(self) -> None:
        """Follow the control loop from now on."""
        self._thread.start()

    def stop(self) -> None:
        """Stop following."""
        self._stopping.set()
        if self._thread.is_alive():
            self._thread.join()

    @abstractmethod
    def show(self, snapshot: Snapshot) -> None:
        """Send every browser what has changed."""

    def _run(self) -> None:
        try:
            self._follow()
        except Exception:
            log.exception("The view met an error.")
            self.failed.set()

    def _follow(self) -> None:
        seen = self._state_publisher.snapshot
        settled = True
        while not self._stopping.is_set():
            # After the last change the read-out still owes its final numbers.
            snapshot = self._state_publisher.wait_for_change(
                seen, 0.5 if settled else READOUT_INTERVAL
            )
            settled = snapshot is seen
            seen = snapshot
            due = time.perf_counter() + self._interval
            self.show(snapshot)
            # Motion is shown at the frame rate, what a person does at once.
            self._state_publisher.wait_for_command(snapshot, due - time.perf_counter())
