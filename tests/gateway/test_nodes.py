"""Test reading and setting the VRML world by name, over every channel."""

from __future__ import annotations

import json
import math
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from katana450.arm.control import commands as cmd
from katana450.arm.control.appearance import AppearanceTrait
from katana450.arm.control.scene_objects import SceneObject, Shape
from katana450.arm.control.session import Session
from katana450.arm.control.state import State
from katana450.arm.robot.bare import bare
from katana450.arm.robot.loader import load
from katana450.arm.robot.mounted_arm import MountedArm
from katana450.arm.robot.robot import Robot
from katana450.assembly.robot_session import describe_robot
from katana450.client import Client, RefusedError, connect
from katana450.errors import InputError
from katana450.extensions.export.placed_object import initial_objects
from katana450.extensions.export.vrml import world_of
from katana450.extensions.export.vrml_node import FIELDS, Node, World
from katana450.extensions.export.vrml_nodes import VrmlNodes
from katana450.maths.geometry import se3, so3
from katana450.resources import URDF_PATH
from katana450.server.api import answers, requests
from katana450.settings import Settings
from tests.browser.server import AppServer
from tests.exchange.conftest import GANTRY
from tests.gateway.client import ask
from tests.gateway.lines import Lines, post, speaking
from tests.robot.public_arms import PX150, J, written

THERE = {"axis_1": 0.4, "axis_2": -1.0, "axis_3": 1.3, "axis_4": 0.3, "axis_5": -0.5}
AXES = {"axis_1": (0, 0, 1), "axis_5": (1, 0, 0)}
"""Axes of the joints that do not turn about y."""


@pytest.fixture(scope="module")
def rules(arm: MountedArm) -> Session:
    return Session(arm, np.array(Settings().ready))


@pytest.fixture(scope="module")
def nodes(robot: Robot, rules: Session) -> VrmlNodes:
    return VrmlNodes(robot, rules.environment)


@pytest.fixture(scope="module")
def state(rules: Session) -> State:
    cube = SceneObject("left/cube", Shape.BOX, (0.1, 0.1, 0.1), np.eye(4))
    begun = rules.begin(rules.ready, 0.2, 0.0)
    return replace(begun, objects=(cube, replace(cube, name="pan link look")))


def setting(node: str, field: str, value: Any) -> requests.FieldSetting:
    return requests.FieldSetting(node=node, field=field, value=value)


def rotation(joint: str, angle: float) -> list[float]:
    return [*AXES.get(joint, (0, 1, 0)), angle]


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
            assert FIELDS[file[name].kind][field.field].value == field.type
            # The links in a file have their places with all joints at zero.
            if not world[name].of.startswith("link") or file[name].kind != "Transform":
                shown: Any = file[name].get(field.field)
                np.testing.assert_allclose(np.array(field.value), shown, rtol=0, atol=5e-5)
    # The server has every Transform and appearance of the file.
    for kinds in (("Transform",), ("Switch", "Material")):
        assert {name for name, node in file.items() if node.kind in kinds} == {
            name for name, node in world.items() if node.kind in kinds
        } - objects
    # Names that are invalid or taken are changed.
    assert {"left_cube", "left_cube_look", "pan_link_look_2", "pan_link_look_paint"} <= objects


def test_export_has_the_objects_of_a_new_server_by_the_same_names(robot: Robot) -> None:
    session = describe_robot(Settings(), URDF_PATH, None).session
    state = session.begin(session.ready, 0.0, 0.0)
    angles = robot.joint_values(state.q, state.gripper)
    file = world_of(robot, angles, None, initial_objects(robot))
    kinds = ("Transform", "Switch", "Material")
    named = {name: node for name, node in file.named().items() if node.kind in kinds}
    world = {
        node.node: node
        for node in VrmlNodes(robot, session.environment).world(state).nodes
        if node.kind in kinds
    }
    assert {"cup", "basin", "tcp", "flange", "cup_look", "cup_paint"} <= world.keys()
    assert world.keys() == named.keys()
    # By the Transforms of the file, every link and object is where the server says.
    poses = absolute_poses(file)
    for name, node in world.items():
        if node.kind == "Transform" and not node.of.startswith("joint"):
            fields = {field.field: field.value for field in node.fields}
            x, y, z, angle = np.array(fields["rotation"]).tolist()
            T = se3.from_rotation_translation(
                so3.exp(angle * np.array((x, y, z))), np.array(fields["translation"])
            )
            np.testing.assert_allclose(T, poses[name], rtol=0, atol=1e-7, err_msg=name)


