"""Program steps, their places in a script, and the conditions that choose between them."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, NamedTuple, Self

from katana450.arm.control.objects.pouring import BASIN, CUP, is_vessel
from katana450.arm.control.state.scene_objects import named
from katana450.arm.control.state.state import State
from katana450.errors import InputError
from katana450.extensions.programs.building.plan_state import PlanState
from katana450.extensions.programs.language.declaration import Declared, Group, record
from katana450.extensions.programs.language.kinds import ObjectName, bound, number, one_of
from katana450.maths.water.units import MILLILITRE

Millilitres = Annotated[float, number(0.0, 10_000.0, "ml")]


class Condition(Declared):
    """A condition on the measured state of an arm and its surroundings.

    Attributes:
        phrase: template of the words for what is measured, with the condition as ``{0}``.
    """

    phrase: ClassVar[str]

    @property
    def words(self) -> str:
        """Words for what is measured, as in "if cup in the hand"."""
        return self.phrase.format(self)

    @abstractmethod
    def checked(self, plan: PlanState) -> Self:
        """Return the condition for the arm of ``plan``.

        Raises InputError if it can never hold for that arm.
        """

    @abstractmethod
    def holds(self, state: State) -> bool:
        """Return whether it holds in ``state``."""


@dataclass(frozen=True)
class Held(Condition):
    """The fingers hold this object."""

    short = "name"
    phrase = "{0.name} in the hand"

    name: ObjectName

    def checked(self, plan: PlanState) -> Self:
        """Return itself. Raises InputError without such an object."""
        plan.scene_object(self.name)
        return self

    def holds(self, state: State) -> bool:
        """Return whether the fingers hold the object."""
        scene_object = named(state.objects, self.name)
        return scene_object is not None and scene_object.held


@dataclass(frozen=True)
class Volume(Condition):
    """Water in the cup, the basin or another vessel, ml; both bounds are included."""

    noun = "a volume"
    needs = ("at_least", "at_most")
    phrase = "the water in the {0.of}"

    of: ObjectName
    at_least: Millilitres = -math.inf
    at_most: Millilitres = math.inf

    def checked(self, plan: PlanState) -> Self:
        """Return itself. Raises InputError without water, and for another object."""
        if self.of not in (CUP, BASIN) and not is_vessel(plan.scene_object(self.of)):
            raise InputError(f"{self.of} holds no water: only cup, basin and vessels do.")
        if plan.state.poured is None:
            raise InputError(
                "There is no water: there is no cup in the scene, or nothing is filled."
            )
        return self

    def holds(self, state: State) -> bool:
        """Return whether the volume is within the bounds."""
        if state.poured is None:
            return False
        water, vessel = state.poured.water, state.poured.water.vessel(self.of)
        if vessel is None and self.of != BASIN:
            return False
        volume = (water.basin if vessel is None else vessel.volume) / MILLILITRE
        return self.at_least <= volume <= self.at_most


CHOICE: Group[Condition | None] = one_of(
    {"held": bound(record(Held)), "volume": bound(record(Volume))}
)
"""One condition of an ``if``, in which names may stand for values."""


STEPS: dict[str, type[Step]] = {}
"""The class of each step by its name in a script; a class enters itself with ``word``."""


class Step(Declared):
    """A program step: declared fields, and how it is planned.

    Attributes:
        word: its name in a script; "" for a base class.
        by_fingers: whether only an arm whose fingers move can do it.
    """

    word: ClassVar[str] = ""
    by_fingers: ClassVar[bool] = False

    def __init_subclass__(cls, word: str = "", example: str | None = None, **options: Any) -> None:
        """Enter the class as the step ``word``, which is also its noun in messages."""
        super().__init_subclass__(**options)
        cls.example = example
        if word:
            STEPS[word], cls.word = cls, word
            if "noun" not in vars(cls):
                cls.noun = f"`{word}`"

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


def titles(steps: Iterable[LocatedStep], before: str = "") -> Iterator[tuple[str, int, int]]:
    """Yield name for people, line and column of each of ``steps``, also of all alternatives.

    ``before``: what is before each name.
    """
    for step, line, column in steps:
        if isinstance(step, Conditional):
            yield f"{before}if {step.condition.words}", line, column
            yield from titles(step.then, "then: ")
            yield from titles(step.otherwise, "else: ")
        else:
            yield f"{before}{step.title}", line, column


class NumberedStep(NamedTuple):
    """A step, and its index in the script, from 0; the steps of all alternatives are counted."""

    number: int
    located: LocatedStep


def numbered(steps: Iterable[LocatedStep], first: int) -> Iterator[NumberedStep]:
    """Yield ``steps`` with their numbers, which begin with ``first``."""
    for located in steps:
        yield NumberedStep(first, located)
        first += count((located,))
