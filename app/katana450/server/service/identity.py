"""Identity of an accepted client."""

from __future__ import annotations

import re
from dataclasses import dataclass

from katana450.arm.control.lease import Person, Role

PAGE = re.compile(r"[A-Za-z0-9_-]{16,64}")
"""Form of the secret key that a page chooses for itself."""


@dataclass(frozen=True)
class Identity:
    """Identity of an accepted client.

    Attributes:
        session: Text that identifies the browser, the program or the access link.
        name: Name of the access link or of a program; None for a browser without a link.
        role: Role of the client.
        link: Number of the access link; empty without one.
        address: Network address of the client; empty if it is unknown.
    """

    session: str
    name: str | None
    role: Role
    link: str = ""
    address: str = ""

    def person(self, key: str, name: str) -> Person:
        """Return the client as the participant of ``key`` that is shown as ``name``."""
        return Person(key, name, self.role, self.link, self.address)
