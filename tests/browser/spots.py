"""Places on the links of the arm, which the mouse can take hold of."""

from __future__ import annotations

from typing import NamedTuple

from tests.browser.page import Pixel, ViserPage

SPOTS = """([links, joint]) => {
    const nodes = links.map((each) => katanaScene.node(each));
    const owner = (pixel) => {
        const hit = katanaScene.pick(pixel, ["/arm", "/cup", "/basin", "/table"]);
        let each = hit?.object;
        while (each && !nodes.includes(each)) each = each.parent;
        return each === nodes[joint] ? hit.point : null;
    };
    const { width, height } = katanaScene.viewer().canvas.getBoundingClientRect();
    const grid = new Map();
    const step = Math.max(5, width / 90);
    for (let x = step; x < width - step; x += step)
        for (let y = step; y < height - step; y += step) {
            const point = owner([x, y]);
            const local = point && nodes[joint].worldToLocal(point);
            if (point) grid.set(`${x},${y}`, { pixel: [x, y], point: local });
        }
    const beside = [[step, 0], [-step, 0], [0, step], [0, -step]];
    const inside = [...grid.values()].filter(({ pixel: [x, y] }) =>
        beside.every(([a, b]) => grid.has(`${x + a},${y + b}`)));
    const far = inside.sort((a, b) => b.point.length() - a.point.length())[0];
    return far ? { pixel: far.pixel, point: far.point.toArray() } : null;
}"""
"""Finds a place on a link that no other part covers."""


class Spot(NamedTuple):
    """A visible place on a link: the pixel, and the point [m] in the link's own frame."""

    pixel: Pixel
    point: tuple[float, float, float]


def spot(page: ViserPage, links: list[str], joint: int) -> Spot:
    """Return the place of the link that is farthest from its axis, and not at its edge."""
    page.wait_drawn()
    places = page.frame.evaluate(SPOTS, [links, joint])
    assert places is not None, f"{links[joint]} is not in the picture"
    box = page.page.locator("#scene").bounding_box()
    assert box is not None
    x, y = places["pixel"]
    return Spot((box["x"] + x, box["y"] + y), tuple(places["point"]))


def seen_at(page: ViserPage, link: str, place: Spot) -> Pixel:
    """Return the pixel where ``place`` of a link is now."""
    return page.project((page.node_pose(link) @ [*place.point, 1.0])[:3])
