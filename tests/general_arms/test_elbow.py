"""The elbow of seven axes moves while the tool rests: by an act, by a jog and in a script."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.session.session import Session
from katana450.arm.control.state.messages import sentence
from katana450.arm.control.state.scene_objects import SceneObject, Shape
from katana450.arm.control.state.state import Reason, State
from katana450.assembly.robot_session import find_robot
from katana450.errors import InputError, KatanaError
from katana450.maths.geometry import se3, so3
from katana450.maths.kinematics.batch import forward_batch
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import joint_frames
from katana450.maths.motion.arm_angle import elbow_postures, elbow_turn
from katana450.settings import Settings
from tests.general_arms.chain_urdf import chain_urdf
from tests.general_arms.driven import begun, run, session_of
from tests.general_arms.programs import played, program
from tests.general_arms.published_arms import GEN3_7, PANDA, SEVEN, UR5E, XARM_7

ARMS = {"Gen3": GEN3_7, **SEVEN, "xArm7": XARM_7}

EXACT = 1e-9
"""[m], [1] Measured over turns from 180 random postures of five arms: 9e-15 m and 2e-14."""

UP = np.array((0.0,) * 6 + (0.6,))
"""Rates of a jog that moves the elbow alone."""


def states_of(
    session: Session, state: State, commands: Sequence[cmd.Command], ticks: int = 1500
) -> list[State]:
    """Return the states from ``state``, with ``commands``, until the arm is at rest."""
    states = [state, run(session, state, commands)]
    while states[-1].moving and len(states) < ticks:
        states.append(run(session, states[-1]))
    return states


def turned(chain: Chain, states: Sequence[State]) -> float:
    """Return the turn of the arm angle [rad]."""
    pairs = pairwise(states)
    return sum(elbow_turn(chain, before.setpoint, after.setpoint) for before, after in pairs)


def check_tool_rests(session: Session, states: Sequence[State]) -> None:
    """Check the pose of the tool and the limits of the joints in every tick."""
    arm = session.require_arm()
    T = forward_batch(arm.chain, np.array([state.setpoint for state in states]))
    assert np.linalg.norm(T[:, :3, 3] - T[0, :3, 3], axis=1).max() < EXACT
    assert np.abs(T[:, :3, :3] - T[0, :3, :3]).max() < EXACT
    slack = 1.0 + 1e-6
    for before, after in pairwise(states):
        a, b, limits = before.motion, after.motion, arm.limits
        tick = after.t - before.t
        assert (np.abs(b.qd) <= slack * limits.speed).all()
        assert (np.abs(b.qd - a.qd) <= slack * limits.acceleration * tick).all()
        assert (np.abs(b.qdd - a.qdd) <= slack * limits.jerk * tick).all()
        assert arm.chain.within_limits(b.q, slack=0.0)


@pytest.mark.cases(1)
@pytest.mark.parametrize("chain", ARMS.values(), ids=ARMS)
def test_elbow_turns_by_an_angle_while_the_tool_rests(chain: Chain) -> None:
    session = session_of(chain)
    start = begun(session)
    # Turns in a row add up.
    states = states_of(session, start, [cmd.TurnElbow(0.2), cmd.TurnElbow(-0.1)])
    check_tool_rests(session, states)
    assert turned(chain, states) == pytest.approx(0.1, abs=1e-5)
    assert (states[-1].findings, states[-1].branch) == ((), start.branch)
    back = states_of(session, states[-1], [cmd.TurnElbow(-0.1)])
    np.testing.assert_allclose(back[-1].setpoint, start.setpoint, atol=1e-5)


def test_arm_angle_is_the_turn_of_the_elbow_about_the_line_from_shoulder_to_wrist() -> None:
    """The elbow of an iiwa is on its axis 4; shoulder and wrist are where three axes meet."""
    chain = SEVEN["iiwa"]
    first, *_, last = (
        joint_frames(chain, q) for q in elbow_postures(chain, session_of(chain).ready, 0.4)
    )
    points = [np.cross(w, v) for w, v in zip(chain.S[:3].T, chain.S[3:].T, strict=True)]
    shoulder, wrist = points[1], (first[4] @ [*points[5], 1.0])[:3]
    line = (wrist - shoulder) / np.linalg.norm(wrist - shoulder)
    elbows = [(frames[2] @ [*points[3], 1.0])[:3] - shoulder for frames in (first, last)]
    np.testing.assert_allclose(so3.exp(0.4 * line) @ elbows[0], elbows[1], atol=1e-5)


@pytest.mark.cases(1)
@pytest.mark.parametrize("chain", SEVEN.values(), ids=SEVEN)
def test_jog_moves_the_elbow_while_it_is_renewed(chain: Chain) -> None:
    session = session_of(chain)
    states = [begun(session)]
    for tick in range(60):
        commands = [cmd.Jog(UP)] if tick % 5 == 0 else []
        states.append(run(session, states[-1], commands))
    assert elbow_turn(chain, states[-2].setpoint, states[-1].setpoint) > 0.002
    states += states_of(session, states[-1], [cmd.Jog(np.zeros(7))])[1:]
    check_tool_rests(session, states)
    assert states[-1].mode == begun(session).mode


@pytest.mark.cases(1)
@pytest.mark.parametrize("chain", [SEVEN["iiwa"], PANDA], ids=["iiwa", "Panda"])
def test_elbow_comes_to_rest_at_a_limit_and_says_which(chain: Chain) -> None:
    session = session_of(chain)
    states = states_of(session, begun(session), [cmd.TurnElbow(math.pi)])
    check_tool_rests(session, states)
    end = states[-1]
    (finding,) = end.findings
    assert (finding.reason, end.moving) == (Reason.AXIS_LIMIT, False)
    assert finding.axis is not None
    assert abs(end.setpoint[finding.axis] - finding.amount) < 1e-3
    assert f"axis {finding.axis + 1} at its limit" in sentence(end).lower()
    # It turns back from there.
    check_tool_rests(session, states_of(session, end, [cmd.TurnElbow(-0.1)]))


def test_stop_and_pause_end_the_motion_of_the_elbow() -> None:
    session = session_of(PANDA)
    moving = states_of(session, begun(session), [cmd.TurnElbow(0.5)], ticks=80)
    stopped = states_of(session, moving[-1], [cmd.Stop()])
    assert len(stopped) < 60
    assert stopped[-1].findings[0].reason is Reason.STOPPED
    assert 0.1 < turned(PANDA, [*moving, *stopped]) < 0.4
    paused = states_of(session, moving[-1], [cmd.Pause()])
    going = states_of(session, paused[-1], [cmd.Resume()])
    check_tool_rests(session, [*moving, *paused, *going])
    assert turned(PANDA, [*moving, *paused, *going]) == pytest.approx(0.5, abs=1e-5)


def test_elbow_keeps_clear_of_a_ball_beside_it(tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    path.write_text(chain_urdf("arm", PANDA), encoding="utf-8")
    session = find_robot(Settings(), path, None).session
    chain = session.require_arm().chain
    # The ball lies where the elbow comes to.
    *_, end = elbow_postures(chain, session.ready, 0.5)
    w, v = np.split(chain.S[:, 3], 2)
    T_base_shoulder = np.eye(4)
    T_base_shoulder[2, 3] = 0.333
    elbow = T_base_shoulder @ joint_frames(chain, end)[3] @ [*np.cross(w, v), 1.0]
    T = se3.from_rotation_translation(np.eye(3), elbow[:3])
    ball = SceneObject("ball", Shape.SPHERE, (0.03,), T)
    start = run(session, session.begin(session.ready, 0.0, 0.0), [cmd.PlaceObject(ball)])
    states = states_of(session, start, [cmd.TurnElbow(0.5)])
    world = session.world_at(states[-1])
    assert world is not None
    for state in states[::20]:
        assert min(world.gap(state.x_setpoint, part.name, "ball") for part in world.parts) > 0.005
    contact = states[-1].findings[0]
    assert (contact.reason, "ball" in (contact.parts or ())) == (Reason.CONTACT, True)
    assert 0.005 < contact.amount < 0.03
    assert 0.1 < turned(chain, states) < 0.45
    check_tool_rests(session, states)
    # A jog that is held there leaves the elbow at rest.
    held = [states[-1]]
    for _ in range(20):
        held.append(run(session, held[-1], [cmd.Jog(UP)]))
    check_tool_rests(session, held)
    assert abs(turned(chain, held)) < 0.01
    assert held[-1].findings[0].reason is Reason.CONTACT


def test_turn_that_the_arm_cannot_do_is_refused_with_the_reason() -> None:
    session = session_of(UR5E)
    for command in (cmd.TurnElbow(0.1), cmd.Jog(UP)):
        with pytest.raises(InputError, match=r"seven turning axes|has 6 numbers"):
            session.step(begun(session), [command], 0.01)
    with pytest.raises(InputError, match="not both"):
        cmd.Jog(UP + 0.1)
    with pytest.raises(KatanaError, match="takes seven turning axes"):
        program(UR5E, "turn_elbow: 20")
    with pytest.raises(
        KatanaError, match=r"Axis 2 comes to its limit of -101.0 deg after 10\d of 170"
    ):
        program(PANDA, "turn_elbow: 170")


@pytest.mark.cases(1)
@pytest.mark.parametrize("chain", ARMS.values(), ids=ARMS)
def test_script_turns_the_elbow_while_the_tool_rests(chain: Chain) -> None:
    states = played(chain, program(chain, "turn_elbow: 20 deg"))
    check_tool_rests(session_of(chain), states)
    assert turned(chain, states) == pytest.approx(math.radians(20.0), abs=1e-5)
