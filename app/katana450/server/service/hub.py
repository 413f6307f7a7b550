"""Everybody who is here, who of them drives, and whether the arm is stopped.

Lives in the gateway's one thread; what it decides reaches the arm through the mailbox.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from katana450.arm.control import commands as cmd
from katana450.arm.control.commands import JOG_TIME
from katana450.arm.control.lease import Lease, Person
from katana450.errors import LeaseError
from katana450.extensions.importers.meshes import Meshes
from katana450.maths.kinematics.velocity import JogFrame
from katana450.server.api.fields import Rates
from katana450.server.service.event_log import Journal
from katana450.server.service.heartbeats import Heartbeat
from katana450.server.service.interfaces import Arm, Behind
from katana450.server.service.program_runner import ProgramRunner
from katana450.server.service.scene_transfer import Scenes
from katana450.server.service.stop_state import Presses, Stopped
from katana450.server.web.authenticator import Identity
from katana450.settings import Settings

log = logging.getLogger(__name__)

TICK = 0.02
"""[s] Between two looks at whether somebody has fallen silent."""

REMEMBERED = 256
"""Pages that are known again when they come back."""


@dataclass(frozen=True, eq=False)
class Window:
    """One open page; ``tell`` leaves it a notice, ``heartbeat`` is its newest sign of life."""

    person: Person
    number: int
    tell: Callable[[dict[str, Any]], None]
    heartbeat: Heartbeat


class Hub:
    """The one place where it is decided who may move the arm. Times are in seconds."""

    def __init__(
        self,
        clock: Callable[[], float],
        hold_after: float = Settings.silence,
        meshes: Meshes | None = None,
        *,
        owner_silence: float = Settings.owner_silence,
    ) -> None:
        """``hold_after``: silence of whoever drives [s] that stops an arm that moves. ``meshes``:
        those there are at first. ``owner_silence``: see ``Settings``."""
        self.clock = clock
        self._hold_after = hold_after
        self.lease = Lease()
        self.stopped: Stopped | None = None
        self.arm: Arm | None = None
        """None until the arm is there."""
        self.journal = Journal()
        self.performer = ProgramRunner(self, owner_silence)
        self.meshes = Meshes() if meshes is None else meshes
        self.scenes = Scenes(self.meshes)
        self._windows: dict[str, Window] = {}
        self._pictures: dict[Behind, tuple[str, set[str]]] = {}
        self._remembered: dict[str, tuple[Person, int]] = {}
        self._numbers = 0
        self._presses = Presses()
        self._jogged = -JOG_TIME

    # Coming and going

    def join(
        self,
        visitor: Identity,
        page: str,
        tell: Callable[[dict[str, Any]], None],
        heartbeat: Heartbeat | None = None,
    ) -> Window:
        """A page opens its control socket; one that comes back is who it was.

        ``heartbeat``: its newest sign of life; without one, what ``beat`` says.
        """
        key = key_of(visitor, page)
        known = self._remembered.pop(key) if key in self._remembered else None
        person, number = known or self._meet(key, visitor)
        self._remembered[key] = (person, number)
        while len(self._remembered) > REMEMBERED:
            self._remembered.pop(next(iter(self._remembered)))
        window = Window(person, number, tell, heartbeat or Heartbeat(self.clock))
        self._windows[key] = window
        self.beat(window)
        return window

    def leave(self, window: Window, *, for_good: bool = False) -> None:
        """Its control socket is closed. ``for_good``: a program, which does not come back."""
        person = window.person
        if self._windows.get(person.key) is not window:
            return
        del self._windows[person.key]
        self.lease = self.lease.leave(person)
        if not for_good:
            return
        self._remembered.pop(person.key, None)
        self.performer.leave(window)
        if self.lease.holder == person:
            if self.stopped is None and self._moves(self.clock()):
                self._halt(Stopped(None, f"{person.name} left while the arm moved."))
            self._change(self.lease.give_up(person))

    def present(self) -> Arm:
        """The arm. Raises LeaseError while there is none yet."""
        if self.arm is None:
            raise LeaseError("The arm is not there yet.")
        return self.arm

    def window(self, key: str) -> Window | None:
        """The window of that key, if its control socket is open."""
        return self._windows.get(key)

    def show(self, key: str, picture: Behind, drags: set[str]) -> None:
        """A page opens its way to viser: how far it is behind, and which gizmos it drags."""
        self._pictures[picture] = (key, drags)

    def hide(self, picture: Behind) -> None:
        """It is closed."""
        del self._pictures[picture]

    @property
    def watching(self) -> int:
        """Browsers that are sent pictures."""
        return len(self._pictures)

    def age(self, window: Window) -> float:
        """How old the picture is that the window shows [s]."""
        of_it = [each for each, (key, _) in self._pictures.items() if key == window.person.key]
        return of_it[-1].age(self.clock()) if of_it else 0.0

    @property
    def windows(self) -> list[Window]:
        """All that are open, the oldest first."""
        return sorted(self._windows.values(), key=lambda window: window.number)

    def announce(self, why: str) -> None:
        """Tell everybody why something that was asked is not done. For any thread."""
        for window in self.windows:
            window.tell({"is": "refused", "why": why})

    # What people do

    def stop(self, name: str, press: str | None = None) -> None:
        """Anybody may, at any time. A ``press`` counts once, however often it is told."""
        if self._presses.is_new(press):
            self._halt(Stopped(name, f"{name} pressed STOP."))

    def reset(self, window: Window) -> None:
        """End a stop; the arm stays where it is until somebody moves it afresh."""
        self._grasp(window)
        if self.arm is not None:
            self.arm.release()
        self.stopped = None

    def may_reset(self, window: Window) -> bool:
        """Whether ``reset`` is not refused to the window."""
        holder = self.lease.holder
        return window.person.role.may_drive and holder in (None, window.person)

    def acquire(self, window: Window) -> None:
        self.lease = self.lease.acquire(window.person, self.clock())

    def take(self, window: Window) -> None:
        self._change(self.lease.take(window.person, self.clock()))

    def request(self, window: Window) -> None:
        self.lease = self.lease.request(window.person)

    def withdraw(self, window: Window) -> None:
        self.lease = self.lease.withdraw(window.person)

    def give_up(self, window: Window) -> None:
        self._change(self.lease.give_up(window.person))

    def hand_over(self, window: Window, number: int) -> None:
        """To the window of that number."""
        taker = next((each for each in self.windows if each.number == number), None)
        if taker is None:
            raise LeaseError("They have closed their window.")
        self._change(self.lease.hand_over(window.person, taker.person, self.clock()))

    def beat(self, window: Window) -> None:
        """A message of the window is being handled: a sign of life as of when it was received."""
        window.heartbeat.note()
        self._hear()

    def drive(self, key: str) -> None:
        """The window of ``key`` wants to move the arm by a control of its own.

        Raises LeaseError with the reason why it must not. Who touches a control first when nobody
        holds the arm, holds it.
        """
        window = self._windows.get(key)
        if window is None:
            raise LeaseError("Open the front page to drive the arm.")
        self._check_runs()
        self._grasp(window)

    def jog(self, window: Window, rates: Rates, frame: JogFrame) -> None:
        """Go with ``rates`` until the next jog, at most for JOG_TIME."""
        arm = self._check_runs()
        self._grasp(window)
        arm.jog(rates, frame)
        self._jogged = self.clock() if any(rates) else -JOG_TIME

    def move(self, window: Window, command: cmd.Command) -> int:
        """Any other command of whoever drives; its ticket."""
        arm = self._check_runs()
        self._grasp(window)
        return arm.put(command)

    def set_speed(self, window: Window, speed: float) -> None:
        self._grasp(window)
        if self.arm is not None:
            self.arm.limit(speed)

    # What time does

    def tick(self) -> None:
        """Look whether whoever drives is still there, and the arm; to be called every TICK."""
        t, arm = self.clock(), self.arm
        self._hear()
        silent = self._listen_for_silence(t)
        if arm is not None:
            # The arm stops by itself where nobody answers for whoever drives.
            if not silent:
                arm.beat()
            self._watch(arm)
            self.journal.follow(arm.ledger, self._who())
            self._agree_with(arm)
            self.performer.tick()

    def _hear(self) -> None:
        """Take over the newest sign of life of whoever drives, by when it was received."""
        holder = self.lease.holder
        window = None if holder is None else self._windows.get(holder.key)
        if window is not None:
            self.lease = self.lease.hear(window.person, window.heartbeat.newest)

    def _watch(self, arm: Arm) -> None:
        """Stop an arm whose process does not answer: it stops once it is there again."""
        age, due = arm.age, self._moves(self.clock()) or not arm.caught_up
        if self.stopped is None and due and age > 2 * self._hold_after:
            self._halt(Stopped(None, f"The arm's process did not answer for {age:.1f} s."))

    def _agree_with(self, arm: Arm) -> None:
        """What is stopped here is stopped there, and the other way round."""
        snapshot = arm.snapshot
        halted = snapshot.state.stopped is not None
        if self.stopped is not None:
            self.stopped = self.stopped.seen(snapshot)
            sent = self.stopped.ticket
            if not halted and (sent is None or snapshot.ticket >= sent):
                # An arm that came after the stop, or an error that undid it.
                self.stopped = self.stopped.requested(arm.stop())
        elif self.stopped is None and halted and arm.caught_up:
            self._halt(Stopped(None, "The arm lost the server and stopped."))

    def _who(self) -> str | None:
        """Who has a hand in what the arm does now."""
        if self.stopped is not None:
            return self.stopped.by
        return None if self.lease.holder is None else self.lease.holder.name

    def _listen_for_silence(self, t: float) -> bool:
        """Whether whoever drives is silent; an arm that moves is stopped then."""
        holder = self.lease.holder
        if holder is None or self.arm is None:
            return False
        silent = self.lease.silence(t) >= self._hold_after
        if silent and self.stopped is None and self._moves(t):
            there = holder.key in self._windows
            why = "fell silent" if there else "lost the connection"
            self._halt(Stopped(None, f"{holder.name} {why} while the arm moved."))
        self._change(self.lease.expire(t))
        return silent and self.lease.holder is not None

    def _moves(self, t: float) -> bool:
        return self.arm is not None and (self.arm.state.moving or t - self._jogged < JOG_TIME)

    def _change(self, lease: Lease) -> None:
        """Another holder finds an arm that stands and wants nothing."""
        if lease.holder != self.lease.holder:
            self._hold()
        self.lease = lease

    def _halt(self, stopped: Stopped) -> None:
        self._let_go()
        self.performer.stopped()
        if self.stopped is None:
            self.stopped = stopped
            log.warning("Stopped: %s", stopped.why)
        if self.arm is not None:
            self.stopped = self.stopped.requested(self.arm.stop())

    def _let_go(self) -> None:
        for _, drags in self._pictures.values():
            drags.clear()
        self._jogged = -JOG_TIME

    def _hold(self) -> None:
        self._let_go()
        if self.arm is not None:
            self.arm.hold()

    def _check_runs(self) -> Arm:
        arm = self.present()
        if self.stopped is not None:
            raise LeaseError("The arm is stopped: reset it first.")
        return arm

    def _grasp(self, window: Window) -> None:
        if self.lease.holder != window.person:
            self.acquire(window)

    def _meet(self, key: str, visitor: Identity) -> tuple[Person, int]:
        self._numbers += 1
        number = self._numbers
        name = visitor.name or f"Window {number}"
        known = [person for person, _ in self._remembered.values()]
        if any(person.name == name for person in known):
            name = f"{name} ({number})"
        return Person(key, name, visitor.role), number


def key_of(visitor: Identity, page: str) -> str:
    """What ties the sockets of one page together."""
    return f"{visitor.session}/{page}"
