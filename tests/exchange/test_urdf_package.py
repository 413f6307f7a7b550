"""Tests of the exported ROS package: complete, reproducible, and loaded by other programs.

Other programs get the unpacked files unchanged.
"""

from __future__ import annotations

import io
import xml.etree.ElementTree as ET
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
import yourdfpy

from katana450.arm.robot.robot import Robot
from katana450.cli.main import main
from katana450.errors import RobotDescriptionError
from katana450.extensions.export.urdf_package import package_files
from katana450.resources import URDF_PATH


@pytest.fixture(scope="module")
def folder(ros_package: Path) -> Path:
    return ros_package


@pytest.fixture(scope="module")
def urdf(folder: Path) -> Path:
    return folder / "urdf" / "katana450.urdf"


def test_yourdfpy_finds_the_same_robot_in_it(urdf: Path) -> None:
    packaged = yourdfpy.URDF.load(str(urdf))
    original = yourdfpy.URDF.load(str(URDF_PATH))
    assert set(packaged.link_map) == set(original.link_map)
    pose = np.full(len(original.actuated_joint_names), 0.1)
    for robot in (packaged, original):
        robot.update_cfg(pose)
    # Coordinates in OBJ are rounded to 0.01 mm.
    np.testing.assert_allclose(packaged.scene.bounds, original.scene.bounds, atol=0.51e-5)
    for link in original.link_map:
        np.testing.assert_allclose(packaged.get_transform(link), original.get_transform(link))
    for name, joint in original.joint_map.items():
        assert packaged.joint_map[name].limit == joint.limit
        assert packaged.joint_map[name].mimic == joint.mimic


def test_every_mesh_is_in_the_package_and_of_a_format_that_all_read(
    folder: Path, urdf: Path
) -> None:
    names = [mesh.get("filename", "") for mesh in ET.parse(urdf).getroot().iter("mesh")]
    files = [name.removeprefix("package://katana450_description/") for name in names]
    assert {Path(file).suffix for file in files} == {".obj"}
    paths = {f"meshes/{path.name}" for path in (folder / "meshes").iterdir()}
    assert paths == {*files, "meshes/materials.mtl"}


def test_visuals_have_the_surfaces_and_colours_of_the_arm(urdf: Path, katana: Robot) -> None:
    """Compare with OBJ and MTL as trimesh reads them, and with the URDF."""
    root = ET.parse(urdf).getroot()
    written = {
        element.get("name"): [float(part) for part in color.get("rgba", "").split()]
        for element in root.iterfind("material")
        for color in element.iterfind("color")
    }
    for link in katana.links:
        (element,) = (e for e in root.iterfind("link") if e.get("name") == link.name)
        visuals = element.findall("visual")
        assert len(visuals) == len(link.shapes)
        for visual, shape in zip(visuals, link.shapes, strict=True):
            mesh, material = visual.find("geometry/mesh"), visual.find("material")
            assert mesh is not None
            assert material is not None
            name = mesh.get("filename", "").rpartition("/")[2]
            loaded: Any = trimesh.load_mesh(urdf.parents[1] / "meshes" / name, process=False)
            assert loaded.visual.material.name == material.get("name")
            np.testing.assert_allclose(
                loaded.visual.material.diffuse[:3] / 255.0, shape.material.colour, atol=0.005
            )
            np.testing.assert_allclose(
                written[material.get("name")], [*shape.material.colour, 1.0], atol=1e-4
            )
            area = trimesh.Trimesh(shape.vertices, shape.faces, process=False).area
            assert loaded.area == pytest.approx(area, rel=2e-3)
            np.testing.assert_allclose(
                loaded.bounds,
                [shape.vertices.min(axis=0), shape.vertices.max(axis=0)],
                atol=0.51e-5,
            )


def test_the_manifest_leaves_licence_and_person_to_be_stated(folder: Path) -> None:
    manifest = ET.parse(folder / "package.xml").getroot()
    assert manifest.findtext("name") == "katana450_description"
    assert manifest.findtext("license") == "TODO: License declaration"
    assert manifest.findtext("maintainer") == "TODO: Maintainer"
    assert "project(katana450_description NONE)" in (folder / "CMakeLists.txt").read_text()


FOREIGN = """<robot name="two">
  <material name="red"><color rgba="1 0 0 1"/></material>
  <link name="base">
    <visual name="look"><origin xyz="0 0 1"/>
      <geometry><mesh filename="both.glb" scale="2 2 2"/></geometry></visual>
    <visual><geometry><mesh filename="both.glb"/></geometry><material name="red"/></visual>
    <collision><geometry><mesh filename="both.glb"/></geometry></collision>
    <collision><geometry><mesh filename="plain.STL"/></geometry></collision>
  </link>
  <link name="frame"/><link name="moving"/>
  <joint name="a" type="fixed"><parent link="base"/><child link="frame"/></joint>
  <joint name="b" type="continuous"><parent link="base"/><child link="moving"/></joint>
</robot>"""


