"""Requests about the lease, the right to drive the arm."""

from __future__ import annotations

from typing import ClassVar

from katana450.server.api.fields import LEASE, Request, RequestTraits


class Acquire(Request, frozen=True):
    """Acquire the lease if it is free. A command does this by itself while the lease is free."""

    traits: ClassVar[RequestTraits] = LEASE


class Take(Request, frozen=True):
    """Take the lease from its holder. For admins only."""

    traits: ClassVar[RequestTraits] = LEASE


class Ask(Request, frozen=True):
    """Ask the holder for the arm; the owner of the program that runs is asked for its program."""

    traits: ClassVar[RequestTraits] = LEASE


class Withdraw(Request, frozen=True):
    """Withdraw the own request for the arm."""

    traits: ClassVar[RequestTraits] = LEASE


class ReleaseLease(Request, frozen=True):
    """Release the lease, so that others can acquire it."""

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
