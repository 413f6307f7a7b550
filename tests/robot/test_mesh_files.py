"""Mesh files that a robot description names: where they are, and the unit of COLLADA."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from katana450.arm.robot.loader import load

DAE = """<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset>{unit}<up_axis>Z_UP</up_axis></asset>
<library_geometries><geometry id="g"><mesh><source id="p"><float_array id="a" count="12">
0 0 0 50 0 0 0 40 0 0 0 30</float_array><technique_common>
<accessor source="#a" count="4" stride="3"><param name="X" type="float"/>
<param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="4"><input semantic="VERTEX" source="#v" offset="0"/>
<p>0 2 1 0 1 3 1 2 3 0 3 2</p></triangles></mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node><translate>100 0 0</translate>
<instance_geometry url="#g"/></node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>"""

ROBOT = """<robot name="r"><link name="base"/><link name="c">
<visual>{geometry}</visual><collision>{geometry}</collision></link>
<joint name="j" type="continuous"><parent link="base"/><child link="c"/><axis xyz="0 0 1"/></joint>
</robot>"""


@pytest.mark.parametrize(
    ("unit", "scale", "factor"),
    [
        ('<unit name="millimeter" meter="0.001"/>', "", 1e-3),
        ("<unit meter = '0.0254' name='inch'/>", "", 0.0254),
        ('<unit meter="1e-2"/>', 'scale="2 3 -1"', 0.01),
        ("<unit/>", "", 1.0),
        ("", 'scale="0.001 0.001 0.001"', 0.001),
    ],
)
def test_unit_of_collada_and_scale_both_apply(
    tmp_path: Path, unit: str, scale: str, factor: float
) -> None:
    (tmp_path / "part.dae").write_text(DAE.format(unit=unit))
    geometry = f'<geometry><mesh filename="part.dae" {scale}/></geometry>'
    (tmp_path / "r.urdf").write_text(ROBOT.format(geometry=geometry))
    link = load(tmp_path / "r.urdf").links[1]
    corners = np.array([[100, 0, 0], [150, 0, 0], [100, 40, 0], [100, 0, 30]])
    wanted = factor * corners * ((2, 3, -1) if "3" in scale else (1, 1, 1))
    (surface,) = link.shapes
    (shape,) = link.collisions
    for vertices in (surface.vertices, shape.mesh.vertices):
        for end in ("min", "max"):
            np.testing.assert_allclose(
                getattr(vertices, end)(axis=0), getattr(wanted, end)(axis=0), atol=1e-9
            )


@pytest.mark.parametrize("name", ["package://pack/meshes/part.stl", "../meshes/part.stl"])
@pytest.mark.parametrize("folder", [".", "urdf", "meshes"])
def test_relative_path_of_a_robot_finds_the_same_meshes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, folder: str
) -> None:
    package = tmp_path / "pack"
    (package / "meshes").mkdir(parents=True)
    (package / "urdf").mkdir()
    trimesh.creation.box((0.1, 0.1, 0.1)).export(package / "meshes/part.stl")
    geometry = f'<geometry><mesh filename="{name}"/></geometry>'
    (package / "urdf/r.urdf").write_text(ROBOT.format(geometry=geometry))
    monkeypatch.chdir(package / folder)
    relative = {".": "urdf/r.urdf", "urdf": "r.urdf", "meshes": "../urdf/r.urdf"}[folder]
    robot = load(Path(relative))
    assert robot.notes == ()
    assert len(robot.links[1].collisions) == 1
