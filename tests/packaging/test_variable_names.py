"""Variables and parameters are nouns that name their quantity."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import katana450

PACKAGE = Path(katana450.__file__).parent

AVOIDED = frozenset(
    [
        "ahead",
        "asked",
        "at",
        "begun",
        "beside",
        "each",
        "found",
        "given",
        "gone",
        "here",
        "kept",
        "made",
        "met",
        "of",
        "seen",
        "taken",
        "there",
        "told",
        "tried",
    ]
)
"""Names that say nothing about the quantity: `candidate`, `posture` or `match` says what it is."""

ROOT = PACKAGE.parents[1]
READ = ("app", "docs", "plugins", "tests")

EXCEPTED = (
    # Its keyword `at` is the word of scripts.
    "app/katana450/library/script_writer.py",
)
"""Files that keep such a name."""


TEXT = r"""\"{3}[\s\S]*?\"{3}|"(?:\\.|[^"\\\n])*"|'(?:\\.|[^'\\\n])*'"""
WORD = re.compile(rf"(?<![\w.])(?:{'|'.join(AVOIDED)})\b")
PART = re.compile(rf"(?P<formatted>\b[rR]?[fF][rR]?(?:{TEXT}))|{TEXT}|#.*|(?P<word>{WORD.pattern})")
"""A text, which contains code if it is formatted; a comment; or one of the names."""


def may_bind(source: str) -> bool:
    """Return whether one of the names is in ``source`` outside of texts and comments."""
    return any(
        part.lastgroup == "word" or WORD.search(part["formatted"])
        for part in PART.finditer(source)
        if part.lastgroup
    )


def variables(tree: ast.AST) -> Iterator[tuple[str, int]]:
    """Yield the names that ``tree`` binds, with their lines, but no fields of classes.

    A field keeps the word that files and the API have for it, such as the ``at`` of an event.
    """
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            yield node.id, node.lineno
        elif isinstance(node, ast.arg):
            yield node.arg, node.lineno
        elif isinstance(node, ast.MatchAs | ast.MatchStar) and node.name:
            yield node.name, node.lineno
        if isinstance(tree, ast.ClassDef) and isinstance(node, ast.AnnAssign):
            continue
        yield from variables(node)


def test_variables_are_nouns() -> None:
    wrong = [
        f"{path.relative_to(ROOT)}:{line}: {name}"
        for folder in READ
        for path in sorted((ROOT / folder).rglob("*.py"))
        if not any(path.is_relative_to(ROOT / place) for place in EXCEPTED)
        # Reading the syntax takes ten times as long.
        if may_bind(source := path.read_text("utf-8"))
        for name, line in variables(ast.parse(source))
        if name in AVOIDED
    ]
    assert not wrong, "Name the quantity instead:\n" + "\n".join(wrong)
