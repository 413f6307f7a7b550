"""Tests of the ROS 2 parts of the exported package: SRDF, ros2_control, launch files, colcon."""

from __future__ import annotations

import json
import math
import os
import runpy
import sys
import xml.etree.ElementTree as ET
import zipfile
from itertools import combinations
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
import xacro
import yaml

from katana450.arm.robot.collision import world_of
from katana450.arm.robot.robot import Robot
from katana450.cli.main import main
from katana450.extensions.export.rest import ADJACENT, excluded_pairs, home_of
from katana450.extensions.export.ros2_package import USED
from katana450.extensions.rosbridge import names
from katana450.maths.kinematics.forward import forward
from katana450.settings import Settings
from tests.exchange.conftest import GANTRY
from tests.exchange.tools import COLCON, PINOCCHIO, needs, needs_package, run

PACKAGE = "katana450_description"


@pytest.fixture(scope="module")
def folder(ros_package: Path) -> Path:
    return ros_package


@pytest.fixture(scope="module")
def srdf(folder: Path) -> ET.Element:
    return ET.parse(folder / "config" / "katana450.srdf").getroot()


def test_groups_are_the_arm_and_its_gripper(srdf: ET.Element, katana: Robot) -> None:
    arm = katana.require_arm()
    chains = {
        group.get("name"): dict(chain.attrib)
        for group in srdf.iterfind("group")
        for chain in group.iterfind("chain")
    }
    assert chains == {"arm": {"base_link": "base_link", "tip_link": "tcp"}}
    # The movable joints of the chain are the axes.
    tip = next(link for link in katana.links if link.name == "tcp")
    passed = [link.joint.name for link in katana.path_to(tip) if link.joint]
    assert tuple(passed) == arm.chain.names
    gripper = srdf.findall("group[@name='gripper']/joint")
    assert [joint.get("name") for joint in gripper] == ["finger_right_joint"]
    (passive,) = srdf.findall("passive_joint")
    assert passive.get("name") == "finger_left_joint"


def test_end_effector_hangs_on_a_link_of_the_arm(srdf: ET.Element, katana: Robot) -> None:
    (effector,) = srdf.findall("end_effector")
    tip = next(link for link in katana.links if link.name == "tcp")
    assert effector.get("parent_link") in {link.name for link in katana.path_to(tip)}
    assert (effector.get("group"), effector.get("parent_group")) == ("gripper", "arm")


def test_states_are_inside_limits_and_home_is_the_apps(srdf: ET.Element, katana: Robot) -> None:
    states = {
        (state.get("group"), state.get("name")): {
            str(joint.get("name")): float(joint.get("value", "nan"))
            for joint in state.iterfind("joint")
        }
        for state in srdf.iterfind("group_state")
    }
    assert set(states) == {
        *(("arm", name) for name in ("home", "zero")),
        *(("gripper", name) for name in ("zero", "open", "closed")),
    }
    for values in states.values():
        for name, value in values.items():
            katana.check(name, value)
    assert tuple(states["arm", "home"].values()) == pytest.approx(Settings.ready)
    assert states["gripper", "open"]["finger_right_joint"] == katana.require_arm().gripper.upper


def test_disabled_collisions_are_the_pairs_that_are_not_checked(
    srdf: ET.Element, katana: Robot
) -> None:
    disabled = {
        frozenset((str(each.get("link1")), str(each.get("link2"))))
        for each in srdf.iterfind("disable_collisions")
    }
    world, _ = world_of(katana)
    assert world is not None
    names = [part.name for part in world.parts]
    checked = {frozenset((names[a], names[b])) for a, b in world.pairs}
    assert checked
    assert not disabled & checked
    assert disabled | checked == {frozenset(pair) for pair in combinations(names, 2)}
    reasons = {frozenset(pair[:2]): pair[2] for pair in excluded_pairs(katana)}
    assert reasons[frozenset(("pan_link", "upper_arm_link"))] == ADJACENT
    assert reasons[frozenset(("base_link", "arm_base_link"))] == ADJACENT


