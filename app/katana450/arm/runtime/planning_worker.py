"""Ways that take a while to find: worked out beside everything else, and followed once found."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable

from katana450.arm.control import commands as cmd
from katana450.arm.control.actor import Actor
from katana450.arm.control.plans import plan_to
from katana450.arm.control.session import Session
from katana450.arm.control.state import State
from katana450.arm.control.tool_targets import with_branch
from katana450.arm.runtime.mailbox import CommandSink
from katana450.arm.runtime.state_publisher import StatePublisher
from katana450.errors import KatanaError

log = logging.getLogger(__name__)

REST_SECONDS = 5.0
"""[s] In which an arm that is to set out from rest has come to it."""


class PlanningWorker:
    """Between whoever commands and the arm: a branch is taken on a planned way, clear from end to
    end; all else goes on at once, and ends the work on a way.
    """

    def __init__(self, session: Session, state_publisher: StatePublisher, arm: CommandSink) -> None:
        self._session = session
        self._state_publisher = state_publisher
        self._arm = arm
        self._lock = threading.Lock()
        self._work: threading.Event | None = None
        self.tell: Callable[[str], None] = log.warning
        """Is told why no way was found."""
        self.redirected: Callable[[], None] = lambda: None
        """Is called, in any thread, when the arm is told to go elsewhere, to hold or to stop."""

    @property
    def last_ticket(self) -> int:
        """The ticket of the newest command that went to the arm."""
        return self._arm.last_ticket

    @property
    def busy(self) -> bool:
        """Whether a way is under work, or found and not begun yet."""
        return self._work is not None or self._state_publisher.snapshot.ticket < self.last_ticket

    def deliver(self, command: cmd.Command, actor: Actor | None) -> int:
        """Implement ``CommandSink``; a command that follows a path found later has no ticket."""
        traits = [each.traits for each in command.parts]
        if not all(each.passive for each in traits):
            self.cancel()
        if any(each.supersedes for each in traits):
            self.redirected()
        if isinstance(command, cmd.TakeBranch):
            self._set_out(command, actor)
            return self.last_ticket
        return self._arm.deliver(command, actor)

    def cancel(self) -> None:
        """Give up the way under work."""
        with self._lock:
            if self._work is not None:
                self._work.set()
                self._work = None

    def _set_out(self, command: cmd.TakeBranch, actor: Actor | None) -> None:
        cancelled = threading.Event()
        with self._lock:
            self._work = cancelled
        threading.Thread(
            target=self._find, args=(command, actor, cancelled), name="planning worker", daemon=True
        ).start()

    def _find(
        self, command: cmd.TakeBranch, actor: Actor | None, cancelled: threading.Event
    ) -> None:
        try:
            state = self._at_rest(actor, cancelled)
            arm = self._session.require_arm()
            goal = with_branch(arm, state, command.branch).goal
            if (goal != state.setpoint).any():
                world = self._session.world_at(state)
                plan = plan_to(arm, world, state, goal)
                self._unless(cancelled, cmd.Follow(plan), actor)
        except KatanaError as error:
            self.tell(str(error))
        except Exception:
            log.exception("A way could not be worked out.")
            self.tell("Something went wrong inside while a way was worked out; see the log.")
        finally:
            with self._lock:
                if self._work is cancelled:
                    self._work = None

    def _at_rest(self, actor: Actor | None, cancelled: threading.Event) -> State:
        """The state of an arm that stands, which it is made to."""
        if self._state_publisher.snapshot.state.moving:
            self._unless(cancelled, cmd.Hold(), actor)
        end = time.monotonic() + REST_SECONDS
        snapshot = self._state_publisher.snapshot
        while snapshot.state.moving or snapshot.ticket < self._arm.last_ticket:
            if time.monotonic() > end or cancelled.is_set():
                break
            snapshot = self._state_publisher.wait_for_change(snapshot, 0.1)
        return snapshot.state

    def _unless(
        self, cancelled: threading.Event, command: cmd.Command, actor: Actor | None
    ) -> None:
        with self._lock:
            if not cancelled.is_set():
                self._arm.deliver(command, actor)
