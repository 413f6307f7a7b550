"""The step ``grip``: close the fingers until they press with a force."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated

from katana450.arm.control import commands as cmd
from katana450.arm.control.gripper_model import GripperModel
from katana450.arm.control.state import State
from katana450.errors import InputError
from katana450.extensions.programs.building.actions import MoveFingers
from katana450.extensions.programs.building.hand_motions import with_fingers
from katana450.extensions.programs.building.plan_state import PlanState
from katana450.extensions.programs.building.step import Step
from katana450.extensions.programs.language.kinds import ObjectName, number
from katana450.extensions.touch.touch_model import TouchModel

MIN_FORCE, MAX_FORCE = 0.1, 100.0
"""[N] Bounds of a force in a script. The gripper may allow less."""

FORCE_TOLERANCE = 0.02
"""[1] Relative difference from the force that counts as reached."""


@dataclass(frozen=True, kw_only=True)
class CloseUntil(MoveFingers):
    """Close the fingers until they press with ``force`` [N].

    The angle is that which the plan predicts. An object that is thicker or thinner than predicted
    changes it.

    Attributes:
        force: [N].
        model: the forces of the fingers.
        gripper: the finger joint.
    """

    force: float
    model: TouchModel
    gripper: GripperModel

    def done(self, state: State, waited: float) -> bool:
        """Return whether the fingers press with the force.

        Raises InputError after the timeout of a motion of the fingers, and if they hold nothing or
        something else than they must.
        """
        found = self.model.squeeze(state) if super().done(state, waited) else None
        return found is not None and abs(found.force - self.force) <= FORCE_TOLERANCE * self.force

    def correction(self, state: State) -> tuple[cmd.Command, ...]:
        """Return the command that gives the force on what the fingers hold; none before they do.

        Raises InputError for a force that they cannot have there.
        """
        if state.held is None or state.grip is None:
            return ()
        return (cmd.Gripper(_angle_for(self.force, self.model, state, self.gripper)),)


def _angle_for(force: float, model: TouchModel, state: State, gripper: GripperModel) -> float:
    """Return the finger joint [rad] at which ``force`` [N] acts on what the fingers hold.

    Raises InputError for a force that they cannot have there, also beyond their range.
    """
    squeeze = model.squeeze_for(state, force)
    assert state.grip is not None
    assert state.held is not None
    angle = gripper.wider(state.grip, -squeeze)
    if gripper.is_wider(gripper.closed, angle):
        raise InputError(
            f"{state.held.name} is too thin: the fingers reach the end of their range before they "
            f"press with {force:g} N."
        )
    return angle


@dataclass(frozen=True)
class GripUntil(Step, word="grip"):
    """Close the fingers until they press with a force.

    Attributes:
        force: [N].
        holding: name of the object that they must hold then; "" for any.
    """

    force: Annotated[
        float,
        number(MIN_FORCE, MAX_FORCE, "N", "Force of a finger, N, such as 3 N").named("until"),
    ]
    holding: ObjectName = ""

    def build(self, plan: PlanState) -> PlanState:
        """Append the motion of the fingers.

        Raises InputError without an object between the fingers, and for a force that they cannot
        have on it.
        """
        fingers = plan.plan_context.arm.gripper
        hand = plan.plan_context.session.environment.hand
        model = None if hand is None else hand.grip_model
        if not isinstance(model, TouchModel):
            raise InputError("The pads of this gripper are not known, so its force is not either.")
        before = plan.state
        closed = before if before.grip is not None else with_fingers(plan, fingers.closed)
        if closed.held is None or closed.grip is None:
            raise InputError(
                "The fingers would close without an object between them. Move the open gripper "
                "over an object that can be held, or use `grasp`."
            )
        if self.holding and closed.held.name != self.holding:
            raise InputError(
                f"The fingers would hold {closed.held.name} instead of {self.holding}, which has "
                "to stand where they close."
            )
        angle = _angle_for(self.force, model, closed, fingers)
        action = CloseUntil(angle, closed.held.name, force=self.force, model=model, gripper=fingers)
        plan = replace(plan, state=closed)
        return plan.with_action(f"grip until {self.force:g} N", action, with_fingers(plan, angle))
