"""Exact text forms of commands, states and all that they are made of.

A value becomes JSON and the same value again: every number has the same bits, every array the same
shape, type and order in memory. What a recording can hold follows from the types of the fields of
commands and states: only values of these types are made, by their constructors, which check them,
so nothing in a text can run code. Plans and solids are named by keys; ``SharedValues`` holds them.
"""

from __future__ import annotations

import dataclasses
import hashlib
import types
import typing
from collections.abc import Callable, Iterable, Iterator, Mapping
from enum import Enum
from functools import cache
from typing import Any, Final, Literal, NamedTuple, Union

import msgspec
import numpy as np
import numpy.typing as npt

from katana450.arm.control.commands.act import ENVELOPE, Act, classes_of, tag_of
from katana450.arm.control.commands.commands import Command
from katana450.arm.control.lease import Actor
from katana450.arm.control.state import modes
from katana450.arm.control.state.solid import Solid
from katana450.arm.control.state.state import State
from katana450.caching import cached_property
from katana450.extensions.programs.planning.curve_path import PosePath, ToolPath
from katana450.extensions.programs.planning.curves import (
    Curve,
    Linear,
    PoseTurn,
    Swing,
    ToolArc,
    ToolLine,
    ToolLines,
    ToolTurn,
    TurnedCurve,
)
from katana450.extensions.programs.steps.trajectory import TrajectoryPath
from katana450.extensions.recording.former_forms import CLASSES, FORMER, command_form, upgraded
from katana450.extensions.recording.forms import (
    MAX_INT,
    MAX_ITEMS,
    FormError,
    array,
    array_form,
    json_form,
    json_text,
    number,
    number_form,
    shown,
)
from katana450.maths.planning.joint_path import JointPath
from katana450.maths.planning.path import Path
from katana450.maths.planning.plan import Plan, Segment

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
        self.detours: list[Any] = []
        """Keys of the detours that states and commands of an older version offer."""

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


MEMBERS: Final[Mapping[Any, Any]] = {
    Path: JointPath | ToolPath | TrajectoryPath | PosePath,
    Curve: ToolLine | ToolLines | ToolArc | ToolTurn | TurnedCurve | PoseTurn,
    Callable: Linear | Swing,
    Command: Union[classes_of(Command)],  # noqa: UP007
}
"""The types that a field may hold whose type is a base or a protocol, by that type."""

SHARED: Final[tuple[type, ...]] = (Plan, Solid)
"""Large values that are written once and then named by a key."""

SINGLE: Final[Mapping[type, Any]] = {modes.Idle: modes.IDLE}
"""Types with one value, which other code compares by identity."""

TAG = "is"
"""Name of the item with the name of the class, that of the API for a command; no field has it."""

ORDER = "order"
"""Name of the item of a plan with the number of each segment in the list of different segments."""

ROUNDING = 1e-9
"""[1] Largest change of a number by a constructor that counts as rounding."""


