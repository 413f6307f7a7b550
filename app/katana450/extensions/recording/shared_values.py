"""Large values that many others share: each is written once, and named by a key from then on.

The key is a hash of its form, so equal values have one key, in every file.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

from katana450.extensions.recording.forms import FormError, shown

KEY_BYTES = 16
"""Length of a key [bytes]; in text it has twice as many digits."""

MAX_REMEMBERED = 128
"""Maximum number of values that are recognized by identity, without their forms."""


class SharedText(NamedTuple):
    """The text of a shared value: the name of its class, its key and its form as JSON."""

    kind: str
    key: str
    text: bytes


def key_of(text: bytes) -> str:
    """Return the key of a value with the form ``text``."""
    return hashlib.blake2b(text, digest_size=KEY_BYTES).hexdigest()


class SharedValues:
    """The shared values of one file, while it is written or read."""

    def __init__(self) -> None:
        self._by_id: dict[int, tuple[str, Any]] = {}
        self._keys: set[str] = set()
        self._texts: dict[str, SharedText] = {}
        self._values: dict[str, Any] = {}
        self._new: list[SharedText] = []

    def key(self, value: Any, text: Callable[[Any], bytes]) -> str:
        """Return the key of ``value``. ``text`` returns the form of a value that is not known."""
        known = self._by_id.get(id(value))
        # The value is kept, so that no other can get its identity.
        if known is not None and known[1] is value:
            return known[0]
        form = text(value)
        key = key_of(form)
        if key not in self._keys:
            self._keys.add(key)
            self._new.append(SharedText(type(value).__name__, key, form))
        self._by_id[id(value)] = key, value
        while len(self._by_id) > MAX_REMEMBERED:
            self._by_id.pop(next(iter(self._by_id)))
        return key

    def take_new(self) -> Iterator[SharedText]:
        """Yield the texts of the values that were named since the last call."""
        new, self._new = self._new, []
        return iter(new)

    def add(self, shared: SharedText) -> None:
        """Add a value that was read. Raises FormError if its key is not that of its text."""
        if key_of(shared.text) != shared.key:
            raise FormError(f"the {shared.kind} {shown(shared.key)} was changed")
        self._texts[shared.key] = shared

    def value(self, kind: str, key: Any, decode: Callable[[bytes], Any]) -> Any:
        """Return the value with ``key``, by ``decode`` at the first use. Raises FormError."""
        shared = self._texts.get(key) if isinstance(key, str) else None
        if shared is None or shared.kind != kind:
            raise FormError(f"the {kind} with the key {shown(key)} is missing")
        if key not in self._values:
            self._values[key] = decode(shared.text)
        return self._values[key]
