"""Build the meshes and collision shapes: ``python -m robot_description.cad [folder]``."""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterable
from pathlib import Path

from robot_description import URDF_PATH
from robot_description.cad.build import MESHES, Built, build
from robot_description.cad.hulls import COLLISION, build_hulls, with_collisions


def main() -> None:
    """Write the files and print a line for each, then the totals; keep the URDF to the shapes."""
    parser = argparse.ArgumentParser(
        prog="python -m robot_description.cad",
        description="Build the meshes and collision shapes of the URDF.",
    )
    parser.add_argument(
        "folder", nargs="?", type=Path, default=MESHES, help="where to write (default: meshes/)"
    )
    folder: Path = parser.parse_args().folder
    print(f"{'part':<20}{'materials':>10}{'triangles':>11}{'bytes':>10}{'seconds':>9}")
    _report(build(folder))
    if folder != MESHES:
        _report(build_hulls(folder / COLLISION.name))
        return
    _report(build_hulls())
    URDF_PATH.write_text(with_collisions(URDF_PATH.read_text("utf-8")), "utf-8")


def _report(files: Iterable[Built]) -> None:
    start = before = time.perf_counter()
    triangles = size = materials = 0
    for built in files:
        now = time.perf_counter()
        print(
            f"{built.path.stem:<20}{built.materials:>10}{built.triangles:>11}"
            f"{built.size:>10}{now - before:>9.2f}",
            flush=True,
        )
        before = now
        triangles += built.triangles
        size += built.size
        materials += built.materials
    print(f"{'total':<20}{materials:>10}{triangles:>11}{size:>10}{before - start:>9.2f}")


if __name__ == "__main__":
    main()
