"""Tests of the USD export: the text has every part, and USD's own library reads the same robot."""

from __future__ import annotations

import json
import os
import re
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from katana450.arm.robot.robot import Robot
from katana450.cli.main import main
from katana450.extensions.export.usd import usd_files
from katana450.extensions.export.usda_text import quoted
from katana450.resources import URDF_PATH
from tests.exchange.conftest import GANTRY, GANTRY_POSE, POSES
from tests.exchange.tools import USD, needs_package, run

READ = """
import json, sys
import numpy as np
from pxr import Gf, Usd, UsdGeom, UsdPhysics, UsdValidation

stage = Usd.Stage.Open(sys.argv[1])
angles = json.loads(sys.argv[2])
root = stage.GetDefaultPrim()
cache = UsdGeom.XformCache()
bodies = [p for p in root.GetChildren() if p.HasAPI(UsdPhysics.RigidBodyAPI)]
places = [p for p in stage.Traverse() if p.IsA(UsdGeom.Xform) and p != root]


def listed(matrix):
    return [list(row) for row in matrix.GetTranspose()]


def local(joint, side):
    at = joint.GetAttribute(f"physics:localPos{side}").Get()
    turn = joint.GetAttribute(f"physics:localRot{side}").Get()
    return Gf.Matrix4d(Gf.Rotation(Gf.Quatd(turn)), Gf.Vec3d(at))


# Places of the bodies by the joints alone, from the root.
placed = {}
waiting = [p for p in root.GetChild("Joints").GetChildren()]
limits = {}
while waiting:
    joint = waiting.pop(0)
    first = [t.name for t in joint.GetRelationship("physics:body0").GetTargets()]
    (second,) = (t.name for t in joint.GetRelationship("physics:body1").GetTargets())
    if first and first[0] not in placed:
        waiting.append(joint)
        continue
    motion = Gf.Matrix4d(1.0)
    value = angles.get(joint.GetName())
    if joint.IsA(UsdPhysics.RevoluteJoint):
        turn = Gf.Rotation(Gf.Vec3d(1, 0, 0), value * 180.0 / 3.141592653589793)
        motion = Gf.Matrix4d(turn, Gf.Vec3d(0))
    elif joint.IsA(UsdPhysics.PrismaticJoint):
        motion.SetTranslate(Gf.Vec3d(value, 0, 0))
    if value is not None:
        limits[joint.GetName()] = [
            joint.GetAttribute("physics:lowerLimit").Get(),
            joint.GetAttribute("physics:upperLimit").Get(),
        ]
    before = placed[first[0]] if first else Gf.Matrix4d(1.0)
    placed[second] = local(joint, 1).GetInverse() * motion * local(joint, 0) * before

meshes = [p for p in stage.Traverse() if p.IsA(UsdGeom.Mesh)]
seen = [p for p in meshes if not p.HasAPI(UsdPhysics.CollisionAPI)]
rules = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
errors = UsdValidation.ValidationContext(rules).Validate(stage)
corners = np.concatenate([
    np.column_stack([p.GetAttribute("points").Get(), np.ones(len(p.GetAttribute("points").Get()))])
    @ np.array(cache.GetLocalToWorldTransform(p))
    for p in seen
])[:, :3]
print(json.dumps({
    "rules": len(rules),
    "errors": [error.GetMessage() for error in errors],
    "axis": UsdGeom.GetStageUpAxis(stage),
    "metres": UsdGeom.GetStageMetersPerUnit(stage),
    "articulated": root.HasAPI(UsdPhysics.ArticulationRootAPI),
    "bodies": [p.GetName() for p in bodies],
    "poses": {p.GetName(): listed(cache.GetLocalToWorldTransform(p)) for p in places},
    "placed": {name: listed(T) for name, T in placed.items()},
    "limits": limits,
    "masses": {p.GetName(): p.GetAttribute("physics:mass").Get() for p in bodies},
    "triangles": sum(len(p.GetAttribute("faceVertexCounts").Get()) for p in seen),
    "collisions": len(meshes) - len(seen),
    "looks": sum(bool(p.GetRelationship("material:binding").GetTargets()) for p in seen),
    "seen": len(seen),
    "valid": all(p.GetAttribute("points").Get() is not None for p in meshes),
    "box": [corners.min(axis=0).tolist(), corners.max(axis=0).tolist()],
}))
"""


def written(folder: Path, words: tuple[str, ...]) -> Path:
    """Return the file that the command writes."""
    assert main(["export", "usd", "--out", str(folder), *words]) == 0
    (path,) = folder.glob("*.usda")
    return path


