"""The version of the installed program."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError
from importlib.metadata import version as installed


def version() -> str:
    """Return the version of the installed package."""
    try:
        return installed("katana450")
    except PackageNotFoundError:
        return "(not installed)"
