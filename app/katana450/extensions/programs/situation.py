"""The conditions that a program is planned for: a plan may be kept while they are the same."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from katana450.arm.control.aims import AT_START
from katana450.arm.control.state import State
from katana450.arm.control.things import Thing
from katana450.maths.geometry.arrays import FloatArray

Scene = tuple[tuple[object, ...], ...]
"""The shape and place of every thing; its looks do not matter to a plan."""


@dataclass(frozen=True, eq=False)
class Situation:
    """Everything of a state that plans depend on.

    Attributes:
        posture: (n,) the joints [rad].
        fingers: the finger joint, and where it grips; None with an empty hand [rad].
        tool: the tool frame.
        scene: the things that stand around or are held.
        water: in the cup [fl]; None where there is none.
    """

    posture: FloatArray
    fingers: tuple[float, float | None]
    tool: str
    scene: Scene
    water: int | None

    @staticmethod
    def of(state: State) -> Situation:
        """The situation of an arm at rest in ``state``."""
        return Situation(
            state.setpoint,
            (state.gripper_setpoint, state.grip),
            state.tool,
            tuple(map(_shape, state.things)),
            None if state.poured is None else state.poured.water.cup,
        )

    @property
    def key(self) -> tuple[object, ...]:
        """A hashable value that is equal for equal situations."""
        return self.posture.tobytes(), self.fingers, self.tool, self.scene, self.water

    def changed_to(self, now: Situation) -> str:
        """Return a clause that names the first change that makes a plan invalid, else "".

        The arm may stand as far from its posture as a plan may be begun.
        """
        if float(np.abs(self.posture - now.posture).max()) > AT_START:
            return "the arm has moved"
        if self.fingers != now.fingers:
            return "the gripper has moved"
        if self.tool != now.tool:
            return "another tool frame is chosen"
        if self.scene != now.scene:
            return "the scene has changed"
        return "" if self.water == now.water else "the water has changed"


def _shape(thing: Thing) -> tuple[object, ...]:
    solid = None if thing.solid is None else thing.solid.key
    T = thing.T.tobytes()
    return (
        thing.name, thing.form, thing.size, thing.scale, solid, T,
        thing.held, thing.fixed, thing.can_be_held,
    )  # fmt: skip
