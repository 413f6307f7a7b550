"""A scene with its meshes: as a folder, or as one .zip of the same files.

All of it is read and checked before it is used. Paths cannot lead outside of the scene.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from katana450.arm.robot.object_meshes import Mesh
from katana450.errors import InputError
from katana450.extensions.importers.archive import (
    MAX_ARCHIVE_BYTES,
    SCENE,
    contents,
    packed,
)
from katana450.extensions.importers.mesh_file import content_of, read_mesh
from katana450.extensions.importers.shape_file import MAX_FILE_BYTES, Format, Up
from katana450.extensions.programs.language.attached_files import attached
from katana450.extensions.programs.language.source import MAX_BYTES, Problem, ScriptError
from katana450.extensions.programs.script.scene_draft import MeshFile, Scene, SceneDraft, parsed
from katana450.extensions.programs.script.script import is_script, parse
from katana450.extensions.programs.script.script_files import files_in
from katana450.extensions.scene.text import written
from katana450.maths.geometry.arrays import FloatArray

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
        found = (folder / name).resolve()
        if not found.is_relative_to(folder):
            raise InputError(f"{name} is not in the folder of the scene.")
        return content_of(found, maximum)

    try:
        if path.suffix.lower() == ".zip":
            return read_scene_zip(content_of(path, MAX_ARCHIVE_BYTES), T_palm_tool)
        text = _text(content_of(path, MAX_BYTES), path.name)
        if not is_script(text):
            return _stored(parsed(text), opened, T_palm_tool)
        scene = parse(attached(text, files_in(folder))).scene
        if scene is None:
            raise InputError(f"{path}: This is a script without a `scene`.")
        below = PurePosixPath(scene.file).parent

        def opened_beside(name: str, maximum: int) -> bytes:
            return opened(str(below / name), maximum)

        return _stored(scene.draft, opened_beside, T_palm_tool)
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
    for file, at in reversed(mesh_files.items()):
        try:
            meshes[file] = _mesh(file, opened)
        except InputError as error:
            problems += at.wrong(str(error)).problems
    if problems:
        raise ScriptError(tuple(problems))
    scene = draft.scene({file: mesh.solid for file, mesh in meshes.items()}, T_palm_tool)
    kept = {mesh.key: mesh for mesh in meshes.values()}
    return StoredScene(scene, tuple(kept.values()))


def _mesh(file: MeshFile, opened: Callable[[str, int], bytes]) -> Mesh:
    parts = PurePosixPath(file.path)
    if (
        parts.is_absolute()
        or ".." in parts.parts
        or re.search(r"[\\:\0]", file.path)
        or not file.path.isprintable()
    ):
        raise InputError(f"{file.path!r} is not a relative path within the scene.")
    is_archive = Format.of(file.path) is Format.ZIP
    content = opened(file.path, MAX_ARCHIVE_BYTES if is_archive else MAX_FILE_BYTES)
    sha256 = hashlib.sha256(content).hexdigest()
    if file.sha256 is not None and sha256 != file.sha256:
        raise InputError(
            f"{file.path} is not the file that the scene was saved with: its SHA-256 is "
            f"{sha256}. To use it nevertheless, remove `sha256`."
        )

    def beside(name: str, maximum: int) -> bytes | None:
        try:
            return opened(str(parts.parent / name), maximum)
        except InputError:
            return None

    up = None if file.up is None else Up(file.up)
    return read_mesh(content, file.path, file.unit, up, beside=beside)


def _text(content: bytes, name: str) -> str:
    try:
        return content.decode("utf-8")
    except UnicodeDecodeError as error:
        raise InputError(f"{name} is not UTF-8 text: {error.reason}.") from error
