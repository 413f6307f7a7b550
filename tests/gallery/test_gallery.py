"""Robots of the gallery by name, from a stand-in for the package that downloads them."""

from __future__ import annotations

import io
import json
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from katana450.arm.robot.loader import load
from katana450.cli.main import main
from katana450.errors import ConfigurationError
from katana450.extensions.gallery.arms_command import file_of, listed_robots, robot_named
from katana450.extensions.robot_choice.robot_routes import choices
from katana450.resources import INCLUDED, URDF_PATH
from tests.browser.server import APP, AppServer
from tests.gallery.stand_in import write_package


def _forget(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in [
        module for module in sys.modules if module.partition(".")[0] == "robot_descriptions"
    ]:
        monkeypatch.delitem(sys.modules, name)


@pytest.fixture
def arms(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Return the folder of the robots of the stand-in, which is installed for this test."""
    _forget(monkeypatch)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setenv("LOCALAPPDATA", str(tmp_path / "cache"))
    package = write_package(tmp_path)
    yield package
    _forget(monkeypatch)


def why(name: str) -> str:
    with pytest.raises(ConfigurationError) as refused:
        file_of(robot_named(name))
    return str(refused.value)


@pytest.mark.usefixtures("arms")
@pytest.mark.parametrize(
    ("typed", "name"),
    [
        ("ur5e", "ur5e"),
        ("ur5e_description", "ur5e"),
        ("SO-101", "so101"),
        ("SO-ARM101", "so_arm101"),
        ("OpenManipulator-X", "open_manipulator_x"),
        ("iiwa 14", "iiwa14"),
    ],
)
def test_a_robot_is_found_by_any_common_form_of_its_name(typed: str, name: str) -> None:
    assert robot_named(typed).name == name


@pytest.mark.usefixtures("arms")
def test_arms_are_listed_with_common_names_and_apart_from_other_robots() -> None:
    listed = {choice.name: (choice.kind, choice.title) for choice in choices(URDF_PATH)}
    assert [*listed][:2] == ["katana450", "so101"]
    assert listed["so101"] == ("included", "SO-101")
    assert listed["so_arm101"] == ("gallery", "SO-ARM101")
    assert listed["allegro_hand"] == ("other", "Allegro Hand (allegro)")


@pytest.mark.usefixtures("arms")
def test_an_unknown_name_is_refused_with_the_nearest_names() -> None:
    message = why("pandda")
    assert message.startswith("The gallery has no robot 'pandda'. Nearest names: panda")
    assert "katana450 arms" in message
    assert "Nearest" not in why("qqqqqqqq")
    assert "as MJCF only" in why("yam_mj")


@pytest.mark.usefixtures("arms")
def test_the_list_states_maker_and_licence(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["arms"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].split() == ["NAME", "ROBOT", "MAKER", "LICENCE"]
    rows = {line.split()[0]: line for line in lines[1:12]}
    assert set(rows) == {*INCLUDED} | {
        robot.name for robot in listed_robots().values() if robot.urdf
    }
    assert rows["so_arm101"].endswith("Apache-2.0")
    assert "Universal Robots" in rows["ur5e"]
    assert "11 robots" in lines[-1]


def test_included_robots_need_no_package(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "robot_descriptions", None)
    assert main(["arms"]) == 0
    assert "\nso101      SO-101 " in (listed := capsys.readouterr().out)
    assert "2 robots. Robots of the gallery need the extra" in listed
    assert main(["arms", "SO-101"]) == 0
    assert capsys.readouterr().out == f"{INCLUDED['so101']}\n"
    monkeypatch.setattr(sys, "stdin", io.StringIO('{"q": [0, 0, 0, 0, 0]}\n'))
    assert main(["fk", "--arm", "so101"]) == 0


def test_one_robot_prints_its_file_and_its_licence(
    arms: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["arms", "allegro"]) == 0
    printed = capsys.readouterr()
    # Standard output is for programs: the progress of the package is not there.
    assert printed.out == f"{arms / 'hand.urdf'}\n"
    assert "Allegro Hand. Licence of the description: BSD." in printed.err
    assert main(["arms", "ur5e"]) == 0
    assert "https://example.org/arms/blob/0123abc/LICENSE" in capsys.readouterr().err


def test_xacro_is_expanded_with_its_arguments_and_finds_its_meshes(
    arms: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    file = file_of(robot_named("ur5e"))
    robot = load(file)
    assert robot.name == "ur5e"
    (visual,) = robot.links[0].visuals
    assert visual.file == (arms / "base.stl").resolve()
    np.testing.assert_allclose(robot.home["tool0"][:3, 3], (0.817, 0.23, 0.06), atol=1e-9)
    # The same file again, and the command takes it by name.
    assert file_of(robot_named("ur5e")) == file
    monkeypatch.setattr(sys, "stdin", io.StringIO('{"q": [0, 0, 0, 0, 0, 0]}\n'))
    assert main(["fk", "--arm", "UR5e", "--tool", "tool0", "--frame", "base"]) == 0
    printed = capsys.readouterr()
    T = np.array(json.loads(printed.out.splitlines()[0])["T"])
    np.testing.assert_allclose(T, robot.home["tool0"], atol=1e-9)
    assert "Universal Robots" in printed.err


@pytest.mark.usefixtures("arms")
def test_each_failure_of_a_download_says_what_to_do(capsys: pytest.CaptureFixture[str]) -> None:
    message = why("panda")
    assert capsys.readouterr().err.endswith("Cloning: 0 %\n")
    assert "cannot be downloaded from https://example.org/arms: Unable to access" in message
    assert "Could not resolve host: example.org" in message
    assert "Check the connection" in message
    assert "Install git" in why("iiwa14")
    assert "is not complete" in why("sawyer")
    assert "names no URDF file" in why("gen3")
    assert "module_that_is_not_there" in why("xarm6")


@pytest.mark.usefixtures("arms")
def test_name_and_file_together_are_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["serve", "--arm", "allegro", "--urdf", "other.urdf"]) == 1
    assert "name two robots" in capsys.readouterr().err


@pytest.mark.parametrize("command", ["fk", "serve"])
@pytest.mark.parametrize("address", ["tcp://192.0.2.1", "192.0.2.1", "/dev/ttyACM0", "ur5e.urdf"])
def test_address_of_a_real_arm_is_no_name(
    command: str, address: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        main([command, "--arm", address])
    said = capsys.readouterr().err
    assert f"{address!r} is an address or a file" in said
    assert "by --device" in said


@pytest.mark.long
@pytest.mark.usefixtures("arms")
def test_a_server_drives_a_robot_of_the_gallery() -> None:
    with AppServer((*APP, "--arm", "allegro")) as server:
        assert "Licence of the description: BSD." in server.output
        assert "Joints only." in server.output
