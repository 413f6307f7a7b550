"""Tests of viser's private parts name the part that they are about."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def part(name: str) -> Iterator[None]:
    """Name the private part in the message of whatever fails in the block.

    ``name``: as in the first column of docs/viser.md.
    """
    try:
        yield
    except Exception as error:
        raise AssertionError(
            f"viser's {name} is not as docs/viser.md describes it: "
            f"{type(error).__name__}: {error}. See there what depends on it."
        ) from error