def test_meshes_of_another_robot_keep_their_places_names_and_colours(tmp_path: Path) -> None:
    scene: Any = trimesh.Scene()
    kinds: Any = trimesh.visual
    for name, colour, x in (("red", (0, 0, 255, 255), 0.0), ("blue", (0, 255, 0, 255), 1.0)):
        box: Any = trimesh.creation.box(extents=[0.2, 0.2, 0.2])
        box.apply_translation([x, 0.0, 0.0])
        material = kinds.material.PBRMaterial(name=name, baseColorFactor=colour)
        box.visual = kinds.TextureVisuals(material=material)
        scene.add_geometry(box, node_name=name + str(x), geom_name=name + str(x))
    scene.export(tmp_path / "both.glb")
    trimesh.creation.box(extents=[1.0, 1.0, 1.0]).export(tmp_path / "plain.stl")
    (tmp_path / "plain.stl").rename(tmp_path / "plain.STL")
    (tmp_path / "two.urdf").write_text(FOREIGN)
    ((_, content),) = package_files(tmp_path / "two.urdf").items()
    zipfile.ZipFile(io.BytesIO(content)).extractall(tmp_path)
    path = tmp_path / "two_description" / "urdf" / "two.urdf"
    root = ET.parse(path).getroot()
    (base, frame, moving) = root.findall("link")
    visuals = base.findall("visual")
    assert [visual.get("name") for visual in visuals] == ["look", "look_1", None, None]
    assert [visual.find("origin") is not None for visual in visuals] == [True, True, False, False]
    painted = [m.get("name") for visual in visuals for m in visual.findall("material")]
    # The material of the URDF overrides that of the mesh, as in other programs.
    assert (sorted(painted[:2], key=str), painted[2:]) == (["blue", "red_2"], ["red", "red"])
    assert [mesh.get("scale") for mesh in base.iterfind("visual/geometry/mesh")] == [
        "2 2 2", "2 2 2", None, None,
    ]  # fmt: skip
    colours = {m.get("name"): m[0].get("rgba") for m in root.findall("material")}
    assert colours == {"red": "1 0 0 1", "red_2": "0 0 1 1", "blue": "0 1 0 1"}
    assert frame.find("inertial/mass[@value='0']") is not None
    assert moving.find("inertial") is None
    loaded = yourdfpy.URDF.load(str(path))
    np.testing.assert_allclose(loaded.scene.bounds, [[-0.2, -0.2, -0.1], [2.2, 0.2, 1.2]])
    assert [mesh.get("filename") for mesh in base.iterfind("collision/geometry/mesh")] == [
        f"package://two_description/meshes/{tmp_path.name}_{name}"
        for name in ("both.obj", "plain.obj")
    ]


def test_the_same_robot_gives_the_same_bytes_and_no_file_twice() -> None:
    one, two = package_files(URDF_PATH), package_files(URDF_PATH)
    assert one == two
    names = zipfile.ZipFile(io.BytesIO(one["katana450_description.zip"])).namelist()
    assert len(names) == len(set(names))


@pytest.mark.parametrize("kind", ["glb", "urdf"])
@pytest.mark.parametrize("suffix", [".glb", ".dae", ".xyz"])
def test_an_unreadable_mesh_is_reported_by_name(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], suffix: str, kind: str
) -> None:
    mesh = tmp_path / f"arm{suffix}"
    mesh.write_bytes(b"junk")
    path = tmp_path / "x.urdf"
    path.write_text(f'<robot name="x"><link name="a">{MESH.format(mesh.name)}</link></robot>')
    assert main(["export", kind, "--urdf", str(path), "--out", str(tmp_path / "out")]) == 1
    assert capsys.readouterr().err == (
        f"katana450: {mesh} cannot be read as a mesh: the file is corrupt, or {suffix} is not "
        "supported. Export it again, for example as binary STL.\n"
    )


MESH = '<visual><geometry><mesh filename="{}"/></geometry></visual>'


def test_robot_without_its_mesh_is_refused(tmp_path: Path) -> None:
    no_mesh = MESH.format("no.stl")
    (tmp_path / "x.urdf").write_text(f'<robot name="x"><link name="a">{no_mesh}</link></robot>')
    with pytest.raises(RobotDescriptionError, match=r"Nothing was written.*no\.stl"):
        package_files(tmp_path / "x.urdf")
