"""Test meshes and scenes: upload, placement, attachment, saving and loading."""

from __future__ import annotations

import io
import json
import time
import zipfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import trimesh

from katana450.arm.control.lease import Role
from katana450.arm.robot.robot import Robot
from katana450.assembly.robot_session import DescribedRobot, describe_robot
from katana450.client import Client, RefusedError
from katana450.errors import InputError
from katana450.extensions.importers.archive import SCENE
from katana450.extensions.importers.formats.scene_file import load_initial_scene
from katana450.extensions.importers.formats.shape_file import MAX_FILE_BYTES
from katana450.extensions.importers.uploads import UPLOAD_BURST
from katana450.maths.kinematics.forward import forward
from katana450.resources import URDF_PATH
from katana450.server.api import answers, requests
from katana450.server.web.access_links import AccessFile
from katana450.settings import Settings
from tests.gateway.virtual import VirtualServer
from tests.waiting import until


@pytest.fixture(scope="module")
def ring(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("files") / "ring.stl"
    path.write_bytes(trimesh.creation.torus(40.0, 12.0, 24, 12).export(file_type="stl"))
    return path


@pytest.fixture(scope="module")
def scene(ring: Path) -> Path:
    """Write a scene folder by hand."""
    path = ring.with_name("mine.yaml")
    path.write_text(
        """\
scene: 1
joints: [10, -68, 85, 8, 0]
water: 80
objects:
- {name: cup, shape: cylinder, size: [32, 90], pose: [340, -260, 0, 0, 0, 0], can_be_held: true}
- name: gate
  shape: mesh
  mesh: {file: ring.stl, unit: mm}
  pose: [420, 150, 0, 90, 0, 30]
  colour: "#2477d4"
- {name: ring, shape: mesh, mesh: {file: ring.stl, unit: mm}, pose: [300, -400, 50, 0, 0, 0]}
"""
    )
    return path


@pytest.fixture(scope="module")
def tokens(ring: Path) -> dict[str, str]:
    """Return the token of a link for each role, and the file of the links."""
    file, until = AccessFile.create(ring.with_name("access.json")), time.time() + 3600.0
    roles = (Role.VIEWER, Role.OPERATOR)
    return {"file": str(file.path)} | {
        role.value: file.give(role.value, role, until) for role in roles
    }


@pytest.fixture(scope="module")
def local(
    described: DescribedRobot, scene: Path, tokens: dict[str, str]
) -> Iterator[VirtualServer]:
    access = AccessFile.open(Path(tokens["file"]))
    with VirtualServer(described, "--scene", str(scene), access=access) as server:
        yield server


@pytest.fixture
def arm(local: VirtualServer, tokens: dict[str, str]) -> Iterator[Client]:
    with local.connect("Test", tokens["operator"]) as arm:
        arm.ask(requests.Acquire())
        yield arm
        arm.ask(requests.ReleaseLease())


def objects(arm: Client) -> dict[str, answers.SceneObject]:
    return {item.name: item for item in arm.query(answers.Objects).objects}


def test_server_starts_with_its_scene_and_objects(arm: Client) -> None:
    now = objects(arm)
    assert list(now) == ["cup", "gate", "ring"]
    assert now["gate"].colour == "#2477d4"
    np.testing.assert_allclose(np.array(now["ring"].T)[:3, 3], (0.3, -0.4, 0.05), atol=1e-12)
    state = arm.query(answers.State)
    assert state.q[0] == pytest.approx(np.radians(10.0), abs=1e-12)
    assert state.water is not None
    assert state.water.cup_ml == pytest.approx(80.0, abs=1e-9)


def test_mesh_is_placed_fixed_to_the_hand_and_touched(
    arm: Client, ring: Path, robot: Robot
) -> None:
    uploaded = arm.upload(ring)
    assert uploaded.name == "ring 2"
    assert uploaded.triangles == 576
    np.testing.assert_allclose(uploaded.size, (0.104, 0.104, 0.024), atol=1e-6)
    other = arm.upload(ring, "cm").key
    assert other != uploaded.key
    form = requests.Shape.MESH
    arm.ask(requests.Place(name="it", shape=form, mesh=uploaded.key, scale=0.5, opacity=0.4))
    until(lambda: "it" in objects(arm))
    position = np.array(objects(arm)["it"].T)[:3, 3]
    assert 0.3 < np.hypot(*position[:2]) < 0.7
    assert position[2] == 0.0
    on_tool = np.eye(4)
    on_tool[:3, 3] = (-0.05, 0.0, 0.06)
    arm.ask(requests.Attach(name="it", to=requests.Attachment.HAND, T=on_tool))
    until(lambda: objects(arm)["it"].fixed)
    mounted = robot.require_arm()
    T = mounted.T_base_shoulder @ forward(mounted.chain, np.array(arm.query(answers.State).q))
    np.testing.assert_allclose(objects(arm)["it"].T, T @ on_tool, atol=1e-9)
    arm.ask(requests.Place(name="it", colour="#ff0000", hidden=True))
    until(lambda: objects(arm)["it"].hidden)
    np.testing.assert_allclose(objects(arm)["it"].T, T @ on_tool, atol=1e-9)
    arm.ask(requests.Attach(name="it", to=requests.Attachment.WORLD))
    until(lambda: not objects(arm)["it"].fixed)
    np.testing.assert_allclose(objects(arm)["it"].T, T @ on_tool, atol=1e-9)
    arm.ask(requests.Remove(name="it"))
    until(lambda: "it" not in objects(arm))
    for wrong in (
        requests.Place(name="it", shape=form),
        requests.Place(name="it", shape=form, mesh="0" * 32),
        requests.Place(name="it", shape=requests.Shape.BOX, size=[0.1] * 3, mesh=uploaded.key),
        requests.Place(name="it", shape=form, mesh=uploaded.key, scale=900.0),
        requests.Place(name="cup", scale=2.0),
        requests.Attach(name="nobody", to=requests.Attachment.HAND),
        requests.Attach(name="ring", to=requests.Attachment.WORLD, T=np.eye(4)),
        requests.Load(scene="0" * 32),
    ):
        with pytest.raises(RefusedError):
            arm.ask(wrong)
    assert list(objects(arm)) == ["cup", "gate", "ring"]


def test_scene_is_saved_and_loaded_whole_or_not_at_all(arm: Client) -> None:
    data = arm.save_scene()
    before = objects(arm)
    arm.ask(requests.Remove(name="gate"))
    arm.ask(requests.Fill(ml=10.0))
    until(lambda: "gate" not in objects(arm))
    water = arm.query(answers.State).water
    assert water is not None
    assert water.cup_ml == pytest.approx(10.0)
    loaded = arm.load_scene(data)
    assert loaded.objects == list(before)
    until(lambda: objects(arm) == before)
    assert arm.save_scene() == data
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    assert sorted(files) == ["meshes/ring.stl", SCENE]
    text = files[SCENE].decode()
    for wrong, reason in (
        (text.replace("name: ring", "name: gate"), "two objects called 'gate'"),
        (text.replace("water: 80", "water: 5000"), "cannot hold 5000 ml"),
        (text.replace("meshes/ring.stl", "../ring.stl"), "not a relative path"),
        (text[: len(text) // 2], "line"),
    ):
        out = io.BytesIO()
        with zipfile.ZipFile(out, "w") as archive:
            for name, content in (files | {SCENE: wrong.encode()}).items():
                archive.writestr(name, content)
        with pytest.raises(RefusedError, match=reason):
            arm.load_scene(out.getvalue())
        assert objects(arm) == before


def test_uploads_beyond_the_limits_are_refused(
    local: VirtualServer, tokens: dict[str, str]
) -> None:
    def ask(path: str, data: bytes, **more: str) -> tuple[int, bytes]:
        bearer = f"Bearer {tokens['operator']}"
        status, _, body = local.ask(f"/api/v1/{path}", data=data, Authorization=bearer, **more)
        return status, body

    status, body = ask("mesh?name=a.stl", bytes(MAX_FILE_BYTES + 1))
    assert status == 413
    assert f"The body is larger than {MAX_FILE_BYTES} bytes.".encode() in body
    for query in ("", "?name=a.exe", "?name=a.stl&unit=ft", f"?name={'a' * 200}.stl"):
        status, body = ask(f"mesh{query}", b"x")
        assert status in (422, 429), body
        assert json.loads(body)["is"] == "refused"
    assert 429 in {ask("mesh?name=a.exe", b"")[0] for _ in range(int(UPLOAD_BURST) + 2)}
    # Uploads from pages of other sites are refused.
    assert ask("mesh?name=a.stl", b"x", Origin="https://evil.example")[0] == 403


def test_spectator_cannot_upload(local: VirtualServer, ring: Path, tokens: dict[str, str]) -> None:
    with local.connect("Eve", tokens["viewer"]) as watcher:
        with pytest.raises(RefusedError, match="may watch"):
            watcher.upload(ring)
        assert watcher.save_scene()
    assert local.ask("/api/v1/mesh?name=ring.stl", data=ring.read_bytes())[0] == 401
    assert local.ask("/api/v1/scene")[0] == 401


def test_invalid_scene_is_refused_before_the_server_starts(scene: Path) -> None:
    robot = describe_robot(Settings(), URDF_PATH, None)
    broken = scene.with_name("broken.yaml")
    whole = scene.read_text()
    for text, reason in (
        (
            whole.replace("shape: mesh", "form: mush"),
            "broken.yaml:\n.*\nline 7, column 3: .* no 'form'",
        ),
        (whole.replace("10, -68", "10, 168").replace("shape: mesh", "shape: sphere"), "line 6"),
        ("scene: 1\njoints: [0, 168, 85, 8, 0]\n", "limits"),
        ("scene: 1\njoints: [0, 1]\n", "joint"),
        ("scene: 1\nwater: 80\n", "no cup"),
    ):
        broken.write_text(text)
        with pytest.raises(InputError, match=reason):
            load_initial_scene(robot.session, broken)
