"""Uploads of several files and of any size by a program: choices, scales, and what is refused."""

from __future__ import annotations

import json
from typing import Any
from urllib.parse import quote

import pytest
from msgspec import structs

from katana450.client import Client, RefusedError
from katana450.extensions.export.vrml.vrml_world import HEADER
from katana450.server.api import requests
from tests.exchange.shape_bytes import zipped
from tests.exchange.test_several_files import ARTICULATED, PARTS
from tests.gateway.virtual import VirtualServer


def upload(local: VirtualServer, data: bytes, **query: str) -> tuple[int, dict[str, Any]]:
    words = "&".join(f"{key}={quote(value)}" for key, value in query.items())
    status, _, body = local.ask(f"/api/v1/mesh?{words}", data=data)
    return status, json.loads(body)


def test_a_zip_is_one_object_and_its_file_is_chosen(local: VirtualServer) -> None:
    status, answer = upload(local, zipped(ARTICULATED), name="robot.zip")
    assert (status, answer["triangles"], answer["scale"]) == (200, 36, 1.0)
    pair = zipped({"a.wrl": PARTS["parts/x.wrl"], "b.wrl": PARTS["parts/x.wrl"]})
    status, answer = upload(local, pair, name="pair.zip")
    assert (status, answer["choices"]) == (422, ["a.wrl", "b.wrl"])
    status, answer = upload(local, pair, name="pair.zip", main="b.wrl")
    assert (status, answer["name"]) == (200, "b")
    status, answer = upload(local, pair, name="pair.zip", main="../b.wrl")
    assert status == 422
    assert "no file '../b.wrl'" in str(answer["why"])


def test_a_large_object_is_placed_with_its_scale(local: VirtualServer, program: Client) -> None:
    house = f"{HEADER}\nShape {{ geometry Box {{ size 5000 1 1 }} }}".encode()
    _, mesh = upload(local, house, name="house.wrl")
    assert mesh["scale"] == 0.2
    place = requests.Place(name="house", shape=requests.Shape.MESH, mesh=mesh["key"])
    with pytest.raises(RefusedError, match=r"must be from 0.001 to 2 m.*Change its scale"):
        program.ask(place)
    program.ask(structs.replace(place, scale=mesh["scale"]))
