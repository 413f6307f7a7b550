"""Paths of other arms: of few and many axes, as recorded, and for numbers that are no path."""

from __future__ import annotations

import math

import numpy as np
import pytest

from katana450.arm.control.commands import commands as cmd
from katana450.errors import InputError
from katana450.extensions.programs.language.scope import Angles
from katana450.extensions.programs.language.source import ScriptError
from katana450.extensions.programs.planning.curve_path import PosePath
from katana450.extensions.recording.codec import Codec
from katana450.extensions.recording.forms import json_form, json_text
from katana450.maths.geometry import se3
from katana450.maths.kinematics.batch import forward_batch
from katana450.maths.kinematics.chain import Chain
from katana450.maths.planning.path import joint_derivatives
from tests.general_arms.driven import session_of
from tests.general_arms.programs import (
    begin_plan,
    every,
    length,
    middle,
    plans,
    point,
    program,
)
from tests.general_arms.published_arms import (
    OPENMANIPULATOR_X,
    PANDA,
    QUARTER,
    SKEWED_LINKS,
    UR5E,
    craig,
)
from tests.ticks import TICK

THREE_AXES = craig(
    [
        (0.0, 0.0, 0.1, 0.0),
        (-QUARTER, 0.0, 0.0, -0.5),
        (0.0, 0.15, 0.0, 1.0),
    ],
    [-3.0, -2.0, -2.0],
    [3.0, 2.0, 2.0],
    se3.from_rotation_translation(np.eye(3), np.array((0.12, 0.0, 0.0))),
)
EIGHT_AXES = craig(
    [*SKEWED_LINKS, (0.8, 0.05, 0.1, 0.0)],
    [-2.0] * 8,
    [2.0] * 8,
)


@pytest.mark.parametrize("chain", [THREE_AXES, EIGHT_AXES], ids=["three axes", "eight axes"])
def test_arm_of_few_or_many_axes_follows_lines_and_circles(chain: Chain) -> None:
    p = middle(chain)
    text = f"circle: {{centre: {point(p - (0.0, 0.0, 15.0))}, normal: x, radius: 15}}"
    compiled_program = program(chain, "line: {by: {y: 20}}", "line: {by: {y: -20}}", text)
    line, _, circle = (plan.segments[0].path for plan in plans(compiled_program))
    sigma = np.linspace(0.0, 1.0, 300)
    points = 1e3 * forward_batch(chain, joint_derivatives(line, sigma)[0])[:, :3, 3]
    np.testing.assert_allclose(points, p + np.outer(sigma, (0.0, 20.0, 0.0)), atol=1e-6)
    np.testing.assert_allclose(circle.end, circle.start, atol=1e-9)
    np.testing.assert_allclose(circle.end, begin_plan(chain).q, atol=1e-8)


def test_three_axes_choose_no_orientation() -> None:
    with pytest.raises(ScriptError, match="3 axes follows from its position"):
        program(THREE_AXES, "line: {pitch: 5}")


@every({"UR5e": UR5E}, {"Panda": PANDA, "OpenMANIPULATOR-X": OPENMANIPULATOR_X})
def test_plan_is_recorded_to_the_bit(chain: Chain) -> None:
    d, p = 0.3 * length(chain), middle(chain)
    through = ", ".join(map(point, (p - (0.0, 0.0, d), p - (0.0, d, d))))
    compiled_program = program(
        chain, f"line: {{by: {{y: {d}}}}}", f"lines: {{through: [{through}]}}"
    )
    writer, reader, session = Codec(), Codec(), session_of(chain)
    states: list[list[bytes]] = [[], []]
    for plan in plans(compiled_program):
        form = json_text(writer.encoded(cmd.Follow(plan)))
        for shared in writer.shared.take_new():
            reader.shared.add(shared)
        decoded = reader.decoded(cmd.Follow, json_form(form))
        for command, setpoints in zip((cmd.Follow(plan), decoded), states, strict=True):
            state = session.begin(plan.start, 0.0, 0.0)
            for number in range(60):
                commands = [command] if number == 0 else []
                state = session.step(state, commands, state.t + TICK)
                state = session.observe(state, state.setpoint, 0.0)
                setpoints.append(state.setpoint.tobytes())
                assert writer.encoded(state)
        assert decoded.plan.segments[0].path.joins == plan.segments[0].path.joins
    assert states[0] == states[1]
    assert len(set(states[0])) > 60


def test_path_refuses_numbers_that_are_no_path() -> None:
    path = plans(program(UR5E, "line: {by: {y: 20}}"))[0].segments[0].path
    assert isinstance(path, PosePath)
    for places, terms, message in (
        (path.places[::-1], path.terms, "must rise from 0 to 1"),
        (path.places[:-1], path.terms, "shape"),
        (path.places, path.terms * np.nan, "nan"),
    ):
        with pytest.raises(InputError, match=message):
            PosePath(path.chain, path.curve, places, terms)


def test_angles_that_gimbal_lock_hides_are_asked_for() -> None:
    plan_state = begin_plan(UR5E)
    target = plan_state.planning.oriented(
        plan_state.target, Angles(math.pi / 2, 0.0, 0.0), np.eye(3)
    )
    with pytest.raises(InputError, match="`roll`, `pitch` and `yaw` together"):
        plan_state.planning.oriented(target, Angles(yaw=0.3), np.eye(3))
    assert plan_state.planning.oriented(target, Angles(), np.eye(3)) is target
