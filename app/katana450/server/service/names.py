"""Names that people choose for themselves."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from katana450.arm.control.lease import Person
from katana450.errors import InputError

MAX_NAME = 24
"""Maximum number of characters of a name."""


def free_name(name: str | None, number: int, others: Iterable[Person]) -> str:
    """Return ``name``, or "Window" without one, with ``number`` where it is needed."""
    name = name or f"Window {number}"
    return f"{name} ({number})" if any(each.name == name for each in others) else name


def renamed(person: Person, name: str, others: Iterable[Person]) -> Person:
    """Return ``person`` with ``name``, with single spaces.

    Raises InputError if the name is empty, too long, not printable, or that of one of ``others``,
    and for a person whose name is that of an access link.
    """
    name = " ".join(name.split())
    if person.link:
        raise InputError("Your name is that of your access link. An admin can change it.")
    if not name:
        raise InputError("The name is empty. Type at least one character.")
    if len(name) > MAX_NAME:
        raise InputError(f"The name has {len(name)} characters. The maximum is {MAX_NAME}.")
    if not name.isprintable():
        raise InputError("The name has characters that cannot be shown. Choose another name.")
    if any(each != person and each.name.casefold() == name.casefold() for each in others):
        raise InputError(f"The name {name} is taken. Choose another name.")
    return replace(person, name=name)
