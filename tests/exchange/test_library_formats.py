"""Tests of COLLADA, 3MF and OFF: read as by other programs, or refused with a message."""

from __future__ import annotations

import io
import time
import zipfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
import trimesh

from katana450.errors import InputError
from katana450.extensions.importers.guarded_reading import read_shape_guarded
from katana450.extensions.importers.mesh_file import read_mesh
from katana450.extensions.importers.shape_file import (
    MAX_FILE_BYTES,
    SECONDS,
    Format,
    Up,
    read_shape,
)
from katana450.maths.geometry import se3, so3
from katana450.platform_support import hanging_time
from tests.exchange.mutations import check_mutations
from tests.exchange.solids import is_closed, sides, volume

L = [(0, 0), (60, 0), (60, 15), (20, 15), (20, 40), (0, 40)]
"""[mm] The L of the foreign files, whose polygons are concave."""

POINTS = [(x, y, z) for z in (0, 25) for x, y in L]

POLYGONS = [
    *([5, 4, 3, 2, 1, 0], [6, 7, 8, 9, 10, 11]),
    *([i, (i + 1) % 6, 6 + (i + 1) % 6, 6 + i] for i in range(6)),
]

DAE = """<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit name="millimeter" meter="{meter}"/><up_axis>{up}</up_axis></asset>
<library_effects><effect id="e"><profile_COMMON><technique sid="t"><lambert>
<diffuse><color>1 0.5 0 1</color></diffuse></lambert></technique></profile_COMMON></effect>
</library_effects>
<library_materials><material id="m"><instance_effect url="#e"/></material></library_materials>
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="a" count="36">{points}</float_array><technique_common>
<accessor source="#a" count="12" stride="3"><param name="X" type="float"/>
<param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<polylist count="8" material="s"><input semantic="VERTEX" source="#v" offset="0"/>
<vcount>{counts}</vcount><p>{corners}</p></polylist></mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="w">{nodes}</visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#w"/></scene></COLLADA>"""

GEOMETRY = (
    '<instance_geometry url="#g"><bind_material><technique_common>'
    '<instance_material symbol="s" target="#m"/></technique_common></bind_material>'
    "</instance_geometry>"
)


def dae(
    meter: object = 0.001, up: str = "Z_UP", nodes: str = f"<node>{GEOMETRY}</node>", **other: str
) -> bytes:
    fields = {
        "points": " ".join(f"{x} {y} {z}" for x, y, z in POINTS),
        "counts": " ".join(str(len(each)) for each in POLYGONS),
        "corners": " ".join(str(corner) for each in POLYGONS for corner in each),
    } | other
    return DAE.format(meter=meter, up=up, nodes=nodes, **fields).encode()


def off(header: str = "OFF") -> bytes:
    paint = " 255 128 0 255" if header == "COFF" else ""
    rows = [f"{x} {y} {z}{paint}" for x, y, z in POINTS]
    rows += [f"{len(each)} {' '.join(map(str, each))}" for each in POLYGONS]
    return f"{header} # an L\n\n12 8 0\n{chr(10).join(rows)}\n".encode()


@pytest.mark.parametrize(
    "data",
    [
        b"\t   OFF" + off()[off().index(b"\n12") + 1 :],
        off().replace(b"12 8 0", b"12 8"),
        off().replace(b"OFF # an L\n\n12 8 0", b"# first\n OFF\t12 8 0"),
    ],
)
def test_header_of_off_may_have_other_forms(data: bytes) -> None:
    plain, shape = (read_shape(each, Format.OFF, "l") for each in (off(), data))
    np.testing.assert_array_equal(shape.vertices[shape.faces], plain.vertices[plain.faces])


SKIN = """<library_controllers><controller id="bones">{body}</controller></library_controllers>
<library_visual_scenes>"""

SKINNED = SKIN.format(
    body="""<skin source="#g"><bind_shape_matrix>1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1</bind_shape_matrix>
<source id="j"><Name_array id="ja" count="1">root</Name_array><technique_common>
<accessor source="#ja" count="1"><param name="JOINT" type="Name"/></accessor></technique_common>
</source><source id="m"><float_array id="ma" count="16">1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1
</float_array><technique_common><accessor source="#ma" count="1" stride="16">
<param name="TRANSFORM" type="float4x4"/></accessor></technique_common></source>
<source id="w"><float_array id="wa" count="1">1</float_array><technique_common>
<accessor source="#wa" count="1"><param name="WEIGHT" type="float"/></accessor></technique_common>
</source><joints><input semantic="JOINT" source="#j"/>
<input semantic="INV_BIND_MATRIX" source="#m"/></joints><vertex_weights count="12">
<input semantic="JOINT" source="#j" offset="0"/><input semantic="WEIGHT" source="#w" offset="1"/>
<vcount>1 1 1 1 1 1 1 1 1 1 1 1</vcount><v>0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0</v>
</vertex_weights></skin>"""
)

