"""Test texts in worlds: letters with their area, in rows and columns, justified and stretched."""

from __future__ import annotations

import numpy as np
import pytest

from katana450.errors import InputError
from katana450.extensions.export.vrml_text import HEADER
from katana450.extensions.importers.letters import filled
from katana450.extensions.importers.shape_file import Format, ShapeFile, Up, read_shape
from tests.exchange.solids import sides


def read(text: str, header: str = HEADER) -> ShapeFile:
    return read_shape(f"{header}\n{text}".encode(), Format.WRL, "world.wrl", 1e-3, Up.Z)


def shown(strings: str, style: str = "", fields: str = "") -> ShapeFile:
    font = f"fontStyle FontStyle {{ {style} }}" if style else ""
    return read(f"Shape {{ geometry Text {{ string [ {strings} ] {font} {fields} }} }}")


def box(shape: ShapeFile) -> list[float]:
    """Return the least and greatest x, then y, in units of the file."""
    low, high = shape.vertices.min(axis=0) * 1e3, shape.vertices.max(axis=0) * 1e3
    return [float(each) for each in (low[0], high[0], low[1], high[1])]


def area(shape: ShapeFile) -> float:
    """Return the area of all triangles, each positive if it is seen from the front."""
    a, b, c = np.moveaxis(shape.vertices[shape.faces], 1, 0)
    return float(np.cross(b - a, c - a)[:, 2].sum()) / 2.0 * 1e6


def test_holes_and_overlaps_are_filled_as_in_fonts() -> None:
    square = np.array(((0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0)))
    hole = square[::-1] / 2.0 + 1.0
    triangles = filled([square, hole])
    a, b, c = np.moveaxis(triangles, 1, 0)
    twice = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    assert (twice > 0.0).all()
    assert twice.sum() / 2.0 == pytest.approx(12.0)
    # Where two outlines of one direction overlap, the plane is covered once.
    both = filled([square, square + np.array((2.0, 0.0))])
    a, b, c = np.moveaxis(both, 1, 0)
    twice = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    assert np.abs(twice).sum() / 2.0 == pytest.approx(24.0)
    assert len(filled([])) == 0


def test_letters_have_their_strokes_and_holes() -> None:
    bar, ring, dot = (shown(f'"{sign}"', 'family "SANS"') for sign in ("|", "O", "."))
    width, height = sides(bar)[:2]
    assert area(bar) == pytest.approx(width * height, rel=1e-2)
    assert 0.2 < area(ring) / np.prod(sides(ring)[:2]) < 0.5
    assert area(dot) == pytest.approx(np.prod(sides(dot)[:2]), rel=1e-2)
    assert sides(ring)[2] == 0.0
    assert "Left out" not in ring.text
    # Capitals are some 0.73 of the height of a line above the base line.
    assert box(shown('"H"'))[2:] == pytest.approx([0.0, 0.73], abs=0.02)


@pytest.mark.parametrize(
    ("style", "wider"),
    [
        ('style "BOLD"', 1.05),
        ('style "ITALIC"', 0.9),
        ('family "TYPEWRITER"', 0.9),
        ('style "BOLDITALIC" family [ "Arial", "sans" ]', 1.0),
    ],
)
def test_fonts_differ(style: str, wider: float) -> None:
    plain, other = shown('"Handgriff"'), shown('"Handgriff"', style)
    assert sides(other)[0] / sides(plain)[0] > wider
    assert area(other) != pytest.approx(area(plain), rel=1e-3)
    assert sides(shown('"iiii"', 'family "TYPEWRITER"'))[0] == pytest.approx(
        sides(shown('"iiii"', 'family "TYPEWRITER" style "ITALIC"'))[0], rel=0.2
    )


