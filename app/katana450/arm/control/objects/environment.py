"""The environment of the arm: its collision world, its hand, and the poses of the objects."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from katana450.arm.control.arm import GripperModel
from katana450.arm.control.state.messages import overlap_text
from katana450.arm.control.state.scene_objects import Attachment, SceneObject, Zone
from katana450.caching import cached_property
from katana450.maths.collision.clearance import DEPTH_ROUNDING, MIN_CLEARANCE
from katana450.maths.collision.world import CollisionWorld, Part, obstacle
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.physics.suction import SuctionCup
from katana450.maths.water.environment import TableTop

TOUCH_DEPTH = 2e-4
"""[m] Depth to which a suction cup is pressed into what it touches."""


@dataclass(frozen=True, eq=False)
class Hand:
    """The part of the arm that takes objects.

    Attributes:
        palm: index of the body in the linkage that carries the fingers; the last body of an arm
            without fingers.
        fingers: names of the fingers among the parts.
        T_palm_tool: (4, 4) the frame of the default tool in the frame of the palm.
        gripper: the finger joint.
        sides: names of the fingers on each side of an object, those at the tips first.
        fixed_jaw: names of the parts of the palm against which a single side closes.
        cup: the suction cup, which is the only finger then; None for fingers.
    """

    palm: int
    fingers: tuple[str, ...]
    T_palm_tool: FloatArray
    gripper: GripperModel
    sides: tuple[tuple[str, ...], ...]
    fixed_jaw: tuple[str, ...] = ()
    cup: SuctionCup | None = None

    @property
    def can_hold(self) -> bool:
        """True if it is a suction cup, or has two sides, between which objects are held."""
        return self.cup is not None or len(self.gripping_sides) >= 2

    @property
    def gripping_sides(self) -> tuple[tuple[str, ...], ...]:
        """Names of the parts on each side of an object, also of a jaw that is fixed."""
        return tuple(side for side in (*self.sides, self.fixed_jaw) if side)


def obstacle_of(scene_object: SceneObject) -> Part:
    """Return an object that the hand does not carry as a fixed part of the collision world."""
    T = scene_object.T_collision_shape
    return obstacle(scene_object.name, T, scene_object.collision_shape)


def _held_part(objects: Sequence[SceneObject]) -> SceneObject | None:
    """Return the held part of a body on a joint; None if there is none."""
    return next((item for item in objects if item.held and item.joint is not None), None)


def _led(objects: Sequence[SceneObject]) -> dict[str, SceneObject]:
    """Return the other parts of the body that the hand holds by a part, in the frame of the hand.

    They go where that part goes, as far as their joint allows.
    """
    held = _held_part(objects)
    if held is None or held.joint is None:
        return {}
    T = held.T @ se3.inverse(held.joint.T_zero)
    return {
        item.name: replace(item, T=T @ item.joint.T_zero)
        for item in objects
        if item is not held and item.joint is not None and item.joint.body == held.joint.body
    }


class Environment:
    """Collision world of the arm with any objects, and the poses of these objects."""

    def __init__(
        self, world: CollisionWorld | None, hand: Hand | None, table: TableTop | None = None
    ) -> None:
        """Create the environment.

        Args:
            world: the arm and all fixed bodies; None to check no contacts.
            hand: the hand; None if nothing can be held.
            table: the support of the objects; None if their support is not checked.
        """
        self._world = world
        self.hand = hand
        self.table = table
        # Cache for the newest objects: those that the hand leads stand still in its frame.
        self._cache: tuple[list[tuple[object, ...]], CollisionWorld] | None = None

    @property
    def bodies(self) -> CollisionWorld | None:
        """The arm and all fixed bodies without objects; None if contacts are not checked."""
        return self._world

    @cached_property
    def table_height(self) -> float:
        """Height of the table in the base frame [m]."""
        parts = () if self._world is None else self._world.parts
        tables = [part.T_mover_shape[0][2, 3] for part in parts if part.name == "table"]
        return float(tables[0]) if tables else 0.0

    def world(self, objects: Sequence[SceneObject]) -> CollisionWorld | None:
        """Return the collision world with ``objects``; None if contacts are not checked."""
        if self._world is None:
            return None
        led = _led(objects)
        placed = [led.get(item.name, item) for item in objects if item.zone is not Zone.SLOW]
        key: list[tuple[object, ...]] = [
            (item.name, item.collision_shape.mark, item.T.tobytes(), item.carried, item.can_be_held)
            for item in placed
        ]
        newest = self._cache
        if newest is None or newest[0] != key:
            self._cache = newest = key, self._world_of(self._world, placed, led)
        return newest[1]

    def _world_of(
        self, world: CollisionWorld, objects: Sequence[SceneObject], led: Mapping[str, SceneObject]
    ) -> CollisionWorld:
        """Return ``world`` with ``objects``, of which those in ``led`` go with the hand."""
        standing, carried, on_joint = list[Part](), list[Part](), list[Part]()
        for item in objects:
            if not item.carried and item.name not in led:
                standing.append(obstacle_of(item))
            elif self.hand is not None:
                T, shape = frozen(item.T_collision_shape), item.collision_shape
                part = Part(item.name, self.hand.palm, (T,), (shape,))
                (carried if item.joint is None else on_joint).append(part)
        if standing:
            world = world.with_obstacles(standing)
        for parts in (carried, on_joint):
            if parts:
                world = world.with_carried(*parts, on_joint=parts is on_joint)
        return world

    def overlap(self, item: SceneObject, x: FloatArray) -> str:
        """Return a sentence on the link in which an object stands at ``x`` (k,), or ``""``."""
        if self._world is None or item.carried or item.zone is Zone.SLOW:
            return ""
        contact = self._world.deepest(x, obstacle_of(item), "table")
        if contact is None or contact.distance > -DEPTH_ROUNDING:
            return ""
        return overlap_text(contact.parts[0], item.name, contact.distance)

    def touch(self, world: CollisionWorld, objects: Sequence[SceneObject]) -> FloatArray:
        """Return the minimum distance (p,) of each pair of ``world`` while the fingers move [m].

        They touch and push what they can hold, so these pairs have no minimum. A suction cup has no
        limited force, and stops where it touches.
        """
        hand = self.hand
        holdable = {
            scene_object.name
            for scene_object in objects
            if scene_object.can_be_held and not scene_object.carried
        }
        fingers = set(hand.fingers if hand is not None and hand.can_hold else ())
        minimum = -np.inf if hand is None or hand.cup is None else -TOUCH_DEPTH
        names = [world.parts[number].name for number in world.part_of.tolist()]
        touching = [
            bool({names[a], names[b]} & holdable and {names[a], names[b]} & fingers)
            for a, b in zip(world.first.tolist(), world.second.tolist(), strict=True)
        ]
        return np.where(touching, minimum, MIN_CLEARANCE)

    def pose(self, scene_object: SceneObject, x: FloatArray) -> FloatArray:
        """Return the pose (4, 4) of ``scene_object`` in the base frame.

        x: (k,) joints and finger joint [rad].
        """
        return scene_object.T if not scene_object.carried else self._palm(x) @ scene_object.T

    def led(
        self, objects: tuple[SceneObject, ...], x: FloatArray
    ) -> tuple[tuple[SceneObject, ...], float, float]:
        """Return ``objects`` where the hand has led the body on a joint of which it holds a part.

        Returns:
            The objects, and how far [m, rad] the joint keeps that part from its place in the hand.

        x: (k,) joints and finger joint [rad].
        """
        held = _held_part(objects)
        if held is None or held.joint is None:
            return objects, 0.0, 0.0
        T = self.pose(held, x)
        position, body = held.joint.position(T), held.joint.body
        allowed = held.joint.pose(position)
        moved = tuple(
            replace(
                item,
                T=item.joint.pose(position) if item is not held else self.into_hand(allowed, x),
            )
            if item.joint is not None and item.joint.body == body
            else item
            for item in objects
        )
        distance = float(np.linalg.norm(T[:3, 3] - allowed[:3, 3]))
        return moved, distance, so3.angle(T[:3, :3], allowed[:3, :3])

    def taken(self, scene_object: SceneObject, x: FloatArray) -> SceneObject:
        """Return ``scene_object`` as held by the hand, at the place where it is."""
        return replace(scene_object, T=self.into_hand(scene_object.T, x), held=True)

    def into_hand(self, T: FloatArray, x: FloatArray) -> FloatArray:
        """Return the pose ``T`` (4, 4), given in the base frame, in the frame of the hand.

        x: (k,) joints and finger joint [rad].
        """
        return se3.inverse(self._palm(x)) @ T

    def mounted(self, scene_object: SceneObject, to: Attachment, x: FloatArray) -> SceneObject:
        """Return ``scene_object`` fixed to ``to``. An object that the fingers hold is unchanged.

        x: (k,) joints and finger joint [rad].
        """
        if scene_object.held or (
            to is Attachment.HAND and (scene_object.fixed or self.hand is None)
        ):
            return scene_object
        if to is Attachment.HAND:
            return replace(scene_object, T=self.into_hand(scene_object.T, x), fixed=True)
        return replace(scene_object, T=self.pose(scene_object, x), fixed=False)

    def tool_point(self, x: FloatArray) -> FloatArray:
        """Return the point (3,) in the base frame where the fingers close [m].

        x: (k,) joints and finger joint [rad].
        """
        assert self.hand is not None
        return np.asarray((self._palm(x) @ self.hand.T_palm_tool)[:3, 3])

    def _palm(self, x: FloatArray) -> FloatArray:
        assert self._world is not None
        assert self.hand is not None
        return np.asarray(self._world.linkage.poses(x)[self.hand.palm])
