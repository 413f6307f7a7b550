"""Pages and programs that are recognised when they return."""

from __future__ import annotations

from collections.abc import Container
from dataclasses import replace

from katana450.arm.control.actor import Actor
from katana450.arm.control.lease import Person
from katana450.arm.control.stop_cause import UNNAMED
from katana450.server.service.identity import Identity
from katana450.server.service.names import free_name

MAX_PAGES = 256
"""Number of pages that are recognised when they return."""


class KnownPages:
    """Person and number of each page, also of pages that are closed now."""

    def __init__(self) -> None:
        """Create a memory without pages."""
        self._known: dict[str, tuple[Person, int]] = {}
        self._numbers = 0

    @property
    def people(self) -> list[Person]:
        """The persons at these pages. For any thread."""
        # A copy: other threads add people.
        return [person for person, _ in list(self._known.values())]

    def find(self, key: str) -> Person | None:
        """Return the person at the page of ``key``; None for an unknown page."""
        return self._known.get(key, (None, 0))[0]

    def named(self, actor: Actor) -> Actor:
        """Return ``actor`` with the name of its page where the process of STOP knew none."""
        person = self.find(actor.key) if actor.name == UNNAMED else None
        return actor if person is None else replace(actor, person=person)

    def recognise(
        self, key: str, identity: Identity, open_now: Container[str]
    ) -> tuple[Person, int]:
        """Return person and number of the page of ``key``; a new page gets new ones.

        ``open_now``: keys of the open pages; of the others the oldest are forgotten.
        """
        known = self._known.pop(key, None)
        person, number = known or self._new(key, identity)
        # A page that returns may have another address.
        person = replace(person, link=identity.link, address=identity.address)
        self._known[key] = (person, number)
        absent = [each for each in self._known if each not in open_now and each != key]
        for each in absent[: max(len(self._known) - MAX_PAGES, 0)]:
            del self._known[each]
        return person, number

    def rename(self, person: Person, number: int) -> None:
        """Remember the new name of ``person``."""
        self._known[person.key] = (person, number)

    def forget(self, key: str) -> None:
        """Forget the page of ``key``."""
        self._known.pop(key, None)

    def _new(self, key: str, identity: Identity) -> tuple[Person, int]:
        self._numbers += 1
        name = free_name(identity.name, self._numbers, self.people)
        return identity.person(key, name), self._numbers
