"""A scene of the picture benchmark as one file, so that all renderers draw the same triangles."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Callable
from dataclasses import dataclass, fields
from importlib.metadata import distribution
from pathlib import Path

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PictureScene:
    """Items, camera and room of one picture.

    Attributes:
        vertices, normals: (v, 3) of all items, in the base frame [m].
        faces: (f, 3) indices into ``vertices``.
        item: (f,) index of the item of each face.
        colour: (i, 3) sRGB from 0 to 1.
        metallic, rough: (i,) glTF's factors.
        opacity: (i,) an opacity below 1 marks water.
        camera: (2, 3) position and target [m], z up.
        fov: (1,) vertical field of view [rad].
        size: (2,) width and height [px].
        room: (4, 3) sRGB of 255: floor, sky, fine lines, coarse lines.
        shadow: (1,) strength of shadows.
        floor: (1,) height of the floor [m].
        lamps: (l, 2, 3) direction towards each lamp, and its linear colour; the first one casts
            shadows.
    """

    vertices: FloatArray
    normals: FloatArray
    faces: npt.NDArray[np.int64]
    item: npt.NDArray[np.int64]
    colour: FloatArray
    metallic: FloatArray
    rough: FloatArray
    opacity: FloatArray
    camera: FloatArray
    fov: FloatArray
    size: npt.NDArray[np.int64]
    room: FloatArray
    shadow: FloatArray
    floor: FloatArray
    lamps: FloatArray

    def save(self, path: Path) -> None:
        """Write the scene to ``path``."""
        np.savez(path, **{each.name: getattr(self, each.name) for each in fields(self)})

    @classmethod
    def load(cls, path: Path) -> PictureScene:
        """Read a scene that ``save`` wrote."""
        with np.load(path) as stored:
            return cls(**{each.name: stored[each.name] for each in fields(cls)})


def measured(
    draw: Callable[[], npt.NDArray[np.uint8]],
    count: int,
    load: float,
    packages: list[str],
) -> str:
    """Return a JSON object with the times, digests and sizes of a renderer.

    Args:
        draw: returns the pixels of the picture.
        count: number of calls of ``draw``.
        load: time of the imports [s].
        packages: distributions that the renderer consists of.
    """
    seconds, cpu, digests = [], [], []
    for _ in range(count):
        start, used = time.perf_counter(), time.process_time()
        pixels = draw()
        seconds.append(time.perf_counter() - start)
        cpu.append(time.process_time() - used)
        digests.append(hashlib.sha256(pixels.tobytes()).hexdigest())
    files = [Path(str(f.locate())) for name in packages for f in distribution(name).files or ()]
    found = {
        "import": load,
        "seconds": seconds,
        "cpu": cpu,
        "digests": digests,
        "bytes": sum(path.stat().st_size for path in files if path.is_file()),
        "versions": [f"{name} {distribution(name).version}" for name in packages],
    }
    return json.dumps(found)
