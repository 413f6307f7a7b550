"""Identity of an accepted client."""

from __future__ import annotations

import re
from dataclasses import dataclass

from katana450.arm.control.lease import Role

PAGE = re.compile(r"[A-Za-z0-9_-]{16,64}")
"""Form of the secret key that a page chooses for itself."""


@dataclass(frozen=True)
class Identity:
    """Identity of an accepted client.

    Attributes:
        session: Text that identifies the browser, the program or the access link.
        name: Name of the access link; None without one.
        role: Role of the client.
    """

    session: str
    name: str | None
    role: Role
