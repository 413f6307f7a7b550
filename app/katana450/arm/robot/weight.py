"""What an arm weighs, by its description."""

from __future__ import annotations

import numpy as np

from katana450.arm.robot.model import RobotModel
from katana450.maths.geometry import se3
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.kinematics.statics import Load


def loads_of(model: RobotModel) -> tuple[Load, ...]:
    """A load for each piece of the arm, its fingers at zero; none where the file tells no mass."""
    T_shoulder_body: dict[str | None, FloatArray] = {None: se3.inverse(model.T_base_shoulder)}
    axes: dict[str | None, int] = {None: 0}
    moments: dict[int, FloatArray] = {}
    for body in model.bodies:
        T = T_shoulder_body[body.name] = T_shoulder_body[body.parent] @ body.T_parent_body
        count = axes[body.name] = axes[body.parent] + (body.joint in model.arm.chain.names)
        # The fourth number is the mass itself.
        moment = body.mass * (T @ np.append(body.centre, 1.0))
        moments[count] = moments.get(count, np.zeros(4)) + moment
    return tuple(
        Load(count, float(moment[3]), frozen(moment[:3] / moment[3]))
        for count, moment in moments.items()
        if moment[3] > 0.0
    )
