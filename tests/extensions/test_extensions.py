"""Test built-in and added extensions with the command line in subprocesses."""

from __future__ import annotations

import dataclasses
import sys
import urllib.request
from pathlib import Path

import pytest

from katana450.extension import Extension, extensions, load
from katana450.server.api.fields import ROOT as ROOT_PATH
from tests.browser.server import AppServer
from tests.commands import completed
from tests.extensions.environments import distribution

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

UNKNOWN_PART = """
from katana450.extension import Extension

EXTENSION = Extension("weather", prepare="station:missing")
"""

SERVED = """
from starlette.responses import PlainTextResponse
from starlette.routing import Route

from katana450.extension import Extension

def add_options(parser):
    parser.add_argument("--degrees", type=int, default=20)

def routes(context):
    async def weather(request):
        context.identity(request)
        return PlainTextResponse(f"arm: {context.hub.arm is not None}")
    return [Route("/api/v1/weather", weather)]

def view_layer(options):
    assert options.degrees == 7

EXTENSION = Extension(
    "weather", serve_options=add_options, view_layer=view_layer, routes="station:routes"
)
"""


def katana450(*options: str, folder: Path | None = None, text: str = "") -> str:
    """Return exit status, a space, and the output of a command with its errors."""
    environment = {} if folder is None else {"PYTHONPATH": str(folder)}
    done = completed([sys.executable, "-m", "katana450", *options], text=text, env=environment)
    assert "Traceback" not in done.stderr
    return f"{done.returncode} {done.stdout}{done.stderr}"


def test_every_part_of_the_built_in_extensions_is_found() -> None:
    parts = [field.name for field in dataclasses.fields(Extension)]
    for extension in extensions():
        targets = [getattr(extension, part) for part in parts if part not in ("name", "commands")]
        for command in extension.commands:
            targets += [command.add_options, command.run]
        for target in targets:
            assert target is None or callable(load(target)), (extension.name, target)


@pytest.mark.long
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
        pytest.param(
            "station:EXTENSION",
            "import no_such_thing",
            "No module named 'no_such_thing'",
            marks=pytest.mark.long,
        ),
        pytest.param(
            "station:EXTENSION", "EXTENSION = 7", "is not an Extension", marks=pytest.mark.long
        ),
        ("station:EXTENSION", STATION.replace("NAME", "'fk'"), "two commands fk"),
        ("station:EXTENSION", UNKNOWN_PART, "weather cannot be loaded"),
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
