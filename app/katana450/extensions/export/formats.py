"""Table of the export formats: one row each."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from katana450.arm.robot.robot import Robot
    from katana450.extensions.export.vrml_world import World


class ExportJob(NamedTuple):
    """The input of a format.

    Attributes:
        options: the options of the command.
        robot: the robot of its URDF.
        values: value of every joint [rad or m].
    """

    options: Namespace
    robot: Robot
    values: Mapping[str, float]


class ExportFormat(NamedTuple):
    """A row of the table.

    Attributes:
        help: description for the help of the command.
        files: function that returns names and contents of the files; None for a page, which is
            a single file and plays a motion.
        posed: whether it is written at a pose.
        scene: whether it has the objects of a new server, and a Switch for each shape.
    """

    help: str
    files: Callable[[ExportJob], Mapping[str, bytes]] | None
    posed: bool = False
    scene: bool = False


def _vrml(job: ExportJob) -> Mapping[str, bytes]:
    from katana450.extensions.export.vrml import vrml_files

    return vrml_files(job.robot, _world(job))


def _x3d(job: ExportJob) -> Mapping[str, bytes]:
    from katana450.extensions.export.vrml import x3d_files

    return x3d_files(job.robot, _world(job))


def _world(job: ExportJob) -> World:
    from katana450.extensions.export.vrml import initial_objects, world_of

    objects = initial_objects(job.robot) if job.options.objects else ()
    return world_of(job.robot, job.values, objects, plain=job.options.plain)


def _c(job: ExportJob) -> Mapping[str, bytes]:
    from katana450.extensions.export.c_source import c_files

    return c_files(job.robot, job.values)


def _glb(job: ExportJob) -> Mapping[str, bytes]:
    from katana450.extensions.export.glb import glb_files

    return glb_files(job.robot, job.values)


def _urdf(job: ExportJob) -> Mapping[str, bytes]:
    from katana450.extensions.export.urdf_package import package_files

    return package_files(job.options.urdf)


def _mjcf(job: ExportJob) -> Mapping[str, bytes]:
    from katana450.assembly.robot_files import read_robot
    from katana450.assembly.robot_session import find_arm
    from katana450.extensions.export.mjcf import mjcf_files

    return mjcf_files(read_robot(job.options.urdf, None, find_arm))


FORMATS: Mapping[str, ExportFormat] = {
    "vrml": ExportFormat(
        "a VRML97 world and one file per part, for LabVIEW, Simulink and X3D browsers",
        _vrml,
        posed=True,
        scene=True,
    ),
    "x3d": ExportFormat("the same world as X3D in XML", _x3d, posed=True, scene=True),
    "c": ExportFormat(
        "C arrays and a draw function per link, kinematics, and an OpenGL viewer",
        _c,
        posed=True,
    ),
    "glb": ExportFormat(
        "binary glTF 2.0, for browsers, Blender and game engines", _glb, posed=True
    ),
    "urdf": ExportFormat(
        "a zip of a ROS 2 package of URDF and meshes",
        _urdf,
    ),
    "mjcf": ExportFormat(
        "a zip of a MuJoCo model with actuators, sites, keyframes and its meshes", _mjcf
    ),
    "html": ExportFormat(
        "a page that plays a run, with a time slider; it needs no server",
        None,
        posed=True,
    ),
}
"""The formats by their names."""


def named(trait: Callable[[ExportFormat], bool]) -> list[str]:
    """Return the names of the formats of which ``trait`` is true."""
    return [name for name, row in FORMATS.items() if trait(row)]
