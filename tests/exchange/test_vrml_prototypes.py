"""Test prototypes and inlined worlds of VRML97: expanded, bounded, from the same upload."""

from __future__ import annotations

import pytest

from katana450.errors import InputError
from katana450.extensions.export.vrml.vrml_world import HEADER
from katana450.extensions.importers.archive import packed
from katana450.extensions.importers.formats.shape_file import Format, ShapeFile, Up, read_shape
from tests.exchange.solids import sides, volume

JOINT = """
PROTO Joint [
  exposedField SFVec3f translation 0 0 0
  exposedField MFNode children [ ]
  field SFVec3f size 1 1 1
  field SFColor colour 1 0 0
  field SFString name ""
  field SFImage picture 1 1 1 255
  eventIn SFVec3f set_translation
] {
  Transform {
    translation IS translation
    set_translation IS set_translation
    children [
      Shape {
        geometry Box { size IS size }
        appearance Appearance { material Material { diffuseColor IS colour } }
      }
      Group { children IS children }
    ]
  }
  Script { url "javascript:" field SFNode target NULL }
}
"""

SQUARE = "geometry Box { }"
BOX = f"{HEADER}\nShape {{ geometry Box {{ size 1 1 1 }} }}"


def read(text: str, **others: str) -> ShapeFile:
    """Return the shape of a world in mm, with other files of the upload by their names."""
    files = {"world.wrl": f"{HEADER}\n{text}"} | {
        name.replace("_", "/").replace("/wrl", ".wrl"): content for name, content in others.items()
    }
    data = packed("world.wrl", {name: content.encode() for name, content in files.items()})
    return read_shape(data, Format.ZIP, "world.zip", 1e-3, Up.Z)


def test_instances_have_their_own_values_and_children() -> None:
    shape = read(f"{JOINT} Joint {{ size 2 2 2 children [ Joint {{ translation 10 0 0 }} ] }}")
    assert volume(shape) == pytest.approx(9e-9)
    assert sides(shape) == pytest.approx([11.5, 2.0, 2.0])
    assert shape.colours is not None
    assert (shape.colours == (255, 0, 0, 255)).all()


def test_a_prototype_may_have_the_name_of_another_node() -> None:
    shape = read(
        "PROTO Cone [ field SFFloat depth 1 ] { Shape { geometry Box { size 3 2 1 } } } "
        "Transform { children Cone { depth 5 } }"
    )
    assert volume(shape) == pytest.approx(6e-9)


def test_prototypes_are_nested_and_shared() -> None:
    leg = JOINT + (
        "PROTO Leg [ field SFVec3f at 0 0 0 field SFNode foot Joint { size 1 1 3 } ] {"
        " PROTO Toe [ ] { Joint { translation 0 0 9 } }"
        " Transform { translation IS at children [ DEF J Joint { } USE J Toe { } ] } }"
    )
    shape = read(f"{leg} Leg {{ }} Leg {{ at 20 0 0 }}")
    assert len(shape.faces) == 2 * 3 * 12
    assert sides(shape) == pytest.approx([21.0, 1.0, 10.0])


def test_a_field_of_an_unknown_field_of_the_prototype_keeps_its_default() -> None:
    proto = "PROTO P [ field SFColor c 1 0 0 ] { Shape { geometry Box { size IS wrong } } }"
    assert sides(read(f"{proto} P {{ c 0 0 1 }}")) == pytest.approx([2.0] * 3)


def test_prototypes_of_prototypes_are_bounded() -> None:
    rows = ["PROTO P0 [ field SFVec3f s 1 1 1 ] { Shape { geometry Box { size IS s } } }"]
    rows += [
        f"PROTO P{i} [ field SFVec3f s 1 1 1 ] {{ Group {{ children [ P{i - 1} {{ s IS s }} "
        f"P{i - 1} {{ s IS s }} ] }} }}"
        for i in range(1, 40)
    ]
    with pytest.raises(InputError, match=r"over 100000 nodes|more than 40000 nodes"):
        read(" ".join(rows) + " P39 { }")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("PROTO P [ field SFBool b TRUE ] { } P { ", "ends too early"),
        ("PROTO P [ size 1 ] { }", "'size' is not a part of the interface"),
        ("PROTO P [ ] { P { } } P { }", "has no triangles. It has P"),
        ("PROTO P [ ] { " * 300, "nested more than 150 deep|nested too deeply"),
        ("PROTO P [ field SFVec3f s a b c ] { }", "expected '{', not 'b'"),
        (
            "PROTO P [ field SFColor c 1 0 0 ] { Shape { geometry Sphere { radius IS c } } } P { }",
            "Sphere.radius has 3 numbers, not 1",
        ),
    ],
)
def test_invalid_prototypes_are_refused(text: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        read(text)


def test_other_worlds_of_the_upload_are_shown_at_their_place() -> None:
    shape = read(
        'Transform { translation 4 0 0 children Inline { url [ "gone.wrl", "parts\\\\a.wrl" ] } }'
        ' Inline { url "B.WRL" } Inline { url "parts/a.wrl" }',
        parts_a_wrl=f'{HEADER}\nInline {{ url "c.wrl" }}',
        parts_c_wrl=BOX,
        b_wrl=f"{HEADER}\nTransform {{ translation 0 7 0 children Shape {{ {SQUARE} }} }}",
    )
    assert sides(shape) == pytest.approx([5.5, 8.5, 2.0])
    assert "not there" not in shape.text


def test_missing_worlds_are_named() -> None:
    shape = read('Shape { geometry Box { } } Inline { url "gone.wrl" } Inline { url "http://a/b" }')
    assert "It names files that are not there: gone.wrl, http://a/b. Add them" in shape.text
    with pytest.raises(InputError, match=r"no triangles. It names files that are not there: a.wrl"):
        read('Inline { url "a.wrl" }')


def test_a_file_of_the_same_name_in_another_folder_is_not_the_file_itself() -> None:
    shape = read(
        'Inline { url "a/b.wrl" }',
        a_b_wrl=f'{HEADER}\nInline {{ url "world.wrl" }} Shape {{ geometry Box {{ }} }}',
    )
    assert "not there: a/world.wrl" in shape.text


def test_no_file_outside_of_the_upload_is_read() -> None:
    for url in ("../secret.wrl", "/etc/passwd", "file:///etc/passwd", "C:\\\\secret.wrl"):
        data = f'{HEADER}\nInline {{ url "{url}" }}'.encode()
        with pytest.raises(InputError, match="not there"):
            read_shape(data, Format.WRL, "a.wrl")


def test_worlds_that_show_each_other_end() -> None:
    shape = read(
        'Shape { geometry Box { } } Inline { url "b.wrl" }',
        b_wrl=f'{HEADER}\nInline {{ url "world.wrl" }} Inline {{ url "b.wrl" }}',
    )
    assert "worlds that show themselves" in shape.text
    doubled = {
        f"n{i}_wrl": HEADER + f'\nInline {{ url "n{i + 1}.wrl" }}' * 4 for i in range(30)
    } | {"n30_wrl": BOX}
    with pytest.raises(InputError, match="more than 500000 triangles"):
        read('Inline { url "n0.wrl" }', **doubled)
