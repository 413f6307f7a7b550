"""Solid bars along the lines and round the points of a file that has no surface."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from katana450.errors import InputError
from katana450.extensions.importers.surface import MeshReading, MeshSurface, Strokes
from katana450.maths.geometry.arrays import FloatArray

THICKNESS = 1.0 / 200.0
"""[1] Thickness of a bar relative to the longest side of all."""

MAX_BARS = 25_000
"""Maximum number of bars, of eight triangles each."""

BAR = ((0, 2, 1), (3, 4, 5), (0, 1, 3), (1, 4, 3), (1, 2, 4), (2, 5, 4), (2, 0, 5), (0, 3, 5))
"""Triangles of a bar with three sides: corners 0 to 2 round its start, 3 to 5 round its end."""

DIAMOND = ((0, 2, 4), (2, 1, 4), (1, 3, 4), (3, 0, 4), (2, 0, 5), (1, 2, 5), (3, 1, 5), (0, 3, 5))
"""Triangles round a point: corners 0 and 1 on both sides of it along x, 2 and 3 y, 4 and 5 z."""


def visible(reading: MeshReading, name: str) -> MeshReading:
    """Return a reading without lines: they are bars if it has no surface, else left out.

    ``name`` is the name of the file. Raises InputError if there are more than MAX_BARS.
    """
    lines = reading.surface.lines
    if lines is None:
        return reading
    ends = reading.surface.vertices[lines.ends]
    if len(reading.surface.faces) or not (np.ptp(ends, axis=(0, 1)) > 0.0).any():
        surface = replace(reading.surface, lines=None)
        return replace(reading, surface=surface, left_out=(*reading.left_out, *lines.kinds))
    note = "It has only lines and points: they are bars, as thick as 1/200 of its length."
    shown = bars(reading.surface.vertices, lines, name)
    return replace(reading, surface=shown, note=f"{reading.note} {note}".lstrip())


def bars(vertices: FloatArray, lines: Strokes, name: str) -> MeshSurface:
    """Return closed bars along ``lines`` between ``vertices``, and diamonds round single points.

    Raises InputError if there are more than MAX_BARS. ``name`` is the name of the file.
    """
    count = len(lines.ends)
    if count > MAX_BARS:
        raise InputError(
            f"{name} has no surface, only {count} lines and points; at most {MAX_BARS} can be "
            "shown as bars. Save it with faces."
        )
    a, b = vertices[lines.ends[:, 0]], vertices[lines.ends[:, 1]]
    radius = 0.5 * THICKNESS * float(np.ptp(np.concatenate((a, b)), axis=0).max())
    length = np.linalg.norm(b - a, axis=1, keepdims=True)
    along = (b - a) / np.where(length > 0.0, length, 1.0)
    # The axis that is farthest from the line gives two directions across it.
    u = np.cross(along, np.eye(3)[np.abs(along).argmin(axis=1)])
    u /= np.where(length > 0.0, np.linalg.norm(u, axis=1, keepdims=True), 1.0)
    v = np.cross(along, u)
    turn = (np.arange(3) * (2.0 * np.pi / 3.0))[:, None]
    ring = radius * (np.cos(turn) * u[:, None] + np.sin(turn) * v[:, None])
    around = radius * np.repeat(np.eye(3), 2, axis=0) * np.tile((1.0, -1.0), 3)[:, None]
    is_line = length[:, :, None] > 0.0
    bar = np.concatenate((a[:, None] + ring, b[:, None] + ring), axis=1)
    corners = np.where(is_line, bar, a[:, None] + around)
    faces = (
        np.where(is_line, np.array(BAR), np.array(DIAMOND)) + 6 * np.arange(count)[:, None, None]
    )
    colours = None if lines.colours is None else np.repeat(lines.colours, len(BAR), axis=0)
    return MeshSurface(corners.reshape(-1, 3), faces.reshape(-1, 3), colours)
