"""Requests about who holds the arm."""

from __future__ import annotations

from typing import ClassVar

from katana450.server.api.fields import LEASE, Request, RequestTraits


class Acquire(Request, frozen=True):
    """Have the arm if nobody has it. A command by whoever holds nothing asks for this by itself."""

    traits: ClassVar[RequestTraits] = LEASE


class Take(Request, frozen=True):
    """Have it even so: for admins."""

    traits: ClassVar[RequestTraits] = LEASE


class Ask(Request, frozen=True):
    """Ask whoever has it."""

    traits: ClassVar[RequestTraits] = LEASE


class Withdraw(Request, frozen=True):
    """Ask no more."""

    traits: ClassVar[RequestTraits] = LEASE


class ReleaseLease(Request, frozen=True):
    """Give up the arm, so that others can have it."""

    traits: ClassVar[RequestTraits] = LEASE


class Give(Request, frozen=True, kw_only=True):
    """Give the arm to the window or program of that number.

    The owner of the program that runs may do this too, which ends the program.
    """

    traits: ClassVar[RequestTraits] = LEASE

    to: int


class Decline(Request, frozen=True, kw_only=True):
    """Decline the request for the arm of the window or program of that number.

    For the holder of the arm, or the owner of the program that runs.
    """

    traits: ClassVar[RequestTraits] = LEASE

    to: int
