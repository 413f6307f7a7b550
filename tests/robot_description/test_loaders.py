"""The URDF as MuJoCo reads it, without help from this project."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import mujoco
import numpy as np
import pytest
import yourdfpy

from katana450.resources import URDF_PATH

LINKS_WITH_SHAPE = 10


@pytest.fixture(scope="module")
def model() -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_path(str(URDF_PATH))


@pytest.fixture(scope="module")
def robot() -> yourdfpy.URDF:
    return yourdfpy.URDF.load(str(URDF_PATH), load_meshes=False)


def test_mujoco_finds_every_link_and_joint(model: mujoco.MjModel, robot: yourdfpy.URDF) -> None:
    bodies = {model.body(k).name for k in range(1, model.nbody)}
    assert bodies == set(robot.link_map)
    joints = {model.joint(k).name: model.jnt_range[k] for k in range(model.njnt)}
    assert set(joints) == {n for n, j in robot.joint_map.items() if j.type != "fixed"}
    for name, limits in joints.items():
        limit = robot.joint_map[name].limit
        np.testing.assert_allclose(limits, (limit.lower, limit.upper), atol=1e-12)


def test_mujoco_places_every_link_where_yourdfpy_does(
    model: mujoco.MjModel, robot: yourdfpy.URDF
) -> None:
    data = mujoco.MjData(model)
    random = np.random.default_rng(450)
    for _ in range(20):
        q = {name: random.uniform(j.limit.lower, j.limit.upper) for name, j in moving(robot)}
        robot.update_cfg(np.array([q[name] for name in robot.actuated_joint_names]))
        q["finger_left_joint"] = q["finger_right_joint"]
        for name, angle in q.items():
            data.joint(name).qpos[0] = angle
        mujoco.mj_forward(model, data)
        for link in robot.link_map:
            pose = robot.get_transform(link, "base_link")
            np.testing.assert_allclose(data.body(link).xpos, pose[:3, 3], atol=1e-9)
            np.testing.assert_allclose(
                data.body(link).xmat.reshape(3, 3), pose[:3, :3], atol=1e-9, err_msg=link
            )


def moving(robot: yourdfpy.URDF) -> list[tuple[str, yourdfpy.Joint]]:
    """Return the joints by name that are neither fixed nor mimics."""
    return [(name, robot.joint_map[name]) for name in robot.actuated_joint_names]


def test_mujoco_takes_the_inertials_as_written(model: mujoco.MjModel, robot: yourdfpy.URDF) -> None:
    for link in robot.robot.links:
        if link.inertial is None:
            continue
        body = model.body(link.name)
        assert body.mass[0] == pytest.approx(link.inertial.mass)
        np.testing.assert_allclose(body.ipos, link.inertial.origin[:3, 3], atol=1e-12)
        principal = np.linalg.eigvalsh(link.inertial.inertia)
        np.testing.assert_allclose(np.sort(body.inertia), principal, rtol=1e-6)


def test_mujoco_couples_the_fingers(model: mujoco.MjModel) -> None:
    assert model.neq == 1
    coupled = {model.joint(int(model.eq_obj1id[0])).name, model.joint(int(model.eq_obj2id[0])).name}
    assert coupled == {"finger_right_joint", "finger_left_joint"}


def test_mujoco_reads_the_stl_files_as_shapes() -> None:
    """Load the files unchanged; the exported package is loaded in tests/exchange."""
    folder = URDF_PATH.parent / "stl"
    root = ET.Element("mujoco")
    ET.SubElement(root, "compiler", meshdir=str(folder))
    asset, world = ET.SubElement(root, "asset"), ET.SubElement(root, "worldbody")
    for path in sorted(folder.glob("*.stl")):
        ET.SubElement(asset, "mesh", name=path.stem, file=path.name, inertia="shell")
        ET.SubElement(world, "geom", type="mesh", mesh=path.stem)
    shaped = mujoco.MjModel.from_xml_string(ET.tostring(root, encoding="unicode"))
    assert (shaped.nmesh, shaped.ngeom) == (LINKS_WITH_SHAPE, LINKS_WITH_SHAPE)
    sizes = shaped.mesh_vert.reshape(-1, 3)
    assert 0.05 < np.ptp(sizes, axis=0).max() < 0.5


def test_a_dropped_arm_keeps_its_energy(model: mujoco.MjModel) -> None:
    """Check that energy is constant with free joints, gravity, no friction and no obstacles."""
    data = mujoco.MjData(model)
    model.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY
    model.opt.disableflags |= (
        mujoco.mjtDisableBit.mjDSBL_LIMIT
        | mujoco.mjtDisableBit.mjDSBL_EQUALITY
        | mujoco.mjtDisableBit.mjDSBL_CONTACT
    )
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    model.opt.timestep = 1e-3
    mujoco.mj_forward(model, data)
    start = data.energy.sum()
    while data.time < 0.3:
        mujoco.mj_step(model, data)
    assert np.isfinite(data.qpos).all()
    assert np.abs(data.qvel).max() > 1.0
    assert data.energy.sum() == pytest.approx(start, abs=1e-3)
