"""Names and archives of exported files: the same robot gives the same bytes."""

from __future__ import annotations

import io
import re
import zipfile
from collections.abc import Container, Iterable, Mapping


def distinct(names: Iterable[str], reserved: Container[str] = ()) -> list[str]:
    """Return an identifier of letters, digits and `_` for each name.

    No two identifiers are equal, even without regard to case.
    A name that is a valid identifier stays, unless it is ``reserved`` or was used before.
    """
    identifiers: list[str] = []
    used: set[str] = set()
    for name in names:
        plain = re.sub(r"[^A-Za-z0-9_]", "_", name)
        plain = plain if re.match(r"[A-Za-z]", plain) else f"n{plain}"
        candidate, number = plain, 2
        while candidate.lower() in used or candidate in reserved:
            candidate, number = f"{plain}_{number}", number + 1
        used.add(candidate.lower())
        identifiers.append(candidate)
    return identifiers


EPOCH = (1980, 1, 1, 0, 0, 0)
"""Time stamp of every file in the zip: the same robot gives the same bytes."""


def zipped(files: Mapping[str, bytes], comment: str = "", mode: int = 0) -> bytes:
    """Return a zip of ``files`` by their names, with their permissions ``mode`` if it is given."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        archive.comment = comment.encode()
        for name, content in sorted(files.items()):
            entry = zipfile.ZipInfo(name, EPOCH)
            entry.external_attr = mode << 16
            archive.writestr(entry, content, zipfile.ZIP_DEFLATED)
    return buffer.getvalue()
