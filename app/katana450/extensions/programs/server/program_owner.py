"""The owner of the present program: the page or API program that sent it."""

from __future__ import annotations

import logging
from datetime import UTC, datetime

from katana450.arm.control.lease import Person, Role
from katana450.errors import LeaseError
from katana450.server.service.heartbeats import LastHeartbeat
from katana450.server.service.hub import Hub
from katana450.server.service.identity import Identity
from katana450.server.service.participants import Participant, session_of

log = logging.getLogger(__name__)


def program_identity(name: str, owner: Person) -> Identity:
    """Return the identity as which the program ``name`` of ``owner`` joins the hub."""
    return Identity(
        f"program of {owner.key}", name, Role.OPERATOR, link=owner.link, address=owner.address
    )


def check_may_drive(person: Person) -> None:
    """Raise LeaseError if the role of ``person`` allows only to watch."""
    if not person.role.may_drive:
        raise LeaseError("You may watch, not drive.")


class AlwaysAlive(LastHeartbeat):
    """The heartbeat of a program, always up to date because it runs in this thread.

    The heartbeat of the owner is monitored instead.
    """

    @property
    def newest(self) -> float:
        """Present time [s]."""
        return self._clock()


class ProgramOwner:
    """The owner of the present program, its heartbeats and its rights.

    Attributes:
        participant: the owner; None before the first program.
        unattended: whether the program runs, or is to run, without heartbeats of the owner.
        began: time at which the run began; None before that.
    """

    def __init__(self, hub: Hub, timeout: float, *, may_be_unattended: bool = True) -> None:
        """Begin without an owner.

        ``timeout`` is the heartbeat timeout of the owner [s]. ``may_be_unattended``: whether
        programs may run unattended.
        """
        self.participant: Participant | None = None
        self.unattended = False
        self.began: datetime | None = None
        self._allowed = may_be_unattended
        self._hub = hub
        self._timeout = timeout
        self._seen = 0.0

    def change_to(self, participant: Participant, t: float) -> None:
        """Make ``participant`` the owner of a program that has not begun, at the time ``t`` [s]."""
        self.participant, self._seen = participant, t
        self.unattended, self.began = False, None

    def begin(self, participant: Participant, t: float, *, unattended: bool) -> None:
        """Make ``participant`` the owner of a run that begins at the time ``t`` [s]."""
        self.change_to(participant, t)
        self.unattended, self.began = unattended, datetime.now(UTC)

    def check_unattended(self, *, unattended: bool) -> None:
        """Raise LeaseError if an ``unattended`` run is not allowed."""
        if unattended and not self._allowed:
            raise LeaseError("Unattended programs are not allowed on this server.")

    @property
    def is_here(self) -> bool:
        """True if the owner is connected."""
        return self._connected is not None

    def is_missing(self, t: float) -> bool:
        """Return whether the owner has to be present at ``t`` [s] and sends no heartbeats."""
        return self.is_silent(t) and not self.unattended

    def is_silent(self, t: float) -> bool:
        """Return whether no heartbeat was received for the heartbeat timeout before ``t`` [s]."""
        connected = self._connected
        if connected is not None:
            self._seen = max(self._seen, connected.heartbeat.newest)
        return t - self._seen > self._timeout

    def is_person(self, person: Person) -> bool:
        """Return whether ``person`` is the owner.

        Another window of the owner's link or browser is so once the owner of an unattended program
        has left.
        """
        if self.participant is None:
            return False
        owner = self.participant.person.key
        if self.unattended and not self.is_here:
            return session_of(person.key) == session_of(owner)
        return person.key == owner

    def check_may_steer(self, person: Person) -> None:
        """Raise LeaseError if ``person`` is not the owner and may not take the lease from it."""
        participant = self.participant
        if participant is not None and not self.is_person(person) and not person.role.may_take:
            raise LeaseError(f"The program belongs to {participant.person.name}.")

    def superseded_by(self, sender: Participant) -> str:
        """Return why the program that is being planned gives way to a new one of ``sender``.

        Raises LeaseError if it does not: planning may take two minutes, and then blocks all but the
        driver.
        """
        if self.is_silent(self._hub.clock()):
            return "Its owner sends no heartbeats."
        owner, drives = self.participant, self._hub.lease.holder == sender.person
        if owner is None or owner.person == sender.person or not drives:
            raise LeaseError("Another program is being planned. Cancel it, or wait for it.")
        why = f"{sender.person.name}, who drives, has sent another program."
        owner.notify({"is": "refused", "why": f"Your program is not planned any more. {why}"})
        return why

    @property
    def _connected(self) -> Participant | None:
        """The owner as it is connected now; its page may have reloaded."""
        return (
            None if self.participant is None else self._hub.participant(self.participant.person.key)
        )
