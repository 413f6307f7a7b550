"""The build of the design: reproducible bytes, no link through another, errors that help."""

from __future__ import annotations

import platform
import sys
from collections.abc import Callable, Iterable
from pathlib import Path

import pytest

from katana450.resources import PROPS_PATH, URDF_PATH
from robot_description.cad.build import MESHES, PARTS, build
from robot_description.cad.hulls import COLLISION, build_hulls
from robot_description.cad.outline import circle, inset, rounded
from robot_description.cad.part import Part
from robot_description.cad.props import build_props
from robot_description.cad.so101 import URDF, build_so101
from robot_description.cad.solid import lathe
from robot_description.cad.stl import build_stl
from tests.robot_description.solids import solid


@pytest.mark.parametrize(
    ("make", "folder"),
    [
        (build, MESHES),
        (build_hulls, COLLISION),
        (build_stl, URDF_PATH.parent / "stl"),
        (build_props, PROPS_PATH.parent),
        (build_so101, URDF.parent),
    ],
    ids=["meshes", "hulls", "stl", "props", "so101"],
)
def test_rebuild_gives_the_committed_bytes(
    tmp_path: Path, make: Callable[[Path], Iterable[object]], folder: Path
) -> None:
    if sys.platform != "linux" or platform.machine() != "x86_64":
        pytest.skip("the committed bytes are those of Linux on x86-64")
    list(make(tmp_path))
    names = {path.relative_to(tmp_path) for path in tmp_path.rglob("*.*")}
    assert names == {path.relative_to(folder) for path in folder.rglob("*.*")}
    for name in names:
        assert (tmp_path / name).read_bytes() == (folder / name).read_bytes(), (
            f"{folder / name} is not what the code makes: run python -m robot_description.cad"
        )


@pytest.mark.parametrize("make", PARTS, ids=lambda make: make.__name__)
def test_each_part_is_connected(make: Callable[[], Part]) -> None:
    assert len(solid(make.__name__).decompose()) == 1


def test_fillet_and_edge_that_do_not_fit_are_refused() -> None:
    with pytest.raises(ValueError, match="overlap: make one radius smaller"):
        rounded([(0, 0, 3.0), (4, 0, 3.0), (4, 4, 3.0), (0, 4, 3.0)])
    with pytest.raises(ValueError, match="make the radius smaller"):
        lathe([(0.0, 5.0, 0.0), (9.0, 5.0, 6.0)])
    with pytest.raises(ValueError, match="does not fit this outline"):
        inset(circle(3.0), 3.5)
