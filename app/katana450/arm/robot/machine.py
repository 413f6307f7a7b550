"""Any mechanism made ready to be driven, joint by joint."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from katana450.arm.control.joints import Joints
from katana450.arm.robot.mechanism import Joint, Mechanism
from katana450.arm.robot.urdf_mechanism import load_mechanism
from katana450.errors import RobotDescriptionError
from katana450.maths.geometry.arrays import FloatArray, frozen

SLOW_TURN, SLOW_SLIDE = 1.0, 0.1
"""[rad/s, m/s] Of a joint whose file names no speed."""


@dataclass(frozen=True, eq=False)
class Machine:
    """A mechanism, its driven joints, and notes for a person on what was taken for granted."""

    mechanism: Mechanism
    joints: Joints
    notes: tuple[str, ...] = ()

    def values(self, q: FloatArray) -> Mapping[str, float]:
        """Every movable joint's value [rad, m] for those of the driven ones, (n,)."""
        return self.mechanism.every(dict(zip(self.joints.names, q.tolist(), strict=True)))

    def way(self, q: FloatArray, to: FloatArray) -> float:
        """How far the origin of any link is from one joint vector (n,) to another [m]."""
        here, there = (self.mechanism.frames(self.values(each)) for each in (q, to))
        return max(math.dist(here[name][:3, 3], there[name][:3, 3]) for name in here)


def load_machine(path: Path, why: str) -> Machine:
    """The tree in a URDF file. ``why``: no tool of it can be brought to a pose.

    Raises RobotDescriptionError when it cannot be read, or has a joint that cannot be driven.
    """
    mechanism, notes = load_mechanism(path)
    joints, more = joints_of(mechanism, why)
    return Machine(mechanism, joints, (*notes, *more))


def joints_of(mechanism: Mechanism, why: str) -> tuple[Joints, tuple[str, ...]]:
    """The driven joints of a mechanism within limits that those that follow keep too, and notes.

    An endless joint is given half a turn either way.
    """
    driven = [mechanism.joints[name] for name in mechanism.driven]
    if not driven:
        raise RobotDescriptionError(f"{mechanism.name} has no joint that could be driven.")
    ranges = [_range(mechanism, joint) for joint in driven]
    speeds, notes = [], []
    for joint in driven:
        speed = joint.speed
        if not 0.0 < speed < math.inf:
            speed = SLOW_SLIDE if joint.slides else SLOW_TURN
            unit = "m/s" if joint.slides else "rad/s"
            notes.append(f"Joint {joint.name!r} has no speed of its own: {speed:g} {unit}.")
        speeds.append(speed)
    joints = Joints(
        names=tuple(joint.name for joint in driven),
        slides=tuple(joint.slides for joint in driven),
        lower=frozen(np.array([low for low, _ in ranges])),
        upper=frozen(np.array([high for _, high in ranges])),
        speed=frozen(np.array(speeds)),
        why=why,
    )
    return joints, tuple(notes)


def _range(mechanism: Mechanism, driven: Joint) -> tuple[float, float]:
    """Where ``driven`` [rad, m] and all that follow it are inside their limits."""
    low, high = -math.inf, math.inf
    for joint in mechanism.joints.values():
        if joint.leader != driven.name or joint.factor == 0.0:
            continue
        ends = sorted((end - joint.offset) / joint.factor for end in (joint.lower, joint.upper))
        low, high = max(low, ends[0]), min(high, ends[1])
    if not driven.slides:
        low, high = (
            -math.pi if low == -math.inf else low,
            math.pi if high == math.inf else high,
        )
    if not (math.isfinite(low) and math.isfinite(high) and low < high):
        raise RobotDescriptionError(
            f"Joint {driven.name!r} of {mechanism.name} cannot be driven: with all that follows it "
            f"it goes from {low:g} to {high:g}. Give it limits with room between them."
        )
    return low, high
