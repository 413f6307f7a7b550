"""Test shape files that are mutated, random or hostile: read or refused within time and memory."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from katana450.errors import InputError
from katana450.extensions.export.vrml.vrml_world import HEADER
from katana450.extensions.importers.archive import packed
from katana450.extensions.importers.formats.shape_file import (
    SECONDS,
    Format,
)
from katana450.extensions.importers.guarded_reading import bind, read_shape_guarded
from tests.exchange.compressed_gltf import draco_glb
from tests.exchange.mutations import MUTATIONS, check_mutations, looked_at
from tests.exchange.shape_bytes import OBJ, PAINTED, ply
from tests.exchange.test_several_files import ARTICULATED
from tests.exchange.test_vrml_prototypes import JOINT

resource = pytest.importorskip("resource")

FOREIGN = Path(__file__).parent / "foreign"

SEEDS = {
    file: (FOREIGN / file).read_bytes()
    for file in (
        *("vtk.wrl", "castle.wrl", "meshlab.stl", "vtk.stl", "meshlab.obj", "vtk.ply"),
        *("meshlab.ply", "assimp.glb", "vtk.gltf"),
    )
} | {
    "colours.obj": OBJ,
    "colours.ply": PAINTED,
    "joint.wrl": f"{HEADER}\n{JOINT} Joint {{ children Joint {{ }} }}".encode(),
    "robot.zip": packed("robot.wrl", {name: text.encode() for name, text in ARTICULATED.items()}),
    "draco.glb": draco_glb(),
}


@pytest.mark.parametrize("seed", SEEDS)
def test_mutated_files_are_read_or_refused(seed: str) -> None:
    check_mutations(seed, SEEDS[seed])


@settings(max_examples=MUTATIONS)
@given(st.sampled_from(Format), st.binary(max_size=200), st.integers(0, 150))
def test_random_bytes_after_any_header_are_read_or_refused(
    format: Format, data: bytes, count: int
) -> None:
    beginnings = {Format.WRL: "castle.wrl", Format.STL: "vtk.stl", Format.OBJ: "vtk.obj"}
    beginning = beginnings.get(format, "meshlab.ply" if format is Format.PLY else "assimp.glb")
    looked_at((FOREIGN / beginning).read_bytes()[:count] + data, format)


def deeply() -> bytes:
    return f"{HEADER}\n{'Group { children ' * 500_000}".encode()


def laughs() -> bytes:
    rows = ["DEF n0 Shape { geometry Box { } }"]
    rows += [f"DEF n{i} Group {{ children [ {f'USE n{i - 1} ' * 10} ] }}" for i in range(1, 30)]
    return f"{HEADER}\n{' '.join(rows)}".encode()


@pytest.mark.parametrize(
    ("make", "format"),
    [
        (deeply, Format.WRL),
        (laughs, Format.WRL),
        (lambda: ply(faces=99_999_999_999), Format.PLY),
        (lambda: ply("9" * 1_000_000 + " 1" * 1_000_000, faces=0), Format.PLY),
    ],
    ids=["deep", "laughs", "faces", "wide"],
)
@pytest.mark.usefixtures("limited_time")
def test_hostile_files_are_refused_in_time(make: Callable[[], bytes], format: Format) -> None:
    data = make()
    start = time.perf_counter()
    with pytest.raises(InputError):
        read_shape_guarded(data, format, "../../hostile\n.bin")
    assert time.perf_counter() - start < SECONDS + 2.0


@pytest.mark.skipif(sys.platform != "linux", reason="other systems count no address space")
def test_a_reading_beyond_the_memory_limit_ends() -> None:
    assert bind.__module__ == "katana450.extensions.importers.guarded_reading"
    words = f"from {bind.__module__} import bind; bind(); bytearray({{}} << 20)"
    for mebibytes, ends in ((2048, 1), (64, 0)):
        done = subprocess.run(
            [sys.executable, "-c", words.format(mebibytes)],
            cwd=Path(__file__).parents[2],
            env=os.environ | {"OPENBLAS_NUM_THREADS": "1"},
            capture_output=True,
            check=False,
        )
        assert done.returncode == ends
        assert (b"MemoryError" in done.stderr) == bool(ends)
