"""Test X3D in XML: nodes in their fields, prototypes, units, other files, errors by their line."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest

from katana450.cli.main import main
from katana450.errors import InputError
from katana450.extensions.export.vrml_text import HEADER
from katana450.extensions.importers.archive import packed
from katana450.extensions.importers.mesh_file import read_mesh_file
from katana450.extensions.importers.shape_file import Format, ShapeFile, Up, read_shape
from tests.exchange.solids import sides, triangles, volume
from tests.exchange.tools import needs, run

FOREIGN = Path(__file__).parent / "foreign"

START = """<?xml version="1.0" encoding="UTF-8"?>
<!DOCTYPE X3D PUBLIC "ISO//Web3D//DTD X3D 3.3//EN" "https://www.web3d.org/specifications/x3d-3.3.dtd">
<X3D profile="Immersive" version="3.3">
"""

RED = '<Appearance><Material diffuseColor="1 0 0"/></Appearance>'

SQUARE = '<Coordinate point="0 0 0, 1 0 0, 1 1 0, 0 1 0"/>'


def document(scene: str, head: str = "") -> bytes:
    return f"{START}<head>{head}</head>\n<Scene>\n{scene}\n</Scene>\n</X3D>\n".encode()


def read(scene: str, unit: float | None = 1e-3, head: str = "", **others: bytes) -> ShapeFile:
    """Return the shape of a scene, z up, with other files of the upload by their names."""
    files = {name.replace("_", "."): content for name, content in others.items()}
    data = packed("a.x3d", {"a.x3d": document(scene, head)} | files)
    return read_shape(data, Format.ZIP, "a.zip", unit, Up.Z)


def test_nodes_get_into_their_fields() -> None:
    shape = read(
        "<!-- a part -->"
        '<Transform DEF="T" translation="10 0 0" metadata="x"><MetadataString name="a"/>'
        f'<Shape>{RED}<Box size="1 2 3"/></Shape></Transform>'
        '<Transform translation="0 20 0" scale="2 2 2"><Group USE="T"/></Transform>'
        '<TimeSensor DEF="C"/><ROUTE fromNode="C" fromField="x" toNode="T" toField="y"/>'
    )
    assert volume(shape) == pytest.approx(6e-9 + 48e-9)
    assert sides(shape) == pytest.approx([11.5, 23.0, 6.0])
    assert shape.colours is not None
    assert np.unique(shape.colours, axis=0).tolist() == [[255, 0, 0, 255]]
    assert "Left out" not in shape.text


@pytest.mark.parametrize(
    "geometry",
    [
        f'<IndexedFaceSet coordIndex="0 1 2 3 -1" solid="false">{SQUARE}</IndexedFaceSet>',
        f"<QuadSet>{SQUARE}</QuadSet>",
        (
            f'<IndexedTriangleSet index="0,1,2,0,2,3" containerField="geometry">{SQUARE}'
            '<Color color="1 0 0 1 0 0 1 0 0 1 0 0"/></IndexedTriangleSet>'
        ),
        '<Rectangle2D size="1 1"/>',
        f"<Inline url='\"gone.wrl\"'/><QuadSet>{SQUARE}</QuadSet>",
    ],
    ids=["faces", "quads", "triangles", "rectangle", "misplaced"],
)
def test_geometry(geometry: str) -> None:
    shape = read(f"<Shape>{geometry}</Shape>")
    assert len(shape.faces) == 2
    assert sides(shape) == [1.0, 1.0, 0.0]


def test_texts_and_switches() -> None:
    shape = read(
        "<Shape><Text string='\"HH\" \"HH\"' solid='true'>"
        "<FontStyle justify='\"MIDDLE\" \"MIDDLE\"' size='2' style='BOLD'/></Text></Shape>"
        '<Switch whichChoice="1"><Group/><Shape><Box/></Shape></Switch>'
        '<LOD range="5"><Group/><Shape><Sphere radius="100"/></Shape></LOD>'
    )
    assert volume(shape) == pytest.approx(8e-9)
    assert sides(shape)[1] == pytest.approx(2.0 + 1.46, abs=0.05)


PROTOTYPES = """
<ProtoDeclare name="Plate"><ProtoInterface>
  <field accessType="inputOutput" type="SFVec3f" name="size" value="1 2 3"/>
  <field accessType="initializeOnly" type="SFColor" name="paint" value="0 0 1"/>
  <field accessType="initializeOnly" type="SFImage" name="picture" value="1 1 1 255"/>
  <field accessType="inputOnly" type="SFTime" name="set_now"/>
  <field accessType="inputOutput" type="MFNode" name="parts">
    <Shape><Box size="9 9 9"/></Shape>
  </field>