def absolute_poses(world: World) -> dict[str, Any]:
    """Return the pose (4, 4) of each named Transform below the Transform that turns z up."""
    found = {}

    def field(node: Node, name: str, default: Any) -> Any:
        value = node.get(name)
        return default if value is None else value

    def visit(node: Node, T: Any) -> None:
        if node.kind == "Transform":
            *axis, angle = field(node, "rotation", (0.0, 0.0, 1.0, 0.0))
            T = T @ se3.from_rotation_translation(
                so3.exp(angle * np.array(axis)), field(node, "translation", (0.0, 0.0, 0.0))
            )
            found[node.name or ""] = T
        for child in field(node, "children", ()):
            if isinstance(child, Node):
                visit(child, T)

    upright = next(node for node in world.nodes if node.kind == "Transform")
    for child in field(upright, "children", ()):
        visit(child, np.eye(4))
    return found


def test_tool_is_set_by_its_name(nodes: VrmlNodes, state: State, robot: Robot) -> None:
    """A position alone keeps the target of the rotation, as the handle does."""
    place, offset = [0.3, 0.1, 0.25], robot.require_arm().T_base_shoulder[:3, 3]
    command = nodes.command(state, [setting(state.tool, "translation", place)])
    assert isinstance(command, cmd.MoveTool)
    # Commands are in {S}, in the shoulder.
    np.testing.assert_allclose(command.position, place - offset, rtol=0, atol=1e-15)
    turn = [0.0, 0.0, 1.0, 0.5]
    command = nodes.command(state, [setting(state.tool, "rotation", turn)])
    assert isinstance(command, cmd.SetPose)
    now = robot.frames(robot.joint_values(state.q, state.gripper))[state.tool]
    np.testing.assert_allclose(command.T[:3, 3], now[:3, 3] - offset, rtol=0, atol=1e-15)
    np.testing.assert_allclose(command.T[:3, :3], so3.rotation_z(0.5), rtol=0, atol=1e-15)
    both = [setting(state.tool, "rotation", turn), setting(state.tool, "translation", place)]
    command = nodes.command(state, both)
    assert isinstance(command, cmd.SetPose)
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
        [setting(each, "rotation", rotation(each, angle)) for each, angle in wanted.items()],
    )
    assert isinstance(command, cmd.SetAxes)
    assert dict(command.values) == {int(each[-1]) - 1: angle for each, angle in wanted.items()}
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
            setting("pan_link_paint", "diffuseColor", [1, 0, 0]),
            setting("finger_right_joint", "rotation", [0, 0, 1, 0.3]),
        ],
    )
    assert isinstance(command, cmd.Batch)
    turned, moved, spun, painted, gripped = command.commands
    assert turned == cmd.SetAxes(((0, 0.1), (1, -1.0)))
    assert isinstance(moved, cmd.MoveObject)
    assert moved.R is None
    assert isinstance(spun, cmd.MoveObject)
    assert spun.R is not None
    np.testing.assert_allclose(spun.R, so3.rotation_z(0.5), rtol=0, atol=1e-15)
    assert painted == cmd.SetAppearance("pan_link", AppearanceTrait.COLOUR, (1.0, 0.0, 0.0))
    assert gripped == cmd.SetGripper(0.3)
    shown = replace(
        state,
        appearance=state.appearance.having("pan_link", AppearanceTrait.COLOUR, (1.0, 0.0, 0.0)),
    )
    assert get(nodes, shown, "pan_link_paint", "diffuseColor") == [1.0, 0.0, 0.0]
    assert get(nodes, shown, "pan_link_look", "whichChoice") == 1.0


@pytest.mark.parametrize(
    ("node", "field", "value", "reason"),
    [
        ("axis_9", "rotation", [0, 1, 0, 0.1], "no node 'axis_9'"),
        ("axis_2", "scale", [1, 1, 1], "is a Transform with rotation; it has no field 'scale'"),
        ("pan_link", "translation", [0, 0, 0], "not the tool frame of the arm and cannot be set"),
        (
            "axis_2",
            "rotation",
            [1, 0, 0, 0.1],
            "axis_2 turns about 0 1 0 and cannot turn about 1 0 0",
        ),
        ("axis_2", "rotation", [0, 0, 0, 0.1], "cannot turn about 0 0 0"),
        ("axis_2", "rotation", [1e300, 1e300, 0, 0.1], "cannot turn about 1e"),
        ("axis_2", "rotation", [0, 1, 0], "SFRotation, which is 4 numbers"),
        ("axis_2", "rotation", 0.1, "SFRotation, which is 4 numbers"),
        ("axis_2", "rotation", [0, 1, 0, math.inf], "finite"),
        ("axis_2", "rotation", None, "has no default"),
        ("finger_left_joint", "rotation", [0, 0, -1, 0.1], "follows finger_right_joint. Set that"),
        ("left_cube", "translation", [0, 0, 5], "more than 2 m"),
        ("left_cube", "translation", None, "left/cube has no default"),
        ("left_cube", "rotation", [0, 0, 0, 1], "an axis of length 0"),
        ("pan_link_look", "whichChoice", [1, 0], "a number"),
        ("pan_link_look", "whichChoice", 7, "-1 for hidden"),
        ("pan_link_paint", "diffuseColor", [1, 0, 2], "0 to 1"),
        ("pan_link_paint", "transparency", [0.5], "a number"),
    ],
)
def test_one_invalid_field_refuses_the_whole_set_request(
    nodes: VrmlNodes, state: State, node: str, field: str, value: Any, reason: str
) -> None:
    fine = setting("axis_1", "rotation", [0, 0, 1, 0.1])
    with pytest.raises(InputError, match=reason):
        nodes.command(state, [fine, setting(node, field, value)])


