"""Requests about the lease, the right to drive the arm, and the names of its users."""

from __future__ import annotations

from typing import Annotated, ClassVar

from msgspec import Meta

from katana450.arm.control.act import Request, Traits
from katana450.server.api.fields import LEASE


class Acquire(Request, frozen=True):
    """Acquire the lease if it is free. A command does this by itself while the lease is free."""

    traits: ClassVar[Traits] = LEASE


class Take(Request, frozen=True):
    """Take the lease from its holder. For admins only."""

    traits: ClassVar[Traits] = LEASE


class Ask(Request, frozen=True):
    """Ask the holder of the lease to hand it over.

    While a program holds the lease, the owner of the program is asked.
    """

    traits: ClassVar[Traits] = LEASE


class Withdraw(Request, frozen=True):
    """Withdraw your own request for the lease."""

    traits: ClassVar[Traits] = LEASE


class ReleaseLease(Request, frozen=True):
    """Release the lease, so that others can acquire it."""

    traits: ClassVar[Traits] = LEASE


class Give(Request, frozen=True, kw_only=True):
    """Hand the lease over to another page or program.

    The holder may do this, and the owner of the running program, which ends the program.

    Attributes:
        to: Number of the page or program.
    """

    traits: ClassVar[Traits] = LEASE

    to: int


class Decline(Request, frozen=True, kw_only=True):
    """Decline the request of another page or program for the lease.

    The holder may do this, and the owner of the running program.

    Attributes:
        to: Number of the page or program.
    """

    traits: ClassVar[Traits] = LEASE

    to: int


class Rename(Request, frozen=True, kw_only=True):
    """Choose the name that others see. Refused if it is empty, too long or taken.

    Attributes:
        name: Name, of at most 24 characters. That of an access link cannot be changed.
    """

    traits: ClassVar[Traits] = Traits()

    name: Annotated[str, Meta(max_length=200)]
