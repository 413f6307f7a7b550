"""The version of the installed program."""

from __future__ import annotations


def version() -> str:
    """Return the version of the installed package."""
    # This library takes longer than all else that the command line needs.
    from importlib import metadata

    try:
        return metadata.version("katana450")
    except metadata.PackageNotFoundError:
        return "(not installed)"
