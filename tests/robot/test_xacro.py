"""A robot description in xacro is expanded without ROS, runs no code, and is refused by line."""

from __future__ import annotations

import math
import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest
import trimesh

import katana450
from katana450.arm.robot.loader import load
from katana450.assembly.robot_files import read_robot, read_urdf
from katana450.cli.main import main
from katana450.errors import RobotDescriptionError
from katana450.extensions.xacro import xacro_file
from katana450.extensions.xacro.xacro_process import (
    FORBIDDEN,
    FileGuard,
    UnsafeExpressionError,
    evaluated,
)
from tests.cli.lines import ask
from tests.commands import output
from tests.robot.public_arms import PX150, urdf
from tests.robot.xacro_files import FILE, OPEN, PACKAGE, refusal, templated
from tests.robot.xacro_forks import run_forked

STARTED = (
    "test_a_package_is_expanded_as_it_is_published",
    "test_the_expansion_agrees_with_the_program_xacro",
    "test_an_expansion_that_does_not_start_says_why",
)
"""Tests that start the process as the app does; for the others it is forked, ten times as fast."""


@pytest.fixture(autouse=True)
def _forked(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    if request.function.__name__ not in STARTED:
        monkeypatch.setattr(subprocess, "run", run_forked)


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """A copy of the package, in a folder of another name."""
    return shutil.copytree(PACKAGE, tmp_path / "clone")


def test_a_package_is_expanded_as_it_is_published() -> None:
    robot = read_robot(FILE)
    arm = robot.require_arm()
    assert (robot.name, robot.notes, robot.faults) == ("printed_arm", (), ())
    assert arm.chain.names == ("waist", "shoulder", "elbow", "wrist", "roll")
    np.testing.assert_allclose(arm.chain.lower[[0, 4]], [math.radians(-170), -math.pi])
    np.testing.assert_allclose(arm.chain.speed, [2.0, 2.0, 2.0, 3.0, 3.0])
    reach = [0.05 + 0.16 + 0.065, 0.0, 0.15]
    np.testing.assert_allclose(arm.chain.M[:3, 3], reach)
    assert arm.gripper.slides
    assert [visual.colour for visual in robot.links[1].visuals] == [(255, 128, 0), (150, 156, 163)]
    assert len(robot.links[1].shapes) == 2


def test_without_its_extension_xacro_is_refused_with_what_to_do() -> None:
    with pytest.raises(RobotDescriptionError, match=r"is in xacro\. Install the extension"):
        load(FILE)


def test_a_package_is_found_by_the_name_in_its_manifest(package: Path) -> None:
    assert read_robot(package / "urdf" / FILE.name).require_arm().chain.n == 5


def test_a_package_of_a_ros_workspace_is_found(
    tmp_path: Path, package: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "alone").mkdir()
    path = templated(
        tmp_path / "alone",
        '<xacro:include filename="$(find printed_arm_description)/urdf/materials.xacro"/>',
    )
    assert "there is no package 'printed_arm_description'" in refusal(path)
    for variable, folder in (
        ("ROS_PACKAGE_PATH", package),
        ("AMENT_PREFIX_PATH", tmp_path / "install"),
    ):
        shutil.copytree(
            package, tmp_path / "install/share/printed_arm_description", dirs_exist_ok=True
        )
        with monkeypatch.context() as patch:
            patch.setenv(variable, str(folder))
            assert b"orange" in read_urdf(path)


def test_the_expansion_agrees_with_the_program_xacro(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("AMENT_PREFIX_PATH", "")
    words = (
        "import sys, types; m = types.ModuleType('ament_index_python.packages'); "
        f"m.get_package_share_directory = lambda _: {str(PACKAGE)!r}; "
        "sys.modules[m.__name__] = m; sys.modules['ament_index_python'] = m; "
        f"import xacro; print(xacro.process_file({str(FILE)!r}).documentElement.toxml())"
    )
    stock = output([sys.executable, "-c", words])
    assert read_urdf(FILE).decode() == stock.rstrip("\n")


@pytest.mark.long
def test_every_command_takes_xacro(
    tmp_path: Path, package: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = str(package / "urdf" / FILE.name)
    assert katana450.load(path).n == 5
    (pose,) = ask("fk", [{"q": [0.1, 0.2, 0.3, 0.4, 0.5]}], "--urdf", path)
    (answer,) = ask("ik", [{"T": pose["T"]}], "--urdf", path)
    postures = [solution["q"] for solution in answer["solutions"]]
    assert np.abs(np.array(postures) - [0.1, 0.2, 0.3, 0.4, 0.5]).max(axis=1).min() < 1e-9
    assert main(["export", "urdf", "--urdf", path, "--out", str(tmp_path / "out")]) == 0
    (file,) = (tmp_path / "out").glob("*.zip")
    with zipfile.ZipFile(file) as archive:
        (name,) = [entry for entry in archive.namelist() if entry.endswith(".urdf")]
        text = archive.read(name).decode()
    assert "xacro" not in text
    assert str(package) not in text
    capsys.readouterr()


def test_arguments_without_default_are_given_by_options(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The argument names an included file, whose meshes are in the package."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    package = tmp_path / "pack"
    (package / "urdf").mkdir(parents=True)
    (package / "package.xml").write_text("<package><name>pack</name></package>")
    trimesh.creation.box((0.1, 0.1, 0.1)).export(package / "part.stl")
    (package / "urdf/small.xacro").write_text(
        '<robot name="r" xmlns:xacro="http://ros.org/wiki/xacro"><link name="$(arg root)"><visual>'
        '<geometry><mesh filename="package://pack/part.stl"/></geometry></visual></link></robot>'
    )
    path = package / "urdf/args.urdf.xacro"
    path.write_text(
        '<robot name="r" xmlns:xacro="http://ros.org/wiki/xacro">'
        '<xacro:include filename="$(find pack)/urdf/$(arg model).xacro"/></robot>'
    )
    monkeypatch.chdir(path.parent)
    command = ["export", "vrml", "--urdf", path.name, "--out", str(tmp_path / "out")]
    options = ["--xacro-arg", "model:=small", "--xacro-arg", "root:=base"]
    assert main([*command, *options]) == 0
    text = (tmp_path / "out/r.wrl").read_text()
    assert "base" in text
    assert "IndexedFaceSet" in text
    capsys.readouterr()
    assert main([*command, *options[:2]]) == 1
    assert "--xacro-arg root:=VALUE" in capsys.readouterr().err
    plain = tmp_path / "plain.urdf"
    plain.write_text('<robot name="r"><link name="base"/></robot>')
    assert main(["export", "vrml", "--urdf", str(plain), "--out", str(tmp_path), *options]) == 1
    assert "is not in xacro" in capsys.readouterr().err


def test_a_file_without_the_suffix_is_expanded_too(tmp_path: Path) -> None:
    path = templated(tmp_path, '<xacro:property name="far" value="0.2"/>', name="arm.urdf")
    text = path.read_text().replace('xyz="0.05 0.0 0.15"', 'xyz="${far / 4} 0 0.15"')
    path.write_text(text)
    assert read_robot(path).require_arm().chain.n == 5


def test_an_older_file_needs_no_prefix_at_its_top(tmp_path: Path) -> None:
    (tmp_path / "width.xacro").write_text(OPEN + '<property name="far" value="0.2"/></robot>')
    path = templated(tmp_path, '<include filename="width.xacro"/>')
    text = path.read_text().replace('xyz="0.05 0.0 0.15"', 'xyz="${far / 4} 0 0.15"')
    path.write_text(text)
    assert read_robot(path).require_arm().chain.n == 5


@pytest.mark.cases(8)
@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ('<link name="${1 +}"/>', "line 2: .*syntax.* '1 [+]'"),
        ('<link name="${far}"/>', "line 2: .*'far' is not defined"),
        ('<link name="${1 / 0}"/>', "line 2: .*division by zero.* '1 / 0'"),
        ('<link name="${[1][3]}"/>', "line 2: .*out of range"),
        ("<link name=\"${dict(a=1)['b']}\"/>", "line 2: .*there is no 'b'"),
        ('<xacro:finger side="left"/>', "line 2: .*unknown macro name: xacro:finger"),
        (
            '<xacro:include filename="$(find no_such_arm)/a.xacro"/>',
            "line 2: .*no package 'no_such_arm'. Put its folder .*ROS_PACKAGE_PATH",
        ),
        ('<xacro:include filename="$(find ../..)/a.xacro"/>', "line 2: .*no package"),
        ('<xacro:include filename="lost.xacro"/>', r"line 2: .*lost\.xacro cannot be opened"),
        (
            '<link name="$(arg side)"/>',
            "line 2: .*'side' has no value.* --xacro-arg side:=VALUE",
        ),
        ('<link name="$(env HOME)"/>', "line 2: .*no environment variable 'HOME' of ROS"),
        ('<link name="$(eval 1 +)"/>', "line 2: .*syntax"),
        ('<link name="$(magic x)"/>', "Unknown substitution command"),
        ('<link name="a" ${broken}/>', "its XML is broken.*line 2"),
        ('<xacro:property name="a b" value="1"/>', "valid python identifiers: a b"),
        (
            '<xacro:property name="a" value="${b}"/><xacro:property name="b" value="${a}"/>${a}',
            "circular variable definition: (a -> b -> a|b -> a -> b)",
        ),
        (
            '<xacro:macro name="m" params=""><xacro:m/></xacro:macro><xacro:m/>',
            "contain themselves",
        ),
        pytest.param(
            '<xacro:include filename="arm.urdf.xacro"/>',
            "contain themselves",
            marks=pytest.mark.long,
        ),
        ("<xacro:macro name='m' params='a'/><xacro:m/>", "Undefined parameters .a."),
        pytest.param(
            '<link name="${10 ** 10 ** 10}"/>',
            "more than .* s of processor time or .* MiB",
            marks=pytest.mark.long,
        ),
        ("<link name=\"${'x' * 10 ** 12}\"/>", "line 2: .*it needs too much memory, in"),
        ("<link name=\"${'x' * 3 * 10 ** 7}\"/>", "more than 20,000,000 characters"),
        ("<link name=\"${'\\ud800'}\"/>", "line 2: .*a surrogate is not a character"),
        ("<link name=\"$(eval '\\udfff')\"/>", "line 2: .*a surrogate is not a character"),
        ('<material name="$(env ROS_NAME)"/>', "a surrogate is not a character"),
    ],
)
def test_every_fault_is_reported_with_its_cause(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, line: str, expected: str
) -> None:
    # Only the number without end needs its time out; any other fault is found, however late.
    monkeypatch.setenv("ROS_NAME", "\udc80")
    monkeypatch.setattr(xacro_file, "SECONDS", 5.0 if "10 ** 10 ** 10" in line else 60.0)
    path = templated(tmp_path, line)
    message = refusal(path)
    assert message.startswith(str(path))
    assert re.search(expected, message)


@pytest.mark.parametrize(
    "line",
    [
        "<link name=\"${dict()['a' * 150000000]}\"/>",
        "<link name=\"${xacro.fatal('\\x1b[31m' + 'a' * 3000)}\"/>",
        "<xacro:include filename=\"${'\\x00' + 'a' * 3000}\"/>",
        "<xacro:include filename=\"${'\\x1b' + 'a' * 3000}\"/>",
    ],
)
def test_the_words_of_a_fault_are_few_and_printable(tmp_path: Path, line: str) -> None:
    path = templated(tmp_path, line)
    message = refusal(path)
    assert message.startswith(f"{path}")
    assert len(message) < len(str(path)) + 400
    assert message.isprintable()


def test_an_expansion_that_does_not_start_says_why(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "xacro.py").write_text("raise ImportError('a broken installation')")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    with pytest.raises(
        RobotDescriptionError, match=r"did not start: ImportError: a broken installation\.$"
    ):
        read_robot(templated(tmp_path, '<link name="${1}"/>'))


def test_the_fault_of_an_included_file_names_that_file(package: Path) -> None:
    joints = package / "urdf" / "joints.xacro"
    text = joints.read_text()
    joints.write_text(text.replace("${limit.speed}", "${limit.sped}"))
    message = refusal(package / "urdf" / FILE.name)
    assert f"{joints}, line " in message
    assert "'sped' is not allowed, or does not exist" in message
    joints.write_text(text.replace("</link>", ""))
    assert f"{joints}, line " in refusal(package / "urdf" / FILE.name)


def test_a_file_of_macros_names_its_remedy() -> None:
    message = refusal(PACKAGE / "urdf" / "joints.xacro")
    assert "name the file that includes it" in message


def test_plain_values_keep_their_methods() -> None:
    symbols = {"text": "a_b", "settings": {"left": {"x": 2}}, "sum": sum}
    assert evaluated("text.replace('_', '-').split('-')", dict(symbols)) == ["a", "b"]
    assert evaluated("settings.left.x + len", symbols | {"len": 3}) == 5
    assert evaluated("sum([x.real for x in [1, 2]])", dict(symbols)) == 3
    with pytest.raises(UnsafeExpressionError, match="'_mapping' is not allowed"):
        evaluated("settings._mapping", dict(symbols))


def test_a_plain_file_starts_no_process(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr(subprocess, "run")
    path = tmp_path / "arm.urdf"
    path.write_text(urdf("arm", PX150).replace("<robot ", f"{OPEN[:7]}{OPEN[18:-2]} ", 1))
    assert "xmlns:xacro" in path.read_text()
    assert read_robot(path).require_arm().chain.n == 5


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
