"""The initial scene of ``katana450 serve``, from the files given on the command line."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from katana450.arm.control import commands as cmd
from katana450.arm.control.scene_objects import SceneObject, Shape
from katana450.arm.control.session import Session
from katana450.arm.robot.initial_scene import InitialScene
from katana450.arm.robot.object_meshes import Mesh
from katana450.errors import InputError
from katana450.extensions.free_place import free_place
from katana450.extensions.importers.mesh_file import read_mesh_file
from katana450.extensions.importers.scene_file import StoredScene, read_scene_folder
from katana450.extensions.objects.scenes import free_name
from katana450.extensions.programs.script.scene_draft import Scene
from katana450.extensions.programs.script.script_scene import check_scene
from katana450.maths.geometry import se3

PLACED = re.compile(
    r"(?P<file>.+?)(?:@(?P<at>[^@,]+(?:,[^@,]+){2}))?(?:@(?P<scale>[0-9.]+(?:e-?[0-9]+)?))?"
)
"""Pattern of an ``--object`` value: FILE[@x,y,z][@SCALE]."""


def initial_scene(
    session: Session, scene: Path | None, object_files: Sequence[str]
) -> InitialScene:
    """Return the initial scene. Raises InputError; see ``load_initial_scene``."""
    stored, notes = load_initial_scene(session, scene, object_files)
    command = cmd.ReplaceScene(stored.scene.objects, stored.scene.water)
    return InitialScene(command, stored.scene.joints, stored.meshes, notes)


def load_initial_scene(
    session: Session, scene: Path | None, object_files: Sequence[str]
) -> tuple[StoredScene, tuple[str, ...]]:
    """Return the scene of the file ``scene`` with the objects of ``object_files``, and notes.

    Each of ``object_files`` is FILE[@x,y,z][@SCALE] with x, y, z in mm. Without a scene file, the
    scene has the robot's own objects. Raises InputError for a file that cannot be read, and for an
    object that cannot stand at its place.
    """
    hand = session.environment.hand
    stored = StoredScene(Scene(session.begin(session.ready, 0.0, 0.0).objects))
    if scene is not None:
        stored = read_scene_folder(scene, None if hand is None else hand.T_palm_tool)
    try:
        check_scene(session, stored.scene)
    except InputError as error:
        raise InputError(f"{scene}: {error}") from error
    objects, meshes, notes = list(stored.scene.objects), list(stored.meshes), []
    for argument in object_files:
        mesh, scene_object = _object(argument, objects, session.environment.table_height)
        objects.append(scene_object)
        meshes.append(mesh)
        notes.append(f"{scene_object.name}: {mesh.text}")
    session.check(cmd.ReplaceScene(tuple(objects), stored.scene.water))
    kept = {mesh.key: mesh for mesh in meshes}
    complete = StoredScene(replace(stored.scene, objects=tuple(objects)), tuple(kept.values()))
    return complete, tuple(notes)


def _object(
    argument: str, objects: Sequence[SceneObject], table: float
) -> tuple[Mesh, SceneObject]:
    match = PLACED.fullmatch(argument)
    assert match is not None
    mesh = read_mesh_file(Path(match["file"]))
    name = free_name(mesh.name, {scene_object.name for scene_object in objects})
    scale = 1.0
    if match["scale"] is not None:
        try:
            scale = float(match["scale"])
        except ValueError:
            raise InputError(f"{argument!r}: the scale must be a number, as in @0.5.") from None
    elif mesh.scale != 1.0:
        raise InputError(
            f"{match['file']}: {mesh.text} Give the scale after the file, as in "
            f"{match['file']}@{mesh.scale:g}."
        )
    scene_object = SceneObject(name, Shape.MESH, (), np.eye(4), solid=mesh.solid, scale=scale)
    if match["at"] is None:
        return mesh, replace(scene_object, T=free_place(scene_object, objects, table))
    try:
        at = [1e-3 * float(each) for each in match["at"].split(",")]
    except ValueError:
        raise InputError(f"{argument!r}: the place must be x,y,z in mm, as in @300,0,0.") from None
    return mesh, replace(scene_object, T=se3.from_rotation_translation(np.eye(3), at))
