"""Names that other languages allow, and no two alike."""

from __future__ import annotations

import re
from collections.abc import Container, Iterable


def distinct(names: Iterable[str], reserved: Container[str] = ()) -> list[str]:
    """An identifier of letters, digits and `_` for each name, all different also in lower case.

    A name that is one already stays, unless it is `reserved` or was there before.
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
