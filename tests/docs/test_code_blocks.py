"""Every code block of the documents is run or read as it is printed."""

from __future__ import annotations

import doctest
import json
import os
import re
import shlex
import sys
import tomllib
from pathlib import Path
from types import CodeType

import pytest
import yaml

from katana450.cli.main import _parser, main
from katana450.client import RefusedError, connect
from katana450.extension import Extension
from katana450.server.api import requests
from katana450.server.api.program_requests import Program, Steer
from katana450.server.api.requests import RequestDecoder
from tests.browser.server import ROOT, AppServer
from tests.commands import output
from tests.docs.code_blocks import CodeBlock, code_block, code_blocks
from tests.recording.sessions import drag, record_session

PRINTED_URL = "http://127.0.0.1:8080"
SECONDS = 120
SCENE = """\
scene: 1
objects:
- name: box
  shape: box
  size: [40, 40, 40]
  pose: [-250, 250, 0, 0, 0, 0]
"""

# Languages that a test below runs or reads; tests/exchange/test_c_kinematics.py compiles C.
CHECKED = {"c", "console", "csv", "json", "pycon", "python", "sh", "toml", "yaml"}
# Other languages, and why nothing runs them.
NOT_CHECKED = {
    "mermaid": "a diagram that is written from a table, as its document says",
    "text": "a diagram, or a summary of options, which is compared with the help",
    "js": "tests/browser/test_roslib.py runs a page with the same calls",
    "caddy": "the configuration of another program, which is not installed here",
    "nginx": "the configuration of another program, which is not installed here",
    "xml": "a part of a description, of which tests/physics/test_suction_cup.py has a whole one",
    "ini": "the configuration of another program, which is not installed here",
}
# Commands of shell blocks that are neither ours nor targets of make, and where they are run.
ELSEWHERE = {
    "apt-get": "changes the system",
    "sudo apt": "changes the system",
    "uv tool install": "tests/packaging/test_tool_install.py",
    "python -m pip install": "downloads; tests/packaging/test_extras.py has the messages",
    "pipx install": "installs the same package as uv; pipx is not among the dependencies",
    "docker": "needs a container service; .ci/image builds and runs the image without one",
    "export": "sets a variable for docker",
    "git": "reads the history, which an archive of the sources does not have",
    "ros2": "needs ROS 2, which is not here",
    "./viewer": "tests/exchange compiles and runs it",
    "make": "tests/exchange runs the Makefile that is exported with the viewer",
    "KEY=": "test_requests_of_the_shell_are_answered",
    "curl": "test_requests_of_the_shell_are_answered",
}
# Commands that are run: those that end by themselves. The options of all others are read.
RUN = ("katana450 access give", "katana450 run square.yaml --dry-run")
RUN_LONG = (
    "katana450 demo circle --headless",
    "katana450 run square.yaml --headless",
)


def identifier(block: CodeBlock) -> str:
    return str(block)


SHELL = [
    pytest.param(block, command, id=f"{block}-{command}")
    for block in code_blocks("sh")
    for command in block.commands
]


@pytest.fixture
def server(plain_server: AppServer) -> AppServer:
    """A server whose arm may move: a program that hangs up while the arm moves stops it."""
    with connect(plain_server.url) as client:
        client.clear_stop()
        client.ask(requests.ReleaseLease())
    return plain_server


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("recorded") / "run.mcap"
    return record_session(path, 220, drag(180))


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, recording: Path) -> Path:
    """An empty folder with the commands of this environment, and what the blocks take as given."""
    (tmp_path / ".venv").symlink_to(Path(sys.executable).parents[1])
    monkeypatch.setenv("PATH", f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}")
    monkeypatch.setenv("MPLBACKEND", "Agg")
    monkeypatch.chdir(tmp_path)
    script = code_block("docs/programs.md", "name: Square").text
    for name in ("square.yaml", "my_script.yaml"):
        (tmp_path / name).write_text(script, encoding="utf-8")
    (tmp_path / "scene.yaml").write_text(SCENE, encoding="utf-8")
    (tmp_path / "run.mcap").symlink_to(recording)
    (tmp_path / "my_arm.urdf").write_bytes((ROOT / "examples" / "my_own_arm.urdf").read_bytes())
    return tmp_path


def own(command: str) -> str:
    """Return a command without the folder of the environment and without ``&``."""
    return command.removesuffix(" &").removeprefix(".venv/bin/")


def run(command: str) -> str:
    """Run a shell command and return what it prints; it has to succeed."""
    return output(["bash", "-c", f"set -e; {command}"], cwd=Path.cwd(), seconds=SECONDS)


def test_every_block_names_a_language_that_is_checked_or_has_a_reason() -> None:
    blocks = code_blocks()
    assert len(blocks) > 25
    unknown = [str(block) for block in blocks if block.language not in CHECKED | set(NOT_CHECKED)]
    assert not unknown, f"name the language behind the fence; one of {sorted(CHECKED)} if it can be"


