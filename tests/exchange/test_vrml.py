"""Tests of the VRML97 export: read back exactly, placed and drawn correctly by other programs."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import cKDTree

from katana450.arm.robot.robot import Robot
from katana450.extensions.export.obj_text import DIGITS
from katana450.extensions.export.vrml.vrml_files import part_world, view, vrml_files, world_of
from katana450.extensions.export.vrml.vrml_world import (
    Node,
    Use,
    World,
    world_text,
)
from katana450.maths.geometry import so3
from katana450.resources import URDF_PATH
from tests.exchange.conftest import GANTRY, GANTRY_POSE, POSES
from tests.exchange.silhouette import SIZE, overlap, placed, seen, silhouette
from tests.exchange.tools import SCREEN, needs, run
from tests.exchange.vrml_reading import Matrix, numbers_of, placed_nodes, read_world

pytestmark = pytest.mark.long

MOST = 2_500_000
"""[bytes] Maximum size of the arm's world."""


def test_texts_and_numbers_are_read_back_as_they_were_written() -> None:
    texts = ['a "b" \\', "", "# no comment", "größe\n\t", "{ ] TRUE"]
    info = Node("WorldInfo", (("title", texts[0]), ("info", texts)), "a_1")
    numbers = [0.0, -0.0, 5e-324, -1.7976931348623157e308, 0.1, -9.9, 1e16, 3.0, 2.0**-40]
    points = Node("Coordinate", (("point", numbers),))
    faces = Node(
        "IndexedFaceSet", (("coord", points), ("coordIndex", [0, -1, 2**31 - 1, -(2**31)]))
    )
    world = World((Node("Group", (("children", [Node("Shape", (("geometry", faces),)), info]),)),
                   Node("Group", (("children", [Use("a_1")]),))))  # fmt: skip
    assert read_world(world_text(world)) == world


def test_the_arm_is_read_back(katana: Robot) -> None:
    world = world_of(katana, katana.values(POSES[1]))
    text = world_text(world)
    assert read_world(text) == world
    assert len(text) <= MOST
    assert set(world.named()) >= {*katana.joints, *(link.name for link in katana.links)}


def placed_points(world: World) -> Iterator[tuple[str, Matrix]]:
    """Return the nearest named ancestor and the placed points (n, 3) of every face set."""
    for node, name, T in placed_nodes(world):
        if node.kind == "Coordinate":
            yield name, numbers_of(node, "point", ()).reshape(-1, 3) @ T[:3, :3].T + T[:3, 3]


@pytest.mark.parametrize("which", ["katana", "gantry"])
def test_the_transforms_place_every_point_as_in_the_urdf(
    which: str, katana: Robot, gantry: Robot
) -> None:
    path, robot, pose = (
        (URDF_PATH, katana, POSES[2]) if which == "katana" else (GANTRY, gantry, GANTRY_POSE)
    )
    values = robot.values(pose)
    read = read_world(world_text(world_of(robot, values)))
    upright = so3.rotation_x(-np.pi / 2.0)
    points = np.concatenate([points for _, points in placed_points(read)])
    expected = np.concatenate([mesh.vertices @ upright.T for _, mesh in placed(path, values)])
    for some, others in ((points, expected), (expected, points)):
        assert cKDTree(others).query(some)[0].max() < 10.0**-DIGITS


def test_parts_are_placed_as_with_all_joints_at_zero(katana: Robot) -> None:
    whole = dict(placed_points(world_of(katana, katana.values(()))))
    for link in katana.links:
        if link.shapes:
            parts = dict(placed_points(part_world(katana, link)))
            np.testing.assert_array_equal(parts[link.name], whole[link.name])


def test_every_link_with_a_shape_has_a_file(gantry: Robot) -> None:
    files = vrml_files(gantry, world_of(gantry, gantry.values(())))
    parts = ("floor", "cart", "mast", "left_finger", "right_finger", "thumb")
    assert sorted(files) == sorted(["gantry_2.wrl", *(f"parts/{part}.wrl" for part in parts)])
    for content in files.values():
        read_world(content.decode())


def picture(folder: Path, content: bytes, name: str = "scene.wrl", time: float = 0.0) -> Path:
    """Return the picture that view3dscene draws of a file some seconds after it was opened."""
    scene, image = folder / name, folder / "picture.png"
    scene.write_bytes(content)
    alone = ("--geometry", f"{SIZE}x{SIZE}", "--hide-extras", "--hide-menu")
    run(*SCREEN, "view3dscene", scene, *alone, "--screenshot", f"{time:g}", image)
    return image


@needs("view3dscene", "xvfb-run", "xauth")
@pytest.mark.parametrize("pose", POSES)
def test_another_program_draws_the_reference_picture(
    tmp_path: Path, katana: Robot, pose: tuple[float, ...]
) -> None:
    values = katana.values(pose)
    ours = silhouette(placed(URDF_PATH, values), view(katana, values))
    theirs = picture(tmp_path, vrml_files(katana, world_of(katana, values))["katana450.wrl"])
    assert overlap(seen(theirs), ours) >= 0.98
