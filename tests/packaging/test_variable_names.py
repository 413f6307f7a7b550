"""Variables and parameters are nouns that name their quantity."""

from __future__ import annotations

import ast
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
READ = ("app", "docs", "tests")

EXCEPTED = (
    # Its keyword `at` is the word of scripts.
    "app/katana450/library/script_writer.py",
)
"""Files that keep such a name."""


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
        for name, line in variables(ast.parse(path.read_text("utf-8")))
        if name in AVOIDED
    ]
    assert not wrong, "Name the quantity instead:\n" + "\n".join(wrong)