def test_rows_follow_each_other() -> None:
    one, three = shown('"H"'), shown('"H", "H", "H"', "spacing 1.5 size 2")
    assert area(three) == pytest.approx(12.0 * area(one), rel=1e-6)
    assert box(three)[2:] == pytest.approx([-6.0, 1.46], abs=0.04)
    up = shown('"H", "H"', "topToBottom FALSE")
    assert box(up)[2:] == pytest.approx([0.0, 1.73], abs=0.02)


@pytest.mark.parametrize(
    ("justify", "middle"),
    [
        ('"BEGIN"', (0.5, 0.5)),
        ('[ "END", "BEGIN" ]', (-0.5, -0.5)),
        ('[ "MIDDLE", "MIDDLE" ]', (0.0, 0.0)),
        ('[ "FIRST", "END" ]', (0.5, 0.5)),
    ],
)
def test_text_is_justified(justify: str, middle: tuple[float, float]) -> None:
    left, right, low, high = box(shown('"HHHH"', f"justify {justify}"))
    width = right - left
    assert (left + right) / 2.0 == pytest.approx(middle[0] * width, abs=0.1)
    assert (low + high) / 2.0 == pytest.approx(middle[1], abs=0.2)


def test_text_from_right_to_left_ends_at_its_origin() -> None:
    left, right, *_ = box(shown('"HHHH"', "leftToRight FALSE"))
    assert right == pytest.approx(0.0, abs=0.1)
    assert left < -2.0


def test_columns_go_down_and_to_the_right() -> None:
    shape = shown('"HH", "HH"', "horizontal FALSE")
    left, right, low, high = box(shape)
    assert (low, high) == pytest.approx((-1.8, 0.0), abs=0.1)
    assert (left, right) == pytest.approx((0.0, 1.85), abs=0.1)
    up = box(shown('"HH"', "horizontal FALSE topToBottom FALSE"))
    assert up[2:] == pytest.approx([0.0, 1.73], abs=0.02)


def test_rows_are_stretched_to_their_lengths() -> None:
    wide = box(shown('"HH", "HH"', fields="length [ 10 ]"))
    assert wide[1] - wide[0] == pytest.approx(10.0, abs=0.5)
    narrow = box(shown('"HHHH", "H"', fields="maxExtent 2"))
    assert narrow[1] == pytest.approx(2.0, abs=0.1)
    assert narrow[3] == pytest.approx(0.73, abs=0.02)


def test_ascii_text_of_version_1_has_its_font() -> None:
    font = "FontStyle { family SANS style (BOLD|ITALIC) size 3 }"
    text = 'AsciiText { string [ "HH", "HH" ] justification CENTER spacing 2 }'
    shape = read(f"Separator {{ {font} {text} }}", "#VRML V1.0 ascii")
    left, right, low, high = box(shape)
    assert (left + right) / 2.0 == pytest.approx(0.0, abs=0.3)
    assert (low, high) == pytest.approx((-6.0, 2.19), abs=0.05)
    # The size is 10 without a FontStyle.
    assert box(read('AsciiText { string "H" }', "#VRML V1.0 ascii"))[3] == pytest.approx(
        7.3, abs=0.1
    )


def test_letters_that_no_font_has_are_reported() -> None:
    shape = shown('"a\u6f22b\\tc"')
    assert "Left out: letters that the font does not have." in shape.text
    with pytest.raises(InputError, match=r"has no triangles\. It has Text without letters"):
        shown('"", " "')


def test_long_texts_are_refused() -> None:
    with pytest.raises(InputError, match="has a text of more than 10000 letters"):
        shown(f'"{"a" * 10_001}"')
    assert len(shown(f'"{"." * 10_000}"').faces) > 10_000


def test_text_beside_a_solid_has_the_colour_of_its_material() -> None:
    red = "appearance Appearance { material Material { diffuseColor 1 0 0 } }"
    shape = read(f'Shape {{ geometry Box {{ }} }} Shape {{ {red} geometry Text {{ string "a" }} }}')
    assert shape.colours is not None
    assert np.unique(shape.colours, axis=0).tolist() == [[204, 204, 204, 255], [255, 0, 0, 255]]
