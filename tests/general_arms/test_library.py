"""Arms of other kinds in the library: kinematics, plans, and what is refused."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import katana450
from katana450.extensions.programs.run.simulation import plan_script
from katana450.extensions.programs.script.script import parse
from katana450.maths.geometry import so3
from tests.robot.hands import hand
from tests.robot.public_arms import PX100, two_sided, written

Urdf = Callable[[str], Path]
NAMES = {"px100": 4, "vx300s": 8, "ur5": 8, "twisted": 1, "seven": 8}


@cache
def load(path: Path, **options: Any) -> katana450.Arm:
    arm: katana450.Arm = katana450.load(path, **options)
    return arm


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("frame", ["shoulder", "base"])
def test_posture_is_found_again(urdf: Urdf, name: str, frame: str) -> None:
    arm = load(urdf(name), frame=frame)
    rng = np.random.default_rng(1)
    for q in rng.uniform(arm.lower, arm.upper, (5, arm.n)):
        T = arm.fk(q)
        solutions = arm.ik(T, q)
        assert solutions.q.shape == (NAMES[name], arm.n)
        assert len(set(solutions.branches)) == NAMES[name]
        assert min(float(np.abs(solution.q - q).max()) for solution in solutions.feasible) < 0.2
        for solution in solutions.feasible:
            np.testing.assert_allclose(arm.fk(solution.q), T, atol=1e-8)
        best = arm.nearest(T)
        assert best.reason == ""
        np.testing.assert_allclose(best.T, T, atol=1e-8)


def test_frames_agree(urdf: Urdf) -> None:
    shoulder, base = load(urdf("ur5")), load(urdf("ur5"), frame="base")
    q = np.full(6, 0.3)
    np.testing.assert_allclose(shoulder.T_base_frame @ shoulder.fk(q), base.fk(q), atol=1e-14)
    # The tool of the published file, turned by nothing.
    home = base.fk(np.zeros(6))
    np.testing.assert_allclose(home[:3, 3], (0.81725, 0.19145, -0.005491), atol=1e-9)


def test_tool_is_chosen_by_its_link(urdf: Urdf) -> None:
    path = urdf("seven")
    assert load(path).tool == "tcp"
    assert load(path, tool="flange").tool == "flange"
    assert load(path, tool="l6").n == 6
    with pytest.raises(katana450.RobotDescriptionError, match="no link 'nose'; its links are"):
        katana450.load(path, tool="nose")


def test_one_of_several_fingers_is_chosen_by_its_tip(tmp_path: Path) -> None:
    path = written(tmp_path, "hand", two_sided(PX100[:4]))
    with pytest.raises(katana450.RobotDescriptionError, match=r"2 arms of 4 joints .* --tool"):
        katana450.load(path)
    assert load(path, tool="right_hand").chain.names == (
        "right_waist",
        "right_shoulder",
        "right_elbow",
        "right_wrist_angle",
    )


def test_posture_of_an_arm_among_other_joints_has_its_axes_alone(tmp_path: Path) -> None:
    path = tmp_path / "hand.urdf"
    path.write_text(hand(), encoding="utf-8")
    arm = load(path, tool="finger1_link2")
    assert (arm.n, len(arm.session.ready)) == (3, 3)
    assert ((arm.lower <= arm.ready) & (arm.ready <= arm.upper)).all()
    assert arm.fk(arm.ready).shape == (4, 4)


def test_arm_beside_another_joint_is_planned_without_a_named_tool(urdf: Urdf) -> None:
    path = urdf("ur5")
    camera = '<link name="camera"/><joint name="pan" type="revolute"><parent link="PARENT"/>'
    camera += '<child link="camera"/><limit lower="-1" upper="1" velocity="1" effort="1"/></joint>'
    parent = load(path).robot.links[0].name
    other = path.with_name("camera.urdf")
    text = path.read_text(encoding="utf-8").replace("</robot>", f"{camera}</robot>")
    other.write_text(text.replace("PARENT", parent), encoding="utf-8")
    arm = load(other)
    assert arm.n == 6
    assert "Joint 'pan' is revolute and stays at zero." in arm.notes
    np.testing.assert_allclose(arm.plan(arm.ready + 0.1).end, arm.ready + 0.1, atol=1e-12)


def test_notes_say_how_poses_are_solved(urdf: Urdf) -> None:
    assert "six axes, three of them parallel" in load(urdf("ur5")).notes[0]
    twisted = load(urdf("twisted"))
    assert "numerical, because axis 2 must be perpendicular to axis 1" in twisted.notes[0]
    assert twisted.method in twisted.notes[0]


def test_two_axes_are_no_arm(tmp_path: Path) -> None:
    path = written(tmp_path, "two", PX100[:2])
    with pytest.raises(katana450.RobotDescriptionError, match="has 2 axes"):
        load(path)
    with pytest.raises(katana450.KatanaError, match="axes"):
        plan_script(parse("steps:\n  - home\n"), path)


@pytest.mark.cases(2)
@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("frame", ["shoulder", "base"])
def test_line_of_the_library_is_straight(urdf: Urdf, name: str, frame: str) -> None:
    arm = load(urdf(name), frame=frame)
    by = np.array((-0.02, 0.02, -0.02))
    plan = arm.line(by=by)
    assert plan.length == pytest.approx(np.linalg.norm(by), abs=1e-9)
    samples = plan.sample()
    off = samples.points - samples.points[0]
    assert np.abs(off - np.outer(off @ by, by) / (by @ by)).max() < 1e-9
    np.testing.assert_allclose(off[-1], by, atol=1e-9)
    if arm.n >= 6:
        np.testing.assert_allclose(samples.T[-1, :3, :3], samples.T[0, :3, :3], atol=1e-9)
    if arm.n != 5:
        back = arm.line(to=samples.points[0], start=plan.end)
        np.testing.assert_allclose(back.end, plan.start, atol=1e-9)


def test_plan_leads_to_a_pose_and_a_line_turns_to_angles(urdf: Urdf) -> None:
    arm = load(urdf("ur5"), frame="base")
    T = arm.fk(arm.ready + 0.1)
    np.testing.assert_allclose(arm.fk(arm.plan(T).end), T, atol=1e-8)
    R = so3.exp((0.1, -0.1, 0.2)) @ arm.fk(arm.ready)[:3, :3]
    roll, pitch, yaw = so3.to_rpy(R)
    line = arm.line(roll=roll, pitch=pitch, yaw=yaw)
    np.testing.assert_allclose(arm.fk(line.end)[:3, :3], R, atol=1e-9)
    centre = arm.fk(arm.ready)[:3, 3]
    circle = arm.circle(
        centre, 0.02, roll=roll, pitch=pitch, yaw=yaw, branch="left-up-flip", turns=0.5
    )
    np.testing.assert_allclose(arm.fk(circle.start)[:3, :3], R, atol=1e-9)
    with arm.show(line) as viewer:
        assert viewer.url.startswith("http://127.0.0.1:")


def test_script_written_in_python_has_a_yaw() -> None:
    with katana450.program("Turn", frame="base") as p:
        p.pose("above", [450, 150, 350], roll=180, pitch=0, yaw=90)
        p.move("above")
        p.move([400, 0, 300], yaw=10)
        p.line(by={"z": -50}, yaw="0.5 rad")
        p.circle([400, 0, 300], "x", 40, yaw=20)
    assert str(p).count("yaw:") == 4


FAR = np.zeros((4, 4))
FAR[0, 3] = 3.0

WRONG: dict[str, tuple[Callable[[katana450.Arm], Any], str]] = {
    "angles of another arm": (lambda arm: arm.fk([0.0] * 5), r"shape \(5,\)"),
    "no number": (lambda arm: arm.fk([np.nan] + [0.0] * 5), "axis 1"),
    "no rotation": (lambda arm: arm.ik(np.diag([2.0, 1.0, 1.0, 1.0])), "rotation"),
    "pose of rows": (lambda arm: arm.ik(np.eye(3)), "shape"),
    "one of many": (lambda arm: arm.ik(np.array([np.eye(4), 2.0 * np.eye(4)])), "ose 1"),
    "hint of five": (lambda arm: arm.ik(np.eye(4), np.zeros(5)), r"shape \(5,\)"),
    "nearest to nothing": (lambda arm: arm.nearest(np.zeros((4, 4))), "last row"),
    "priority": (lambda arm: arm.nearest(np.eye(4), priority="pitch"), "for five-axis arms"),
    "branch": (lambda arm: arm.nearest(np.eye(4), branch="front-up"), "for five-axis arms"),
    "goal out of reach": (lambda arm: arm.plan(np.diag([1.0, 1, 1, 1]) + FAR), "cannot take this"),
    "roll in words": (lambda arm: arm.circle((0.3, 0, 0), 0.1, roll=np.nan), "roll has nan"),
    "branch of a circle": (lambda arm: arm.circle((0.3, 0, 0), 0.1, branch="left"), "no branch"),
    "line to nowhere": (lambda arm: arm.line(by=(0.0, 0.0, 0.0)), "moves nothing"),
    "long line": (lambda arm: arm.line(by=(3.0, 0.0, 0.0)), "leaves the reach"),
    "short jacobian": (lambda arm: arm.jacobian([0.0]), "shape"),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_input_is_refused(urdf: Urdf, case: str) -> None:
    call, message = WRONG[case]
    with pytest.raises(katana450.InputError, match=message):
        call(load(urdf("ur5")))


def test_wrong_arguments_of_load_are_refused(urdf: Urdf, tmp_path: Path) -> None:
    path = urdf("ur5")
    with pytest.raises(katana450.InputError, match="no frame 'world'"):
        katana450.load(path, frame="world")  # type: ignore[arg-type]
    scene = tmp_path / "scene.yaml"
    scene.write_text("scene: 1\nobjects: []\n", encoding="utf-8")
    assert load(path, scene=scene).objects == ()
    with pytest.raises(katana450.RobotDescriptionError, match="'base' is carried by 0"):
        katana450.load(path, tool="base")
    assert "ur5" in repr(load(path))
