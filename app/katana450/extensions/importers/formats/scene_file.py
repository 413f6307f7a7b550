"""A scene with its meshes, as a folder or as one .zip of its files; and that of a new server.

All of it is read and checked before it is used. Paths cannot lead outside of the scene.
"""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

import numpy as np
import yaml

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.session.session import Session
from katana450.arm.control.state.object_joint import ObjectJoint
from katana450.arm.control.state.scene_objects import SceneObject
from katana450.arm.robot.object_meshes import InitialScene, Mesh
from katana450.atomic import bytes_of
from katana450.errors import InputError
from katana450.extensions.importers.archive import (
    MAX_ARCHIVE_BYTES,
    SCENE,
    contents,
    packed,
)
from katana450.extensions.importers.formats.mesh_file import read_mesh
from katana450.extensions.importers.formats.shape_file import Format, Up
from katana450.extensions.programs.language.source import MAX_BYTES, Problem, ScriptError
from katana450.extensions.programs.script.script import is_script, parse
from katana450.extensions.programs.script.script_scene import (
    VERSION,
    MeshFile,
    Scene,
    SceneDraft,
    check_scene,
    parsed,
)
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.water.units import ML

LENGTH_DIGITS, ANGLE_DIGITS = 6, 9
"""Decimal places of written numbers [mm], [deg]: a millionth of a millimetre."""

HEAD = """\
# A scene of katana450. Lengths are in mm and angles in degrees. A pose is x, y, z, roll, pitch, yaw
# in the frame of the base, or in that of the tool for what is attached to the hand.
"""
"""Comment at the start of a written scene."""


def written(scene: Scene, files: Mapping[str, MeshFile], T_palm_tool: FloatArray | None) -> str:
    """Return the text of a scene. ``files`` are the files of its meshes by their keys."""
    entry: dict[str, object] = {"scene": VERSION}
    if scene.joints is not None:
        entry["joints"] = [_round(angle, ANGLE_DIGITS) for angle in np.degrees(scene.joints)]
    if scene.water is not None:
        entry["water"] = _round(scene.water / ML, LENGTH_DIGITS)
    leads: dict[str, str] = {}
    for item in scene.objects:
        if item.joint is not None and (
            item.name == item.joint.body or item.joint.body not in leads
        ):
            leads[item.joint.body] = item.name
    entry["objects"] = [
        _object_entry(item, files, T_palm_tool, leads[item.joint.body] if item.joint else "")
        for item in scene.objects
    ]
    # Lists of numbers are on one line.
    body: str = yaml.safe_dump(
        entry, sort_keys=False, allow_unicode=True, width=100, default_flow_style=None
    )
    return HEAD + body


def _object_entry(
    scene_object: SceneObject,
    files: Mapping[str, MeshFile],
    T_palm_tool: FloatArray | None,
    lead: str,
) -> dict[str, object]:
    """Return the entry of an object; ``lead``: the first part of the body on its joint."""
    entry: dict[str, object] = {"name": scene_object.name, "shape": scene_object.shape.value}
    joint = scene_object.joint
    T = scene_object.T if joint is None else joint.T_zero
    if scene_object.fixed and T_palm_tool is not None:
        T = se3.inverse(T_palm_tool) @ T
    if scene_object.solid is None:
        entry["size"] = [_round(1e3 * number, LENGTH_DIGITS) for number in scene_object.size]
    else:
        file = files[scene_object.solid.key]
        values = {"file": file.path, "unit": file.unit, "up": file.up, "sha256": file.sha256}
        entry["mesh"] = {name: fact for name, fact in values.items() if fact is not None}
    entry["pose"] = [
        *(_round(1e3 * number, LENGTH_DIGITS) for number in T[:3, 3]),
        *(_round(number, ANGLE_DIGITS) for number in np.degrees(so3.to_rpy(T[:3, :3]))),
    ]
    scale, opacity = (
        float(f"{number:.12g}") for number in (scene_object.scale, scene_object.appearance.opacity)
    )
    if scale != 1.0:
        entry["scale"] = scale
    if scene_object.appearance.colour is not None:
        entry["colour"] = "#{:02x}{:02x}{:02x}".format(*scene_object.appearance.colour)
    if opacity != 1.0:
        entry["opacity"] = opacity
    for name, true in (
        ("hidden", scene_object.appearance.hidden),
        ("can_be_held", scene_object.can_be_held),
    ):
        if true:
            entry[name] = True
    if scene_object.crush_force is not None:
        entry["crush_force"] = scene_object.crush_force
    if scene_object.is_zone:
        entry["zone"] = scene_object.zone.value
    if scene_object.fixed:
        entry["attach"] = "hand"
    if joint is not None and lead != scene_object.name:
        entry["part_of"] = lead
    elif joint is not None:
        entry["joint"] = _joint_entry(joint, joint.position(scene_object.T))
    return entry


