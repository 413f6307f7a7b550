"""A package with the names of robot_descriptions, whose robots are files of this test."""

from __future__ import annotations

from pathlib import Path

from tests.robot.hands import hand

LIST = """
from dataclasses import dataclass


@dataclass
class Description:
    formats: tuple
    robot: str
    maker: str | None
    repository: str
    license_spdx: str
    license_file: str
    tags: tuple

    @property
    def has_urdf(self):
        return "urdf" in self.formats


def _arm(robot, maker, licence="BSD-3-Clause", formats=("urdf",), repository="arms", tags=("arm",)):
    return Description(formats, robot, maker, repository, licence, "LICENSE", tags)


DESCRIPTIONS = {
    "so_arm101_description": _arm("SO-ARM101", "The Robot Studio", "Apache-2.0"),
    "so_arm101_mj_description": _arm("SO-ARM101", "The Robot Studio", formats=("mjcf",)),
    "ur5e_description": _arm("UR5e", "Universal Robots"),
    "panda_description": _arm("Panda", "Franka Robotics"),
    "xarm6_description": _arm("xArm6", "UFACTORY"),
    "open_manipulator_x_description": _arm("OpenMANIPULATOR-X", "ROBOTIS"),
    "allegro_hand_description": _arm("Allegro Hand", None, "BSD", repository="elsewhere", tags=()),
    "iiwa14_description": _arm("iiwa 14", "KUKA"),
    "sawyer_description": _arm("Sawyer", "Rethink Robotics"),
    "yam_mj_description": _arm("YAM", "I2RT", formats=("mjcf",)),
    "gen3_description": _arm("Gen3", "Kinova"),
}
"""

REPOSITORIES = """
class Repository:
    url, commit = "https://example.org/arms.git", "0123abc"


REPOSITORIES = {"arms": Repository}
"""

XACRO = """<robot name="$(arg name)" xmlns:xacro="http://www.ros.org/wiki/xacro">
<xacro:arg name="name" default="none"/><xacro:arg name="kind" default="none"/>
<xacro:property name="lengths" value="${dict(ur5e=[0.425, 0.392], none=[0, 0])}"/>
<xacro:property name="a" value="${lengths['$(arg kind)']}"/>
<link name="base_link"><visual><geometry><mesh filename="package://arms/base.stl"/></geometry>
</visual></link>
<xacro:macro name="turn" params="number parent xyz axis"><link name="link${number}"/>
<joint name="joint${number}" type="revolute"><parent link="${parent}"/>
<child link="link${number}"/><origin xyz="${xyz}"/><axis xyz="${axis}"/>
<limit lower="-3" upper="3" velocity="2" effort="1"/></joint></xacro:macro>
<xacro:turn number="1" parent="base_link" xyz="0 0 0.16" axis="0 0 1"/>
<xacro:turn number="2" parent="link1" xyz="0 0 0" axis="0 1 0"/>
<xacro:turn number="3" parent="link2" xyz="${a[0]} 0 0" axis="0 1 0"/>
<xacro:turn number="4" parent="link3" xyz="${a[1]} 0 0" axis="0 1 0"/>
<xacro:turn number="5" parent="link4" xyz="0 0.13 0" axis="0 0 -1"/>
<xacro:turn number="6" parent="link5" xyz="0 0 -0.1" axis="0 1 0"/>
<link name="tool0"/><joint name="flange" type="fixed"><parent link="link6"/><child link="tool0"/>
<origin xyz="0 0.1 0"/></joint></robot>
"""

NO_NETWORK = """
import sys

print("Cloning: 0 %", end="", file=sys.stderr)


class GitCommandError(Exception):
    pass


raise GitCommandError('''Cmd('git') failed due to: exit code(128)
  cmdline: git fetch
  stderr: 'fatal: unable to access 'https://example.org/a/': Could not resolve host: example.org'
''')
"""


def write_package(folder: Path) -> Path:
    """Write the package to ``folder`` and return the folder of its robots."""
    package, arms = folder / "robot_descriptions", folder / "downloads" / "arms"
    package.mkdir()
    arms.mkdir(parents=True)
    (package / "__init__.py").write_text(LIST)
    (package / "_repositories.py").write_text(REPOSITORIES)
    (arms / "package.xml").write_text("<package><name>arms</name></package>")
    (arms / "hand.urdf").write_text(hand(2))
    (arms / "arm.urdf.xacro").write_text(XACRO)
    (arms / "base.stl").write_bytes(b"")
    modules = {
        "allegro_hand": f"print('Cloning...')\nURDF_PATH = {str(arms / 'hand.urdf')!r}\n",
        "ur5e": f"XACRO_PATH = {str(arms / 'arm.urdf.xacro')!r}\n"
        "XACRO_ARGS = {'kind': 'ur5e', 'name': 'ur5e'}\n",
        "panda": NO_NETWORK,
        "iiwa14": "raise ImportError('Bad git executable.')\n",
        "sawyer": f"URDF_PATH = {str(arms / 'missing.urdf')!r}\n",
        "gen3": "PACKAGE_PATH = ''\n",
        "xarm6": "import module_that_is_not_there\n",
    }
    for name, text in modules.items():
        (package / f"{name}_description.py").write_text(text)
    return arms
