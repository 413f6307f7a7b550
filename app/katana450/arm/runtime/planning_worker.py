"""Planning of motions in a thread of its own; the arm follows the plan once it is found."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable

import numpy as np

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.lease import Actor, Grounds
from katana450.arm.control.session.goals import START_TOLERANCE
from katana450.arm.control.session.plans import plan_to
from katana450.arm.control.session.session import Session
from katana450.arm.control.session.tool_targets import branch_named, with_branch
from katana450.arm.control.state.state import State
from katana450.arm.runtime.mailbox import CommandSink
from katana450.arm.runtime.pipes.state_publisher import StatePublisher
from katana450.errors import KatanaError
from katana450.maths.planning.plan import Plan

log = logging.getLogger(__name__)

REST_TIMEOUT = 5.0
"""[s] Timeout for the arm to come to rest before a plan starts."""


SUPERSEDED = "The path that was being planned is dropped: another command came first."
"""Sentence for people."""


class PlanningWorker:
    """Command sink that plans the ``planned`` commands and passes all others on at once.

    A planned command, such as a branch change, follows a path that is clear from end to end. Every
    other command that is not passive ends the planning.
    """

    def __init__(self, session: Session, state_publisher: StatePublisher, arm: CommandSink) -> None:
        self._session = session
        self._state_publisher = state_publisher
        self._arm = arm
        self._lock = threading.Lock()
        self._work: threading.Event | None = None
        self.notify: Callable[[str], None] = log.warning
        """Called with the reason if no path was found, or if another command came first."""
        self.redirected: Callable[[], None] = lambda: None
        """Called, in any thread, when a command gives the arm another motion, a hold or a stop.

        Not for the hold of an arm whose driver has left.
        """
        self.failure = ""
        """Reason for which no path was found, until the next command; empty without one."""

    @property
    def busy(self) -> bool:
        """True if a path is being planned, or is found and not started yet."""
        sent = self._arm.last_ticket
        return self._work is not None or self._state_publisher.snapshot.ticket < sent

    def deliver(self, command: cmd.Command, actor: Actor | None) -> int:
        """Send ``command`` as the arm does. One that is planned first gets no ticket of its own."""
        traits = [part.traits for part in command.parts]
        self.failure = ""
        is_planning = self._work is not None
        if not all(part.passive for part in traits):
            self.cancel()
            if is_planning and not any(part.safety for part in traits):
                self.notify(SUPERSEDED)
        # The hold for a driver who has left. A run that another person ordered is still wanted.
        left = actor is not None and actor.grounds is Grounds.SERVER and command == cmd.Hold()
        if any(part.supersedes for part in traits) and not left:
            self.redirected()
        if command.traits.planned:
            self._session.check(command)
            self._plan(command, actor)
            return self._arm.last_ticket
        return self._arm.deliver(command, actor)

    def cancel(self) -> None:
        """End the planning."""
        with self._lock:
            if self._work is not None:
                self._work.set()
                self._work = None

    def _plan(self, command: cmd.Command, actor: Actor | None) -> None:
        cancelled = threading.Event()
        with self._lock:
            self._work = cancelled
        threading.Thread(
            target=self._find, args=(command, actor, cancelled), name="planning", daemon=True
        ).start()

    def _find(self, command: cmd.Command, actor: Actor | None, cancelled: threading.Event) -> None:
        waited = self._state_publisher.snapshot.state.waits
        try:
            state = self._at_rest(actor, cancelled)
            plan = self._plan_of(command, state)
            # An arm that the server has paused meanwhile moves only by a newer command.
            may_move = waited or not self._state_publisher.snapshot.state.waits
            if plan is not None and may_move:
                self._unless(cancelled, cmd.Follow(plan), actor)
        except KatanaError as error:
            self._fail(str(error))
        except Exception:
            log.exception("The planning of a path failed.")
            self._fail("Internal error while a path was planned: see the server's log.")
        finally:
            with self._lock:
                if self._work is cancelled:
                    self._work = None

    def _plan_of(self, command: cmd.Command, state: State) -> Plan | None:
        """Return the plan of ``command`` from the rest of ``state``; None if nothing has to move.

        Raises InputError if the arm cannot do it, and BlockedError without a clear path.
        """
        arm, world = self._session.require_arm(), self._session.world_at(state)
        match command:
            case cmd.Branch(name=name):
                goal = with_branch(arm, state, branch_named(arm, name)).goal
                # At a stretched elbow two branches are one posture, but for rounding.
                if (np.abs(goal - state.setpoint) <= START_TOLERANCE).all():
                    return None
                return plan_to(arm, world, state, goal)
        raise AssertionError(f"There is no plan for {command!r}.")

    def _fail(self, why: str) -> None:
        self.failure = why
        self.notify(why)

    def _at_rest(self, actor: Actor | None, cancelled: threading.Event) -> State:
        """Return the state of the arm at rest; a moving arm is sent a hold first."""
        if self._state_publisher.snapshot.state.moving:
            self._unless(cancelled, cmd.Hold(), actor)
        end = time.monotonic() + REST_TIMEOUT
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