class Codec:
    """Coder of values, with the shared values of one file. For use in one thread."""

    def __init__(self) -> None:
        self.shared = SharedValues()
        """The plans and solids that the values refer to."""

    def encoded(self, value: Any) -> Any:
        """Return the form of ``value``. Raises FormError."""
        kind = type(value)
        if value is None or kind is bool:
            return value
        if kind is str:
            try:
                value.encode()
            except UnicodeEncodeError as error:
                raise FormError(f"it is not Unicode: {error}") from None
            return value
        if kind is bytes:
            return value.hex()
        if kind is np.ndarray:
            return array_form(value)
        if isinstance(value, tuple):
            if len(value) > MAX_ITEMS:
                raise FormError(f"it has more than {MAX_ITEMS} items")
            return [self.encoded(item) for item in value]
        if isinstance(value, Enum):
            return value.name
        if isinstance(value, int | float | np.number):
            return number_form(value)
        record = recorded_classes().get(kind)
        if record is None:
            raise FormError(f"a {kind.__name__} has no form here")
        if kind in SHARED:
            return self.shared.key(value, lambda whole: json_text(self._record(record, whole)))
        return self._record(record, value)

    def _record(self, record: _Record, value: Any) -> dict[str, Any]:
        form: dict[str, Any] = {TAG: record.name} if record.tagged else {}
        order = None
        if record.kind is Plan:
            # A segment that is followed several times is written once. The session remembers by
            # identity which one it has checked, so a plan that is read has one object there too.
            different = {id(segment): segment for segment in value.segments}
            numbers = {key: place for place, key in enumerate(different)}
            order = [numbers[id(segment)] for segment in value.segments]
            value = Plan(tuple(different.values()), value.clear_of, value.fingers, value.nearest)
        for name in record.forms:
            form[name] = self.encoded(getattr(value, name))
        return form if order is None else {**form, ORDER: order}

    def decoded(self, kind: Any, form: Any) -> Any:
        """Return the value of ``form``, which is of the type ``kind``. Raises FormError."""
        try:
            return form_of(kind).decode(form, self.shared)
        except RecursionError:
            raise FormError("its values are in each other too often") from None

    def field(self, kind: type, name: str, form: Any) -> Any:
        """Return the value of ``form``, that of the field ``name`` of ``kind``."""
        return self.decoded(typing.get_type_hints(kind)[name], form)


class TextForm(NamedTuple):
    """The form of the values of one type: types of its JSON, and the function that reads it."""

    json: tuple[type, ...]
    decode: Callable[[Any, SharedValues], Any]
    record: _Record | None = None


@cache
def form_of(hint: Any) -> TextForm:
    """Return the form of the type ``hint``. Raises TypeError for a type that is not recorded."""
    origin, parts = typing.get_origin(hint), typing.get_args(hint)
    if hint in MEMBERS or origin in MEMBERS:
        return form_of(MEMBERS.get(hint) or MEMBERS[origin])
    if hint is float:
        return TextForm((float, int, bool, str), lambda form, _: number(form))
    if hint in (int, bool, str):
        return _plain(hint)
    if hint is bytes:
        return TextForm((str,), lambda form, _: _bytes(form))
    if origin is Literal:
        return _plain(type(parts[0]), parts)
    # From numpy 2.5 on, which needs Python 3.12, the alias is a type of its own.
    if origin in (np.ndarray, npt.NDArray):
        return TextForm((list, dict), lambda form, _: array(form))
    if origin is tuple:
        repeated = len(parts) == 2 and parts[1] is ...
        return _row(parts[:1] if repeated else parts, repeated=repeated)
    if origin in (types.UnionType, typing.Union):
        return _union(parts)
    if not isinstance(hint, type):
        raise TypeError(f"{hint} is not a type of recorded values.")
    if issubclass(hint, Enum):
        return _plain(str, tuple(hint.__members__), hint.__members__.get)
    if issubclass(hint, tuple) and hasattr(hint, "_fields"):
        hints = typing.get_type_hints(hint)
        kinds = tuple(hints[name] for name in hint._fields)
        return _row(kinds, convert=lambda items: hint(*items))
    if dataclasses.is_dataclass(hint) or issubclass(hint, msgspec.Struct):
        record = _Record(hint)
        return _shared(record) if hint in SHARED else TextForm((dict,), record.decode, record)
    raise TypeError(f"{hint} is not a type of recorded values.")


def _shared(record: _Record) -> TextForm:
    """Return the form of a value that is named by its key."""
    name = record.kind.__name__

    def decode(form: Any, shared: SharedValues) -> Any:
        return shared.value(name, form, lambda text: record.decode(json_form(text), shared))

    return TextForm((str,), decode, record)


def _bytes(form: Any) -> bytes:
    try:
        return bytes.fromhex(form)
    except (TypeError, ValueError):
        raise FormError(f"{shown(form)} is not a row of hexadecimal digits") from None


