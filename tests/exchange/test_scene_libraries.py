"""Tests of VRML worlds: their numbers, and the poses that Coin reads."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import cKDTree

from katana450.arm.robot.robot import Robot
from katana450.cli.main import main
from katana450.extensions.export.vrml.vrml_files import vrml_files, world_of
from katana450.resources import URDF_PATH
from tests.exchange.conftest import POSES
from tests.exchange.silhouette import placed
from tests.exchange.tools import PIVY, needs, run

WORD = re.compile(r'"(?:[^"\\]|\\.)*"|[^\s,\[\]{}"]+')

NUMBER = re.compile(r"-?[0-9]+(\.[0-9]+)?(e[+-]?[0-9]+)?")

OPENED = """\
import array, json, sys
from pivy import coin
source = coin.SoInput()
assert source.openFile(sys.argv[1])
world = coin.SoDB.readAll(source)
world.ref()
"""

TRIANGLES = """\
numbers = array.array("d")
def keep(_, action, *corners):
    matrix = action.getModelMatrix()
    for corner in corners:
        numbers.extend(matrix.multVecMatrix(corner.getPoint()).getValue())
action = coin.SoCallbackAction()
action.addTriangleCallback(coin.SoVRMLIndexedFaceSet.getClassTypeId(), keep, None)
action.apply(world)
numbers.tofile(open(sys.argv[2], "wb"))
"""

PLACES = """\
found = {}
for name in sys.argv[2:]:
    node = coin.SoNode.getByName(name)
    # The matrix of a path includes the Transforms above its last node.
    mark = coin.SoInfo()
    node.addChild(mark)
    search = coin.SoSearchAction()
    search.setSearchingAll(True)
    search.setNode(mark)
    search.apply(world)
    action = coin.SoGetMatrixAction(coin.SbViewportRegion(100, 100))
    action.apply(search.getPath())
    found[name] = action.getMatrix().getValue()
print(json.dumps(found))
"""

PYTHON = "/usr/bin/python3"
"""The Python of the system, which has the packages of the system."""


def test_every_number_has_a_digit_before_its_point(katana: Robot) -> None:
    """VTK (ParaView, PyVista) reads .0122 as 0."""
    numbers = 0
    for content in vrml_files(
        katana, world_of(katana, katana.values((0.01, -0.02, 0.03)))
    ).values():
        for word in WORD.findall(content.decode().partition("\n")[2]):
            if word[0] in "+-.0123456789":
                assert NUMBER.fullmatch(word), word
                numbers += 1
    assert numbers > 100_000


def exported(folder: Path, pose: tuple[float, ...]) -> Path:
    """Return the world that the command writes of the arm alone."""
    values = ",".join(map(str, pose))
    options = ["--no-objects", "--out", str(folder), f"--pose={values}"]
    assert main(["export", "vrml", *options]) == 0
    return folder / "katana450.wrl"


@pytest.mark.long
@needs(PIVY)
@pytest.mark.parametrize("pose", POSES)
def test_coin_places_every_triangle(tmp_path: Path, katana: Robot, pose: tuple[float, ...]) -> None:
    """Its pictures stay black without a graphics card, so its triangles are compared."""
    (tmp_path / "triangles.py").write_text(OPENED + TRIANGLES)
    output = tmp_path / "triangles.bin"
    run(PYTHON, tmp_path / "triangles.py", exported(tmp_path, pose), output)
    points = np.fromfile(output).reshape(-1, 3)
    points = np.column_stack((points[:, 0], -points[:, 2], points[:, 1]))
    expected = np.concatenate(
        [mesh.triangles.reshape(-1, 3) for _, mesh in placed(URDF_PATH, katana.values(pose))]
    )
    assert len(points) == len(expected)
    for some, others in ((points, expected), (expected, points)):
        assert cKDTree(others).query(some)[0].max() < 2e-5


@pytest.mark.long
@needs(PIVY)
@pytest.mark.parametrize("pose", POSES)
def test_coin_places_the_tool_and_every_link_by_name(
    tmp_path: Path, katana: Robot, pose: tuple[float, ...]
) -> None:
    """Read absolute poses as Simulink's VR Source does by `tcp.translation_abs`."""
    (tmp_path / "places.py").write_text(OPENED + PLACES)
    links = [link.name for link in katana.links]
    assert {"tcp", "flange"} < set(links)
    printed = run(PYTHON, tmp_path / "places.py", exported(tmp_path, pose), *links)
    places = json.loads(printed.splitlines()[-1])
    upright = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
    for link, T in katana.frames(katana.values(pose)).items():
        # Coin multiplies rows by matrices, in single precision.
        theirs = np.array(places[link]).T
        np.testing.assert_allclose(theirs[:3, 3], upright @ T[:3, 3], atol=2e-6, err_msg=link)
        np.testing.assert_allclose(theirs[:3, :3], upright @ T[:3, :3], atol=5e-6, err_msg=link)
