"""Classes that declare their fields, from which their reading and their JSON Schema follow.

The type of a field has its kind, as in ``x: Annotated[float, LENGTH]``: how its value is read, and
how an editor explains and checks it.
"""

from __future__ import annotations

import difflib
import inspect
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Generic, NamedTuple, Self, TypeVar, get_args

from katana450.errors import InputError
from katana450.extensions.programs.language.scope import ScriptContext
from katana450.extensions.programs.language.source import Problem, ScriptError, YamlValue

T = TypeVar("T")
D = TypeVar("D")


class Fields:
    """The fields of one mapping. Problems are collected, so that all are reported at once."""

    def __init__(self, value: YamlValue, what: str) -> None:
        """Take a mapping. ``what`` names it in messages, as in "a circle". Raises ScriptError."""
        self.value = value
        self.what = what
        self.problems: list[Problem] = []
        # The names are in their order, each once.
        self._known: dict[str, None] = {}
        self._held: dict[str, YamlValue] = {}
        if value.kind != "mapping":
            raise value.wrong(
                f"{what.capitalize()} must be a mapping of names to values, not {value}."
            )
        for name, held in value.fields:
            if not isinstance(name.held, str):
                self.problems += name.wrong(f"A name must be a text, not {name}.").problems
            elif name.held in self._held:
                problem = f"{name.held!r} is given twice in {what}."
                self.problems += name.wrong(problem).problems
            else:
                self._held[name.held] = held
        self._names = {str(name.held): name for name, _ in value.fields}

    def has(self, name: str) -> bool:
        """Return whether the field is given."""
        self._known[name] = None
        return name in self._held

    def take(self, name: str, read: Callable[[YamlValue], T], default: D) -> T | D:
        """Return the field as ``read`` converts it, or ``default`` if it is absent or wrong."""
        self._known[name] = None
        if name not in self._held:
            return default
        try:
            return read(self._held[name])
        except ScriptError as error:
            self.problems += error.problems
        except InputError as error:
            self.problems += self._held[name].wrong(str(error)).problems
        return default

    def need(self, name: str, read: Callable[[YamlValue], T], instead: D) -> T | D:
        """Return a required field as ``read`` converts it; ``instead`` if it is absent or wrong."""
        if name not in self._held:
            self.refuse(f"{self.what.capitalize()} needs {name!r}.")
        return self.take(name, read, instead)

    def refuse(self, problem: str, name: str = "") -> None:
        """Add a problem of the field ``name``, or of the whole mapping."""
        self.problems += self._held.get(name, self.value).wrong(problem).problems

    def done(self) -> None:
        """Refuse unknown fields, together with all other problems. Raises ScriptError."""
        for name in self._held:
            if name not in self._known:
                problem = f"{self.what.capitalize()} has no {name!r}{or_known(name, self._known)}"
                self.problems += self._names[name].wrong(problem).problems
        if self.problems:
            raise ScriptError(tuple(self.problems))


def or_known(name: str, known: Collection[str]) -> str:
    """Return the end of a message on an unknown ``name``: the nearest known name, or all names."""
    near = difflib.get_close_matches(name, known, 1)
    if near:
        return f"; did you mean {near[0]!r}?"
    return f"; it may have `{'`, `'.join(known)}`." if known else "; it has no fields."


Schema = dict[str, Any]
T_co = TypeVar("T_co", covariant=True)

ALONE = ScriptContext()
"""The settings of a value that does not depend on its script."""

REQUIRED = inspect.Parameter.empty
"""The default of a field that must be given."""


@dataclass(frozen=True, eq=False)
class Kind(Generic[T_co]):
    """A kind of value.

    Attributes:
        read: function of a value and of the settings of its script. It raises ScriptError.
        schema: its JSON Schema.
        field: name of the field in a script, if it is not that of the attribute.
    """

    read: Callable[[YamlValue, ScriptContext], T_co]
    schema: Schema
    field: str = ""

    def __call__(self, value: YamlValue, context: ScriptContext = ALONE) -> T_co:
        """Read the value. Raises ScriptError."""
        return self.read(value, context)

    def within(self, context: ScriptContext) -> Callable[[YamlValue], T_co]:
        """Return the function that reads a value of a script with these settings."""
        return lambda value: self.read(value, context)

    def about(self, text: str) -> Kind[T_co]:
        """Return the kind with the description ``text``."""
        return replace(self, schema={**self.schema, "description": text})

    def named(self, field: str) -> Kind[T_co]:
        """Return the kind of a field that is not named like the attribute."""
        return replace(self, field=field)


@dataclass(frozen=True, eq=False)
class Group(Generic[T_co]):
    """Fields of a mapping that are one value of a class.

    Attributes:
        take: function that takes the value from the fields, and adds mistakes to their problems.
        schemas: schemas of the fields, by their names.
    """

    take: Callable[[Fields, ScriptContext], T_co]
    schemas: Mapping[str, Schema]


class _Part(NamedTuple):
    """The kind that a class declares of one attribute, and its default."""

    kind: Kind[Any] | Group[Any]
    default: Any