</ProtoInterface><ProtoBody>
  <Transform>
    <Shape>
      <Appearance><Material>
        <IS><connect nodeField="diffuseColor" protoField="paint"/></IS>
      </Material></Appearance>
      <Box size="5 5 5"><IS><connect nodeField="size" protoField="size"/></IS></Box>
    </Shape>
    <Group><IS><connect nodeField="children" protoField="parts"/></IS></Group>
  </Transform>
</ProtoBody></ProtoDeclare>
"""


def test_prototypes_are_expanded() -> None:
    shape = read(
        f"{PROTOTYPES}<ProtoInstance name='Plate'><fieldValue name='size' value='2 2 2'/>"
        "<fieldValue name='parts'><Transform translation='10 0 0'><Shape><Box size='1 1 1'/>"
        "</Shape></Transform></fieldValue></ProtoInstance>"
    )
    assert volume(shape) == pytest.approx(9e-9)
    assert shape.colours is not None
    assert [0, 0, 255, 255] in shape.colours.tolist()
    # The default values, at the place of a node in a field.
    default = read(f"{PROTOTYPES}<Group><ProtoInstance name='Plate' DEF='p'/></Group>")
    assert volume(default) == pytest.approx(6e-9 + 729e-9)


def test_prototypes_and_worlds_of_other_files() -> None:
    external = (
        "<ExternProtoDeclare name='Plate' url='\"b.x3d#Plate\"'>"
        "<field accessType='inputOutput' type='SFVec3f' name='size'/></ExternProtoDeclare>"
        "<ProtoInstance name='Plate'><fieldValue name='size' value='1 1 1'/></ProtoInstance>"
    )
    shape = read(
        external
        + "<Transform translation='0 0 50'><Inline url='\"c.wrl\" \"d.wrl\"'/></Transform>",
        b_x3d=document(PROTOTYPES),
        c_wrl=f'{HEADER}\nInline {{ url "e.x3d" }}'.encode(),
        e_x3d=document("<Shape><Box size='2 2 2'/></Shape>"),
    )
    assert volume(shape) == pytest.approx(1e-9 + 729e-9 + 8e-9)


def test_units_of_the_head_count() -> None:
    head = '<unit category="length" name="inch" conversionFactor="0.0254"/><meta name="a"/>'
    shape = read("<Shape><Box size='1 1 1'/></Shape>", None, head)
    assert shape.unit == 0.0254
    assert sides(shape) == pytest.approx([25.4] * 3)
    bad = head.replace("0.0254", "0")
    with pytest.raises(InputError, match=r"a.x3d, line .: the unit 'inch' of 0 m is not possible"):
        read("<Shape><Box/></Shape>", None, bad)


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (document("<Shape>\n<Box size='1 a 1'/></Shape>"), "line 7: expected a number, not 'a'"),
        (document("<Shape><Box"), "a.x3d is corrupt: .*line 7"),
        (document(""), "a.x3d has no triangles"),
        (document("<Wobbler a='1'><Box/></Wobbler>"), "has no triangles. It has Wobbler"),
        (document("<Group USE='gone'/>"), "nodes that are used, but not defined"),
        (document("<Shape><Box size='1 1 1 } }'/></Shape>"), "line 6: expected"),
        (document("<Group>" * 300 + "</Group>" * 300), "nodes are nested more than 200 deep"),
        (b"<html><body/></html>", "a.x3d is not X3D: it has no Scene"),
        (b"<X3D>", "is corrupt"),
        (b"<!DOCTYPE X3D [<!ENTITY a 'b'>]><X3D><Scene>&a;</Scene></X3D>", "entities of its own"),
        (b"<!DOCTYPE X3D [<!ENTITY a SYSTEM 'file:///etc/passwd'>]><X3D/>", "entities of its own"),
        (b"<X3D><Scene>&a;</Scene></X3D>", "is corrupt"),
        (b"<!DOCTYPE X3D SYSTEM 'a'><X3D><Scene>&a;</Scene></X3D>", "has no triangles"),
        (b"<?xml version='1.0' encoding='ebcdic-cp-us'?><X3D/>", "corrupt: Unsupported encoding"),
        (b"\xff\xfe<\0X\0", "it must begin with"),
    ],
)  # fmt: skip
def test_invalid_files_are_refused(data: bytes, said: str) -> None:
    with pytest.raises(InputError, match=said):
        read_shape(data, Format.of("a.x3d"), "a.x3d")


def test_changed_files_are_read_or_refused() -> None:
    chance = np.random.default_rng(4)
    whole = document(
        f"{PROTOTYPES}<ProtoInstance name='Plate'/><Shape>{RED}<QuadSet>{SQUARE}</QuadSet></Shape>"
    )
    kinds = set()
    for _ in range(200):
        cut = whole[: int(chance.integers(len(whole)))]
        at = int(chance.integers(len(whole)))
        swapped = whole[:at] + bytes(chance.integers(32, 127, 3, dtype=np.uint8)) + whole[at + 3 :]
        for data in (cut, swapped):
            try:
                kinds.add(len(read_shape(data, Format.WRL, "a.x3d").faces) > 0)
            except InputError:
                kinds.add(False)
    assert kinds == {True, False}


def test_a_long_line_of_numbers_is_read_in_time() -> None:
    count = 60_000
    points = " ".join(f"{i % 97} {i % 89} {i % 83}" for i in range(3 * count))
    data = document(f"<Shape><TriangleSet><Coordinate point='{points}'/></TriangleSet></Shape>")
    start = time.process_time()
    shape = read_shape(data, Format.WRL, "a.x3d", 1e-3)
    assert shape.text.startswith(f"{len(shape.faces)} triangles")
    assert time.process_time() - start < 5.0


@needs("tovrmlx3d")
def test_files_of_another_program_are_read(tmp_path: Path) -> None:
    bracket = tmp_path / "bracket.x3d"
    bracket.write_text(run("tovrmlx3d", "--encoding=xml", "--force-x3d", FOREIGN / "bracket.wrl"))
    assert "<X3D" in bracket.read_text()
    found, expected = (
        read_shape(path.read_bytes(), Format.of(path.name), path.name, 1e-3)
        for path in (bracket, FOREIGN / "bracket.wrl")
    )
    assert triangles(found.vertices * 1e3, found.faces, 3) == triangles(
        expected.vertices * 1e3, expected.faces, 3
    )


@pytest.mark.long
def test_our_own_export_is_read_back(tmp_path: Path) -> None:
    for kind in ("x3d", "vrml"):
        assert main(["export", kind, "--no-objects", "--out", str(tmp_path)]) == 0
    ours, theirs = (read_mesh_file(tmp_path / f"katana450.{kind}", "m") for kind in ("wrl", "x3d"))
    assert len(theirs.faces) == len(ours.faces)
    np.testing.assert_allclose(theirs.vertices, ours.vertices, atol=1e-9)
    np.testing.assert_allclose(theirs.solid.size, ours.solid.size, atol=1e-9)
