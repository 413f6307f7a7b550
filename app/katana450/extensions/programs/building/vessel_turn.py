"""The turn of a held vessel over a basin or another vessel, and the tilt that pours a given flow.

An arm of the five-axis family rolls the vessel by its wrist. Other arms tilt it about its lip.

The tilt is the inverse of the flow over the lip of the cup. The surface is level and at rest. See
``maths/water/lip.py`` for the rules.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import numpy.typing as npt
from numpy.polynomial.polynomial import polyfit, polyval

from katana450.arm.control.objects.pouring import is_vessel
from katana450.arm.control.state.scene_objects import SceneObject
from katana450.errors import InputError
from katana450.extensions.programs.building.plan_state import PlanState
from katana450.extensions.programs.planning.approach import UP
from katana450.extensions.programs.planning.curves import Curve, PoseTurn, ToolLine, ToolTurn
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.kinematics.tool import ToolTarget
from katana450.maths.water.cylinder import Cylinder
from katana450.maths.water.lip import THINNING_TIME, viscous_flow, weir_flow, withdrawn_thickness
from katana450.maths.water.units import GRAVITY

HALVINGS = 40
"""Number of halvings of the interval that contains the tilt: to 3e-12 rad."""


def flow_at(tilt: float, volume: float, cup: Cylinder) -> float:
    """Return the flow [m^3/s] out of a cup with ``volume`` [m^3] at ``tilt`` [rad]."""
    over = volume - cup.holds(tilt)
    head = -cup.margin(tilt, cup.level(tilt, volume))
    if over <= 0.0 or head <= 0.0:
        return 0.0
    weir = weir_flow(cup.radius, tilt, head, GRAVITY)
    thick = viscous_flow(cup.radius, tilt, head, GRAVITY)
    return min(weir, thick) + over / THINNING_TIME


def tilt_for(flow: float, volume: float, cup: Cylinder) -> float:
    """Return the tilt [rad] at which a cup with ``volume`` [m^3] pours ``flow`` [m^3/s].

    The flow grows with the tilt. The result is pi if the flow is not reached.
    """
    low, high = 0.0, math.pi
    for _ in range(HALVINGS):
        tilt = 0.5 * (low + high)
        if flow_at(tilt, volume, cup) < flow:
            low = tilt
        else:
            high = tilt
    return high


def spill_tilt(cup: Cylinder, volume: float) -> float:
    """Return the tilt [rad] from which ``cup`` no longer holds ``volume`` [m^3].

    Down to half of its capacity the floor stays covered and the answer is an arc tangent.
    """
    rise = cup.depth - volume / (math.pi * cup.radius**2)
    if rise <= 0.5 * cup.depth:
        return math.atan2(max(rise, 0.0), cup.radius)
    low, high = math.atan2(0.5 * cup.depth, cup.radius), 0.5 * math.pi
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        if cup.holds(middle) > volume:
            low = middle
        else:
            high = middle
    return low


def film_after(poured: float, rest: float, time: float, cup: Cylinder) -> float:
    """Return the volume [m^3] of the film when ``poured`` [m^3] has flowed out in ``time`` [s].

    ``rest`` [m^3] stays in the cup. The surface falls evenly from that of the upright cup to that
    at the tilt that holds the rest.
    """
    full = cup.wetted(0.0, (poured + rest) / (math.pi * cup.radius**2))
    tilt = spill_tilt(cup, rest)
    bared = max(full - cup.wetted(tilt, cup.level(tilt, rest)), 0.0)
    speed = bared / (math.tau * cup.radius * time)
    return 2.0 / 3.0 * bared * withdrawn_thickness(speed, GRAVITY)


EMPTY_TILT: Final = math.radians(120.0)
"""[rad] Tilt of a cup that is emptied about its lip: past its side. It is not tilted farther."""

POUR_TURN: Final = math.radians(165.0)
"""[rad] Roll of a pour: with any tilt of the tool, the cup then lies past its side."""

UNDERSIDES: Final = (0.02, 0.05, 0.09)
"""[m] Heights of the upright cup over the rim below it, tried in this order."""

ABOVE_RIM: Final = 0.13
"""[m] Height of the tool above the rim of a basin: the cup is rolled over between them."""

AIM: Final = 0.015
"""[m] Distance of the lip before the middle of another vessel: as far as the water flies while it
falls, with the flows of a pour.
"""

NODES: Final = frozen(-np.cos(np.linspace(0.0, np.pi, 15)))
"""Places in the interval from -1 to 1, with its ends, through which polynomials are laid."""

ROUNDS: Final = 12
"""Number of corrections of the tool's place; each leaves less than a third of the error."""