def read(path: Path, values: dict[str, float], monkeypatch: pytest.MonkeyPatch) -> Any:
    """Return what USD's library finds in the file at ``path``, in a process of its own."""
    monkeypatch.setenv("PYTHONPATH", os.fspath(USD.folder))
    printed = run(sys.executable, "-c", READ, path, json.dumps(values), folder=path.parent)
    return json.loads(printed.splitlines()[-1])


@needs_package(USD)
@pytest.mark.long
@pytest.mark.parametrize("pose", POSES)
def test_usd_reads_the_same_robot(
    tmp_path: Path, katana: Robot, pose: tuple[float, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = written(tmp_path, (f"--pose={','.join(map(str, pose))}",))
    values = katana.values(pose)
    found = read(path, values, monkeypatch)
    frames = katana.frames(values)
    assert (found["axis"], found["metres"], found["articulated"]) == ("Z", 1.0, True)
    assert found["rules"] > 20
    assert found["errors"] == []
    assert set(found["poses"]) == set(frames)
    for link, T in frames.items():
        np.testing.assert_allclose(found["poses"][link], T, atol=1e-9, err_msg=link)
        # Joints have places and rotations in single precision.
        if link in found["bodies"]:
            np.testing.assert_allclose(found["placed"][link], T, atol=1e-6, err_msg=link)
    # A body without mass would get one from the engine.
    assert set(found["bodies"]) == {link.name for link in katana.links if link.mass}
    masses = {link.name: link.mass for link in katana.links if link.mass}
    stated = {name: mass for name, mass in found["masses"].items() if mass}
    assert stated == pytest.approx(masses, rel=1e-6)
    for name, (lower, upper) in found["limits"].items():
        joint = katana.joints[name]
        assert np.radians((lower, upper)) == pytest.approx((joint.lower, joint.upper), abs=1e-6)
    shapes = [shape for link in katana.links for shape in link.shapes]
    assert found["triangles"] == sum(len(shape.faces) for shape in shapes)
    assert found["seen"] == found["looks"] == len(shapes)
    assert found["collisions"] == sum(len(link.collisions) for link in katana.links)
    assert found["valid"]
    corners = np.concatenate(
        [
            shape.vertices @ frames[link.name][:3, :3].T + frames[link.name][:3, 3]
            for link in katana.links
            for shape in link.shapes
        ]
    )
    # Coordinates are rounded to 0.01 mm.
    bounds = (corners.min(axis=0), corners.max(axis=0))
    np.testing.assert_allclose(found["box"], bounds, atol=1e-5)


@needs_package(USD)
@pytest.mark.long
def test_usd_reads_sliding_and_following_joints(
    tmp_path: Path, gantry: Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = written(tmp_path, ("--urdf", str(GANTRY), f"--pose={','.join(map(str, GANTRY_POSE))}"))
    values = gantry.values(GANTRY_POSE)
    named = {name.replace(" ", "_"): value for name, value in values.items()}
    found = read(path, named, monkeypatch)
    assert found["errors"] == []
    for link, T in gantry.frames(values).items():
        name = link.replace("/", "_")
        np.testing.assert_allclose(found["placed"][name], T, atol=1e-6, err_msg=link)
        np.testing.assert_allclose(found["poses"][name], T, atol=1e-9, err_msg=link)


def test_text_has_every_link_joint_and_coupling(katana: Robot) -> None:
    (content,) = usd_files(katana, URDF_PATH, katana.values(())).values()
    text = content.decode()
    places = re.findall(r'def Xform "(\w+)"', text)
    assert sorted(places) == sorted(["katana450", *(link.name for link in katana.links)])
    for name, joint in katana.joints.items():
        assert f'def PhysicsRevoluteJoint "{name}"' in text
        follows = f'custom string katana450:mimic:joint = "{joint.leader}"'
        assert (follows in text) == (joint.leader != name) or joint.leader == name
    assert text.count("PhysicsDriveAPI:angular") == len(katana.driven)
    assert text.count("{") == text.count("}")
    assert text.count("(") == text.count(")")


def test_the_same_robot_gives_the_same_text(gantry: Robot) -> None:
    values = gantry.values(GANTRY_POSE)
    assert usd_files(gantry, GANTRY, values) == usd_files(gantry, GANTRY, values)


def test_strings_are_escaped() -> None:
    assert quoted('a "b" \\ c\n') == '"a \\"b\\" \\\\ c\\n"'


def test_size_of_a_dense_mesh_is_stated(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("katana450.extensions.export.export.LARGE_BYTES", 4_000_000)
    assert main(["export", "usd", "--out", str(tmp_path)]) == 0
    assert "5 MB, because the meshes have 48,942 triangles" in capsys.readouterr().err
