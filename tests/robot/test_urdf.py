"""A URDF file is read by yourdfpy, as plain values that are complete."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from katana450.arm.robot.loader import load
from katana450.arm.robot.urdf import Urdf, urdf_of
from katana450.arm.robot.visual import GREY
from katana450.errors import RobotDescriptionError
from katana450.settings import Settings
from tests.commands import modules_after, output
from tests.robot.public_arms import PX150, J, urdf, written

EVERYTHING = """<robot name="all of it">
  <material name="sky"><color rgba="0.2 0.4 1.0 0.5"/></material>
  <material name="none"/>
  <link name="root">
    <inertial><origin xyz="0.1 -0.2 0.3" rpy="1 2 3"/><mass value="2.5"/></inertial>
    <visual><origin rpy="0.3 -1.1 2.9"/><geometry><box size="0.1,0.2, 0.3"/></geometry>
      <material name="sky"/></visual>
    <visual><geometry><sphere radius="0.1"/></geometry>
      <material name="own"><color rgba="0 1.5 0.5"/></material></visual>
    <visual><geometry><cylinder radius="0.1" length="0.4"/></geometry>
      <material name="none"/></visual>
    <collision><origin xyz="1 2 3"/><geometry><box size="1 2 3"/></geometry></collision>
  </link>
  <link name="led"/><link name="leader"/><link name="endless"/><link name="held"/>
  <joint name="a" type="revolute"><parent link="root"/><child link="led"/>
    <origin xyz="0.1 0 0" rpy="0.4 1.57079632679 -3"/><axis xyz="0 3 4"/>
    <limit upper="1.5" effort="1"/><mimic joint="b"/></joint>
  <joint name="b" type="prismatic"><parent link="led"/><child link="leader"/>
    <limit lower="-0.1" upper="0.2" velocity="0.3" effort="1"/></joint>
  <joint name="c" type="continuous"><parent link="leader"/><child link="endless"/>
    <origin xyz="0 0 1"/><mimic joint="b" multiplier="-2" offset="0.25"/></joint>
  <joint name="d" type="fixed"><parent link="endless"/><child link="held"/>
    <origin rpy="-1 0.5 0.25"/></joint>
</robot>"""


@pytest.fixture
def everything(tmp_path: Path) -> Path:
    path = tmp_path / "all.urdf"
    path.write_text(EVERYTHING)
    return path


def read(path: Path) -> Urdf:
    return urdf_of(path.read_bytes(), path.parent)


def test_links_have_their_shapes_colors_and_mass(everything: Path) -> None:
    root = read(everything).links["root"]
    assert [visual.colour for visual in root.visuals] == [(51, 102, 255), (0, 255, 128), GREY]
    box, ball, can = (shape.mesh for shape in root.visuals)
    assert box.volume == pytest.approx(0.1 * 0.2 * 0.3)
    assert ball.extents == pytest.approx((0.2, 0.2, 0.2), abs=2e-3)
    assert can.extents == pytest.approx((0.2, 0.2, 0.4), abs=2e-3)
    (collision,) = root.collisions
    assert collision.mesh.bounds.tolist() == [[0.5, 1.0, 1.5], [1.5, 3.0, 4.5]]
    assert root.inertial is not None
    assert (root.inertial.mass, root.inertial.T_link_inertia[:3, 3].tolist()) == (
        2.5,
        [0.1, -0.2, 0.3],
    )


def test_libraries_are_loaded_when_they_are_needed() -> None:
    load = "from katana450.arm.robot.loader import load"
    assert not modules_after(load) & {"trimesh", "yourdfpy"}
    assert not modules_after(f"{load}; load()") & {"mujoco", "viser"}


def test_described_robot_needs_no_engine_until_a_distance_is_measured() -> None:
    script = (
        "import sys; from katana450.assembly.robot_session import find_robot;"
        "from katana450.resources import URDF_PATH; from katana450.settings import Settings;"
        "session = find_robot(Settings(), URDF_PATH, None).session;"
        "before = 'mujoco' in sys.modules; session.choices(session.begin(session.ready, 0.0, 0.0));"
        "print(before, 'mujoco' in sys.modules)"
    )
    # The first process may have to find the pairs that can meet, and keeps them.
    first, second = (output([sys.executable, "-c", script]) for _ in range(2))
    assert first.endswith("True\n")
    assert second == "False True\n"


@pytest.mark.parametrize(
    "part",
    ["<gazebo>" * 300 + "</gazebo>" * 300, f"<gazebo a='{'x' * 11_000_000}'/>"],
    ids=["deep", "long"],
)
def test_file_that_yourdfpy_reads_in_part_is_refused(tmp_path: Path, part: str) -> None:
    path = tmp_path / "far.urdf"
    path.write_text(f"<robot name='far'><link name='root'/>{part}</robot>")
    with pytest.raises(RobotDescriptionError, match=r"far\.urdf cannot be read"):
        load(path)


def test_joint_that_cannot_be_moved_rests_in_an_arm_and_in_no_export(tmp_path: Path) -> None:
    loose = J("afloat", "floating", "base", "buoy", (0.0, 0.0, 0.1))
    robot = load(written(tmp_path, "arm", [*PX150, loose]))
    arm = robot.require_arm()
    assert "Joint 'afloat' is floating and stays at zero." in arm.notes
    ready = robot.frames(robot.joint_values(arm.ready(Settings().ready), 0.0))
    assert ready["buoy"][2, 3] == pytest.approx(0.1)
    with pytest.raises(RobotDescriptionError, match=r"'afloat' of arm\.urdf is floating"):
        robot.check_complete()


def test_links_of_any_order_are_sorted_from_the_root(tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    whole = urdf("arm", PX150)
    path.write_text(whole)
    before = load(path)
    base = '<link name="base"/>'
    assert base in whole
    path.write_text(whole.replace(base, "").replace("</robot>", f"{base}</robot>"))
    after = load(path)
    assert [link.name for link in after.links] == [link.name for link in before.links]
    known: set[str | None] = {None}
    for link in after.links:
        assert link.parent in known
        known.add(link.name)
