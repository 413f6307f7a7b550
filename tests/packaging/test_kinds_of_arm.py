"""The code asks an arm for what it can do, and hardly ever which kind of arm it is."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterable, Iterator
from pathlib import Path

import katana450

PACKAGE = Path(katana450.__file__).parent

INTERFACES = frozenset(["ArmModel", "Branch", "JointSet", "Kinematics", "ToolKinematics"])
"""The classes of an arm: they and all classes derived from them are kinds."""

MAX_DISTINCTIONS = 2
"""Number of places that tell kinds apart. Both are about joints without an arm."""


CLASS = re.compile(r"^ *class (\w+)\(([^)]*)\)", re.MULTILINE)
"""Name and bases of a class."""

DISTINCTION = re.compile(r"\b(?:isinstance|issubclass|cast)\(|^ *case ", re.MULTILINE)


def kinds(texts: Iterable[str]) -> set[str]:
    """Return the names of `INTERFACES` and of all classes derived from them."""
    bases = {
        name: {base.strip() for base in parents.split(",")}
        for text in texts
        for name, parents in CLASS.findall(text)
    }
    names: set[str] = set(INTERFACES)
    while derived := {name for name, parents in bases.items() if parents & names} - names:
        names |= derived
    return names


def distinctions(tree: ast.AST, names: set[str]) -> Iterator[int]:
    """Yield the line of each place that tells kinds apart.

    It is a call of `isinstance`, `issubclass` or `cast`, or a class pattern of a `match`, that
    mentions one of ``names``, or several.
    """
    for node in ast.walk(tree):
        match node:
            case ast.Call(func=ast.Name(id="isinstance" | "issubclass"), args=[_, kind]):
                mentioned: ast.AST = kind
            case ast.Call(func=ast.Name(id="cast"), args=[kind, _]):
                mentioned = kind
            case ast.MatchClass(cls=kind):
                mentioned = kind
            case _:
                continue
        if any(isinstance(part, ast.Name) and part.id in names for part in ast.walk(mentioned)):
            yield node.lineno


def test_arms_are_asked_what_they_can_do() -> None:
    texts = {path: path.read_text("utf-8") for path in sorted(PACKAGE.rglob("*.py"))}
    names = kinds(texts.values())
    assert names >= {"FiveAxisKinematics", "FiveAxisTool", "DrivenTool", "ClosedForm", "SevenAxes"}
    mention = re.compile(rf"\b(?:{'|'.join(names)})\b")
    places = [
        f"{path.relative_to(PACKAGE)}:{line}"
        for path, text in texts.items()
        # The others need not be parsed.
        if DISTINCTION.search(text) and mention.search(text)
        for line in distinctions(ast.parse(text), names)
    ]
    message = "Add a property to `Kinematics` or `ToolKinematics` instead:\n" + "\n".join(places)
    assert len(places) <= MAX_DISTINCTIONS, message
