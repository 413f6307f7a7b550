"""Exact text forms of commands, states and all that they are made of.

A value becomes JSON and the same value again: every number has the same bits, every array the same
shape, type and order in memory. Nothing in a text can run code: only values of the classes in
``allowed`` are made, by their constructors, which check them. Plans and solids are named by keys;
``SharedValues`` holds them.
"""

from __future__ import annotations

import dataclasses
import types
import typing
from collections.abc import Callable, Mapping
from enum import Enum
from typing import Any, Literal

import msgspec
import numpy as np
import numpy.typing as npt

from katana450.extensions.recording.allowed import (
    CLASSES,
    ENUMS,
    MEMBERS,
    ROWS,
    SHARED,
    SINGLE,
)
from katana450.extensions.recording.form_error import FormError
from katana450.extensions.recording.plan_form import PlanCoder
from katana450.extensions.recording.record_forms import (
    ClassCoder,
    RowCoder,
    TupleCoder,
    UnionCoder,
)
from katana450.extensions.recording.shared_values import SharedCoder, SharedValues
from katana450.extensions.recording.simple_forms import (
    ArrayCoder,
    BytesCoder,
    Coder,
    EnumCoder,
    FloatCoder,
    IntCoder,
    PlainCoder,
)
from katana450.maths.planning.plan import Plan

MAX_TEXT_BYTES = 32_000_000
"""Maximum length of the text of one value; the longest plan of an hour has a tenth of it."""


def json_text(form: Any) -> bytes:
    """Return ``form`` as JSON."""
    return msgspec.json.encode(form)


def json_form(text: bytes) -> Any:
    """Return the form in the JSON ``text``. Raises FormError."""
    if len(text) > MAX_TEXT_BYTES:
        raise FormError(f"it has {len(text)} bytes, more than {MAX_TEXT_BYTES}")
    try:
        return msgspec.json.decode(text)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as error:
        raise FormError(f"it is not JSON: {error}") from None


class Codec:
    """Coder of values, with the shared values of one file. For use in one thread."""

    def __init__(self) -> None:
        self.shared = SharedValues()
        """The plans and solids that the values refer to."""
        self._coders: dict[Any, Coder] = {}
        self._whole = {
            kind: PlanCoder(self.fields) if kind is Plan else self._class_coder(kind)
            for kind in SHARED
        }

    def encoded(self, kind: Any, value: Any) -> Any:
        """Return the form of ``value``, which is of the type ``kind``. Raises FormError."""
        return self.coder(kind).encode(value)

    def decoded(self, kind: Any, form: Any) -> Any:
        """Return the value of ``form``, which is of the type ``kind``. Raises FormError."""
        try:
            return self.coder(kind).decode(form)
        except RecursionError:
            raise FormError("its values are in each other too often") from None

    def coder(self, hint: Any) -> Coder:
        """Return the coder of the type ``hint``. Raises TypeError if it is not allowed."""
        if hint not in self._coders:
            self._coders[hint] = self._made(hint)
        return self._coders[hint]

    def fields(self, kind: type) -> Mapping[str, Coder]:
        """Return the coders of the fields that the constructor of ``kind`` takes."""
        hints = typing.get_type_hints(kind)
        names = [field.name for field in dataclasses.fields(kind) if field.init]
        return {name: self.coder(hints[name]) for name in names}

    def _made(self, hint: Any) -> Coder:
        origin, parts = typing.get_origin(hint), typing.get_args(hint)
        known: Mapping[Any, Callable[[], Coder]] = {
            float: FloatCoder,
            int: IntCoder,
            bool: lambda: PlainCoder(bool),
            str: lambda: PlainCoder(str),
            bytes: BytesCoder,
        }
        if hint in known:
            return known[hint]()
        if hint in MEMBERS:
            return self.coder(MEMBERS[hint])
        if origin is Literal:
            return PlainCoder(type(parts[0]), parts)
        # From numpy 2.5 on, which needs Python 3.12, the alias is a type of its own.
        if origin in (np.ndarray, npt.NDArray):
            return ArrayCoder()
        if origin is tuple:
            repeated = len(parts) == 2 and parts[1] is ...
            items = parts[:1] if repeated else parts
            return TupleCoder(tuple(map(self.coder, items)), repeated=repeated)
        if origin in (types.UnionType, typing.Union):
            named = [
                typing.get_args(MEMBERS[each]) if each in MEMBERS else (each,) for each in parts
            ]
            kinds = [each for some in named for each in some if each is not types.NoneType]
            members = tuple(map(self.coder, kinds))
            return UnionCoder(members, optional=types.NoneType in parts)
        if origin in MEMBERS:
            return self.coder(MEMBERS[origin])
        if hint in SHARED:
            whole = self._whole[hint]
            return SharedCoder(
                hint,
                self.shared,
                lambda value: json_text(whole.encode(value)),
                lambda text: whole.decode(json_form(text)),
            )
        if hint in ENUMS and issubclass(hint, Enum):
            return EnumCoder(hint)
        if hint in ROWS:
            hints = typing.get_type_hints(hint)
            return RowCoder(hint, tuple(self.coder(hints[name]) for name in hint._fields))
        if hint in CLASSES:
            return self._class_coder(hint)
        raise TypeError(f"{hint} is not a type of recorded values.")

    def _class_coder(self, kind: type) -> ClassCoder:
        return ClassCoder(kind, SINGLE.get(kind), self.fields)
