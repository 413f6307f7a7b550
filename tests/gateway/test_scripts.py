"""Scripts over HTTP: the list, reading a text by line, and saving it in the folder."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from katana450.arm.control.lease import Role
from katana450.assembly.robot_session import DescribedRobot
from katana450.extensions.programs.language.source import MAX_BYTES
from katana450.extensions.programs.script.script import script_schema
from katana450.server.api import answers
from katana450.server.api.program_requests import Program
from katana450.server.web.access_links import AccessFile
from tests.gateway.client import HOUR
from tests.gateway.virtual import VirtualServer

POSES = "name: Mine\nsteps:\n  - joints: [0, -68, 85, 8, 0]\n  - wait: 1\n"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("scripts")


@pytest.fixture(scope="module")
def server(described: DescribedRobot, folder: Path) -> Iterator[VirtualServer]:
    with VirtualServer(described, "--programs", str(folder)) as server:
        yield server


def post(server: VirtualServer, text: str | bytes, name: str = "") -> tuple[int, bytes]:
    data = text.encode() if isinstance(text, str) else text
    status, _, body = server.ask(f"/api/v1/scripts{name}", data=data, Origin=server.url)
    return status, body


def read(server: VirtualServer, text: str) -> dict[str, Any]:
    status, body = post(server, text)
    assert status == 200, body
    answer: dict[str, Any] = json.loads(body)
    return answer


def test_text_is_read_as_poses_or_with_its_problems(server: VirtualServer) -> None:
    answer = read(server, POSES)
    assert answer["problems"] == []
    pose = {"joints": [0.0, -68.0, 85.0, 8.0, 0.0], "speed": 1.0, "blend": False}
    poses = [{**pose, "gripper": None, "wait": 1.0}]
    assert answer["taught"] == {"name": "Mine", "times": 1, "poses": poses}
    assert [block["title"] for block in answer["blocks"]] == ["joints (0, -68, 85, 8, 0)", "wait 1"]
    answer = read(server, "steps: [home]")
    assert (answer["problems"], answer["taught"], len(answer["blocks"])) == ([], None, 1)
    answer = read(server, "steps:\n  - hme\n  - wait: -1\n")
    assert [block["line"] for block in answer["blocks"]] == [2, 3]
    problems = answer["problems"]
    assert [problem["line"] for problem in problems] == [2, 3]
    assert "did you mean 'home'" in problems[0]["text"]
    answer = read(server, "steps: [")
    assert (answer["problems"][0]["line"], answer["blocks"]) == (1, None)


def test_script_is_saved_once_and_can_be_read(server: VirtualServer, folder: Path) -> None:
    assert post(server, POSES, "/Mine") == (204, b"")
    assert (folder / "Mine.yaml").read_text(encoding="utf-8") == POSES
    status, body = post(server, POSES, "/Mine")
    assert (status, b"exists already" in body) == (409, True)
    assert post(server, POSES, "/Mine?replace") == (204, b"")
    status, _, body = server.ask("/api/v1/scripts")
    listed = json.loads(body)
    assert (listed["saves"], listed["names"][0]) == (True, "Mine")
    assert "Pour" in listed["names"]
    assert listed["steps"]["wait"] == "wait: 1"
    assert server.ask("/api/v1/scripts/Mine")[2].decode() == POSES


def test_anything_else_is_refused_and_not_saved(server: VirtualServer, folder: Path) -> None:
    before = sorted(folder.parent.rglob("*"))
    cases: list[tuple[str, str | bytes, int]] = [
        ("/..%2Fout", POSES, 404),
        ("/.hidden", POSES, 409),
        ("/Bad", "steps: [fly]", 422),
        ("/Bad", b"\xff", 422),
        ("/Bad", "#" * (MAX_BYTES + 1), 413),
        ("", "#" * (MAX_BYTES + 1), 413),
    ]
    for name, text, status in cases:
        assert post(server, text, name)[0] == status, (name, text[:9])
        assert sorted(folder.parent.rglob("*")) == before


def test_viewers_neither_read_nor_save(described: DescribedRobot, tmp_path: Path) -> None:
    links = AccessFile.create(tmp_path / "access.json")
    scripts = tmp_path / "scripts"
    scripts.mkdir()
    with VirtualServer(described, "--programs", str(scripts), access=links) as server:
        url = "/api/v1/scripts"
        for role, wanted in ((Role.VIEWER, 403), (Role.OPERATOR, 200)):
            token = f"Bearer {links.give('Anna', role, time.time() + HOUR)}"
            assert server.ask(url, data=POSES.encode(), Authorization=token)[0] == wanted
            saved = server.ask(f"{url}/Mine", data=POSES.encode(), Authorization=token)[0]
            assert saved == (204 if wanted == 200 else 403)
            assert server.ask(url, Authorization=token)[0] == 200
        assert server.ask(url)[0] == 401
        assert server.ask(url, data=POSES.encode())[0] == 401


def test_server_without_a_folder_saves_nothing(local: VirtualServer) -> None:
    assert not json.loads(local.ask("/api/v1/scripts")[2])["saves"]
    status, body = post(local, POSES, "/Mine")
    assert (status, b"no folder for scripts" in body) == (409, True)


def test_schema_is_served_to_editors(server: VirtualServer) -> None:
    status, headers, body = server.ask("/api/v1/script.schema.json")
    assert (status, headers["content-type"]) == (200, "application/schema+json")
    assert json.loads(body) == script_schema()


@pytest.mark.parametrize(
    ("moved", "status", "why"),
    [
        (0.0, "ready", ""),
        (5.0, "refused", "line 1, column 8: The scene is not that of the script: cup is elsewhere"),
    ],
)
def test_server_checks_the_scene_of_a_script(
    server: VirtualServer, moved: float, status: str, why: str
) -> None:
    with server.connect("Owner") as arm:
        objects = arm.query(answers.Objects).objects
        scene = ", ".join(
            f"{{name: {item.name}, shape: {item.shape}, "
            f"size: {[1e3 * size for size in item.size]}, can_be_held: {item.can_be_held}, "
            f"pose: {[1e3 * item.T[0][3] + moved, 1e3 * item.T[1][3], 0, 0, 0, 0]}}}"
            for item in objects
        )
        arm.ask(Program(text=f"scene: [{scene}]\nsteps:\n  - nudge: {{axis: 5, by: 5}}\n"))
        while (program := arm.query(answers.State).program) is None or program.status == "planning":
            time.sleep(0.02)
    assert program.status == status
    assert program.why.startswith(why)
