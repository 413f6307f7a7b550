"""The planning of a hand: how it comes to an object, draws back, and carries what it holds."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from katana450.arm.control.objects.pouring import is_vessel
from katana450.arm.control.session.session import Session
from katana450.arm.control.state.scene_objects import SceneObject
from katana450.arm.control.state.state import State
from katana450.errors import InputError
from katana450.extensions.programs.planning.hand_frames import (
    ABOVE,
    DOWN,
    FRONT,
    JAW_ROOM,
    LOW,
    PLANAR_AXES,
    ROLLING_AXES,
    YAW_TOLERANCE,
    Approach,
    ArmPlane,
    GraspFrame,
    Widths,
    fitting,
    grasp_frame,
    symmetry,
    widths,
)
from katana450.extensions.programs.planning.tool_planning import ToolPlanning
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.kinematics.branch import AnyBranch
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.tool import ToolTarget
from katana450.maths.kinematics.turns import wrapped

FREE_AXES: Final = 6
"""Minimum number of axes with which a hand takes every pose."""

GRASP: Final = "grasp"
"""Name of a tool frame that the five-axis family grasps with, if its description has it."""

PITCHES: Final = tuple(np.radians((45.0, 25.0, 65.0)).tolist())
"""[rad] Pitches of the hand for a grasp from the front, tried in this order."""

FLAT_PITCHES: Final = tuple(np.radians((30.0, 35.0, 25.0, 40.0, 20.0, 45.0)).tolist())
"""[rad] The same for five axes. They pour better with a smaller pitch, but the limit of the
shoulder joint of the Katana keeps a level tool (pitch 0) above 110 mm.
"""

STEEP_PITCHES: Final = tuple(np.radians((55.0, 65.0, 75.0)).tolist())
"""[rad] Further pitches for objects that are not poured, as near the arm only these are reached."""

TIP_DISTANCES: Final = tuple(np.arange(0.0, 0.056, 0.002).tolist())
"""[m] Distances of the hand before the middle of a low object that is grasped by the tips, tried
from the smallest.
"""

FRAME_DEPTH: Final = 0.014
"""[m] The smallest of these for a frame `grasp`, which is farther behind the tips. They move down
as the fingers close.
"""

SWINGS: Final = tuple(np.radians((-30.0, 30.0, -60.0, 60.0)).tolist())
"""[rad] Turns of the arm angle with which a pose is tried."""

MAX_BRANCHES: Final = 4
"""Maximum number of branches on which a grasp is tried."""

TILT_DIRECTIONS: Final = tuple(np.radians((90.0, -90.0, 45.0, -45.0, 0.0)).tolist())
"""[rad] Directions in which a cup is tilted, seen from above, from that in which the hand points.
Beside the hand the wrist does most of the turn.
"""

TURNS: Final = tuple(np.radians((45.0, -45.0, 90.0, -90.0, 180.0)).tolist())
"""[rad] Further turns of an object over its new place, beside those with the arm and without."""

MAX_SKEW: Final = math.radians(15.0)
"""[rad] Maximum angle between the fingers and the sides of a box: the pads yield by as much."""


class TiltDirection(NamedTuple):
    """A direction in which a held cup is tilted over a place.

    Attributes:
        turn: turn about axis 1 that brings the cup there [rad].
        toward: (3,) unit vector, level, from the middle of the rim to the lip, in {S}.
        in_pose: the same in the frame of the rotation of a `ToolTarget`.
    """

    turn: float
    toward: FloatArray
    in_pose: FloatArray


@dataclass(frozen=True, eq=False)
class HandPlanning:
    """The hand of one arm with one tool. Joint angles ``q`` are (n,) [rad], points (3,) [m] in {S}.

    Six and more axes take whole poses. The yaw of a hand on fewer follows from its place, in an
    `ArmPlane`; four axes choose its pitch, and five its roll, too.

    Attributes:
        planning: that of the tool.
        T_base_shoulder: (4, 4) pose of {S} in the base frame [m].
        T_tool_grasp: (4, 4) pose of the grasp frame in that of the tool [m].
        frame: where its fingers meet; a suction cup takes objects from above at their tops.
        plane: that of an arm with fewer than six axes; None for others.
        tool: name of the tool frame that grasps; "" for every one.
    """

    planning: ToolPlanning
    T_base_shoulder: FloatArray
    T_tool_grasp: FloatArray
    frame: GraspFrame
    plane: ArmPlane | None
    tool: str = ""

    @property
    def tip_distances(self) -> Sequence[float]:
        """The distances [m] at which fingertips grasp a low object, in their order."""
        return [distance for distance in TIP_DISTANCES if not self.tool or distance >= FRAME_DEPTH]

    @property
    def is_redundant(self) -> bool:
        """True if the arm takes a pose in a curve of postures."""
        return self._chain.n > FREE_AXES

    def approaches(
        self, scene_object: SceneObject, place: FloatArray, side: FloatArray
    ) -> Mapping[str, Sequence[Approach]]:
        """Return the approaches that suit an object, by side, the preferred side first.

        The object stands at ``place`` (3,) [m] with its x axis along ``side`` (3,), both in {S}. A
        vessel is only grasped from the front: from above the wrist could not pour it. Raises
        InputError for an object that does not fit between the fingers.
        """
        pitches = PITCHES
        if self._chain.n == ROLLING_AXES:
            # Only steep fingertips come near what a low object stands on.
            low = STEEP_PITCHES[::-1] if scene_object.height < LOW else None
            pitches = low or (*FLAT_PITCHES, *STEEP_PITCHES)
            pitches = FLAT_PITCHES if is_vessel(scene_object) else pitches
        return self._fitting(pitches, scene_object, place, side)

    def with_pitch(
        self, pitch: float, scene_object: SceneObject, place: FloatArray, side: FloatArray
    ) -> Sequence[Approach]:
        """Return the approaches with ``pitch`` [rad]; see ``approaches``."""
        options = self._fitting((pitch,), scene_object, place, side)
        return options.get(ABOVE if abs(pitch - DOWN) <= YAW_TOLERANCE else FRONT, ())

    def _fitting(
        self,
        pitches: Sequence[float],
        scene_object: SceneObject,
        place: FloatArray,
        side: FloatArray,
    ) -> Mapping[str, Sequence[Approach]]:
        """Return all approaches between whose fingers the object fits, or raise InputError."""
        options: Widths = widths(pitches, scene_object, place, side)
        if self.frame.is_cup:
            options = {ABOVE: options.get(ABOVE, ())}
        if self.plane is not None:
            options = self._in_plane(self.plane, options)
        return fitting(options, self.frame.opening, one_jaw=self.frame.one_jaw)

    def _in_plane(self, plane: ArmPlane, options: Widths) -> Widths:
        """Return those options whose direction and, with four axes, roll follow from the arm."""
        possible = {
            side: [
                (approach._replace(aside=0.0, roll=approach.roll if plane.rolls else 0.0), width)
                for approach, width in approaches
                if abs(approach.aside) <= MAX_SKEW
                and (plane.rolls or abs(approach.roll) <= MAX_SKEW)
            ]
            for side, approaches in options.items()
        }
        if not any(possible.values()):
            raise InputError(
                "its sides are turned too far, seen from the arm, and four axes cannot turn the "
                f"hand: at most {math.degrees(MAX_SKEW):.0f} deg are possible. Turn it."
            )
        if plane.rolls and self.frame.one_jaw:
            # The fixed jaw may be on either side.
            possible[FRONT] = [
                (approach._replace(roll=roll), width)
                for approach, width in possible[FRONT]
                for roll in (0.0, math.pi)
            ]
        return possible

    def before(self, middle: FloatArray, approach: Approach, back: float) -> ToolTarget:
        """Return the tool at which the hand is ``back`` [m] before ``middle`` (3,) [m]."""
        inside = (self.T_tool_grasp @ (back, approach.shift, 0.0, 1.0))[:3]
        if self.plane is None:
            yaw = math.atan2(middle[1], middle[0]) + approach.aside
            R_hand = so3.from_rpy(approach.roll, approach.pitch, yaw)
            R, turn = R_hand @ self.T_tool_grasp[:3, :3].T, 0.0
        else:
            R = self.plane.rotation(approach.pitch, approach.roll)
            turn = self.plane.turn(middle, self.plane.beside_at(R, inside))
        return self.planning.target(frozen(middle - so3.rotation_z(turn) @ R @ inside), R)

    def retreat(self, q: FloatArray, away: float) -> ToolTarget:
        """Return the tool with which the hand leaves an object that it released at `q`.

        It is drawn back by ``away`` [m] and, for a fixed jaw, moved by JAW_ROOM along -y of the
        grasp frame, so that this jaw leaves the object.
        """
        target, (x, y, _) = self.planning.at(q), self._R(q).T
        aside = JAW_ROOM if self.frame.one_jaw else 0.0
        return target.moved(frozen(target.position - away * x - aside * y))

    def branches_to(self, q: FloatArray, target: ToolTarget) -> Sequence[AnyBranch | None]:
        """Return the branches on which a grasp at ``target`` is tried, that of `q` first.

        None is the nearest one. The result is empty if ``target`` is out of reach.
        """
        chain, kinematics = self._chain, self.planning.kinematics
        if self.planning.is_pitched:
            return () if self.planning.joints(q, target, None) is None else (None,)
        R = target.R
        if self.plane is not None:
            turn = self.plane.turn(target.position, self.plane.beside_at(R, np.zeros(3)))
            R = so3.rotation_z(turn) @ R
        T = se3.from_rotation_translation(R, target.position)
        present, hints = kinematics.branch_of(q), [q]
        for axis in self.planning.equations(q).locked[:1]:
            # The posture there may have another arm angle.
            hints += [chain.clamp(q + swing * np.eye(chain.n)[axis]) for swing in SWINGS]
        for hint in hints:
            postures = [
                p for p in kinematics.solver.inverse(T, hint) if p.exact and p.within_limits
            ]
            if postures:
                names = sorted((str(p.branch) for p in postures), key=lambda name: name != present)
                return [*dict.fromkeys(names)][:MAX_BRANCHES]
        return ()

    def branch_at(self, q: FloatArray) -> AnyBranch | None:
        """Return the branch on which an approach to `q` begins; None for any."""
        five = self._chain.n == ROLLING_AXES
        return None if five else self.planning.kinematics.branch_of(q)

    def way_round(self, start: float, end: float) -> float:
        """Return the turn [rad] about axis 1 by which an object is carried between directions.

        It is the shorter one, but not behind an arm whose axis 1 does not turn all round.
        """
        turns_round = self._chain.upper[0] - self._chain.lower[0] >= math.tau
        return wrapped(end - start) if turns_round else end - start

    def turned(self, target: ToolTarget, position: FloatArray, angle: float) -> ToolTarget:
        """Return ``target`` turned by ``angle`` [rad] about the vertical, to ``position`` (3,).

        The targets of fewer than six axes turn with the arm.
        """
        if self.plane is not None:
            return target.moved(frozen(position))
        return ToolTarget(frozen(position), rotation=frozen(so3.rotation_z(angle) @ target.R))

    def over(
        self,
        held: SceneObject,
        T_base_object: FloatArray,
        q: FloatArray,
        goal: FloatArray,
        yaw: float | None,
    ) -> Sequence[ToolTarget]:
        """Return the tools that hold an object over ``goal`` (3,) [m], the best first.

        Args:
            held: the object in the hand.
            T_base_object: (4, 4) its present pose in the base frame.
            q: the present posture.
            goal: the place of its underside.
            yaw: its angle about the vertical in the base frame [rad]; None for any.

        Raises InputError for a ``yaw`` to which this hand cannot turn it.
        """
        p = (se3.inverse(self.T_base_shoulder) @ T_base_object)[:3, 3]
        now, alike = math.atan2(T_base_object[1, 0], T_base_object[0, 0]), symmetry(held)
        free = yaw is None or alike == 0.0
        if self.plane is None:
            start, end = (math.atan2(place[1], place[0]) for place in (p, goal))
            natural = self.way_round(start, end)
            if yaw is None or free:
                turns = [natural, 0.0, *(wrapped(natural + turn) for turn in TURNS)]
            else:
                first = natural + math.remainder(yaw - now - natural, alike)
                turns = sorted(
                    (wrapped(first + k * alike) for k in range(round(math.tau / alike))),
                    key=lambda turn: abs(wrapped(turn - natural)),
                )
            tools = [self._carried(q, p, goal, turn) for turn in turns]
            return [tool for tool in tools if self.branches_to(q, tool)] or tools[:1]
        natural, tool = self._rolled_over(self.plane, q, p, goal, 0.0)
        if yaw is None or free:
            return [tool]
        turn = math.remainder(yaw - wrapped(now + natural), alike)
        if abs(turn) <= YAW_TOLERANCE:
            return [tool]
        pitch, roll = self.plane.angles(self._R_level(q))
        if not self.plane.rolls or abs(pitch - DOWN) > YAW_TOLERANCE:
            remedy = "Leave out the yaw: four axes cannot turn it."
            if self.plane.rolls:
                remedy = "Pick it with `side: above`, or leave out the yaw."
            raise InputError(
                "it turns with the arm, and its yaw would be "
                f"{math.degrees(wrapped(now + natural)):.1f} deg there instead of "
                f"{math.degrees(yaw):g}. {remedy}"
            )
        count = round(math.tau / alike)
        rolls = sorted((wrapped(roll - turn + k * alike) for k in range(count)), key=abs)
        return [self._rolled_over(self.plane, q, p, goal, angle - roll)[1] for angle in rolls]

    def _carried(self, q: FloatArray, p: FloatArray, goal: FloatArray, turn: float) -> ToolTarget:
        """Return the tool at `q`, turned with an object at `p` (3,) so that it is at ``goal``."""
        target = self.planning.at(q)
        return self.turned(target, goal + so3.rotation_z(turn) @ (target.position - p), turn)

    def _rolled_over(
        self, plane: ArmPlane, q: FloatArray, p: FloatArray, goal: FloatArray, by: float
    ) -> tuple[float, ToolTarget]:
        """Return the turn [rad] about axis 1 that brings an object to ``goal``, and the tool there.

        The object at `p` (3,) [m] is held at `q`, and rolled ``by`` [rad] by the hand.
        """
        T = forward(self._chain, q)
        inside = T[:3, :3].T @ (p - T[:3, 3])
        R = self._R_level(q)
        if by:
            pitch, roll = plane.angles(R)
            R = plane.rotation(pitch, roll + by)
        turn = plane.turn(goal, plane.beside_at(R, inside))
        position = frozen(goal - so3.rotation_z(turn) @ R @ inside)
        # Without a roll, the target keeps the turns of its angles.
        target = self.planning.target(position, R) if by else self.planning.at(q).moved(position)
        return wrapped(turn - self._turned(q)), target

    def tilt_directions(
        self, q: FloatArray, cup: FloatArray, over: FloatArray
    ) -> Iterable[TiltDirection]:
        """Yield the directions in which a cup can be tilted with its lip over a place.

        Args:
            q: the present posture.
            cup: (3,) the present middle of its rim [m] in {S}.
            over: (3,) the place of the lip [m] in {S}.
        """
        if self.plane is None:
            start, end = (math.atan2(p[1], p[0]) for p in (cup, over))
            turn = self.way_round(start, end)
            x, y, _ = self._R(q)[:, 0]
            for aside in TILT_DIRECTIONS:
                toward = so3.rotation_z(math.atan2(y, x) + turn + aside)[:, 0]
                yield TiltDirection(turn, toward, toward)
            return
        present = self._turned(q)
        distance = float(self.plane.across @ so3.rotation_z(-present) @ cup)
        turn = self.plane.turn(over, distance)
        for outward in (self.plane.outward, -self.plane.outward):
            yield TiltDirection(wrapped(turn - present), so3.rotation_z(turn) @ outward, outward)

    @property
    def _chain(self) -> Chain:
        return self.planning.kinematics.chain

    def _R(self, q: FloatArray) -> FloatArray:
        """Return the rotation (3, 3) of the grasp frame in {S} at `q`."""
        return np.asarray(forward(self._chain, q)[:3, :3] @ self.T_tool_grasp[:3, :3])

    def _turned(self, q: FloatArray) -> float:
        """Return the turn [rad] of the plane of the arm about the vertical at `q`."""
        return 0.0 if self.plane is None else self.plane.sign * float(q[0])

    def _R_level(self, q: FloatArray) -> FloatArray:
        """Return the rotation (3, 3) of the tool at `q`, turned back to axis 1 at zero."""
        return np.asarray(so3.rotation_z(-self._turned(q)) @ forward(self._chain, q)[:3, :3])


def hand_of(session: Session, T_base_shoulder: FloatArray, state: State) -> HandPlanning:
    """Return the hand of the arm of ``session`` with the tool of ``state``.

    ``T_base_shoulder``: (4, 4) pose of {S} in the base frame [m]. Raises InputError, with the
    reason, for an arm that cannot grasp.
    """
    arm, environment = session.require_arm(), session.environment
    planning, axes = ToolPlanning(arm.kinematics_to(state.tool), state), arm.chain.n
    in_family, chain = planning.is_pitched, planning.chain
    if in_family and GRASP in arm.tools:
        in_front = ArmPlane.of(chain, np.eye(4), session.ready)
        frame = GraspFrame(np.eye(4), math.inf)
        return HandPlanning(planning, T_base_shoulder, np.eye(4), frame, in_front, GRASP)
    if not in_family and axes < FREE_AXES and axes != PLANAR_AXES:
        raise InputError(
            f"An arm with {axes} axes outside the five-axis family cannot keep an object upright. "
            "Objects are grasped by arms with four axes, with six or more, and by the five-axis "
            "family."
        )
    hand = environment.hand
    frame = grasp_frame(environment.world(()), hand, arm.gripper)
    assert hand is not None
    T_palm_tool = (
        hand.T_palm_tool @ se3.inverse(arm.tools[arm.default_tool]) @ arm.tools[state.tool]
    )
    T_tool_grasp = frozen(se3.inverse(T_palm_tool) @ frame.T_palm_grasp)
    plane = ArmPlane.of(chain, T_tool_grasp, session.ready) if axes < FREE_AXES else None
    return HandPlanning(planning, T_base_shoulder, T_tool_grasp, frame, plane)
