"""The bodies of an arm and of its environment, and the pairs of them that may meet."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from katana450.caching import cached_property
from katana450.maths.collision import engine
from katana450.maths.collision.engine import Contact, Placement
from katana450.maths.collision.linkage import GROUND, Linkage
from katana450.maths.collision.shape import PLANE, CollisionShape
from katana450.maths.geometry.arrays import FloatArray, frozen

IndexArray = npt.NDArray[np.int64]

DIRECT_PAIRS = 8
"""Number of pairs that are measured as quickly as the boxes round their bodies are compared."""

PATH_LENGTH_FACTOR = 1.2
"""Maximum ratio [1] of the path length of a point to its tangent. Joints that turn by t_i at the
distances r_i move a point by d <= sum t_i (r_i + d), so this holds up to sum t_i = MAX_PATH_LENGTH.
"""

MAX_PATH_LENGTH = 1.0 - 1.0 / PATH_LENGTH_FACTOR
"""Sum of turns [rad] up to which `CollisionWorld.travel` is a bound: 1 - 1 / PATH_LENGTH_FACTOR."""


@dataclass(frozen=True, eq=False)
class Part:
    """One named link, or one object of the environment.

    Attributes:
        name: the name of the link or object.
        mover: index of the rigid group it moves with; GROUND stands still.
        T_mover_shape: pose (4, 4) of each of its shapes in the frame of the group [m].
        shapes: convex shapes; together they are the part.
    """

    name: str
    mover: int
    T_mover_shape: tuple[FloatArray, ...]
    shapes: tuple[CollisionShape, ...]


def obstacle(name: str, T_base_shape: FloatArray, *shapes: CollisionShape) -> Part:
    """Return an object that stands still, with all its ``shapes`` in one frame."""
    return Part(name, GROUND, tuple(frozen(T_base_shape) for _ in shapes), shapes)


@dataclass(frozen=True, eq=False)
class Fingerprint:
    """A digest of the bodies and pairs of a world, and the poses (b, 4, 4) of the bodies."""

    bodies: bytes
    places: FloatArray

    def differs_by(self, other: Fingerprint) -> float:
        """Return the largest difference in place of a body [m or 1]; infinite for other bodies."""
        if self.bodies != other.bodies:
            return np.inf
        return float(np.abs(self.places - other.places).max(initial=0.0))


class CollisionWorld:
    """Convex bodies on the rigid groups of a linkage, and the pairs of them that may meet.

    Attributes:
        parts: the parts of the arm, then the obstacles.
        first, second: indices (p,) of the bodies of each pair; the second belongs to a later part.
        close: distance [m] that the parts of a pair keep, if they stand nearer than others at rest.
    """

    def __init__(
        self,
        linkage: Linkage,
        parts: Sequence[Part],
        pairs: Sequence[tuple[int, int]],
        close: Mapping[tuple[int, int], float] | None = None,
    ) -> None:
        """Build the world; ``pairs`` are indices of parts that may meet, the smaller one first."""
        self.linkage = linkage
        self.parts = tuple(parts)
        self.pairs = tuple(pairs)
        self.close = dict(close or {})
        bodies = [
            (number, part.mover, T, shape)
            for number, part in enumerate(self.parts)
            for T, shape in zip(part.T_mover_shape, part.shapes, strict=True)
        ]
        shapes = [shape for _, _, _, shape in bodies]
        count = len(bodies)
        self.part_of = np.array([number for number, _, _, _ in bodies], dtype=np.int64)
        self.mover_of = np.array([mover for _, mover, _, _ in bodies], dtype=np.int64)
        self.T_mover_body = np.array([T for _, _, T, _ in bodies]).reshape(-1, 4, 4)
        self.radius = np.array([shape.radius for shape in shapes])
        # Most bodies share their frame with others of the same link.
        frames: dict[tuple[int, bytes], int] = {}
        frame_of = [
            frames.setdefault((mover, T.tobytes()), len(frames)) for _, mover, T, _ in bodies
        ]
        first_of = [frame_of.index(frame) for frame in range(len(frames))]
        self.frame_of = np.array(frame_of, dtype=np.int64)
        self.frames = self.mover_of[first_of], self.T_mover_body[first_of, :3, :3]
        R = self.T_mover_body[:, :3, :3]
        positions = self.T_mover_body[:, :3, 3]
        centres = np.array([shape.centre for shape in shapes]).reshape(-1, 3, 1)
        # The centres in the base frame are this (b, 4 m) times the columns of all poses, (4 m, 3).
        spread = np.zeros((count, linkage.count, 4))
        spread[range(count), self.mover_of, :3] = (R @ centres)[:, :, 0] + positions
        spread[range(count), self.mover_of, 3] = 1.0
        self.spread = spread.reshape(count, -1)
        # A box along the axes of the group round the box along those of the body.
        middle = np.array([0.5 * (shape.low + shape.high) for shape in shapes]).reshape(-1, 3, 1)
        half = np.array([0.5 * (shape.high - shape.low) for shape in shapes]).reshape(-1, 3, 1)
        self.box_middle = (R @ middle)[:, :, 0] + positions
        self.box_half = (np.abs(R) @ half)[:, :, 0]

        pair_exists = np.zeros((len(self.parts), len(self.parts)), dtype=bool)
        for a, b in self.pairs:
            pair_exists[a, b] = True
        self.first, self.second = np.nonzero(
            pair_exists[self.part_of[:, None], self.part_of[None, :]]
        )
        self.geometries = tuple(shape.geometry for shape in shapes)
        self.radii = self.radius[self.first] + self.radius[self.second]
        # Flat indices into (b, m) of a body relative to a group.
        directions = np.zeros((linkage.count, linkage.count, 4))
        directions[range(linkage.count), range(linkage.count), :3] = linkage.axis
        self.axes = directions.reshape(linkage.count, -1)
        self._carries = linkage.carries[self.mover_of].astype(np.float64)
        self._stays = (~linkage.carries).T.astype(np.float64)
        self.bodies_of = list(zip(self.first.tolist(), self.second.tolist(), strict=True))
        self.planes = [body for body, shape in enumerate(shapes) if shape.mark == PLANE]
        self._second_seen = self.second * linkage.count + self._seen(self.first, self.second)
        self._first_seen = self.first * linkage.count + self._seen(self.second, self.first)

    def _seen(self, bodies: IndexArray, others: IndexArray) -> IndexArray:
        """Return the group (p,) that each of ``bodies`` (p,) moves with, as ``others`` see it.

        A body moves with its own group. But a turn about the normal of a plane leaves the plane as
        it is, so a plane at rest counts as turned by the first joint of an arm that stands on it:
        this joint moves no part towards the table.
        """
        groups = self.mover_of[bodies]
        for body in self.planes:
            turning = self.linkage.turning_about(self.T_mover_body[body, :3, 2])
            turned = turning[self.mover_of[others]]
            groups = np.where((bodies == body) & (groups == GROUND), turned, groups)
        return groups

    def load(self) -> None:
        """Prepare the engine of this thread now, so that no later check in it waits."""
        engine.load(self.geometries)

    @cached_property
    def _closest(self) -> FloatArray:
        """The distance (p,) of ``close`` that each pair keeps, infinite for most [m]."""
        one, other = self.part_of[self.first].tolist(), self.part_of[self.second].tolist()
        return np.array([self.close.get(pair, np.inf) for pair in zip(one, other, strict=True)])

    def kept(self, distance: float) -> FloatArray:
        """Return the distance (p,) [m] that each pair keeps where most keep ``distance``."""
        return np.minimum(distance, self._closest)

    def at(self, x: FloatArray) -> PlacedWorld:
        """Return the world with all bodies placed at ``x`` (k,) [rad or m]."""
        return _placed(self, x.tobytes())

    def travel(self, placed: PlacedWorld, x: FloatArray, towards: FloatArray) -> FloatArray:
        """Return a bound on the relative motion (p,) [m] of the bodies of each pair.

        ``placed`` is the world at ``x`` (k,) [rad or m]. On the path to ``towards`` (k,) the joints
        together turn by at most MAX_PATH_LENGTH.
        """
        joints = self.linkage
        turns = np.abs(joints.factor * (towards - x)[joints.variable])
        # (b, m): motion of a body by the joints that do not also move the other group.
        moved = ((placed.reach * turns * self._carries) @ self._stays).ravel()
        return np.asarray(PATH_LENGTH_FACTOR * (moved[self._second_seen] + moved[self._first_seen]))

    def nearest(self, x: FloatArray) -> Contact | None:
        """Return the contact of the nearest pair of bodies at ``x`` (k,) [rad or m].

        None means that no two parts can meet.
        """
        return self.at(x).nearest()

    def gap(self, x: FloatArray, one: str, *others: str) -> float:
        """Return the distance [m] of a part from the nearest of others that it may meet, at ``x``.

        x: (k,). The distance of parts that cannot meet is infinite.
        """
        names = [self.parts[number].name for number in self.part_of.tolist()]
        placed, wanted = self.at(x), {frozenset((one, other)) for other in others}
        pairs = zip(self.first.tolist(), self.second.tolist(), strict=True)
        matches = (pair for pair, (a, b) in enumerate(pairs) if {names[a], names[b]} in wanted)
        return min(map(placed.distance, matches), default=np.inf)

    def deepest(self, x: FloatArray, new: Part, *excluded: str) -> Contact | None:
        """Return the nearest contact at ``x`` (k,) of a ``new`` part with all but ``excluded``."""
        count = len(self.parts)
        pairs = [(k, count) for k, part in enumerate(self.parts) if part.name not in excluded]
        return CollisionWorld(self.linkage, (*self.parts, new), pairs).nearest(x)

    @cached_property
    def fingerprint(self) -> Fingerprint:
        """The fingerprint by which an equal world is recognized, also in another process."""
        close = repr(sorted(self.close.items())) if self.close else ""
        hasher = hashlib.sha256(f"{self.pairs!r}{close}".encode())
        for part in self.parts:
            hasher.update(f"{part.name} {part.mover}".encode())
            for shape in part.shapes:
                hasher.update(shape.mark)
        return Fingerprint(hasher.digest(), frozen(self.T_mover_body))

    def with_carried(self, *carried: Part, on_joint: bool = False) -> CollisionWorld:
        """Return this world with the ``carried`` parts of the arm.

        They may meet every part from which more than one joint separates them. The part that holds
        them turns with them, and the next link turns under them. Parts of the ground ``on_joint``,
        which the hand only leads, do not meet the ground.
        """
        count = len(self.parts)
        new_pairs = [
            (number, count + k)
            for k, new in enumerate(carried)
            for number, part in enumerate(self.parts)
            if len(self.linkage.variables_between(part.mover, new.mover)) > 1
            and not (on_joint and part.mover == GROUND)
        ]
        return CollisionWorld(
            self.linkage, (*self.parts, *carried), (*self.pairs, *new_pairs), self.close
        )

    def with_obstacles(self, obstacles: Sequence[Part]) -> CollisionWorld:
        """Return this world with ``obstacles``, which every part that moves may meet."""
        count = len(self.parts)
        moving = [number for number, part in enumerate(self.parts) if part.mover != GROUND]
        new_pairs = [(number, count + k) for number in moving for k in range(len(obstacles))]
        parts = (*self.parts, *obstacles)
        return CollisionWorld(self.linkage, parts, (*self.pairs, *new_pairs), self.close)


class PlacedWorld:
    """The bodies of a world in one posture."""

    def __init__(self, world: CollisionWorld, T_base_mover: FloatArray) -> None:
        self._world = world
        self._T = T_base_mover
        self._distances: dict[int, float] = {}

    @cached_property
    def _columns(self) -> FloatArray:
        """The columns of all poses below each other, (4 m, 3)."""
        return self._T[:, :3, :].transpose(0, 2, 1).reshape(-1, 3)

    @cached_property
    def _centre(self) -> FloatArray:
        """The centre of the ball round each body, (b, 3) in the base frame [m]."""
        return np.asarray(self._world.spread @ self._columns)

    @cached_property
    def _apart(self) -> FloatArray:
        """The distance between the balls round the bodies of each pair, (p,) [m]."""
        # By coordinates, because numpy takes whole rows far faster.
        world, centre = self._world, np.ascontiguousarray(self._centre.T)
        apart = centre.take(world.second, axis=1) - centre.take(world.first, axis=1)
        apart *= apart
        return np.asarray(np.sqrt(apart[0] + apart[1] + apart[2]) - world.radii)

    @cached_property
    def reach(self) -> FloatArray:
        """The farthest distance of each body from each joint's axis, (b, m) [m].

        For joints that slide it is 1: the motion of a body for each metre of the joint.
        """
        axes = self._world.axes @ self._columns
        origins = self._columns[3::4]
        c = self._centre
        along = c @ axes.T - np.einsum("ij,ij->i", origins, axes)
        square = np.einsum("ij,ij->i", c, c)[:, None] - 2.0 * (c @ origins.T)
        square += np.einsum("ij,ij->i", origins, origins) - along * along
        reach = np.asarray(np.sqrt(np.maximum(square, 0.0)) + self._world.radius[:, None])
        sliding = self._world.linkage.sliding
        if sliding.size:
            reach[:, sliding] = 1.0
        return reach

    def likely_nearest(self) -> int:
        """Return the pair whose balls are nearest to each other, or deepest in each other."""
        return int(self._apart.argmin())

    def nearer_than(self, limit: FloatArray | float) -> tuple[IndexArray, FloatArray]:
        """Return the pairs that may be nearer than ``limit``, (p,) or scalar [m].

        Returns:
            The indices (k,) of the pairs, and a lower bound (k,) of each distance [m].
        """
        world = self._world
        pairs = np.nonzero(self._apart < limit)[0]
        if len(pairs) <= DIRECT_PAIRS:
            return pairs, self._apart[pairs]
        # The ball of each body against the box of the other, in both directions.
        a, b = world.first[pairs], world.second[pairs]
        boxes, balls = np.concatenate((a, b)), np.concatenate((b, a))
        T = self._T[world.mover_of[boxes]]
        local = np.einsum("ij,ijk->ik", self._centre[balls] - T[:, :3, 3], T[:, :3, :3])
        outside = np.maximum(np.abs(local - world.box_middle[boxes]) - world.box_half[boxes], 0.0)
        away = np.sqrt(np.einsum("ij,ij->i", outside, outside))
        # For a centre inside the box the depth of the ball is unknown.
        away = np.where(away > 0.0, away - world.radius[balls], -np.inf)
        bounds = np.maximum(self._apart[pairs], away.reshape(2, -1).max(axis=0))
        near = bounds < (limit[pairs] if isinstance(limit, np.ndarray) else limit)
        return pairs[near], bounds[near]

    @cached_property
    def _placement(self) -> Placement:
        """The geometries of all bodies, at their places."""
        world, T = self._world, self._T
        # Most geometries are about the centre of their ball.
        positions = self._centre
        for body in world.planes:
            positions = positions.copy()
            positions[body] = (T[world.mover_of[body]] @ world.T_mover_body[body])[:3, 3]
        movers, R_mover_body = world.frames
        rotations = (T.take(movers, axis=0)[:, :3, :3] @ R_mover_body).reshape(-1, 9)
        return Placement(world.geometries, positions, rotations.take(world.frame_of, axis=0))

    def nearest(self) -> Contact | None:
        """Return the contact of the nearest pair of bodies, as ``CollisionWorld.nearest``."""
        if not len(self._world.first):
            return None
        nearest = self.likely_nearest()
        best = self.distance(nearest)
        pairs, bounds = self.nearer_than(best)
        for number in np.argsort(bounds).tolist():
            if bounds[number] >= best:
                break
            pair = int(pairs[number])
            distance = self.distance(pair)
            if distance < best:
                best, nearest = distance, pair
        return self.contact(nearest)

    def distance(self, pair: int) -> float:
        """Return the distance between the bodies of a pair [m]; a negative value is their depth."""
        distance = self._distances.get(pair)
        if distance is None:
            bodies = self._world.bodies_of[pair]
            distance = self._distances[pair] = engine.distance(self._placement, *bodies)
        return distance

    def contact(self, pair: int) -> Contact:
        """Return the nearest points of the bodies of a pair."""
        world = self._world
        bodies = world.bodies_of[pair]
        witness = engine.witness(self._placement, *bodies)
        one, other = (world.parts[world.part_of[body]].name for body in bodies)
        return Contact((one, other), witness.distance, witness.points, witness.normal)


# A tick asks for the places where a step and a brake begin and end several times.
@lru_cache(maxsize=16)
def _placed(world: CollisionWorld, variables: bytes) -> PlacedWorld:
    """Return ``world`` at the values of x that the bytes are."""
    return PlacedWorld(world, world.linkage.poses(np.frombuffer(variables)))
