"""The zip of a ROS package: whole, the same each time, and read by others."""

from __future__ import annotations

import io
import xml.etree.ElementTree as ET
import zipfile
from pathlib import Path

import mujoco
import numpy as np
import pytest
import yourdfpy

from app.errors import RobotDescriptionError
from app.exchange.urdf_package import package_files
from robot_description import URDF_PATH
from tests.exchange.conftest import GANTRY


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    ((name, content),) = package_files(URDF_PATH, "MIT").items()
    assert name == "katana450_description.zip"
    where = tmp_path_factory.mktemp("ros")
    zipfile.ZipFile(io.BytesIO(content)).extractall(where)
    return where / "katana450_description"


def test_yourdfpy_finds_the_same_robot_in_it(folder: Path) -> None:
    there = yourdfpy.URDF.load(
        str(folder / "urdf" / "katana450.urdf"),
        filename_handler=lambda fname: str(folder.parent / fname.removeprefix("package://")),
        load_collision_meshes=True,
    )
    here = yourdfpy.URDF.load(str(URDF_PATH), load_collision_meshes=True)
    assert set(there.link_map) == set(here.link_map)
    pose = np.full(len(here.actuated_joint_names), 0.1)
    for robot in (there, here):
        robot.update_cfg(pose)
    np.testing.assert_allclose(there.scene.bounds, here.scene.bounds, atol=1e-12)
    for link in here.link_map:
        np.testing.assert_allclose(there.get_transform(link), here.get_transform(link))
    for name, joint in here.joint_map.items():
        assert there.joint_map[name].limit == joint.limit
        assert there.joint_map[name].mimic == joint.mimic


def test_mujoco_weighs_the_same_robot(folder: Path) -> None:
    """It takes package:// for the folder of the URDF's own package."""
    text = (folder / "urdf" / "katana450.urdf").read_text()
    (folder / "here.urdf").write_text(text.replace("package://katana450_description/", ""))
    there = mujoco.MjModel.from_xml_path(str(folder / "here.urdf"))
    here = mujoco.MjModel.from_xml_path(str(URDF_PATH))
    assert there.nbody == here.nbody
    assert there.nmesh == here.nmesh
    np.testing.assert_allclose(there.body_mass, here.body_mass)
    np.testing.assert_allclose(there.jnt_range, here.jnt_range)


def test_its_manifest_is_one(folder: Path) -> None:
    manifest = ET.parse(folder / "package.xml").getroot()
    assert manifest.findtext("name") == "katana450_description"
    assert manifest.findtext("license") == "MIT"
    assert "project(katana450_description NONE)" in (folder / "CMakeLists.txt").read_text()


def test_the_same_robot_gives_the_same_bytes_and_no_mesh_twice() -> None:
    one, two = package_files(URDF_PATH), package_files(URDF_PATH)
    assert one == two
    names = zipfile.ZipFile(io.BytesIO(one["katana450_description.zip"])).namelist()
    assert len(names) == len(set(names))
    meshes = {m.get("filename") for m in ET.parse(URDF_PATH).getroot().iter("mesh")}
    assert len([name for name in names if "/meshes/" in name]) == len(meshes)


def test_a_robot_without_meshes_has_a_package_too() -> None:
    ((name, content),) = package_files(GANTRY).items()
    assert name == "gantry_2_description.zip"
    assert (
        "gantry_2_description/urdf/gantry_2.urdf" in zipfile.ZipFile(io.BytesIO(content)).namelist()
    )


NO_MESH = '<visual><geometry><mesh filename="no.stl"/></geometry></visual>'


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "is not a robot description"),
        ("<robot/>", "names no robot"),
        ('<other name="x"/>', "names no robot"),
        (f'<robot name="x"><link name="a">{NO_MESH}</link></robot>', "no mesh at .*no.stl"),
    ],
)
def test_what_is_no_robot_is_refused(tmp_path: Path, text: str, said: str) -> None:
    (tmp_path / "x.urdf").write_text(text)
    with pytest.raises(RobotDescriptionError, match=said):
        package_files(tmp_path / "x.urdf")
