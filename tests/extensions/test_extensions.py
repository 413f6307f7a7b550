"""Test found, missing and added extensions with the command line in subprocesses."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import urllib.error
import urllib.request
from pathlib import Path

import pytest

from katana450.client import RefusedError, connect
from katana450.extension import BUILT_IN, extensions
from katana450.server.api import answers, requests
from katana450.server.api.fields import ROOT as ROOT_PATH
from tests.browser.server import APP, AppServer, free_port
from tests.extensions.environments import distribution, without, write_blocking

ROOT = Path(__file__).resolve().parents[2]
LINE = '{"q": [0, 0, 0, 0, 0]}\n'

STATION = """
from katana450.extension import CliCommand, Extension

def run(options):
    print(f"It is {options.degrees} degrees.")
    return 3

def add_options(parser):
    parser.add_argument("--degrees", type=int, default=20)

EXTENSION = Extension("weather", (CliCommand(NAME, "tell the weather", add_options, run),))
"""

SERVED = """
from starlette.responses import PlainTextResponse
from starlette.routing import Route

from katana450.extension import Extension, ServeExtension

def add_options(parser):
    parser.add_argument("--degrees", type=int, default=20)

def routes(context):
    async def weather(request):
        context.identity(request)
        return PlainTextResponse(f"arm: {context.hub.arm is not None}")
    return [Route("/api/v1/weather", weather)]

def view_layer(options):
    assert options.degrees == 7