def _joint_entry(joint: ObjectJoint, position: float) -> dict[str, object]:
    """Return the joint of a lead, which is at ``position`` [m or rad]."""
    T, body_joint = se3.inverse(joint.T_zero), joint.joint
    slides, loads = body_joint.slides, (body_joint.friction, body_joint.damping)

    def shown(number: float) -> float:
        value, digits = (
            (1e3 * number, LENGTH_DIGITS) if slides else (math.degrees(number), ANGLE_DIGITS)
        )
        return _round(value, digits)

    entry: dict[str, object] = {
        "type": "slide" if slides else "hinge",
        "axis": [_round(number, ANGLE_DIGITS) for number in T[:3, :3] @ body_joint.axis],
        "range": [shown(body_joint.lower), shown(body_joint.upper)],
        "position": shown(position),
        **{name: load for name, load in zip(("friction", "damping"), loads, strict=True) if load},
    }
    if not slides:
        point = T[:3, :3] @ body_joint.point + T[:3, 3]
        entry["origin"] = [_round(1e3 * number, LENGTH_DIGITS) for number in point]
    return entry if body_joint.mass is None else {**entry, "mass": body_joint.mass}


def _round(value: float, digits: int) -> int | float:
    rounded = round(float(value), digits) + 0.0
    return int(rounded) if rounded == int(rounded) else rounded


FOLDER = "meshes"
"""Folder of the meshes in a .zip."""

MAX_FILES = 64
"""Maximum number of files in a .zip."""

MAX_ENTRIES = 4096
"""Maximum number of directory entries in the bytes of a .zip, those of packed .zip files included.
`zipfile` reads them all at once, and a million takes seconds."""

ENTRY = b"PK\x01\x02"
"""Beginning of a directory entry."""

SEARCHED_BYTES = 1_000_000
"""Bytes that are searched at once: other threads wait meanwhile."""


@dataclass(frozen=True, eq=False)
class StoredScene:
    """A scene, and the meshes of its objects."""

    scene: Scene
    meshes: tuple[Mesh, ...] = ()


def read_scene_zip(data: bytes, T_palm_tool: FloatArray | None) -> StoredScene:
    """Return the scene in a .zip.

    ``T_palm_tool``: see ``Hand``; None for an arm without a hand. Raises InputError; for errors in
    the text ScriptError with the lines.
    """
    if len(data) > MAX_ARCHIVE_BYTES:
        raise InputError(f"A scene has at most {MAX_ARCHIVE_BYTES // 1_000_000} MB.")
    if _entries(data) > MAX_ENTRIES:
        raise InputError(f"The scene has more than {MAX_FILES} files.")
    files, _ = contents(
        data, "The scene", MAX_FILES, lambda path: None if path.endswith("/") else path
    )

    def opened(path: str, _maximum: int) -> bytes:
        if path not in files:
            raise InputError(f"There is no file {path} in the .zip.")
        return files[path]

    draft = parsed(_text(opened(SCENE, MAX_BYTES), SCENE))
    return _stored(draft, opened, T_palm_tool)


def _entries(data: bytes) -> int:
    """Return the number of directory entries in ``data``."""
    starts = range(0, len(data), SEARCHED_BYTES)
    return sum(data.count(ENTRY, start, start + SEARCHED_BYTES) for start in starts)


def read_scene_folder(path: Path, T_palm_tool: FloatArray | None) -> StoredScene:
    """Return the scene of the text file ``path``, with meshes in or below its folder; or of a .zip.

    The text is a scene, or a script that has one. Raises InputError.
    """
    folder = path.resolve().parent

    def opened(name: str, maximum: int) -> bytes:
        file = (folder / name).resolve()
        if not file.is_relative_to(folder):
            raise InputError(f"{name} is not in the folder of the scene.")
        return bytes_of(file, maximum)

    try:
        if path.suffix.lower() == ".zip":
            return read_scene_zip(bytes_of(path, MAX_ARCHIVE_BYTES), T_palm_tool)
        text = _text(bytes_of(path, MAX_BYTES), path.name)
        if not is_script(text):
            return _stored(parsed(text), opened, T_palm_tool)
        scene = parse(text).scene
        if scene is None:
            raise InputError(f"{path}: This is a script without a `scene`.")
        return _stored(scene, opened, T_palm_tool)
    except ScriptError as error:
        raise InputError(f"{path}:\n{error}") from error


