"""Other arms of the family, end to end: read, classified, solved, projected, served."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import yourdfpy

from katana450.arm.control.session.session import Session
from katana450.arm.control.state.scene_objects import SceneObject, Shape
from katana450.arm.robot.arm_reader import MountedArm
from katana450.arm.robot.collision import hand_of, world_of
from katana450.arm.robot.loader import load
from katana450.arm.robot.robot import Robot
from katana450.errors import RobotDescriptionError
from katana450.maths.collision.world import CollisionWorld
from katana450.maths.geometry import se3, so3
from katana450.maths.kinematics.arm import arm_of
from katana450.maths.kinematics.forward import forward
from katana450.resources import URDF_PATH
from katana450.settings import Settings
from tests.collision.distances import distances
from tests.robot.public_arms import PX150, urdf
from tests.robot.urdf_files import edited, saved

ROOT = Path(__file__).resolve().parents[2]
ARMS = Path(__file__).parent / "arms"
PINCHER, YOUBOT = ARMS / "pincherx_150.urdf", ARMS / "youbot_arm.urdf"


@pytest.fixture(params=[PINCHER, YOUBOT], ids=lambda path: path.stem)
def path(request: pytest.FixtureRequest) -> Path:
    return Path(request.param)


@pytest.fixture
def other(path: Path) -> MountedArm:
    return load(path).require_arm()


def test_the_pincher_is_that_of_its_manual() -> None:
    arm = load(PINCHER).require_arm()
    # The manual's home configuration and screw axes, in its base frame.
    M = se3.from_rotation_translation(np.eye(3), [0.358575, 0.0, 0.25457])
    np.testing.assert_allclose(arm.T_base_shoulder @ arm.chain.M, M, atol=1e-12)
    heights = -np.array([0.10457, 0.25457, 0.25457]) + arm.T_base_shoulder[2, 3]
    np.testing.assert_allclose(arm.chain.S[3, 1:4], heights, atol=1e-12)
    np.testing.assert_allclose(arm.chain.S[5, 1:4], [0.0, 0.05, 0.2], atol=1e-12)
    canonical = arm_of(arm.chain)
    assert canonical.l1 == pytest.approx(math.hypot(0.05, 0.15))
    assert canonical.shifts[1] == pytest.approx(-math.atan2(0.15, 0.05))
    assert (canonical.a, canonical.d, canonical.tilt) == (0.0, 0.0, 0.0)


def test_the_youbot_is_that_of_its_manual() -> None:
    arm = load(YOUBOT).require_arm()
    canonical = arm_of(arm.chain)
    lengths = [canonical.a, canonical.l1, canonical.l2, canonical.l3]
    assert lengths == pytest.approx([0.033, 0.155, 0.135, 0.2175])
    assert canonical.d == 0.0
    assert canonical.signs[0] == -1.0
    assert canonical.signs[1] == -canonical.signs[2] == canonical.signs[3]
    np.testing.assert_allclose(arm.T_base_shoulder[:3, 3], [0.0, 0.0, 0.147], atol=1e-15)
    assert list(arm.tools) == ["tip"]
    assert arm.notes == ("Joint 'left' is assumed to be a gripper joint; 'tip' is the tool.",)
    assert arm.fingers == {"left": (1.0, 0.0), "right": (1.0, 0.0)}
    assert (arm.gripper.lower, arm.gripper.upper) == (0.0, 0.0115)


@pytest.mark.parametrize("path", [URDF_PATH, PINCHER, YOUBOT], ids=lambda path: path.stem)
def test_the_chain_agrees_with_yourdfpy(path: Path) -> None:
    robot, urdf = load(path), yourdfpy.URDF.load(str(path), load_meshes=False)
    arm = robot.require_arm()
    rng = np.random.default_rng(3)
    for q in rng.uniform(arm.chain.lower, arm.chain.upper, size=(30, 5)):
        values = robot.joint_values(q, float(rng.uniform(arm.gripper.lower, arm.gripper.upper)))
        urdf.update_cfg({name: values[name] for name in urdf.actuated_joint_names})
        for tool in arm.tools:
            T = arm.T_base_shoulder @ forward(arm.chain_to(tool), q)
            np.testing.assert_allclose(T, urdf.get_transform(tool), atol=1e-12)


def test_ready_posture_has_room_to_move(other: MountedArm) -> None:
    chain = other.chain
    q = other.ready(Settings().ready)
    assert (q > chain.lower).all()
    assert (q < chain.upper).all()
    tool = other.T_base_shoulder @ forward(chain, q)
    assert tool[0, 3] > 0.1
    assert abs(tool[1, 3]) < 1e-12


def test_links_without_shapes_are_drawn_as_rods() -> None:
    robot = load(YOUBOT)
    bodies = {body.name: body for body in robot.links}
    (rod,) = bodies["upper_arm"].visuals
    np.testing.assert_allclose(rod.mesh.bounds[:, 2], [0.0, 0.155], atol=1e-9)
    (box,) = bodies["turret"].visuals
    assert box.colour == (255, 102, 0)
    np.testing.assert_allclose(box.mesh.extents, [0.1, 0.08, 0.06], atol=1e-12)
    np.testing.assert_allclose(box.mesh.bounds.mean(axis=0), [0.0165, 0.0, 0.0], atol=1e-12)
    assert "foot" not in robot.moving
    assert "tip" in robot.moving


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('<axis xyz="1 0 0"/>', '<axis xyz="0 1 0"/>', "axis 5 must be perpendicular to axis 4"),
        ('<origin xyz="0.05 0 0.15"/>', '<origin rpy="0.1 0 0"/>', "axis 3 must be parallel"),
        ('<joint name="elbow" type="revolute">', '<joint name="elbow" type="fixed">', "five turn"),
        (
            '<joint name="elbow" type="revolute">',
            '<joint name="elbow" type="prismatic">',
            "only by turning axes",
        ),
        (
            '<joint name="elbow" type="revolute">',
            '<joint name="elbow" type="floating">',
            "elbow .fl",
        ),
        (
            '<limit lower="-2.0',
            '<mimic joint="shoulder"/><limit lower="-2.0',
            "'elbow' follows joint",
        ),
        (
            '<axis xyz="1 0 0"/>',
            '<axis xyz="nan 0 0"/>',
            "<axis> of <joint> 'wrist_rotate'",
        ),
        ('lower="-1.97222205" ', "", "shoulder"),
        (
            '<origin xyz="0.05 0 0.15"/>',
            '<origin xyz="0 inf 0"/>',
            "<origin> of <joint> 'elbow'",
        ),
        (
            '<origin xyz="0.05 0 0.15"/>',
            '<origin rpy="0.0008 0 0"/>',
            "write 1.570796 instead of 1.57",
        ),
    ],
)
def test_an_arm_of_another_kind_is_refused_with_the_reason(
    tmp_path: Path, old: str, new: str, message: str
) -> None:
    with pytest.raises(RobotDescriptionError, match=message):
        load(edited(tmp_path, PINCHER.read_text(), old, new)).require_arm()


def test_an_impossible_tool_is_refused() -> None:
    with pytest.raises(RobotDescriptionError, match="no link 'nose'; its links are base, turret"):
        load(PINCHER, "nose")
    with pytest.raises(RobotDescriptionError, match=r"is carried by 4 turning joints .* --tool"):
        load(PINCHER, "wrist")


def test_the_shoulder_frame_of_our_own_arm_needs_no_link(tmp_path: Path) -> None:
    own = load().require_arm()
    text = (ROOT / "robot_description" / "katana450.urdf").read_text(encoding="utf-8")
    path = edited(tmp_path, text, '"shoulder_frame"', '"elsewhere"')
    other = load(path).require_arm()
    np.testing.assert_allclose(other.T_base_shoulder, own.T_base_shoulder, atol=1e-15)
    np.testing.assert_allclose(so3.log(other.chain.M[:3, :3]), 0.0, atol=1e-15)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("no markup", "its XML is broken, syntax error: line 1"),
        ("<robot name='r'>\n <link name='a'>\n", "its XML is broken, no element found: line 3"),
        ("<sdf/>", "its outermost element is <sdf>, not <robot>"),
        ("<robot/>", "its <robot> has no name"),
        ("<?xml version='1.0' encoding='klingon'?><robot/>", "its XML is broken, unknown encoding"),
    ],
)
def test_invalid_robot_description_is_reported_plainly(
    text: str, message: str, tmp_path: Path
) -> None:
    with pytest.raises(RobotDescriptionError, match=message):
        load(saved(tmp_path, text))


def test_a_joint_behind_a_tool_without_name_is_reported(tmp_path: Path) -> None:
    more = """<link name="more"/><joint name="{}" type="revolute"><parent link="fingertips"/>
        <child link="more"/><limit lower="-1" upper="1" velocity="1" effort="1"/></joint></robot>"""
    path = tmp_path / "six.urdf"
    path.write_text(PINCHER.read_text().replace("</robot>", more.format("jaw")))
    (note,) = load(path).require_arm().notes
    assert note == "Joint 'jaw' is assumed to be a gripper joint; 'fingertips' is the tool."
    assert load(path, "fingertips").require_arm().notes == ()
    # A joint whose name does not suggest a finger is an axis, unless --tool names the tool.
    path.write_text(PINCHER.read_text().replace("</robot>", more.format("sixth")))
    with pytest.raises(RobotDescriptionError, match=r"has 6 axes .* add --tool fingertips"):
        load(path).require_arm()
    assert load(path, "fingertips").require_arm().gripper.moves


BOX = '<link name="{0}"><{1}><geometry><box size="{2}"/></geometry></{1}></link>'
THICK = 0.01
"""[m] Thickness of a finger along its direction of motion."""


@pytest.fixture
def arm_path(tmp_path: Path) -> Path:
    """Return the file of a PincherX-150 with boxes for its fingers and its forearm."""
    text = urdf("arm", PX150)
    sizes = {"left": f"0.04 {THICK} 0.02", "right": f"0.04 {THICK} 0.02", "upper": "0.03 0.03 0.03"}
    for link, size in sizes.items():
        text = text.replace(f'<link name="{link}"/>', BOX.format(link, "collision", size))
    arm_path = tmp_path / "arm.urdf"
    arm_path.write_text(text, encoding="utf-8")
    return arm_path


@pytest.fixture
def robot(arm_path: Path) -> Robot:
    return load(arm_path)


@pytest.fixture
def arm(robot: Robot) -> MountedArm:
    return robot.require_arm()


@pytest.fixture
def world(robot: Robot) -> CollisionWorld:
    world, _ = world_of(robot)
    assert world is not None
    return world


def test_bodies_of_fingers_slide(arm_path: Path, arm: MountedArm, world: CollisionWorld) -> None:
    robot = yourdfpy.URDF.load(str(arm_path), load_meshes=False)
    rng = np.random.default_rng(1)
    for _ in range(20):
        q = rng.uniform(arm.chain.lower, arm.chain.upper)
        opened = float(rng.uniform(0.015, 0.037))
        robot.update_cfg(dict(zip(arm.chain.names, q, strict=True)) | {"left_finger": opened})
        T = world.linkage.poses(np.append(q, opened))
        for part in world.parts:
            expected = robot.get_transform(part.name)
            np.testing.assert_allclose(T[part.mover] @ part.T_mover_shape[0], expected, atol=1e-12)


def test_no_distance_changes_more_than_their_bodies_travel(
    robot: Robot, arm: MountedArm, world: CollisionWorld
) -> None:
    ball = se3.from_rotation_translation(np.eye(3), np.array([0.3, 0.0, 0.2]))
    scene_object = SceneObject("box", Shape.BOX, (0.02, 0.02, 0.02), ball, can_be_held=True)
    session = Session(arm, np.zeros(5), world, hand=hand_of(robot, world), objects=(scene_object,))
    around = session.world_at(session.begin(session.ready, 0.02, 0.0))
    assert around is not None
    pairs = np.arange(len(around.first))
    rng = np.random.default_rng(2)
    tightest = 0.0
    for _ in range(40):
        x = np.append(rng.uniform(-0.5, 0.5, 5), rng.uniform(0.015, 0.037))
        step = np.append(0.01 * rng.uniform(-1.0, 1.0, 5) * rng.integers(0, 2), 0.0)
        step[5] = rng.uniform(0.015, 0.037) - x[5]
        placed, moved = around.at(x), around.at(x + step)
        change = np.abs(distances(moved, pairs) - distances(placed, pairs))
        apart = distances(placed, pairs) > 0.0
        travel = around.travel(placed, x, x + step)
        assert (change <= travel + 2e-6)[apart].all()
        tightest = max(tightest, float((change / np.maximum(travel, 1e-6))[apart].max()))
    assert tightest > 0.5
