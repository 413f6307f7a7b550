"""Tests of the robot's tree: the same as in the URDF, as yourdfpy reads it."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import trimesh
import yourdfpy

from katana450.arm.robot.initial_camera import FIELD_OF_VIEW, camera
from katana450.arm.robot.loader import load
from katana450.arm.robot.robot import Robot
from katana450.errors import InputError, RobotDescriptionError
from katana450.extensions.export.files import distinct
from katana450.resources import URDF_PATH
from tests.exchange.conftest import GANTRY, POSES
from tests.robot.urdf_files import edited, saved

ARMS = Path(__file__).parents[1] / "robot" / "arms"


@pytest.mark.parametrize("path", [URDF_PATH, *sorted(ARMS.glob("*.urdf"))])
def test_links_are_placed_as_in_yourdfpy(path: Path) -> None:
    robot = load(path)
    urdf = yourdfpy.URDF.load(str(path), load_meshes=False, build_scene_graph=True)
    assert robot.notes == ()
    assert set(robot.driven) == set(urdf.actuated_joint_names)
    rng = np.random.default_rng(9)
    for _ in range(10):
        ends = [(robot.joints[n].lower, robot.joints[n].upper) for n in robot.driven]
        pose = [rng.uniform(max(low, -4.0), min(high, 4.0)) for low, high in ends]
        urdf.update_cfg(dict(zip(robot.driven, pose, strict=True)))
        frames = robot.frames(robot.values(pose))
        for link in urdf.link_map:
            np.testing.assert_allclose(frames[link], urdf.get_transform(link), atol=1e-12)


def test_mimic_of_a_mimic_follows_the_driven_joint(tmp_path: Path) -> None:
    direct = '<mimic joint="grip" multiplier="-0.1" offset="-0.04"/>'
    chained = '<mimic joint="grip too" multiplier="0.1" offset="-0.05"/>'
    gantry = load(edited(tmp_path, GANTRY.read_text(), direct, chained))
    assert gantry.driven == ("rail", "turn", "grip")
    values = gantry.values((0.1, 20.0, -0.5))
    assert values["grip too"] == pytest.approx(0.6)
    assert values["out"] == pytest.approx(0.1 * 0.6 - 0.05)
    T = gantry.frames(values)
    np.testing.assert_allclose(T["cart"][:3, 3], [0.1 * math.cos(0.3), 0.1 * math.sin(0.3), 0.085])
    slid = np.linalg.inv(T["right/finger"]) @ T["thumb"]
    np.testing.assert_allclose(slid[:3, 3], [0.0, 0.0, 0.16 - values["out"]], atol=1e-15)


def test_every_shape_is_there_with_its_material(katana: Robot) -> None:
    shapes = [shape for link in katana.links for shape in link.shapes]
    assert sum(len(shape.faces) for shape in shapes) == 48_942
    colours = {shape.material.name: shape.material.colour for shape in shapes}
    assert len(colours) == 12
    # sRGB beb4a1, within the rounding of light to eight bits.
    assert colours["champagne aluminium"] == pytest.approx((0.745, 0.706, 0.631), abs=2e-3)
    for shape in shapes:
        np.testing.assert_allclose(np.linalg.norm(shape.normals, axis=1), 1.0, atol=1e-6)


def test_a_mesh_without_normals_keeps_its_edges(gantry: Robot) -> None:
    shapes = {link.name: link.shapes for link in gantry.links}
    (box,), (ball,) = shapes["cart"], shapes["thumb"]
    for shape, most in ((box, 1e-6), (ball, math.radians(10.0))):
        corners = shape.vertices[shape.faces]
        flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        flat /= np.linalg.norm(flat, axis=1, keepdims=True)
        lean = np.einsum("fck,fk->fc", shape.normals[shape.faces], flat)
        assert np.arccos(np.clip(lean, -1.0, 1.0)).max() < most
    assert len(box.vertices) == 24
    assert len(ball.vertices) < len(ball.faces)


PAINTED = """mtllib painted.mtl
v 0 0 0
v 1 0 0
v 0 1 0
v 0 0 1
vt 0 0
usemtl red
f 1/1 3/1 2/1
f 1/1 2/1 4/1
f 2/1 3/1 4/1
f 1/1 4/1 3/1
"""


def test_mesh_files_keep_their_colours_and_a_mirror_its_outside(tmp_path: Path) -> None:
    box = trimesh.creation.box(extents=(0.2, 0.3, 0.4))
    (tmp_path / "painted.mtl").write_text("newmtl red\nKd 0.8 0.1 0.2\n")
    (tmp_path / "painted.obj").write_text(PAINTED)
    box.export(tmp_path / "bare.stl")
    text = GANTRY.read_text()
    for shape, mesh in (
        ('<box size="0.2 0.2 0.12"/>', '<mesh filename="painted.obj"/>'),
        ('<sphere radius="0.05"/>', '<mesh filename="bare.stl" scale="1 -1 2"/>'),
    ):
        assert shape in text
        text = text.replace(shape, mesh)
    shapes = {link.name: link.shapes for link in load(saved(tmp_path, text)).links}
    (cart,), (thumb,) = shapes["cart"], shapes["thumb"]
    assert cart.material.colour == pytest.approx((0.8, 0.1, 0.2), abs=0.01)
    assert thumb.material.colour == pytest.approx((0.1, 0.4, 0.7), abs=0.01)
    solid = trimesh.Trimesh(thumb.vertices, thumb.faces, process=False)
    assert solid.volume == pytest.approx(2.0 * box.volume)
    outward = np.einsum("nk,nk->n", thumb.vertices, thumb.normals)
    assert outward.min() > 0.0


def test_the_camera_sees_it_in_every_pose_of_the_pictures(katana: Robot) -> None:
    view = camera(katana)
    way = (view.target - view.eye) / np.linalg.norm(view.target - view.eye)
    for pose in POSES:
        for link, T in katana.frames(katana.values(pose)).items():
            ray = T[:3, 3] - view.eye
            angle = math.acos(float(ray @ way) / float(np.linalg.norm(ray)))
            assert angle < 0.95 * FIELD_OF_VIEW / 2.0, link


@pytest.mark.parametrize(
    ("pose", "said"),
    [
        ((0.0,) * 7, "at most 6"),
        ((math.nan,), "nan"),
        ((0.0, math.inf), "inf"),
        ((4.0,), "axis_1 cannot be at 4 rad"),
    ],
)
def test_an_impossible_pose_is_refused(katana: Robot, pose: tuple[float, ...], said: str) -> None:
    with pytest.raises(InputError, match=said):
        katana.values(pose)


@pytest.mark.parametrize(
    ("before", "after", "said"),
    [
        ('name="rail" type="prismatic"', 'name="rail" type="floating"', "'rail'.*floating"),
        ('<mimic joint="grip" mul', '<mimic joint="nobody" mul', "mimics 'nobody'"),
        (
            '<mimic joint="grip" mul',
            '<mimic joint="grip too" mul',
            "'grip too' .*mimics 'grip too', which is",
        ),
        ('upper="0.5" velocity="1" effort="1"/>', 'upper="0.5"/>CIRCLE', "follows no driven joint"),
        ('<axis xyz="0 0 2"/>', '<axis xyz="0 0 0"/>', "'turn'.*no axis"),
    ],
)
def test_an_invalid_description_is_refused(
    tmp_path: Path, before: str, after: str, said: str
) -> None:
    after = after.replace("CIRCLE", '<mimic joint="out"/>')
    path = edited(tmp_path, GANTRY.read_text(), before, after)
    with pytest.raises(RobotDescriptionError, match=said):
        load(path).check_complete()


def test_names_become_identifiers_and_stay_apart() -> None:
    names = distinct(["a b", "a_b", "A b", "for", "3d", "", "größe", "plain"], {"for"})
    assert names == ["a_b", "a_b_2", "A_b_3", "for_2", "n3d", "n", "gr__e", "plain"]