def scene_zip(stored: StoredScene, T_palm_tool: FloatArray | None) -> bytes:
    """Return the scene as the content of a .zip."""
    return packed("", _files(stored, T_palm_tool))


def _files(stored: StoredScene, T_palm_tool: FloatArray | None) -> dict[str, bytes]:
    """Return the content of all files of a scene, by relative paths."""
    files: dict[str, MeshFile] = {}
    contents: dict[str, bytes] = {}
    for mesh in stored.meshes:
        # Files of the same name are distinguished by the hash of their content.
        stem = re.sub(r"[^A-Za-z0-9_-]+", "_", mesh.name).strip("_") or "mesh"
        path = f"{FOLDER}/{stem}.{mesh.format}"
        if path in contents:
            path = f"{FOLDER}/{stem}_{mesh.key[:8]}.{mesh.format}"
        files[mesh.key] = MeshFile(path, mesh.unit, mesh.up, mesh.sha256)
        contents[path] = mesh.file
    return {SCENE: written(stored.scene, files, T_palm_tool).encode()} | contents


def _stored(
    draft: SceneDraft, opened: Callable[[str, int], bytes], T_palm_tool: FloatArray | None
) -> StoredScene:
    mesh_files = {
        entry.mesh: entry.source for entry in reversed(draft.entries) if entry.mesh is not None
    }
    meshes: dict[MeshFile, Mesh] = {}
    problems: list[Problem] = []
    for file, source in reversed(mesh_files.items()):
        try:
            meshes[file] = _mesh(file, opened)
        except InputError as error:
            problems += source.wrong(str(error)).problems
    if problems:
        raise ScriptError(tuple(problems))
    scene = draft.scene({file: mesh.solid for file, mesh in meshes.items()}, T_palm_tool)
    distinct = {mesh.key: mesh for mesh in meshes.values()}
    return StoredScene(scene, tuple(distinct.values()))


def _mesh(file: MeshFile, opened: Callable[[str, int], bytes]) -> Mesh:
    parts = PurePosixPath(file.path)
    if (
        parts.is_absolute()
        or ".." in parts.parts
        or re.search(r"[\\:\0]", file.path)
        or not file.path.isprintable()
    ):
        raise InputError(f"{file.path!r} is not a relative path within the scene.")
    content = opened(file.path, Format.of(file.path).max_bytes)
    sha256 = hashlib.sha256(content).hexdigest()
    if file.sha256 is not None and sha256 != file.sha256:
        raise InputError(
            f"{file.path} is not the file that the scene was saved with: its SHA-256 is "
            f"{sha256}. To use it nevertheless, remove `sha256`."
        )

    up = None if file.up is None else Up(file.up)
    return read_mesh(content, file.path, file.unit, up)


def _text(content: bytes, name: str) -> str:
    try:
        return content.decode("utf-8")
    except UnicodeDecodeError as error:
        raise InputError(f"{name} is not UTF-8 text: {error.reason}.") from error


def initial_scene(session: Session, scene: Path) -> InitialScene:
    """Return the initial scene. Raises InputError; see ``load_initial_scene``."""
    stored = load_initial_scene(session, scene)
    command = cmd.ReplaceScene(stored.scene.objects, stored.scene.water)
    return InitialScene(command, stored.scene.joints, stored.meshes)


def load_initial_scene(session: Session, scene: Path | None) -> StoredScene:
    """Return the scene of the file ``scene``; without a file, the robot's own objects.

    Raises InputError for a file that cannot be read, and for an object that cannot stand at its
    place.
    """
    hand = session.environment.hand
    stored = StoredScene(Scene(session.begin(session.ready, 0.0, 0.0).objects))
    if scene is not None:
        stored = read_scene_folder(scene, None if hand is None else hand.T_palm_tool)
    try:
        check_scene(session, stored.scene)
    except InputError as error:
        raise InputError(f"{scene}: {error}") from error
    session.check(cmd.ReplaceScene(stored.scene.objects, stored.scene.water))
    return stored
