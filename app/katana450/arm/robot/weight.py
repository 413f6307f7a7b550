"""Loads of the links of an arm, from the masses in its description."""

from __future__ import annotations

import numpy as np

from katana450.arm.robot.robot import Robot
from katana450.maths.geometry import se3
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.kinematics.statics import LinkLoad


def loads_of(robot: Robot) -> tuple[LinkLoad, ...]:
    """Return one load for each rigid group of the arm, with its fingers at zero.

    Empty if the file states no mass, or if there is no arm.
    """
    arm = robot.arm
    if arm is None:
        return ()
    T_shoulder_link: dict[str | None, FloatArray] = {None: se3.inverse(arm.T_base_shoulder)}
    axes: dict[str | None, int] = {None: 0}
    moments: dict[int, FloatArray] = {}
    for link in robot.links:
        T = T_shoulder_link[link.name] = T_shoulder_link[link.parent] @ link.at_rest(arm.resting)
        turned = link.joint is not None and link.joint.name in arm.chain.names
        count = axes[link.name] = axes[link.parent] + turned
        if link.inertial is None:
            continue
        # The fourth entry is the mass itself.
        moment = link.inertial.mass * (T @ link.inertial.T_link_inertia[:, 3])
        moments[count] = moments.get(count, np.zeros(4)) + moment
    return tuple(
        LinkLoad(count, float(moment[3]), frozen(moment[:3] / moment[3]))
        for count, moment in moments.items()
    )
