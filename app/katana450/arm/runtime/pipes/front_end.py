"""The front end's end of the pipe to the arm's process; ``arm_end`` is the other end."""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from multiprocessing.connection import Connection

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.lease import Actor
from katana450.arm.control.session.checks import DROPPED
from katana450.arm.control.session.stopping import joined
from katana450.arm.control.state.scene_objects import same
from katana450.arm.runtime.clock import MonotonicClock
from katana450.arm.runtime.pipes.arm_end import PULSE, CommandMessage, Heartbeat, StateMessage
from katana450.arm.runtime.pipes.guarded_pipe import PIPE_ERRORS, GuardedPipe
from katana450.arm.runtime.pipes.state_publisher import Snapshot, StatePublisher
from katana450.arm.runtime.pipes.wire import PlanStore, plan_of
from katana450.arm.runtime.readiness import readable, writable
from katana450.errors import InputError

COMMAND_TIMEOUT = 0.5
"""[s] Silence of the arm's process after which only a stop is sent to it."""

REST_HEARTBEAT = 0.08
"""[s] Minimum interval of the heartbeats to an arm at rest: less than half its silence timeout."""

RECONNECT_INTERVAL = 0.05
"""[s] Interval of the attempts to connect to a new process of the arm."""

PIPE = "The pipe to the arm's process"


