"""Test values that are kept on disk: found again, never old, never damaged, never another's."""

from __future__ import annotations

import hashlib
import os
import pickle
import sys
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from katana450 import disk_cache
from katana450.arm.robot.collision import world_of
from katana450.arm.robot.loader import load
from katana450.arm.robot.surfaces import Drawn, shapes_of
from katana450.assembly import page_routes
from katana450.disk_cache import kept
from katana450.extensions.bodies.pieces import pieces
from katana450.maths.geometry.arrays import FloatArray
from katana450.resources import URDF_PATH
from katana450.server.view.scene import surface
from katana450.server.view.scene_objects import _merged
from katana450.server.viser_bridge import viser_page
from tests.commands import modules_after


class Made:
    """Counts how often a value is computed."""

    def __init__(self, value: Any = 1.0) -> None:
        self.times = 0
        self.value = value
        self.__module__, self.__qualname__ = __name__, "Made"

    def __call__(self) -> Any:
        self.times += 1
        return self.value


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the folder of the files, which is new."""
    for name in ("XDG_CACHE_HOME", "LOCALAPPDATA", "HOME"):
        monkeypatch.setenv(name, str(tmp_path))
    monkeypatch.setattr(disk_cache, "_folder", disk_cache._folder.__wrapped__)
    folder = disk_cache._folder()
    assert folder is not None
    return folder


@pytest.mark.usefixtures("folder")
def test_value_is_computed_once_for_the_same_inputs() -> None:
    value = Made(np.arange(3.0))
    for _ in range(3):
        np.testing.assert_array_equal(kept(value, FloatArray, b"a", "b", np.eye(2)), np.arange(3.0))
    assert value.times == 1
    for others in ((b"ab",), (b"a", "b"), (b"a", "b", np.zeros((2, 2))), (b"a", "b", np.eye(4))):
        kept(value, FloatArray, *others)
    assert value.times == 5


@pytest.mark.usefixtures("folder")
def test_read_only_array_stays_read_only() -> None:
    array = np.arange(3.0)
    array.setflags(write=False)
    for _ in range(2):
        arrays = kept(Made((array, np.zeros(2))), tuple[FloatArray, FloatArray], b"")
        assert isinstance(arrays, tuple)
        assert [values.flags.writeable for values in arrays] == [False, True]


def test_damaged_file_is_replaced(folder: Path) -> None:
    value = Made()
    kept(value, float, b"a")
    (file,) = folder.iterdir()
    whole = file.read_bytes()
    for damaged in (b"", whole[:-1], whole[:40], whole[:-1] + b"x"):
        file.write_bytes(damaged)
        assert kept(value, float, b"a") == 1.0
        assert file.read_bytes() == whole
    assert value.times == 5


class Harmful:
    """Leaves a file where it is unpickled."""

    def __init__(self, file: Path) -> None:
        self.file = file

    def __reduce__(self) -> tuple[Any, ...]:
        return Path.touch, (self.file,)


def test_pickle_in_the_folder_is_not_read(folder: Path, tmp_path: Path) -> None:
    value, trace = Made(), tmp_path / "trace"
    kept(value, float, b"a")
    (file,) = folder.iterdir()
    content = pickle.dumps(Harmful(trace))
    file.write_bytes(hashlib.sha256(content).digest() + content)
    assert kept(value, float, b"a") == 1.0
    assert value.times == 2
    assert not trace.exists()


def test_change_of_the_code_makes_a_value_old(
    folder: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    package, value = tmp_path / "package", Made()
    package.mkdir()
    (package / "code.py").write_text("X = 1\n", encoding="ascii")
    monkeypatch.setattr(disk_cache, "__file__", str(package / "disk_cache.py"))
    monkeypatch.setattr(disk_cache, "_surroundings", disk_cache._surroundings.__wrapped__)
    for _ in range(2):
        kept(value, float, b"a")
    assert value.times == 1
    (package / "code.py").write_text("X = 12\n", encoding="ascii")
    kept(value, float, b"a")
    assert value.times == 2
    assert len(list(folder.iterdir())) == 2


@pytest.mark.usefixtures("folder")
def test_another_version_of_a_library_makes_a_value_old(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    value = Made()
    monkeypatch.setattr(disk_cache, "_surroundings", disk_cache._surroundings.__wrapped__)
    kept(value, float, b"a")
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "unrelated-1.0.dist-info").mkdir()
    kept(value, float, b"a")
    assert value.times == 1
    (tmp_path / "trimesh-99.0.dist-info").mkdir()
    kept(value, float, b"a")
    assert value.times == 2


def test_error_is_raised_again_and_leaves_no_file(folder: Path) -> None:
    def fail() -> None:
        raise ValueError("unreadable")

    for _ in range(2):
        with pytest.raises(ValueError, match="unreadable"):
            kept(fail, type(None), b"a")
    assert list(folder.iterdir()) == []


def test_number_of_files_is_bounded(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(disk_cache, "MAX_FILES", 3)
    for number in range(6):
        kept(Made(), float, str(number))
    assert len(list(folder.iterdir())) == 3


def test_value_that_is_used_is_kept_longest(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(disk_cache, "MAX_FILES", 2)
    used, unused = Made(), Made()
    kept(used, float, "used")
    kept(unused, float, "unused")
    for file in folder.iterdir():
        os.utime(file, (0, 0))
    kept(used, float, "used")
    kept(Made(), float, "new")
    kept(used, float, "used")
    kept(unused, float, "unused")
    assert (used.times, unused.times) == (1, 2)


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such permissions")
def test_folder_that_others_may_write_to_or_replace_is_not_used(folder: Path) -> None:
    value = Made()
    kept(value, float, b"a")
    for open_to_others in (folder, folder.parent):
        open_to_others.chmod(0o777)
        for _ in range(2):
            kept(value, float, b"a")
        open_to_others.chmod(0o700)
    assert value.times == 5
    kept(value, float, b"a")
    assert value.times == 5


@pytest.mark.skipif(
    not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only root gives folders away"
)
def test_home_of_another_user_stays_untouched(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("XDG_CACHE_HOME", "HOME"):
        monkeypatch.setenv(name, str(tmp_path))
    monkeypatch.setattr(disk_cache, "_folder", disk_cache._folder.__wrapped__)
    os.chown(tmp_path, 12345, 12345)
    value = Made()
    for _ in range(2):
        assert kept(value, float, b"a") == 1.0
    assert value.times == 2
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such permissions")
@pytest.mark.skipif(
    hasattr(os, "geteuid") and os.geteuid() == 0, reason="root may write to every folder"
)
def test_folder_that_is_read_only_changes_nothing(folder: Path) -> None:
    folder.chmod(0o500)
    assert kept(Made(), float, b"a") == 1.0


@pytest.mark.usefixtures("folder")
def test_robot_that_was_read_before_needs_no_trimesh() -> None:
    read = "from katana450.arm.robot import collision, loader; collision.world_of(loader.load())"
    assert ["trimesh" in modules_after(read) for _ in range(2)] == [True, False]


@pytest.mark.usefixtures("folder")
def test_kept_robot_is_the_robot_in_its_file() -> None:
    fresh, cached = load(), load()
    for one, other in zip(fresh.links, cached.links, strict=True):
        assert one.name == other.name
        assert one.T_parent_link.tobytes() == other.T_parent_link.tobytes()
        assert (one.inertial is None) == (other.inertial is None)
        if one.inertial is not None and other.inertial is not None:
            assert one.inertial.mass == other.inertial.mass
            assert one.inertial.moments.tobytes() == other.inertial.moments.tobytes()
        for a, b in zip(one.shapes, other.shapes, strict=True):
            assert (a.vertices == b.vertices).all()
            assert a.material == b.material
    (world, _), (kept_world, _) = world_of(fresh), world_of(cached)
    assert world is not None
    assert kept_world is not None
    assert world.fingerprint.differs_by(kept_world.fingerprint) == 0.0


@pytest.mark.usefixtures("folder")
def test_changed_file_is_read_again(tmp_path: Path) -> None:
    text = URDF_PATH.read_text(encoding="utf-8")
    file = tmp_path / URDF_PATH.name
    file.write_text(text, encoding="utf-8")
    before = load(file)
    assert "There is no mesh at" in " ".join(before.notes)
    (tmp_path.parent / "meshes").mkdir(exist_ok=True)
    file.write_text(text.replace('name="katana450"', 'name="other"', 1), encoding="utf-8")
    assert load(file).name == "other"


def test_every_kind_of_value_is_found_again(folder: Path) -> None:
    robot = load()
    visual = next(shape for link in robot.links for shape in link.visuals if shape.glb is not None)
    for read in (
        load,
        partial(world_of, load()),
        partial(pieces, visual),
        partial(shapes_of, visual),
        partial(surface, visual),
        partial(visual.kept, lambda: _merged(visual), Drawn),
        page_routes.page_files,
        viser_page.load,
    ):
        read()
        files = {file: file.stat().st_ino for file in folder.iterdir()}
        read()
        assert {file: file.stat().st_ino for file in folder.iterdir()} == files, read
