"""Reference pictures of a URDF, by yourdfpy, trimesh and Pillow alone."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import numpy.typing as npt
import trimesh
import yourdfpy
from PIL import Image, ImageDraw

from katana450.arm.robot.initial_camera import FIELD_OF_VIEW, InitialCamera

SIZE = 800
"""Edge of a picture [px]."""

FINE = 4
"""Pixels of a reference picture per pixel, so that a rim counts if half of it is covered."""

Mask = npt.NDArray[np.bool_]


def placed(path: Path, joints: Mapping[str, float]) -> list[tuple[str, trimesh.Trimesh]]:
    """Return link and mesh of every visual in the root's frame, at the values of all joints."""
    urdf = yourdfpy.URDF.load(str(path), load_meshes=False, build_scene_graph=True)
    urdf.update_cfg({name: joints[name] for name in urdf.actuated_joint_names})
    meshes = []
    for name, link in urdf.link_map.items():
        for visual in link.visuals:
            shape = visual.geometry
            if shape.mesh is not None:
                scene = trimesh.load_scene(path.parent / shape.mesh.filename)
                mesh = scene.to_mesh()
                mesh.apply_scale(1.0 if shape.mesh.scale is None else shape.mesh.scale)
            elif shape.box is not None:
                mesh = trimesh.creation.box(extents=shape.box.size)
            elif shape.cylinder is not None:
                mesh = trimesh.creation.cylinder(
                    radius=shape.cylinder.radius, height=shape.cylinder.length
                )
            else:
                mesh = trimesh.creation.icosphere(subdivisions=3, radius=shape.sphere.radius)
            mesh.apply_transform(np.eye(4) if visual.origin is None else visual.origin)
            mesh.apply_transform(urdf.get_transform(name))
            meshes.append((name, mesh))
    return meshes


def silhouette(meshes: list[tuple[str, trimesh.Trimesh]], view: InitialCamera) -> Mask:
    """Return (SIZE, SIZE), True where a camera sees any of the meshes."""
    back = view.eye - view.target
    back = back / np.linalg.norm(back)
    right = np.cross((0.0, 0.0, 1.0), back)
    # Seen from above, x is to the right.
    right = right / np.linalg.norm(right) if np.any(right) else np.array((1.0, 0.0, 0.0))
    R = np.stack((right, np.cross(back, right), back))
    width = SIZE * FINE
    reach = width / 2.0 / np.tan(FIELD_OF_VIEW / 2.0)
    picture = Image.new("L", (width, width), 0)
    pen = ImageDraw.Draw(picture)
    for _, mesh in meshes:
        points = (np.asarray(mesh.vertices) - view.eye) @ R.T
        flat = points[:, :2] / -points[:, 2:] * (reach, -reach) + width / 2.0
        for corners in flat[mesh.faces].reshape(-1, 6).tolist():
            pen.polygon(corners, fill=1)
    blocks = np.asarray(picture, dtype=float).reshape(SIZE, FINE, SIZE, FINE)
    return np.asarray(blocks.mean(axis=(1, 3)) > 0.5)


def seen(picture: Path) -> Mask:
    """Return where a picture file differs from its background, the colour of its first corner."""
    pixels = np.asarray(Image.open(picture).convert("RGB")).astype(int)
    assert pixels.shape[:2] == (SIZE, SIZE)
    return np.asarray(np.abs(pixels - pixels[0, 0]).max(axis=2) > 2)


def overlap(a: Mask, b: Mask) -> float:
    """Return the ratio of intersection to union of two pictures."""
    assert a.sum() > 2000
    return float((a & b).sum() / (a | b).sum())
