"""Everybody who is here, who of them drives, and whether the arm is stopped.

Lives in the gateway's one thread; what it decides reaches the arm through the mailbox.
"""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from app.api.fields import Rates
from app.control import commands as cmd
from app.control.choices import Choice
from app.control.commands import JOG_TIME
from app.control.lease import Lease, Person
from app.control.ledger import Entry
from app.control.margins import Margins
from app.control.pouring import Pouring
from app.control.state import State
from app.control.things import Surroundings
from app.errors import LeaseError
from app.exchange.machine import Machine
from app.exchange.meshes import Meshes
from app.gateway.door import Visitor
from app.gateway.journal import Journal
from app.gateway.nodes import Nodes
from app.gateway.performer import Performer
from app.gateway.scenes import Scenes
from app.geometry.arrays import FloatArray
from app.kinematics.velocity import JogFrame
from app.programs.bench import Rig
from app.robot.model import RobotModel
from app.runtime.board import Snapshot
from app.runtime.lateness import Lateness
from app.settings import Settings

log = logging.getLogger(__name__)

TICK = 0.02
"""[s] Between two looks at whether somebody has fallen silent."""

REMEMBERED = 256
"""Pages that are known again when they come back, and presses of STOP that are told again."""


class Arm(Protocol):
    """What the gateway asks of the arm; ``Motion`` is one."""

    @property
    def model(self) -> RobotModel | Machine: ...

    @property
    def robot(self) -> RobotModel: ...

    @property
    def nodes(self) -> Nodes: ...

    @property
    def snapshot(self) -> Snapshot: ...

    @property
    def state(self) -> State: ...

    @property
    def ready(self) -> FloatArray: ...

    @property
    def rig(self) -> Rig: ...

    @property
    def lateness(self) -> Lateness: ...

    @property
    def surroundings(self) -> Surroundings: ...

    @property
    def pouring(self) -> Pouring | None: ...

    @property
    def holding(self) -> FloatArray | None: ...

    @property
    def margins(self) -> Margins: ...

    @property
    def ledger(self) -> Sequence[Entry]: ...

    @property
    def caught_up(self) -> bool: ...

    @property
    def busy(self) -> bool: ...

    def beat(self) -> None: ...

    def stop(self) -> None: ...

    def release(self) -> None: ...

    def hold(self) -> None: ...

    def jog(self, rates: Rates, frame: JogFrame) -> None: ...

    def limit(self, share: float) -> None: ...

    def put(self, command: cmd.Command) -> int: ...

    def choices(self) -> tuple[Choice, ...]: ...


class Behind(Protocol):
    """How far a window's picture is behind; ``Flow`` is one."""

    def age(self, t: float) -> float: ...


@dataclass(frozen=True)
class Stopped:
    """Why nothing moves. ``by`` is nobody when the gateway itself stopped the arm."""

    by: str | None
    why: str


@dataclass(frozen=True, eq=False)
class Window:
    """One open page; ``tell`` leaves it a notice."""

    person: Person
    number: int
    tell: Callable[[dict[str, Any]], None]


class Hub:
    """The one place where it is decided who may move the arm. Times are in seconds."""

    def __init__(
        self,
        clock: Callable[[], float],
        hold_after: float = Settings.silence,
        meshes: Meshes | None = None,
    ) -> None:
        """``hold_after``: silence of whoever drives [s] that stops an arm that moves. ``meshes``:
        those there are at first."""
        self.clock = clock
        self._hold_after = hold_after
        self.lease = Lease()
        self.stopped: Stopped | None = None
        self.arm: Arm | None = None
        """None until the arm is there."""
        self.journal = Journal()
        self.performer = Performer(self)
        self.meshes = Meshes() if meshes is None else meshes
        self.scenes = Scenes(self.meshes)
        self._windows: dict[str, Window] = {}
        self._pictures: dict[Behind, tuple[str, set[str]]] = {}
        self._remembered: dict[str, tuple[Person, int]] = {}
        self._numbers = 0
        self._presses: deque[str] = deque(maxlen=REMEMBERED)
        self._jogged = -JOG_TIME
        self._looked = clock()

    # Coming and going

    def join(self, visitor: Visitor, page: str, tell: Callable[[dict[str, Any]], None]) -> Window:
        """A page opens its control socket; one that comes back is who it was."""
        key = key_of(visitor, page)
        known = self._remembered.pop(key) if key in self._remembered else None
        person, number = known or self._meet(key, visitor)
        self._remembered[key] = (person, number)
        while len(self._remembered) > REMEMBERED:
            self._remembered.pop(next(iter(self._remembered)))
        window = Window(person, number, tell)
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
        if press is not None:
            if press in self._presses:
                return
            self._presses.append(press)
        self._halt(Stopped(name, f"{name} pressed STOP."))

    def reset(self, window: Window) -> None:
        """End a stop; the arm stays where it is until somebody moves it afresh."""
        self._grasp(window)
        self.stopped = None
        if self.arm is not None:
            self.arm.release()

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
        """A sign of life."""
        if self.lease.holder == window.person:
            self.lease = self.lease.hear(window.person, self.clock())

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
        """Look whether whoever drives is still there; to be called every TICK."""
        t = self.clock()
        late = t - self._looked > self._hold_after / 2
        self._looked = t
        # When this thread was held up itself, what came in the meantime is read first.
        if not late:
            self._listen_for_silence(t)
        if self.arm is not None:
            self.arm.beat()
            self.journal.follow(self.arm.ledger, self._who())
            self._agree_with(self.arm)
            self.performer.tick()

    def _agree_with(self, arm: Arm) -> None:
        """What is stopped here is stopped there, and the other way round."""
        halted = arm.state.halted is not None
        if self.stopped is not None and not halted:
            # An arm that came after the stop, or an error that undid it.
            arm.stop()
        elif self.stopped is None and halted and arm.caught_up:
            self._halt(Stopped(None, "The arm lost the server and stopped."))

    def _who(self) -> str | None:
        """Who has a hand in what the arm does now."""
        if self.stopped is not None:
            return self.stopped.by
        return None if self.lease.holder is None else self.lease.holder.name

    def _listen_for_silence(self, t: float) -> None:
        holder = self.lease.holder
        if holder is None or self.arm is None:
            return
        silent = self.lease.silence(t) >= self._hold_after
        if silent and self.stopped is None and self._moves(t):
            self._halt(Stopped(None, f"The line to {holder.name} broke while the arm moved."))
        self._change(self.lease.expire(t))

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
        if self.arm is not None:
            self.arm.stop()
        if self.stopped is None:
            self.stopped = stopped
            log.warning("Stopped: %s", stopped.why)

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

    def _meet(self, key: str, visitor: Visitor) -> tuple[Person, int]:
        self._numbers += 1
        number = self._numbers
        name = visitor.name or f"Window {number}"
        known = [person for person, _ in self._remembered.values()]
        if any(person.name == name for person in known):
            name = f"{name} ({number})"
        return Person(key, name, visitor.role), number


def key_of(visitor: Visitor, page: str) -> str:
    """What ties the sockets of one page together."""
    return f"{visitor.session}/{page}"
