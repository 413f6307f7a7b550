"""Tests of the exported MuJoCo model: loaded as shipped, it carries its weight and is the arm."""

from __future__ import annotations

import math
import re
import zipfile
from itertools import count
from pathlib import Path

import mujoco
import numpy as np
import pytest

from katana450.arm.robot.robot import Robot
from katana450.cli.main import main
from katana450.extensions.export.mjcf import SAG, keyframes
from katana450.extensions.programs.run.simulation import plan_script, run_by_clock
from katana450.extensions.programs.script.script import parse
from katana450.extensions.programs.script.script_files import library_file, script_text
from katana450.maths.geometry.arrays import FloatArray
from katana450.resources import URDF_PATH
from katana450.settings import Settings
from tests.exchange.conftest import GANTRY, GANTRY_POSE, POSES
from tests.general_arms.chain_urdf import chain_urdf
from tests.general_arms.links_of_arms import ur5e
from tests.general_arms.published_arms import PANDA

MASS = 9.271
"""[kg] Mass of the robot."""

OWN_ARM = Path(__file__).parents[2] / "examples" / "my_own_arm.urdf"

SEEN = 2
"""Group of the geometries that are seen and do not collide."""

LARGEST_ZIP = 1_200_000
"""[bytes]"""


SCENE = """
scene: 1
objects:
- name: door
  shape: box
  size: [200, 12, 150]
  pose: [450, 200, 5, 0, 0, 0]
  joint: {type: hinge, axis: z, origin: [-100, 0, 0], range: [0, 90], position: 30, friction: 0.05}
- {name: knob, shape: box, size: [12, 40, 60], pose: [530, 174, 40, 0, 0, 0], part_of: door}
- {name: post, shape: box, size: [20, 20, 100], pose: [360, 200, 0, 0, 0, 0]}
- {name: cube, shape: box, size: [40, 40, 40], pose: [400, -100, 0, 0, 0, 20], can_be_held: true}
- {name: cup, shape: cylinder, size: [32, 90], pose: [340, -260, 0, 0, 0, 0], can_be_held: true}
- {name: space, shape: box, size: [20, 40, 100], pose: [650, 0, 0, 0, 0, 0], zone: keep_out}
"""


def unpacked(where: Path, urdf: Path = URDF_PATH, *options: str) -> Path:
    """Return the folder of a model as the command writes it and unzip unpacks it."""
    assert main(["export", "mjcf", "--urdf", str(urdf), "--out", str(where), *options]) == 0
    (archive,) = where.glob("*.zip")
    assert archive.stat().st_size < LARGEST_ZIP
    zipfile.ZipFile(archive).extractall(where)
    return where / archive.stem.removesuffix("_mjcf")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return unpacked(tmp_path_factory.mktemp("mjcf"))


def begun(model: mujoco.MjModel, key: str = "home") -> mujoco.MjData:
    """Return the state at a keyframe."""
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key(key).id)
    mujoco.mj_forward(model, data)
    return data


@pytest.fixture(scope="module")
def model(folder: Path) -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_path(str(folder / "katana450.xml"))


def set_values(model: mujoco.MjModel, data: mujoco.MjData, values: dict[str, float]) -> None:
    for name, value in values.items():
        data.joint(name).qpos[0] = value
    mujoco.mj_kinematics(model, data)


def test_model_has_the_parts_of_the_arm(model: mujoco.MjModel, katana: Robot) -> None:
    assert {model.actuator(k).name for k in range(model.nu)} == set(katana.driven)
    assert {"tcp", "grasp", "flange"} <= {model.site(k).name for k in range(model.nsite)}
    assert [model.key(k).name for k in range(model.nkey)] == ["home", "zero"]
    assert model.neq == 1
    assert model.body_mass.sum() == pytest.approx(MASS, abs=1e-9)
    assert (model.dof_armature > 0.0).all()
    assert (model.dof_damping > 0.0).all()
    for name, joint in katana.joints.items():
        np.testing.assert_allclose(model.joint(name).range, (joint.lower, joint.upper))
    # Neighbours, which overlap at their hinges, and the pairs that never meet.
    assert model.nexclude > 20


def test_every_link_is_where_our_kinematics_have_it(model: mujoco.MjModel, katana: Robot) -> None:
    data = mujoco.MjData(model)
    random = np.random.default_rng(450)
    for _ in range(50):
        pose = [
            random.uniform(katana.joints[name].lower, katana.joints[name].upper)
            for name in katana.driven
        ]
        values = katana.values(pose)
        set_values(model, data, values)
        frames = katana.frames(values)
        for link, T in frames.items():
            body = data.site(link) if link in sites(model) else data.body(link)
            np.testing.assert_allclose(body.xpos, T[:3, 3], atol=1e-9, err_msg=link)
            np.testing.assert_allclose(body.xmat.reshape(3, 3), T[:3, :3], atol=1e-9)


