"""The step ``pick``, which grasps an object and lifts it, and ``stack``, which also places it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from katana450.errors import InputError
from katana450.extensions.programs.approach import UP
from katana450.extensions.programs.declaration import Declared
from katana450.extensions.programs.grasp import Grasp
from katana450.extensions.programs.kinds import Object, ObjectName
from katana450.extensions.programs.place import PlaceHeld
from katana450.extensions.programs.plan_builder import PlanBuilder
from katana450.extensions.programs.step import Step

LIFTS = (0.06, 0.04, 0.025, 0.015)
"""[m] Heights to which an object is lifted, tried from the highest."""


@dataclass(frozen=True)
class Pick(Grasp, word="pick"):
    """Grasp an object, and lift it."""

    def build(self, builder: PlanBuilder) -> None:
        """Plan grasp and lifting. Raises InputError if it is not possible."""
        super().build(builder)
        at = builder.target

        def lift(height: float) -> None:
            raised = at.moved(at.position + height * UP)
            builder.lead([builder.planning.line(at, raised)], f"lift {self.name}")

        try:
            builder.first(LIFTS, lift)
        except InputError as error:
            raise error.after(f"{self.name} cannot be lifted") from error


@dataclass(frozen=True)
class Stack(Declared):
    """Pick an object and place it on the middle of another."""

    noun = "a stack"

    name: Object
    on: ObjectName
    in_base: bool = False

    @classmethod
    def mistakes(cls, given: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
        """Yield the mistake of an object on itself."""
        if given.get("name") is not None and given["name"] == given.get("on"):
            yield "", f"{given['name']} cannot stand on itself."

    @property
    def steps(self) -> tuple[Step, Step]:
        """Two steps, so that the object is picked in another way if it cannot be placed."""
        return Pick(self.name), PlaceHeld(on=self.on, in_base=self.in_base)
