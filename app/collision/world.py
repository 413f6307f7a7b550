"""The bodies of an arm and of what stands around it, and the pairs that may meet."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import coal
import numpy as np
import numpy.typing as npt

from app.collision.contact import Contact
from app.collision.linkage import GROUND, Linkage
from app.collision.shape import Shape
from app.geometry.arrays import FloatArray, frozen

IndexArray = npt.NDArray[np.int64]

LONG_WAY = 1.05
"""[1] How much longer than its tangent the way of a point may be that several joints turn by the
few hundredths of a radian of one tick."""


@dataclass(frozen=True, eq=False)
class Part:
    """One named link, or one thing that stands around the arm.

    Attributes:
        name: of the link or thing.
        mover: index of the piece it moves with; GROUND stands still.
        T_mover_shape: where each of its shapes is, (4, 4) in the frame of the piece [m].
        shapes: convex; together they are the part.
    """

    name: str
    mover: int
    T_mover_shape: tuple[FloatArray, ...]
    shapes: tuple[Shape, ...]


def obstacle(name: str, T_base_shape: FloatArray, *shapes: Shape) -> Part:
    """A thing that stands still, all its ``shapes`` in one frame."""
    return Part(name, GROUND, tuple(frozen(T_base_shape) for _ in shapes), shapes)


class World:
    """Convex bodies on the pieces of a linkage, and the pairs of them that may meet.

    Attributes:
        parts: of the arm, then the obstacles.
        first, second: (p,) indices of the bodies of each pair; the second is of a later part.
    """

    def __init__(
        self, linkage: Linkage, parts: Sequence[Part], pairs: Sequence[tuple[int, int]]
    ) -> None:
        """``pairs``: indices of the parts that may meet, the smaller first."""
        self.linkage = linkage
        self.parts = tuple(parts)
        self.pairs = tuple(pairs)
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
        self.geometry = [shape.geometry for shape in shapes]
        self.radius = np.array([shape.radius for shape in shapes])
        # Most bodies share their frame with others of the same link.
        frames: dict[tuple[int, bytes], int] = {}
        self.frame_of = [
            frames.setdefault((mover, T.tobytes()), len(frames)) for _, mover, T, _ in bodies
        ]
        R = self.T_mover_body[:, :3, :3]
        at = self.T_mover_body[:, :3, 3]
        centres = np.array([shape.centre for shape in shapes]).reshape(-1, 3, 1)
        # Centres in the base frame are this (b, 4 m) times the columns of all poses, (4 m, 3).
        spread = np.zeros((count, linkage.count, 4))
        spread[range(count), self.mover_of, :3] = (R @ centres)[:, :, 0] + at
        spread[range(count), self.mover_of, 3] = 1.0
        self.spread = spread.reshape(count, -1)
        # A box along the axes of the piece round the box along those of the body.
        middle = np.array([0.5 * (shape.low + shape.high) for shape in shapes]).reshape(-1, 3, 1)
        half = np.array([0.5 * (shape.high - shape.low) for shape in shapes]).reshape(-1, 3, 1)
        self.box_middle = (R @ middle)[:, :, 0] + at
        self.box_half = (np.abs(R) @ half)[:, :, 0]

        met = np.zeros((len(self.parts), len(self.parts)), dtype=bool)
        for a, b in self.pairs:
            met[a, b] = True
        self.first, self.second = np.nonzero(met[self.part_of[:, None], self.part_of[None, :]])
        self.pair_bodies = list(zip(self.first.tolist(), self.second.tolist(), strict=True))
        # Flat indices, into (b, b) and (b, m), of a pair and of a body seen from a piece.
        self.flat = self.first * count + self.second
        self.radii = self.radius[:, None] + self.radius[None, :]
        self._carries = linkage.carries[self.mover_of].astype(np.float64)
        self._stays = (~linkage.carries).T.astype(np.float64)
        self._second_seen = self.second * linkage.count + self.mover_of[self.first]
        self._first_seen = self.first * linkage.count + self.mover_of[self.second]

    def at(self, x: FloatArray) -> Placed:
        """All bodies where ``x`` (k,) [rad] puts them."""
        return Placed(self, self.linkage.poses(x))

    def travel(self, placed: Placed, x: FloatArray, towards: FloatArray) -> FloatArray:
        """At most how far the bodies of each pair move against each other, (p,) [m].

        ``placed`` is at ``x`` (k,) [rad], and the way to ``towards`` (k,) that of one tick.
        """
        joints = self.linkage
        turns = np.abs(joints.factor * (towards - x)[joints.variable])
        # (b, m): how far a body is moved by the joints that do not move another piece with it.
        moved = ((placed.reach() * turns * self._carries) @ self._stays).ravel()
        return np.asarray(LONG_WAY * (moved[self._second_seen] + moved[self._first_seen]))

    def nearest(self, x: FloatArray) -> Contact | None:
        """The pair of bodies that are nearest to each other at ``x`` (k,) [rad].

        None when no two parts can meet at all.
        """
        if not len(self.pair_bodies):
            return None
        placed = self.at(x)
        found = placed.likely_nearest()
        best = placed.distance(found)
        pairs, bounds = placed.nearer_than(best)
        for number in np.argsort(bounds).tolist():
            if bounds[number] >= best:
                break
            pair = int(pairs[number])
            distance = placed.distance(pair)
            if distance < best:
                best, found = distance, pair
        return placed.contact(found)

    def with_obstacles(self, obstacles: Sequence[Part]) -> World:
        """This world and ``obstacles``, which every part that moves may meet."""
        count = len(self.parts)
        moving = [number for number, part in enumerate(self.parts) if part.mover != GROUND]
        met = [(number, count + k) for number in moving for k in range(len(obstacles))]
        return World(self.linkage, (*self.parts, *obstacles), (*self.pairs, *met))


class Placed:
    """The bodies of a world in one posture."""

    def __init__(self, world: World, T_base_mover: FloatArray) -> None:
        self._world = world
        self._T = T_base_mover
        self._transforms: dict[int, Any] = {}

    @cached_property
    def _request(self) -> Any:
        """It asks, of bodies that are in each other, how deep: a distance below zero."""
        return coal.DistanceRequest()

    @cached_property
    def _result(self) -> Any:
        return coal.DistanceResult()

    @cached_property
    def _centre(self) -> FloatArray:
        """Of the ball round each body, (b, 3) in the base frame [m]."""
        columns = self._T[:, :3, :].transpose(0, 2, 1).reshape(-1, 3)
        return np.asarray(self._world.spread @ columns)

    @cached_property
    def _square(self) -> FloatArray:
        """The square of the distance of each centre from the origin, (b,) [m^2]."""
        return np.asarray((self._centre * self._centre).sum(axis=1))

    @cached_property
    def _apart(self) -> FloatArray:
        """How far apart the balls round the bodies of each pair are, (p,) [m]."""
        world, c = self._world, self._centre
        square = self._square[:, None] + self._square - 2.0 * (c @ c.T)
        return np.asarray((np.sqrt(np.maximum(square, 0.0)) - world.radii).ravel()[world.flat])

    def reach(self) -> FloatArray:
        """The farthest that each body is from each joint's axis, (b, m) [m]."""
        axes = (self._T[:, :3, :3] @ self._world.linkage.axis[:, :, None])[:, :, 0]
        origins = self._T[:, :3, 3]
        c = self._centre
        along = c @ axes.T - (origins * axes).sum(axis=1)
        square = self._square[:, None] - 2.0 * (c @ origins.T) + (origins * origins).sum(axis=1)
        off = np.sqrt(np.maximum(square - along * along, 0.0))
        return np.asarray(off + self._world.radius[:, None])

    def likely_nearest(self) -> int:
        """The pair whose balls are nearest to each other, or farthest in each other."""
        return int(self._apart.argmin())

    def nearer_than(self, limit: FloatArray | float) -> tuple[IndexArray, FloatArray]:
        """The pairs that may be nearer than ``limit``, (p,) or scalar [m].

        Returns:
            their indices (k,), and (k,) at least how far apart the bodies of each are [m].
        """
        world = self._world
        pairs = np.nonzero(self._apart < limit)[0]
        if not pairs.size:
            return pairs, self._apart[pairs]
        a, b = world.first[pairs], world.second[pairs]
        bounds = np.maximum(
            self._apart[pairs], np.maximum(self._box_to_ball(a, b), self._box_to_ball(b, a))
        )
        near = bounds < (limit[pairs] if isinstance(limit, np.ndarray) else limit)
        return pairs[near], bounds[near]

    def _box_to_ball(self, a: IndexArray, b: IndexArray) -> FloatArray:
        """How far the ball round each ``b`` (k,) is from the box round each ``a`` (k,), [m]."""
        world = self._world
        T = self._T[world.mover_of[a]]
        seen = ((self._centre[b] - T[:, :3, 3])[:, None, :] @ T[:, :3, :3])[:, 0, :]
        outside = np.maximum(np.abs(seen - world.box_middle[a]) - world.box_half[a], 0.0)
        away = np.sqrt((outside * outside).sum(axis=1))
        # A centre inside the box tells nothing of how deep the ball is in it.
        return np.where(away > 0.0, away - world.radius[b], -np.inf)

    def distances(self, pairs: IndexArray) -> FloatArray:
        """Between the bodies of each of ``pairs`` (k,), as ``distance``, (k,) [m]."""
        return np.array([self.distance(pair) for pair in pairs.tolist()])

    def distance(self, pair: int) -> float:
        """Between the bodies of a pair [m]; negative is how deep they are in each other."""
        world, result = self._world, self._result
        a, b = world.pair_bodies[pair]
        result.clear()
        distance: float = coal.distance(
            world.geometry[a],
            self._transform(a),
            world.geometry[b],
            self._transform(b),
            self._request,
            result,
        )
        return distance

    def contact(self, pair: int) -> Contact:
        """Where the bodies of a pair are nearest."""
        distance = self.distance(pair)
        world, result = self._world, self._result
        one, other = (world.parts[world.part_of[body]].name for body in world.pair_bodies[pair])
        return Contact(
            (one, other),
            distance,
            frozen((result.getNearestPoint1(), result.getNearestPoint2())),
            frozen(result.normal),
        )

    def _transform(self, body: int) -> Any:
        world = self._world
        frame = world.frame_of[body]
        found = self._transforms.get(frame)
        if found is None:
            T = self._T[world.mover_of[body]] @ world.T_mover_body[body]
            found = self._transforms[frame] = coal.Transform3s(T[:3, :3], T[:3, 3])
        return found
