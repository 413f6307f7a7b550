"""The owner of the present program: the page or API program that sent it."""

from __future__ import annotations

from katana450.arm.control.lease import Person, Role
from katana450.errors import LeaseError
from katana450.server.service.hub import Hub, Window
from katana450.server.service.identity import Identity


def program_identity(name: str, owner: Person) -> Identity:
    """Return the identity as which the program ``name`` of ``owner`` joins the hub."""
    return Identity(f"program of {owner.key}", name, Role.OPERATOR, owner.link, owner.address)


class ProgramOwner:
    """The owner of the present program, its heartbeats and its rights.

    Attributes:
        window: the window of the owner; None before the first program.
    """

    def __init__(self, hub: Hub, timeout: float) -> None:
        """Begin without an owner. ``timeout`` is the heartbeat timeout of the owner [s]."""
        self.window: Window | None = None
        self._hub = hub
        self._timeout = timeout
        self._seen = 0.0

    def change_to(self, window: Window, t: float) -> None:
        """Make ``window`` the owner at the time ``t`` [s]."""
        self.window, self._seen = window, t

    @property
    def is_here(self) -> bool:
        """True if the owner is connected."""
        return self._connected is not None

    def is_silent(self, t: float) -> bool:
        """Return whether no heartbeat was received for the heartbeat timeout before ``t`` [s]."""
        connected = self._connected
        if connected is not None:
            self._seen = max(self._seen, connected.heartbeat.newest)
        return t - self._seen > self._timeout

    def is_person(self, person: Person) -> bool:
        """Return whether ``person`` is the owner."""
        return self.window is not None and self.window.person.key == person.key

    def check_may_steer(self, person: Person) -> None:
        """Raise LeaseError if ``person`` is not the owner and may not take the lease from it."""
        window = self.window
        if window is not None and not self.is_person(person) and not person.role.may_take:
            raise LeaseError(f"The program belongs to {window.person.name}.")

    @property
    def _connected(self) -> Window | None:
        """The present window of the owner, a new one after a page has reloaded."""
        return None if self.window is None else self._hub.window(self.window.person.key)
