"""Names of a module that are loaded when they are first used (PEP 562).

The module lists them once, as imports for type checkers: ``from katana450.x import Name as Name``.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any


def modules_of(path: str) -> dict[str, str]:
    """Return the module of each name that the Python file at ``path`` lists."""
    with open(path, encoding="utf-8") as file:
        imports = (line.split() for line in file if line.startswith("    from katana450."))
        return {words[-1]: words[1] for words in imports}


def loaded(name: str, modules: dict[str, str], into: dict[str, Any]) -> Any:
    """Load ``name``, one of ``modules``, keep it in ``into``, the names of a module, and return it.

    Raises AttributeError for any other name.
    """
    if name not in modules:
        raise AttributeError(f"module {into['__name__']!r} has no attribute {name!r}")
    module = import_module(modules[name])
    # The name can be that of a module, which its package need not have loaded.
    value = getattr(module, name, None) or import_module(f"{modules[name]}.{name}")
    into[name] = value
    return value
