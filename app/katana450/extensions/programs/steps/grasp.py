"""The program step ``grasp``: plan how the fingers take an object where it stands."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, NamedTuple

import numpy as np

from katana450.arm.control.objects.pouring import is_vessel
from katana450.arm.control.state.messages import finding_text, part
from katana450.arm.control.state.scene_objects import SceneObject
from katana450.arm.control.state.state import Reason, State
from katana450.errors import InputError
from katana450.extensions.programs.building.actions import MoveFingers, use_tool
from katana450.extensions.programs.building.plan_state import (
    APPROACHES,
    GraspInfo,
    PlanState,
    with_fingers,
)
from katana450.extensions.programs.building.step import Conditional, Held, Step
from katana450.extensions.programs.language.kinds import Object, angle, choice, millimetres
from katana450.extensions.programs.planning.curves import line_between
from katana450.extensions.programs.planning.hand_frames import ABOVE, DOWN, FRONT, LOW, Approach
from katana450.maths.collision.engine import Contact
from katana450.maths.collision.world import CollisionWorld
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.branch import AnyBranch
from katana450.maths.planning.clearance import SweptClearance
from katana450.maths.planning.plan import JOIN_TOLERANCE, MARGIN, apart

HEIGHT_FRACTIONS = {FRONT: (0.78, 0.95), ABOVE: (0.5, 0.7, 0.9, 1.05, 1.2)}
"""[1] Heights of the grasp as fractions of the object's height, tried in this order. From the front
the palm has room over the table only above the middle of the object.
"""

MIN_HEIGHT = 0.012
"""[m] Minimum height of an object: the tips stay MARGIN over what it stands on, at most a step of
``tip_distances`` more, and cover at least 4 mm of it.
"""

MAX_DISTANCE, DISTANCE_STEP = 0.03, 0.002
"""[m] How far the tool moves away from an object, at most and by which steps, until the palm has
room.
"""

PALM_CLEARANCE = MARGIN + 5e-4
"""[m] Minimum distance between the palm and the grasped object."""

JOINT_ROOM = math.radians(2.0)
"""[rad] Distance to the joint limits that a grasp keeps, if one of its pitches can."""


class Grip(NamedTuple):
    """The place of a grasp on an object.

    Attributes:
        height: over the underside of the object [m].
        distance: between the tool frame and the axis of the object there [m], at least.
    """

    height: float
    distance: float = 0.0


@dataclass
class _Room:
    """The distance to the joint limits that is kept [rad], and whether one was nearer."""

    minimum: float
    is_missed: bool = False


@dataclass(frozen=True)
class Grasp(Step, word="grasp", example="cup"):
    """Open, approach an object, and close the fingers on it.

    Attributes:
        name: name of the object.
        side: FRONT or ABOVE; "" for the first with which this and all later steps succeed.
        pitch: of the tool [rad]; None for the first with which this and all later steps succeed.
        height: above the underside of the object [m]; None for HEIGHT_FRACTIONS of its height.
    """

    by_fingers = True
    short = "name"

    name: Object
    side: Annotated[str, choice(FRONT, ABOVE).about("Side of the tool; found unless given")] = ""
    pitch: Annotated[
        float | None, angle(0.0, 90.0, "Pitch of the tool, deg; found unless given")
    ] = None
    height: Annotated[
        float | None,
        millimetres(1.0, 500.0, "Height above the underside, mm; found unless given"),
    ] = None

    def build(self, plan: PlanState) -> PlanState:
        """Plan the grasp. Raises InputError if the object cannot be taken."""
        scene_object = plan.scene_object(self.name)
        if plan.state.grip is not None:
            raise InputError("The hand already holds an object. Set it down first.")
        if not scene_object.can_be_held:
            raise InputError(
                f"{self.name} cannot be held by the fingers. Set its `can_be_held` to true if they "
                "may take it."
            )
        hand = plan.hand
        if not hand.frame.is_cup and self.height is None and scene_object.height < MIN_HEIGHT:
            raise InputError(
                f"{self.name} is {1e3 * scene_object.height:.1f} mm high, and the minimum is "
                f"{1e3 * MIN_HEIGHT:.0f} mm: the fingertips stay {1e3 * MARGIN:.0f} mm over what "
                "an object stands on."
            )
        if hand.tool and plan.state.tool != hand.tool:
            plan.plan_context.arm.chain_to(hand.tool)
            plan = plan.with_action(
                f"grasp {self.name}: tool {hand.tool}",
                use_tool(hand.tool),
                replace(plan.state, tool=hand.tool),
            )
        opened = plan.plan_context.arm.gripper.opened
        after = with_fingers(plan, opened)
        plan = plan.with_action(f"grasp {self.name}: open", MoveFingers(opened), after)
        branch_of, ready = plan.plan_context.arm.kinematics.branch_of, plan.plan_context.ready
        # Pitches of a grasp are those of the posture at Home; an arm that reaches over its shoulder
        # would take the object with the hand upside down.
        via_home = (False,) if branch_of(plan.q) == branch_of(ready) else (False, True)

        def take(plan: PlanState, via: bool) -> PlanState:
            if via:
                plan = plan.move_to(ready, f"grasp {self.name}: home")
            return self._approach(plan, scene_object)

        try:
            return plan.first(via_home, take)
        except InputError as error:
            raise error.after(f"{self.name} cannot be grasped at its place") from error

    def _approach(self, plan: PlanState, scene_object: SceneObject) -> PlanState:
        """Plan the grasp with the first approach that works. Raises InputError without one."""
        chosen, room = self._approaches(plan, scene_object), _Room(JOINT_ROOM)

        def take(plan: PlanState, approach: Approach) -> PlanState:
            return self._plan(plan, scene_object, approach, room)

        try:
            return plan.first(chosen, take)
        except InputError:
            if not room.is_missed:
                raise
            room = _Room(0.0)
            return plan.first(chosen, take)

    def _approaches(self, plan: PlanState, scene_object: SceneObject) -> Sequence[Approach]:
        """Return the approaches to try, in their order, without those that were given up."""
        place = _point(plan, scene_object, 0.0)
        turned = plan.direction(scene_object.T[:3, 0], in_base=True)
        if self.pitch is not None:
            return plan.hand.with_pitch(self.pitch, scene_object, place, turned)
        options = plan.hand.approaches(scene_object, place, turned)
        sides = [self.side] if self.side else list(options)
        chosen = [approach for side in sides for approach in options.get(side, ())]
        if not chosen:
            raise InputError(_no_approach(scene_object, self.side))
        remaining = [approach for approach in chosen if approach not in plan.given_up]
        # Without one in reach, the first gives the reason.
        in_reach = [
            approach for approach in remaining if self._is_in_reach(plan, scene_object, approach)
        ]
        return in_reach or remaining[:1]

    def _is_in_reach(self, plan: PlanState, scene_object: SceneObject, approach: Approach) -> bool:
        """Return whether the tool can be at one of the heights of a grasp."""
        hand = plan.hand
        return any(
            hand.branches_to(
                plan.q,
                hand.before(_point(plan, scene_object, grip.height), approach, grip.distance),
            )
            for grip in self._grips(plan, scene_object, approach)
        )

    def _grips(self, plan: PlanState, scene_object: SceneObject, approach: Approach) -> list[Grip]:
        """Return the places of the grasp on the object, the best first."""
        if self.height is not None or plan.hand.frame.is_cup:
            return [Grip(scene_object.height if self.height is None else self.height)]
        fractions = HEIGHT_FRACTIONS[ABOVE if approach.pitch == DOWN else FRONT]
        grips = [Grip(fraction * scene_object.height) for fraction in fractions]
        if scene_object.height < LOW:
            middle = 0.5 * scene_object.height
            grips += [Grip(middle, distance) for distance in plan.hand.tip_distances]
        return grips

    def _plan(
        self, plan: PlanState, scene_object: SceneObject, approach: Approach, room: _Room
    ) -> PlanState:
        """Plan approach and closing. Raises InputError if it is not possible."""

        def plan_at(plan: PlanState, grip: Grip) -> PlanState:
            point = _point(plan, scene_object, grip.height)
            target = plan.hand.before(point, approach, grip.distance)
            return plan.first(
                plan.hand.branches_to(plan.q, target) or (None,),
                lambda plan, branch: self._plan_at(
                    plan, scene_object, approach, grip, branch, room
                ),
            )

        return plan.first(self._grips(plan, scene_object, approach), plan_at)

    def _plan_at(
        self,
        plan: PlanState,
        scene_object: SceneObject,
        approach: Approach,
        grip: Grip,
        branch: AnyBranch | None,
        room: _Room,
    ) -> PlanState:
        """Plan the grasp at ``grip`` on ``branch``. Raises InputError if it is not possible."""
        hand, point = plan.hand, _point(plan, scene_object, grip.height)
        distance, q = _smallest_distance(plan, point, approach, grip.distance, branch)
        held = self._closed(plan, q)

        def start_at(plan: PlanState, away: float) -> FloatArray:
            before = hand.before(point, approach, distance + away)
            start = plan.joints_of(before, hand.branch_at(q))
            left = min(_joint_room(plan, start), _joint_room(plan, q))
            if left < room.minimum:
                room.is_missed = True
                raise InputError(f"a joint would come within {math.degrees(left):.1f} deg.")
            return start

        start = plan.choose(APPROACHES, start_at)
        plan = plan.move_to(start, f"grasp {self.name}: approach")
        goal = hand.before(point, approach, distance)
        plan = plan.lead([line_between(plan.target, goal)], f"grasp {self.name}")
        if float(np.abs(plan.q - q).max()) > JOIN_TOLERANCE:
            if not hand.is_redundant:
                raise InputError("the straight path to it ends in another posture than planned.")
            held = self._closed(plan, plan.q)
        held = replace(plan, state=held).standing(plan.q).state
        holding = "" if self._checked_later(plan.ahead) else self.name
        close = MoveFingers(plan.plan_context.arm.gripper.closed, holding)
        plan = plan.with_action(f"grasp {self.name}: close", close, held)
        chosen = None if self.pitch is not None else approach
        return replace(plan, taken=GraspInfo(plan.target, chosen, scene_object))

    def _closed(self, plan: PlanState, q: FloatArray) -> State:
        """Return the state at ``q`` (n,) [rad] in which the closed fingers hold the object.

        Raises InputError if they do not, or are so near to something that they could not leave.
        """
        held = with_fingers(plan.standing(q), plan.plan_context.arm.gripper.closed)
        if held.held is None or held.held.name != self.name:
            raise InputError(f"the fingers do not hold it: {_why_not_held(held)}.")
        for finding in held.findings:
            if finding.reason is Reason.CRUSHED:
                raise InputError(f"{finding_text(finding)}.")
        others = tuple(other for other in held.objects if other.name != self.name)
        world = plan.plan_context.session.world_at(replace(held, objects=others))
        nearest = None if world is None else _nearer(plan, world, held.x_setpoint, MARGIN)
        if nearest is not None:
            raise InputError(_too_near(nearest, MARGIN))
        return held

    def _checked_later(self, steps: Sequence[object]) -> bool:
        """Return whether an ``if`` of ``steps`` asks whether the object is held, before a grasp."""
        for step in steps:
            if isinstance(step, Conditional) and step.condition == Held(self.name):
                return True
            if isinstance(step, Grasp):
                return False
        return False


def _point(plan: PlanState, scene_object: SceneObject, height: float) -> FloatArray:
    """Return the point (3,) [m] in {S} at ``height`` [m] over the underside of the object."""
    return plan.point(scene_object.T[:3, 3] + (0.0, 0.0, height), in_base=True)


def _joint_room(plan: PlanState, q: FloatArray) -> float:
    """Return the smallest distance [rad] of the joints ``q`` (5,) [rad] to their limits."""
    chain = plan.chain
    return float(np.minimum(q - chain.lower, chain.upper - q).min())


def _why_not_held(state: State) -> str:
    """Return why the closed fingers do not hold an object."""
    if state.held is not None:
        return f"they would close on {state.held.name}"
    if any(finding.reason is Reason.LOPSIDED for finding in state.findings):
        return "only one of them would touch it"
    if any(finding.reason is Reason.LEAKING for finding in state.findings):
        return "the suction cup would leak, because it needs a flat face as wide as its rim"
    return "they close without touching it"


def _too_near(nearest: Contact, minimum: float) -> str:
    """Return that two bodies would be nearer than ``minimum`` [m]."""
    one, other = map(part, nearest.parts)
    away = apart(nearest.distance)
    return f"{one} and {other} would {away}; the minimum is {1e3 * minimum:.1f} mm."


def _no_approach(scene_object: SceneObject, side: str) -> str:
    """Return why no approach from ``side`` suits the object."""
    if is_vessel(scene_object):
        return "a vessel is grasped from the front, because from above the wrist could not pour it."
    return (
        "its sides are turned too far, seen from the arm, so the fingers cannot hold it from the "
        f"{side}. Grasp it from above, or turn it."
    )


def _nearer(
    plan: PlanState, world: CollisionWorld, x: FloatArray, minimum: float
) -> Contact | None:
    """Return the nearest contact at `x` (k,) of a pair that is nearer than ``minimum`` [m].

    Pairs that are nearer at Home may be as near as there. None if all are far enough.
    """
    home = np.append(plan.plan_context.ready, x[-1])
    placed, minimums = world.at(x), SweptClearance.about(world, minimum, home).minimum
    pairs = placed.nearer_than(minimums)[0].tolist()
    distances = {pair: placed.distance(pair) for pair in pairs}
    near = [pair for pair, distance in distances.items() if distance < minimums[pair]]
    return placed.contact(min(near, key=distances.__getitem__)) if near else None


def _smallest_distance(
    plan: PlanState,
    point: FloatArray,
    approach: Approach,
    least: float,
    branch: AnyBranch | None,
) -> tuple[float, FloatArray]:
    """Return the smallest distance [m] of the tool before ``point`` at which the palm has room.

    It is at least ``least`` [m]. The second value is the joints (n,) [rad] at that distance.
    """

    def joints_with_room(plan: PlanState, distance: float) -> tuple[float, FloatArray]:
        q = plan.joints_of(hand.before(point, approach, distance), branch)
        x = np.append(q, fingers)
        nearest = None if world is None else _nearer(plan, world, x, PALM_CLEARANCE)
        if nearest is not None:
            raise InputError(_too_near(nearest, PALM_CLEARANCE))
        return distance, q

    hand, world, fingers = plan.hand, plan.world, plan.state.gripper_setpoint
    distances = (least + np.arange(0.0, MAX_DISTANCE + DISTANCE_STEP, DISTANCE_STEP)).tolist()
    return plan.choose(distances, joints_with_room)
