"""Materials of Wavefront OBJ (MTL): the diffuse colour and the opacity of each.

Source: Alias|Wavefront, MTL material format specification (1995).
"""

from __future__ import annotations

import math

Material = tuple[float, float, float, float]
"""Diffuse colour and opacity 0..1."""

PLAIN: Material = (0.8, 0.8, 0.8, 1.0)
"""A material without a colour."""


def read_mtl(text: str) -> tuple[dict[str, Material], bool]:
    """Return the materials by their names, and whether any has pictures.

    Lines that are no MTL are ignored, because a surface without its colours is still a surface.
    """
    found: dict[str, Material] = {}
    name, has_pictures = None, False
    for line in text.splitlines():
        words = line.partition("#")[0].split()
        if len(words) < 2:
            continue
        kind = words[0].lower()
        if kind == "newmtl":
            name = line.split(None, 1)[1].strip()
            found[name] = PLAIN
        elif name is not None and kind in ("kd", "d", "tr"):
            numbers = _numbers(words[1:])
            red, green, blue, opacity = found[name]
            if kind == "kd" and numbers:
                # A single number stands for grey.
                red, green, blue = numbers[:3] if len(numbers) >= 3 else (numbers[0],) * 3
            elif numbers:
                opacity = numbers[-1] if kind == "d" else 1.0 - numbers[-1]
            found[name] = (red, green, blue, opacity)
        has_pictures |= kind.startswith("map_")
    return found, has_pictures


def _numbers(words: list[str]) -> list[float]:
    """Return the finite numbers among ``words``, such as those after the option -halo."""
    found: list[float] = []
    for word in words:
        try:
            found.append(float(word))
        except ValueError:
            continue
    return [number for number in found if math.isfinite(number)]
