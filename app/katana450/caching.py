"""Cached properties of values that several threads share."""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING, Any

__all__ = ["cached_property"]

if TYPE_CHECKING:
    from functools import cached_property  # noqa: TID251
else:

    class cached_property(functools.cached_property):  # noqa: N801, TID251
        """A cached property whose first read may happen while another thread pickles the object.

        The first read adds an entry to the dictionary of the object, through which pickle must not
        walk meanwhile.
        """

        def __set_name__(self, owner: type, name: str) -> None:
            super().__set_name__(owner, name)
            if owner.__getstate__ is object.__getstate__:
                owner.__getstate__ = _state


def _state(value: Any) -> dict[str, Any]:
    """Return a copy of the attributes of ``value``, made in one step of the interpreter."""
    attributes: dict[str, Any] = vars(value)
    return attributes.copy()