names = st.sampled_from(
    ["axis_1", "axis_5", "finger_right_joint", "finger_left_joint", "left_cube", "pan_link_look",
     "pan_link_paint", "left_cube_paint", "base_link_look", "tcp", "pan_link", "axis", ""]
)  # fmt: skip
fields = st.sampled_from(
    ["rotation", "translation", "whichChoice", "diffuseColor", "transparency", "x"]
)
numbers = st.floats() | st.sampled_from([0.0, 1.0, -1.0, 0.5])
anything = st.none() | numbers | st.lists(numbers, min_size=1, max_size=5)


@settings(max_examples=100)
@given(st.lists(st.tuples(names, fields, anything), min_size=1, max_size=3))
def test_setting_any_field_gives_a_valid_command_or_a_refusal(
    nodes: VrmlNodes, rules: Session, state: State, changes: list[tuple[str, str, Any]]
) -> None:
    try:
        command = nodes.command(state, [setting(*each) for each in changes])
    except InputError:
        return
    rules.check(command)
    after = rules.step(state, [command], 0.01)
    for node in nodes.world(after).nodes:
        for each in node.fields:
            assert np.isfinite(np.array(each.value)).all()


def test_held_object_is_not_moved_by_name(nodes: VrmlNodes, state: State) -> None:
    held = replace(state, objects=(replace(state.objects[0], held=True),))
    with pytest.raises(InputError, match="Open the gripper first"):
        nodes.command(held, [setting("left_cube", "translation", [0, 0, 0])])


def test_cup_is_not_moved_by_name_to_where_nothing_carries_it(robot: Robot) -> None:
    session = describe_robot(Settings(), URDF_PATH, None).session
    nodes = VrmlNodes(robot, session.environment)
    begun = session.begin(session.ready, 0.0, 0.0)
    nodes.command(begun, [setting("cup", "translation", [0.5, -0.5, 0.0])])
    with pytest.raises(InputError, match="nothing carries it there"):
        nodes.command(begun, [setting("cup", "translation", [1.5, 0.0, 0.0])])


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
    np.testing.assert_allclose(command.values, ((0, -0.1),), rtol=0, atol=1e-15)
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


def arrived(lines: Lines, ticket: int) -> None:
    """Wait until the arm rests and its state includes the command of ``ticket``."""
    while (now := lines.answer(do="query"))["ticket"] < ticket or now["moving"]:
        time.sleep(0.02)


def all_joints(q: dict[str, float]) -> dict[str, Any]:
    (node, angle), *rest = q.items()
    more = [{"node": n, "field": "rotation", "value": rotation(n, a)} for n, a in rest]
    return {"node": node, "field": "rotation", "value": rotation(node, angle), "more": more}


