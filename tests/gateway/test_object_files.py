"""Uploads of several files and of any size by a program: choices, scales, and what is refused."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import quote

import pytest

from katana450.client import Client, RefusedError, connect
from katana450.extensions.export.vrml_text import HEADER
from katana450.server.api import answers, requests
from tests.browser.server import APP, AppServer
from tests.exchange.test_several_files import ARTICULATED, PARTS, written, zipped
from tests.gateway.client import ask


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[AppServer]:
    path = written(tmp_path_factory.mktemp("robot"), ARTICULATED)
    with AppServer((*APP, "--object", f"{path}@400,300,0@0.5")) as server:
        yield server


@pytest.fixture
def arm(server: AppServer) -> Iterator[Client]:
    with connect(server.url, "Test") as arm:
        arm.ask(requests.Acquire())
        yield arm
        arm.ask(requests.ReleaseLease())


def upload(server: AppServer, data: bytes, **query: str) -> tuple[int, dict[str, object]]:
    words = "&".join(f"{key}={quote(value)}" for key, value in query.items())
    status, _, body = ask(f"{server.url}/api/v1/mesh?{words}", data=data)
    return status, json.loads(body)


def test_serve_reads_the_files_of_a_folder(arm: Client) -> None:
    objects = {each.name: each for each in arm.query(answers.Objects).objects}
    assert objects["robot"].scale == 0.5


def test_a_zip_is_one_object_and_its_file_is_chosen(server: AppServer) -> None:
    status, answer = upload(server, zipped(ARTICULATED), name="robot.zip")
    assert (status, answer["triangles"], answer["scale"]) == (200, 36, 1.0)
    pair = zipped({"a.wrl": PARTS["parts/x.wrl"], "b.wrl": PARTS["parts/x.wrl"]})
    status, answer = upload(server, pair, name="pair.zip")
    assert (status, answer["choices"]) == (422, ["a.wrl", "b.wrl"])
    status, answer = upload(server, pair, name="pair.zip", main="b.wrl")
    assert (status, answer["name"]) == (200, "b")
    status, answer = upload(server, pair, name="pair.zip", main="../b.wrl")
    assert status == 422
    assert "no file '../b.wrl'" in str(answer["why"])


def test_a_large_object_is_placed_with_its_scale(arm: Client, tmp_path: Path) -> None:
    path = tmp_path / "house.wrl"
    path.write_text(f"{HEADER}\nShape {{ geometry Box {{ size 5000 1 1 }} }}")
    mesh = arm.upload(path)
    assert mesh.scale == 0.2
    place = requests.Place(name="house", shape=requests.Shape.MESH, mesh=mesh.key)
    with pytest.raises(RefusedError, match=r"must be from 0.001 to 2 m.*Change its scale"):
        arm.ask(place)
    arm.ask(requests.Place(name="house", shape=place.shape, mesh=mesh.key, scale=mesh.scale))


def test_a_missing_file_is_named(server: AppServer) -> None:
    status, answer = upload(server, ARTICULATED["robot.wrl"].encode(), name="robot.wrl")
    assert status == 422
    assert "not there: parts/arm.wrl, parts/tool/grip.wrl. Add them" in str(answer["why"])
