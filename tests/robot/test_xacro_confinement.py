"""The expansion of xacro reads nothing outside the packages of a robot and starts nothing."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest

from katana450.assembly.robot_files import read_robot, read_urdf
from katana450.extensions.xacro.xacro_process import FORBIDDEN, FileGuard
from tests.robot.xacro_files import FILE, OPEN, PACKAGE, refusal, templated


@pytest.mark.cases(5)
@pytest.mark.parametrize(
    "expression",
    [
        "[x.__class__ for x in [1]]",
        "[x.__class__.__base__.__subclasses__() for x in [1]]",
        "(lambda x: x.__class__)(1)",
        "'{0.__class__}'.format(1)",
        "'{a.__class__}'.format_map(dict(a=1))",
        "(x for x in [1]).gi_frame.f_builtins",
        "str.mro()",
        "__import__('os')",
        "[__builtins__ for x in [1]]",
        "open('/etc/passwd')",
        "xacro.load_yaml.__globals__",
        "python.type(1)",
        "python.vars(str)",
        "xacro.parent",
        "[0 for python.x in [1]]",
    ],
)
def test_an_expression_reaches_no_other_code(tmp_path: Path, expression: str) -> None:
    escaped = expression.replace('"', "&quot;")
    path = templated(tmp_path, f'<link name="${{{escaped}}}"/>')
    assert "line 2" in refusal(path)


def test_the_old_evaluation_has_no_builtins(tmp_path: Path) -> None:
    mark = tmp_path / "mark"
    path = templated(
        tmp_path,
        f"<xacro:property name='code' value=\"open('{mark}', 'w')\"/>",
        '<link name="$(eval ${code})"/>',
    )
    assert "'open' is not defined" in refusal(path)
    assert not mark.exists()


def test_the_environment_stays_private(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("KATANA450_SECRET", "seen")
    monkeypatch.setenv("ROS_DISTRO", "jazzy")
    path = templated(
        tmp_path, '<material name="$(optenv KATANA450_SECRET hidden) $(env ROS_DISTRO)"/>'
    )
    assert b"hidden jazzy" in read_urdf(path)


@pytest.mark.cases(1)
@pytest.mark.parametrize("name", ["PATH", "LANG", "HOME"])
def test_only_variables_of_ros_are_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.setenv("LANG", "C.UTF-8")
    path = templated(tmp_path, f'<link name="$(env {name})"/>')
    assert f"line 2: this cannot be expanded: there is no environment variable '{name}'" in (
        refusal(path)
    )
    path = templated(tmp_path, f'<material name="$(optenv {name} hidden)"/>')
    assert b'"hidden"' in read_urdf(path)


OUTSIDE = r"secret\.xacro cannot be opened \(it is outside the packages of the robot\)"


@pytest.mark.cases(4)
@pytest.mark.parametrize(
    "line",
    [
        "<link name=\"${xacro.load_yaml('FOLDER/secret.xacro')}\"/>",
        "<link name=\"${xacro.load_yaml('FOLDER/sec' + 'ret.xacro')}\"/>",
        '<xacro:include filename="FOLDER/secret.xacro"/>',
        '<xacro:include filename="../secret.xacro"/>',
        '<xacro:include filename="../*.xacro"/>',
        '<xacro:include filename="linked/secret.xacro"/>',
        '<xacro:include filename="$(find linked)/secret.xacro"/>',
    ],
)
def test_files_outside_the_packages_are_not_read(tmp_path: Path, line: str) -> None:
    outside = tmp_path / "outside"
    (outside / "arm").mkdir(parents=True)
    (outside / "secret.xacro").write_text(OPEN + "</robot>")
    (outside / "arm" / "linked").symlink_to(outside)
    path = templated(outside / "arm", line.replace("FOLDER", str(outside)))
    expected = "no package 'linked'" if "$(find" in line else OUTSIDE
    place = "" if "*" in line else "line 2: .*"
    assert re.search(place + expected, refusal(path))


def test_a_name_outside_the_packages_that_is_computed_is_refused(tmp_path: Path) -> None:
    path = templated(tmp_path, "<xacro:include filename=\"/etc/${'host' + 'name'}\"/>")
    assert "(it is outside the packages of the robot)" in refusal(path)


def test_the_root_and_the_home_folder_are_no_places_of_packages(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    home = tmp_path / "home"
    (home / "arm").mkdir(parents=True)
    (home / "letters").mkdir()
    monkeypatch.setenv("HOME", str(home))
    monkeypatch.setenv("USERPROFILE", str(home))
    for name in ("etc", "home", "letters", tmp_path.name):
        path = templated(home / "arm", f'<material name="$(find {name})"/>')
        assert f"line 2: this cannot be expanded: there is no package {name!r}" in refusal(path)
    (home / "letters" / "package.xml").write_text("<package><name>other</name></package>")
    path = templated(home / "arm", '<material name="$(find letters)"/>')
    assert str(home / "letters").encode() in read_urdf(path)


def test_a_package_installed_as_links_to_its_source_is_read(tmp_path: Path) -> None:
    package = shutil.copytree(PACKAGE, tmp_path / "clone")
    installed = tmp_path / "share" / PACKAGE.name
    for file in package.rglob("*"):
        if file.is_file():
            link = installed / file.relative_to(package)
            link.parent.mkdir(parents=True, exist_ok=True)
            link.symlink_to(file)
    assert read_robot(installed / "urdf" / FILE.name).require_arm().chain.n == 5


def test_a_package_without_a_manifest_is_found_by_its_folder(tmp_path: Path) -> None:
    package = shutil.copytree(PACKAGE, tmp_path / PACKAGE.name)
    (package / "package.xml").unlink()
    assert read_robot(package / "urdf" / FILE.name).require_arm().chain.n == 5


def test_the_expansion_starts_nothing() -> None:
    guard = FileGuard(FILE)
    for event in FORBIDDEN:
        with pytest.raises(Exception, match=f"it must not call {event}"):
            guard(event, ())
