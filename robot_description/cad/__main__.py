"""Build all files of the robot description: ``python -m robot_description.cad [folder]``."""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterable
from pathlib import Path

from katana450.resources import URDF_PATH
from robot_description.cad.build import CONDUITS, MESHES, Built, build, write_conduits
from robot_description.cad.hulls import COLLISION, build_hulls, with_collisions
from robot_description.cad.mass import write_inertials
from robot_description.cad.props import PROPS, build_props
from robot_description.cad.so101 import URDF, build_so101
from robot_description.cad.stl import STL, build_stl


def _report(title: str, files: Iterable[Built]) -> None:
    """Print a line for each of ``files`` as it is written, then the total."""
    print(f"{title:<20}{'materials':>10}{'triangles':>11}{'bytes':>10}{'seconds':>9}")
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
    print(f"{'total':<20}{materials:>10}{triangles:>11}{size:>10}{before - start:>9.2f}\n")


def main() -> None:
    """Write all files, and update masses and collision shapes in the URDF."""
    parser = argparse.ArgumentParser(
        prog="python -m robot_description.cad",
        description="Build meshes, props, STL files and collision shapes, and update the URDF.",
    )
    parser.add_argument(
        "folder",
        nargs="?",
        type=Path,
        default=MESHES.parent,
        help="where to write (default: robot_description/)",
    )
    folder: Path = parser.parse_args().folder
    _report("meshes", build(folder / MESHES.name))
    _report("props", build_props(folder / PROPS.name))
    _report("stl", build_stl(folder / STL.name))
    _report("collision", build_hulls(folder / COLLISION.name))
    write_conduits(folder / CONDUITS.name)
    urdf = folder / URDF_PATH.name
    urdf.write_text(with_collisions(URDF_PATH.read_text("utf-8"), folder / COLLISION.name), "utf-8")
    write_inertials(urdf)
    print(f"inertials and collision shapes in {urdf}")
    _report("so101", build_so101(folder / URDF.stem))


if __name__ == "__main__":
    main()
