"""Zones of reduced speed around one arm: where they slow it, and for how long on a plan."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from katana450.arm.control.objects.environment import Environment, obstacle_of
from katana450.arm.control.session.motion_stepper import MotionStepper
from katana450.arm.control.state.scene_objects import SceneObject, Zone
from katana450.arm.control.state.state import Finding, Reason, State
from katana450.maths.collision.clearance import path_lengths
from katana450.maths.collision.world import CollisionWorld
from katana450.maths.geometry.arrays import BoolArray, FloatArray
from katana450.maths.planning.plan import Plan

SLOW_SPEED = 0.25
"""[m/s] Maximum speed of the tool point while a part of the arm is in such a zone: that of
ISO 10218-1 for an arm beside people."""

ZONE_MARGIN = 0.05
"""[m] Distance from the zone at which the arm is no longer slow, once it was."""

SAMPLE_TIME = 0.05
"""[s] Time at full speed between two samples of a plan."""


@dataclass(frozen=True, eq=False)
class ZonedWorld:
    """A collision world with the zones of reduced speed among its obstacles.

    Attributes:
        zones: names of the zones.
        world: the arm, what it carries, and the zones.
        pairs: (p,) whether a pair of the world has a zone.
    """

    zones: frozenset[str]
    world: CollisionWorld
    pairs: BoolArray

    @classmethod
    def of(cls, world: CollisionWorld, zones: Sequence[SceneObject]) -> ZonedWorld:
        """Return ``world``, with what the arm carries, with ``zones``."""
        world = world.with_obstacles([obstacle_of(item) for item in zones])
        names = frozenset(item.name for item in zones)
        of_zone = np.array([world.parts[part].name in names for part in world.part_of.tolist()])
        return cls(names, world, of_zone[world.first] | of_zone[world.second])

    def entered(self, x: FloatArray, rest: FloatArray, margin: float) -> tuple[str, str] | None:
        """Return the names of the part and the zone that meet on the way from ``x`` to ``rest``.

        None if they keep ``margin`` [m]. x, rest: (k,) joints and finger joint [rad].
        """
        placed, placed_at_rest = self.world.at(x), self.world.at(rest)
        lengths = path_lengths(self.world, placed, x, rest - x)
        near = placed.nearer_than(np.where(self.pairs, lengths + margin, -np.inf))
        for pair in near[0].tolist():
            distances = placed.distance(pair) + placed_at_rest.distance(pair)
            # The least distance on the way to rest is at least this.
            if 0.5 * (distances - lengths[pair]) < margin:
                one, other = placed.contact(pair).parts
                return (other, one) if one in self.zones else (one, other)
        return None


class SlowZones:
    """The zones of reduced speed around one arm. Its methods are pure."""

    def __init__(self, environment: Environment) -> None:
        """Create the rules of the arm in ``environment``."""
        self._environment = environment
        # Cache for the zones and the carried objects of the newest state.
        self._cache: tuple[list[SceneObject], ZonedWorld] | None = None

    def finding(self, state: State, stepper: MotionStepper) -> Finding | None:
        """Return that the arm is in a zone, or could come to rest only in one; None if not."""
        zones = _slow(state.objects)
        if not zones or not state.moving:
            return None
        carried = [item for item in state.objects if item.carried]
        if self._cache is None or self._cache[0] != zones + carried:
            world = self._environment.world(carried)
            if world is None:
                return None
            self._cache = zones + carried, ZonedWorld.of(world, zones)
        x, end = state.x_setpoint, stepper.stopping_point(state)[0]
        was_slow = any(finding.reason is Reason.SLOW_ZONE for finding in state.findings)
        margin = ZONE_MARGIN if was_slow else 0.0
        parts = self._cache[1].entered(x, np.append(end, x[-1]), margin)
        return None if parts is None else Finding(Reason.SLOW_ZONE, SLOW_SPEED, parts=parts)


def with_slow_zone(state: State, finding: Finding | None) -> State:
    """Return ``state`` with ``finding`` in place of that of an earlier zone."""
    others = tuple(other for other in state.findings if other.reason is not Reason.SLOW_ZONE)
    findings = others if finding is None else (*others, finding)
    return state if findings == state.findings else replace(state, findings=findings)


def slow_span(
    plan: Plan, world: CollisionWorld, objects: Sequence[SceneObject], fraction: float
) -> float:
    """Return the part of the span of ``plan`` [s] in which a zone of ``objects`` slows the arm.

    world: the arm, what it carries, and obstacles. fraction: of full speed, in a zone.
    """
    zones = _slow(objects)
    if not zones:
        return 0.0
    zoned = ZonedWorld.of(world, zones)
    count = max(1, math.ceil(plan.span / SAMPLE_TIME))
    postures = [np.append(q, plan.fingers) for q in plan.postures(count + 1)]
    slow, samples = False, 0
    for place, x in enumerate(postures[:-1]):
        scaling = plan.segments[plan.segment_at(plan.span * place / count)].scaling
        pace = fraction if slow else 1.0
        brake = 0.5 * pace * (pace / scaling.acceleration + scaling.acceleration / scaling.jerk)
        # The arm slows down on the way to a zone, so it is slow on about half of that.
        way = brake if slow else 0.5 * brake
        later = min(count, place + round(way * count / plan.span))
        slow = zoned.entered(x, postures[later], ZONE_MARGIN if slow else 0.0) is not None
        samples += slow
    return plan.span * samples / count


def _slow(objects: Sequence[SceneObject]) -> list[SceneObject]:
    return [item for item in objects if item.zone is Zone.SLOW]
