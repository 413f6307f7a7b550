"""Check the OpenAPI document: by a validator, and by the messages of a server."""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from katana450.arm.control.commands.act import tag_of
from katana450.assembly.robot_session import find_robot
from katana450.extensions.api_description import openapi_json
from katana450.resources import URDF_PATH
from katana450.server.api import answers
from katana450.server.web import http_api
from katana450.settings import Settings
from tests.api.test_documented import EVERY_REQUEST
from tests.commands import completed
from tests.exchange.tools import OPENAPI_VALIDATOR, needs_package
from tests.gateway.virtual import Socket, VirtualServer


@cache
def openapi() -> dict[str, Any]:
    described: dict[str, Any] = json.loads(openapi_json(EVERY_REQUEST))
    return described


@pytest.fixture(scope="module")
def local() -> Iterator[VirtualServer]:
    with VirtualServer(find_robot(Settings(), URDF_PATH, None)) as server:
        yield server


def resolved(document: dict[str, Any], reference: str) -> Any:
    """Return what a reference such as ``#/a/b`` leads to, through further references."""
    part: Any = document
    for name in reference.removeprefix("#/").split("/"):
        part = part[name]
    return resolved(document, part["$ref"]) if "$ref" in part else part


def test_generators_of_clients_can_read_every_schema() -> None:
    # openapi-python-client refuses `false` as a schema, and others name a class Do17.
    schemas: list[Any] = list(openapi()["components"]["schemas"].values())
    assert openapi()["components"]["schemas"]["Stop"]["properties"]["do"] == {"const": "stop"}
    for schema in schemas:
        parts = schema.values() if isinstance(schema, dict) else schema
        schemas += [part for part in parts if isinstance(part, (dict, list))]
        if isinstance(schema, dict):
            assert schema.get("items") is not False, schema
            assert len(schema.get("enum", "ab")) > 1, schema


def test_every_reference_leads_somewhere() -> None:
    document = openapi()
    references = set(re.findall(r'"\$ref": "([^"]+)"', json.dumps(document)))
    assert len(references) > 30
    for reference in references:
        assert resolved(document, reference)


def test_every_operation_of_openapi_has_a_name_of_its_own() -> None:
    operations = [operation for path in openapi()["paths"].values() for operation in path.values()]
    names = [operation["operationId"] for operation in operations]
    assert len(names) == len(openapi()["paths"])
    assert len(set(names)) == len(names)
    assert all(re.fullmatch(r"[a-z_]+", name) for name in names)
    assert openapi()["servers"][0]["url"] == "/"


def test_every_refusal_of_openapi_has_the_schema_of_a_refusal() -> None:
    operations = [operation for path in openapi()["paths"].values() for operation in path.values()]
    refusals = [
        (status, response.get("content"))
        for operation in operations
        for status, response in operation["responses"].items()
        if status.startswith("4")
    ]
    assert len(refusals) > 50
    # A motion that ends elsewhere than asked is reported with the status of a refusal.
    wrong = [
        refusal for refusal in refusals if "#/components/schemas/Refused" not in json.dumps(refusal)
    ]
    assert wrong == []


def test_fields_are_described_with_their_units() -> None:
    schemas = openapi()["components"]["schemas"]
    assert schemas["Margins"]["properties"]["limits"]["description"].count("[rad]")
    assert schemas["Joint"]["properties"]["value"]["description"].startswith("Target [rad]")
    assert "Attributes" not in json.dumps(schemas)


def checked(message: dict[str, Any]) -> str:
    """Return the name of a message that fits the schema of its name."""
    message = dict(message)
    name = next(
        answer.__name__ for answer in answers.EVERY if tag_of(answer.__name__) == message["is"]
    )
    schema = {"$ref": f"#/components/schemas/{name}", "components": openapi()["components"]}
    jsonschema.Draft202012Validator(schema).validate(message)
    return name


async def test_welcome_fits_its_schema(local: VirtualServer) -> None:
    socket = Socket(local, "/api/v1/socket?name=Schemas", {})
    assert checked(json.loads(await socket.recv())) == "Welcome"


def test_messages_of_a_server_fit_the_schemas(local: VirtualServer) -> None:
    with local.speaking("Schemas") as lines:
        questions: list[dict[str, Any]] = [
            *(
                {"do": "query", "at": topic}
                for topic in ("state", "arm", "objects", "world", "loop")
            ),
            *({"do": "query", "at": topic} for topic in ("branches", "program_plan")),
            {"do": "get", "node": "tcp", "field": "translation"},
            {"do": "heartbeat"},
            {"do": "nudge", "axis": 5, "by": 0.1, "wait": 20},
            {"do": "joint", "axis": 5, "value": 40},
            {"do": "joint", "axis": 9, "value": 0},
        ]
        kinds = {checked(lines.answer(**request)) for request in questions}
    others = {"Mesh", "Scene", "Welcome"}
    assert kinds == {kind.__name__ for kind in answers.EVERY} - others
    with pytest.raises(jsonschema.ValidationError):
        checked({"is": "echo", "n": "one"})
    # A pose is four rows of four numbers.
    schema = {"$ref": "#/components/schemas/Pose", "components": openapi()["components"]}
    pose = {"do": "pose", "T": [[1, 0, 0, 0.4], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]}
    jsonschema.Draft202012Validator(schema).validate(pose)
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.Draft202012Validator(schema).validate({**pose, "T": [[1, 0, 0, 0.4]]})


def test_server_describes_its_requests_and_questions(local: VirtualServer) -> None:
    served = json.loads(local.ask("/api/v1/openapi.json")[2])
    assert served["paths"] == openapi()["paths"]
    assert {*served["paths"]} == {
        f"/api/v1/{name}" for name in ("do", "stop", *http_api.QUERY_SUBJECTS)
    }
    assert {kind.__name__ for kind in (*EVERY_REQUEST, *answers.EVERY)} <= {
        *served["components"]["schemas"]
    }


@pytest.mark.long
@needs_package(OPENAPI_VALIDATOR)
def test_validator_of_openapi_finds_nothing(tmp_path: Path) -> None:
    file = tmp_path / "openapi.json"
    for document, status in ((openapi(), 0), ({**openapi(), "paths": {"x": {"get": 3}}}, 1)):
        file.write_text(json.dumps(document), encoding="utf-8")
        done = completed(
            [sys.executable, "-m", "openapi_spec_validator", str(file)],
            env={"PYTHONPATH": str(OPENAPI_VALIDATOR.folder)},
        )
        assert done.returncode == status, done.stdout + done.stderr
