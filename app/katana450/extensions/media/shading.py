"""What a surface sends to the camera: glTF's metallic-roughness model under the room's lights.

Diffuse by Lambert; mirrored by the microfacets of Trowbridge and Reitz (GGX), with Schlick's
Fresnel and the joint shadowing of Hammon, PBR Diffuse Lighting for GGX+Smith Microsurfaces, 2017.
What the room mirrors is a sky and two soft boxes as spherical Gaussians, which widen with
roughness; how much of it, is Karis's fit, Physically Based Shading on Mobile, 2014.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from katana450.extensions.media.light import Light
from katana450.extensions.media.scene import Floats, light_of, unit


class Lamp(NamedTuple):
    """A light far off. towards: (3,) unit. colour: (3,) what a white surface square to it sends."""

    towards: Floats
    colour: Floats


def lamp(position: tuple[float, float, float], rgb: tuple[int, int, int], power: float) -> Lamp:
    """Shining from ``position`` towards the base; rgb: of 255."""
    return Lamp(unit(np.array(position)), power * light_of(np.array(rgb, dtype=np.float32) / 255.0))


class SurfaceMaterial(NamedTuple):
    """Of n points: colour (n, 3) of light, metallic and rough (n,), glTF's factors."""

    colour: Floats
    metallic: Floats
    rough: Floats


DIELECTRIC = 0.04
"""What anything but metal mirrors, looked at straight."""

ZENITH, HORIZON = 1.35, 1.05
"""How bright the sky is that surfaces mirror, as a white surface."""

BOUNCED = 0.35
"""Of the sky, from below and from what hides it."""

BOXES = (
    ((0.5, -0.75, 0.8), 1.5, 9.0),
    ((-0.7, 0.75, 0.65), 0.9, 6.0),
)
"""Towards it, how bright, and how sharp its edge, of each soft box that surfaces mirror."""


def shaded(
    material: SurfaceMaterial,
    normals: Floats,
    directions: Floats,
    light: Light,
    lamps: tuple[Lamp, ...],
) -> Floats:
    """(n, 3) light. directions: (n, 3) of the rays that see it. The first lamp has shadows."""
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
"""How much the sky gives beside the lamps."""


def _microfacets(half: Floats, facing: Floats, towards: Floats, alpha: Floats) -> Floats:
    """(n,) pi times what is mirrored of a lamp with Fresnel's share left out."""
    square = alpha * alpha
    spread = square / (half * half * (square - 1.0) + 1.0) ** 2
    hidden = (1.0 - alpha) * 2.0 * towards * facing + alpha * (towards + facing)
    found = np.minimum(spread * 0.5 / np.maximum(hidden, 1e-3), MAX_GLINT)
    return np.asarray(found, dtype=np.float32)


MAX_GLINT = 6.0
"""Of a glint: more would only make edges rough."""


def _room(r: Floats, rough: Floats) -> Floats:
    """(n,) how bright the room is in directions (n, 3), blurred as rough surfaces do."""
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
    r = 1.0 - rough
    steep = np.minimum(r * r, np.exp2(-9.28 * facing)) * r + (0.0425 - 0.0275 * rough)
    return -1.04 * steep + (1.04 - 0.572 * rough), 1.04 * steep + (0.022 * rough - 0.04)


def _dot(a: Floats, b: Floats) -> Floats:
    return np.asarray(np.einsum("ni,ni->n", a, b), dtype=np.float32)


def developed(light: Floats) -> Floats:
    """SRGB 0..1 of light: as it is up to the shoulder, then softly up to white."""
    over = np.maximum(light - SHOULDER, 0.0) / (1.0 - SHOULDER)
    soft = SHOULDER + (1.0 - SHOULDER) * (1.0 - np.exp(-over))
    x = np.clip(np.where(light > SHOULDER, soft, light), 0.0, 1.0)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1.0 / 2.4) - 0.055).astype(np.float32)


SHOULDER = 0.75
