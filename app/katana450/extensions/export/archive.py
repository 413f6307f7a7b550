"""Zip archives that depend on their files alone."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Mapping

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
