"""Files that a script names, and their texts within the script.

A script names files beside it, under ``include``, ``scene`` and the ``file`` of a trajectory. A
reader of scripts opens no file, because a script that is sent to a server stands alone. A program
that has the folder of the script replaces each name by ``{NAME: TEXT}`` on the same line, so that
all lines keep their numbers.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from typing import Any, NamedTuple

import yaml

from katana450.errors import InputError
from katana450.extensions.programs.language.declaration import Fields, Kind
from katana450.extensions.programs.language.kinds import TEXT, any_of
from katana450.extensions.programs.language.source import (
    MAX_BYTES,
    ScriptError,
    YamlValue,
    composed,
)

INCLUDE, SCENE = "include", "scene"
"""Fields of a script that name files."""

DEFINE, STEPS = "define", "steps"
"""Fields of a script with steps."""

MAX_FILES = 16
"""Maximum number of files that a script names, with those that its files name."""

MAX_NAME_LENGTH = 100
"""Maximum number of characters of the name of a file."""

YAML, CSV = ".yaml", ".csv"
"""Suffixes of files that a script names."""

NAMES = {
    YAML: re.compile(r"[^\\:\0/][^\\:\0]*\.ya?ml"),
    CSV: re.compile(r"[^\\:\0/][^\\:\0]*\.csv"),
}
"""Patterns of the names of files, by their suffixes."""


class AttachedFile(NamedTuple):
    """A file that a script names.

    Attributes:
        at: the place of its name in the script.
        name: its name, relative to the folder of the script.
        texts: the texts of files by their names; without its own if the script does not stand
            alone.
    """

    at: YamlValue
    name: str
    texts: Mapping[str, str]

    @property
    def text(self) -> str:
        """Its text. Raises ScriptError if the script does not stand alone."""
        if self.name not in self.texts:
            raise self.at.wrong(
                f"The text of {self.name} is missing: a script that is sent stands alone. "
                "`katana450 run` attaches the files that a script names."
            )
        return self.texts[self.name]


def attached_file(value: YamlValue, suffix: str = YAML) -> AttachedFile:
    """Read NAME, or {NAME: TEXT}, which may also have the texts of further files.

    Raises ScriptError.
    """
    if value.kind != "mapping":
        return AttachedFile(value, _checked_name(value, suffix), {})
    fields = Fields(value, "an attached file")
    names = [_checked_name(name, suffix) for name, _ in value.fields]
    texts = {name: fields.take(name, _text, "") for name in names}
    fields.done()
    if not names:
        raise value.wrong("Expected the name of a file with its text, not an empty mapping.")
    return AttachedFile(value.fields[0][0], names[0], texts)


FILE = Kind(
    lambda value, _: attached_file(value),
    any_of(
        "A file, or a mapping of its name to its text",
        TEXT.schema,
        {"type": "object", "additionalProperties": TEXT.schema, "minProperties": 1},
    ),
)
"""A file of YAML."""


def is_file_name(value: YamlValue) -> bool:
    """Return whether ``value`` looks like the name of a file that can be attached."""
    return value.kind == "text" and str(value.held).endswith((".yaml", ".yml"))


def _text(value: YamlValue) -> str:
    if value.kind != "text":
        raise value.wrong(f"Expected the text of a file, not {value}.")
    return str(value.held)


def _checked_name(value: YamlValue, suffix: str) -> str:
    """Return the name of a file in the folder of the script or below. Raises ScriptError."""
    name = TEXT(value)
    if not NAMES[suffix].fullmatch(name) or ".." in name.split("/") or not name.isprintable():
        raise value.wrong(
            f"{name!r} is not the name of a {suffix} file in the folder of the script or below."
        )
    if len(name) > MAX_NAME_LENGTH:
        raise value.wrong(f"The name of a file has at most {MAX_NAME_LENGTH} characters.")
    return name


def attached(text: str, opened: Callable[[str], str]) -> str:
    """Return the script ``text`` with the texts of all files that it names, each on its line.

    ``opened`` returns the text of a file by its name in the folder of the script, and raises
    InputError. A text that cannot be read is returned unchanged: its reader names the mistake.
    Raises ScriptError at the name of a file that cannot be opened.
    """
    texts: dict[str, str] = {}
    parts: list[str] = []
    end = 0
    for node in _names(text, ""):
        texts_by_name = _opened(node, "", opened, texts)
        if texts_by_name:
            inner = ", ".join(
                f"{_quoted(name)}: {_quoted(content)}" for name, content in texts_by_name.items()
            )
            parts += [text[end : node.start_mark.index], f"{{{inner}}}"]
            end = node.end_mark.index
    return "".join((*parts, text[end:]))


def without_scene(text: str) -> str:
    """Return the script ``text`` without its scene; all lines keep their numbers."""
    root = _root(text, "")
    for key, value in () if root is None else root.value:
        if key.value == SCENE:
            start, instead = key.start_mark.index, ""
            if root is not None and root.flow_style:
                start, instead = value.start_mark.index, "null"
            lines = "\n" * text[start : value.end_mark.index].count("\n")
            return text[:start] + instead + lines + text[value.end_mark.index :]
    return text


def _opened(
    node: Any, file: str, opened: Callable[[str], str], texts: dict[str, str]
) -> dict[str, str]:
    """Return the new texts of the file that ``node`` in ``file`` names, and of those it names.

    They are added to ``texts``.
    """
    line, column = node.start_mark.line + 1, node.start_mark.column + 1
    place = YamlValue(line, column, str(node.value), "text", file=file)
    suffix = CSV if str(node.value).endswith(CSV) else YAML
    name = _checked_name(place, suffix)
    if name in texts:
        return {}
    if len(texts) >= MAX_FILES:
        raise place.wrong(f"A script names at most {MAX_FILES} files.")
    try:
        text = opened(name)
    except InputError as error:
        raise place.wrong(str(error)) from error
    if len(text) > MAX_BYTES:
        raise place.wrong(f"{name} has more than {MAX_BYTES // 1024} KB.")
    texts[name] = text
    texts_by_name = {name: text}
    for inner in _names(text, name) if suffix == YAML else ():
        texts_by_name |= _opened(inner, name, opened, texts)
    return texts_by_name


def _names(text: str, file: str) -> Iterator[Any]:
    """Yield the nodes of the names of files in ``text``, in their order."""
    root = _root(text, file)
    for key, value in () if root is None else root.value:
        if key.value == INCLUDE and isinstance(value, yaml.SequenceNode):
            yield from (node for node in value.value if _is_name(node))
        elif key.value in (INCLUDE, SCENE) and _is_name(value):
            yield value
        elif key.value in (DEFINE, STEPS):
            yield from _trajectory_names(value)


def _trajectory_names(node: Any) -> Iterator[Any]:
    """Yield the nodes of the names of files of trajectories in ``node``, in their order."""
    if isinstance(node, yaml.SequenceNode):
        for item in node.value:
            yield from _trajectory_names(item)
    elif isinstance(node, yaml.MappingNode):
        for key, value in node.value:
            if key.value == "trajectory" and isinstance(value, yaml.MappingNode):
                yield from (
                    held for name, held in value.value if name.value == "file" and _is_name(held)
                )
            else:
                yield from _trajectory_names(value)


def _is_name(node: Any) -> bool:
    return isinstance(node, yaml.ScalarNode) and node.tag == "tag:yaml.org,2002:str"


def _root(text: str, file: str) -> Any:
    """Return the mapping of ``text``; None if it cannot be read or is no mapping."""
    try:
        root = composed(text, "script", file)
    except ScriptError:
        return None
    return root if isinstance(root, yaml.MappingNode) else None


def _quoted(text: str) -> str:
    """Return ``text`` in quotes, on one line, as YAML reads it."""
    shown = (
        character if " " <= character <= "~" and character not in '"\\' else _escape(character)
        for character in text
    )
    return f'"{"".join(shown)}"'


def _escape(character: str) -> str:
    simple = {"\n": "\\n", "\t": "\\t", '"': '\\"', "\\": "\\\\"}
    return simple.get(character) or f"\\U{ord(character):08x}"
