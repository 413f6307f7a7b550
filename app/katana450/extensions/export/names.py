"""Distinct identifiers for other languages."""

from __future__ import annotations

import re
from collections.abc import Container, Iterable


def distinct(names: Iterable[str], reserved: Container[str] = ()) -> list[str]:
    """Return an identifier of letters, digits and `_` for each name.

    No two identifiers are equal, even without regard to case.
    A name that is a valid identifier stays, unless it is ``reserved`` or was used before.
    """
    found: list[str] = []
    taken: set[str] = set()
    for name in names:
        plain = re.sub(r"[^A-Za-z0-9_]", "_", name)
        plain = plain if re.match(r"[A-Za-z]", plain) else f"n{plain}"
        candidate, number = plain, 2
        while candidate.lower() in taken or candidate in reserved:
            candidate, number = f"{plain}_{number}", number + 1
        taken.add(candidate.lower())
        found.append(candidate)
    return found
