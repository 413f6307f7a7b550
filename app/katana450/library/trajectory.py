"""Samples of a plan at equal time steps."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from katana450.errors import InputError
from katana450.library.pose_frame import PoseFrame
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.kinematics.batch import forward_batch
from katana450.maths.kinematics.chain import Chain
from katana450.maths.planning.plan import Plan, Segment

MAX_SAMPLES = 1_000_000
"""Maximum number of samples; their poses take 128 MB."""


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Samples of a plan. Every sample is evaluated on the plan; nothing is interpolated.

    Attributes:
        t: (N,) times from the start [s], at equal steps except the last, which is the end.
        q, qd, qdd: (N, n) joint angles and their derivatives [rad, rad/s, rad/s^2].
        T: (N, 4, 4) poses of the tool in the frame of the arm object [m].
    """

    t: FloatArray
    q: FloatArray
    qd: FloatArray
    qdd: FloatArray
    T: FloatArray

    def __len__(self) -> int:
        """Return the number of samples."""
        return len(self.t)

    @property
    def points(self) -> FloatArray:
        """(N, 3) positions of the tool point [m]."""
        return self.T[:, :3, 3]


def sampled(plan: Plan, dt: float, chain: Chain, frame: PoseFrame) -> Trajectory:
    """Sample ``plan`` every ``dt`` [s] and at its end. Raises InputError for an invalid ``dt``."""
    if not (isinstance(dt, int | float) and math.isfinite(dt) and dt > 0.0):
        raise InputError(f"The sampling time must be a number of seconds above 0, not {dt!r}.")
    count = math.ceil(plan.duration / dt - 1e-9)
    if count >= MAX_SAMPLES:
        raise InputError(
            f"A sampling time of {dt:g} s gives {count} samples of this plan; "
            f"choose one that gives fewer than {MAX_SAMPLES}."
        )
    t = np.append(dt * np.arange(count), plan.duration)
    starts = np.cumsum([0.0, *(segment.scaling.duration for segment in plan.segments)])
    numbers = np.searchsorted(starts[1:-1], t, side="right")
    moved = np.array(
        [
            _motion(plan.segments[number], time - float(starts[number]))
            for number, time in zip(numbers.tolist(), t.tolist(), strict=True)
        ]
    )
    q, qd, qdd = (frozen(moved[:, order]) for order in range(3))
    return Trajectory(frozen(t), q, qd, qdd, frozen(frame.from_shoulder(forward_batch(chain, q))))


def _motion(segment: Segment, t: float) -> FloatArray:
    """Return (3, n) angles, speeds and accelerations ``t`` [s] after the start of ``segment``."""
    tau, speed, acceleration = segment.scaling.motion_after(t)
    moving = segment.at(tau)
    return np.array(
        (
            moving.q,
            speed * moving.first,
            speed**2 * moving.second + acceleration * moving.first,
        )
    )