def test_xacro_adds_a_mock_system_with_every_joint(folder: Path, katana: Robot) -> None:
    """The file is expanded by xacro itself, as ROS does."""
    text = xacro.process_file(str(folder / "urdf" / "katana450.control.xacro")).toxml()
    root = ET.fromstring(text)
    assert {link.get("name") for link in root.iterfind("link")} == {
        link.name for link in katana.links
    }
    (section,) = root.findall("ros2_control")
    assert section.findtext("hardware/plugin") == "mock_components/GenericSystem"
    joints = {str(joint.get("name")): joint for joint in section.iterfind("joint")}
    assert set(joints) == set(katana.joints)
    home = home_of(katana)
    for name, joint in joints.items():
        commanded = [each.get("name") for each in joint.iterfind("command_interface")]
        assert commanded == (["position"] if name in katana.driven else [])
        start = joint.findtext("state_interface[@name='position']/param[@name='initial_value']")
        assert float(start or "nan") == home[name]
    assert joints["finger_left_joint"].findtext("param[@name='mimic']") == "finger_right_joint"


def test_controllers_command_the_driven_joints(folder: Path, katana: Robot) -> None:
    parameters = yaml.safe_load((folder / "config" / "controllers.yaml").read_text())
    manager = parameters.pop("controller_manager")["ros__parameters"]
    assert manager["update_rate"] == 100
    assert set(parameters) == {"arm_controller", "gripper_controller"}
    assert all("type" in manager[name] for name in (*parameters, "joint_state_broadcaster"))
    arm, gripper = (parameters[name]["ros__parameters"] for name in parameters)
    assert [*arm["joints"], gripper["joint"]] == list(katana.driven)


def test_gripper_has_the_action_of_our_server(folder: Path) -> None:
    """The controller of this type serves `gripper_cmd` below its name."""
    parameters = yaml.safe_load((folder / "config" / "controllers.yaml").read_text())
    manager = parameters["controller_manager"]["ros__parameters"]
    name, _, action = names.GRIPPER.strip("/").partition("/")
    assert action == "gripper_cmd"
    assert manager[name]["type"] == "position_controllers/GripperActionController"
    assert names.FOLLOW.strip("/").partition("/")[0] in parameters
    assert "gripper_controllers" in (folder / "package.xml").read_text()


class Recorded:
    """A class of ROS that only keeps its arguments."""

    def __init__(self, *words: object, **named: object) -> None:
        self.words = words
        self.named = named


