"""Robots of which shapes are missing or look wrong: estimated contacts, and what drivers read."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
import trimesh

from katana450.arm.control.commands import commands as cmd
from katana450.arm.robot.loader import load
from katana450.assembly.robot_session import DescribedRobot, find_robot
from katana450.settings import Settings
from tests.general_arms.driven import begun, settled
from tests.general_arms.links_of_arms import ur5e
from tests.robot.hands import column
from tests.robot.urdf_files import saved

SHAPE = re.compile(r"<(cylinder|box) [^>]*/>")
ESTIMATED = "Contacts are estimated, because shapes cannot be read:"
SHAPED = re.compile("<(visual|collision)>.*?</(visual|collision)>")
SHAPELESS = "Contacts are estimated, because the file gives no shapes:"
MISSING = '<mesh filename="package://ur/none.stl"/>'


def read(tmp_path: Path, text: str) -> DescribedRobot:
    return find_robot(Settings(), saved(tmp_path, text), None)


STICKS = "'base_link', 'upper_arm', 'forearm', 'wrist_1', 'wrist_2'"


@pytest.mark.parametrize(
    ("text", "cautions"),
    [
        (
            SHAPE.sub(MISSING, ur5e()),
            ("Not checked for contacts: 'shoulder', 'wrist_3'.", f"{ESTIMATED} {STICKS}."),
        ),
        (SHAPED.sub("", ur5e()), (f"{SHAPELESS} {STICKS}.",)),
    ],
    ids=["without its meshes", "without shapes"],
)
def test_arm_without_shapes_stops_before_the_table_and_says_what_is_estimated(
    tmp_path: Path, text: str, cautions: tuple[str, ...]
) -> None:
    robot, session, notes = read(tmp_path, text)
    assert robot.cautions == cautions
    assert set(robot.cautions) <= set(notes)
    for elbow in (0.0, 1.0):
        state = settled(session, begun(session), [cmd.Joint(2, -np.pi / 2.0)])
        state = settled(session, state, [cmd.Joint(3, elbow)])
        state = settled(session, state, [cmd.Joint(2, 0.7)])
        frames = robot.frames(robot.joint_values(state.q, 0.0))
        lowest = min(frames[name][2, 3] for name in ("forearm", "wrist_1", "wrist_2", "wrist_3"))
        assert state.q[1] < 0.69
        assert 0.03 < lowest < 0.1
        (finding,) = state.findings
        assert finding.parts is not None
        assert finding.parts[1] == "table"


@pytest.mark.parametrize(
    ("lost", "dropped", "estimated"),
    [
        ("visual|collision", "", True),
        # What is drawn replaces a collision shape, and without one a drawing is not needed.
        ("collision", "", False),
        ("visual", "", False),
        ("visual", "collision", True),
    ],
)
@pytest.mark.parametrize("mesh", ["none.stl", "bad.stl"])
def test_only_a_link_of_unknown_shape_is_estimated(
    tmp_path: Path, lost: str, dropped: str, mesh: str, estimated: bool
) -> None:
    if mesh == "bad.stl" and lost == "collision":
        # A file that cannot be read was checked for contacts, so its link is estimated.
        estimated = True
    (tmp_path / "bad.stl").write_bytes(b"no mesh")
    text = re.sub("<collision>.*?</collision>", "", ur5e()) if dropped else ur5e()
    forearm = re.search('<link name="forearm">.*?</link>', text)
    assert forearm is not None
    replaced = re.sub(
        f"<({lost})>.*?</({lost})>",
        lambda shape: SHAPE.sub(f'<mesh filename="{mesh}"/>', shape[0]),
        forearm[0],
    )
    robot, session, _ = read(tmp_path, text.replace(forearm[0], replaced))
    assert robot.cautions == (f"{ESTIMATED} 'forearm'.",) * estimated
    assert session.world is not None
    assert "forearm" in [part.name for part in session.world.parts]


def test_mechanism_without_its_meshes_keeps_its_table(tmp_path: Path) -> None:
    robot, session, _ = read(tmp_path, SHAPE.sub(MISSING, column()))
    assert robot.cautions == (
        "Not checked for contacts: 'beam'.",
        f"{ESTIMATED} 'base'.",
    )
    assert session.world is not None
    (table,) = (part for part in session.world.parts if part.name == "table")
    assert table.T_mover_shape[0][2, 3] == 0.0


def test_sizes_and_places_that_look_wrong_are_named(tmp_path: Path) -> None:
    large = ur5e().replace('radius="0.037" length="0.06"', 'radius="37" length="60"')
    robot, _, _ = read(tmp_path, large)
    assert robot.cautions == ("'wrist_3' is 74 m long: check the unit of its shapes.",)
    deep = ur5e().replace('xyz="-0.196 0.0 0.007"', 'xyz="0 4 0"')
    robot, _, _ = read(tmp_path, deep)
    (overlap,) = robot.cautions
    assert re.match(r"'forearm' and 'table' overlap by \d+ mm where the robot starts", overlap)
    far = ur5e().replace('xyz="-0.425 0.0', 'xyz="-425.0 0.0').replace('xyz="-0.425', 'xyz="-425.0')
    robot, _, _ = read(tmp_path, far)
    assert robot.cautions == (
        "'forearm' is 425 m from its parent 'upper_arm': check the origin of its joint.",
    )


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