def test_arm_is_driven_by_name_over_tcp(server: AppServer, arm: MountedArm) -> None:
    T_base_shoulder = arm.T_base_shoulder
    with speaking(server, "VR Sink") as lines:
        before = lines.answer(do="query")["q"]
        done = lines.answer(do="set", **all_joints(THERE))
        assert done["is"] == "done"
        soon = lines.answer(do="get", node="axis_1", field="rotation")["values"][0]["value"][3]
        # The arm is still moving, under its own limits.
        assert abs(soon - before[0]) < 0.1
        arrived(lines, done["ticket"])
        more = [{"node": name, "field": "rotation"} for name in THERE]
        values = lines.answer(do="get", node="tcp", field="translation", more=more)["values"]
        assert [each["node"] for each in values] == ["tcp", *THERE]
        tool = values[0]["value"]
        # The root's frame stands on the table, {S} is in the shoulder.
        T = T_base_shoulder @ np.array(lines.answer(do="query")["T"])
        np.testing.assert_allclose(tool, T[:3, 3], rtol=0, atol=1e-9)
        for each, (name, angle) in zip(values[1:], THERE.items(), strict=True):
            np.testing.assert_allclose(each["value"], rotation(name, angle), rtol=0, atol=1e-9)
        # The tool is set by its name too.
        place = [tool[0], tool[1], tool[2] + 0.01]
        done = lines.answer(do="set", node="tcp", field="translation", value=place)
        arrived(lines, done["ticket"])
        values = lines.answer(do="get", node="tcp", field="translation")["values"]
        np.testing.assert_allclose(values[0]["value"], place, rtol=0, atol=1e-6)
        lines.answer(do="set", **all_joints(THERE))
        # Either all fields are set or none.
        bad = all_joints({**THERE, "axis_1": 0.0})
        bad["more"][-1]["value"] = [0, 1, 0, 0.1]
        refused = lines.answer(do="set", **bad)
        assert refused["is"] == "refused"
        assert "axis_5 turns about 1 0 0" in refused["why"]
        assert lines.answer(do="query")["goal"][0] == THERE["axis_1"]
        # A stop also blocks commands by name.
        lines.answer(do="stop")
        stopped = lines.answer(do="set", node="axis_1", field="rotation", value=[0, 0, 1, 0])
        assert "clear the stop first" in stopped["why"]
        assert lines.clear_stop()["is"] == "done"
        arrived(lines, lines.answer(do="home")["ticket"])
        lines.answer(do="release_lease")


def test_appearance_and_objects_are_set_and_watched_by_name(server: AppServer) -> None:
    with speaking(server, "Painter") as lines:
        lines.answer(
            do="set", node="cup", field="translation", value=[0.3, 0.2, 0.0],
            more=[{"node": "cup_paint", "field": "diffuseColor", "value": [1, 0, 0]},
                  {"node": "pan_link_look", "field": "whichChoice", "value": -1}],
        )  # fmt: skip
        lines.say(
            do="watch", hz=20,
            fields=[{"node": "cup", "field": "translation"},
                    {"node": "cup_paint", "field": "diffuseColor"},
                    {"node": "pan_link_look", "field": "whichChoice"},
                    {"node": "axis_2", "field": "rotation"}],
        )  # fmt: skip
        wanted: list[Any] = [[0.3, 0.2, 0.0], [1.0, 0.0, 0.0], -1.0]
        values: list[Any] = []
        while values[:3] != wanted:
            state = lines.hear()
            values = [each["value"] for each in state.get("fields", ())]
        assert values[3] == [0.0, 1.0, 0.0, state["q"][1]]
        lines.say(do="watch", hz=0)
        nothing = lines.answer(do="watch", hz=5, fields=[{"node": "cups", "field": "translation"}])
        assert "no node 'cups'" in nothing["why"]
        for node, field in (("cup_paint", "diffuseColor"), ("pan_link_look", "whichChoice")):
            assert lines.answer(do="set", node=node, field=field, value=None)["is"] == "done"
        with connect(server.url, "Watcher") as watcher:
            # The answer arrives when the command is taken; the changed world follows.
            end = time.monotonic() + 5.0
            while painted(watcher):
                assert time.monotonic() < end
                time.sleep(0.02)
            with pytest.raises(RefusedError, match="Painter holds"):
                watcher.ask(requests.Set(node="pan_link_look", field="whichChoice", value=-1))
            assert not painted(watcher)
        lines.answer(do="release_lease")


def painted(client: Client) -> bool:
    world = client.query(answers.World)
    return any(
        field.value != 0.0
        for node in world.nodes
        for field in node.fields
        if field.field == "whichChoice"
    )


def test_names_work_over_http(server: AppServer) -> None:
    status, _, body = ask(f"{server.url}/api/v1/world")
    assert status == 200
    world = {node["node"]: node for node in json.loads(body)["nodes"]}
    assert {"axis_1", "pan_link_look", "pan_link_paint", "cup", "basin_paint"} <= world.keys()
    assert world["axis_2"]["fields"][0] == {
        "field": "rotation", "type": "SFRotation", "settable": True,
        "value": world["axis_2"]["fields"][0]["value"],
    }  # fmt: skip
    status, answer = post(server, do="set", node="axis_5", field="rotation", value=[1, 0, 0, 0.2])
    assert (status, answer["is"]) == (200, "done")
    status, answer = post(server, do="get", node="axis_5", field="rotation")
    assert (status, answer["is"]) == (200, "values")
    status, answer = post(server, do="set", node="axis_5", field="rotation", value="round")
    assert (status, answer["is"]) == (422, "refused")
    status, answer = post(server, do="release_lease")
    assert status == 200
