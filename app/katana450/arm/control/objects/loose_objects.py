"""Loose objects: they fall, slide, roll, topple, lie on each other, and are held by friction.

While all of them are at rest nothing is computed. What changes wakes what is beside it: a command
about an object, fingers that move, and an object in the hand.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from katana450.arm.control.objects.environment import Environment
from katana450.arm.control.objects.grip import FINGER_FORCE, suction_of
from katana450.arm.control.objects.pouring import BASIN, CUP, is_vessel
from katana450.arm.control.state.scene_objects import MAX_COORDINATE, Attachment, SceneObject, Shape
from katana450.arm.control.state.state import State
from katana450.errors import InputError
from katana450.maths.collision.linkage import GROUND
from katana450.maths.collision.shape import CollisionShape, box, cylinder, half_space, hull
from katana450.maths.collision.world import Part, obstacle
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.physics.model import (
    BodyMotion,
    FingerDrive,
    RigidBody,
    volume,
)
from katana450.maths.physics.simulation import BodySimulation
from katana450.maths.physics.suction import SuctionCup
from katana450.maths.water.environment import Basin, Cup, TableTop, WaterEnvironment
from katana450.maths.water.units import DENSITY as WATER_DENSITY
from katana450.maths.water.units import FEMTOLITRE

SUPPORT_GAP = 1e-3
"""[m] Height over a surface up to which an object counts as standing on it."""

MIN_UPRIGHT = 0.999
"""Cosine of the tilt up to which the top of an object is level enough to carry another."""


def is_loose(scene_object: SceneObject) -> bool:
    """Return whether ``scene_object`` needs a support: vessels, the basin, and holdable objects.

    All other objects are parts of the work cell and may hang in the air.
    """
    return not (scene_object.carried or scene_object.joint) and (
        scene_object.can_be_held or is_vessel(scene_object) or scene_object.name == BASIN
    )


def check_carried(
    table: TableTop | None,
    objects: Sequence[SceneObject],
    scene_object: SceneObject,
    *,
    may_fall: bool = False,
) -> None:
    """Raise InputError, with the position and the table's extent, if an object has no support.

    An object is carried if its middle is over the table or over an upright object, and its
    lowest point is on that, or, if it ``may_fall``, above that.

    table: None if the support is not checked.
    """
    if table is None or scene_object.carried:
        return
    (x, y), lowest = scene_object.T_collision_shape[:2, 3], _lowest(scene_object)
    tops = [other.T[2, 3] + other.height for other in objects if is_over(scene_object, other)]
    if table.x[0] <= x <= table.x[1] and table.y[0] <= y <= table.y[1]:
        tops.append(0.0)
    if any(may_fall or lowest - top <= SUPPORT_GAP for top in tops):
        return
    refusal = f"{scene_object.name} would be in the air at x {1e3 * x:.1f}, y {1e3 * y:.1f}"
    if tops:
        gap = f"{1e3 * (lowest - max(tops)):.1f} mm"
        raise InputError(f"{refusal} mm, {gap} above its support: put it {gap} lower.")
    (left, right), (front, back) = 1e3 * np.array(table.x), 1e3 * np.array(table.y)
    raise InputError(
        f"{refusal} mm: nothing carries it there. The table reaches from x {left:.0f} to "
        f"{right:.0f} and from y {front:.0f} to {back:.0f} mm in the base frame; choose a place "
        "on it."
    )


def surface_below(objects: Sequence[SceneObject], scene_object: SceneObject) -> float:
    """Return the height [m] of the highest level surface below the middle of an object.

    The object is where it would be released; the table is at 0.
    """
    lowest = _lowest(scene_object) + SUPPORT_GAP
    tops = [other.T[2, 3] + other.height for other in objects if is_over(scene_object, other)]
    return max((float(top) for top in tops if top <= lowest), default=0.0)


def check_mounted(
    environment: Environment,
    objects: Sequence[SceneObject],
    scene_object: SceneObject,
    to: Attachment,
    x: FloatArray,
) -> None:
    """Raise InputError if nothing would be below ``scene_object``, taken off the hand.

    x: (k,) joints and finger joint [rad].
    """
    left = environment.mounted(scene_object, to, x)
    if is_loose(left):
        check_carried(environment.table, objects, left, may_fall=True)


def _lowest(scene_object: SceneObject) -> float:
    """Return the height [m] of the lowest point in the base frame; for a mesh, of its box."""
    T, down = scene_object.T_collision_shape, abs(scene_object.T[2, :3])
    match scene_object.shape:
        case Shape.SPHERE:
            reach = scene_object.extent[0]
        case Shape.CYLINDER | Shape.VESSEL:
            radius, height = scene_object.extent
            reach = radius * float(np.hypot(down[0], down[1])) + 0.5 * height * down[2]
        case _:
            reach = 0.5 * float(down @ scene_object.extent)
    return float(T[2, 3] - reach)


def is_over(scene_object: SceneObject, other: SceneObject) -> bool:
    """Return whether the middle of ``scene_object`` is over the level top of ``other``."""
    if other.name == scene_object.name or other.carried or other.is_zone:
        return False
    if other.shape is Shape.SPHERE:
        return False
    if other.T[2, 2] < MIN_UPRIGHT:
        return False
    x, y, _ = se3.inverse(other.T)[:3] @ np.append(scene_object.T_collision_shape[:3, 3], 1.0)
    if other.shape.is_round:
        return bool(np.hypot(x, y) <= other.extent[0])
    return bool(abs(x) <= 0.5 * other.extent[0] and abs(y) <= 0.5 * other.extent[1])


DENSITY = 500.0
"""[kg/m^3] Density of an object of unknown mass: light wood, or a printed part that is not solid.
Assumed."""

FRICTION = 0.35
"""[1] Coefficient of friction of objects on the table and on each other: smooth plastic. Assumed.
"""

MASS_STEP = 1e-2
"""[kg] The mass of the water in a vessel counts in steps, because each mass is another model."""

FULL_FORCE_WAY = 5e-3
"""[m] How much farther than the object the fingers are commanded to close for FINGER_FORCE."""

RIM_PIECES = 16
"""Number of convex pieces round the inside of a vessel."""

SHOWN_MOTION, SHOWN_TURN = 2e-5, 2e-4
"""[m, rad] Least motion of an object that the state shows. Contacts at rest give way by less."""

WALL = MAX_COORDINATE - 0.05
"""[m] Distance from the base along any axis at which walls keep what rolls away in the scene."""

WAKING_DISTANCE = 0.02
"""[m] Distance from a change at which it wakes an object, between the balls round both."""


class Ball(NamedTuple):
    """A ball round an object: its middle (3,) and radius [m]."""

    middle: FloatArray
    radius: float


class Grasping(NamedTuple):
    """The fingers or the suction cup as the physics needs them.

    Attributes:
        drive: the drive of the fingers, or the cup.
        reach: radius of a ball round the tool point that contains them [m].
    """

    drive: FingerDrive | SuctionCup
    reach: float

    @staticmethod
    def of(environment: Environment) -> Grasping | None:
        """Return the fingers of ``environment``; None if they hold nothing."""
        hand, world = environment.hand, environment.bodies
        if hand is None or world is None or not hand.can_hold or not hand.gripper.moves:
            return None
        if hand.cup is not None:
            stroke = hand.gripper.upper - hand.gripper.lower
            return Grasping(hand.cup, stroke + 2.0 * hand.cup.radius)
        linkage = world.linkage
        parts = {part.name: part for part in world.parts}
        variable = int(linkage.variable[parts[hand.fingers[0]].mover])
        x = np.zeros(variable + 1)
        x[-1] = middle = 0.5 * (hand.gripper.lower + hand.gripper.upper)
        point, reach, speeds = hand.T_palm_tool[:3, 3], 0.0, dict[str, float]()

        def centres(value: float) -> dict[str, FloatArray]:
            """Return the middles (3,) of the fingers in the frame of the palm [m]."""
            x[-1] = value
            poses = linkage.poses(x)
            T = se3.inverse(poses[hand.palm])
            return {
                name: (T @ poses[parts[name].mover] @ _centre(parts[name]))[:3]
                for name in hand.fingers
            }

        step = 1e-3 * (hand.gripper.upper - hand.gripper.lower)
        one, other = centres(middle), centres(middle + step)
        for name in hand.fingers:
            speeds[name] = float(np.linalg.norm(other[name] - one[name])) / step
            radius = max(shape.radius for shape in parts[name].shapes)
            reach = max(reach, float(np.linalg.norm(one[name] - point)) + 2.0 * radius)
        tips = [max(speeds[name] for name in side) for side in hand.sides if side]
        force_limit = FINGER_FORCE * math.fsum(tips)
        stiffness = force_limit * max(tips) / FULL_FORCE_WAY
        drive = FingerDrive(variable, stiffness, force_limit, hand.palm, point)
        return Grasping(drive, reach)

    def ball(self, environment: Environment, state: State) -> Ball:
        """Return a ball that contains the fingers in ``state``."""
        return Ball(environment.tool_point(state.x_setpoint), self.reach)


def _centre(part: Part) -> FloatArray:
    """Return the middle of the shapes of ``part`` in the frame of its group, (4,) [m]."""
    places = zip(part.T_mover_shape, part.shapes, strict=True)
    return np.asarray(np.mean([T @ (*shape.centre, 1.0) for T, shape in places], axis=0))


class LooseObjects:
    """The motion of the loose objects around one arm. Its methods are pure."""

    def __init__(
        self, environment: Environment, water_environment: WaterEnvironment | None = None
    ) -> None:
        """Create the rules.

        Args:
            environment: the arm with its collision world.
            water_environment: the inside of the vessels; None for solid ones.
        """
        self._environment, self._water_environment = environment, water_environment
        self._hand = Grasping.of(environment)
        # Cache for the objects of the newest state.
        self._cache: tuple[tuple[object, ...], BodySimulation] | None = None

    def step(self, before: State, state: State, dt: float) -> State:
        """Return ``state`` after the motion of the loose objects in ``dt`` [s].

        ``before`` is the state at the end of the last tick. In ``state``, the commands of this tick
        have changed the scene, and the arm has moved.
        """
        movable = [scene_object for scene_object in state.objects if can_move(scene_object)]
        if self._environment.bodies is None or not movable:
            return state if state.bodies is None else replace(state, bodies=None)
        moved, places = self._changes(before, state)
        woken = _near(movable, places, self._environment, before)
        motion = state.bodies
        if not woken and not moved and (motion is None or motion.resting.all()):
            return state
        simulation = self._simulation(state, movable)
        start, end = before.x_setpoint, state.x_setpoint
        motion = simulation.begin(self.poses(movable, start), motion, moved, woken)
        if dt <= 0.0:
            return replace(state, bodies=motion)
        grasp = self._grasp(before, state, motion, simulation.finger_joint(motion))
        rates = np.append(before.motion.qd, 0.0), np.append(state.motion.qd, 0.0)
        suction = suction_of(self._environment.hand, state)
        motion = simulation.step(motion, start, end, dt, rates, grasp, suction=suction)
        fingers, goal = simulation.finger_joint(motion), state.gripper_goal
        hand = self._environment.hand
        if fingers is not None and hand is not None and grasp == goal and state.grip is None:
            # They are where the object lets them be, never beyond their goal, and no faster than
            # their drive.
            way, last = hand.gripper.speed * dt, before.gripper_setpoint
            fingers = min(max(fingers, last - way), last + way)
            wider = hand.gripper.is_wider(fingers, goal)
            state = replace(state, gripper_setpoint=fingers if wider else goal)
        idle = motion.resting.all() and not motion.contacts
        return replace(state, objects=self._shown(state, motion), bodies=None if idle else motion)

    def _grasp(
        self, before: State, state: State, motion: BodyMotion, fingers: float | None
    ) -> float | None:
        """Return the goal of the drive of fingers that touch something [rad or m].

        Fingers that open, or touch nothing, move as the setpoint does: then it is None.
        ``fingers`` are where they are; None at the setpoint, which faster fingers lag behind.
        """
        hand = self._environment.hand
        if hand is None or not motion.contacts:
            return None
        gripper, grip, setpoint = hand.gripper, state.grip, before.gripper_setpoint
        if gripper.is_wider(state.gripper_goal, setpoint):
            return None
        if grip is not None:
            return gripper.wider(grip, -state.squeeze)
        place = setpoint if fingers is None else fingers
        is_closing = gripper.is_wider(place, state.gripper_goal)
        waits = state.stopped is not None or state.paused
        return state.gripper_goal if is_closing and not waits else None

    def _changes(self, before: State, state: State) -> tuple[set[str], list[Ball]]:
        """Return the objects that were put elsewhere, and the balls in which something changed."""
        moved, places = set[str](), list[Ball]()
        if before.objects is not state.objects:
            now = {scene_object.name: scene_object for scene_object in state.objects}
            known = {scene_object.name: scene_object for scene_object in before.objects}
            for name in known.keys() | now.keys():
                old, new = known.get(name), now.get(name)
                if old is new or (old and new and _body_of(old) == _body_of(new)):
                    continue
                moved.update(_body_name(item) for item in (old, new) if item)
                places += [self._ball(old, before)] if old else []
                places += [self._ball(new, state)] if new else []
        if (before.x_setpoint != state.x_setpoint).any():
            places += [self._ball(item, state) for item in state.objects if item.carried]
        drive = before.gripper_setpoint, before.gripper_goal, before.squeeze
        if self._hand is not None and drive != (
            state.gripper_setpoint, state.gripper_goal, state.squeeze
        ):  # fmt: skip
            places.append(self._hand.ball(self._environment, state))
        return moved, places

    def _ball(self, scene_object: SceneObject, state: State) -> Ball:
        """Return the ball round an object in ``state``."""
        T = self._environment.pose(scene_object, state.x_setpoint)
        return Ball(T[:3, 3] + 0.5 * scene_object.height * T[:3, 2], _radius(scene_object))

    def _shown(self, state: State, motion: BodyMotion) -> tuple[SceneObject, ...]:
        """Return the objects at their places in ``motion``; the same tuple if none has moved."""
        poses, shown = motion.poses, []
        for scene_object in state.objects:
            T, joint = poses.get(_body_name(scene_object)), scene_object.joint
            if T is not None and joint is not None:
                T = frozen(T @ joint.T_body_part)
            if T is not None and scene_object.held:
                T = self._environment.into_hand(T, state.x_setpoint)
            if T is not None and _apart(scene_object.T, T):
                shown.append(replace(scene_object, T=T))
            else:
                shown.append(scene_object)
        same = all(one is other for one, other in zip(shown, state.objects, strict=True))
        return state.objects if same else tuple(shown)

    def _simulation(self, state: State, loose: Sequence[SceneObject]) -> BodySimulation:
        """Return the simulation of ``loose`` objects among everything else in ``state``."""
        others = [item for item in state.objects if not (can_move(item) or item.is_zone)]
        # Those on joints come last.
        loose = sorted(loose, key=lambda item: item.joint is not None)
        masses = [self.mass(scene_object, state) for scene_object in loose]
        joints = [None if item.joint is None else item.joint.key for item in loose]
        key = (
            *((item.name, item.shape, item.extent, item.solid) for item in loose),
            *joints,
            *masses,
            *(
                (item.name, item.shape, item.extent, item.T.tobytes(), item.fixed)
                for item in others
            ),
        )
        if self._cache is None or self._cache[0] != key:
            world = self._environment.bodies
            assert world is not None
            bodies, standing = self.scene(state)
            parts = [part for part in world.parts if part.name != "table"]
            parts += standing
            drive = None if self._hand is None else self._hand.drive
            simulation = BodySimulation(world.linkage, (*parts, *self._ground()), bodies, drive)
            self._cache = (key, simulation)
        return self._cache[1]

    def poses(self, movable: Sequence[SceneObject], x: FloatArray) -> dict[str, FloatArray]:
        """Return the pose (4, 4) of the body of each object [m], with the arm at ``x`` (k,)."""
        poses = {}
        for item in movable:
            T = self._environment.pose(item, x)
            poses[_body_name(item)] = T if item.joint is None else item.joint.body_pose(T)
        return poses

    def scene(self, state: State) -> tuple[list[RigidBody], list[Part]]:
        """Return the bodies of the objects, those on joints last, and the parts that stand still.

        Objects that are attached to the hand are parts of it.
        """
        items = [item for item in state.objects if not item.is_zone]
        parts_of: dict[str, list[SceneObject]] = {}
        for item in sorted(filter(can_move, items), key=lambda item: item.joint is not None):
            parts_of.setdefault(_body_name(item), []).append(item)
        bodies = [self._body(name, parts, state) for name, parts in parts_of.items()]
        return bodies, [self._part(item) for item in items if not can_move(item)]

    def mass(self, scene_object: SceneObject, state: State) -> float:
        """Return the mass of an object [kg], for a vessel with the water in it."""
        vessel = self._vessel(scene_object)
        if vessel is not None and vessel.mass > 0.0:
            mass = vessel.mass
        else:
            mass = DENSITY * math.fsum(map(volume, self._pieces(scene_object)[0]))
        water = None if state.poured is None else state.poured.water.vessel(scene_object.name)
        if water is None:
            return mass
        return mass + MASS_STEP * round(water.volume * FEMTOLITRE * WATER_DENSITY / MASS_STEP)

    def _vessel(self, scene_object: SceneObject) -> Cup | Basin | None:
        """Return the form of a vessel; None for other objects, and where there is no water."""
        water = self._water_environment
        if water is None:
            return None
        if scene_object.name == BASIN:
            return water.basin
        if not is_vessel(scene_object):
            return None
        return water.cup if scene_object.name == CUP else water.cup.sized(*scene_object.extent)

    def _body(self, name: str, parts: Sequence[SceneObject], state: State) -> RigidBody:
        """Return the body ``name`` of one object, or of all ``parts`` on one joint."""
        shapes, places, owners = list[CollisionShape](), list[FloatArray](), list[str]()
        for part in parts:
            own_shapes, own_places = self._pieces(part)
            T = np.eye(4) if part.joint is None else part.joint.T_body_part
            shapes += own_shapes
            places += [frozen(T @ place) for place in own_places]
            owners += [part.name] * len(own_shapes)
        joint = None if parts[0].joint is None else parts[0].joint.joint
        mass = None if joint is None else joint.mass
        if mass is None:
            mass = math.fsum(self.mass(part, state) for part in parts)
        return RigidBody(name, tuple(shapes), tuple(places), mass, FRICTION, joint, tuple(owners))

    def _part(self, scene_object: SceneObject) -> Part:
        """Return an object that does not move by itself as a part of the world or of the hand."""
        hand = self._environment.hand
        group = hand.palm if scene_object.carried and hand is not None else GROUND
        shapes, places = self._pieces(scene_object)
        return Part(
            scene_object.name, group, tuple(frozen(scene_object.T @ T) for T in places), shapes
        )

    def _pieces(
        self, scene_object: SceneObject
    ) -> tuple[tuple[CollisionShape, ...], tuple[FloatArray, ...]]:
        """Return the convex pieces of an object, and their poses (4, 4) in its frame."""
        vessel = self._vessel(scene_object)
        if isinstance(vessel, Basin):
            radii = vessel.floor_radius, vessel.rim_radius
            return _wedges(*radii, vessel.depth, vessel.floor, vessel.outer_radius)
        if vessel is not None:
            inside = vessel.inside
            radii = inside.radius, inside.radius
            return _wedges(*radii, inside.depth, vessel.floor, vessel.outer_radius)
        up = se3.from_rotation_translation(np.eye(3), (0.0, 0.0, 0.5 * scene_object.height))
        return (scene_object.collision_shape,), (up,)

    def _ground(self) -> tuple[Part, ...]:
        """Return the table, the floor under it, and walls at the border of the scene."""
        top, height = self._environment.table, self._environment.table_height
        parts = []
        floor = height
        if top is not None:
            (left, right), (front, back) = top.x, top.y
            thickness = -top.floor
            middle = (0.5 * (left + right), 0.5 * (front + back), -0.5 * thickness)
            T = se3.from_rotation_translation(np.eye(3), middle)
            parts.append(obstacle("table", T, box((right - left, back - front, thickness))))
            floor = top.floor
        T = se3.from_rotation_translation(np.eye(3), (0.0, 0.0, floor))
        parts.append(obstacle("floor" if top is not None else "table", T, half_space()))
        for number in range(4):
            R = so3.rotation_z(0.5 * math.pi * number) @ so3.rotation_y(-0.5 * math.pi)
            place = so3.rotation_z(0.5 * math.pi * number) @ (WALL, 0.0, 0.0)
            T = se3.from_rotation_translation(R, place)
            parts.append(obstacle(f"border {number}", T, half_space()))
        return tuple(parts)


def _radius(scene_object: SceneObject) -> float:
    return scene_object.collision_shape.radius


def can_move(scene_object: SceneObject) -> bool:
    """Return whether an object moves by itself: it is loose, on a joint, or held by friction."""
    return scene_object.held or scene_object.joint is not None or is_loose(scene_object)


def _body_name(scene_object: SceneObject) -> str:
    """Return the name of the body of which an object is a part, or the only one."""
    joint = scene_object.joint
    return scene_object.name if joint is None else f"parts of {joint.body}"


def _near(
    objects: Sequence[SceneObject], places: Sequence[Ball], environment: Environment, state: State
) -> set[str]:
    """Return the names of the bodies of the ``objects`` of ``state`` beside ``places``."""
    near = set[str]()
    for scene_object in objects if places else ():
        T = environment.pose(scene_object, state.x_setpoint)
        middle = T[:3, 3] + 0.5 * scene_object.height * T[:3, 2]
        for place in places:
            reach = place.radius + _radius(scene_object) + WAKING_DISTANCE
            if float(np.linalg.norm(middle - place.middle)) < reach:
                near.add(_body_name(scene_object))
    return near


def _body_of(scene_object: SceneObject) -> tuple[object, ...]:
    """Return all on which the motion of an object depends."""
    shape = scene_object.shape, scene_object.extent, scene_object.solid
    return (*shape, scene_object.T.tobytes(), scene_object.carried, is_loose(scene_object))


def _apart(T: FloatArray, other: FloatArray) -> bool:
    """Return whether two poses differ by more than what the state shows."""
    change = np.abs(T - other)
    return bool(change[:3, 3].max() > SHOWN_MOTION or change[:3, :3].max() > SHOWN_TURN)


@lru_cache(maxsize=16)
def _wedges(
    floor_radius: float, rim_radius: float, depth: float, floor: float, outer_radius: float
) -> tuple[tuple[CollisionShape, ...], tuple[FloatArray, ...]]:
    """Return the pieces of a round vessel: its floor, and wedges round its inside. All [m]."""
    shapes, places = [cylinder(outer_radius, floor)], []
    places.append(frozen(se3.from_rotation_translation(np.eye(3), (0.0, 0.0, 0.5 * floor))))
    half = math.pi / RIM_PIECES
    sides = np.array([(math.cos(half), sign * math.sin(half)) for sign in (-1.0, 1.0)])
    corners = [
        (radius * x, radius * y, z)
        for radius, z in (
            (floor_radius, floor), (rim_radius, floor + depth),
            (outer_radius, floor), (outer_radius, floor + depth),
        )
        for x, y in sides.tolist()
    ]  # fmt: skip
    wedge = hull(corners)
    for number in range(RIM_PIECES):
        R = so3.rotation_z(2.0 * half * number)
        shapes.append(wedge)
        places.append(frozen(se3.from_rotation_translation(R, np.zeros(3))))
    return tuple(shapes), tuple(places)
