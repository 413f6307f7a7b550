"""Which version of the program this is."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError
from importlib.metadata import version as installed


def version() -> str:
    """Of the installed package."""
    try:
        return installed("katana450")
    except PackageNotFoundError:
        return "(not installed)"
