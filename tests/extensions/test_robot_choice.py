"""The choice of another robot while the server runs, and the robots that people give to it."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from katana450 import connect
from katana450.client import Client, RefusedError
from katana450.errors import InputError, KatanaError
from katana450.extensions.importers.archive import ChoiceError
from katana450.extensions.robot_choice.choose_robot import ChooseRobot
from katana450.extensions.robot_choice.robot_check import refuse_outside
from katana450.extensions.robot_choice.robot_routes import choices
from katana450.extensions.robot_choice.uploaded_robots import (
    MAX_UPLOADED,
    folder_of,
    keep_robot,
    uploaded_robots,
    used_robot,
)
from katana450.resources import URDF_PATH
from katana450.server.api import answers, requests
from tests.browser.server import SIMULATION_APP, AppServer
from tests.exchange.shape_bytes import zipped
from tests.gateway.client import ask, enter, opened
from tests.waiting import until

LINK = '<link name="{name}"><visual><geometry>{shape}</geometry></visual></link>'
BOX = '<box size="0.05 0.05 0.2"/>'
JOINT = """<joint name="j{number}" type="revolute"><parent link="l{number}"/>
<child link="l{next}"/><origin xyz="0 0 0.2"/><axis xyz="{axis}"/>
<limit lower="-2" upper="2" velocity="1" effort="1"/></joint>"""


def urdf(axes: str = "zyyx", shape: str = BOX) -> bytes:
    """Return an arm whose axes are named by letters."""
    links = [LINK.format(name=f"l{number}", shape=shape) for number in range(len(axes) + 1)]
    vectors = {"x": "1 0 0", "y": "0 1 0", "z": "0 0 1"}
    joints = [
        JOINT.format(number=number, next=number + 1, axis=vectors[axis])
        for number, axis in enumerate(axes)
    ]
    return f'<robot name="arm">{"".join(links + joints)}</robot>'.encode()


def kept(data: bytes, name: str, main: str = "") -> Path:
    """Return the description of the robot after it was given to the server."""
    key = keep_robot(data, name, main)
    return uploaded_robots()[key]


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    return tmp_path


def test_zip_keeps_the_meshes_beside_the_description() -> None:
    arm = urdf(shape='<mesh filename="package://arm/meshes/a.stl"/>')
    files = {
        "arm/arm.urdf": arm,
        "arm/meshes/a.stl": b"solid",
        "arm/.hidden": b"",
        "arm/a.png": b"",
    }
    path = kept(zipped(files), "arm.zip")
    assert path.name == "arm.urdf"
    assert (path.parent / "meshes" / "a.stl").read_bytes() == b"solid"
    assert not (path.parent / "a.png").exists()


def test_one_of_several_robots_is_chosen_and_one_that_includes_others_is_known() -> None:
    files = {"a.urdf": urdf("zy"), "b.urdf": urdf("zyx")}
    with pytest.raises(ChoiceError) as raised:
        keep_robot(zipped(files), "two.zip")
    assert raised.value.choices == ("a.urdf", "b.urdf")
    assert kept(zipped(files), "two.zip", "b.urdf").name == "b.urdf"
    macro = {"arm.xacro": b'<xacro:include filename="parts.xacro"/>', "parts.xacro": b"<robot/>"}
    assert kept(zipped(macro), "arm.zip").name == "arm.xacro"


@pytest.mark.parametrize(
    ("name", "data", "words"),
    [
        ("arm.stl", b"solid", "no .urdf, .xacro or .zip"),
        ("arm.zip", b"PK", "cannot be read as a .zip"),
        ("arm.zip", zipped({"a.stl": b"solid"}), "There is no .urdf or .xacro"),
        ("arm\0.urdf", urdf(), "cannot be shown"),
    ],
)
def test_other_files_are_refused(name: str, data: bytes, words: str) -> None:
    with pytest.raises(InputError, match=words):
        keep_robot(data, name)
    assert not uploaded_robots()


@pytest.mark.parametrize(
    "name",
    ["file:///etc/hosts", "/etc/hosts", "&#47;etc&#47;hosts", "../../a.stl", "package://etc/hosts"],
)
def test_mesh_outside_of_the_folder_is_refused(name: str) -> None:
    path = kept(urdf(shape=f'<mesh filename="{name}"/>'), "arm.urdf")
    root = folder_of(path)
    assert root == path.parent
    with pytest.raises(InputError, match="outside of the folder of the robot"):
        refuse_outside(path.read_bytes(), path.parent, root)


def test_mesh_in_the_folder_may_be_missing() -> None:
    for name in ("a.stl", "meshes/a.stl", "package://arm/a.stl"):
        path = kept(urdf(shape=f'<mesh filename="{name}"/>'), "arm.urdf")
        refuse_outside(path.read_bytes(), path.parent, path.parent)


def test_robot_that_was_not_used_for_longest_makes_room() -> None:
    names = []
    for number in range(MAX_UPLOADED + 1):
        names.append(keep_robot(urdf() + b" " * number, "arm.urdf"))
        assert used_robot(names[0]) is not None
    assert len(uploaded_robots()) == MAX_UPLOADED
    assert {names[0], names[-1]} <= uploaded_robots().keys()
    assert names[1] not in uploaded_robots()
    assert used_robot("none") is None
    assert folder_of(URDF_PATH) is None


def test_robot_with_which_the_server_began_is_listed_beside_ours() -> None:
    key = keep_robot(urdf(), "arm.urdf")
    listed = choices(Path("/robots/mine.urdf"))[:4]
    assert [(robot.name, robot.title) for robot in listed] == [
        ("katana450", "Katana450"),
        ("so101", "SO-101"),
        ("first", "mine.urdf"),
        (key, "arm.urdf"),
    ]
    assert [robot.name for robot in choices(URDF_PATH)[:3]] == ["katana450", "so101", key]


@pytest.fixture
def server(folder: Path) -> Iterator[AppServer]:
    del folder
    with AppServer(SIMULATION_APP) as server:
        yield server


def upload(server: AppServer, data: bytes, name: str) -> tuple[int, dict[str, Any]]:
    status, _, body = ask(
        f"{server.url}/api/v1/robots?name={name}",
        data=data,
        Cookie=enter(server.url),
        Origin=server.url,
    )
    return status, json.loads(body)


def axes(server: AppServer) -> int:
    """Return the number of axes of the robot that the server drives; 0 while it starts."""
    try:
        with connect(server.url, "Watcher") as client:
            return len(client.query(answers.State).q)
    except (KatanaError, OSError):
        # Refused or cut, at any stage of the start.
        return 0


def refusal(client: Client, request: requests.Request) -> str:
    with pytest.raises(RefusedError) as raised:
        client.ask(request)
    return str(raised.value)


def test_server_drives_an_uploaded_robot_and_then_its_own_again(server: AppServer) -> None:
    status, answer = upload(server, urdf(), "small.urdf")
    assert status == 200, answer
    name = answer["robot"]["name"]
    listed = json.loads(ask(f"{server.url}/api/v1/robots", Cookie=enter(server.url))[2])["robots"]
    assert [robot["name"] for robot in listed[:3]] == ["katana450", "so101", name]
    with connect(server.url, "Ada") as ada, connect(server.url, "Bob") as bob:
        ada.ask(requests.Acquire())
        assert "Ada" in refusal(bob, ChooseRobot(robot=name))
        ada.stop()
        assert "stopped" in refusal(ada, ChooseRobot(robot=name))
        ada.clear_stop()
        # A posture that is clear of the table, where the arm would come to rest in several steps.
        aside = np.array(ada.query(answers.State).q)
        aside[0] += 0.4

        def is_refused_in_motion() -> bool:
            # A busy machine delays messages, which pauses the arm.
            ada.ask(requests.Joints(q=aside))
            return "moves" in refusal(ada, ChooseRobot(robot=name))

        until(is_refused_in_motion)
        until(lambda: not ada.query(answers.State).moving, 20.0)
        ada.ask(ChooseRobot(robot=name))
    until(lambda: axes(server) == 4, 30.0)
    until(lambda: "katana450 is ready with small.urdf" in server.output)
    with connect(server.url, "Ada") as ada:
        assert ada.query(answers.State).stopped is None
        ada.ask(ChooseRobot(robot="katana450"))
    until(lambda: axes(server) == 5, 30.0)
    assert "Traceback" not in server.output


async def problem_with(server: AppServer, name: str, words: str) -> str:
    """Choose the robot ``name`` by a page; return why that fails, which has ``words`` in it."""
    async with opened(server.url) as (_, control):
        await control.say("choose_robot", robot=name)
        async with asyncio.timeout(20.0):
            while words not in (problem := control.status.get("robot", {}).get("problem", "")):
                await asyncio.sleep(0.02)
        await control.say("release_lease")
    return str(problem)


@pytest.mark.long
def test_robot_that_cannot_be_read_leaves_the_present_one(server: AppServer) -> None:
    _, answer = upload(server, b"<robot name='a'><link name='l'/></robot>", "broken.urdf")
    name = answer["robot"]["name"]
    problem = asyncio.run(problem_with(server, name, "no joint that can be driven"))
    assert str(Path.home()) not in problem
    asyncio.run(problem_with(server, "no_such", "gallery"))
    assert axes(server) == 5
    assert upload(server, b"", "arm.stl")[0] == 422
