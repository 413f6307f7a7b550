"""Taught poses: a script that only moves through joint angles, as a list that a person edits.

The page writes the text of such a script (``static/teach/poses.js``); this module reads it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from katana450.extensions.programs.building.step import LocatedStep
from katana450.extensions.programs.script.script import Script
from katana450.extensions.programs.steps.moves import Joints, Via
from katana450.extensions.programs.steps.settings_steps import Gripper, Speed, TimedPause
from katana450.maths.geometry.arrays import FloatArray

DIGITS = 3
"""Decimal places of angles [deg]: a tenth of the arm's resolution."""

BLEND = 0.5
"""Blend of all rounded corners, which is the default of ``via``."""


@dataclass(frozen=True)
class TaughtPose:
    """A pose, and what happens there.

    Attributes:
        joints: angles of the five joints [deg].
        speed: fraction of full speed of the motion to it.
        blend: whether the arm passes it without a rest, with a rounded corner.
        gripper: where the fingers move there [deg], or [mm] if they slide; None to leave them.
        wait: time to wait there [s].
    """

    joints: tuple[float, ...]
    speed: float = 1.0
    blend: bool = False
    gripper: float | None = None
    wait: float = 0.0


@dataclass(frozen=True)
class TaughtScript:
    """The poses of a script in their order, and how often the arm moves through all of them."""

    name: str
    times: int
    poses: tuple[TaughtPose, ...]


def taught(script: Script) -> TaughtScript | None:
    """Return ``script`` as poses; None if it says anything else."""
    if script.bare or script.about or script.expected or script.scene or script.speed != 1.0:
        return None
    steps, times = _once(script.steps)
    poses: list[TaughtPose] = []
    speed = 1.0
    for step in (located.step for located in steps):
        last = poses[-1] if poses else None
        match step:
            case Speed(value=value):
                speed = value
            case Joints(q=q):
                poses.append(TaughtPose(_degrees(q), speed))
            case Via(through=through, blend=blend) if blend == BLEND:
                joints = [place.joints for place in through]
                passed = [TaughtPose(_degrees(q), speed, True) for q in joints if q is not None]
                if len(passed) < len(through):
                    return None
                poses += [*passed[:-1], replace(passed[-1], blend=False)]
            case Gripper(to=float(where)) if last and last.gripper is None and not last.wait:
                poses[-1] = replace(last, gripper=where)
            case TimedPause(seconds=seconds) if last and not last.wait:
                poses[-1] = replace(last, wait=seconds)
            case _:
                return None
    return TaughtScript(script.name, times, tuple(poses)) if poses else None


def _once(steps: Sequence[LocatedStep]) -> tuple[Sequence[LocatedStep], int]:
    """Return the steps of a ``repeat`` around the whole script once, and their repetitions."""
    times = sum(other.step is steps[0].step for other in steps)
    once = steps[: len(steps) // times]
    repeated = all(
        other.step is once[number % len(once)].step for number, other in enumerate(steps)
    )
    return (once, times) if repeated and len(steps) == times * len(once) else (steps, 1)


def _degrees(q: FloatArray) -> tuple[float, ...]:
    rounded: list[float] = np.round(np.degrees(q), DIGITS).tolist()
    return tuple(angle + 0.0 for angle in rounded)
