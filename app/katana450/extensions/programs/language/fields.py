"""Reading of the fields of a YAML mapping by name and type; unknown fields are refused."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Collection
from typing import TypeVar

from katana450.errors import InputError
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
    return f"; it may have {', '.join(known)}." if known else "; it has no fields."