FIRST_ROLL: Final = 1e-4
"""[1] Fraction of the roll at which the lip of an upright vessel is found."""


class VesselTurn(ABC):
    """The motions that turn an upright vessel over. Angles [rad] count from upright.

    Attributes:
        at: the tool with the vessel upright.
        end: angle at the end of the pour.
    """

    at: ToolTarget
    end: float

    @abstractmethod
    def line(self, start: float, end: float) -> Curve:
        """Return the even turn from one angle to another."""


@dataclass(frozen=True, eq=False)
class Tilting(VesselTurn):
    """The turn of a cup about its lip. Its angle is the tilt.

    Attributes:
        at: the tool with the cup upright.
        lip: (3,) the point of the lip about which the cup tilts [m].
        axis: unit vector (3,), level, about which it does.
        axis_in_pose: the same in the frame of the rotation of a `ToolTarget`.
        end: angle at the end of the pour.
    """

    at: ToolTarget
    lip: FloatArray
    axis: FloatArray
    axis_in_pose: FloatArray
    end: float

    def line(self, start: float, end: float) -> Curve:
        """Return the `PoseTurn`."""
        return PoseTurn(self.at, self.lip, self.axis, _evenly(start, end), self.axis_in_pose)


@dataclass(frozen=True, eq=False)
class Rolling(VesselTurn):
    """The roll of a vessel by the wrist. Its angle is the roll of the tool, either way.

    Attributes:
        at: the tool with the vessel upright.
        end: angle at the end of the pour.
        offsets: coefficients (n, 3) of the path of the tool point [m] that keeps the lip in its
            place, of the powers of 2 angle / end - 1; None to keep the tool point.
    """

    at: ToolTarget
    end: float
    offsets: FloatArray | None = None

    def line(self, start: float, end: float) -> Curve:
        """Return the even roll."""
        if self.offsets is None:
            one, other = (replace(self.at, roll=self.at.roll + roll) for roll in (start, end))
            return ToolLine(one, other)
        angles = _evenly(start, end)
        rolls = np.append(self.at.roll + angles[0], angles[1:])
        places = 2.0 * polyval(NODES, angles) / self.end - 1.0
        return ToolTurn(self.at, rolls, _through(polyval(places, self.offsets).T))


def _evenly(start: float, end: float) -> FloatArray:
    """Return the coefficients (2,) of an even turn [rad], of the powers of 2 sigma - 1."""
    return np.array((0.5 * (start + end), 0.5 * (end - start)))


def turns_over(
    plan: PlanState,
    held: SceneObject,
    below: SceneObject,
    tilt: float | None,
) -> Iterator[VesselTurn]:
    """Yield the ways to turn the vessel in the hand over ``below``, the best first.

    Args:
        plan: the arm, which holds it.
        held: the vessel.
        below: what receives its water.
        tilt: its tilt at the end of the pour [rad]; None to empty it.

    Raises InputError for a tilt that the arm cannot give it, and out of reach.
    """
    level = plan.target
    if not level.is_pitched:
        if tilt is not None and tilt > EMPTY_TILT:
            raise InputError("No tilt of the cup pours this part; pour all of it, or less.")
        yield from _about_the_lip(plan, held, below, tilt)
        return
    roll = POUR_TURN if tilt is None else float(_roll_of(tilt, level.pitch))
    if tilt is not None and roll >= POUR_TURN:
        raise InputError("The wrist cannot tilt it that far; pour all of it, or less.")
    over = _over_vessel if is_vessel(below) else _over_basin
    for sign, limit in ((1.0, plan.chain.upper[4]), (-1.0, -plan.chain.lower[4])):
        # The turn is limited to the range of the wrist.
        turn = sign * min(roll, 0.995 * float(limit) - abs(level.roll))
        yield over(plan, held, below, level, turn, is_emptied=tilt is None)


