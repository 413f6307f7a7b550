"""Identity of an accepted client."""

from __future__ import annotations

from dataclasses import dataclass

from katana450.arm.control.lease import Role


@dataclass(frozen=True)
class Identity:
    """Identity of an accepted client.

    Attributes:
        session: Text that identifies the browser, the program or the access link.
        name: Name of the access link or of a program; None for a browser without a link.
        role: Role of the client.
        link: Name of the access link, also of a program with a name of its own; empty without one.
        muted: Interval [s] in which one STOP counts; None unless the access file has a mute.
    """

    session: str
    name: str | None
    role: Role
    link: str = ""
    muted: float | None = None
