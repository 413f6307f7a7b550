"""Pictures of katana450's own renderer beside the same pictures of VTK.

    python -m benchmarks.pictures

Both draw the same triangles, in the light and the dark theme: the arm at home, its table, and a cup
of water. They take turns, each picture in a fresh process. VTK has a separate environment under
``.venv-bench``. The pictures are kept, so that people can compare them.
"""

from __future__ import annotations

import argparse
import json
import statistics
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.peers import prepare
from benchmarks.pictures_scene import PictureScene
from katana450.arm.control import commands as cmd
from katana450.arm.robot.props import load_props
from katana450.assembly.robot_session import describe_robot
from katana450.extensions.media import room
from katana450.extensions.media.report_pictures import FOV, ON_TABLE
from katana450.extensions.media.scene import RenderScene
from katana450.extensions.media.stage import RenderStage
from katana450.resources import URDF_PATH
from katana450.server.viser_bridge.themes import THEMES
from katana450.settings import Settings

ROOT = Path(__file__).resolve().parents[1]
OWN, VTK = "katana450", "VTK"
FILLING = 2e-4
"""[m3] Volume of the water in the cup."""

TIMEOUT = 600.0
"""[s] Timeout of one process."""


def scenes(size: tuple[int, int]) -> dict[str, PictureScene]:
    """Return the scene of each theme, for pictures of width and height ``size`` [px]."""
    robot, session, _ = describe_robot(Settings(), URDF_PATH, None)
    stage = RenderStage(robot, session, load_props())
    begin = session.begin(session.ready, 0.0, 0.0)
    state = session.step(begin, [cmd.Fill(FILLING)], 0.01)
    solid, water = stage.items(state), stage.water(state)
    every = [*solid, *(each.item for each in water)]
    scene = RenderScene.of(every)
    materials = [item.shape.material for item in every]
    return {
        name: PictureScene(
            vertices=scene.vertices.astype(float),
            normals=scene.normals.astype(float),
            faces=scene.faces.astype(np.int64),
            item=scene.item.astype(np.int64),
            colour=np.array([material.colour for material in materials]),
            metallic=scene.metallic.astype(float),
            rough=scene.rough.astype(float),
            opacity=np.array([1.0] * len(solid) + [each.opacity for each in water]),
            camera=np.array(ON_TABLE),
            fov=np.array([FOV]),
            size=np.array(size),
            room=np.array([theme.floor, theme.sky, theme.cell, theme.section], dtype=float),
            shadow=np.array([theme.shadow]),
            floor=np.array([room.HEIGHT]),
            lamps=np.array([(lamp.towards, lamp.colour) for lamp in room.LAMPS], dtype=float),
        )
        for name, theme in THEMES.items()
    }


def renderers(peers: Path) -> dict[str, list[str]]:
    """Return the command of each installed renderer, without its arguments."""
    found = {OWN: [sys.executable, "-m", "benchmarks.pictures_own"]}
    python = prepare(peers, "vtk")
    if isinstance(python, str):
        print(f"VTK could not be installed: {python}", file=sys.stderr)
    else:
        found[VTK] = [str(python), "-m", "benchmarks.pictures_vtk"]
    return found


def drawn(command: list[str], scene: Path, out: Path) -> dict[str, Any]:
    """Draw ``scene`` into the file ``out`` and return the measurements; see `measured`."""
    done = subprocess.run(
        [*command, str(scene), str(out), "1"],
        capture_output=True,
        text=True,
        check=False,
        timeout=TIMEOUT,
        cwd=ROOT,
    )
    if done.returncode != 0:
        raise SystemExit(f"{command} ended with {done.returncode}: {done.stderr}")
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return found


def rows(results: Mapping[tuple[str, str], list[dict[str, Any]]]) -> list[str]:
    """Return the lines of the table in docs/benchmarks.md."""
    lines = [
        "| renderer | theme | s, median | s, least | s to load | same bytes | MB on disk |",
        "|---|---|--:|--:|--:|---|--:|",
    ]
    for (name, theme), runs in results.items():
        seconds = [each["seconds"][0] for each in runs]
        same = len({digest for each in runs for digest in each["digests"]}) == 1
        lines.append(
            f"| {name} ({', '.join(runs[0]['versions'])}) | {theme} "
            f"| {statistics.median(seconds):.1f} | {min(seconds):.1f} "
            f"| {statistics.median(each['cpu'][0] for each in runs):.1f} "
            f"| {statistics.median(each['import'] for each in runs):.1f} "
            f"| {'yes' if same else 'no'} | {runs[0]['bytes'] / 1e6:.0f} |"
        )
    return lines


def main() -> None:
    """Draw, measure and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=3, help="default: %(default)s")
    parser.add_argument("--size", type=int, nargs=2, default=(1280, 720), metavar=("W", "H"))
    parser.add_argument("--out", type=Path, default=ROOT / "test-artefacts" / "pictures")
    parser.add_argument("--peers", type=Path, default=ROOT / ".venv-bench")
    options = parser.parse_args()
    out: Path = options.out.absolute()
    out.mkdir(parents=True, exist_ok=True)
    commands = renderers(options.peers.absolute())
    results: dict[tuple[str, str], list[dict[str, Any]]] = {}
    for theme, scene in scenes(tuple(options.size)).items():
        file = out / f"{theme.lower()}.npz"
        scene.save(file)
        for _ in range(options.rounds):
            for name, command in commands.items():
                picture = out / f"{name}-{theme.lower()}.png"
                results.setdefault((name, theme), []).append(drawn(command, file, picture))
    print("\n".join(rows(dict(sorted(results.items())))))
    print(f"The pictures are in {out}.")


if __name__ == "__main__":
    main()
