"""The pairs of links that need no collision check, for programs that list them."""

from __future__ import annotations

from itertools import combinations

from katana450.arm.robot.collision import world_of
from katana450.arm.robot.link import Link
from katana450.arm.robot.robot import Robot

ADJACENT, NEVER = "Adjacent", "Never"
"""Reasons of MoveIt: joined by at most one joint, or never in contact."""


def excluded_pairs(robot: Robot) -> list[tuple[str, str, str]]:
    """Return (link, link, reason) of the pairs of links with collision shapes that cannot meet.

    For an arm these are all pairs that this project does not check either: neighbours, pairs that
    no sampled posture brings near each other, and those that always overlap. For a mechanism
    without an arm these are the neighbours.
    """
    links = [link for link in robot.links if link.collisions]
    joined = [
        (a.name, b.name, ADJACENT)
        for a, b in combinations(links, 2)
        if len(_joints_between(robot, a, b)) <= 1
    ]
    world = world_of(robot)[0] if robot.arm is not None else None
    if world is None:
        return joined
    names = [part.name for part in world.parts]
    met = {frozenset((names[a], names[b])) for a, b in world.pairs}
    adjacent = {frozenset(pair[:2]) for pair in joined}
    return [
        (a, b, ADJACENT if frozenset((a, b)) in adjacent else NEVER)
        for a, b in combinations(names, 2)
        if frozenset((a, b)) not in met
    ]


def _joints_between(robot: Robot, a: Link, b: Link) -> set[str]:
    """Return the driven joints that move ``b`` relative to ``a``."""
    above = [
        {link.joint.name: link.joint.leader for link in robot.path_to(each) if link.joint}
        for each in (a, b)
    ]
    only = above[0].keys() ^ above[1].keys()
    return {(above[0] | above[1])[name] for name in only}
