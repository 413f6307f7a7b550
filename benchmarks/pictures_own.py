"""The scenes of the picture benchmark drawn by katana450.

    python -m benchmarks.pictures_own SCENE OUT.png COUNT

Prints a JSON object; see `measured`.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

started = time.perf_counter()
import numpy as np  # noqa: E402

from benchmarks.pictures_scene import PictureScene, measured  # noqa: E402
from katana450.arm.robot.surfaces import Material, VisualMesh  # noqa: E402
from katana450.extensions.media.camera import Camera  # noqa: E402
from katana450.extensions.media.picture import Picture, Translucent, picture  # noqa: E402
from katana450.extensions.media.scene import Item  # noqa: E402
from katana450.server.viser_bridge.themes import Theme  # noqa: E402

IMPORT_SECONDS = time.perf_counter() - started


def drawn(scene: PictureScene) -> Picture:
    """Return the picture of ``scene``."""
    items = [_item(scene, number) for number in range(len(scene.colour))]
    pairs = list(zip(items, scene.opacity.tolist(), strict=True))
    (floor, sky, cell, section), shadow = _colours(scene), float(scene.shadow[0])
    position, target = (tuple(point) for point in scene.camera.tolist())
    width, height = scene.size.tolist()
    return picture(
        [item for item, opacity in pairs if opacity >= 1.0],
        [Translucent(item, opacity) for item, opacity in pairs if opacity < 1.0],
        Camera(position, target, float(scene.fov[0]), (width, height)),
        Theme(floor, cell, section, sky, shadow, dark=False),
    )


def _item(scene: PictureScene, number: int) -> Item:
    used, faces = np.unique(scene.faces[scene.item == number], return_inverse=True)
    red, green, blue = scene.colour[number].tolist()
    metallic, rough = float(scene.metallic[number]), float(scene.rough[number])
    material = Material(str(number), (red, green, blue), metallic, rough)
    shape = VisualMesh(material, scene.vertices[used], scene.normals[used], faces.reshape(-1, 3))
    return Item(str(number), shape, np.eye(4))


def _colours(scene: PictureScene) -> list[tuple[int, int, int]]:
    return [(int(red), int(green), int(blue)) for red, green, blue in scene.room]


def main() -> None:
    """Draw the picture as often as requested, each time from the triangles."""
    scene = PictureScene.load(Path(sys.argv[1]))
    measurements = measured(
        lambda: drawn(scene).pixels, int(sys.argv[3]), IMPORT_SECONDS, ["embreex", "pillow"]
    )
    Path(sys.argv[2]).write_bytes(drawn(scene).png)
    print(measurements)


if __name__ == "__main__":
    main()
