"""Physically based materials in glTF's metallic-roughness model."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Material:
    """A surface: colour is sRGB 0..1, metallic and rough are glTF's factors 0..1.

    ``paint`` is so thin that its edges are shaded together with its face.
    """

    name: str
    colour: tuple[float, float, float]
    metallic: float
    rough: float
    paint: bool = False

    def linear_colour(self) -> list[float]:
        """Return the colour for glTF: linear RGB and opacity."""
        linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in self.colour]
        return [*(round(c, 5) for c in linear), 1.0]


def _hex(code: str) -> tuple[float, float, float]:
    red, green, blue = (int(code[k : k + 2], 16) / 255.0 for k in (0, 2, 4))
    return red, green, blue


ALUMINIUM = Material("champagne aluminium", _hex("beb4a1"), 0.40, 0.42)
GREY = Material("grey aluminium", _hex("adaba7"), 0.45, 0.38)
BRIGHT = Material("bright aluminium", _hex("cfcdc8"), 0.45, 0.33)
STEEL = Material("dark steel", _hex("454340"), 0.50, 0.42)
RUBBER = Material("black rubber", _hex("1c1b1a"), 0.0, 0.78)
PLASTIC = Material("black plastic", _hex("282726"), 0.0, 0.70)
PANEL = Material("light panel", _hex("d0cfca"), 0.0, 0.50)
GREEN = Material("terminal green", _hex("1c8549"), 0.0, 0.45)
BLUE = Material("blue lettering", _hex("1f3f9c"), 0.0, 0.50, paint=True)

# The gripper's own
BRASS = Material("brass", _hex("b98f4a"), 0.45, 0.38)
LENS = Material("sensor window", _hex("561a26"), 0.0, 0.30)
PAD = Material("black pad", _hex("27272a"), 0.0, 0.60)

# Those of the SO-101
PRINT = Material("printed plastic", _hex("ecc94f"), 0.0, 0.60)
SERVO = Material("servo plastic", _hex("232427"), 0.0, 0.50)

# The props'
MELAMINE = Material("white melamine", _hex("ece9e2"), 0.0, 0.38)
RIM = Material("blue rim", _hex("2c4f86"), 0.0, 0.38)
LAMINATE = Material("grey laminate", _hex("8e9497"), 0.0, 0.85)
BIRCH = Material("birch edge", _hex("c8a97a"), 0.0, 0.75)

MATERIALS: tuple[Material, ...] = (
    *(ALUMINIUM, GREY, BRIGHT, STEEL),
    *(RUBBER, PLASTIC, PANEL, GREEN, BLUE),
    *(BRASS, LENS, PAD),
    *(PRINT, SERVO),
    *(MELAMINE, RIM, LAMINATE, BIRCH),
)
"""All materials, in the order in which their primitives are written."""
