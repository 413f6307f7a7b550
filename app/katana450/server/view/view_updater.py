"""The base of views: follows the control loop in a thread of its own."""

from __future__ import annotations

import logging
import threading
import time

import viser

from katana450.arm.runtime.pipes.state_publisher import Snapshot, StatePublisher
from katana450.server.view.panel_folder import AddFolders

READOUT_INTERVAL = 0.1
"""Time [s] between two updates of numbers and sliders; people cannot read faster changes."""

log = logging.getLogger(__name__)


class ViewUpdater:
    """Shows new snapshots, up to a maximum number per second. The base shows nothing.

    Attributes:
        failed: set when the view has ended with an error.
    """

    def __init__(
        self, server: viser.ViserServer, state_publisher: StatePublisher, frame_rate: float
    ) -> None:
        """Prepare the thread; ``frame_rate``: maximum number of updates per second [Hz]."""
        self._server = server
        self._state_publisher = state_publisher
        self._interval = 1.0 / frame_rate
        self._stopping = threading.Event()
        self.failed = threading.Event()
        self._thread = threading.Thread(target=self._run, name="view", daemon=True)

    def add_panel(self, folders: AddFolders) -> None:
        """Add the panel, with the controls of extensions. Raises KatanaError."""

    def start(self) -> None:
        """Start to follow the control loop, with the panel."""
        self._thread.start()

    def stop(self) -> None:
        """End the thread and wait for it."""
        self._stopping.set()
        self._state_publisher.wake()
        if self._thread.is_alive():
            self._thread.join()

    def show(self, snapshot: Snapshot) -> None:
        """Send the changes in ``snapshot`` to every browser."""

    def show_panel(self, snapshot: Snapshot) -> None:
        """Send what may follow the scene: it does not delay the picture of a drag."""

    def _run(self) -> None:
        try:
            self._follow()
        except Exception:
            log.exception("The view met an error.")
            self.failed.set()

    def _follow(self) -> None:
        shown = self._state_publisher.snapshot
        settled = True
        while not self._stopping.is_set():
            # The read-out has a longer interval and needs one more update after the last change.
            snapshot = self._state_publisher.wait_for_change(
                shown, 0.5 if settled else READOUT_INTERVAL, self._stopping.is_set
            )
            settled = snapshot is shown
            shown = snapshot
            due = time.perf_counter() + self._interval
            self.show(snapshot)
            # The scene is on its way meanwhile.
            self._state_publisher.wait_for_command(snapshot, self._interval / 2)
            self.show_panel(snapshot)
            # Motion is shown at the frame rate, the effect of a command immediately.
            self._state_publisher.wait_for_command(snapshot, due - time.perf_counter())
