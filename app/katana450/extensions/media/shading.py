"""Light from a surface to the camera: glTF's metallic-roughness model under the room's lights.

Diffuse reflection follows Lambert. Specular reflection uses the microfacets of Trowbridge and Reitz
(GGX), with Schlick's Fresnel term and the joint shadowing of Hammon, PBR Diffuse Lighting for
GGX+Smith Microsurfaces, 2017. The mirrored room is a sky and two soft boxes as spherical Gaussians,
which widen with roughness. Its intensity follows Karis, Physically Based Shading on Mobile, 2014.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from katana450.extensions.media.light import Light
from katana450.extensions.media.scene import Floats, light_of, unit


class Lamp(NamedTuple):
    """A distant light.

    Attributes:
        towards: (3,) unit direction to it.
        colour: (3,) light from a white surface perpendicular to it.
    """

    towards: Floats
    colour: Floats


def lamp(position: tuple[float, float, float], rgb: tuple[int, int, int], power: float) -> Lamp:
    """Return a lamp at ``position``, directed to the base. ``rgb`` is its colour, 0 to 255."""
    return Lamp(unit(np.array(position)), power * light_of(np.array(rgb, dtype=np.float32) / 255.0))


class SurfaceMaterial(NamedTuple):
    """The material of n points: linear colour (n, 3), metallic and rough (n,), glTF's factors."""

    colour: Floats
    metallic: Floats
    rough: Floats


DIELECTRIC = 0.04
"""Reflectance of non-metals at perpendicular incidence."""

ZENITH, HORIZON = 1.35, 1.05
"""Brightness of the mirrored sky, relative to a white surface."""

BOUNCED = 0.35
"""[1] Fraction of the sky's light from below and from surfaces that hide it."""

BOXES = (
    ((0.5, -0.75, 0.8), 1.5, 9.0),
    ((-0.7, 0.75, 0.65), 0.9, 6.0),
)
"""Direction, brightness and sharpness of the edge of each mirrored soft box."""


def shaded(
    material: SurfaceMaterial,
    normals: Floats,
    directions: Floats,
    light: Light,
    lamps: tuple[Lamp, ...],
) -> Floats:
    """Return the light (n, 3). ``directions`` (n, 3) are of the camera rays; lamp 0 has shadows."""
    view = -directions
    facing = np.maximum(_dot(normals, view), 1e-3)
    metal = material.metallic[:, None]
    f0 = DIELECTRIC * (1.0 - metal) + material.colour * metal
    flat = material.colour * (1.0 - metal)
    alpha = np.maximum(material.rough, 0.05) ** 2
    total = np.zeros_like(normals)
    for number, each in enumerate(lamps):
        towards = np.maximum(normals @ each.towards, 0.0)
        if number == 0:
            towards = towards * light.key
        half = unit(view + each.towards)
        peak = _microfacets(np.maximum(_dot(normals, half), 0.0), facing, towards, alpha)
        fresnel = f0 + (1.0 - f0) * ((1.0 - np.maximum(_dot(half, view), 0.0)) ** 5)[:, None]
        sent = flat * (1.0 - fresnel) + fresnel * peak[:, None]
        total += sent * towards[:, None] * each.colour
    sky, up = light.sky, 0.5 + 0.5 * normals[:, 2]
    dome = sky * (BOUNCED + (0.92 - BOUNCED) * up) + (1.0 - sky) * 0.5 * BOUNCED
    mirrored = np.asarray(2.0 * facing[:, None] * normals - view, dtype=np.float32)
    seen = _room(mirrored, material.rough) * (0.25 + 0.75 * sky)
    fraction, rest = _karis(material.rough, facing)
    total += SKY * (flat * dome[:, None] + (f0 * fraction[:, None] + rest[:, None]) * seen[:, None])
    return total.astype(np.float32)


SKY = 1.0
"""Intensity of the sky relative to the lamps."""


def _microfacets(half: Floats, facing: Floats, towards: Floats, alpha: Floats) -> Floats:
    """Return (n,) pi times the specular reflection of a lamp, without the Fresnel factor."""
    square = alpha * alpha
    spread = square / (half * half * (square - 1.0) + 1.0) ** 2
    hidden = (1.0 - alpha) * 2.0 * towards * facing + alpha * (towards + facing)
    found = np.minimum(spread * 0.5 / np.maximum(hidden, 1e-3), MAX_GLINT)
    return np.asarray(found, dtype=np.float32)


MAX_GLINT = 6.0
"""Maximum of a highlight; larger values would only make edges rough."""


def _room(r: Floats, rough: Floats) -> Floats:
    """Return the brightness (n,) of the room in directions (n, 3), blurred by roughness."""
    edge = 6.0 / (0.15 + rough)
    up = 1.0 / (1.0 + np.exp(-np.clip(edge * r[:, 2], -30.0, 30.0)))
    sky = HORIZON + (ZENITH - HORIZON) * np.maximum(r[:, 2], 0.0)
    found = BOUNCED + (sky - BOUNCED) * up
    for towards, bright, sharp in BOXES:
        wide = sharp / (1.0 + 6.0 * rough * rough)
        along = r @ unit(np.array(towards)) - 1.0
        found = found + bright * (wide / sharp) ** 0.5 * np.exp(wide * along)
    return np.asarray(found, dtype=np.float32)


def _karis(rough: Floats, facing: Floats) -> tuple[Floats, Floats]:
    """Return factor and offset (n,) of the environment reflection."""
    r = 1.0 - rough
    steep = np.minimum(r * r, np.exp2(-9.28 * facing)) * r + (0.0425 - 0.0275 * rough)
    return -1.04 * steep + (1.04 - 0.572 * rough), 1.04 * steep + (0.022 * rough - 0.04)


def _dot(a: Floats, b: Floats) -> Floats:
    return np.asarray(np.einsum("ni,ni->n", a, b), dtype=np.float32)


def developed(light: Floats) -> Floats:
    """Return light as sRGB 0..1: unchanged up to the shoulder, then softly up to white."""
    over = np.maximum(light - SHOULDER, 0.0) / (1.0 - SHOULDER)
    soft = SHOULDER + (1.0 - SHOULDER) * (1.0 - np.exp(-over))
    x = np.clip(np.where(light > SHOULDER, soft, light), 0.0, 1.0)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1.0 / 2.4) - 0.055).astype(np.float32)


SHOULDER = 0.75
"""Linear value above which highlights are compressed."""
