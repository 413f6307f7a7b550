"""Digests of states: a few bytes that differ if any number, text or choice in a state differs.

A digest covers every field of the state bit by bit: it is BLAKE2b of the fields in MessagePack,
which holds numbers in binary and is made by compiled code, so that a digest takes a tenth of the
time of the text form. A plan counts by its length alone: the commands hold it, and the place on it
is in the digest.
"""

from __future__ import annotations

import hashlib
from dataclasses import fields
from typing import Any

import msgspec
import numpy as np

from katana450.arm.control.following import Following
from katana450.arm.control.modes import Leaving, Mode, Positioning, Tracking
from katana450.arm.control.scene_objects import SceneObject
from katana450.arm.control.state import State
from katana450.extensions.recording.former_forms import poured_content, target_content
from katana450.extensions.recording.forms import FormError

DIGEST_DIGITS = 10
"""Length of a digest. One of 10^10 states that differ has the same digest by chance. Decimal digits
take less room than others beside numbers."""

APART = ("t", "mode", "objects")
PLAIN = tuple(each.name for each in fields(State) if each.name not in APART)
POURED = PLAIN.index("poured")


def _hook(value: Any) -> Any:
    """Return the content of a value that MessagePack does not know."""
    if isinstance(value, np.ndarray):
        return value.tobytes()
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"A {type(value).__name__} has no digest.")


class Digester:
    """Makes the digests of the states of one session, one after another."""

    def __init__(self) -> None:
        self._encoder = msgspec.msgpack.Encoder(enc_hook=_hook)
        self._objects: tuple[SceneObject, ...] = ()
        self._of_objects = b""

    def content(self, state: State) -> bytes:
        """Return all of ``state`` but its time, as bytes that differ if it differs.

        Raises FormError for a text that is not Unicode.
        """
        try:
            return self._content(state)
        except UnicodeEncodeError as error:
            raise FormError(f"it is not Unicode: {error}") from None

    def _content(self, state: State) -> bytes:
        if state.objects is not self._objects or not self._of_objects:
            # They change seldom, and many states share them.
            self._objects = state.objects
            self._of_objects = hashlib.blake2b(self._encoder.encode(state.objects)).digest()
        values = [getattr(state, name) for name in PLAIN]
        values[POURED] = poured_content(state.poured)
        return self._encoder.encode((values, self._of_objects, _mode(state.mode)))

    def digest(self, state: State, content: bytes | None = None) -> str:
        """Return the digest of ``state``. ``content``: its content, if it is known."""
        content = self.content(state) if content is None else content
        found = hashlib.blake2b(self._encoder.encode(state.t) + content, digest_size=8).digest()
        return f"{int.from_bytes(found) % 10**DIGEST_DIGITS:0{DIGEST_DIGITS}d}"


def _mode(mode: Mode) -> tuple[Any, ...]:
    name = type(mode).__name__
    match mode:
        case Following(plan=plan):
            return name, plan.span, mode.number, mode.pace, mode.towards
        case Leaving(along=along, then=then):
            return name, _mode(along), _mode(then)
        case Positioning(target=target, beyond_gap=beyond, detour=detour):
            span = None if detour is None else detour.span
            return name, *target_content(target), beyond, span
        case Tracking():
            target, since = target_content(mode.target)[1], target_content(mode.since)[1]
            return name, {"target": target, "since": since, "let_go": mode.let_go}
    return name, mode
