"""The names that a script may use: values, places and definitions, also those of other files."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from katana450.extensions.programs import fields as read
from katana450.extensions.programs.attached_files import MAX_FILES, AttachedFile, attached_file
from katana450.extensions.programs.blocks import Definition, StepReader
from katana450.extensions.programs.fields import Fields
from katana450.extensions.programs.places import place
from katana450.extensions.programs.scope import Scope
from katana450.extensions.programs.script_context import ScriptContext
from katana450.extensions.programs.source import Problem, ScriptError, YamlValue
from katana450.extensions.programs.source import read as read_text
from katana450.extensions.programs.step_target import StepTarget

FRAMES = ("shoulder", "base")
"""The frames of points."""


@dataclass(frozen=True)
class Vocabulary:
    """The names at one place of a script.

    Attributes:
        in_base: whether points are in the base frame, not in {S}.
        scope: named values.
        poses: named places.
        definitions: named steps.
    """

    in_base: bool
    scope: Scope = field(default_factory=Scope)
    poses: Mapping[str, StepTarget] = field(default_factory=dict)
    definitions: Mapping[str, Definition] = field(default_factory=dict)

    @property
    def setting(self) -> ScriptContext:
        """The settings that all steps share."""
        return ScriptContext(self.in_base, self.poses)

    @property
    def reader(self) -> StepReader:
        """The reader of steps that knows all names."""
        return StepReader(self.setting, self.scope, self.definitions)

    def extended(self, fields: Fields) -> Vocabulary:
        """Return it with `let`, `poses` and `define` of ``fields``, which collect all problems."""
        scope = fields.take("let", self._let, self.scope)
        found = replace(self, scope=scope)
        found = replace(found, poses=fields.take("poses", found._poses, self.poses))
        reader = fields.take("define", found.reader.defining, found.reader)
        return replace(found, definitions=reader.definitions)

    def including(self, value: YamlValue) -> Vocabulary:
        """Return it with the names of a file, or of a list of files. Raises ScriptError."""
        items = value.items if value.kind == "list" else (value,)
        files = read.listed(attached_file, 1, MAX_FILES)(replace(value, held=items, kind="list"))
        texts = {name: text for file in files for name, text in file.texts.items()}
        if len(texts) > MAX_FILES:
            raise value.wrong(f"A script names at most {MAX_FILES} files.")
        done: list[str] = []
        found = self
        problems: list[Problem] = []
        for file in files:
            try:
                found = found._with_file(file._replace(texts=texts), done, ())
            except ScriptError as error:
                problems += error.problems
        if problems:
            raise ScriptError(tuple(problems))
        return found

    def _with_file(self, file: AttachedFile, done: list[str], under: tuple[str, ...]) -> Vocabulary:
        """Return it with the names of ``file``, and append its name to ``done``.

        ``under``: the files that include it, each included by the one before.
        """
        if file.name in under:
            circle = " includes ".join((*under[under.index(file.name) :], file.name))
            raise file.at.wrong(f"Files must not include each other in a circle: {circle}.")
        if file.name in done:
            return self
        fields = Fields(read_text(file.text, "file", file.name), "an included file")
        for name in ("name", "about"):
            fields.take(name, read.text, "")
        fields.take("frame", self._same_frame, None)

        def including(value: YamlValue) -> Vocabulary:
            found = self
            for each in value.items if value.kind == "list" else (value,):
                inner = attached_file(each)._replace(texts=file.texts)
                found = found._with_file(inner, done, (*under, file.name))
            return found

        found = fields.take("include", including, self).extended(fields)
        fields.done()
        done.append(file.name)
        return found

    def _same_frame(self, value: YamlValue) -> None:
        frame, own = read.choice(*FRAMES)(value), FRAMES[self.in_base]
        if frame != own:
            raise value.wrong(
                f"The points of this file are in the frame {frame}, those of the script in {own}. "
                "Use one frame for both."
            )

    def _let(self, value: YamlValue) -> Scope:
        """Return the named values; each may use those before it."""
        scope = self.scope
        problems: list[Problem] = list(Fields(value, "the values").problems)
        for name, inner in value.fields:
            try:
                scope = scope.having(name, inner)
            except ScriptError as error:
                problems += error.problems
        if problems:
            raise ScriptError(tuple(problems))
        return scope

    def _poses(self, value: YamlValue) -> dict[str, StepTarget]:
        """Return the poses by name; each may refer to those before it."""
        fields = Fields(self.scope.bound(value), "the poses")
        found = dict(self.poses)
        for name in [str(key.held) for key, _ in value.fields]:
            read_place = fields.take(
                name, lambda each: place(each, ScriptContext(self.in_base, found)), None
            )
            if read_place is not None:
                found[name] = read_place
        fields.done()
        return found
