"""Test reading and setting the VRML world by name."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.session.session import Session
from katana450.arm.control.state.scene_objects import SceneObject, Shape
from katana450.arm.control.state.state import State
from katana450.arm.robot.arm_reader import MountedArm
from katana450.arm.robot.loader import load
from katana450.arm.robot.robot import Robot, bare
from katana450.assembly.robot_session import describe_robot
from katana450.errors import InputError
from katana450.extensions.export.vrml.vrml_files import initial_objects, world_of
from katana450.extensions.export.vrml.vrml_nodes import VrmlNodes
from katana450.maths.geometry import se3, so3
from katana450.resources import URDF_PATH
from katana450.server.api import requests
from katana450.settings import Settings
from tests.exchange.conftest import GANTRY
from tests.exchange.joint_rotations import THERE, rotation
from tests.exchange.vrml_reading import placed_nodes
from tests.robot.public_arms import PX150, J, written

TYPES = {"rotation": "SFRotation", "translation": "SFVec3f"}
"""Types of the fields that can be set: ISO/IEC 14772-1:1997, 6."""


@pytest.fixture(scope="module")
def rules(arm: MountedArm) -> Session:
    return Session(arm, np.array(Settings().ready))


@pytest.fixture(scope="module")
def nodes(robot: Robot, rules: Session) -> VrmlNodes:
    return VrmlNodes(robot, rules.environment)


@pytest.fixture(scope="module")
def state(rules: Session) -> State:
    cube = SceneObject("left/cube", Shape.BOX, (0.1, 0.1, 0.1), np.eye(4))
    beginning = rules.begin(rules.ready, 0.2, 0.0)
    return replace(beginning, objects=(cube, replace(cube, name="pan link")))


def setting(node: str, field: str, value: Any) -> requests.FieldSetting:
    return requests.FieldSetting(node=node, field=field, value=value)


def get(nodes: VrmlNodes, state: State, node: str, field: str) -> Any:
    (value,) = nodes.read(state, [requests.FieldName(node=node, field=field)])
    return value.value


def test_names_types_and_values_are_those_of_the_file(
    nodes: VrmlNodes, state: State, robot: Robot
) -> None:
    angles = robot.joint_values(state.q, state.gripper)
    file = world_of(robot, angles).named()
    world = {node.node: node for node in nodes.world(state).nodes}
    objects = {name for name, node in world.items() if node.of.startswith("object")}
    assert world.keys() - objects <= file.keys()
    assert not objects & file.keys()
    for name in world.keys() - objects:
        assert world[name].kind == file[name].kind
        for field in world[name].fields:
            assert field.type == TYPES[field.field]
            # The links in a file have their places with all joints at zero.
            if not world[name].of.startswith("link") or file[name].kind != "Transform":
                shown: Any = file[name].get(field.field)
                np.testing.assert_allclose(np.array(field.value), shown, rtol=0, atol=5e-5)
    # The server has every Transform of the file.
    assert {name for name, node in file.items() if node.kind == "Transform"} == {
        name for name, node in world.items() if node.kind == "Transform"
    } - objects
    # Names that are invalid or taken are changed.
    assert objects == {"left_cube", "pan_link_2"}


def test_export_has_the_objects_of_a_new_server_by_the_same_names(robot: Robot) -> None:
    session = describe_robot(Settings(), URDF_PATH, None).session
    state = session.begin(session.ready, 0.0, 0.0)
    angles = robot.joint_values(state.q, state.gripper)
    file = world_of(robot, angles, initial_objects(robot))
    named = {name: node for name, node in file.named().items() if node.kind == "Transform"}
    nodes = VrmlNodes(robot, session.environment).world(state).nodes
    world = {node.node: node for node in nodes}
    assert {"cup", "basin", "tcp", "flange"} <= world.keys()
    assert world.keys() == named.keys()
    # By the Transforms of the file, every link and object is where the server says, with z up.
    turn = se3.from_rotation_translation(so3.rotation_x(0.5 * np.pi), np.zeros(3))
    poses = {node.name: turn @ T for node, _, T in placed_nodes(file) if node.kind == "Transform"}
    for name, node in world.items():
        if not node.of.startswith("joint"):
            fields = {field.field: field.value for field in node.fields}
            x, y, z, angle = np.array(fields["rotation"]).tolist()
            T = se3.from_rotation_translation(
                so3.exp(angle * np.array((x, y, z))), np.array(fields["translation"])
            )
            np.testing.assert_allclose(T, poses[name], rtol=0, atol=1e-7, err_msg=name)


def test_fields_that_can_be_set_say_so(nodes: VrmlNodes, state: State, robot: Robot) -> None:
    """A field is settable if `set` takes its present value; that of a tool while it is in use."""
    tools = robot.require_arm().tools
    for node in nodes.world(state).nodes:
        for field in node.fields:
            used = replace(state, tool=node.node) if node.node in tools else state
            try:
                nodes.command(used, [setting(node.node, field.field, field.value)])
            except InputError:
                assert not field.settable, (node.node, field.field)
            else:
                assert field.settable, (node.node, field.field)
    settable = {
        node.node for node in nodes.world(state).nodes for field in node.fields if field.settable
    }  # fmt: skip
    joints = {*THERE, "finger_right_joint"}
    assert settable == {*joints, *tools, "left_cube", "pan_link_2"}


def test_tool_is_set_by_its_name(nodes: VrmlNodes, state: State, robot: Robot) -> None:
    """A position alone keeps the target of the rotation, as the handle does."""
    place, offset = [0.3, 0.1, 0.25], robot.require_arm().T_base_shoulder[:3, 3]
    command = nodes.command(state, [setting(state.tool, "translation", place)])
    assert isinstance(command, cmd.Position)
    # Commands are in {S}, in the shoulder.
    np.testing.assert_allclose(command.p, place - offset, rtol=0, atol=1e-15)
    turn = [0.0, 0.0, 1.0, 0.5]
    command = nodes.command(state, [setting(state.tool, "rotation", turn)])
    assert isinstance(command, cmd.Pose)
    now = robot.frames(robot.joint_values(state.q, state.gripper))[state.tool]
    np.testing.assert_allclose(command.T[:3, 3], now[:3, 3] - offset, rtol=0, atol=1e-15)
    np.testing.assert_allclose(command.T[:3, :3], so3.rotation_z(0.5), rtol=0, atol=1e-15)
    both = [setting(state.tool, "rotation", turn), setting(state.tool, "translation", place)]
    command = nodes.command(state, both)
    assert isinstance(command, cmd.Pose)
    np.testing.assert_allclose(command.T[:3, 3], place - offset, rtol=0, atol=1e-15)
    with pytest.raises(InputError, match="either joints or the tool"):
        nodes.command(state, [*both, setting("axis_2", "rotation", [0, 1, 0, -1.0])])


@settings(max_examples=50)
@given(st.dictionaries(st.sampled_from(sorted(THERE)), st.floats(-2.0, 2.0), min_size=1))
def test_setting_a_joint_is_a_motion_command(
    nodes: VrmlNodes, state: State, wanted: dict[str, float]
) -> None:
    command = nodes.command(
        state,
        [setting(node, "rotation", rotation(node, angle)) for node, angle in wanted.items()],
    )
    assert isinstance(command, cmd.SetAxes)
    assert dict(command.values) == {int(node[-1]): angle for node, angle in wanted.items()}
    # The length of the axis does not matter.
    huge = [setting(n, "rotation", [1e200 * x for x in rotation(n, 0)[:3]] + [a])
            for n, a in wanted.items()]  # fmt: skip
    assert nodes.command(state, huge) == command
    # The negative angle about the reversed axis of any length is the same rotation.
    turned = [setting(n, "rotation", [-2.0 * x for x in rotation(n, 0)[:3]] + [-a])
              for n, a in wanted.items()]  # fmt: skip
    again = nodes.command(state, turned)
    assert isinstance(again, cmd.SetAxes)
    assert dict(again.values) == dict(command.values)


def test_all_fields_of_a_message_are_one_command(nodes: VrmlNodes, state: State) -> None:
    command = nodes.command(
        state,
        [
            setting("axis_1", "rotation", [0, 0, 1, 0.1]),
            setting("left_cube", "translation", [0.3, 0.1, 0.0]),
            setting("left_cube", "rotation", [0, 0, 2, 0.5]),
            setting("axis_2", "rotation", [0, 1, 0, -1.0]),
            setting("finger_right_joint", "rotation", [0, 0, 1, 0.3]),
        ],
    )
    assert isinstance(command, cmd.Batch)
    turned, moved, spun, gripped = command.commands
    assert turned == cmd.SetAxes(((1, 0.1), (2, -1.0)))
    assert isinstance(moved, cmd.MoveObject)
    assert moved.R is None
    assert isinstance(spun, cmd.MoveObject)
    assert spun.R is not None
    np.testing.assert_allclose(spun.R, so3.rotation_z(0.5), rtol=0, atol=1e-15)
    assert gripped == cmd.Gripper(0.3)


@pytest.mark.parametrize(
    ("node", "field", "value", "reason"),
    [
        ("axis_9", "rotation", [0, 1, 0, 0.1], "no node 'axis_9'"),
        ("axis_2", "scale", [1, 1, 1], "is a Transform with rotation; it has no field 'scale'"),
        ("pan_link", "translation", [0, 0, 0], "not the tool frame of the arm and cannot be set"),
        ("flange", "translation", [0.3, 0, 0.2], "flange is not the tool frame .* Set tcp."),
        (
            "axis_2",
            "rotation",
            [1, 0, 0, 0.1],
            "axis_2 turns about 0 1 0 and cannot turn about 1 0 0",
        ),
        ("axis_2", "rotation", [0, 0, 0, 0.1], "cannot turn about 0 0 0"),
        ("axis_2", "rotation", [1e300, 1e300, 0, 0.1], "cannot turn about 1e"),
        ("axis_2", "rotation", [0, 1, 0], "SFRotation, which is 4 numbers"),
        ("axis_2", "rotation", [0, 1, 0, math.inf], "finite"),
        ("finger_left_joint", "rotation", [0, 0, -1, 0.1], "follows finger_right_joint. Set that"),
        ("left_cube", "translation", [0, 0, 5], "more than 2 m"),
        ("left_cube", "rotation", [0, 0, 0, 1], "an axis of length 0"),
    ],
)
def test_one_invalid_field_refuses_the_whole_set_request(
    nodes: VrmlNodes, state: State, node: str, field: str, value: Any, reason: str
) -> None:
    fine = setting("axis_1", "rotation", [0, 0, 1, 0.1])
    with pytest.raises(InputError, match=reason):
        nodes.command(state, [fine, setting(node, field, value)])


names = st.sampled_from(
    ["axis_1", "axis_5", "finger_right_joint", "finger_left_joint", "left_cube", "tcp", "pan_link",
     "pan_link_2", "axis", ""]
)  # fmt: skip
fields = st.sampled_from(["rotation", "translation", "x"])
numbers = st.floats() | st.sampled_from([0.0, 1.0, -1.0, 0.5])
anything = st.lists(numbers, min_size=1, max_size=5)


@settings(max_examples=100)
@given(st.lists(st.tuples(names, fields, anything), min_size=1, max_size=3))
def test_setting_any_field_gives_a_valid_command_or_a_refusal(
    nodes: VrmlNodes, rules: Session, state: State, changes: list[tuple[str, str, Any]]
) -> None:
    try:
        command = nodes.command(state, [setting(*change) for change in changes])
        # As the arm does before it takes a command, which can refuse a place far away.
        rules.check(command)
    except InputError:
        return
    after = rules.step(state, [command], 0.01)
    for node in nodes.world(after).nodes:
        for field in node.fields:
            assert np.isfinite(np.array(field.value)).all()


def test_held_object_is_not_moved_by_name(nodes: VrmlNodes, state: State) -> None:
    held = replace(state, objects=(replace(state.objects[0], held=True),))
    with pytest.raises(InputError, match="Open the gripper first"):
        nodes.command(held, [setting("left_cube", "translation", [0, 0, 0])])


def test_cup_is_not_moved_by_name_to_where_nothing_carries_it(robot: Robot) -> None:
    session = describe_robot(Settings(), URDF_PATH, None).session
    nodes = VrmlNodes(robot, session.environment)
    state = session.begin(session.ready, 0.0, 0.0)
    nodes.command(state, [setting("cup", "translation", [0.5, -0.5, 0.0])])
    with pytest.raises(InputError, match="nothing carries it there"):
        nodes.command(state, [setting("cup", "translation", [1.5, 0.0, 0.0])])


def test_arm_without_a_gripper_has_no_names_for_it(robot: Robot) -> None:
    stripped = bare(robot)
    arm = stripped.require_arm()
    session = Session(arm, arm.ready((0.0, -1.2, 1.5, 0.1, 0.0)))
    nodes = VrmlNodes(stripped, session.environment)
    names = {node.node for node in nodes.world(session.begin(session.ready, 0.0, 0.0)).nodes}
    assert "axis_5" in names
    assert not {name for name in names if "finger" in name or "gripper" in name}


def test_sliding_joint_has_a_translation_along_its_axis() -> None:
    gantry = load(GANTRY)
    session = Session(gantry.joint_group, np.zeros(3), travel=gantry.distance)
    nodes = VrmlNodes(gantry, session.environment)
    state = session.begin(np.array((0.2, 0.0, 0.0)), 0.0, 0.0)
    along = np.array((math.cos(0.3), math.sin(0.3), 0.0))
    np.testing.assert_allclose(get(nodes, state, "rail", "translation"), 0.2 * along, atol=1e-12)
    command = nodes.command(state, [setting("rail", "translation", (-0.1 * along).tolist())])
    assert isinstance(command, cmd.SetAxes)
    np.testing.assert_allclose(command.values, ((1, -0.1),), rtol=0, atol=1e-15)
    with pytest.raises(InputError, match=r"rail slides along 0\.955336 0\.29552 0"):
        nodes.command(state, [setting("rail", "translation", [0.1, 0.1, 0.1])])


def test_fixed_joint_has_its_value_and_cannot_be_set(tmp_path: Path) -> None:
    pan = J("pan", "revolute", "base", "camera", axis=(0.0, 1.0, 0.0), limits=(0.3, 0.8))
    robot = load(written(tmp_path, "arm", [*PX150, pan]))
    arm = robot.require_arm()
    session = Session(arm, arm.ready(Settings().ready))
    nodes = VrmlNodes(robot, session.environment)
    state = session.begin(session.ready, 0.0, 0.0)
    assert get(nodes, state, "pan", "rotation") == [0.0, 1.0, 0.0, 0.3]
    with pytest.raises(InputError, match="pan cannot move"):
        nodes.command(state, [setting("pan", "rotation", [0.0, 1.0, 0.0, 0.5])])
