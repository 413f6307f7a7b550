"""The base class of program steps, and the table of all steps by their names."""

from __future__ import annotations

from abc import abstractmethod
from typing import Any

from katana450.extensions.programs.building.plan_state import PlanState
from katana450.extensions.programs.language.declaration import Declared

STEPS: dict[str, type[Step]] = {}
"""The class of each step by its name in a script; a class enters itself with ``word``."""


class Step(Declared):
    """A program step: declared fields, and how it is planned."""

    def __init_subclass__(cls, word: str = "", **options: Any) -> None:
        """Enter the class as the step ``word``, which is also its noun in messages."""
        super().__init_subclass__(**options)
        if word:
            STEPS[word] = cls
            if "noun" not in vars(cls):
                cls.noun = f"an {word}" if word[0] in "aeiou" else f"a {word}"

    @abstractmethod
    def build(self, plan: PlanState) -> PlanState:
        """Return ``plan`` with the actions of the step. Raises InputError if it is not possible."""
