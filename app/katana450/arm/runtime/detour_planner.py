"""Planning of detours in a thread of its own, while the hand rests at a gap or has let go."""

from __future__ import annotations

import logging
import threading

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.session.plans import detour_from
from katana450.arm.control.session.session import Session
from katana450.arm.control.state.state import State
from katana450.arm.runtime.pipes.state_publisher import Snapshot, StatePublisher
from katana450.arm.runtime.planning_worker import PlanningWorker
from katana450.errors import CancelledError, KatanaError
from katana450.maths.planning.checkpoint import checked_by

log = logging.getLogger(__name__)

SETTLE_TIME = 0.15
"""[s] Time without a new state after which the hand rests."""

WAKE_INTERVAL = 0.5
"""[s] Interval at which the end of the thread is checked."""


class DetourPlanner:
    """Offers a detour at each gap that ended a drag, if a clear path on the branch leads round it.

    The session withdraws the offer when anything changes; then a new one is planned.
    """

    def __init__(
        self,
        session: Session,
        state_publisher: StatePublisher,
        arm: PlanningWorker,
    ) -> None:
        """Prepare the thread.

        Args:
            session: the rules of the arm.
            state_publisher: the source of states.
            arm: the sink of the offers.
        """
        self._session = session
        self._state_publisher = state_publisher
        self._arm = arm
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="detours", daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def stop(self) -> None:
        """End the thread."""
        self._stopping.set()
        self._state_publisher.wake()
        self._thread.join()

    def _run(self) -> None:
        snapshot = self._state_publisher.snapshot
        while not self._stopping.is_set():
            wanted = _wants_detour(snapshot.state)
            new = self._state_publisher.wait_for_change(
                snapshot, SETTLE_TIME if wanted else WAKE_INTERVAL, self._stopping.is_set
            )
            if new is snapshot and wanted:
                self._offer(snapshot)
                # Planned at most once for each state.
                new = self._changed(snapshot)
            snapshot = new

    def _changed(self, snapshot: Snapshot) -> Snapshot:
        """Return the next snapshot after ``snapshot``, or ``snapshot`` when the thread ends."""
        new = snapshot
        while new is snapshot and not self._stopping.is_set():
            new = self._state_publisher.wait_for_change(
                snapshot, WAKE_INTERVAL, self._stopping.is_set
            )
        return new

    def _offer(self, snapshot: Snapshot) -> None:
        """Plan the detour of ``snapshot`` and offer it."""

        def check() -> None:
            if self._stopping.is_set() or self._state_publisher.snapshot is not snapshot:
                raise CancelledError("The state of the arm has changed.")

        state = snapshot.state
        try:
            with checked_by(check):
                world = self._session.world_at(state)
                plan = detour_from(self._session.require_arm(), world, state)
                check()
            self._arm.deliver(cmd.OfferDetour(plan), self._arm.newest_actor)
        except KatanaError as error:
            log.debug("No detour: %s", error)
        except Exception:
            log.exception("The planning of a detour failed.")


def _wants_detour(state: State) -> bool:
    """Return whether ``state`` rests at a gap without an offer."""
    resting = not (state.moving or state.paused or state.blocked)
    return resting and state.beyond_gap is not None and state.detour is None
