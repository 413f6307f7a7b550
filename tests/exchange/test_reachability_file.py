"""Tests of map files: read again exactly; invalid files are refused."""

from __future__ import annotations

import dataclasses
import io
from pathlib import Path

import numpy as np
import pytest

from katana450.errors import InputError
from katana450.extensions.reachability.reachability_file import (
    FORMAT,
    StoredMap,
    load_map,
    write_npz,
)

POINTS = np.array([[0.11, -0.2, 0.3], [0.13, -0.2, 0.3], [0.15, 0.2, 0.5]])
FRACTION = np.array([0.25, 1.0, 1 / 3])
MAP = StoredMap(POINTS, FRACTION, 0.02, 0.05, "katana450", "tcp")


@pytest.fixture
def npz(tmp_path: Path) -> Path:
    path = tmp_path / "map.npz"
    with path.open("wb") as file:
        write_npz(file, MAP)
    return path


def test_a_map_is_read_back_exactly(npz: Path) -> None:
    stored = load_map(npz)
    assert np.array_equal(stored.points, POINTS)
    assert np.array_equal(stored.fraction, FRACTION)
    assert not stored.points.flags.writeable
    assert not stored.fraction.flags.writeable
    assert (stored.voxel, stored.robot, stored.tool) == (0.02, "katana450", "tcp")


def test_the_file_has_the_documented_keys(npz: Path) -> None:
    with np.load(npz, allow_pickle=False) as arrays:
        rest = {key: arrays[key].item() for key in arrays if arrays[key].ndim == 0}
    assert rest == {
        "format": FORMAT,
        "voxel": 0.02,
        "table": 0.05,
        "robot": "katana450",
        "tool": "tcp",
    }


def test_the_same_map_is_the_same_bytes(npz: Path) -> None:
    again = io.BytesIO()
    write_npz(again, MAP)
    assert again.getvalue() == npz.read_bytes()


def test_an_empty_map_is_a_map(tmp_path: Path) -> None:
    path = tmp_path / "empty.npz"
    empty = dataclasses.replace(MAP, points=np.empty((0, 3)), fraction=np.empty(0))
    with path.open("wb") as file:
        write_npz(file, empty)
    stored = load_map(path)
    assert stored.points.shape == (0, 3)
    assert stored.fraction.shape == (0,)


GOOD = {
    "format": np.array(FORMAT),
    "points": POINTS,
    "fraction": FRACTION,
    "voxel": np.array(0.02),
    "table": np.array(0.05),
    "robot": np.array("katana450"),
    "tool": np.array("tcp"),
}


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"format": np.array("something else")}, "something else"),
        ({"points": POINTS[:, :2]}, "'points'"),
        ({"points": POINTS[:2]}, "'fraction'"),
        ({"points": POINTS * np.nan}, "'points'"),
        ({"points": np.array(0.0)}, "'points'"),
        ({"points": np.array([["a", "b", "c"]])}, "'points'"),
        ({"points": np.array([None, {}], dtype=object)}, "corrupt"),
        ({"fraction": FRACTION[:, None]}, "'fraction'"),
        ({"fraction": FRACTION - 0.25}, "above 0"),
        ({"fraction": FRACTION + 0.1}, "up to 1"),
        ({"voxel": np.array(0.0)}, "is 0.0 m"),
        ({"voxel": np.array(np.nan)}, "is nan m"),
        ({"voxel": np.array("wide")}, "'voxel'"),
        ({"voxel": FRACTION}, "corrupt"),
        ({"table": np.array("low")}, "'table'"),
        ({"robot": np.array(3)}, "'robot'"),
        ({"tool": np.array(1.5)}, "'tool'"),
    ],
)
def test_a_file_with_invalid_values_is_refused(
    tmp_path: Path, change: dict[str, np.ndarray[tuple[int, ...], np.dtype[np.generic]]], said: str
) -> None:
    path = tmp_path / "map.npz"
    np.savez(path, allow_pickle=True, **(GOOD | change))
    with pytest.raises(InputError, match=said) as refused:
        load_map(path)
    assert "map.npz" in str(refused.value)


@pytest.mark.parametrize("key", list(GOOD))
def test_a_file_without_a_key_is_refused(tmp_path: Path, key: str) -> None:
    path = tmp_path / "map.npz"
    np.savez(path, allow_pickle=True, **{name: GOOD[name] for name in GOOD if name != key})
    with pytest.raises(InputError, match=key):
        load_map(path)


def test_map_of_an_older_version_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "map.npz"
    np.savez(path, allow_pickle=False, **(GOOD | {"format": np.array("katana450 reachability 1")}))
    with pytest.raises(InputError, match=r"map\.npz is corrupt or not .*reachability 1, not"):
        load_map(path)


def test_invalid_npz_is_refused(npz: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be read"):
        load_map(tmp_path / "nothing.npz")
    with pytest.raises(InputError, match="cannot be read"):
        load_map(tmp_path)
    other = tmp_path / "other.npz"
    whole = npz.read_bytes()
    array = io.BytesIO()
    np.save(array, POINTS)
    for content in (b"", b"nonsense", whole[: len(whole) // 2], array.getvalue()):
        other.write_bytes(content)
        with pytest.raises(
            InputError, match=r"other\.npz is corrupt or not a reachability map(?!.*pickle)"
        ):
            load_map(other)
    damaged = bytearray(whole)
    damaged[whole.index(b"points.npy") + 50] ^= 0xFF
    other.write_bytes(bytes(damaged))
    with pytest.raises(InputError, match=r"other\.npz"):
        load_map(other)
