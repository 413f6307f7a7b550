"""The picture benchmark draws its scenes; the tests do not need VTK."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from PIL import Image

from benchmarks.pictures import drawn, rows, scenes
from benchmarks.pictures_scene import PictureScene

OWN = [sys.executable, "-m", "benchmarks.pictures_own"]


def test_scene_is_drawn_twice_with_the_same_bytes(tmp_path: Path) -> None:
    shown = scenes((96, 54))
    assert set(shown) == {"Light", "Dark"}
    scene = shown["Dark"]
    assert (scene.opacity < 1.0).any()
    scene.save(tmp_path / "dark.npz")
    assert np.array_equal(PictureScene.load(tmp_path / "dark.npz").faces, scene.faces)
    runs = [drawn(OWN, tmp_path / "dark.npz", tmp_path / f"{n}.png") for n in range(2)]
    with Image.open(tmp_path / "0.png") as picture:
        assert picture.size == (96, 54)
    assert (tmp_path / "0.png").read_bytes() == (tmp_path / "1.png").read_bytes()
    (row,) = rows({("katana450", "Dark"): runs})[2:]
    assert row.startswith("| katana450 (embreex ")
    assert "| yes |" in row
