"""The names that a script may use: values, places and definitions, also those of other files."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

from katana450.extensions.programs.language.attached_files import (
    FILE,
    MAX_FILES,
    AttachedFile,
    attached_file,
)
from katana450.extensions.programs.language.fields import Fields
from katana450.extensions.programs.language.kinds import TEXT, choice, listed
from katana450.extensions.programs.language.places import PLACE
from katana450.extensions.programs.language.scope import ScriptContext
from katana450.extensions.programs.language.source import Problem, ScriptError, YamlValue, read
from katana450.extensions.programs.script.blocks import with_definitions

FRAME = choice("shoulder", "base")
"""The frame of points."""

FILES = listed(FILE, 1, MAX_FILES)


def context_of(fields: Fields) -> ScriptContext:
    """Return the names of a script with these fields, which collect all problems."""
    context = ScriptContext(fields.take("frame", FRAME, "shoulder") == "base")
    context = fields.take("include", lambda value: _with_files(value, context), context)
    return _with_names(fields, context)


def _with_names(fields: Fields, context: ScriptContext) -> ScriptContext:
    """Return ``context`` with `let`, `poses` and `define` of ``fields``."""
    for name, extend in (
        ("let", _with_values),
        ("poses", _with_poses),
        ("define", with_definitions),
    ):
        context = fields.take(name, partial(extend, context=context), context)
    return context


def _with_files(value: YamlValue, context: ScriptContext) -> ScriptContext:
    """Return ``context`` with the names of a file, or of a list of files. Raises ScriptError."""
    items = value.items if value.kind == "list" else (value,)
    files = FILES(replace(value, held=items, kind="list"))
    texts = {name: text for file in files for name, text in file.texts.items()}
    if len(texts) > MAX_FILES:
        raise value.wrong(f"A script names at most {MAX_FILES} files.")
    done: list[str] = []
    problems: list[Problem] = []
    for file in files:
        try:
            context = _with_file(file._replace(texts=texts), context, done, ())
        except ScriptError as error:
            problems += error.problems
    if problems:
        raise ScriptError(tuple(problems))
    return context


def _with_file(
    file: AttachedFile, context: ScriptContext, done: list[str], under: tuple[str, ...]
) -> ScriptContext:
    """Return ``context`` with the names of ``file``, and append its name to ``done``.

    ``under``: the files that include it, each included by the one before.
    """
    if file.name in under:
        circle = " includes ".join((*under[under.index(file.name) :], file.name))
        raise file.at.wrong(f"Files must not include each other in a circle: {circle}.")
    if file.name in done:
        return context
    fields = Fields(read(file.text, "file", file.name), "an included file")
    for name in ("name", "about"):
        fields.take(name, TEXT, "")

    def check_frame(value: YamlValue) -> None:
        frame, own = FRAME(value), "base" if context.in_base else "shoulder"
        if frame != own:
            raise value.wrong(
                f"The points of this file are in the frame {frame}, those of the script in {own}. "
                "Use one frame for both."
            )

    def including(value: YamlValue) -> ScriptContext:
        included = context
        for item in value.items if value.kind == "list" else (value,):
            inner = attached_file(item)._replace(texts=file.texts)
            included = _with_file(inner, included, done, (*under, file.name))
        return included

    fields.take("frame", check_frame, None)
    extended = _with_names(fields, fields.take("include", including, context))
    fields.done()
    done.append(file.name)
    return extended


def _with_values(value: YamlValue, context: ScriptContext) -> ScriptContext:
    """Return ``context`` with named values; each may use those before it."""
    scope = context.scope
    problems: list[Problem] = list(Fields(value, "the values").problems)
    for name, inner in value.fields:
        try:
            scope = scope.having(name, inner)
        except ScriptError as error:
            problems += error.problems
    if problems:
        raise ScriptError(tuple(problems))
    return replace(context, scope=scope)


def _with_poses(value: YamlValue, context: ScriptContext) -> ScriptContext:
    """Return ``context`` with named places; each may refer to those before it."""
    fields = Fields(context.scope.bound(value), "the poses")
    for name in [str(key.held) for key, _ in value.fields]:
        place = fields.take(name, PLACE.within(context), None)
        if place is not None:
            context = replace(context, poses={**context.poses, name: place})
    fields.done()
    return context


EXTENSIONS = {"let": _with_values, "poses": _with_poses, "define": with_definitions}
"""How each field of a script with names extends those before it."""