def test_surfaces_are_where_ours_are(model: mujoco.MjModel, katana: Robot) -> None:
    """MuJoCo moves each mesh into the frame of its inertia; its geometry brings it back."""
    data = mujoco.MjData(model)
    values = katana.values(POSES[1])
    set_values(model, data, values)
    frames = katana.frames(values)
    for link in katana.links:
        if not link.shapes:
            continue
        T = frames[link.name]
        ours = np.concatenate([s.vertices @ T[:3, :3].T + T[:3, 3] for s in link.shapes])
        theirs = np.concatenate(
            [
                corners(model, data, number)
                for number in range(model.ngeom)
                if model.geom_bodyid[number] == model.body(link.name).id
                and model.geom_group[number] == SEEN
            ]
        )
        np.testing.assert_allclose(theirs.min(axis=0), ours.min(axis=0), atol=1.5e-5)
        np.testing.assert_allclose(theirs.max(axis=0), ours.max(axis=0), atol=1.5e-5)


def corners(model: mujoco.MjModel, data: mujoco.MjData, geom: int) -> FloatArray:
    """Return the vertices (n, 3) [m] of a geometry that is a mesh."""
    mesh = model.geom_dataid[geom]
    start, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
    vertices = model.mesh_vert[start : start + count]
    placed: FloatArray = vertices @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]
    return placed


def sites(model: mujoco.MjModel) -> set[str]:
    return {model.site(k).name for k in range(model.nsite)}


@pytest.mark.parametrize("key", ["home", "zero"])
def test_keyframes_are_postures_without_contact(
    model: mujoco.MjModel, katana: Robot, key: str
) -> None:
    data = begun(model, key)
    values = keyframes(katana)[key]
    for name in katana.joints:
        assert data.joint(name).qpos[0] == values[name]
    for name in katana.driven:
        assert data.actuator(name).ctrl[0] == values[name]
    assert data.ncon == 0


@pytest.mark.parametrize("key", ["home", "zero"])
def test_arm_holds_itself_for_five_seconds(model: mujoco.MjModel, key: str) -> None:
    """At rest no joint sags by more than the promised `SAG`."""
    data = begun(model, key)
    start, tool = data.qpos.copy(), data.site("tcp").xpos.copy()
    sag = drop = 0.0
    while data.time < 5.0:
        mujoco.mj_step(model, data)
        sag = max(sag, float(np.abs(data.qpos - start).max()))
        drop = max(drop, float(np.linalg.norm(data.site("tcp").xpos - tool)))
    print(f"{key}: sag {1e3 * sag:.3f} mrad, tool {1e3 * drop:.3f} mm")
    # When the weight comes on, the joints swing a little further.
    assert 0.0 < sag < 1.5 * SAG
    assert drop < 2e-3
    assert float(np.abs(data.qpos - start).max()) < SAG
    assert float(np.abs(data.qvel).max()) < 1e-6


@pytest.mark.long
def test_drives_follow_the_circle(model: mujoco.MjModel, katana: Robot) -> None:
    """The actuators, given the joint angles of the demo, follow with a small lag."""
    plan = plan_script(parse(script_text(library_file("circle"))), URDF_PATH)
    states = run_by_clock(plan).states
    data = mujoco.MjData(model)
    first = katana.joint_values(states[0].q, states[0].gripper)
    set_values(model, data, first)
    worst = 0.0
    steps = round(1.0 / Settings().rate / model.opt.timestep)
    for state in states[:300]:
        values = katana.joint_values(state.q, state.gripper)
        for name in katana.driven:
            data.actuator(name).ctrl[0] = values[name]
        for _ in range(steps):
            mujoco.mj_step(model, data)
        worst = max(
            worst, *(abs(float(data.joint(name).qpos[0]) - values[name]) for name in values)
        )
    assert worst < 0.02


def test_fingers_move_together(model: mujoco.MjModel) -> None:
    data = begun(model)
    data.actuator("finger_right_joint").ctrl[0] = -0.3
    while data.time < 1.0:
        mujoco.mj_step(model, data)
    right, left = (float(data.joint(f"finger_{side}_joint").qpos[0]) for side in ("right", "left"))
    assert right == pytest.approx(-0.3, abs=2e-3)
    assert left == pytest.approx(right, abs=2e-3)


def test_scene_has_a_floor(folder: Path) -> None:
    model = mujoco.MjModel.from_xml_path(str(folder / "scene.xml"))
    assert model.geom("floor").type[0] == mujoco.mjtGeom.mjGEOM_PLANE
    data = begun(model)
    assert data.ncon == 0


