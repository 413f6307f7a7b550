"""The trace of the tool in viser's scene; nothing is sent at rest."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import viser

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.session.plans import plan_along
from katana450.arm.control.session.session import Session
from katana450.arm.robot.arm_reader import MountedArm
from katana450.extensions.programs.planning.curve_path import ToolPath
from katana450.extensions.programs.planning.curves import Linear, ToolArc
from katana450.extensions.programs.server.traces import (
    BAD_COLOUR,
    GOOD_COLOUR,
    WORST_ERROR,
    TracesLayer,
    coloured,
)
from katana450.maths.kinematics.branch import branch_of
from katana450.maths.kinematics.tool import ToolTarget
from katana450.settings import Settings


def test_trace_follows_the_arc(server: viser.ViserServer, arm: MountedArm) -> None:
    session = Session(arm, np.array(Settings().ready))
    state = session.begin(session.ready, 0.0, 0.0)
    target = ToolTarget.at(arm.chain, session.ready)
    centre = target.position - (0.0, 0.0, 0.05)
    arc = ToolArc(target.position, centre, np.array((1.0, 0.0, 0.0)), math.tau,
                  Linear(target.pitch, target.pitch), Linear(0.0, 0.0))  # fmt: skip
    path = ToolPath(arm.chain, arc, branch_of(arm.chain, session.ready), session.ready)
    traces = TracesLayer()
    robot: Any = SimpleNamespace(require_arm=lambda: arm)
    context: Any = SimpleNamespace(server=server, robot=robot)
    traces.attach(context)
    traced = traces._traced

    def is_shown() -> bool:
        return bool(traced.visible)

    traces.follow(state)
    assert not is_shown()
    state = session.step(state, [cmd.Follow(plan_along(arm, None, state, [path]))], 0.01)
    lengths = []
    while state.moving:
        state = session.step(state, [], state.t + 0.01)
        state = session.observe(state, state.setpoint, 0.0)
        traces.follow(state)
        lengths.append(len(traced.points))
    assert is_shown()
    middle = (arm.T_base_shoulder @ np.append(centre, 1.0))[:3]
    away = np.linalg.norm(np.asarray(traced.points) - middle, axis=2)
    assert np.abs(away - 0.05).max() < 1e-5
    assert (np.asarray(traced.colors) == GOOD_COLOUR.astype(np.uint8)).all()
    # The trace is extended ten times a second, not at every tick.
    assert len(set(lengths)) < 1.2 * len(lengths) / 10 + 3
    last = traced.points
    traces.follow(state)
    assert traced.points is last
    # It stays until the arm is driven by hand.
    state = session.step(state, [cmd.Gripper(0.0)], state.t + 0.01)
    traces.follow(state)
    assert is_shown()
    state = session.step(
        state, [cmd.StepTool(np.array((0.0, 0.0, 0.01, 0.0, 0.0)))], state.t + 0.01
    )
    traces.follow(state)
    assert not is_shown()


def test_errors_have_their_colours() -> None:
    colours = coloured(np.array((0.0, WORST_ERROR, 5.0 * WORST_ERROR)))
    assert colours.tolist() == [GOOD_COLOUR.tolist(), BAD_COLOUR.tolist(), BAD_COLOUR.tolist()]