def _plain(
    kind: type, allowed: tuple[Any, ...] = (), convert: Callable[[Any], Any] = lambda form: form
) -> TextForm:
    """Return the form of texts, whole numbers or truth values, of those in ``allowed`` if any."""
    named = "a whole number" if kind is int else f"of the type {kind.__name__}"

    def decode(form: Any, _: SharedValues) -> Any:
        if type(form) is not kind or (isinstance(form, int) and abs(form) > MAX_INT):
            raise FormError(f"{shown(form)} is not {named}")
        if allowed and form not in allowed:
            raise FormError(f"{shown(form)} is not one of {', '.join(map(str, allowed))}")
        return convert(form)

    return TextForm((kind,), decode)


def _row(
    hints: tuple[Any, ...], *, repeated: bool = False, convert: Callable[[Any], Any] = tuple
) -> TextForm:
    """Return the form of tuples of ``hints``; if ``repeated``, of any number of the first."""

    def decode(form: Any, shared: SharedValues) -> Any:
        if not isinstance(form, list):
            raise FormError(f"{shown(form)} is not a row of items")
        if len(form) > MAX_ITEMS or (not repeated and len(form) != len(hints)):
            raise FormError(f"it has {len(form)} items, not {len(hints)}")
        items = []
        for place, item in enumerate(form):
            try:
                kind = form_of(hints[0 if repeated else place])
                items.append(kind.decode(item, shared))
            except FormError as error:
                raise error.within(place) from None
        return convert(items)

    for hint in hints:
        form_of(hint)
    return TextForm((list,), decode)


def _union(parts: Iterable[Any]) -> TextForm:
    """Return the form of a field with several types. Classes are distinguished by their names."""
    named = [typing.get_args(MEMBERS[part]) if part in MEMBERS else (part,) for part in parts]
    kinds = [kind for group in named for kind in group]
    optional = types.NoneType in kinds
    forms = [form_of(kind) for kind in kinds if kind is not types.NoneType]
    records = {
        form.record.name: form.record
        for form in forms
        if form.record is not None and form.json == (dict,)
    }
    by_json = {json: form for form in forms for json in form.json}
    if len(by_json) + max(len(records) - 1, 0) != sum(len(form.json) for form in forms):
        raise TypeError(f"The forms of {kinds} cannot be distinguished.")
    if len(records) > 1:
        for record in records.values():
            record.tagged = True
    commands = any(issubclass(record.kind, Act) for record in records.values())

    def decode(form: Any, shared: SharedValues) -> Any:
        if form is None and optional:
            return None
        if len(records) > 1 and isinstance(form, dict):
            form = command_form(form, shared.detours) if commands else form
            name = form.get(TAG)
            # Before a field had several types, its objects had no tag.
            fit = [record for record in records.values() if record.has_form_of(form)]
            record = records.get(CLASSES.get(name, name)) if isinstance(name, str) else None
            if name is None and len(fit) == 1:
                record = fit[0]
            if record is None:
                raise FormError(f"{shown(name)} is not one of {', '.join(records)}")
            return record.decode(form, shared)
        plain_form = by_json.get(type(form))
        if plain_form is None:
            raise FormError(f"{shown(form)} has no value here")
        return plain_form.decode(form, shared)

    return TextForm(tuple(by_json), decode)


