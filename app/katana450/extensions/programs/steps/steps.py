"""All program steps by name: the modules of this folder enter their classes.

To add a kind, write a class as ``Step`` describes it. Extensions of other distributions add steps
by their part ``step``.
"""

from __future__ import annotations

from importlib import import_module
from pkgutil import iter_modules

from katana450.extension import provided
from katana450.extensions.programs import steps
from katana450.extensions.programs.building.step import STEPS

for module in iter_modules(steps.__path__):
    import_module(f"{steps.__name__}.{module.name}")

ADDED = tuple(provided("step"))
"""The steps of other distributions."""

__all__ = ["STEPS"]
