"""Arms with four, six and seven axes empty a cup about its lip, without spilling."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from katana450.arm.control.objects.pouring import CUP
from katana450.arm.control.state.scene_objects import named
from katana450.arm.control.state.state import State
from katana450.arm.robot.collision import scene_objects_of
from katana450.arm.robot.props import load_props
from katana450.assembly.robot_session import describe_robot
from katana450.errors import InputError
from katana450.extensions.media.measures import measurements
from katana450.extensions.programs.building.actions import FollowPlan
from katana450.extensions.programs.building.plan_state import PlanContext
from katana450.extensions.programs.language.source import ScriptError
from katana450.extensions.programs.planning.curves import PoseTurn
from katana450.extensions.programs.run.program import compiled
from katana450.extensions.programs.run.simulation import Planned, Simulation, run_by_clock
from katana450.extensions.programs.script.script import parse
from katana450.extensions.programs.steps.pouring import EMPTY_TILT, POURING, UNDERSIDES, turns_over
from katana450.extensions.recording.codec import Codec
from katana450.extensions.recording.forms import FormError
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.batch import forward_batch
from katana450.maths.kinematics.tool import ToolTarget
from katana450.maths.planning.jet import Jet
from katana450.maths.planning.path import joint_derivatives
from katana450.settings import Settings
from tests.general_arms.gripping_arms import HANDS, gripping_urdf
from tests.general_arms.programs import begin_plan
from tests.general_arms.published_arms import UR5E

MICROMETRE = 1e-6

CREEP = 1e-4
"""[m] Way that a cup may move when it is set down, and in the fingers, by friction alone."""


class Setting(NamedTuple):
    """Places of cup and basin on the table [mm], the lift [mm], and the water in the cup [ml]."""

    cup: tuple[float, float] = (450.0, -150.0)
    basin: tuple[float, float] = (450.0, 200.0)
    lift: float = 140.0
    water: float = 200.0


SETTINGS = {
    "four axes": Setting((230.0, -60.0), (60.0, 190.0), 60.0, 100.0),
    "four long axes": Setting((400.0, -120.0), (60.0, 190.0)),
}


class Pour(NamedTuple):
    """A planned pour and its run."""

    plan: Planned
    simulation: Simulation

    def cup(self, state: State) -> FloatArray:
        """Return the pose (4, 4) of the cup in the base frame."""
        cup = named(state.objects, CUP)
        assert cup is not None
        return self.plan.session.environment.pose(cup, state.x_setpoint)

    def lip(self, state: State) -> FloatArray:
        """Return the lowest point (3,) of the rim of the tilted cup in the base frame [m]."""
        cup, T = named(state.objects, CUP), self.cup(state)
        assert cup is not None
        up = T[:3, 2]
        down = up[2] * up - (0.0, 0.0, 1.0)
        lip: FloatArray = T[:3, 3] + cup.height * up + cup.size[0] * down / np.linalg.norm(down)
        return lip


def planned(tmp_path: Path, name: str, pour: str, *later: str) -> Planned:
    """Return a script that fills the cup of the scene, pours as the step says, and continues."""
    path, setting = tmp_path / "arm.urdf", SETTINGS.get(name, Setting())
    path.write_text(gripping_urdf(name), encoding="utf-8")
    steps = (
        "put: {{object: cup, x: {:g}, y: {:g}}}".format(*setting.cup),
        "put: {{object: basin, x: {:g}, y: {:g}}}".format(*setting.basin),
        f"fill: {setting.water:g}",
        "grasp: cup",
        f"line: {{by: {{z: {setting.lift:g}}}}}",
        f"pour: {pour}",
        *later,
    )
    script = parse("frame: base\nsteps:\n" + "".join(f"  - {step}\n" for step in steps))
    robot, session, _ = describe_robot(Settings(), path, None)
    start = session.begin(session.ready, 0.0, 0.0)
    context = PlanContext(session, robot.require_arm().T_base_shoulder)
    return Planned(script, compiled(script, context, start), robot, session, start)


def poured(tmp_path: Path, name: str, pour: str) -> Pour:
    plan = planned(tmp_path, name, pour, "set_down:", "home")
    result = Pour(plan, run_by_clock(plan))
    assert not any(state.findings for state in result.simulation.states)
    return result


def test_tool_turns_about_a_lip_over_the_middle_of_the_basin(tmp_path: Path) -> None:
    plan = planned(tmp_path, "UR5e", "{into: basin, shake: 0}")
    (path,) = (
        task.action.plan.segments[0].path
        for task in plan.program.tasks
        if task.name == POURING and isinstance(task.action, FollowPlan)
    )
    arm = plan.robot.require_arm()
    q = joint_derivatives(path, np.linspace(0.0, 1.0, 41))[0]
    T = arm.T_base_shoulder @ forward_batch(arm.chain, q)
    basin = load_props().basin.height
    moved = T @ np.linalg.inv(T[0])
    off = []
    for under in UNDERSIDES:
        lip = np.array((0.45, 0.2, basin + load_props().cup.height + under, 1.0))
        off.append(float(np.abs(moved @ lip - lip).max()))
    assert min(off) < MICROMETRE
    # The cup turns evenly, about a level axis.
    angles = [so3.angle(pose[:3, :3], np.eye(3)) for pose in moved]
    np.testing.assert_allclose(np.degrees(angles), np.linspace(0.0, 120.0, 41), atol=1e-6)
    assert moved[-1][2, 2] == pytest.approx(-0.5, abs=1e-9)


@pytest.mark.long
@pytest.mark.parametrize("name", ["UR5e", "Panda", "four long axes"])
def test_cup_is_emptied_about_its_lip(name: str, tmp_path: Path) -> None:
    pour = poured(tmp_path, name, "{into: basin, shake: 1}")
    values = measurements(pour.simulation)
    assert values["emptied_percent"] is not None
    assert 99.5 < values["emptied_percent"] <= 100.0
    assert values["spilled_ml"] == 0.0
    assert values["carried_margin_to_rim_mm"] is not None
    assert values["carried_margin_to_rim_mm"] > 1.0
    # The lip stays where it is while the cup turns, and is over the middle of the basin.
    names = [task.name for task in pour.plan.program.tasks]
    ticks = np.flatnonzero(pour.simulation.tasks == names.index(POURING)).tolist()
    tilted = [s for s in map(pour.simulation.states.__getitem__, ticks) if _tilt(pour, s) > 5.0]
    lips = np.array([pour.lip(state) for state in tilted])
    assert np.ptp(lips, axis=0).max() < CREEP
    setting = SETTINGS.get(name, Setting())
    np.testing.assert_allclose(1e3 * lips[0, :2], setting.basin, atol=1e3 * CREEP)
    assert _tilt(pour, tilted[-1]) == pytest.approx(120.0, abs=0.1)
    cup = pour.cup(pour.simulation.states[-1])
    np.testing.assert_allclose(1e3 * cup[:3, 3], (*setting.cup, 0.0), atol=1e3 * CREEP)


def _tilt(pour: Pour, state: State) -> float:
    """Return the tilt of the cup [deg]."""
    return float(np.degrees(np.arccos(np.clip(pour.cup(state)[2, 2], -1.0, 1.0))))


def test_tilt_beyond_that_of_an_empty_cup_is_refused() -> None:
    plan_state = begin_plan(UR5E)
    cup, basin, *_ = scene_objects_of(load_props())
    with pytest.raises(InputError, match="No tilt of the cup pours this part"):
        next(turns_over(plan_state, cup, basin, EMPTY_TILT + 0.01))


@pytest.mark.long
@pytest.mark.parametrize("name", ["four axes", "UR5e"])
def test_flow_that_no_tilt_gives_is_refused(name: str, tmp_path: Path) -> None:
    """The last drops flow too slowly."""
    setting = SETTINGS.get(name, Setting())
    why = "The cup cannot be emptied into basin: No tilt of the cup pours this part; pour all of it"
    with pytest.raises(ScriptError, match=why):
        planned(tmp_path, name, f"{{into: basin, ml: {setting.water:g}}}")


def test_basin_too_near_to_axis_1_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The hand moves in a plane 120 mm beside axis 1, and the basin is 80 mm from that axis."""
    chain, gripper = HANDS["four axes"]
    M = chain.M.copy()
    M[1, 3] += 0.12
    monkeypatch.setitem(HANDS, "beside", (replace(chain, M=M), gripper))
    monkeypatch.setitem(SETTINGS, "beside", Setting((230.0, -60.0), (-80.0, 0.0), 60.0, 100.0))
    with pytest.raises(ScriptError, match="cannot be emptied into basin: it stands too near to a"):
        planned(tmp_path, "beside", "{into: basin, ml: 60}")


