"""Arms as their makers describe them: read with their grippers, or refused for the true reason."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import yourdfpy

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.session.session import Session
from katana450.arm.control.state.state import Reason
from katana450.arm.drivers.driver import SimulatedDriver
from katana450.arm.robot.link import SLOW_TURN
from katana450.arm.robot.loader import load
from katana450.assembly.robot_session import find_robot
from katana450.errors import RobotDescriptionError
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.projection import project
from katana450.maths.kinematics.solver import inverse
from katana450.settings import Settings
from tests.robot.hands import rail
from tests.robot.public_arms import (
    KATANAS,
    PX100,
    PX150,
    ROLLS_TWICE,
    SO101,
    UR5,
    VX300S,
    YOUBOT_FINGERS,
    Z1,
    Z1_WITH_JAW,
    J,
    stewart,
    two_sided,
    written,
)
from tests.robot.urdf_files import saved


@pytest.mark.parametrize("name", KATANAS)
def test_every_public_katana_is_an_arm_with_both_fingers_driven(tmp_path: Path, name: str) -> None:
    robot = load(written(tmp_path, name, KATANAS[name]))
    arm = robot.require_arm()
    assert arm.default_tool == "tool_frame"
    gripper = arm.gripper
    assert (gripper.lower, gripper.upper, gripper.speed) == (-0.44, 0.30, 0.718834)
    assert not gripper.slides
    angles = robot.joint_values(np.zeros(5), 0.2)
    # The left finger's axis points the other way, so equal angles open both.
    assert (angles["r"], angles["l"]) == (0.2, 0.2)
    assert [note for note in arm.notes if "'r', 'l'" in note and "driven together" in note]


def test_sliding_fingers_move_within_their_limits(tmp_path: Path) -> None:
    path = written(tmp_path, "px150", PX150)
    robot = load(path)
    arm = robot.require_arm()
    gripper = arm.gripper
    assert (gripper.lower, gripper.upper, gripper.slides) == (0.015, 0.037, True)
    assert robot.joint_values(np.zeros(5), 0.03) | {"waist": 0} == {
        **dict.fromkeys((*arm.chain.names, "gripper"), 0.0),
        "left_finger": 0.03,
        "right_finger": -0.03,
    }
    driver = SimulatedDriver(arm, np.zeros(5), 0.0)
    assert driver.start(0.0).gripper == 0.015
    urdf = yourdfpy.URDF.load(str(path), load_meshes=False, build_scene_graph=True)
    urdf.update_cfg(dict.fromkeys(arm.chain.names, 0.0) | {"left_finger": 0.03})
    for name, T in robot.frames(robot.joint_values(np.zeros(5), 0.03)).items():
        np.testing.assert_allclose(T, urdf.get_transform(name), atol=1e-12)


def test_a_session_drives_sliding_fingers_and_names_their_limit(tmp_path: Path) -> None:
    arm = load(written(tmp_path, "px150", PX150)).require_arm()
    session = Session(arm, arm.ready(Settings().ready))
    state = session.begin(session.ready, arm.gripper.clamp(0.0), 0.0)
    state = session.step(state, [cmd.Gripper(0.05)], 0.01)
    assert [(f.reason, f.amount) for f in state.findings] == [(Reason.GRIPPER_SLIDE_LIMIT, 0.037)]
    for tick in range(2, 20):
        state = session.step(state, [], 0.01 * tick)
    assert state.gripper_setpoint == pytest.approx(0.037, abs=1e-12)


@pytest.mark.parametrize(
    ("joints", "expected"),
    [
        ([J("f", "prismatic", "hand", "a", limits=(0.0, 0.02))], {"f": (1.0, 0.0)}),
        (YOUBOT_FINGERS, {"finger_l": (1.0, 0.0), "finger_r": (1.0, 0.0)}),
        ([J("a", "prismatic", "hand", "left", limits=(-0.03, -0.01)),
          J("b", "prismatic", "hand", "right", limits=(0.01, 0.03))],
         {"b": (1.0, 0.0), "a": (-1.0, 0.0)}),
        ([J("a", "revolute", "hand", "left", limits=(-0.5, 0.5)),
          J("b", "revolute", "hand", "right", limits=(-0.5, 0.5))],
         {"a": (1.0, 0.0), "b": (-1.0, 0.0)}),
        ([J("a", "revolute", "hand", "left", limits=(0.0, 0.5)),
          J("b", "revolute", "left", "tip", limits=(0.0, 1.0), mimic=("a", 2.0)),
          J("c", "prismatic", "hand", "right", limits=(0.0, 0.02), mimic=("b", 0.01))],
         {"a": (1.0, 0.0), "b": (2.0, 0.0), "c": (0.02, 0.0)}),
    ],
    ids=["one sliding", "youBot", "mirrored ranges", "parallel axes", "a chain of mimics"],
)  # fmt: skip
def test_fingers_of_every_kind_are_driven_together(
    tmp_path: Path, joints: list[J], expected: dict[str, tuple[float, float]]
) -> None:
    arm = load(written(tmp_path, "arm", [*PX150[:5], *joints])).require_arm()
    assert set(arm.fingers) == set(expected)
    assert next(iter(arm.fingers)) == next(iter(expected))
    for name, follow in expected.items():
        assert arm.fingers[name] == pytest.approx(follow)


def test_a_joint_that_cannot_move_rests_inside_its_limits(tmp_path: Path) -> None:
    pan = J("pan_tilt", "revolute", "base", "camera", axis=(0.0, 1.0, 0.0), limits=(0.3, 0.8))
    robot = load(written(tmp_path, "arm", [*PX150, pan]))
    camera = robot.frames(robot.joint_values(np.zeros(5), 0.0))["camera"]
    assert camera[0, 0] == pytest.approx(math.cos(0.3))
    assert "camera" not in robot.moving
    assert "Joint 'pan_tilt' is revolute and stays at 0.3 rad." in robot.require_arm().notes
    assert "Joint 'gripper' is continuous and stays at zero." in robot.require_arm().notes


@pytest.mark.parametrize(
    ("joints", "message"),
    [
        (PX100, r"arm.urdf has 4 axes \(waist, shoulder, elbow, wrist_angle\)"),
        (UR5, r"arm.urdf has 6 axes \(shoulder_pan, .*, wrist_3\); the closed-form"),
        (Z1, r"has 6 axes \(joint1, .*, joint6\).*If joint6 only opens .*, add --tool link05"),
        (Z1_WITH_JAW, r"has 6 axes \(joint1, .*, joint6\)"),
        (VX300S, r"has 6 axes \(waist, shoulder, elbow, forearm_roll, wrist_angle, wrist_rotate\)"),
        (ROLLS_TWICE, r"has 6 axes \(waist, shoulder, elbow, wrist_angle, wrist_rotate, sixth\)"),
        (
            [*UR5[:6], J("f", "fixed", "l6", "flange")],
            r"has 6 axes \(shoulder_pan, .*, wrist_3\); the closed-form",
        ),
        (
            two_sided(PX150[:5]),
            r"has 2 arms of 5 joints each, which begin at left_waist, right_waist.* --tool",
        ),
        (
            two_sided(PX100[:4]),
            r"has 2 arms of 4 joints each, which begin at left_waist, right_waist.* --tool",
        ),
        (
            [*Z1, J("rh_r1", "revolute", "link06", "trigger", limits=(-3.14, 3.14))],
            r"has 6 axes \(joint1, .*, joint6\)",
        ),
        ([J("rail", "prismatic", "floor", "base"), *PX150[:5]], r"has 6 axes \(rail \(prismatic\)"),
        ([J("rail", "prismatic", "floor", "base"), *PX100], r"has 5 axes \(rail \(prismatic\)"),
    ],
    ids=["PincherX-100", "UR5", "Z1", "Z1 with a jaw", "ViperX-300 6DOF", "a sixth axis",
         "a flange on six", "two arms", "two fingers", "a trigger", "six with a rail",
         "five with a rail"],
)  # fmt: skip
def test_the_number_of_axes_is_the_first_reason(
    tmp_path: Path, joints: list[J], message: str
) -> None:
    path = written(tmp_path, "arm", joints)
    with pytest.raises(RobotDescriptionError, match=message):
        load(path).require_arm()
    described = find_robot(Settings(), path, None)
    slides_or_several = any(word in message for word in ("prismatic", "has 2 arms"))
    if slides_or_several:
        assert described.robot.arm is None
        assert [n for n in described.notes if n.startswith("Joints only. ") and "arm.urdf" in n]
    else:
        # A server drives its tool with the kinematics of other arms.
        assert described.robot.require_arm().kinematics.freedoms == 6


def test_limit_that_is_wrong_is_the_reason_not_the_number_of_axes(tmp_path: Path) -> None:
    joints = [*PX150[:5], J("sixth", "revolute", "hand", "link6", limits=(2.0, 1.0))]
    described = find_robot(Settings(), written(tmp_path, "arm", joints), None)
    assert described.robot.arm is None
    assert "The limits of axis 6 (sixth) are 2 to 1 rad" in described.notes[-1]


@pytest.mark.parametrize(
    "jaw",
    [
        J("gripper_joint_1", "revolute", "hand", "f", limits=(-6.28, 6.28)),
        J("gripper", "continuous", "hand", "f", limits=None),
        J("motor_6", "revolute", "hand", "moving_jaw", limits=(-0.2, 2.0)),
        J("joint_6", "prismatic", "hand", "link_6", limits=(0.0, 0.02)),
    ],
    ids=["a wide range", "an endless one", "the link's name", "it slides"],
)
def test_a_last_joint_in_a_row_can_be_a_finger(tmp_path: Path, jaw: J) -> None:
    arm = load(written(tmp_path, "arm", [*PX150[:5], jaw])).require_arm()
    assert arm.chain.names == tuple(joint.name for joint in PX150[:5])


def test_a_joint_beside_a_tool_frame_is_a_finger(tmp_path: Path) -> None:
    frame = J("end", "fixed", "hand", "end_effector_link", (0.1, 0.0, 0.0))
    sixth = J("joint_6", "revolute", "hand", "link_6")
    arm = load(written(tmp_path, "arm", [*PX150[:5], frame, sixth])).require_arm()
    assert arm.default_tool == "end_effector_link"
    assert arm.gripper.moves


@pytest.mark.parametrize(
    ("links", "tools"),
    [
        (("flange", "tool0"), ["tool0", "flange"]),
        (("tool0", "gripper_tcp"), ["gripper_tcp", "tool0"]),
        (("panda_hand", "panda_hand_tcp"), ["panda_hand_tcp"]),
        (("px/ee_gripper_link", "px/fingers_link"), ["px/ee_gripper_link"]),
        (("left_tool0", "left_camera"), ["left_tool0"]),
        (("tool_frame", "end_effector_link"), ["end_effector_link", "tool_frame"]),
        (("ee_link", "tool0"), ["ee_link", "tool0"]),
        (("wedge", "mytool0"), ["mytool0"]),
    ],
)
def test_tool_is_the_link_that_its_maker_calls_so(
    tmp_path: Path, links: tuple[str, str], tools: list[str]
) -> None:
    one, other = links
    frames = [J("a", "fixed", "hand", one), J("b", "fixed", one, other, (0.1, 0.0, 0.0))]
    arm = load(written(tmp_path, "arm", [*PX150[:5], *frames])).require_arm()
    assert list(arm.tools) == tools
    assert arm.default_tool == tools[0]


def test_a_wheeled_base_does_not_hide_its_arm(tmp_path: Path) -> None:
    wheels = [
        J(f"wheel_{n}", "continuous", "base", f"w{n}", axis=(0.0, 1.0, 0.0)) for n in range(4)
    ]
    arm = load(written(tmp_path, "rover", [*wheels, *PX150])).require_arm()
    assert arm.chain.names == ("waist", "shoulder", "elbow", "wrist_angle", "wrist_rotate")


def test_the_loops_of_a_stewart_platform_are_refused(tmp_path: Path) -> None:
    path = written(tmp_path, "stewart", stewart())
    message = (
        r"stewart.urdf, line \d+: link 'plate' is the child of 6 joints \(ball_1, .*closed loops"
    )
    with pytest.raises(RobotDescriptionError, match=r"(?i)" + message):
        find_robot(Settings(), path, None)
    four_bar = [
        J("a", "revolute", "ground", "crank"),
        J("b", "revolute", "crank", "coupler"),
        J("c", "revolute", "coupler", "rocker"),
        J("d", "revolute", "rocker", "ground"),
    ]
    path = written(tmp_path, "four_bar", four_bar)
    with pytest.raises(
        RobotDescriptionError, match=r"link 'ground' is its own ancestor, by joint 'd'"
    ):
        find_robot(Settings(), path, None)


def test_an_so101_is_idealised_once_and_everything_works_on_it(tmp_path: Path) -> None:
    path = written(tmp_path, "so101", SO101)
    arm = load(path).require_arm()
    chain = arm.chain
    (note,) = [note for note in arm.notes if "exact arm" in note]
    assert "0.00021 deg" in note
    rng = np.random.default_rng(3)
    for q in rng.uniform(chain.lower, chain.upper, size=(300, 5)):
        solutions = inverse(chain, project(chain, forward(chain, q), within_limits=False).T)
        exact = [s for s in solutions if s.exact]
        assert max(s.position_error for s in exact) < 1e-14
        # Its own posture is found again; with the rounding of the file the error was 35 mrad.
        assert min(np.abs(np.sin(0.5 * (s.q - q))).max() for s in exact) < 1e-9
    robot = yourdfpy.URDF.load(str(path), load_meshes=False, build_scene_graph=True)
    moved = []
    for q in rng.uniform(chain.lower, chain.upper, size=(100, 5)):
        robot.update_cfg(dict(zip(chain.names, q.tolist(), strict=True)) | {"gripper": 0.0})
        T = arm.T_base_shoulder @ forward(chain, q)
        moved.append(T[:3, 3] - robot.get_transform("gripper_frame_link")[:3, 3])
    # Less than the last digit of the file, and the amount in the note.
    assert np.linalg.norm(moved, axis=1).max() < 1.5e-6
    assert "about 0.001 mm" in note


ARM = Path(__file__).resolve().parent / "arms" / "pincherx_150.urdf"


@pytest.mark.parametrize(
    "beginning",
    [
        '\n\n<?xml version="1.0"?>\n',
        '  <?xml version="1.0" encoding="utf-8"?>\n',
        '<?xml version="0.0" ?>\n',
        "<?xml version='1.0' encoding='UTF-8' standalone='yes'?>",
        "\n",
        "",
    ],
)
def test_a_wrong_xml_declaration_is_overlooked(tmp_path: Path, beginning: str) -> None:
    robot = load(saved(tmp_path, beginning + rail()))
    assert robot.driven == ("slide_left", "slide_right")
    # The line of a fault is still that of the file.
    broken = beginning + rail().replace('lower="-0.5"', 'lower="low"', 1)
    line = broken[: broken.index('"low"')].count("\n") + 1
    with pytest.raises(RobotDescriptionError, match=f"line {line}: lower='low'"):
        load(saved(tmp_path, broken))


def test_elements_of_other_programs_need_no_declared_prefix(tmp_path: Path) -> None:
    text = rail().replace(
        "</robot>",
        '<gazebo><controller:base name="c"><interface:position name="p"/></controller:base>'
        "</gazebo></robot>",
    )
    assert load(saved(tmp_path, text)).driven == ("slide_left", "slide_right")
    xacro = rail().replace("</robot>", '<xacro:unknown name="x"/></robot>')
    with pytest.raises(RobotDescriptionError, match="unbound prefix"):
        load(saved(tmp_path, xacro))


def test_limits_of_followers_that_exclude_each_other_are_left_out_with_a_note(
    tmp_path: Path,
) -> None:
    # A follower in the opposite direction, with the limits of the driven joint.
    text = rail().replace('joint="slide_right"/>', 'joint="slide_right" multiplier="-1"/>')
    text = text.replace('lower="-0.5" upper="0.3"', 'lower="0.1" upper="0.3"')
    robot = load(saved(tmp_path, text))
    joints = robot.joint_group
    assert (joints.lower[1], joints.upper[1]) == (0.1, 0.3)
    (note,) = robot.joint_notes
    assert "follow 'slide_right' exclude each other" in note
    # Limits that only narrow each other count, as before.
    narrow = rail().replace('upper="0.3"', 'upper="0.1"')
    robot = load(saved(tmp_path, narrow.replace('upper="0.1"', 'upper="0.3"', 1)))
    assert robot.joint_group.upper[1] == 0.1
    assert robot.joint_notes == ()


@pytest.mark.parametrize("speed", ['velocity="0"', ""])
def test_an_arm_without_speeds_turns_slowly_and_says_so(tmp_path: Path, speed: str) -> None:
    text = ARM.read_text(encoding="utf-8")
    assert 'velocity="' in text
    start = text.index('velocity="')
    end = text.index('"', start + len('velocity="')) + 1
    path = saved(tmp_path, text[:start] + speed + text[end:])
    robot = load(path)
    arm = robot.require_arm()
    expected = np.array(load(ARM).require_arm().chain.speed)
    expected[0] = SLOW_TURN
    np.testing.assert_array_equal(arm.chain.speed, expected)
    assert any("no speed in its file; it gets 1 rad/s" in note for note in robot.joint_notes)
