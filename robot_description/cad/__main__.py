"""Build the meshes: ``python -m robot_description.cad [folder]``."""

from __future__ import annotations

import argparse
import time
from pathlib import Path

from robot_description.cad.build import MESHES, build, write_conduits


def main() -> None:
    """Write the meshes and the conduit's ends; print a line for each mesh, then the total."""
    parser = argparse.ArgumentParser(
        prog="python -m robot_description.cad", description="Build the meshes of the URDF."
    )
    parser.add_argument(
        "folder", nargs="?", type=Path, default=MESHES, help="where to write (default: meshes/)"
    )
    folder: Path = parser.parse_args().folder
    start = time.perf_counter()
    print(f"{'part':<20}{'materials':>10}{'triangles':>11}{'bytes':>10}{'seconds':>9}")
    triangles = size = materials = 0
    before = start
    for built in build(folder):
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
    if folder == MESHES:
        write_conduits()
    print(f"{'total':<20}{materials:>10}{triangles:>11}{size:>10}{before - start:>9.2f}")


if __name__ == "__main__":
    main()