START = ToolTarget.of(
    se3.from_rotation_translation(so3.from_rpy(0.3, 0.2, 0.1), np.array((0.5, 0.1, 0.4)))
)
TURN = PoseTurn(
    START,
    np.array((0.4, 0.2, 0.3)),
    so3.rotation_z(0.7)[:, 0],
    np.array((0.5, 0.3, 0.1, -0.05)),
    so3.rotation_z(0.2)[:, 0],
)


def test_turn_by_a_polynomial_keeps_the_lip_in_its_place() -> None:
    turn = replace(TURN, axis_in_pose=None)
    sigma = np.linspace(0.0, 1.0, 11)
    T = turn.at(Jet.variable(sigma)).T
    before = se3.from_rotation_translation(START.R, START.position)
    for place, pose in zip(sigma.tolist(), T, strict=True):
        angle = np.polynomial.polynomial.polyval(2.0 * place - 1.0, turn.angles)
        R = so3.exp(angle * turn.axis)
        moved = se3.from_rotation_translation(R, turn.point - R @ turn.point)
        np.testing.assert_allclose(pose, moved @ before, atol=1e-12)


@pytest.mark.parametrize("has_pose_axis", [True, False])
def test_turn_is_read_from_recordings(has_pose_axis: bool) -> None:
    """Older recordings have no `axis_in_pose`: it is the axis then."""
    codec = Codec()
    form = codec.encoded(TURN)
    if not has_pose_axis:
        del form["axis_in_pose"]
    read = codec.decoded(PoseTurn, form)
    wanted = replace(TURN, axis_in_pose=TURN.axis_in_pose if has_pose_axis else TURN.axis)
    sigma = Jet.variable(np.linspace(0.0, 1.0, 5))
    np.testing.assert_array_equal(read.at(sigma).T, wanted.at(sigma).T)


@pytest.mark.parametrize("name", ["point", "axis", "angles", "axis_in_pose"])
@pytest.mark.parametrize(
    "wrong", [np.zeros(0), np.ones(2), np.ones((3, 3)), np.array((np.nan, 0.0, 1.0))]
)
def test_turn_of_wrong_numbers_is_refused(name: str, wrong: FloatArray) -> None:
    if name == "angles" and wrong.shape == (2,):
        wrong = np.array(0.0)
    changed: dict[str, Any] = {name: wrong}
    why = f"The {name} of a turn has"
    with pytest.raises(InputError, match=why):
        replace(TURN, **changed)
    codec = Codec()
    form = codec.encoded(TURN)
    form[name] = codec.encoded(wrong)
    with pytest.raises(FormError, match=f"these fields are no PoseTurn: {why}"):
        codec.decoded(PoseTurn, form)


@pytest.mark.parametrize("name", ["axis", "axis_in_pose"])
def test_turn_about_an_axis_of_another_length_is_refused(name: str) -> None:
    changed: dict[str, Any] = {name: np.array((0.0, 0.0, 2.0))}
    with pytest.raises(InputError, match=f"The {name} of a turn is not a unit vector"):
        replace(TURN, **changed)
