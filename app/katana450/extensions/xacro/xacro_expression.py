"""Evaluation of the Python expressions in xacro files, without a way to other code.

The package xacro hands expressions to ``eval`` and refuses names that begin with two underscores
only where it finds them. A comprehension hides them, so a file could run any code.
"""

from __future__ import annotations

import ast
from collections.abc import Mapping
from typing import Any

PLAIN = (str, int, float, complex, list, tuple, dict, set, frozenset)
"""Types of values whose public methods an expression can call."""

REFUSED = frozenset({"format", "format_map"})
"""Methods whose text argument can read attributes."""

ATTRIBUTE = "attribute of"
"""Name of the function that reads an attribute; no expression can contain it."""


class UnsafeExpressionError(Exception):
    """An expression that is not evaluated, with the reason."""


def evaluated(text: str, symbols: dict[str, Any], names: Mapping[str, Any] | None = None) -> object:
    """Return the value of the expression ``text``.

    Args:
        text: a Python expression.
        symbols: what its names mean; gets two more entries.
        names: what its names mean first.

    Raises:
        UnsafeExpressionError: it uses a private name, or an attribute of anything but plain values.
        Exception: whatever the expression raises.
    """
    tree = _Guarded().visit(ast.parse(text.strip(), "<expression>", "eval"))
    code = compile(ast.fix_missing_locations(tree), "<expression>", "eval")
    symbols.update({"__builtins__": {}, ATTRIBUTE: _attribute})
    return eval(code, symbols, names)


class _Guarded(ast.NodeTransformer):
    """Replaces each attribute by a call of ``_attribute``, and refuses private names."""

    def visit_Name(self, node: ast.Name) -> ast.AST:
        if node.id.startswith("__"):
            raise UnsafeExpressionError(f"the name {node.id!r} is not allowed")
        return node

    def visit_Attribute(self, node: ast.Attribute) -> ast.AST:
        function = ast.Name(ATTRIBUTE, ast.Load())
        return ast.Call(function, [self.visit(node.value), ast.Constant(node.attr)], [])


def _attribute(value: object, name: str) -> object:
    """Return the entry ``name`` of a mapping, or a public attribute of a plain value."""
    # Namespaces of xacro and mappings of YAML are mappings that are read with a dot.
    if isinstance(value, dict) and name in value and not name.startswith("_"):
        return value[name]
    kind = next((kind for kind in PLAIN if isinstance(value, kind)), None)
    if kind is None or name.startswith("_") or name in REFUSED or not hasattr(kind, name):
        raise UnsafeExpressionError(f"the attribute {name!r} is not allowed, or does not exist")
    return getattr(value, name)
