"""Drives of joints for simulations, from the masses that a URDF states."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from katana450.arm.robot.link import Joint, Link
from katana450.arm.robot.robot import Robot

GRAVITY = 9.81
"""[m/s^2]"""

SAG = 1e-3
"""[rad, m] Maximum displacement of a joint at rest by the weight that it carries."""

INERTIA_RATIO = 0.2
"""Inertia of a joint's drive, as a fraction of the largest inertia that it moves."""

DAMPING_RATIO = 0.05
"""Damping ratio of a joint whose URDF states no damping, with its drive as the spring."""

MAX_FREQUENCY = 400.0
"""[rad/s] Maximum natural frequency of a joint on its drive, so that simulations stay stable."""

MIN_LOAD = 0.01
"""[N m, N] Minimum weight for which a drive is made, for joints that carry no mass."""

FORCE_RATIO = 2.0
"""Maximum force of a drive without a credible effort in the file, as a ratio to its load."""

CREDIBLE_RATIO = 0.5
"""A smaller effort, as a ratio to the load of a joint, is not that of its motor."""


@dataclass(frozen=True, eq=False)
class Drive:
    """A position controller of a joint, and the losses of the joint.

    None of the numbers is of a real motor, except damping, friction and effort that the URDF
    states. The stiffness is as low as `SAG` allows.

    Attributes:
        stiffness: [N m/rad or N/m].
        armature: inertia of the drive, seen at the joint [kg m^2 or kg].
        damping: [N m s/rad or N s/m].
        friction: [N m or N].
        max_force: [N m or N].
    """

    stiffness: float
    armature: float
    damping: float
    friction: float
    max_force: float


def is_frame(robot: Robot, link: Link) -> bool:
    """Return whether ``link`` is only a frame: fixed, without mass, shape and children."""
    return not (
        link.parent is None
        or link.joint is not None
        or link.inertial is not None
        or link.collisions
        or robot.children(link)
        or any(len(shape.faces) for shape in link.shapes)
    )


def drives_of(robot: Robot) -> dict[str, Drive]:
    """Return a drive for each movable joint of ``robot``."""
    carried = {joint.name: _carried(robot, link, joint) for link, joint in moved_links(robot)}
    found: dict[str, Drive] = {}
    for _, joint in moved_links(robot):
        # A drive carries the joints that follow it too.
        moved = [
            (abs(other.factor), *carried[other.name])
            for other in robot.joints.values()
            if joint.name in (other.name, other.leader)
        ]
        load = max(sum(factor * weight for factor, weight, _ in moved), MIN_LOAD)
        inertia = sum(factor * factor * mass for factor, _, mass in moved)
        stiffness = load / SAG
        armature = max(INERTIA_RATIO * inertia, stiffness / MAX_FREQUENCY**2 - inertia)
        is_credible = CREDIBLE_RATIO * load <= joint.effort < np.inf
        force = joint.effort if is_credible else FORCE_RATIO * load
        spring = DAMPING_RATIO * 2.0 * float(np.sqrt(stiffness * (inertia + armature)))
        found[joint.name] = Drive(
            stiffness, armature, joint.damping or spring, joint.friction, force
        )
    return found


def moved_links(robot: Robot) -> Iterator[tuple[Link, Joint]]:
    """Yield every link that has a movable joint, with the joint."""
    for link in robot.links:
        if link.joint is not None:
            yield link, link.joint


def _carried(robot: Robot, link: Link, joint: Joint) -> tuple[float, float]:
    """Return upper bounds on the weight [N m or N] and the inertia that ``joint`` moves."""
    load = inertia = 0.0
    farthest = {link.name: 0.0}
    for other in robot.links:
        if other.name != link.name:
            if other.parent not in farthest:
                continue
            step = float(np.linalg.norm(other.T_parent_link[:3, 3])) + _travel(other)
            farthest[other.name] = farthest[other.parent] + step
        inertial = other.inertial
        if inertial is not None:
            offset = float(np.linalg.norm(inertial.T_link_inertia[:3, 3]))
            arm = 1.0 if joint.slides else farthest[other.name] + offset
            load += GRAVITY * inertial.mass * arm
            own = 0.0 if joint.slides else float(np.linalg.eigvalsh(inertial.moments)[-1])
            inertia += inertial.mass * arm * arm + own
    return load, inertia


def _travel(link: Link) -> float:
    """Return the maximum distance [m] that the joint of ``link`` slides from zero."""
    joint = link.joint
    if joint is None or not joint.slides:
        return 0.0
    ends = [abs(end) for end in (joint.lower, joint.upper) if np.isfinite(end)]
    return max(ends, default=0.0)