class Declared:
    """A class that is read from a mapping, by the kinds of its attributes.

    Attributes that declare no kind have a default; ``in_base`` becomes whether the script gives
    points in the base frame, and ``source`` the value itself. The first line of the docstring
    describes the class in editors.

    Attributes:
        noun: what it is in messages, as in "a circle".
        short: attribute that a value stands for which is no mapping; "" for none. If no other one
            is declared, there is no mapping.
        needs: names of fields of which at least one must be given.
        excludes: names of two fields that exclude each other.
        example: a valid value as text, which the page offers; None to offer none.
    """

    noun: ClassVar[str] = ""
    short: ClassVar[str] = ""
    needs: ClassVar[tuple[str, ...]] = ()
    excludes: ClassVar[tuple[str, ...]] = ()
    example: ClassVar[str | None] = None

    @classmethod
    def read(cls, value: YamlValue, context: ScriptContext) -> Self:
        """Read the value. Raises ScriptError with all mistakes."""
        parts, others = declaration_of(cls)
        if not parts:
            if value.kind != "nothing":
                raise value.wrong(f"{cls.noun.capitalize()} takes no value. Remove it.")
            return cls()
        own = {"in_base": context.in_base, "source": value}
        own = {name: own[name] for name in others if name in own}
        if cls.short and (value.kind != "mapping" or len(parts) == 1):
            kind = parts[cls.short].kind
            assert isinstance(kind, Kind)
            return cls(**{cls.short: kind(value, context)}, **own)
        fields = Fields(value, cls.noun)
        values: dict[str, Any] = {}
        for name, part in parts.items():
            if isinstance(part.kind, Group):
                values[name] = part.kind.take(fields, context)
            elif fields.has(field := part.kind.field or name) or part.default is REQUIRED:
                values[name] = fields.need(field, part.kind.within(context), None)
        if cls.needs and not any(map(fields.has, cls.needs)):
            *before, last = (f"`{name}`" for name in cls.needs)
            fields.refuse(f"{cls.noun.capitalize()} needs {', '.join(before)} or {last}.")
        if cls.excludes and all(map(fields.has, cls.excludes)):
            one, other = cls.excludes
            fields.refuse(f"{cls.noun.capitalize()} takes `{one}` or `{other}`, not both.", other)
        for name, problem in cls.mistakes(values):
            fields.refuse(problem, name)
        fields.done()
        return cls(**values, **own)

    @classmethod
    def mistakes(cls, values: Mapping[str, Any]) -> Iterator[tuple[str, str]]:  # noqa: ARG003
        """Yield field and text of each mistake in ``values`` that no field has by itself.

        The field is "" for the whole mapping. ``values`` has the attributes that the mapping gives,
        None for one that is wrong.
        """
        yield from ()

    @classmethod
    def schema(cls) -> Schema:
        """Return the JSON Schema of the value."""
        about = " ".join((cls.__doc__ or "").partition("\n\n")[0].split()).rstrip(".")
        parts = declaration_of(cls).parts
        if not parts:
            return {"type": "null", "description": about}
        short = parts[cls.short].kind if cls.short else None
        if isinstance(short, Kind) and len(parts) == 1:
            return short.about(about).schema
        properties: dict[str, Schema] = {}
        required = []
        for name, (kind, default) in parts.items():
            if isinstance(kind, Group):
                properties |= kind.schemas
                continue
            properties[kind.field or name] = kind.schema
            if default is REQUIRED:
                required.append(kind.field or name)
        mapping = {
            "type": "object",
            "properties": properties,
            "required": required,
            "additionalProperties": False,
        }
        if cls.needs:
            mapping["anyOf"] = [{"required": [name]} for name in cls.needs]
        if cls.excludes:
            mapping["not"] = {"required": list(cls.excludes)}
        if isinstance(short, Kind):
            return {"description": about, "anyOf": [short.schema, mapping]}
        return {"description": about, **mapping}


def record(declared: type[T]) -> Kind[T]:
    """Return the kind of a value that is read as the class ``declared``."""
    assert issubclass(declared, Declared)
    return Kind(declared.read, declared.schema())


class _Declaration(NamedTuple):
    """The attributes of a class that declare a kind, and the names of the others."""

    parts: Mapping[str, _Part]
    others: tuple[str, ...]


_DECLARATIONS: dict[type[Declared], _Declaration] = {}


def declaration_of(declared: type[Declared]) -> _Declaration:
    """Return the attributes of a class, each in their order."""
    if declared not in _DECLARATIONS:
        hints: dict[str, Any] = {}
        for base in reversed(declared.__mro__):
            hints |= inspect.get_annotations(base, eval_str=True)
        parts: dict[str, _Part] = {}
        others = []
        for name, parameter in inspect.signature(declared).parameters.items():
            kind = _kind(hints.get(name))
            if kind is None:
                others.append(name)
            else:
                parts[name] = _Part(kind, parameter.default)
        _DECLARATIONS[declared] = _Declaration(parts, tuple(others))
    return _DECLARATIONS[declared]


def _kind(hint: Any) -> Kind[Any] | Group[Any] | None:
    """Return the kind that the type of an attribute has; None for other attributes."""
    for option in (hint, *get_args(hint)):
        for extra in reversed(getattr(option, "__metadata__", ())):
            if isinstance(extra, Kind | Group):
                return extra
    return None
