"""Test mistakes in VRML worlds that leave no doubt about the surface: read, most with a note."""

from __future__ import annotations

import pytest

from katana450.errors import InputError
from katana450.extensions.export.vrml_text import HEADER
from katana450.extensions.importers.shape_file import Format, ShapeFile, Up, read_shape
from tests.exchange.solids import sides, volume

BOX = "Shape { geometry Box { } }"


def read(text: str, header: str = HEADER) -> ShapeFile:
    return read_shape(f"{header}\n{text}".encode(), Format.WRL, "world.wrl", 1e-3, Up.Z)


@pytest.mark.parametrize(
    ("text", "note"),
    [
        (f"DEF Transform {{ children {BOX} }}", ""),
        (f"Group {{ DEF a Group {{ children {BOX} }} }}", ""),
        (f"Transform {{ {BOX} translation 1 0 0 }}", ""),
        (f"Switch {{ choice DEF a {BOX} }} Transform {{ scale 1 1 1 USE a }}", ""),
        ("Transform { children Box { } }", ""),
        ("Shape { geometry Box { } appearance Appearance { DEF a Material { } } }", "a node in A"),
        (f"Anchor {{ children {BOX} }} Group {{ bboxSize 1 1 1 children USE b }}", "not defined"),
        (f"Collision {{ collide true children {BOX} }} Collision {{ collide False }}", ""),
        ("Shape { geometry Box { } appearance [ Appearance { } ] }", ""),
        ("Shape { geometry Box { } appearance [ 1 0 0, 0 1 0 ] }", "in the place of nodes"),
        ("Shape { geometry Box { } appearance 7 }", "in the place of nodes"),
        (f"{BOX} Shape {{ geometry Extrusion {{ spine [ 0 0 0 ] }} }}", "too few points"),
        (
            f"{BOX} Shape {{ geometry ElevationGrid {{ xDimension 9 zDimension 9 }} }}",
            "heights that do not match",
        ),
        (f'{BOX} Inline {{ url "..\\parts\\a.wrl" }}', "not there: ../parts/a.wrl"),
        (f"Switch {{ choice DEF a DEF a Group {{ children {BOX} }} }} USE a", ""),
        (f"Group {{ children {BOX} name TITLE bboxSize 1 1 1 }}", "name of Group"),
        ("geometry Box { }", ""),
        (f'EXTERNPROTO P [ ] [ "a.wrl" "urn:x:node:Group" ] DEF p P {{ children {BOX} }}', ""),
    ],
)
def test_a_mistake_leaves_the_rest_of_the_world(text: str, note: str) -> None:
    shape = read(text)
    assert volume(shape) == pytest.approx(8e-9)
    assert note in shape.text
    assert note or "Left out" not in shape.text


def test_heights_beyond_a_grid_are_dropped() -> None:
    grid = "xDimension 2 zDimension 2 height [ 0 0 0 0 9 9 ]"
    shape = read(f"Shape {{ geometry ElevationGrid {{ {grid} }} }}")
    assert sides(shape) == pytest.approx([1.0, 0.0, 1.0])
    assert "heights that do not match their grid" in shape.text


@pytest.mark.parametrize(
    ("geometry", "size"),
    [
        ("Box { size 4 0 2 }", [4.0, 0.0, 2.0]),
        ("Cylinder { radius 2 height 0 }", [4.0, 0.0, 4.0]),
        ("Cone { bottomRadius 2 height 0 }", [4.0, 0.0, 4.0]),
    ],
)
def test_a_solid_without_a_height_is_a_plate(geometry: str, size: list[float]) -> None:
    assert sides(read(f"Shape {{ geometry {geometry} }}")) == pytest.approx(size)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("Shape { geometry Box { size [ 1 ", "line 2: expected a number, not '\\['"),
        ("Shape { appearance [ 1 0 0 } ]", "expected '{'|closes nothing|'}'"),
        ("Collision { collide maybe }", "line 2: expected TRUE or FALSE, not 'maybe'"),
        ("Group { DEF", "ends too early"),
    ],
)
def test_a_mistake_that_hides_what_is_meant_is_refused(text: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        read(text)