class FrontEnd:
    """The end of the pipe in the front end: it takes commands and publishes the arm's states."""

    def __init__(
        self,
        pipe: Connection,
        check: Callable[[cmd.Command], None],
        reconnect: Callable[[int], Connection] | None = None,
    ) -> None:
        """Create the end, and wait for the first snapshot.

        Args:
            pipe: the pipe to the arm's process.
            check: see ``Mailbox``.
            reconnect: makes a pipe to a new process of the arm, to which it gives the number of the
                newest command. Raises OSError or EOFError while there is none. Without it the pipe
                is cut when the arm's process ends.

        Raises:
            EOFError: the arm's process has closed the pipe.
        """
        self._pipe = pipe
        self._check = check
        self._reconnect = reconnect
        self._connected = True
        self._sending = threading.Lock()
        self._unsent: deque[CommandMessage] = deque()
        self._number = 0
        self._beaten = -math.inf
        self._plans = PlanStore()
        first = _loaded(pipe.recv_bytes(), self._plans)
        if first is None:
            raise EOFError
        self._heard = time.monotonic()
        self.profile = first.profile
        """Reaction of the moving arm to silence."""
        self.state_publisher = StatePublisher(first.snapshot, first.loop_timing)
        self.cut = threading.Event()
        """Set once this front end is no longer the one of the arm."""
        self.on_stop_change: Callable[[], None] = lambda: None
        """Called in the thread of the pipe when a state is the first that is stopped, or not."""
        self.on_command_at_rest: Callable[[], None] = lambda: None
        """Called with each command to an arm at rest, which may need heartbeats from now on."""
        self._thread = threading.Thread(target=self._listen, name="pipe", daemon=True)

    def start(self) -> None:
        """Read all states that have arrived, then follow the arm in a thread of its own.

        Between construction and start the arm may have moved, or stopped. After this call
        ``state_publisher`` holds the newest state.
        """
        with suppress(*PIPE_ERRORS):
            while readable(self._pipe.fileno()):
                self._take(self._pipe.recv_bytes())
        self._thread.start()

    @property
    def last_ticket(self) -> int:
        """The ticket of the newest command."""
        with self._sending:
            return self._number

    def deliver(self, command: cmd.Command, actor: Actor | None = None) -> int:
        """Send ``command`` of ``actor`` to the arm, and return its ticket.

        Raises InputError for a command that the arm does not support. If the arm's process does not
        answer or has ended, every command but a stop is refused.
        """
        self._check(command)
        age = self.age
        if isinstance(command, cmd.Servo):
            # An early stamp keeps delays in this process from looking like motion.
            command = command.timed(MonotonicClock().now())
        with self._sending:
            if isinstance(command, cmd.Stop):
                # Unsent commands are dropped; an earlier stop is fulfilled together with this one.
                unsent = (
                    waiting for waiting in self._unsent if not isinstance(waiting.command, cmd.Stop)
                )
                self.state_publisher.outcomes.note((waiting.number, DROPPED) for waiting in unsent)
                for waiting in self._unsent:
                    if isinstance(waiting.command, cmd.Stop):
                        command, actor = joined(waiting.command, command), waiting.actor
                self._unsent.clear()
            elif age > COMMAND_TIMEOUT or not self._connected:
                raise InputError(
                    f"The arm's process has not answered for {age:.1f} s: only STOP is accepted."
                )
            number = self._number = self._number + 1
            plan = plan_of(command)
            if plan is not None:
                self._plans.note(number, plan)
            # Read before the command is sent: afterwards the arm may move already.
            state = self.state_publisher.snapshot.state
            self._unsent.append(CommandMessage(number, command, actor, state.t))
            self._flush()
        if not state.moving:
            self.on_command_at_rest()
        return number

    @property
    def age(self) -> float:
        """Time since the newest message of the arm's process [s]; a running loop has sent it.

        A message that has arrived and is not read yet counts as new.
        """
        if self.cut.is_set() or not self._connected:
            return time.monotonic() - self._heard
        return 0.0 if readable(self._pipe.fileno()) else time.monotonic() - self._heard

    def heartbeat(self) -> None:
        """Send a heartbeat, unless commands still wait to be sent.

        An arm at rest needs them seldom; the command that moves it counts as one.
        """
        with self._sending:
            if not (self._flush() and self._connected):
                return
            now, resting = time.monotonic(), not self.state_publisher.snapshot.state.moving
            if not resting or now - self._beaten >= REST_HEARTBEAT:
                self._beaten = now
                self._send(Heartbeat())

    def close(self) -> None:
        """Cut the pipe; a thread that reads from the pipe ends with its process."""
        self.cut.set()

    def _flush(self) -> bool:
        """Send the waiting commands; return whether none is left. A full pipe does not block."""
        while self._connected and self._unsent and self._send(self._unsent[0]):
            self._unsent.popleft()
        return not self._unsent

    def _send(self, message: CommandMessage | Heartbeat) -> bool:
        try:
            if writable(self._pipe.fileno()):
                self._pipe.send(message)
                return True
        except PIPE_ERRORS:
            # The thread that reads notices it too, and connects again.
            self._connected = False
        return False

    def _listen(self) -> None:
        while not self.cut.is_set():
            with GuardedPipe(self._pipe, PIPE):
                while self._take(self._pipe.recv_bytes()):
                    pass
                # Another front end has taken the place of this one.
                self.cut.set()
            self._connected = False
            if self._reconnect is None or not self._connect(self._reconnect):
                self.cut.set()

    def _connect(self, reconnect: Callable[[int], Connection]) -> bool:
        """Connect to a new process of the arm; return whether it succeeded before a cut."""
        while not self.cut.wait(RECONNECT_INTERVAL):
            with self._sending:
                # No command to the process that ended reaches the new one, which is stopped.
                self.state_publisher.outcomes.note(
                    (unsent.number, DROPPED) for unsent in self._unsent
                )
                self._unsent.clear()
                number = self._number
            with suppress(*PIPE_ERRORS):
                pipe, plans = reconnect(number), PlanStore()
                with GuardedPipe(pipe, PIPE):
                    first = _loaded(pipe.recv_bytes(), plans)
                    if first is None:
                        continue
                    self.state_publisher.publish(first.snapshot)
                    with self._sending:
                        self._pipe, self._plans, self._heard = pipe, plans, time.monotonic()
                        self._connected = True
                        self._flush()
                    return True
        return False

    def _take(self, data: bytes) -> bool:
        """Publish the content of ``data`` from the arm's end; return False if that closes."""
        self._heard = time.monotonic()
        if self._unsent:
            with self._sending:
                self._flush()
        if data == PULSE:
            return True
        message = _loaded(data, self._plans)
        if message is None:
            return False
        self.state_publisher.loop_timing = message.loop_timing
        last = self.state_publisher.snapshot
        if message.snapshot.state.t != last.state.t or message.snapshot.ticket != last.ticket:
            self.state_publisher.publish(_known(message.snapshot, last))
        # The state comes first: a client with an answer must find its command in the state.
        self.state_publisher.outcomes.note(message.outcomes)
        if (message.snapshot.state.stopped is None) != (last.state.stopped is None):
            self.on_stop_change()
        return True


def _known(message: Snapshot, last: Snapshot) -> Snapshot:
    """Return ``message`` with the objects of ``last`` if they are the same.

    Objects from the pipe are new Python objects each time, which would be taken for a change.
    """
    if not same(message.state.objects, last.state.objects):
        return message
    return Snapshot(replace(message.state, objects=last.state.objects), message.ticket)


def _loaded(data: bytes, plans: PlanStore) -> StateMessage | None:
    """Return the message in ``data`` from the arm's end; None when that closes."""
    message: StateMessage | None = plans.loaded(data)
    return message
