"""Checks of what is seen: arm and gizmo in the picture, contrasts, boxes that overlap."""

from __future__ import annotations

import math
from typing import Any

from playwright.sync_api import FloatRect

from tests.browser.page import ViserPage

SHOWN = """() => {
    // Each vertex of the arm and of the gizmo, as the camera sees it: pixels of viser's document.
    const { camera, canvas, nodeRefFromName } = __viserMutable;
    const { left, top, width, height } = canvas.getBoundingClientRect();
    camera.updateMatrixWorld();
    const found = [];
    for (const name of ["/arm", "/target/move"])
        nodeRefFromName[name].traverseVisible((object) => {
            const attributes = object.geometry?.attributes;
            const vertices = attributes?.instanceStart ?? attributes?.position;
            if (!vertices) return;
            object.updateWorldMatrix(true, false);
            const step = Math.ceil(vertices.count / 200);
            for (let i = 0; i < vertices.count; i += step) {
                const point = camera.position.clone()
                    .set(vertices.getX(i), vertices.getY(i), vertices.getZ(i))
                    .applyMatrix4(object.matrixWorld).project(camera);
                found.push([left + (1 + point.x) / 2 * width, top + (1 - point.y) / 2 * height]);
            }
        });
    const outermost = [0, 1].flatMap((axis) => [Math.min, Math.max].map((pick) =>
        found.reduce((a, b) => pick(a[axis], b[axis]) === a[axis] ? a : b)));
    const uncovered = outermost.every(([x, y]) => document.elementFromPoint(x, y) === canvas);
    return { outermost, uncovered, canvas: [left, top, width, height], count: found.length };
}"""


def shown(page: ViserPage) -> dict[str, Any]:
    page.wait_drawn()
    sight: dict[str, Any] = page.frame.evaluate(SHOWN)
    return sight


def whole(page: ViserPage) -> bool:
    """Return whether arm and gizmo are in the picture and not covered by either document."""
    sight = shown(page)
    assert sight["count"] > 1000
    left, top, width, height = sight["canvas"]
    frame = page.frame.frame_element().bounding_box()
    assert frame is not None
    window = page.page.viewport_size
    assert window is not None
    for x, y in sight["outermost"]:
        if not (left < x < left + width and top < y < top + height):
            return False
        place = [frame["x"] + x, frame["y"] + y]
        if not (0 < place[0] < window["width"] and 0 < place[1] < window["height"]):
            return False
        if page.page.evaluate("(at) => document.elementFromPoint(...at)?.id", place) != "scene":
            return False
    return bool(sight["uncovered"])


def wait_whole(page: ViserPage, what: str) -> None:
    page.wait_until(lambda: whole(page), f"arm and gizmo in the picture {what}", seconds=15.0)
    # The state must last.
    page.page.wait_for_timeout(200)
    assert whole(page), what


def contrast(one: str, other: str) -> float:
    """Return the contrast ratio (WCAG 2.2) of two colours in CSS notation."""

    def luminance(colour: str) -> float:
        parts = [int(part) / 255 for part in colour[4:-1].split(",")]
        linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in parts]
        return math.fsum(k * c for k, c in zip((0.2126, 0.7152, 0.0722), linear, strict=True))

    low, high = sorted(map(luminance, (one, other)))
    return (high + 0.05) / (low + 0.05)


def overlap(box: FloatRect, x: float, y: float, width: float, height: float) -> bool:
    """Return whether a box and a rectangle overlap."""
    across = min(box["x"] + box["width"], x + width) - max(box["x"], x)
    return across > 0 and min(box["y"] + box["height"], y + height) > max(box["y"], y)
