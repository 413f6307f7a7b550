"""The library of Parquet files, which is an extra of the package."""

from __future__ import annotations

from typing import Any

from katana450.extras import library


def arrow() -> tuple[Any, Any]:
    """Return the modules ``pyarrow`` and ``pyarrow.parquet``.

    Raises MissingExtraError if pyarrow is not installed.
    """
    what = "Parquet files and LeRobot datasets"
    return library("pyarrow", "datasets", what), library("pyarrow.parquet", "datasets", what)