MORPHED = SKIN.format(
    body="""<morph source="#g" method="NORMALIZED"><source id="t"><IDREF_array id="ta" count="1">g
</IDREF_array><technique_common><accessor source="#ta" count="1">
<param name="MORPH_TARGET" type="IDREF"/></accessor></technique_common></source>
<source id="w"><float_array id="wa" count="1">0</float_array><technique_common>
<accessor source="#wa" count="1"><param name="MORPH_WEIGHT" type="float"/></accessor>
</technique_common></source><targets><input semantic="MORPH_TARGET" source="#t"/>
<input semantic="MORPH_WEIGHT" source="#w"/></targets></morph>"""
)


@pytest.mark.parametrize(
    ("controller", "said"), [(SKINNED, "bones"), (MORPHED, "changes of shape")]
)
def test_deformed_collada_keeps_its_surface(controller: str, said: str) -> None:
    nodes = f"<node>{GEOMETRY}</node>".replace("instance_geometry", "instance_controller")
    data = dae(nodes=nodes.replace('url="#g"', 'url="#bones"'))
    data = data.replace(b"<library_visual_scenes>", controller.encode())
    plain, shape = (read_shape(each, Format.DAE, "l") for each in (dae(), data))
    np.testing.assert_array_equal(shape.vertices[shape.faces], plain.vertices[plain.faces])
    assert f"Left out: {said}" in shape.text


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
    shape = read_shape(off(), Format.OFF, "l", 1e-3)
    vertices = "".join(
        '<vertex x="{:g}" y="{:g}" z="{:g}"/>'.format(*row) for row in shape.vertices * 1e3
    )
    triangles = "".join('<triangle v1="{}" v2="{}" v3="{}"/>'.format(*row) for row in shape.faces)
    model = MODEL.format(unit=unit, vertices=vertices, triangles=triangles, more=more)
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in ({"3D/3dmodel.model": model.encode()} | (files or {})).items():
            archive.writestr(name, content)
    return out.getvalue()


@pytest.mark.parametrize(
    ("data", "format", "colour"),
    [
        (dae(), Format.DAE, [255, 128, 0, 255]),
        (off(), Format.OFF, None),
        (off("COFF"), Format.OFF, [255, 128, 0, 255]),
    ],
    ids=["dae", "off", "coff"],
)
def test_concave_polygons_units_and_colours(
    data: bytes, format: Format, colour: list[int] | None
) -> None:
    shape = read_shape(data, format, "l")
    assert (shape.unit, sides(shape), is_closed(shape)) == (1e-3, [60.0, 40.0, 25.0], True)
    assert volume(shape) == pytest.approx(35e-6, rel=1e-6)
    a, b, c = np.moveaxis(shape.vertices[shape.faces], 1, 0)
    # A fan of a concave polygon would cover more than the polygon.
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2.0
    assert area == pytest.approx(1e-6 * (2 * 1400 + 25 * 200), rel=1e-5)
    if colour is None:
        assert shape.colours is None
    else:
        assert shape.colours is not None
        assert np.unique(shape.colours, axis=0).tolist() == [colour]


def test_components_units_and_transforms_of_3mf() -> None:
    shape = read_shape(threemf(), Format.THREEMF, "l.3mf")
    assert "the unit is mm, as in the file" in shape.text
    # Rotated by 90 degrees about z.
    assert (sides(shape), is_closed(shape)) == ([40.0, 60.0, 25.0], True)
    assert volume(shape) == pytest.approx(35e-6, rel=1e-6)
    assert read_shape(threemf("centimeter"), Format.THREEMF, "l").unit == 1e-2


def test_transforms_and_axes_of_dae() -> None:
    turned = '<node><matrix>-1 0 0 5 0 1 0 0 0 0 1 0 0 0 0 1</matrix><node id="n">{}</node></node>'
    shape = read_shape(dae(nodes=turned.format(GEOMETRY)), Format.DAE, "l")
    assert shape.vertices[:, 0].max() == pytest.approx(5e-3)
    # Mirrored, and its faces still look outward.
    assert volume(shape) == pytest.approx(35e-6, rel=1e-6)
    upright = read_shape(dae(up="Y_UP"), Format.DAE, "l")
    assert sides(upright) == [60.0, 25.0, 40.0]
    assert sides(read_shape(dae(up="Y_UP"), Format.DAE, "l", up=Up.Z)) == [60.0, 40.0, 25.0]
    assert sides(read_shape(dae(up="X_UP"), Format.DAE, "l")) == [40.0, 25.0, 60.0]


def test_other_units_become_metres() -> None:
    shape = read_shape(dae(meter=0.002), Format.DAE, "l")
    assert (shape.unit, sides(shape)) == (1.0, [120.0, 80.0, 50.0])
    mesh = read_mesh(dae(meter=0.002), "l.dae")
    assert mesh.unit == "m"
    again = read_mesh(mesh.file, "l.dae", mesh.unit)
    np.testing.assert_array_equal(again.vertices, mesh.vertices)