@pytest.mark.parametrize("name", ["display", "control"])
def test_launch_files_describe_their_nodes(
    folder: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    """They run with classes that record, because there is no ROS here."""
    modules: dict[str, dict[str, object]] = {
        "ament_index_python": {},
        "ament_index_python.packages": {"get_package_share_directory": lambda _: str(folder)},
        "launch": {"LaunchDescription": Recorded},
        "launch.substitutions": {"Command": Recorded},
        "launch_ros": {},
        "launch_ros.actions": {"Node": Recorded},
        "launch_ros.parameter_descriptions": {"ParameterValue": Recorded},
    }
    for module, values in modules.items():
        made = ModuleType(module)
        made.__dict__.update(values)
        monkeypatch.setitem(sys.modules, module, made)
    launched = runpy.run_path(str(folder / "launch" / f"{name}.launch.py"))
    (nodes,) = launched["generate_launch_description"]().words
    started = {node.named["package"] for node in nodes}
    assert started <= set(USED)
    (viewer,) = (node for node in nodes if node.named["package"] == "rviz2")
    assert Path(viewer.named["arguments"][1]).is_file()
    publisher = next(n for n in nodes if n.named["package"] == "robot_state_publisher")
    (parameters,) = publisher.named["parameters"]
    (described,) = parameters["robot_description"].words
    if name == "display":
        assert started == {"robot_state_publisher", "joint_state_publisher_gui", "rviz2"}
        assert described == (folder / "urdf" / "katana450.urdf").read_text(encoding="utf-8")
    else:
        spawned = [n.named["arguments"][0] for n in nodes if n.named["executable"] == "spawner"]
        assert spawned == ["joint_state_broadcaster", "arm_controller", "gripper_controller"]
        assert described.words == (["xacro ", str(folder / "urdf" / "katana450.control.xacro")],)


def test_manifest_names_what_the_launch_files_start(folder: Path) -> None:
    manifest = ET.parse(folder / "package.xml").getroot()
    assert tuple(each.text for each in manifest.iterfind("exec_depend")) == USED
    cmake = (folder / "CMakeLists.txt").read_text()
    for name in ("urdf", "meshes", "launch", "rviz", "config"):
        assert (folder / name).is_dir()
        assert name in cmake


def test_rviz_shows_the_robot_in_its_root(folder: Path, katana: Robot) -> None:
    shown = yaml.safe_load((folder / "rviz" / "display.rviz").read_text())["Visualization Manager"]
    assert shown["Global Options"]["Fixed Frame"] == katana.links[0].name
    (model,) = (each for each in shown["Displays"] if each["Name"] == "Robot")
    assert model["Description Topic"]["Value"] == "/robot_description"
    assert 0.5 < shown["Views"]["Current"]["Distance"] < 3.0


def test_a_mechanism_without_an_arm_has_one_group(tmp_path: Path, gantry: Robot) -> None:
    assert main(["export", "urdf", "--urdf", str(GANTRY), "--out", str(tmp_path)]) == 0
    zipfile.ZipFile(tmp_path / "gantry_2_description.zip").extractall(tmp_path)
    folder = tmp_path / "gantry_2_description"
    root = ET.parse(folder / "config" / "gantry_2.srdf").getroot()
    (group,) = root.findall("group")
    assert tuple(joint.get("name") for joint in group) == gantry.driven
    assert not root.findall("end_effector")
    parameters = yaml.safe_load((folder / "config" / "controllers.yaml").read_text())
    assert parameters["joints_controller"]["ros__parameters"]["joints"] == list(gantry.driven)
    xacro.process_file(str(folder / "urdf" / "gantry_2.control.xacro"))


@needs("check_urdf")
@pytest.mark.long
def test_check_urdf_accepts_it(folder: Path, katana: Robot) -> None:
    printed = run("check_urdf", folder / "urdf" / "katana450.urdf")
    assert "Successfully Parsed XML" in printed
    for link in katana.links:
        assert link.name in printed


PLACES = """
import json, sys
sys.path += sys.argv[1:3]
import numpy as np
import pinocchio as pin
model = pin.buildModelFromUrdf(sys.argv[3])
data = model.createData()
found = []
for values in json.loads(sys.argv[4]):
    q = pin.neutral(model)
    for name, value in values.items():
        joint = model.joints[model.getJointId(name)]
        q[joint.idx_q] = value
    pin.framesForwardKinematics(model, data, q)
    found.append({f.name: data.oMf[k].homogeneous.tolist() for k, f in enumerate(model.frames)})
mass = sum(inertia.mass for inertia in model.inertias)
print("\\n" + json.dumps([pin.__version__, mass, found]))
"""


@needs_package(PINOCCHIO)
@pytest.mark.long
def test_pinocchio_has_the_same_kinematics(tmp_path: Path, folder: Path, katana: Robot) -> None:
    arm = katana.require_arm()
    random = np.random.default_rng(450)
    postures = random.uniform(arm.chain.lower, arm.chain.upper, (50, 5))
    values = [arm.joint_values(q, 0.1) for q in postures]
    printed = run(
        sys.executable,
        "-c",
        PLACES,
        PINOCCHIO.file.parents[1] if PINOCCHIO.file else "",
        PINOCCHIO.folder,
        folder / "urdf" / "katana450.urdf",
        json.dumps(values),
        folder=tmp_path,
    )
    _, mass, found = json.loads(printed.splitlines()[-1])
    assert mass == pytest.approx(9.271, abs=1e-9)
    for q, each, places in zip(postures, values, found, strict=True):
        for link, T in katana.frames(each).items():
            np.testing.assert_allclose(places[link], T, atol=1e-9, err_msg=link)
        tool = arm.T_base_shoulder @ forward(arm.chain, q)
        np.testing.assert_allclose(places["tcp"], tool, atol=1e-9)
    assert math.isfinite(mass)


@needs(*COLCON)
@pytest.mark.long
def test_colcon_builds_the_package(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Debian's colcon and ament build it as shipped, and its files are installed."""
    workspace = folder.parents[1]
    monkeypatch.setenv("COLCON_HOME", os.fspath(workspace / ".colcon"))
    # Ament's modules are those of the Python of the system.
    monkeypatch.setenv("PATH", "/usr/bin:/bin")
    run("colcon", "build", folder=workspace, seconds=300.0)
    share = workspace / "install" / PACKAGE / "share" / PACKAGE
    for path in folder.rglob("*"):
        if path.is_file() and path.name != "CMakeLists.txt":
            assert (share / path.relative_to(folder)).read_bytes() == path.read_bytes()
    index = share.parent / "ament_index" / "resource_index" / "packages" / PACKAGE
    assert index.is_file()
