"""A context that names the private part of viser in the error of a test."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def part(name: str) -> Iterator[None]:
    """Name the private part in the message of every error in the block.

    ``name``: as in the first column of docs/viser.md.
    """
    try:
        yield
    except Exception as error:
        raise AssertionError(
            f"viser's {name} is not as docs/viser.md describes it: "
            f"{type(error).__name__}: {error}. That list names the dependent files."
        ) from error