def _about_the_lip(
    plan: PlanState, held: SceneObject, below: SceneObject, tilt: float | None
) -> Iterator[Tilting]:
    """Yield the ways to tilt an upright cup about its lip, by a hand that takes poses."""
    T = plan.plan_context.session.environment.pose(held, plan.state.x_setpoint)
    cup = plan.point(T[:3, 3] + held.height * T[:3, 2], in_base=True)
    over = plan.point(below.T[:3, 3] + (0.0, 0.0, below.height), in_base=True)
    level, hand, aim = plan.target, plan.hand, AIM if is_vessel(below) else 0.0
    for height in UNDERSIDES:
        point = over + (held.height + height) * UP
        for turn, toward, in_pose in hand.tilt_directions(plan.q, cup, point):
            lip = point - aim * toward
            axis, axis_in_pose = (frozen(np.cross(UP, d)) for d in (toward, in_pose))
            # The cup turns with the arm on the way to the basin.
            moved = so3.rotation_z(turn) @ (level.position - cup)
            tool = hand.turned(level, lip - held.extent[0] * toward + moved, turn)
            end = EMPTY_TILT if tilt is None else tilt
            yield Tilting(tool, frozen(lip), axis, axis_in_pose, end)


def _over_basin(
    plan: PlanState,
    held: SceneObject,
    below: SceneObject,
    level: ToolTarget,
    turn: float,
    *,
    is_emptied: bool,
) -> Rolling:
    """Return the roll with the lip over the middle of the object ``below`` when it pours."""
    over = plan.point(below.T[:3, 3] + (0.0, 0.0, below.height + ABOVE_RIM), in_base=True)
    position = over
    for _ in range(3):
        # When the cup lies on its side, or is tilted as far as it will be.
        tool = replace(level, position=position)
        tilted = 0.5 * turn if is_emptied else turn
        side = plan.joints_of(replace(tool, roll=level.roll + tilted))
        position = position + (over - _lip(plan, held, side)[0]) * (1.0, 1.0, 0.0)
    return Rolling(replace(level, position=position), turn)


def _over_vessel(
    plan: PlanState,
    held: SceneObject,
    below: SceneObject,
    level: ToolTarget,
    turn: float,
    *,
    is_emptied: bool,  # noqa: ARG001
) -> Rolling:
    """Return the roll with the lip in one place over the vessel ``below``."""
    height = below.height + held.height + UNDERSIDES[0]
    over = plan.point(below.T[:3, 3] + (0.0, 0.0, height), in_base=True)
    positions, position = [], over
    for roll in (0.5 * turn * np.maximum(1.0 + NODES, FIRST_ROLL)).tolist():
        for _ in range(ROUNDS):
            tool = replace(level, position=position, roll=level.roll + roll)
            lip, toward = _lip(plan, held, plan.joints_of(tool))
            position = position + over - AIM * toward - lip
        positions.append(position)
    upright = replace(level, position=frozen(positions[0]))
    return Rolling(upright, turn, _through(np.array(positions) - positions[0]))


def _lip(plan: PlanState, held: SceneObject, q: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the lowest point (3,) [m] of the rim in {S}, and the level direction (3,) out of it.

    q: the joints (5,) [rad] with which the vessel is tilted.
    """
    environment = plan.plan_context.session.environment
    T = environment.pose(held, np.append(q, plan.state.gripper_setpoint))
    up = T[:3, 2]
    downhill = -(np.array((0.0, 0.0, 1.0)) - up[2] * up)
    downhill /= np.linalg.norm(downhill)
    rim = plan.point(T[:3, 3] + held.height * up + held.extent[0] * downhill, in_base=True)
    toward = np.array((up[0], up[1], 0.0)) / np.hypot(up[0], up[1])
    return rim, plan.direction(toward, in_base=True)


def _through(values: FloatArray) -> FloatArray:
    """Return the coefficients (n, 3) of the polynomial with the ``values`` (n, 3) at NODES."""
    return frozen(polyfit(NODES, values, len(NODES) - 1))


def _roll_of(tilt: npt.ArrayLike, pitch: float) -> FloatArray:
    """Return the roll [rad] of a tool with ``pitch`` [rad] at which a cup has ``tilt`` [rad].

    Rolling by phi tilts it by cos(tilt) = cos(phi) + (1 - cos(phi)) sin(pitch)^2. The result is pi
    where no roll tilts it that far.
    """
    steep = math.sin(pitch) ** 2
    return np.arccos(np.clip((np.cos(tilt) - steep) / (1.0 - steep), -1.0, 1.0))
