"""Zones of reduced speed: in them the tool moves as slowly as beside people."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from katana450.arm.control.objects.environment import Environment, obstacle_of
from katana450.arm.control.session.motion_stepper import MotionStepper
from katana450.arm.control.state.scene_objects import SceneObject, Zone
from katana450.arm.control.state.state import Finding, Reason, State
from katana450.maths.collision.clearance import path_lengths
from katana450.maths.collision.world import CollisionWorld
from katana450.maths.physics.body import BoolArray

SLOW_SPEED = 0.25
"""[m/s] Maximum speed of the tool point while a part of the arm is in such a zone: that of
ISO 10218-1 for an arm beside people."""

MARGIN = 0.05
"""[m] Distance from the zone at which the arm is no longer slow, once it was."""


class SlowZones:
    """The zones of reduced speed around one arm. Its methods are pure."""

    def __init__(self, environment: Environment) -> None:
        """Create the rules of the arm in ``environment``."""
        self._environment = environment
        # Cache for the zones of the newest state.
        self._cache: tuple[list[SceneObject], CollisionWorld, BoolArray] | None = None

    def finding(self, state: State, stepper: MotionStepper) -> Finding | None:
        """Return that the arm is in a zone, or could come to rest only in one; None if not."""
        zones = [item for item in state.objects if item.zone is Zone.SLOW]
        world = self._environment.bodies
        if not zones or world is None or not state.moving:
            return None
        if self._cache is None or self._cache[0] != zones:
            world = world.with_obstacles([obstacle_of(item) for item in zones])
            names = {item.name for item in zones}
            of_zone = np.array([world.parts[part].name in names for part in world.part_of.tolist()])
            self._cache = zones, world, of_zone[world.first] | of_zone[world.second]
        _, world, pairs = self._cache
        x, end = state.x_setpoint, stepper.stopping_point(state)[0]
        rest = np.append(end, x[-1])
        placed, placed_at_rest = world.at(x), world.at(rest)
        lengths = path_lengths(world, placed, x, rest - x)
        was_slow = any(finding.reason is Reason.SLOW_ZONE for finding in state.findings)
        margin = MARGIN if was_slow else 0.0
        for pair in placed.nearer_than(np.where(pairs, lengths + margin, -np.inf))[0].tolist():
            distances = placed.distance(pair) + placed_at_rest.distance(pair)
            # The least distance on the way to rest is at least this.
            if 0.5 * (distances - lengths[pair]) < margin:
                one, other = placed.contact(pair).parts
                is_zone = any(item.name == one for item in zones)
                parts = (other, one) if is_zone else (one, other)
                return Finding(Reason.SLOW_ZONE, SLOW_SPEED, parts=parts)
        return None


def with_slow_zone(state: State, finding: Finding | None) -> State:
    """Return ``state`` with ``finding`` in place of that of an earlier zone."""
    others = tuple(other for other in state.findings if other.reason is not Reason.SLOW_ZONE)
    findings = others if finding is None else (*others, finding)
    return state if findings == state.findings else replace(state, findings=findings)
