"""Tests of VRML worlds for VTK: digits before decimal points, and a static pose."""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path

import numpy as np
import pytest

from katana450.arm.robot.robot import Robot
from katana450.extensions.export.glb import glb_files
from katana450.extensions.export.trajectory_file import RecordedMotion, load_motion
from katana450.extensions.export.vrml import vrml_files, world_of
from katana450.extensions.export.vrml_names import VrmlNames
from tests.exchange.conftest import GANTRY_POSE
from tests.exchange.tools import VTK, run, vtk_folder

WORD = re.compile(r'"(?:[^"\\]|\\.)*"|[^\s,\[\]{}"]+')

NUMBER = re.compile(r"-?[0-9]+(\.[0-9]+)?(e[+-]?[0-9]+)?")

BOUNDS = """\
import json, sys
sys.path.insert(0, sys.argv[1])
import vtkmodules.vtkRenderingOpenGL2
from vtkmodules.vtkIOImport import vtkVRMLImporter
importer = vtkVRMLImporter()
importer.SetFileName(sys.argv[2])
importer.Update()
actors = importer.GetRenderer().GetActors()
actors.InitTraversal()
bounds = [actors.GetNextActor().GetBounds() for _ in range(actors.GetNumberOfItems())]
bounds = [each for each in bounds if each[0] <= each[1]]
low = [min(each[2 * i] for each in bounds) for i in range(3)]
high = [max(each[2 * i + 1] for each in bounds) for i in range(3)]
print(json.dumps([low, high]))
"""


@pytest.fixture
def motion(tmp_path: Path, gantry: Robot) -> RecordedMotion:
    names = gantry.driven
    lines = (
        ",".join(("t", *names)),
        ",".join(map(str, (0.0, *GANTRY_POSE))),
        ",".join(["1.0"] + ["0.0"] * len(names)),
    )
    text = "\n".join(lines)
    (tmp_path / "m.csv").write_text(text)
    return load_motion(tmp_path / "m.csv", gantry)


def test_every_number_has_a_digit_before_its_point(katana: Robot) -> None:
    """VTK reads .0122 as 0."""
    numbers = 0
    for content in vrml_files(katana, katana.values((0.01, -0.02, 0.03))).values():
        for word in WORD.findall(content.decode().partition("\n")[2]):
            if word[0] in "+-.0123456789":
                assert NUMBER.fullmatch(word), word
                numbers += 1
    assert numbers > 100_000


def test_static_pose_is_the_first_sample_of_the_motion(
    gantry: Robot, motion: RecordedMotion
) -> None:
    start = gantry.values(GANTRY_POSE)
    assert motion.start == pytest.approx(start)
    rest = gantry.values(())
    moving = world_of(gantry, rest, motion).named()
    standing = world_of(gantry, start).named()
    for name in VrmlNames(gantry).joints.values():
        assert moving[name] == standing[name]
    (with_motion,), (without,) = (
        glb_files(gantry, rest, motion).values(),
        glb_files(gantry, start).values(),
    )
    assert nodes(with_motion) == nodes(without)


def nodes(glb: bytes) -> list[object]:
    """Return the nodes of a binary glTF file."""
    length = int.from_bytes(glb[12:16], "little")
    found: list[object] = json.loads(glb[20 : 20 + length])["nodes"]
    return found


@pytest.mark.long
@pytest.mark.skipif(vtk_folder() is None, reason=f"not here; pip brings {VTK}")
def test_vtk_reads_the_arm_in_its_size(tmp_path: Path, katana: Robot) -> None:
    files = vrml_files(katana, katana.values(()))
    (tmp_path / "arm.wrl").write_bytes(next(files[name] for name in files if "/" not in name))
    (tmp_path / "bounds.py").write_text(BOUNDS)
    folder = vtk_folder()
    assert folder is not None
    printed = run(sys.executable, tmp_path / "bounds.py", folder, tmp_path / "arm.wrl")
    low, high = np.array(json.loads(printed.splitlines()[-1]))
    points = np.concatenate(
        [
            shape.vertices @ T[:3, :3].T + T[:3, 3]
            for T, link in ((katana.home[link.name], link) for link in katana.links)
            for shape in link.shapes
        ]
    )
    # VRML has y up, the root has z up.
    points = points[:, (0, 2, 1)] * (1.0, 1.0, -1.0)
    np.testing.assert_allclose(low, points.min(axis=0), atol=1e-5)
    np.testing.assert_allclose(high, points.max(axis=0), atol=1e-5)
