"""Tests of the reading time: any mesh within the size limits is read in time.

Processor time is measured, because the machine may be shared.
"""

from __future__ import annotations

import numpy as np
import pytest

from katana450.extensions.importers import guarded_reading
from katana450.extensions.importers.formats.mesh_file import read_mesh
from katana450.extensions.importers.formats.shape_file import SECONDS
from katana450.maths.geometry.arrays import FloatArray

resource = pytest.importorskip("resource")

OURS = 1.0
"""[s] Maximum processor time in the process of the server."""


def stl(triangles: FloatArray) -> bytes:
    """Return a binary STL file of triangles (n, 3, 3)."""
    facet = [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attributes", "<u2")]
    rows = np.zeros(len(triangles), dtype=facet)
    rows["corners"] = triangles
    return bytes(80) + len(triangles).to_bytes(4, "little") + rows.tobytes()


def soup(count: int) -> FloatArray:
    """Return small triangles (count, 3, 3) [mm] in a cube, without common corners."""
    rng = np.random.default_rng(1)
    return rng.uniform(-100.0, 100.0, (count, 1, 3)) + rng.normal(size=(count, 3, 3))


def spent() -> tuple[float, float]:
    """Return the processor time [s] of this process, and of its children that have ended."""
    own, others = (
        resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    )
    return own.ru_utime + own.ru_stime, others.ru_utime + others.ru_stime


def test_mesh_is_read_in_the_time_promised(monkeypatch: pytest.MonkeyPatch) -> None:
    # The reading process limits its own processor time.
    monkeypatch.setattr(guarded_reading, "SECONDS", 100.0)
    own, others = spent()
    mesh = read_mesh(stl(soup(20_000)), "soup.stl")
    own, others = spent()[0] - own, spent()[1] - others
    assert mesh.text.startswith("20000 triangles")
    assert len(mesh.faces) == 20_000
    assert own + others < SECONDS
    assert own < OURS