class _Record:
    """The form of a class: an object with the fields that its constructor takes."""

    def __init__(self, kind: type) -> None:
        self.kind = kind
        self.name = tag_of(kind.__name__) if issubclass(kind, Act) else kind.__name__
        self.tagged = False
        """Whether its objects name the class, because some field can have several classes."""
        fields: Any = (
            [field for field in msgspec.structs.fields(kind) if field.name not in ENVELOPE]
            if issubclass(kind, msgspec.Struct)
            else [field for field in dataclasses.fields(kind) if field.init]  # type: ignore[arg-type]
        )
        missing = (dataclasses.MISSING, msgspec.NODEFAULT)
        self._names = [field.name for field in fields]
        self._required = {
            field.name
            for field in fields
            if field.default in missing and field.default_factory in missing
        }

    @cached_property
    def forms(self) -> Mapping[str, TextForm]:
        """The forms of the fields. They are made at the first use: classes refer to each other."""
        hints = typing.get_type_hints(self.kind)
        return {name: form_of(hints[name]) for name in self._names}

    def has_form_of(self, form: Mapping[str, Any]) -> bool:
        """Return whether ``form`` has all fields that are required, and no others."""
        return self._required <= form.keys() <= self.forms.keys()

    def decode(self, form: Any, shared: SharedValues) -> Any:
        """Return the value whose fields have the forms in the object ``form``."""
        name = self.kind.__name__
        if not isinstance(form, dict):
            raise FormError(f"{shown(form)} is not an object of {name}")
        order = form.get(ORDER) if self.kind is Plan else None
        forms: dict[str, Any] = {}
        for field, content in upgraded(self.kind, form, shared.detours).items():
            if field not in self.forms:
                known = field == TAG or (field == ORDER and self.kind is Plan)
                if known or FORMER.get(field) == content:
                    continue
                raise FormError(f"{name} has no field {shown(field)}")
            try:
                forms[field] = self.forms[field].decode(content, shared)
            except FormError as error:
                raise error.within(field) from None
        missing = self._required - forms.keys()
        if missing:
            raise FormError(f"{name} lacks {', '.join(sorted(missing))}")
        if self.kind is Plan:
            forms["segments"] = _ordered(forms["segments"], order)
        return self._made(forms)

    def _made(self, forms: Mapping[str, Any]) -> Any:
        """Return the value with the fields ``given``. Raises FormError if they are invalid."""
        if self.kind in SINGLE:
            return SINGLE[self.kind]
        try:
            value = self.kind(**forms)
        except Exception as error:
            # Whatever a constructor raises for fields of the right types, they are invalid.
            raise FormError(f"these fields are no {self.kind.__name__}: {error}") from None
        if hasattr(self.kind, "__post_init__"):
            self._keep_exact(value, forms)
        return value

    def _keep_exact(self, value: Any, forms: Mapping[str, Any]) -> None:
        """Undo the rounding of what was rounded before, such as the length of a direction."""
        for name, wanted in forms.items():
            computed = getattr(value, name)
            if isinstance(wanted, np.ndarray):
                if not (
                    isinstance(computed, np.ndarray)
                    and computed.shape == wanted.shape
                    and np.allclose(computed, wanted, ROUNDING, ROUNDING, equal_nan=True)
                ):
                    raise FormError(f"this is not a valid {name} of {self.kind.__name__}")
                if isinstance(value, msgspec.Struct):
                    msgspec.structs.force_setattr(value, name, wanted)
                else:
                    object.__setattr__(value, name, wanted)
            elif computed is not wanted and computed != wanted:
                raise FormError(f"{name} of {self.kind.__name__} cannot be {shown(wanted)}")


def _ordered(segments: tuple[Segment, ...], order: Any) -> tuple[Segment, ...]:
    """Return the segments of a plan in their ``order``. Raises FormError."""
    if not isinstance(order, list) or not 0 < len(order) <= MAX_ITEMS:
        raise FormError("a plan has at least one segment", (ORDER,))
    if not all(type(place) is int and 0 <= place < len(segments) for place in order):
        raise FormError(f"the numbers of segments are from 0 to {len(segments) - 1}", (ORDER,))
    return tuple(segments[place] for place in order)


@cache
def recorded_classes() -> Mapping[type, _Record]:
    """Return the classes that commands, their givers and states are made of, with their forms."""
    known: dict[type, _Record] = {}
    hints = [Command, Actor, State]
    while hints:
        hint = hints.pop()
        hint = MEMBERS.get(hint, MEMBERS.get(typing.get_origin(hint), hint))
        if hint in (types.NoneType, ...):
            continue
        record = form_of(hint).record
        if record is not None and record.kind not in known:
            known[record.kind] = record
            fields = typing.get_type_hints(record.kind)
            hints += [fields[name] for name in record.forms]
        elif typing.get_origin(hint) in (tuple, types.UnionType, typing.Union):
            hints += typing.get_args(hint)
    return known