# pycollada, when it writes, with NumPy 2.5.
@pytest.mark.filterwarnings("ignore:Setting the shape on a NumPy array:DeprecationWarning")
@pytest.mark.parametrize("kind", ["dae", "3mf", "off"])
def test_another_program_writes_the_same(kind: str) -> None:
    turn = se3.from_rotation_translation(so3.exp((0.2, 0.4, 0.6)), (5.0, 0.0, 0.0))
    mesh = trimesh.creation.annulus(10.0, 30.0, 25.0, transform=turn)
    data = mesh.export(file_type=kind)
    data = data.encode() if isinstance(data, str) else data
    shape = read_shape(data, Format(kind), "a", 1e-3, Up.Z)
    assert len(shape.faces) == len(mesh.faces)
    assert is_closed(shape)
    assert volume(shape) == pytest.approx(mesh.volume * 1e-9, rel=1e-5)


ENTITY = b'<?xml version="1.0"?>\n<!DOCTYPE a [<!ENTITY b SYSTEM "file:///etc/passwd">]>\n'


@pytest.mark.parametrize(
    ("data", "format", "said"),
    [
        (b"", Format.DAE, "corrupt or not COLLADA"),
        (b"<a/>", Format.DAE, "not COLLADA"),
        (dae()[:-300], Format.DAE, "line 1"),
        (ENTITY + dae().partition(b"\n")[2], Format.DAE, "declares XML entities"),
        (dae(counts="6 6 4 4 4 4 4 5"), Format.DAE, "corners they declare|no triangles"),
        (dae(corners="99 " * 36), Format.DAE, "vertex 99|no triangles|corrupt"),
        (dae(meter=0), Format.DAE, "its unit is 0 m"),
        (dae(nodes=""), Format.DAE, "has no triangles"),
        (b"PK", Format.THREEMF, "cannot be read as a .zip"),
        (threemf("league"), Format.THREEMF, "'league' is not a unit of 3MF"),
        (threemf(more=' transform="nan 0 0 0 1 0 0 0 1 0 0 0"'), Format.THREEMF, "finite|corrupt"),
        (
            threemf(files={"big": bytes(MAX_FILE_BYTES)}),
            Format.THREEMF,
            "more than 20 MB when unpacked",
        ),
        (threemf(files={f"f{i}": b"" for i in range(300)}), Format.THREEMF, "more than 256 files"),
        (b"", Format.OFF, "not OFF"),
        (b"OFF BINARY\n", Format.OFF, "not OFF"),
        (b"OFF\n3 1", Format.OFF, "ends too early"),
        (b"OFF\n3 1 0\n0 0 0\n1 0\n0 1 0\n3 0 1 2", Format.OFF, "line 4: a vertex has 3 numbers"),
        (b"OFF\n3 1 0\n0 0 0\n1 0 x\n0 1 0\n3 0 1 2", Format.OFF, "line 4: expected numbers"),
        (
            b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1",
            Format.OFF,
            "line 6: this face does not have 3 corners",
        ),
        (b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 3", Format.OFF, "vertex 3, counted from 0"),
        (b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 nan 0\n3 0 1 2", Format.OFF, "not finite numbers"),
    ],
)
def test_corrupt_file_is_refused_with_a_message(data: bytes, format: Format, said: str) -> None:
    with pytest.raises(InputError, match=said):
        read_shape(data, format, f"a.{format.value}")


def test_no_other_file_is_opened(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Pictures and geometry in files beside it stay unread."""
    other = tmp_path / "other.dae"
    other.write_bytes(dae())
    image = (
        f"<library_images><image id='i'><init_from>{other}</init_from></image></library_images>"
        "<library_effects>"
    )
    named = dae().replace(b"<library_effects>", image.encode())
    elsewhere = dae(nodes=f'<node><instance_geometry url="{other.as_uri()}#g"/></node>')
    # Triggers imports on first use before files are watched.
    read_shape(dae(), Format.DAE, "l")
    opened: list[str] = []
    monkeypatch.setattr("builtins.open", lambda path, *_a, **_k: opened.append(str(path)))
    shape = read_shape(named, Format.DAE, "l")
    with pytest.raises(InputError, match=r"no triangles\. It has 1 corrupt parts"):
        read_shape(elsewhere, Format.DAE, "l")
    monkeypatch.undo()
    assert "pictures on the surface" in shape.text
    assert not opened


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
    for at in (data.index(b"big") - 46 + 24, data.rindex(b"big") - 46 + 24):
        data[at : at + 4] = (100).to_bytes(4, "little")
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


SEEDS = {"l.dae": dae(), "l.3mf": threemf(), "l.off": off(), "c.off": off("COFF")}


@pytest.mark.parametrize("seed", SEEDS)
def test_mutated_files_are_read_or_refused(seed: str) -> None:
    check_mutations(seed, SEEDS[seed])
