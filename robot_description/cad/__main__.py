"""Build all of the robot: ``python -m robot_description.cad [folder]``."""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterable
from pathlib import Path

from robot_description import URDF_PATH
from robot_description.cad.build import CONDUITS, MESHES, Built, build, write_conduits
from robot_description.cad.mass import write_inertials
from robot_description.cad.props import PROPS, build_props
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
    """Write meshes, props, STL files, the conduit's ends and the inertials in the URDF."""
    parser = argparse.ArgumentParser(
        prog="python -m robot_description.cad",
        description="Build meshes, props and STL files, and write the inertials into the URDF.",
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
    write_conduits(folder / CONDUITS.name)
    urdf = folder / URDF_PATH.name
    if urdf != URDF_PATH:
        urdf.write_text(URDF_PATH.read_text("utf-8"), "utf-8")
    write_inertials(urdf)
    print(f"inertials in {urdf}")


if __name__ == "__main__":
    main()
