"""Requests of admins about everybody who is connected."""

from __future__ import annotations

from typing import Annotated, ClassVar

from msgspec import Meta

from katana450.arm.control.act import Request, Traits
from katana450.server.api.fields import ADMIN

MAX_TIME_OUT = 86_400.0
"""Maximum time [s] for which an admin keeps somebody out without revoking the link."""


class ListPeople(Request, frozen=True):
    """List everybody who is connected or kept out. For admins only."""

    traits: ClassVar[Traits] = Traits(admin=True, answered=True, extension=True)


class Kick(Request, frozen=True, kw_only=True):
    """Close all connections of a person, and keep the person out for a while. For admins only.

    The person can still stop the arm over HTTP. A running program of the person ends, also an
    unattended one.

    Attributes:
        person: Number of the person in ``people``.
        seconds: Time [s] after which the person may come back; 0 lets the person in at once.
        revoke: Whether to revoke the access link for good. An admin's link is revoked by
            ``katana450 access revoke`` alone.
    """

    traits: ClassVar[Traits] = ADMIN

    person: int
    seconds: Annotated[float, Meta(ge=0.0, le=MAX_TIME_OUT)] = 60.0
    revoke: bool = False
