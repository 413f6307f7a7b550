"""Steps of scripts for arms outside the five-axis family, and the refusal of all others."""

from __future__ import annotations

from typing import Final

from katana450.arm.control.arm import ArmModel
from katana450.arm.control.messages import finding_text
from katana450.arm.control.state import State
from katana450.errors import InputError
from katana450.extensions.programs.step_target import StepTarget
from katana450.maths.geometry.arrays import FloatArray

FIVE: Final = 5
"""Number of freedoms of a tool that has a pitch and a roll."""

OF_FIVE_AXES: Final = (
    "This needs a five-axis arm. Scripts of other arms can have `home`, `joints`, `nudge`, `move` "
    "to x, y and z or `by` a distance, and `via` such places."
)
"""Refusal of a step that needs a pitch, a roll or a path of the tool."""


def has_five_axes(arm: ArmModel) -> bool:
    """Return whether ``arm`` is of the five-axis family."""
    return arm.kinematics.freedoms == FIVE


def need_five_axes(arm: ArmModel) -> None:
    """Raise InputError for an arm outside the five-axis family."""
    if not has_five_axes(arm):
        raise InputError(OF_FIVE_AXES)


def point_of(place: StepTarget) -> FloatArray:
    """Return the position (3,) [m] of ``place``. Raises InputError if it has more or none."""
    if place.position is None or (place.pitch, place.roll, place.branch) != (None,) * 3:
        raise InputError(OF_FIVE_AXES)
    return place.position


def joints_at_point(arm: ArmModel, state: State, p: FloatArray) -> FloatArray:
    """Return the joints (n,) [rad] with the tool point at ``p`` (3,) [m] in {S}.

    The tool keeps its orientation and its branch. Raises InputError with the reason if it cannot.
    """
    kinematics = arm.kinematics_to(state.tool)
    target = kinematics.target_at(state.goal).moved(p)
    found = kinematics.leap(state, target, state.branch)
    losses = kinematics.losses(state, found, yaw_was_given=False)
    if losses:
        reasons = "; ".join(map(finding_text, losses))
        raise InputError(f"The place cannot be reached with this orientation: {reasons}.")
    return found.q
