"""Tests of 3MF: read as other programs do, or refused with a message."""

from __future__ import annotations

import io
import time
import zipfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from katana450.errors import InputError
from katana450.extensions.importers.formats.mesh_file import read_mesh
from katana450.extensions.importers.formats.shape_file import (
    MAX_FILE_BYTES,
    SECONDS,
    Format,
    read_shape,
)
from katana450.extensions.importers.guarded_reading import read_shape_guarded
from katana450.platform_support import hanging_time
from tests.exchange.mutations import check_mutations
from tests.exchange.shape_bytes import zipped
from tests.exchange.solids import is_closed, sides, volume

FOREIGN = Path(__file__).parent / "foreign"

MODEL = (
    '<model unit="{unit}" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02">'
    '<resources><object id="1"><mesh><vertices>{vertices}</vertices>'
    "<triangles>{triangles}</triangles></mesh></object>"
    '<object id="2"><components><component objectid="1" transform="0 1 0 -1 0 0 0 0 1 0 0 5"/>'
    '</components></object></resources><build><item objectid="2"{more}/></build></model>'
)


def threemf(
    unit: str = "millimeter", more: str = "", files: dict[str, bytes] | None = None
) -> bytes:
    shape = read_shape((FOREIGN / "vtk.obj").read_bytes(), Format.OBJ, "l", 1e-3)
    vertices = "".join(
        '<vertex x="{:g}" y="{:g}" z="{:g}"/>'.format(*row) for row in shape.vertices * 1e3
    )
    triangles = "".join('<triangle v1="{}" v2="{}" v3="{}"/>'.format(*row) for row in shape.faces)
    model = MODEL.format(unit=unit, vertices=vertices, triangles=triangles, more=more)
    return zipped({"3D/3dmodel.model": model.encode()} | (files or {}))


def test_components_units_and_transforms_of_3mf() -> None:
    shape = read_shape(threemf(), Format.THREEMF, "l.3mf")
    assert "the unit is mm, as in the file" in shape.text
    # Rotated by 90 degrees about z.
    assert (sides(shape), is_closed(shape)) == ([40.0, 60.0, 25.0], True)
    assert volume(shape) == pytest.approx(35e-6, rel=1e-6)
    assert read_shape(threemf("centimeter"), Format.THREEMF, "l").unit == 1e-2


def test_other_units_become_metres() -> None:
    mesh = read_mesh(threemf("micron"), "l.3mf")
    assert mesh.unit == "m"
    again = read_mesh(mesh.file, "l.3mf", "m")
    np.testing.assert_array_equal(again.vertices, mesh.vertices)


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"PK", "cannot be read as a .zip"),
        (threemf("league"), "'league' is not a unit of 3MF"),
        (threemf(more=' transform="nan 0 0 0 1 0 0 0 1 0 0 0"'), "finite|corrupt"),
        (threemf(files={"big": bytes(MAX_FILE_BYTES)}), "more than 20 MB when unpacked"),
        (threemf(files={f"f{i}": b"" for i in range(300)}), "more than 256 files"),
    ],
)
def test_corrupt_file_is_refused_with_a_message(data: bytes, said: str) -> None:
    with pytest.raises(InputError, match=said):
        read_shape(data, Format.THREEMF, "a.3mf")


def laughing_archive() -> bytes:
    """Return an archive of objects of ten components each, nested many times."""
    objects = "".join(
        f'<object id="{i}"><components>{f"<component objectid={chr(34)}{i - 1}{chr(34)}/>" * 10}'
        "</components></object>"
        for i in range(3, 30)
    )
    with zipfile.ZipFile(io.BytesIO(threemf())) as archive:
        model = archive.read("3D/3dmodel.model").decode()
    model = model.replace("</resources>", f"{objects}</resources>")
    model = model.replace('<item objectid="2"', '<item objectid="29"')
    return threemf(files={"3D/3dmodel.model": model.encode()})


def bomb() -> bytes:
    """Return an archive that declares a smaller size than it unpacks to."""
    data = bytearray(threemf(files={"big": bytes(50_000_000)}))
    for place in (data.index(b"big") - 46 + 24, data.rindex(b"big") - 46 + 24):
        data[place : place + 4] = (100).to_bytes(4, "little")
    return bytes(data)


def entities(file: str = "") -> bytes:
    """Return an archive whose model nests entities by tens, or includes another file."""
    rows = [f'<!ENTITY e0 SYSTEM "{file}">' if file else '<!ENTITY e0 "0123456789">']
    rows += [f'<!ENTITY e{i} "{f"&e{i - 1};" * 10}">' for i in range(1, 12)]
    with zipfile.ZipFile(io.BytesIO(threemf())) as archive:
        model = archive.read("3D/3dmodel.model").decode()
    name = "&e0;" if file else "&e11;"
    model = model.replace('<object id="1"', f'<object id="1" name="{name}"')
    return threemf(files={"3D/3dmodel.model": f"<!DOCTYPE m [{''.join(rows)}]>{model}".encode()})


@pytest.mark.parametrize(
    "make",
    [
        bomb,
        pytest.param(entities, marks=pytest.mark.long),
        pytest.param(lambda: entities("file:///etc/passwd"), marks=pytest.mark.long),
    ],
    ids=["bomb", "entities", "other file"],
)
@pytest.mark.usefixtures("limited_time")
def test_hostile_archive_is_refused_in_time(make: Callable[[], bytes]) -> None:
    data = make()
    start = time.perf_counter()
    with pytest.raises(InputError):
        read_shape_guarded(data, Format.THREEMF, "hostile.3mf")
    assert time.perf_counter() - start < SECONDS + 2.0


@pytest.mark.long
@pytest.mark.usefixtures("limited_time")
def test_archive_of_nested_copies_costs_no_more_than_the_limits() -> None:
    """A quick machine reads it within the limit: the library shows each part once."""
    data, start = laughing_archive(), time.perf_counter()
    with suppress(InputError):
        read_shape_guarded(data, Format.THREEMF, "hostile.3mf")
    assert time.perf_counter() - start < hanging_time(SECONDS)


def test_mutated_files_are_read_or_refused() -> None:
    check_mutations("l.3mf", threemf())