SERVE = ServeExtension(add_options, view_layer=view_layer, routes=routes)
EXTENSION = Extension("weather", serve=SERVE)
"""


def katana450(*options: str, folder: Path | None = None, blocked: str = "", text: str = "") -> str:
    """Return exit status, a space, and the output of a command with its errors."""
    environment = os.environ | {"BLOCKED": blocked}
    if folder is not None:
        environment["PYTHONPATH"] = str(folder)
    done = subprocess.run(
        [sys.executable, "-m", "katana450", *options],
        input=text,
        capture_output=True,
        text=True,
        cwd=ROOT,
        env=environment,
        timeout=60,
        check=False,
    )
    assert "Traceback" not in done.stderr
    return f"{done.returncode} {done.stdout}{done.stderr}"


@pytest.fixture
def blocking(tmp_path: Path) -> Path:
    """Return a folder whose module blocks the import of the packages in BLOCKED."""
    write_blocking(tmp_path)
    return tmp_path


def test_every_built_in_extension_is_found() -> None:
    assert tuple(extension.name for extension in extensions()) == BUILT_IN


@pytest.mark.parametrize(
    ("name", "commands"),
    [
        ("event_log", ["log"]),
        ("reachability", ["workspace"]),
        ("export", ["export", "render"]),
        ("experiments", ["run", "demo"]),
        ("programs", ["run", "demo"]),
        ("media", ["render"]),
        ("kinematics", ["fk", "ik"]),
        ("server_commands", ["access", "people"]),
    ],
)
def test_commands_of_a_missing_extension_are_not_listed(
    blocking: Path, name: str, commands: list[str]
) -> None:
    blocked = f"katana450.extensions.{name}"
    output = katana450("--help", folder=blocking, blocked=blocked)
    listed = [line.split()[0] for line in output.splitlines() if line.startswith("    ")]
    everything = [
        "serve",
        "fk",
        "ik",
        "access",
        "people",
        "log",
        "workspace",
        "export",
        "run",
        "demo",
        "render",
    ]
    assert [each for each in everything if each not in listed] == commands
    refused = katana450(commands[0], folder=blocking, blocked=blocked)
    assert refused.startswith("2 ")
    assert f"invalid choice: '{commands[0]}'" in refused


def test_server_command_works_without_any_extension(blocking: Path) -> None:
    blocked = "katana450.extensions"
    helped = katana450("--help", folder=blocking, blocked=blocked)
    assert helped.startswith("0 ")
    assert "serve" in helped
    assert "demo" not in helped
    assert "left out" not in helped
    serve = katana450("serve", "--help", folder=blocking, blocked=blocked)
    assert serve.startswith("0 ")
    assert "--workspace" not in serve


def test_command_of_a_missing_extension_reports_it(blocking: Path) -> None:
    blocked = "katana450.extensions.media"
    output = katana450("demo", "circle", "--headless", folder=blocking, blocked=blocked)
    assert output.startswith("1 ")
    assert "The extension media is needed but not installed." in output


NOT_NEEDED = (
    *("importers", "scene", "reachability", "export", "experiments", "media"),
    *("conduit", "ellipsoid", "objects", "undo", "server_commands"),
)
"""Extensions that a server does not need."""


def test_server_runs_without_the_extensions_it_does_not_need(
    blocking: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("BLOCKED", " ".join(f"katana450.extensions.{name}" for name in NOT_NEEDED))
    monkeypatch.setenv("PYTHONPATH", str(blocking))
    with AppServer() as server:
        assert server.running
        with connect(server.url, "Test") as arm:
            assert arm.query(answers.Objects).objects
            assert arm.query(answers.Links).links
            with pytest.raises(RefusedError, match="Install the extension"):
                arm.ask(requests.Get(node="Clock", field="startTime"))
            for absent in (requests.Undo(), requests.Remove(name="cup"), requests.ListPeople()):
                with pytest.raises(RefusedError, match="This server has no request"):
                    arm.ask(absent)
            arm.ask(requests.Home())
        with urllib.request.urlopen(f"{server.url}{ROOT_PATH}/openapi.json", timeout=10) as answer:
            shapes = json.load(answer)["components"]["schemas"]
        assert {"Home", "Stop", "Steer"} <= set(shapes)
        assert not {"Undo", "Place", "Attach", "Load", "Remove", "Fill", "Kick"} & set(shapes)
        upload = urllib.request.Request(f"{server.url}{ROOT_PATH}/mesh?name=a.stl", b"solid")
        with pytest.raises(urllib.error.HTTPError) as refused:
            urllib.request.urlopen(upload, timeout=10)
        with refused.value:
            assert refused.value.code == 404


def test_robot_without_a_tool_is_driven_without_its_view(tmp_path: Path) -> None:
    gantry = str(ROOT / "tests" / "exchange" / "gantry.urdf")
    command = (*APP, "--urdf", gantry)
    with (
        without(tmp_path, "joint_view"),
        AppServer(command) as server,
        connect(server.url, "Test") as arm,
    ):
        goal = [0.1, *arm.query(answers.State).q[1:]]
        assert arm.joints(goal).q == pytest.approx(goal)


def test_option_of_a_missing_extension_is_refused(blocking: Path) -> None:
    blocked = "katana450.extensions.importers"
    output = katana450("serve", "--scene", "scene.yaml", folder=blocking, blocked=blocked)
    assert output.startswith("2 ")
    assert "katana450 serve: error: unrecognized arguments: --scene" in output


@pytest.mark.long
def test_map_is_refused_for_a_mechanism_that_is_not_an_arm(tmp_path: Path) -> None:
    gantry = str(ROOT / "tests" / "exchange" / "gantry.urdf")
    options = ("--urdf", gantry, "--workspace", str(tmp_path / "map.npz"))
    output = katana450("serve", "--port", str(free_port()), *options)
    assert output.startswith("1 ")
    assert "map.npz is a map of the points that a tool reaches. " in output


def test_another_distribution_extends_the_server(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = distribution(tmp_path, "station:EXTENSION", SERVED)
    monkeypatch.setenv("PYTHONPATH", str(folder))
    command = (sys.executable, "-m", "katana450", "serve", "--port", "{port}")
    with (
        AppServer((*command, "--degrees", "7")) as server,
        urllib.request.urlopen(f"{server.url}{ROOT_PATH}/weather", timeout=10) as answer,
    ):
        assert answer.read() == b"arm: True"


def test_another_distribution_adds_a_command(tmp_path: Path) -> None:
    module = STATION.replace("NAME", "'weather'")
    folder = distribution(tmp_path, "station:EXTENSION", module)
    assert "tell the weather" in katana450("--help", folder=folder)
    assert katana450("weather", "--degrees", "7", folder=folder) == "3 It is 7 degrees.\n"


@pytest.mark.parametrize(
    ("entry", "module", "message"),
    [
        ("station:EXTENSION", "raise ValueError('no wind')", "weather cannot be loaded"),
        ("station:EXTENSION", "import no_such_thing", "No module named 'no_such_thing'"),
        ("station:EXTENSION", "EXTENSION = 7", "is not an Extension"),
        ("station:EXTENSION", STATION.replace("NAME", "'fk'"), "two commands fk"),
    ],
)
def test_broken_extension_of_another_distribution_is_reported_and_left_out(
    tmp_path: Path, entry: str, module: str, message: str
) -> None:
    folder = distribution(tmp_path, entry, module)
    answered = katana450("fk", folder=folder, text=LINE)
    assert answered.startswith("0 ")
    assert '"T": [[1.0, ' in answered
    assert message in answered


def test_reading_options_loads_nothing_heavy() -> None:
    code = (
        "import sys; from katana450.cli.main import _parser; _parser();"
        "heavy = {'numpy', 'viser', 'yaml', 'trimesh', 'asyncio', 'importlib.metadata'};"
        "print(*sorted(heavy & set(sys.modules)))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60
    )
    assert done.stdout.split() == []
