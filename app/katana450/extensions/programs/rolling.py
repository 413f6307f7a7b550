"""The roll of a held vessel by the wrist of the five-axis family, over what receives its water."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.polynomial.polynomial import polyfit, polyval

from katana450.arm.control.scene_objects import SceneObject
from katana450.extensions.programs.curve import ToolLine
from katana450.extensions.programs.plan_builder import PlanBuilder
from katana450.extensions.programs.tilting import AIM, UNDERSIDES
from katana450.extensions.programs.tool_curves import ToolTurn
from katana450.extensions.programs.tool_planning import AnyCurve
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.kinematics.tool import ToolTarget

NODES: Final = frozen(-np.cos(np.linspace(0.0, np.pi, 15)))
"""Places in the interval from -1 to 1, with its ends, through which polynomials are laid."""

ROUNDS: Final = 12
"""Number of corrections of the tool's place; each leaves less than a third of the error."""

FIRST_ROLL: Final = 1e-4
"""[1] Fraction of the roll at which the lip of an upright vessel is found."""


@dataclass(frozen=True, eq=False)
class Rolling:
    """The motions that roll a vessel. Rolls are those of the tool [rad].

    Attributes:
        at: the tool with the vessel upright.
        turn: the roll from there to the end of the pour.
        offsets: coefficients (n, 3) of the way of the tool point [m] that keeps the lip in its
            place, of the powers of 2 (roll - at.roll) / turn - 1; None to keep the tool point.
    """

    at: ToolTarget
    turn: float
    offsets: FloatArray | None = None

    def line(self, start: float, end: float) -> AnyCurve:
        """Return the even turn from one roll to another."""
        if self.offsets is None:
            return ToolLine(replace(self.at, roll=start), replace(self.at, roll=end))
        return self.by(np.array((0.5 * (start + end), 0.5 * (end - start))))

    def by(self, rolls: FloatArray) -> AnyCurve:
        """Return the turn whose roll is a polynomial of ``rolls`` (n,); see `ToolTurn`."""
        if self.offsets is None:
            return ToolTurn(self.at, rolls)
        places = 2.0 * (polyval(NODES, rolls) - self.at.roll) / self.turn - 1.0
        return ToolTurn(self.at, rolls, _through(polyval(places, self.offsets).T))


def over_vessel(
    builder: PlanBuilder, held: SceneObject, below: SceneObject, level: ToolTarget, turn: float
) -> Rolling:
    """Return the roll with the lip of the ``held`` vessel in one place over the vessel ``below``.

    ``level``: the tool with the upright vessel, anywhere. Raises InputError out of reach.
    """
    height = below.height + held.height + UNDERSIDES[0]
    over = builder.point(below.T[:3, 3] + (0.0, 0.0, height), in_base=True)
    positions, position = [], over
    for place in (0.5 * turn * np.maximum(1.0 + NODES, FIRST_ROLL)).tolist():
        for _ in range(ROUNDS):
            tool = replace(level, position=position, roll=level.roll + place)
            lip, toward = lip_of(builder, held, builder.joints_of(tool))
            position = position + over - AIM * toward - lip
        positions.append(position)
    at = replace(level, position=frozen(positions[0]))
    return Rolling(at, turn, _through(np.array(positions) - positions[0]))


def lip_of(builder: PlanBuilder, held: SceneObject, q: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the lowest point (3,) [m] of the rim in {S}, and the level direction (3,) out of it.

    q: the joints (5,) [rad] with which the vessel is tilted.
    """
    environment = builder.plan_context.session.environment
    T = environment.pose(held, np.append(q, builder.state.gripper_setpoint))
    up = T[:3, 2]
    downhill = -(np.array((0.0, 0.0, 1.0)) - up[2] * up)
    downhill /= np.linalg.norm(downhill)
    rim = builder.point(T[:3, 3] + held.height * up + held.extent[0] * downhill, in_base=True)
    toward = np.array((up[0], up[1], 0.0)) / np.hypot(up[0], up[1])
    return rim, builder.direction(toward, in_base=True)


def _through(values: FloatArray) -> FloatArray:
    """Return the coefficients (n, 3) of the polynomial with the ``values`` (n, 3) at NODES."""
    return frozen(polyfit(NODES, values, len(NODES) - 1))
