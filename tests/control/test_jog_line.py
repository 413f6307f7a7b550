"""A jog keeps the direction of its twist while it starts, moves, turns and brakes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pytest

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.session.session import Session
from katana450.arm.control.state.state import Finding, Reason, State
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.forward import forward, jacobian_body
from katana450.maths.kinematics.tool import pitch_and_roll
from katana450.maths.kinematics.velocity import JogFrame
from tests.ticks import rested, ticked

TICK = 0.01
DISTANCE = 0.1

MAX_DEVIATION = 1e-4
"""[m] Measured over all cases: 0.07 mm in motion, 0.09 mm after the brake."""

MAX_TURN = math.radians(0.01)
"""[rad] Measured over all cases: 0.002 degrees. Before joints changed in proportion, 1 degree."""

POSTURES = {
    "ready": [0.0, -1.187, 1.484, 0.14, 0.0],
    "left": [0.4, -1.2, 1.6, 0.3, 0.2],
    "right": [-1.0, -0.8, 1.2, 0.4, 1.0],
    "near": [0.8, -1.5, 1.8, 0.6, -1.2],
    "down": [0.0, -0.9, 1.5, 0.8, 0.0],
}

AXES = {
    sign + axis: factor * np.eye(3)[k]
    for k, axis in enumerate("xyz")
    for sign, factor in (("", 1.0), ("-", -1.0))
}

# Directions in which neither a limit nor the stretched arm is near.
QUICK = ["ready y", "ready -z", "near x", "left z", "right -x", "near -y", "near z", "down -z"]
MORE = ["ready -y", "left y", "left -y", "left -z", "right y", "right z", "right -z"]
MORE += ["near -x", "near y", "down y", "down -y", "down z"]


@dataclass
class Course:
    """The states of a jog, tick by tick, and how the tool turned."""

    session: Session
    states: list[State]

    def run(self, *commands: cmd.Command) -> State:
        """Execute a tick, check the limits of the joints, and return its state."""
        before, limits = self.states[-1], self.session.require_arm().limits
        state = self.session.step(before, commands, before.t + TICK)
        slack = 1.0 + 1e-6
        assert (np.abs(state.motion.qd) <= limits.speed * slack).all()
        change = np.abs(state.motion.qd - before.motion.qd)
        assert (change <= limits.acceleration * TICK * slack + 1e-8).all()
        change = np.abs(state.motion.qdd - before.motion.qdd)
        assert (change <= limits.jerk * TICK * slack + 1e-7).all()
        self.states.append(state)
        return state

    def rest(self, *commands: cmd.Command) -> None:
        """Execute ``commands`` and wait until the arm is at rest."""
        self.run(*commands)
        while self.states[-1].moving:
            self.run()

    @property
    def moved(self) -> FloatArray:
        """The movement of the tool point (3,) [m] since the first state."""
        chain = self.session.require_arm().chain
        first, last = (forward(chain, self.states[k].setpoint) for k in (0, -1))
        return np.asarray(last[:3, 3] - first[:3, 3])

    def points(self) -> FloatArray:
        """Return the movement of the tool point since the first state (ticks, 3) [m]."""
        chain = self.session.require_arm().chain
        points = np.array([forward(chain, state.setpoint)[:3, 3] for state in self.states])
        return np.asarray(points - points[0])

    def deviation(self, direction: FloatArray) -> float:
        """Return the largest distance [m] of the tool point from its line."""
        points = self.points()
        return float(np.linalg.norm(points - np.outer(points @ direction, direction), axis=1).max())

    def turn(self) -> float:
        """Return the largest rotation [rad] about the axis of pitch or of roll.

        The heading follows the tool point, which turns the tool about the third axis.
        """
        chain = self.session.require_arm().chain
        rotations = [forward(chain, state.setpoint)[:3, :3] for state in self.states]
        steps = [a.T @ b for a, b in pairwise(rotations)]
        rolled = np.cumsum([0.5 * (step[2, 1] - step[1, 2]) for step in steps])
        pitches = np.array([pitch_and_roll(chain, state.setpoint)[0] for state in self.states])
        return float(max(np.abs(rolled).max(), np.abs(pitches - pitches[0]).max()))

    def speed(self) -> float:
        """Return the present speed of the tool point [m/s]."""
        state = self.states[-1]
        J = jacobian_body(self.session.require_arm().chain, state.setpoint)
        return float(np.linalg.norm(J[3:] @ state.motion.qd))


def begun(session: Session, posture: str) -> Course:
    return Course(session, [session.begin(np.array(POSTURES[posture]), 0.0, 0.0)])


def jog(v: FloatArray, pitch: float = 0.0) -> cmd.Jog:
    return cmd.Jog(np.array([*v, pitch, 0.0]))


@pytest.mark.cases(3)
@pytest.mark.parametrize(
    "case", [*QUICK, *(pytest.param(case, marks=pytest.mark.long) for case in MORE)]
)
def test_jog_stays_on_its_line(session: Session, case: str) -> None:
    posture, name = case.split()
    direction, course = AXES[name], begun(session, posture)
    while course.moved @ direction < DISTANCE:
        course.run(jog(0.1 * direction))
        assert len(course.states) < 200
    assert course.deviation(direction) < MAX_DEVIATION
    assert course.turn() < MAX_TURN
    course.rest()
    assert course.moved @ direction < DISTANCE + 0.06
    assert course.deviation(direction) < MAX_DEVIATION
    assert course.turn() < MAX_TURN
    assert course.states[-1].findings == ()


@pytest.mark.parametrize("command", [cmd.Hold(), cmd.Pause()], ids=lambda case: type(case).__name__)
def test_brake_of_a_jog_stays_on_its_line(session: Session, command: cmd.Command) -> None:
    """Joints that braked as hard as they could sped the tool up from 0.1 to 0.3 m/s."""
    direction, course = AXES["-z"], begun(session, "ready")
    for _ in range(90):
        course.run(jog(0.1 * direction))
    fastest = course.speed()
    assert fastest > 0.09
    course.run(command)
    while course.states[-1].moving:
        assert course.speed() < fastest + 1e-3
        course.run()
    assert course.deviation(direction) < MAX_DEVIATION
    assert course.turn() < MAX_TURN


def test_hold_drops_the_jog_and_reports_its_cause(session: Session) -> None:
    course, cause = begun(session, "ready"), Finding(Reason.DRIVER_SILENT)
    for _ in range(60):
        course.run(jog(0.1 * AXES["y"]))
    state = course.run(cmd.HoldFor(cause))
    assert state.jogging is not None
    assert not state.jogging.rates.any()
    course.rest()
    state = course.states[-1]
    assert state.jogging is None
    assert [finding.reason for finding in state.findings] == [Reason.WAITING, Reason.DRIVER_SILENT]


@pytest.mark.parametrize("later", [-0.1 * AXES["y"], 0.1 * AXES["z"]], ids=["back", "up"])
def test_change_of_direction_does_not_turn_the_tool(session: Session, later: FloatArray) -> None:
    course = begun(session, "ready")
    for _ in range(50):
        course.run(jog(0.1 * AXES["y"]))
    for _ in range(60):
        course.run(jog(later))
    course.rest()
    # The directions mix while one replaces the other, in their plane.
    assert np.abs(course.points()[:, 0]).max() < 2e-4
    assert course.turn() < math.radians(0.05)


def test_rotation_keeps_the_tool_point(session: Session) -> None:
    course = begun(session, "right")
    for _ in range(80):
        course.run(jog(np.zeros(3), -0.4))
    course.rest()
    assert np.linalg.norm(course.points(), axis=1).max() < 2e-4
    assert course.turn() > 0.2


def test_fast_jog_is_slowed_where_its_path_bends(session: Session) -> None:
    """A jog that the joints cannot follow at its speed keeps its line, and the slower speed."""
    direction, course = AXES["z"], begun(session, "ready")
    for _ in range(120):
        course.run(jog(0.4 * direction))
    assert 0.02 < course.speed() < 0.2
    course.rest()
    assert course.deviation(direction) < 1e-3
    assert course.turn() < math.radians(0.1)


EXACT = 1e-6
"""[m] Tolerance of the tracker."""


def pose(session: Session, state: State) -> FloatArray:
    """Return the pose (4, 4) of the tool at the setpoint."""
    return forward(session.require_arm().chain_to(state.tool), state.setpoint)


def step(
    x: float = 0.0, y: float = 0.0, z: float = 0.0, frame: JogFrame = JogFrame.BASE
) -> cmd.StepTool:
    return cmd.StepTool(np.array([x, y, z, 0.0, 0.0]), frame)


@pytest.mark.parametrize("length", [1e-4, 1e-3, 1e-2])
def test_step_moves_the_tool_by_its_length(session: Session, state: State, length: float) -> None:
    before = pose(session, state)
    after = pose(session, rested(session, state, step(z=-length)))
    np.testing.assert_allclose(after[:3, 3] - before[:3, 3], (0.0, 0.0, -length), atol=EXACT)
    np.testing.assert_allclose(after[:3, :3], before[:3, :3], atol=1e-5)


def test_steps_given_at_once_add_up(session: Session, state: State) -> None:
    before = pose(session, state)
    steps: list[cmd.Command] = [step(x=-0.001), step(x=-0.001), step(z=0.001)]
    state = ticked(session, state, *steps)
    state = rested(session, ticked(session, state, ticks=2), step(x=-0.001))
    moved = pose(session, state)[:3, 3] - before[:3, 3]
    np.testing.assert_allclose(moved, (-0.003, 0.0, 0.001), atol=EXACT)


def test_step_along_the_tool_follows_its_direction(session: Session, state: State) -> None:
    before = pose(session, state)
    state = rested(session, state, step(x=-0.01, frame=JogFrame.TOOL))
    moved = pose(session, state)[:3, 3] - before[:3, 3]
    np.testing.assert_allclose(moved, before[:3, :3] @ (-0.01, 0.0, 0.0), atol=EXACT)


def test_step_turns_pitch_and_roll(session: Session, state: State) -> None:
    before = state.setpoint
    turned = cmd.StepTool(np.array([0.0, 0.0, 0.0, 0.0, 0.02]))
    state = rested(session, state, turned)
    np.testing.assert_allclose(state.setpoint[4] - before[4], 0.02, atol=EXACT)
    turned = cmd.StepTool(np.array([0.0, 0.0, 0.0, 0.02, 0.0]))
    state = rested(session, state, turned)
    np.testing.assert_allclose(sum(state.setpoint[1:4] - before[1:4]), 0.02, atol=EXACT)


def test_steps_beyond_the_reach_do_not_pile_up(session: Session, state: State) -> None:
    for _ in range(20):
        state = rested(session, state, step(x=0.1))
    farthest = pose(session, state)[:3, 3]
    state = rested(session, state, step(x=-0.02))
    assert pose(session, state)[0, 3] < farthest[0] - 0.01