def test_scene_of_a_file_has_its_objects_and_their_joints(tmp_path: Path) -> None:
    """They rest, and a torque beyond its friction opens the door to the end of its range."""
    (tmp_path / "scene.yaml").write_text(SCENE, encoding="utf-8")
    folder = unpacked(tmp_path, URDF_PATH, "--scene", str(tmp_path / "scene.yaml"))
    model = mujoco.MjModel.from_xml_path(str(folder / "scene.xml"))
    data, door = begun(model), model.joint("parts of door")
    assert data.joint(door.id).qpos[0] == pytest.approx(math.radians(30.0))
    assert door.range == pytest.approx([0.0, math.radians(90.0)], abs=1e-5)
    places = {name: data.body(name).xpos.copy() for name in ("cube", "cup")}
    assert places["cube"] == pytest.approx([0.4, -0.1, 0.0])
    assert model.body("cup").mass[0] == pytest.approx(0.0614, abs=1e-4)
    assert not any("space" in model.geom(number).name for number in range(model.ngeom))
    for torque, angle in ((0.049, 30.0), (0.2, 90.0)):
        data.qfrc_applied[door.dofadr[0]] = torque
        mujoco.mj_step(model, data, 3000)
        assert math.degrees(data.joint(door.id).qpos[0]) == pytest.approx(angle, abs=0.2)
    for name, place in places.items():
        assert data.body(name).xpos == pytest.approx(place, abs=1e-4)


def test_only_mjcf_has_the_scene_of_a_file(tmp_path: Path) -> None:
    options = ["export", "glb", "--out", str(tmp_path), "--scene", "scene.yaml"]
    assert main(options) == 1


def test_another_mechanism_is_a_model_too(tmp_path: Path, gantry: Robot) -> None:
    """It has sliding, endless and following joints, primitive shapes, and no mass."""
    model = mujoco.MjModel.from_xml_path(str(unpacked(tmp_path, GANTRY) / "gantry_2.xml"))
    data = mujoco.MjData(model)
    values = gantry.values(GANTRY_POSE)
    set_values(model, data, values)
    for link, T in gantry.frames(values).items():
        np.testing.assert_allclose(data.body(link).xpos, T[:3, 3], atol=1e-9, err_msg=link)
    assert model.neq == 2
    assert [model.key(k).name for k in range(model.nkey)] == ["home", "zero"]


def test_an_arm_without_masses_holds_itself_too(tmp_path: Path) -> None:
    """Its URDF states none, although it has collision shapes."""
    model = mujoco.MjModel.from_xml_path(str(unpacked(tmp_path, OWN_ARM) / "my_own_arm.xml"))
    data = begun(model)
    start = data.qpos.copy()
    while data.time < 1.0:
        mujoco.mj_step(model, data)
    assert float(np.abs(data.qpos - start).max()) < SAG


def weighed(urdf: str, masses: list[float], efforts: list[float]) -> str:
    """Return ``urdf`` with the masses [kg] of its links with shapes, and efforts [N m]."""
    link, joint = count(), count()

    def inertial(match: re.Match[str]) -> str:
        mass = masses[next(link)]
        moments = " ".join(f'{name}="{0.01 * mass}"' for name in ("ixx", "iyy", "izz"))
        return (
            f'{match[0]}<inertial><mass value="{mass}"/>'
            f'<inertia {moments} ixy="0" ixz="0" iyz="0"/></inertial>'
        )

    urdf = re.sub(r'<link name="[^"]+">', inertial, urdf)
    return re.sub(r'effort="[^"]*"', lambda _: f'effort="{efforts[next(joint)]}"', urdf)


UR5 = weighed(
    # Thick wrists, so that links which are no neighbours overlap.
    ur5e().replace('radius="0.045" length="0.12"', 'radius="0.06" length="0.24"'),
    [4.0, 3.76, 8.06, 2.85, 1.37, 1.3, 0.365],
    [150.0, 150.0, 150.0, 28.0, 0.0, 28.0],
)
FRANKA = weighed(
    chain_urdf("panda", PANDA).replace('radius="0.02"', 'radius="0.06"'),
    [3.0, 3.0, 3.0, 2.5, 2.0, 1.5],
    [87.0] * 4 + [12.0] * 3,
)


@pytest.mark.parametrize(
    ("text", "home", "forces"),
    [
        # Without an effort: twice the weight that the joint carries.
        (UR5, (0.0, -np.pi / 2, -np.pi / 2), [150.0, 150.0, 150.0, 28.0, None, 28.0]),
        (FRANKA, (0.0, -np.pi / 4, 0.0), [87.0] * 4 + [12.0] * 3),
    ],
    ids=["ur5", "panda"],
)
def test_other_arms_hold_themselves_at_home(
    tmp_path: Path, text: str, home: tuple[float, ...], forces: list[float | None]
) -> None:
    """Links that overlap there do not push each other away, and forces are limited."""
    (tmp_path / "arm.urdf").write_text(text)
    scene = unpacked(tmp_path, tmp_path / "arm.urdf") / "scene.xml"
    model = mujoco.MjModel.from_xml_path(str(scene))
    stated = [math.nan if force is None else force for force in forces]
    limits = np.where(np.isnan(stated), model.actuator_forcerange[:, 1], stated)
    assert (limits > 0.0).all()
    np.testing.assert_allclose(model.actuator_forcerange, np.column_stack((-limits, limits)))
    data = begun(model)
    start, speed = data.qpos.copy(), 0.0
    np.testing.assert_allclose(start[:3], home, atol=1e-9)
    while data.time < 5.0:
        mujoco.mj_step(model, data)
        speed = max(speed, float(np.abs(data.qvel).max()))
    assert float(np.abs(data.qpos - start).max()) < SAG
    assert speed < 0.1
