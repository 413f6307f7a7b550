"""Program steps, their places in a script, and the choice between steps."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

from katana450.extensions.programs.building.conditions import Condition
from katana450.extensions.programs.building.plan_state import PlanState
from katana450.extensions.programs.language.declaration import Declared

STEPS: dict[str, type[Step]] = {}
"""The class of each step by its name in a script; a class enters itself with ``word``."""


class Step(Declared):
    """A program step: declared fields, and how it is planned.

    Attributes:
        word: its name in a script; "" for a base class.
    """

    word: ClassVar[str] = ""

    def __init_subclass__(cls, word: str = "", **options: Any) -> None:
        """Enter the class as the step ``word``, which is also its noun in messages."""
        super().__init_subclass__(**options)
        if word:
            STEPS[word], cls.word = cls, word
            if "noun" not in vars(cls):
                cls.noun = f"an {word}" if word[0] in "aeiou" else f"a {word}"

    @property
    def title(self) -> str:
        """The name of the step for people: its word, and the text that may follow it alone."""
        text = getattr(self, self.short, "")
        words = self.word.replace("_", " ")
        return f"{words} {text}" if isinstance(text, str) and text else words

    @abstractmethod
    def build(self, plan: PlanState) -> PlanState:
        """Return ``plan`` with the actions of the step. Raises InputError if it is not possible."""


@dataclass(frozen=True, eq=False)
class Conditional:
    """The step ``if``: a choice between steps, by a condition that is measured when it is reached.

    Attributes:
        condition: the condition.
        then: the steps if it holds.
        otherwise: the steps if it does not; may be empty.
    """

    condition: Condition
    then: tuple[LocatedStep, ...]
    otherwise: tuple[LocatedStep, ...]


class LocatedStep(NamedTuple):
    """A step and its place in the text, from 1.

    Attributes:
        step: the step.
        line, column: its place in the script.
    """

    step: Step | Conditional
    line: int
    column: int


def count(steps: Iterable[LocatedStep]) -> int:
    """Return the number of ``steps``, with those of all alternatives."""
    return sum(
        1 + count(located.step.then) + count(located.step.otherwise)
        if isinstance(located.step, Conditional)
        else 1
        for located in steps
    )


def titles(steps: Iterable[LocatedStep], before: str = "") -> Iterator[str]:
    """Yield the name of each of ``steps`` for people, with those of all alternatives.

    ``before``: what is before each name.
    """
    for located in steps:
        step = located.step
        if isinstance(step, Conditional):
            yield f"{before}if {step.condition.words}"
            yield from titles(step.then, "then: ")
            yield from titles(step.otherwise, "else: ")
        else:
            yield f"{before}{step.title}"


class NumberedStep(NamedTuple):
    """A step, and its index in the script, from 0; the steps of all alternatives are counted."""

    number: int
    located: LocatedStep


def numbered(steps: Iterable[LocatedStep], first: int) -> Iterator[NumberedStep]:
    """Yield ``steps`` with their numbers, which begin with ``first``."""
    for located in steps:
        yield NumberedStep(first, located)
        first += count((located,))
