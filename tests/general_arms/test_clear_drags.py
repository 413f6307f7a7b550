"""Drags with a clear way arrive although limits or the edge of a branch are beside it."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest

from katana450.arm.control.state import State
from katana450.extensions.general_arms.driven_tool import DrivenTool
from katana450.extensions.general_arms.tool_pose import ToolPose
from katana450.maths.geometry import so3
from tests.general_arms.published_arms import SEVEN
from tests.general_arms.test_random_drags import is_clear

MAX_TICKS = 20
"""[1] Those below take 3 to 11."""


class Drag(NamedTuple):
    """A drag that was once held: arm, posture [rad], and motion of the tool [m], [rad]."""

    arm: str
    start: tuple[float, ...]
    move: tuple[float, float, float]
    turn: tuple[float, float, float]


DRAGS = {
    "limit that cuts a joint's step short": Drag(
        "iiwa",
        (-2.434186, -1.719151, -0.832864, 1.701507, 0.883969, 0.90653, -1.607751),
        (-0.0009, 0.0115, -0.0258),
        (-0.4385, -0.1425, 0.5062),
    ),
    "wrist nearly in line": Drag(
        "iiwa",
        (-2.898818, -1.715465, -2.172348, -1.677857, -0.603546, -0.445373, 0.019228),
        (0.036, 0.0021, -0.0185),
        (-0.6332, -0.0998, -0.0064),
    ),
    "axis 5 nearly at its limit": Drag(
        "iiwa",
        (1.732008, -0.594512, -2.741793, 1.853126, -2.900384, -1.194974, 0.752582),
        (-0.1168, -0.0252, 0.0387),
        (-0.6605, -0.4184, -0.2653),
    ),
    "axis 7 nearly at its limit": Drag(
        "Panda",
        (-1.690474, 1.749666, 1.860011, -2.088841, -1.091476, 2.195511, -2.889606),
        (0.0454, 0.0858, 0.0019),
        (-0.1965, -0.0346, -0.6001),
    ),
}


@pytest.mark.parametrize("name", DRAGS)
def test_drag_with_a_clear_way_arrives(name: str) -> None:
    drag = DRAGS[name]
    chain = SEVEN[drag.arm]
    tool, q = DrivenTool(chain), np.array(drag.start)
    state, since = State.standing(q, 0.0, 0.0, "tcp", tool.branch_of(q)), tool.target_at(q)
    target = ToolPose(since.position + np.array(drag.move), so3.exp(np.array(drag.turn)) @ since.R)
    assert is_clear(tool, q, str(state.branch), (since, target))
    for _ in range(MAX_TICKS):
        found = tool.track(state, target, since)
        assert tool.branch_of(found.best.q) == state.branch
        assert chain.within_limits(found.best.q, slack=0.0)
        state = replace(state, goal=found.best.q)
        if found.since is None:
            break
        assert isinstance(found.since, ToolPose)
        since = found.since
    assert found.since is None
    assert found.beyond_gap is None
    assert max(found.best.position_error, found.best.rotation_error) < 1e-9
