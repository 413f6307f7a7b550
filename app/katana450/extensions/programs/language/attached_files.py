"""The scene file that a script names, and its text within the script.

A reader of scripts opens no file, because a script that is sent to a server stands alone. A program
that has the folder of the script replaces the name by ``{NAME: TEXT}`` on the same line, so that
all lines keep their numbers.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import Any, NamedTuple

import yaml

from katana450.errors import InputError
from katana450.extensions.programs.language.kinds import TEXT
from katana450.extensions.programs.language.source import (
    MAX_BYTES,
    ScriptError,
    YamlValue,
    composed,
)

SCENE = "scene"
"""Field of a script that names a file."""

MAX_NAME_LENGTH = 100
"""Maximum number of characters of the name of a file."""

NAME = re.compile(r"[^\\:\0/][^\\:\0]*\.ya?ml")
"""Pattern of the names of files."""


class AttachedFile(NamedTuple):
    """The name of a file, relative to the folder of the script, and its text."""

    name: str
    text: str


def attached_file(value: YamlValue) -> AttachedFile:
    """Read {NAME: TEXT}. Raises ScriptError, also for a name without a text."""
    if value.kind != "mapping":
        raise value.wrong(
            f"The text of {_checked_name(value)} is missing: a script that is sent stands alone. "
            "`katana450 run` attaches the file that a script names."
        )
    if len(value.fields) != 1:
        raise value.wrong("Expected the name of one file with its text.")
    ((name, text),) = value.fields
    if text.kind != "text":
        raise text.wrong(f"Expected the text of a file, not {text}.")
    return AttachedFile(_checked_name(name), str(text.held))


def is_file_name(value: YamlValue) -> bool:
    """Return whether ``value`` looks like the name of a file that can be attached."""
    return value.kind == "text" and str(value.held).endswith((".yaml", ".yml"))


def _checked_name(value: YamlValue) -> str:
    """Return the name of a file in the folder of the script or below. Raises ScriptError."""
    name = TEXT(value)
    if not NAME.fullmatch(name) or ".." in name.split("/") or not name.isprintable():
        raise value.wrong(
            f"{name!r} is not the name of a .yaml file in the folder of the script or below."
        )
    if len(name) > MAX_NAME_LENGTH:
        raise value.wrong(f"The name of a file has at most {MAX_NAME_LENGTH} characters.")
    return name


def attached(text: str, opened: Callable[[str], str]) -> str:
    """Return the script ``text`` with the text of the file that it names, on the same line.

    ``opened`` returns the text of a file by its name in the folder of the script, and raises
    InputError. A text that cannot be read is returned unchanged: its reader names the mistake.
    Raises ScriptError at the name of a file that cannot be opened.
    """
    root = _root(text)
    for key, value in () if root is None else root.value:
        if key.value == SCENE and _is_name(value):
            start, end = value.start_mark, value.end_mark
            place = YamlValue(start.line + 1, start.column + 1, str(value.value), "text")
            name = _checked_name(place)
            try:
                content = opened(name)
            except InputError as error:
                raise place.wrong(str(error)) from error
            if len(content) > MAX_BYTES:
                raise place.wrong(f"{name} has more than {MAX_BYTES // 1024} KB.")
            inner = f"{{{_quoted(name)}: {_quoted(content)}}}"
            return text[: start.index] + inner + text[end.index :]
    return text


def without_scene(text: str) -> str:
    """Return the script ``text`` without its scene; all lines keep their numbers."""
    root = _root(text)
    for key, value in () if root is None else root.value:
        if key.value == SCENE:
            start, instead = key.start_mark.index, ""
            if root is not None and root.flow_style:
                start, instead = value.start_mark.index, "null"
            lines = "\n" * text[start : value.end_mark.index].count("\n")
            return text[:start] + instead + lines + text[value.end_mark.index :]
    return text


def _is_name(node: Any) -> bool:
    return isinstance(node, yaml.ScalarNode) and node.tag == "tag:yaml.org,2002:str"


def _root(text: str) -> Any:
    """Return the mapping of ``text``; None if it cannot be read or is no mapping."""
    try:
        root = composed(text, "script", "")
    except ScriptError:
        return None
    return root if isinstance(root, yaml.MappingNode) else None


def _quoted(text: str) -> str:
    """Return ``text`` in quotes, on one line, as YAML reads it."""
    quoted: str = yaml.safe_dump(text, default_style='"', width=math.inf)
    return quoted.rstrip("\n")
