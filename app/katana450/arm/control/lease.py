"""Who drives the arm: one person at a time, by a lease that silence ends.

A lease is a value; every event makes another one. What may not happen raises a LeaseError and so
changes nothing. Time comes in as an argument, in seconds on any clock that only goes forwards.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import Enum
from typing import Self

from katana450.errors import LeaseError

HEARTBEAT_INTERVAL = 0.1
"""[s] Between two heartbeats that whoever drives is asked for."""

LEASE_TIMEOUT = 3.0
"""[s] Of silence: a page that reloads is back sooner, one that is gone must not keep the arm."""


class Role(Enum):
    """What a person may do; each may do what those before it may."""

    VIEWER = "viewer"
    """Watch, and stop the arm."""
    OPERATOR = "operator"
    """Drive the arm when nobody else does."""
    ADMIN = "admin"
    """Take the arm from whoever drives it."""

    @property
    def may_drive(self) -> bool:
        return self is not Role.VIEWER

    @property
    def may_take(self) -> bool:
        return self is Role.ADMIN


@dataclass(frozen=True)
class Person:
    """Somebody at a page. ``key`` tells pages apart; nobody reads it."""

    key: str
    name: str
    role: Role


@dataclass(frozen=True)
class Lease:
    """Who holds the arm.

    Attributes:
        holder: the one person who may move the arm, if there is one.
        heard: when the holder last gave a heartbeat [s].
        waiting: who has asked for the arm, the first to ask first; never the holder.
    """

    holder: Person | None = None
    heard: float = -math.inf
    waiting: tuple[Person, ...] = ()

    def acquire(self, person: Person, t: float) -> Self:
        """A free arm is given to ``person``; one that is held is not."""
        _check_may_drive(person)
        if self.holder == person:
            raise LeaseError("You hold the arm already.")
        if self.holder is not None:
            raise LeaseError(f"{self.holder.name} holds the arm: ask for it.")
        return self._given(person, t)

    def take(self, person: Person, t: float) -> Self:
        """The arm is taken from whoever holds it."""
        _check_may_drive(person)
        if self.holder == person:
            raise LeaseError("You hold the arm already.")
        if self.holder is not None and not person.role.may_take:
            raise LeaseError(f"Only an admin may take the arm from {self.holder.name}: ask for it.")
        return self._given(person, t)

    def request(self, person: Person) -> Self:
        """``person`` asks whoever holds the arm for it."""
        _check_may_drive(person)
        if self.holder is None:
            raise LeaseError("Nobody holds the arm: you can have it at once.")
        if self.holder == person:
            raise LeaseError("You hold the arm already.")
        if person in self.waiting:
            raise LeaseError(f"You have asked {self.holder.name} already.")
        return replace(self, waiting=(*self.waiting, person))

    def withdraw(self, person: Person) -> Self:
        """``person`` does not want the arm any more."""
        if person not in self.waiting:
            raise LeaseError("You have not asked for the arm.")
        return self._without(person)

    def decline(self, holder: Person, person: Person) -> Self:
        """Return the lease without the request of ``person``, which the holder declines."""
        self._check_holds(holder)
        if person not in self.waiting:
            raise LeaseError("The request for the arm was withdrawn.")
        return self._without(person)

    def hand_over(self, giver: Person, taker: Person, t: float) -> Self:
        """The holder gives the arm to ``taker``, who need not have asked."""
        self._check_holds(giver)
        _check_may_drive(taker)
        if taker == giver:
            raise LeaseError("You hold the arm already.")
        return self._given(taker, t)

    def release(self, person: Person) -> Self:
        """The holder lets go; the arm is free, and those who wait may have it."""
        self._check_holds(person)
        return replace(self, holder=None, heard=-math.inf)

    def hear(self, person: Person, t: float) -> Self:
        """A heartbeat of the holder."""
        self._check_holds(person)
        return replace(self, heard=max(t, self.heard))

    def leave(self, person: Person) -> Self:
        """``person`` is gone: asks for nothing any more, and keeps the arm only until LOST_AFTER.

        A line that breaks is no wish to give up the arm, and a reloaded page is soon back.
        """
        return self._without(person)

    def expire(self, t: float) -> Self:
        """Free, once the holder has been silent for LOST_AFTER; else as it was."""
        if self.holder is None or self.silence(t) < LEASE_TIMEOUT:
            return self
        return replace(self, holder=None, heard=-math.inf)

    def silence(self, t: float) -> float:
        """How long the holder has given no heartbeat [s]; 0 when nobody holds the arm."""
        return 0.0 if self.holder is None else max(t - self.heard, 0.0)

    def _given(self, person: Person, t: float) -> Self:
        return replace(self._without(person), holder=person, heard=t)

    def _without(self, person: Person) -> Self:
        return replace(self, waiting=tuple(each for each in self.waiting if each != person))

    def _check_holds(self, person: Person) -> None:
        if self.holder != person:
            raise LeaseError("You do not hold the arm.")


def _check_may_drive(person: Person) -> None:
    if not person.role.may_drive:
        raise LeaseError(f"{person.name} may only watch.")
