"""Forms of records: dataclasses, named tuples, tuples and unions of them."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from katana450.extensions.recording.form_error import FormError, shown
from katana450.extensions.recording.former_forms import FORMER, upgraded
from katana450.extensions.recording.simple_forms import MAX_ITEMS, Coder

TAG = "is"
"""Name of the item with the name of the class; no field of a class can have it."""

ROUNDING = 1e-9
"""[1] Largest change of a number by a constructor that counts as rounding."""


class TupleCoder:
    """Coder of tuples: of any length with one type of items, or of fixed length."""

    python: tuple[type, ...] = (tuple,)
    json: tuple[type, ...] = (list,)

    def __init__(self, items: tuple[Coder, ...], *, repeated: bool) -> None:
        """Code tuples of ``items``; if ``repeated``, any number of the first."""
        self._items, self._repeated = items, repeated

    def _coders(self, value: Any, kind: type[tuple[Any, ...] | list[Any]]) -> tuple[Coder, ...]:
        if not isinstance(value, kind):
            raise FormError(f"{shown(value)} is not a row of items")
        if not self._repeated and len(value) != len(self._items):
            raise FormError(f"it has {len(value)} items, not {len(self._items)}")
        if len(value) > MAX_ITEMS:
            raise FormError(f"it has more than {MAX_ITEMS} items")
        return self._items * len(value) if self._repeated else self._items

    def encode(self, value: Any) -> Any:
        """Return the list of the forms of the items."""
        coders = self._coders(value, tuple)
        return [coder.encode(each) for coder, each in zip(coders, value, strict=True)]

    def decode(self, form: Any) -> Any:
        """Return the tuple of the values of the items."""
        found = []
        for place, (coder, each) in enumerate(zip(self._coders(form, list), form, strict=True)):
            try:
                found.append(coder.decode(each))
            except FormError as error:
                raise error.within(place) from None
        return tuple(found)


class RowCoder(TupleCoder):
    """Coder of a named tuple as a row."""

    def __init__(self, kind: type, items: tuple[Coder, ...]) -> None:
        """Code values of ``kind``, whose fields have the coders ``items``."""
        super().__init__(items, repeated=False)
        self.python = (kind,)
        self._kind = kind

    def decode(self, form: Any) -> Any:
        """Return the named tuple of the row ``form``."""
        return self._kind(*super().decode(form))


class ClassCoder:
    """Coder of a dataclass as an object with its fields."""

    json: tuple[type, ...] = (dict,)

    def __init__(
        self, kind: type, single: Any, coders: Callable[[type], Mapping[str, Coder]]
    ) -> None:
        """Code values of ``kind``.

        Args:
            kind: the class.
            single: its only value, if it has one.
            coders: returns the coders of its fields. It is called at the first use, because classes
                can refer to each other.
        """
        self.python: tuple[type, ...] = (kind,)
        self.kind, self._single, self._coders = kind, single, coders
        self._fields: Mapping[str, Coder] = {}
        self._ready = False
        made = dataclasses.fields(kind)
        self._required = {
            each.name
            for each in made
            if each.init
            and each.default is dataclasses.MISSING
            and each.default_factory is dataclasses.MISSING
        }
        self._checks = hasattr(kind, "__post_init__")

    @property
    def fields(self) -> Mapping[str, Coder]:
        """The coders of the fields by name."""
        if not self._ready:
            self._fields, self._ready = self._coders(self.kind), True
        return self._fields

    def has_form_of(self, form: Mapping[str, Any]) -> bool:
        """Return whether ``form`` has all fields that are required, and no others."""
        return self._required <= form.keys() <= self.fields.keys()

    def encode(self, value: Any) -> Any:
        """Return the object of the forms of the fields."""
        if type(value) is not self.kind:
            raise FormError(f"a {type(value).__name__} is not a {self.kind.__name__}")
        form = {}
        for name, coder in self.fields.items():
            try:
                form[name] = coder.encode(getattr(value, name))
            except FormError as error:
                raise error.within(name) from None
        return form

    def decode(self, form: Any) -> Any:
        """Return the value whose fields have the forms in the object ``form``."""
        if not isinstance(form, dict):
            raise FormError(f"{shown(form)} is not an object of {self.kind.__name__}")
        given: dict[str, Any] = {}
        for name, each in upgraded(self.kind, form).items():
            coder = self.fields.get(name)
            if coder is None:
                if name == TAG or FORMER.get(name) == each:
                    continue
                raise FormError(f"{self.kind.__name__} has no field {shown(name)}")
            try:
                given[name] = coder.decode(each)
            except FormError as error:
                raise error.within(name) from None
        missing = self._required - given.keys()
        if missing:
            raise FormError(f"{self.kind.__name__} lacks {', '.join(sorted(missing))}")
        return self.made(given)

    def made(self, given: Mapping[str, Any]) -> Any:
        """Return the value with the fields ``given``. Raises FormError if they are invalid."""
        if self._single is not None:
            return self._single
        try:
            value = self.kind(**given)
        except Exception as error:
            # Whatever a constructor raises for fields of the right types, they are invalid.
            raise FormError(f"these fields are no {self.kind.__name__}: {error}") from None
        if self._checks:
            self._keep_exact(value, given)
        return value

    def _keep_exact(self, value: Any, given: Mapping[str, Any]) -> None:
        """Undo the rounding of what was rounded before, such as the length of a direction."""
        for name, wanted in given.items():
            found = getattr(value, name)
            if isinstance(wanted, np.ndarray):
                if not (
                    isinstance(found, np.ndarray)
                    and found.shape == wanted.shape
                    and np.allclose(found, wanted, ROUNDING, ROUNDING, equal_nan=True)
                ):
                    raise FormError(f"this is not a valid {name} of {self.kind.__name__}")
                object.__setattr__(value, name, wanted)
            elif found is not wanted and found != wanted:
                raise FormError(f"{name} of {self.kind.__name__} cannot be {shown(wanted)}")


class UnionCoder:
    """Coder of a field with several types. Classes are distinguished by their names."""

    def __init__(self, members: tuple[Coder, ...], *, optional: bool) -> None:
        """Code values of any of ``members``, and None if ``optional``."""
        self._optional = optional
        self._by_python = {kind: coder for coder in members for kind in coder.python}
        classes = {each.kind.__name__: each for each in members if isinstance(each, ClassCoder)}
        self._tagged = classes if len(classes) > 1 else {}
        self._by_json = {kind: coder for coder in members for kind in coder.json}
        self.python = tuple(self._by_python)
        self.json = tuple(self._by_json)
        others = [each for each in members if not isinstance(each, ClassCoder)]
        kinds = [kind for each in others for kind in each.json] + [dict] * bool(classes)
        if len(kinds) != len(set(kinds)):
            raise TypeError(f"The forms of {self.python} cannot be distinguished.")

    def encode(self, value: Any) -> Any:
        """Return the form of ``value`` by its type."""
        if value is None and self._optional:
            return None
        coder = self._by_python.get(type(value))
        if coder is None:
            raise FormError(f"a {type(value).__name__} has no form here")
        form = coder.encode(value)
        return {TAG: type(value).__name__, **form} if type(value).__name__ in self._tagged else form

    def decode(self, form: Any) -> Any:
        """Return the value of ``form`` by its type and its tag."""
        if form is None and self._optional:
            return None
        if self._tagged and isinstance(form, dict):
            name = form.get(TAG)
            # Before a field had several types, its objects had no tag.
            fit = [each for each in self._tagged.values() if each.has_form_of(form)]
            tagged = self._tagged.get(name) if isinstance(name, str) else None
            if name is None and len(fit) == 1:
                tagged = fit[0]
            if tagged is None:
                raise FormError(f"{shown(name)} is not one of {', '.join(self._tagged)}")
            return tagged.decode(form)
        coder = self._by_json.get(type(form))
        if coder is None:
            raise FormError(f"{shown(form)} has no value here")
        return coder.decode(form)