def executed(code: CodeType, server: AppServer) -> dict[str, object]:
    """Run ``code`` until no sample of a plan is late, and return its names.

    On a busy machine a sample may leave late. The ``server`` then refuses it and those after it,
    and may stop the arm.
    """
    for _ in range(3):
        namespace: dict[str, object] = {"__name__": "printed"}
        try:
            exec(code, namespace)
        except RefusedError as error:
            if " s late: " not in str(error):
                raise
            with connect(server.url, "After a late sample") as client:
                client.clear_stop()
        else:
            return namespace
    raise AssertionError("samples were late in each of three runs")


@pytest.mark.parametrize("block", code_blocks("python"), ids=identifier)
def test_python_runs(block: CodeBlock, folder: Path, server: AppServer) -> None:
    code = compile(block.text.replace(PRINTED_URL, server.url), str(block), "exec")
    namespace = executed(code, server)
    if "savefig" in block.text:
        assert (folder / "circle.png").read_bytes().startswith(b"\x89PNG")
    if isinstance(extension := namespace.get("EXTENSION"), Extension):
        assert [command.name for command in extension.commands] == (
            ["weather"] if extension.name == "weather" else []
        )


@pytest.mark.parametrize("block", code_blocks("pycon"), ids=identifier)
def test_output_of_python_is_as_printed(block: CodeBlock) -> None:
    session = doctest.DocTestParser().get_doctest(
        block.text, {}, str(block), block.document, block.line
    )
    reports: list[str] = []
    doctest.DocTestRunner().run(session, out=reports.append)
    assert session.examples
    assert not reports, "".join(reports)


def test_readme_shows_python_with_its_output_on_one_screen() -> None:
    assert "README.md" in {block.document for block in code_blocks("pycon")}
    assert (ROOT / "README.md").read_bytes().count(b"\n") <= 90


@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize("block", code_blocks("console"), ids=identifier)
def test_output_of_the_console_is_as_printed(block: CodeBlock) -> None:
    prompt, _, output = block.text.partition("\n")
    assert prompt.startswith("$ ")
    assert run(prompt.removeprefix("$ ")) == output


@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize(("block", "command"), SHELL)
def test_command_runs_or_its_options_exist(block: CodeBlock, command: str) -> None:
    command = own(command)
    if command.startswith(RUN):
        assert main(shlex.split(command)[1:]) == 0
    elif command.startswith("katana450 "):
        assert _parser().parse_args(shlex.split(command)[1:]).command
    elif (target := re.fullmatch(r"make ([\w-]+)", command)) is not None:
        makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
        assert re.search(rf"^{target[1]}:", makefile, re.MULTILINE), target[1]
    else:
        assert command.startswith(tuple(ELSEWHERE)), f"{block}: nothing runs {command!r}"


@pytest.mark.long
@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize(("block", "command"), SHELL)
def test_command_that_takes_longer_runs(block: CodeBlock, command: str) -> None:
    if not own(command).startswith(RUN_LONG):
        pytest.skip(f"{block}: read or run by the test above")
    run(own(command))


@pytest.mark.usefixtures("folder")
def test_requests_of_the_shell_are_answered(server: AppServer) -> None:
    block = code_block("docs/api.md", "KEY=")
    printed = run(block.text.replace(PRINTED_URL, server.url)).replace("}{", "}\n{")
    *motions, state = map(json.loads, printed.splitlines())
    ends = [motion["end"]["how"] for motion in motions if "end" in motion]
    assert ends == ["reached"] * 5
    assert [motion["is"] for motion in motions] == ["done"] * 6
    assert (state["is"], state["holder"], state["moving"]) == ("state", None, False)
    assert state["q"] == motions[-1]["end"]["q"]


@pytest.mark.parametrize("block", code_blocks("json"), ids=identifier)
def test_requests_are_understood(block: CodeBlock) -> None:
    decoder = RequestDecoder((Program, Steer))
    for line in block.text.splitlines():
        decoder.decoded(line)


# Scripts are planned and run by the commands of docs/programs.md, see `folder`; the scene is loaded
# by tests/exchange/test_scene_file.py.
@pytest.mark.parametrize("block", code_blocks("toml", "yaml"), ids=identifier)
def test_toml_and_yaml_are_read(block: CodeBlock) -> None:
    read = tomllib.loads if block.language == "toml" else yaml.safe_load
    assert read(block.text)


@pytest.mark.parametrize(
    ("command", "option"),
    sorted(
        {
            (" ".join(line.split()[:2]), option)
            for block in code_blocks("text")
            for line in block.text.splitlines()
            if line.startswith("katana450 ")
            for option in re.findall(r"--[a-z-]+", line)
        }
    ),
)
def test_option_of_a_summary_exists(
    command: str, option: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        _parser().parse_args([command.split()[1], "--help"])
    assert re.search(rf"{option}\b", capsys.readouterr().out)
