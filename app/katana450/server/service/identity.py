"""Identity of a client that may come in."""

from __future__ import annotations

from dataclasses import dataclass

from katana450.arm.control.lease import Role


@dataclass(frozen=True)
class Identity:
    """A client that was let in.

    Attributes:
        session: tells browsers and programs apart.
        name: that of the access link; None without one.
        role: what the client may do.
    """

    session: str
    name: str | None
    role: Role
