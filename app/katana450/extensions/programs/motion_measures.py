"""Measures of a motion and of its water that need no plan: of simulated and recorded runs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from katana450.arm.control.arm import ArmModel
from katana450.arm.control.pouring import MotionWithWater
from katana450.extensions.programs.score import score
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.velocity import singular_values


def motion_measures(
    arm: ArmModel, tools: Sequence[str], q: FloatArray, qd: FloatArray
) -> dict[str, float]:
    """Return the measures of the joints by their names in ``measures.MEASURES``.

    Args:
        arm: the arm.
        tools: (N,) the tool frame.
        q: (N, n) joints [rad].
        qd: (N, n) rates [rad/s].
    """
    chains = [arm.chain_to(tool) for tool in tools]
    limits = arm.chain
    room = np.minimum(q - limits.lower, limits.upper - q)
    singular = [singular_values(chain, row)[-1] for chain, row in zip(chains, q, strict=True)]
    rows = zip(tools, q, qd, strict=True)
    speeds = [arm.kinematics_to(tool).tool_speed(*each) for tool, *each in rows]
    return {
        "smallest_singular_value": float(min(singular)),
        "margin_to_limits_deg": float(np.degrees(room.min())),
        "max_speed_fraction": float((np.abs(qd) / limits.speed).max()),
        "max_tool_speed_mm_s": 1e3 * max(speeds),
    }


def water_measures(end: MotionWithWater) -> dict[str, float]:
    """Return the measures of the water at the end of a run, by their names."""
    found = score(end.water, end.course)
    return {
        "emptied_percent": found.emptied_percent,
        "emptied_ml": found.in_basin_ml,
        "spilled_ml": found.spilled_ml,
        "cup_peak_jerk_m_s3": found.peak_jerk,
    }
