"""Names that people choose for themselves."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable
from dataclasses import replace

from katana450.arm.control.lease import Person
from katana450.errors import InputError

MAX_NAME = 24
"""Maximum number of characters of a name."""


BLANK = re.compile("[\u115f\u1160\u2800\u3164\uffa0]")
"""Printable characters that show nothing."""

RESERVED = re.compile(r"you|somebody|nobody|(the )?server|(window|program) \d+.*")
"""Names by which the page means someone else."""

MAX_MARKS = 2
"""Maximum number of marks on one letter."""


ACTS = "pressed STOP|ended it|cancelled the planning|went to step|runs it from"
"""Pattern of the acts of people in sentences."""


def addressed(words: str, name: str) -> str:
    """Return ``words`` for the person ``name``, who is "You" where they say what that one did."""
    return re.sub(rf"^{re.escape(name)} (?={ACTS})", "You ", words).replace("You runs", "You run")


def free_name(name: str | None, number: int, others: Iterable[Person]) -> str:
    """Return ``name``, or "Window" without one, with ``number`` where it is needed."""
    name = name or f"Window {number}"
    return f"{name} ({number})" if any(each.name == name for each in others) else name


def renamed(person: Person, name: str, others: Iterable[Person]) -> Person:
    """Return ``person`` with ``name``, with single spaces.

    Raises InputError if the name is empty, too long, not printable, reserved, or that of one of
    ``others``, and for a person whose name is that of an access link.
    """
    name = " ".join(unicodedata.normalize("NFKC", name).split())
    if person.link:
        raise InputError("Your name is that of your access link. An admin can change it.")
    if name == person.name:
        return person
    if not name:
        raise InputError("The name is empty. Type at least one character.")
    if len(name) > MAX_NAME:
        raise InputError(f"The name has {len(name)} characters. The maximum is {MAX_NAME}.")
    marks = "".join("m" if unicodedata.combining(each) else " " for each in name)
    if not name.isprintable() or BLANK.search(name) or "m" * (MAX_MARKS + 1) in marks:
        raise InputError("The name has characters that cannot be shown. Choose another name.")
    if not any(each.isalnum() for each in name) or RESERVED.fullmatch(name.casefold()):
        raise InputError(f"{name} is not a name of one person. Choose another name.")
    plain = name.casefold()
    if any(each.key != person.key and each.name.casefold() == plain for each in others):
        raise InputError(f"The name {name} is taken. Choose another name.")
    return replace(person, name=name)
